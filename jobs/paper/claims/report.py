"""Format the answers as tables: for people, in Markdown, as JSON."""

import json
import textwrap

from claims.data import Claim

WIDTH = 100


def in_order(claims: list[Claim]) -> list[Claim]:
    """Sort claims by number."""
    return sorted(claims, key=lambda claim: claim.number)


def as_text(answers: dict[str, list[Claim]]) -> str:
    """Format the answers for people."""
    lines = []
    for variant, claims in answers.items():
        lines += [f"damping: {variant}", ""]
        for claim in in_order(claims):
            lines.append(f"  {claim.number:<3} {claim.verdict.value:<12} {claim.text}")
            lines += textwrap.wrap(
                claim.finding, WIDTH, initial_indent=" " * 19, subsequent_indent=" " * 19
            )
        lines.append("")
    return "\n".join(lines).rstrip()


def as_json(answers: dict[str, list[Claim]]) -> str:
    """Format the answers as JSON: damping to a list of claims."""
    return json.dumps(
        {
            variant: [
                {
                    "number": claim.number,
                    "claim": claim.text,
                    "verdict": claim.verdict.value,
                    "finding": claim.finding,
                }
                for claim in in_order(claims)
            ]
            for variant, claims in answers.items()
        },
        indent=1,
    )


def as_markdown(answers: dict[str, list[Claim]]) -> str:
    """Format the answers as one Markdown table, verdict and numbers for each damping."""
    variants = list(answers)
    rows: dict[str, tuple[str, dict[str, str]]] = {}
    for variant, claims in answers.items():
        for claim in claims:
            cell = f"**{claim.verdict.value}**: {claim.finding}"
            rows.setdefault(claim.number, (claim.text, {}))[1][variant] = cell.replace("|", "\\|")
    lines = [
        "| | claim | " + " | ".join(f"damping: {variant}" for variant in variants) + " |",
        "|---|---|" + "---|" * len(variants),
    ]
    for number in sorted(rows):
        text, cells = rows[number]
        answer = " | ".join(cells.get(variant, "") for variant in variants)
        lines.append(f"| {number} | {text} | {answer} |")
    return "\n".join(lines)
