"""The commented job that `hpcsweep new` writes, made of the declarations of its keys."""

import re
import textwrap
from collections.abc import Iterable, Iterator

from hpcsweep.job.keys import declared
from hpcsweep.studies.keys import Key
from hpcsweep.studies.kinds import DEFAULT_KIND, KINDS

HEAD = """\
# A job of hpcsweep: TOML. It is complete, and takes seconds:
#     mpirun -n 2 hpcsweep run FILE.toml       computes FILE.h5; hpcsweep run FILE.toml works too
#     hpcsweep plot FILE.h5 -o FILE.png        draws it
#     hpcsweep run FILE.toml --dry-run         predicts the cost of a larger one
#
# A key behind a # has its default, which is shown; take the # away to give it another value.
#
# Lengths are in gaps, from a floor at rest to the stop, so that the stop is at 1. Time is in
# 1/omega_0, where omega_0 = sqrt(k/m) of one storey. With u the floors' displacements
#
#     u'' + 2 gamma C u' + K u + beta S(u) (u - 1) = -A sin(Omega tau)

# Another job, whose path is relative to this file: what is given here replaces what is there.
#extends = "other.toml"

# Name of the results, without folder; default: the name of this file.
#name = "other"
"""
VARY = """\
# Keys of study, structure, pounding, sweep or solver with several values each: a list or a range.
# All is computed at every value of one with every value of another, in one file with the keys as
# its first dimensions; keys that vary together are columns of a CSV file, rows = "portfolio.csv".
#[vary]
#structure.gap = {from = 0.5, to = 2.0, count = 16}
"""
TABLES = ("study", "structure", "forcing", "sweep", "solver", "output")
REQUIRED = ("sweep.omega", "sweep.amplitude")


LINK = re.compile(r"(?: \()?\[([^]]+)\]\([^)]*\)\)?")
POINTERS = ("how", "which", "dashpots", "formats", "what they do", "what they spare", "what it is")
"""Links that only point to a page, left out of comments."""


def template() -> str:
    """Write the job: the keys of an amplitude sweep, then those of other studies."""
    parts, every = [HEAD], declared(KINDS[DEFAULT_KIND])
    for table in TABLES:
        parts.append(f"[{table}]")
        if table == "study":
            parts += [_comment(f'"{kind}": {study.summary}') for kind, study in KINDS.items()]
        parts += [*_given(table, every[table]), ""]
    parts.append("# Tables of other structures, see docs/structures.md:")
    for table in ("building", "pounding", "units"):
        keys = every.get(table) or [key for key in every[""] if key.name == table]
        parts += [f"#[{table}]", *(_mentioned("", key) for key in keys)]
    told = {(table, key.name) for table, keys in every.items() for key in keys}
    for kind, study in KINDS.items():
        further = {
            table: [key for key in keys if key not in every[table]]
            for table, keys in declared(study).items()
        }
        names = [f"{table}.{key.name}" for table, keys in further.items() for key in keys]
        if names:
            parts.append("\n" + _comment(f'Keys of study.kind = "{kind}": {", ".join(names)}'))
        for table, keys in further.items():
            new = [key for key in keys if (table, key.name) not in told]
            told |= {(table, key.name) for key in new}
            if new and table not in TABLES:
                parts.append(f"#[{table}]")
            parts += [_mentioned(f"{table}." * (table in TABLES), key) for key in new]
    return "\n".join([*parts, "", VARY])


def _given(table: str, keys: Iterable[Key]) -> Iterator[str]:
    """Write keys, each after its comment; of one without a value only the comment."""
    for key in keys:
        value = key.example or key.shown
        if value:
            mark = "#" * (f"{table}.{key.name}" not in REQUIRED)
            default = f"; default: {key.told}" * bool(key.told)
            yield f"{_comment(key.description + default)}\n{mark}{key.name} = {value}\n"
        else:
            yield _mentioned("", key) + "\n"


def _mentioned(prefix: str, key: Key) -> str:
    """Write a key of other jobs, and what it means, as a comment."""
    default = key.shown or key.told
    return _comment(
        f"{prefix}{key.name}: {key.description}" + f"; default: {default}" * bool(default), "#     "
    )


def _comment(text: str, indent: str = "# ") -> str:
    """Write a text as a comment, without the marks of Markdown."""
    text = LINK.sub(lambda link: "" if link[1] in POINTERS else link[1], text).replace("`", "")
    lines = textwrap.wrap(text, 98 - len(indent), break_long_words=False, break_on_hyphens=False)
    return "\n".join([f"# {lines[0]}", *(f"{indent}{line}" for line in lines[1:])])
