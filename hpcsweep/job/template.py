"""The commented job that `hpcsweep new` writes, made from the declarations of keys."""

import re
import textwrap
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from importlib.resources import files

from hpcsweep.job.job import ABOUT
from hpcsweep.job.keys import declared
from hpcsweep.studies.keys import OMEGA, Key
from hpcsweep.studies.kinds import DEFAULT_KIND, KINDS

TEXTS = tomllib.loads((files(__package__) / "template.toml").read_text())
"""Head, tables of buildings, and what differs between kinds of study, by name."""
OF_FILE = ("name", "part", *ABOUT)
TABLES = ("study", "structure", "forcing", "sweep", "solver", "output")
OF_SWEEP = {"sweep.omega": "0.445", "sweep.amplitude": OMEGA[2].example}
SLICE = "{from = -1.0, to = 1.0, count = 40}"
SCALE = '{by = "sa", period = 0.78, from = 1.0, to = 12.0, count = 12}'
RESPONSE = "response"
"""Kind of a job: sweeps along the frequency, of a frequency response."""
FEW = {"sweep.amplitude": "{from = 0.1, to = 0.2, count = 3}"}
GIVEN: dict[str, dict[str, str]] = {
    DEFAULT_KIND: OF_SWEEP,
    "points": {"sweep.omega": "{from = 0.4, to = 0.5, count = 3}", **FEW},
    "attractors": {**OF_SWEEP, **FEW, "study.starts": "60"},
    "basins": {**OF_SWEEP, "sweep.amplitude": "0.128"}
    | {"study.components": '["u_1", "u_2"]', "study.horizontal": SLICE, "study.vertical": SLICE},
    "records": {"records.synthetic": "{count = 5, seed = 1}", "records.scale": SCALE},
    RESPONSE: {"sweep.along": '"omega"', "sweep.omega": "{from = 0.3, to = 0.9, count = 61}"}
    | {"sweep.amplitude": "[0.1, 0.2, 0.4]", "output.rows": '["1"]'},
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
    every, shaken = declared(KINDS.get(kind, KINDS[DEFAULT_KIND])), kind == "records"
    named = {"study.kind": f'"{kind}"'} if kind not in (DEFAULT_KIND, RESPONSE) else {}
    completing = named | GIVEN[kind]
    units = TEXTS["in_own" if shaken else "in_gaps"]
    parts = [TEXTS["head"].format(TEXTS["seeds"] * (kind == "branches") + units)]
    parts += _given("", (key for key in every[""] if key.name in OF_FILE), {})
    for table in (*TABLES, "records", "branches"):
        if not every[table]:
            continue
        if shaken and table == "structure":
            parts.append(TEXTS["buildings"])
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
    vary = TEXTS["vary"].replace("#structure", "#pounding" if shaken else "#structure")
    return "\n".join([*parts, "", vary])


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
    value = key.shown or key.told
    default = f"; default: {value}" * bool(value)
    return _comment(f"{key.name}: {key.description}{default}", "#     ")


def _comment(text: str, indent: str = "# ") -> str:
    """Write a text as a comment, without the marks of Markdown."""
    plain = LINK.sub(
        lambda link: "" if link[2] in POINTERS else f" ({link[2]})" if link[1] else link[2], text
    )
    text = plain.replace("`", "")
    lines = textwrap.wrap(text, 98 - len(indent), break_long_words=False, break_on_hyphens=False)
    return "\n".join([f"# {lines[0]}", *(f"{indent}{line}" for line in lines[1:])])
