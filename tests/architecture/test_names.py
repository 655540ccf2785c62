"""Names in docstrings: what stands between backquotes is there."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[2] / "hpcsweep"
DOCSTRING = re.compile(r'^\s*r?"""(.*?)"""', re.S | re.M)
PROSE = re.compile(r'"[^"\n]* [^"\n]*"|#.*')
QUOTED = re.compile(r"(?<![`\w])`([A-Za-z_][\w.]*)`(?![`_])")
ELSEWHERE = {"vendor", "reference"}
"""A folder without modules, and the judge in benchmarks."""


def test_every_name_in_a_docstring_is_there():
    """In the code of the package, where ruff and mypy know that it exists, or a path in it."""
    texts = {path.relative_to(ROOT): path.read_text() for path in sorted(ROOT.rglob("*.py"))}
    known, quoted = {"hpcsweep"} | ELSEWHERE, []
    for path, text in texts.items():
        known |= {*path.with_suffix("").parts}
        known |= set(re.findall(r"\w+", PROSE.sub("", DOCSTRING.sub("", text))))
        quoted += [(path, name) for doc in DOCSTRING.findall(text) for name in QUOTED.findall(doc)]
    assert len(quoted) > 500
    assert [f"{path}: {name}" for path, name in quoted if set(name.split(".")) - known] == []
