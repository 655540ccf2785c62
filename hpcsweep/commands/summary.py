"""`hpcsweep summary`: the numbers of a whole study."""

import json
import math
from pathlib import Path

from hpcsweep.commands.status import inferred_text
from hpcsweep.figures.options import whole_number
from hpcsweep.studies.run_names import count

SUMMARY = "summarise studies: cost, kinds of motion"
HELP = """\
Summarise studies: what they cost, how much work was spared, what shares of the runs are periodic,
chaotic, quasi-periodic or undecided, and which contact sets occur. Files may be larger than the
memory. To see the progress alone, `hpcsweep status` is quicker."""
MAX_ROWS = 16
"""Most orbit periods, and most contact sets, that are listed one by one."""


def configure(parser) -> None:
    """Add the options of the command."""
    parser.add_argument("files", type=Path, nargs="+", metavar="FILE")
    form = parser.add_mutually_exclusive_group()
    form.add_argument("--json", action="store_true", help="machine-readable")
    form.add_argument(
        "--markdown", action="store_true", help="a Markdown table with a column for each file"
    )
    parser.add_argument(
        "--transients",
        type=whole_number(1),
        metavar="N",
        help="continue N chaotic runs of each file, drawn at random, by 10,000 forcing periods, "
        "and say what share of chaos outlives them",
    )


def run(options) -> int:
    """Run the command."""
    from hpcsweep.campaign.summary import summarize

    found = [summarize(path) for path in options.files]
    if options.transients:
        from hpcsweep.checks.transients import outliving

        for summary in found:
            summary["transients"] = outliving(summary["file"], options.transients)
    if options.json:
        print(json.dumps(found, indent=1))
    elif options.markdown:
        print(_markdown(found))
    else:
        print("\n\n".join(_text(summary) for summary in found))
    return 0


def _text(summary: dict) -> str:
    rows = _rows(summary, [summary])
    width = max(len(name) for name in rows)
    return "\n".join([summary["file"], *(f"  {name:<{width}}  {rows[name]}" for name in rows)])


def _markdown(summaries: list[dict]) -> str:
    columns = [_rows(summary, summaries) for summary in summaries]
    names = dict.fromkeys(name for rows in columns for name in rows)
    lines = [
        "| | " + " | ".join(summary["name"] for summary in summaries) + " |",
        "|---|" + "---|" * len(summaries),
    ]
    lines += [
        f"| {name} | " + " | ".join(rows.get(name, "–") for rows in columns) + " |"
        for name in names
    ]
    return "\n".join(lines)


def _rows(summary: dict, together: list[dict]) -> dict[str, str]:
    """Return name and value of every line of a table, for summaries shown together."""
    vary = [f"{key} {_values(values)}" for key, values in summary["vary"].items()]
    rows = {
        "structure": summary["structure"] + (" (the first)" if vary else ""),
        **({"varied": "; ".join(vary)} if vary else {}),
        f"{_noun(summary)}s": f"{summary['runs_done']} of {summary['runs_total']}{_grid(summary)}",
        **_inferred_rows(summary),
        **_cost_rows(summary),
    }
    rows |= _own_rows(summary)
    rows["file"] = (
        f"{summary['file_bytes'] / 1e9:.4g} GB, {summary['disk_bytes'] / 1e9:.4g} GB on disk"
    )
    if "measure" not in summary:
        rows |= _motion_rows(summary, together)
    for name, most in summary["largest"].items():
        units = "" if most["units"] == "1" else f" {most['units']}"
        rows[f"largest {name}"] = f"{most['value']:.4g}{units} ({most['of']}, {_where(most)})"
    failures = [f"{name} {count}" for name, count in summary["failures"].items() if count]
    rows["failures"] = ", ".join(failures) or "0"
    return rows


def _own_rows(summary: dict) -> dict[str, str]:
    """Format the lines of only one kind of study."""
    if "measure" in summary:
        return _record_rows(summary)
    if "branches" in summary:
        return _branch_rows(summary)
    return _attractor_rows(summary) if "attractors" in summary else _history_rows(summary)


def _where(most: dict) -> str:
    """Write where the largest value of a measure is."""
    if "record" in most:
        part = f"{most['part']}, " if most["part"] else ""
        return f"{part}{most['record']}, scale {most['scale']:.6g}"
    return f"A = {most['amplitude']:.6g}, Omega = {most['omega']:.6g}"


def _record_rows(summary: dict) -> dict[str, str]:
    rows = {"scaled by": summary["measure"]}
    for key, name in (
        ("below_contact", "below first contact"),
        ("equal_ratio", "of equal ratio"),
        ("with_contact", "with contact"),
    ):
        rows[name] = _share(summary[key])
    return rows


def _motion_rows(summary: dict, together: list[dict]) -> dict[str, str]:
    """Write the shares of kinds of motion, periods and contact sets."""
    rows = {}
    directions = summary.get("by_direction", {})
    for name, entry in summary["classes"].items():
        rows[name] = _share(entry)
        if len(directions) > 1 and entry["runs"]:
            parts = [f"{d} {_percent(kinds[name]['share'])}" for d, kinds in directions.items()]
            rows[name] += f": {', '.join(parts)}"
    if summary["classes"] and not summary["tells_chaos"]:
        rows["chaotic"] = "not told: the file holds neither motion nor lyapunov"
    if (later := summary.get("transients")) and later["share"] is not None:
        rows["chaos that lasts"] = (
            f"{_percent(later['share'])} of chaotic runs outlive {later['periods']} more periods "
            f"({later['outlive']} of {later['samples']} drawn, {later['undecided']} undecided; "
            f"95 %: {_percent(later['low'])} to {_percent(later['high'])})"
        )
        mean, low, high = (math.inf if x is None else x for x in later["lifetime"])
        rows["lifetime of chaos"] = f"{mean:.4g} periods (95 %: {low:.4g} to {high:.4g})"
    window = summary.get("window_test")
    if window and window["runs"]:
        rows["window test"] = (
            f"of {window['runs']} windows it claims {window['wrong']} wrong periods and misses "
            f"{window['missed']}"
        )
    for key, label in (("periods", "P{}"), ("contact_sets", "contact {}")):
        for name in _listed(key, together):
            entry = summary[key].get(name)
            rows[label.format(name)] = _share(entry) if entry else "0"
    return rows


def _inferred_rows(summary: dict) -> dict[str, str]:
    if "audit" not in summary:
        return {}
    share = summary["runs_inferred"] / summary["runs_total"]
    share_text = inferred_text(summary["runs_inferred"], summary["audit"])
    of = "all of these" if "basins" in summary else "runs"
    return {"inferred": f"{_percent(share)} of the map, {share_text}; all shares below are of {of}"}


def _noun(summary: dict) -> str:
    """Return the noun for a run of a study."""
    if "basins" in summary and "audit" in summary:
        return "start"
    for key, noun in (("basins", "row"), ("branches", "line")):
        if key in summary:
            return noun
    return "point" if "attractors" in summary else "run"


def _grid(summary: dict) -> str:
    """Format the frames and amplitudes of the runs, or the point of a slice."""
    if "basins" in summary or "branches" in summary:
        return ""
    if "measure" in summary:
        return f" ({count(summary['records'], 'record')} x {count(summary['scales'], 'scale')})"
    frames, amplitudes = (
        count(summary["frames"], "frame"),
        count(summary["amplitudes"], "amplitude"),
    )
    return f" ({frames} x {amplitudes}, {' and '.join(summary['directions'])})"


def _history_rows(summary: dict) -> dict[str, str]:
    rows = {}
    if summary["runs_done"]:
        rows["periods per run"] = (
            f"{summary['periods_per_run']:.4g} integrated, of {summary['periods_per_run_window']}"
        )
    return rows | {
        f"skip rule {name}": _share(entry)
        for name, entry in summary["skip_rules"].items()
        if name != "none"
    }


def _attractor_rows(summary: dict) -> dict[str, str]:
    if not summary["runs_done"]:
        return {}
    noun = _noun(summary)
    rows = {
        f"periods per {noun}": f"{summary['periods_per_run']:.4g} integrated, "
        f"{summary['periods_per_start']:.4g} a start"
    }
    for number, entry in summary["numbers"].items():
        rows[f"points with {count(number, 'attractor')}"] = _share(entry)
    if noun != "start":
        rows["starts"] = str(summary["starts"])
    for name in ("undecided", "failed", "elsewhere"):
        rows[f"starts {name}"] = _share(summary[f"starts_{name}"])
    rows["attractors"] = str(summary["attractors"])
    for number, entry in summary.get("basins", {}).items():
        rows[f"starts to {number}, {entry['name']}"] = _share(entry)
    return rows


def _branch_rows(summary: dict) -> dict[str, str]:
    rows = {
        "parameter": summary["parameter"],
        "branches": str(summary["branches"]),
        **{f"branches by {name}": _share(entry) for name, entry in summary["sources"].items()},
        "points": str(summary["points"]),
        "points stable": _share(summary["points_stable"]),
    }
    rows |= {f"points of {name}": str(n) for name, n in summary["special_points"].items()}
    if "curves" in summary:
        told = summary["curves"]
        rows["curves"] = f"{told['curves']}, {told['points']} points"
        rows["special points on a curve"] = _share(told["followed"])
        rows["meetings"] = ", ".join(f"{k} {n}" for k, n in told["meetings"].items() if n) or "0"
    rows["seeds"] = (
        f"{summary['seeds']}, and {summary['motions_not_periodic']} motions not periodic"
    )
    rows["seeds on a branch"] = _share(summary["seeds_covered"])
    missed = summary["seeds_missed"]
    for k, one in enumerate(missed[:MAX_ROWS]):
        rows[f"seed {k + 1} on none"] = (
            f"{one['line']}, {summary['parameter']} = {one['value']:.8g}, P{one['period']}: "
            f"{one['reason']}"
        )
    if len(missed) > MAX_ROWS:
        rows["more seeds on none"] = str(len(missed) - MAX_ROWS)
    return rows


def _cost_rows(summary: dict) -> dict[str, str]:
    cost = summary["cost"]
    if cost is None:
        return {"cost": "not known: no journal beside the file"}
    ranks = " or ".join(str(count) for count in cost["ranks"])
    ranks += " rank" if cost["ranks"] == [1] else " ranks"
    pieces = f" in {cost['sessions']} sessions" if cost["sessions"] > 1 else ""
    rows = {
        "wall time": f"{cost['wall_seconds']:.4g} s{pieces} on {ranks}",
        "core seconds": f"{cost['core_seconds']:.4g} s",
    }
    for name, key in (
        (f"{_noun(summary)}s per second", "runs_per_second"),
        (f"{_noun(summary)}s per core second", "runs_per_core_second"),
    ):
        if cost[key] is not None:
            rows[name] = f"{cost[key]:.4g}"
    return rows


def _listed(key: str, together: list[dict]) -> list:
    """Return the most frequent names of all summaries: periods in order, sets by frequency."""
    total: dict = {}
    for summary in together:
        for name, entry in summary[key].items():
            total[name] = total.get(name, 0) + entry["runs"]
    chosen = sorted(total, key=lambda name: -total[name])[:MAX_ROWS]
    return sorted(chosen) if key == "periods" else chosen


def _values(values: list) -> str:
    """Format the values of a key; only the ends of many."""
    words = [f"{one:.6g}" if isinstance(one, int | float) else one for one in values]
    if len(words) <= 3:
        return ", ".join(words)
    return f"{words[0]} to {words[-1]} ({len(words)} values)"


def _share(entry: dict) -> str:
    return f"{entry['runs']} ({_percent(entry['share'])})"


def _percent(share: float | None) -> str:
    return "–" if share is None else f"{100 * share:.3g} %"
