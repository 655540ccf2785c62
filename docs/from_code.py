"""Pages of the reference that are made from the code: they need no other source."""

import argparse
import contextlib
import io
import os
import re
import tomllib
from pathlib import Path

from hpcsweep.commands.cli import build_parser
from hpcsweep.job import JobError, load_job
from hpcsweep.job import template as job_template
from hpcsweep.job.keys import declared, every_key, keys_of
from hpcsweep.job.tree import resolve
from hpcsweep.model.unit_names import GAPS
from hpcsweep.studies.kinds import KINDS
from hpcsweep.studies.quantities import MEASURES
from hpcsweep.studies.refine.growth import MapGrowth

ROOT = Path(__file__).resolve().parents[1]
ALL = [f"output.{name} = true" for name in (*MEASURES, "lyapunov", "times", "alone")]
"""Settings with which a file holds whatever it can."""
REFINED = "study.refine = {levels = 2}"
JOB_KEYS = """\
# Keys of a job

A job is a TOML file; `hpcsweep new study.toml` writes [a commented one](./template.md).
[Describe a structure](structures.md) and [choose a study](studies.md) introduce the keys by task.
This table is made from the code. A key goes with every kind of study unless its meaning names some.

Where several numbers may stand, they are a list, or a range with both ends included:
`{from = 0.1, to = 0.4, count = 31}` or `{from = 0.1, to = 0.4, step = 0.01}`. Lengths are in gaps
and times in 1/omega_0, unless a job gives masses, stiffnesses and gaps of its own.

A mistake in a job is one line that names file, key, value and limit; nothing is then written.
"""
EXTENDS = (
    "| `extends` | another job file, of which this one gives what differs "
    "([how](studies.md#jobs-made-of-other-jobs)) | |\n"
)
NOTES = {
    "attractors": """\
Empty slots have `attractor_id` 0. `contact`, `drift` and `modal_norm` are those of the orbit, or of
2,000 periods. `point`, the last of `poincare`, is the seed at the next amplitude. `outcome` is 2 to
4 only where all starts failed.
[What shares and identities mean](../attractors.md#what-a-share-is-a-share-of).
""",
    "basins": """\
A run is a row of starts. Every row lists the same attractors, which are
[found before](../attractors.md#basins). `ordinate` is the second component of the slice.
`n_undecided`, `n_failed` and `n_elsewhere` count the labels -1, -2 and -3. With `study.refine` a
run is one start; the attractors, without `hits`, are 0 or NaN until the map is complete.
""",
    "records": """\
A run is a record at a scale; `factor` multiplies the record. Peaks are over continuous time, to the
end of the tail. `output.history` adds the motion itself, `output.times` the times of the peaks,
`output.alone` those without contacts and `gap_needed`, or of the elastic motion of what has none.
`skip_rule` is 1 below first contact.
""",
    "branches": """\
A run is a line. Points of all branches follow each other along `step`, special points along
`special`; 0 or NaN fills the rest. `omega` or `forcing_amplitude` is NaN where it is the parameter.
`point` is one stroboscopic point of the orbit. `seed_reason` is 0 where a seed lies on a branch.
`special_step` is the step after a special point, of a fold its own. With `branches.curves` points
of curves follow each other along `curve_step`, where they end and meet along `meeting`;
`special_curve` is 0 where no curve was found or asked for, `curve_unstable` counts multipliers.
""",
}
"""What the tables of a kind of study do not say."""
TYPES = {"<f8": "float64", "<i4": "int32", "<i1": "int8", "<u8": "uint64"}


def pages() -> dict[str, str]:
    """Return the text of each page by its name."""
    return {
        "command-line": command_line(),
        "job-keys": job_keys(),
        "template": template(),
        "variables": variables(),
    }


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
        "# A commented job\n\n`hpcsweep new study.toml` writes it; every key is explained in\n"
        f"[keys of a job](job-keys.md).\n\n```toml\n{job_template.template()}```\n"
    )


def job_keys() -> str:
    """Return tables of all keys of a job: meaning, with the kinds of study, and default."""
    tables: dict[str, dict[str, str]] = {"job": {"extends": EXTENDS}}
    for study in KINDS.values():
        for table, keys in declared(study).items():
            for key in keys:
                if key.description:
                    name = f"{table}.{key.name}" if table else key.name
                    default = key.told or (f"`{key.shown}`" if key.shown else "")
                    row = f"`{name}`", _kinds(name) + key.description, default
                    tables.setdefault(table or "job", {})[name] = f"| {' | '.join(row)} |\n"
    parts = [JOB_KEYS]
    head = "| key | meaning | default |\n|---|---|---|\n"
    parts += [f"## {table}\n\n{head}{''.join(rows.values())}" for table, rows in tables.items()]
    return re.sub(r"\]\((?=[a-z])", "](../", "\n".join(parts))


def _kinds(key: str) -> str:
    """Return the kinds of study that a key goes with; nothing where it goes with all."""
    table, name = key.split(".")[:2] if "." in key else (key, "")
    own = [kind for kind, study in KINDS.items() if name in ("", *keys_of(study).get(table, ()))]
    others = [kind for kind in KINDS if kind not in own]
    if len(others) == 1:
        return f"*not for {others[0]}:* "
    return f"*for {', '.join(own)}:* " if others and own != [table] else ""


def variables() -> str:
    """Return tables of the dimensions and variables of a results file, for each kind of study."""
    parts = [
        "# Variables of a results file\n\nMade from the code, as the file holds them where all of "
        "`[output]` is asked for. Units are those of the building\nof the paper. "
        "[The results file](../file-format.md) says what the rest means.\n"
    ]
    known: dict[tuple[str, ...], str] = {}
    for kind, (plain, refined) in examples().items():
        rows = _rows(plain)
        parts += [f"## `{kind}`\n", *([NOTES[kind]] if kind in NOTES else [])]
        parts.append(f"A run has the dimensions {', '.join(f'`{d}`' for d in plain.run_dims)}.\n")
        parts.append("| dimension | unit | coordinate |\n|---|---|---|")
        for name, (_, units, long_name) in plain.coordinates.items():
            parts.append(f"| `{name}` | {_unit(units)} | {long_name} |")
        if rows in known:
            parts.append(f"\nThe variables are those of `{known[rows]}`.\n")
        else:
            parts.append(f"\n{_table(rows)}")
        known.setdefault(rows, kind)
        if refined is not None:
            derived = MapGrowth(refined, refined.refine).variables
            more = tuple(_row(variable, refined.run_dims) for variable in derived)
            parts.append(f"\nWith `study.refine` there are also\n\n{_table(more)}")
    return "\n".join(parts)


def _table(rows: tuple[str, ...]) -> str:
    head = "| variable | dimensions beside those of a run | type | unit | meaning |"
    return "\n".join((head, "|---|---|---|---|---|", *rows, ""))


def _rows(study) -> tuple[str, ...]:
    return tuple(_row(variable, study.run_dims) for variable in _held(study))


def examples() -> dict[str, tuple]:
    """Return for each kind of study that of a job in `jobs`, with all outputs, and it refined.

    Jobs that vary keys are passed over: a thousand parts take seconds to read.
    """
    fullest: dict[str, tuple[int, int, Path]] = {}
    for path in sorted((ROOT / "jobs").rglob("*.toml")):
        if "vary" in tomllib.loads(resolve(path, (), every_key)[0]):
            continue
        study = load_job(path).study
        fullest[study.kind] = max(
            fullest.get(study.kind, (-1, 0, path)), (len(_held(study)), study.n_runs, path)
        )
    return {kind: _with_all(fullest[kind][2]) for kind in KINDS}


def _with_all(path: Path) -> tuple:
    """Return the study of a job with all outputs, and it refined; None where that cannot be."""
    settings = _accepted(path, ALL)
    refined = _accepted(path, [*settings, REFINED])
    more = load_job(path, refined).study if len(refined) > len(settings) else None
    return load_job(path, settings).study, more


def _accepted(path: Path, settings: list[str]) -> list[str]:
    """Return those of some settings that a job may have."""
    accepted: list[str] = []
    for setting in settings:
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
