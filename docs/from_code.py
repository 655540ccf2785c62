"""Pages of the reference that are made from the code: they need no other source."""

import argparse
import contextlib
import io
import os
from collections.abc import Iterator
from pathlib import Path

from hpcsweep.commands.cli import build_parser
from hpcsweep.job import JobError, load_job
from hpcsweep.job.template import TEMPLATE
from hpcsweep.model.unit_names import GAPS
from hpcsweep.studies.kinds import KINDS
from hpcsweep.studies.settings import MEASURES

ROOT = Path(__file__).resolve().parents[1]
ALL = [f"output.{name} = true" for name in (*MEASURES, "lyapunov")]
"""Settings with which a file holds whatever it can."""
TYPES = {"<f8": "float64", "<i4": "int32", "<i1": "int8", "<u8": "uint64"}


def pages() -> dict[str, str]:
    """Return the text of each page by its name."""
    return {"command-line": command_line(), "template": template(), "variables": variables()}


def write(folder: Path) -> None:
    """Write all pages but those that have not changed, which need not be built again."""
    folder.mkdir(exist_ok=True)
    for name, text in pages().items():
        page = folder / f"{name}.md"
        if not page.exists() or page.read_text() != text:
            page.write_text(text)


def command_line() -> str:
    """Return the help of every command."""
    os.environ["COLUMNS"] = "88"
    parser = build_parser()
    (commands,) = (a for a in parser._actions if isinstance(a, argparse._SubParsersAction))
    parts = [
        "# Command line\n\nThe help of every command, as `hpcsweep COMMAND --help` prints it.\n"
    ]
    parts.append(f"```text\n{parser.format_help()}```\n")
    for name in commands.choices:
        parts.append(f"## {name}\n\n```text\n{_help(parser, name)}```\n")
    return "\n".join(parts)


def _help(parser: argparse.ArgumentParser, command: str) -> str:
    """Return what a command prints when asked for help: parts of it are added only then."""
    said = io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.suppress(SystemExit):
        parser.parse_args([command, "--help"])
    return said.getvalue()


def template() -> str:
    """Return the commented job that `hpcsweep new` writes."""
    return (
        "# A commented job\n\n`hpcsweep new study.toml` writes it; every key is explained on\n"
        f"[Job files](../job-files.md).\n\n```toml\n{TEMPLATE}```\n"
    )


def variables() -> str:
    """Return tables of the dimensions and variables of a results file, for each kind of study."""
    parts = [
        "# Variables of a results file\n\nMade from the code, as the file holds them where all of "
        "`[output]` is asked for. Units are those of the building\nof the paper. "
        "[The results file](../file-format.md) says what the rest means.\n"
    ]
    told: dict[tuple[str, ...], str] = {}
    for kind, study in examples():
        rows = tuple(_row(variable, study.run_dims) for variable in _held(study))
        parts.append(f"## `{kind}`\n")
        parts.append(f"A run has the dimensions {', '.join(f'`{d}`' for d in study.run_dims)}.\n")
        parts.append("| dimension | unit | coordinate |\n|---|---|---|")
        for name, (_, units, long_name) in study.coordinates.items():
            parts.append(f"| `{name}` | {_unit(units)} | {long_name} |")
        if rows in told:
            parts.append(f"\nThe variables are those of `{told[rows]}`.\n")
            continue
        told[rows] = kind
        parts.append(
            "\n| variable | dimensions beside those of a run | type | unit | meaning |\n"
            "|---|---|---|---|---|\n" + "\n".join(rows) + "\n"
        )
    return "\n".join(parts)


def examples() -> Iterator[tuple[str, object]]:
    """Yield each kind of study with one of a job in `jobs`, with all outputs that it can have."""
    of_kind: dict[str, object] = {}
    for path in sorted((ROOT / "jobs").rglob("*.toml")):
        kind = load_job(path).study.kind
        if kind not in of_kind:
            of_kind[kind] = load_job(path, _accepted(path)).study
    for kind in KINDS:
        yield kind, of_kind[kind]


def _accepted(path: Path) -> list[str]:
    """Return those of the settings `ALL` that a job may have."""
    accepted: list[str] = []
    for setting in ALL:
        with contextlib.suppress(JobError):
            load_job(path, [*accepted, setting])
            accepted.append(setting)
    return accepted


def _held(study) -> list:
    return [*study.variables, *(variable for variable, _ in study.given), study.commit]


def _row(variable, run_dims: tuple[str, ...]) -> str:
    """Return a variable as a row of a table: of a run's dimensions, all that are further."""
    of_run = variable.dims[: len(run_dims)] == tuple(run_dims)
    dims = variable.dims[len(run_dims) :] if of_run else variable.dims
    listed = ", ".join(f"`{name}`" for name in dims)
    shown = listed if of_run else f"only {listed}"
    type_ = TYPES.get(variable.dtype, variable.dtype)
    units = _unit(variable.units)
    return f"| `{variable.name}` | {shown} | {type_} | {units} | {variable.long_name} |"


def _unit(units: str) -> str:
    """Return units with the names that they have for the building of the paper."""
    return "; ".join(GAPS.get(unit, unit) for unit in units.split("; "))
