"""The commented job that `hpcsweep new` writes, made from the declarations of keys."""

import re
import textwrap
from collections.abc import Iterable, Iterator, Mapping

from hpcsweep.job.job import ABOUT
from hpcsweep.job.keys import declared
from hpcsweep.studies.keys import OMEGA, Key
from hpcsweep.studies.kinds import DEFAULT_KIND, KINDS

HEAD = """\
# A job of hpcsweep: TOML. It is complete, and takes seconds:
#     mpirun -n 2 hpcsweep run FILE.toml       computes FILE.h5; hpcsweep run FILE.toml works too
#     hpcsweep plot FILE.h5 -o FILE.png        draws it
#     hpcsweep run FILE.toml --dry-run         predicts the cost of a larger one
#
# A key behind a # has its default, which is shown; remove the # to give it another value.
#
{}
# Another job, whose path is relative to this file: what is given here replaces what is there.
#extends = "other.toml"
"""
IN_GAPS = """\
# Lengths are in gaps, from a floor at rest to the stop, so that the stop is at 1. Time is in
# 1/omega_0, where omega_0 = sqrt(k/m) of one storey. With u the floors' displacements
#
#     u'' + 2 gamma C u' + K u + beta S(u) (u - 1) = -A sin(Omega tau)
"""
SEEDS = """\
# It begins at the motions of study.h5: hpcsweep new study.toml, hpcsweep run study.toml.
#
"""
IN_OWN = """\
# Quantities are in any consistent units, here in m, kg and s.
"""
BUILDINGS = """\
[[building]]
name = "A"
mass = [2.5e5, 2.5e5, 2.0e5]
storey_stiffness = [3e8, 3e8, 2e8]
storey_height = 3.2

[[building]]
name = "B"
mass = [2.5e5, 2.5e5, 2.5e5, 2.5e5, 2.0e5]
storey_stiffness = 2e8
storey_height = 3.2

[pounding]
gap = 0.05
stiffness = 2e9

[units]
length = "m"
mass = "kg"
time = "s"
"""
VARY = """\
# Keys of study, structure, pounding, sweep or solver with several values each: a list or a range.
# All is computed at every value of one with every value of another, in one file with the keys as
# its first dimensions; keys that vary together are columns of a CSV file, rows = "portfolio.csv".
#[vary]
#structure.gap = {from = 0.5, to = 2.0, count = 16}
"""
OF_FILE = ("name", "part", *ABOUT)
TABLES = ("study", "structure", "forcing", "sweep", "solver", "output")
OF_SWEEP = {"sweep.omega": "0.445", "sweep.amplitude": OMEGA[2].example}
SLICE = "{from = -1.0, to = 1.0, count = 40}"
SCALE = '{by = "sa", period = 0.78, from = 1.0, to = 12.0, count = 12}'
FEW = {"sweep.amplitude": "{from = 0.1, to = 0.2, count = 3}"}
GIVEN: dict[str, dict[str, str]] = {
    DEFAULT_KIND: OF_SWEEP,
    "points": {"sweep.omega": "{from = 0.4, to = 0.5, count = 3}", **FEW},
    "attractors": {**OF_SWEEP, **FEW, "study.starts": "60"},
    "basins": {**OF_SWEEP, "sweep.amplitude": "0.128"}
    | {"study.components": '["u_1", "u_2"]', "study.horizontal": SLICE, "study.vertical": SLICE},
    "records": {"records.synthetic": "{count = 5, seed = 1}", "records.scale": SCALE},
    "branches": {**OF_SWEEP, "branches.seeds": '"study.h5"', "branches.max_branches": "8"},
}
"""Values of keys, by kind of study, that make the job complete."""


LINK = re.compile(r"( ?\()?\[([^]]+)\]\([^)]*\)(?(1)\))")
POINTERS = (
    *("how", "which", "dashpots", "formats", "what they do", "what they spare", "what it is"),
    "size and price",
)
"""Links that only point to a page, left out of comments."""


def template(kind: str = DEFAULT_KIND) -> str:
    """Write a job for a kind of study, with all its keys."""
    every, shaken = declared(KINDS[kind]), kind == "records"
    completing = GIVEN[kind] if kind == DEFAULT_KIND else {"study.kind": f'"{kind}"', **GIVEN[kind]}
    parts = [HEAD.format(SEEDS * (kind == "branches") + (IN_OWN if shaken else IN_GAPS))]
    parts += _given("", (key for key in every[""] if key.name in OF_FILE), {})
    for table in (*TABLES, "records", "branches"):
        if not every[table]:
            continue
        if shaken and table == "structure":
            parts.append(BUILDINGS)
            continue
        parts.append(f"[{table}]")
        if table == "study":
            parts += [_comment(f'"{other}": {study.summary}') for other, study in KINDS.items()]
            parts.append("# Keys that a kind alone has: hpcsweep new OTHER.toml --kind KIND\n")
        parts += [*_given(table, every[table], completing), ""]
    parts.append("# Tables of other structures, see docs/structures.md:")
    for table in ("building", "pounding", "units"):
        keys = every.get(table) or [key for key in every[""] if key.name == table]
        parts += [f"#[{table}]", *(_mentioned(key) for key in keys)]
    return "\n".join([*parts, "", VARY.replace("#structure", "#pounding") if shaken else VARY])


def _given(table: str, keys: Iterable[Key], completing: Mapping[str, str]) -> Iterator[str]:
    """Write keys, each below its comment, or the comment alone where there is no value."""
    for key in keys:
        name = f"{table}.{key.name}"
        value = completing.get(name) or key.example or key.shown
        if value:
            mark = "#" * (name not in completing)
            default = f"; default: {key.told}" * bool(key.told)
            yield f"{_comment(key.description + default)}\n{mark}{key.name} = {value}\n"
        else:
            yield _mentioned(key) + "\n"


def _mentioned(key: Key) -> str:
    """Write a key of other jobs and its meaning as a comment."""
    default = key.shown or key.told
    return _comment(
        f"{key.name}: {key.description}" + f"; default: {default}" * bool(default), "#     "
    )


def _comment(text: str, indent: str = "# ") -> str:
    """Write a text as a comment, without the marks of Markdown."""
    plain = LINK.sub(
        lambda link: "" if link[2] in POINTERS else f" ({link[2]})" if link[1] else link[2], text
    )
    text = plain.replace("`", "")
    lines = textwrap.wrap(text, 98 - len(indent), break_long_words=False, break_on_hyphens=False)
    return "\n".join([f"# {lines[0]}", *(f"{indent}{line}" for line in lines[1:])])
