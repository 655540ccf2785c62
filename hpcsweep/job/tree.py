"""Merge a job file with the files it extends and the settings of the command line.

A tree is what ``tomllib`` makes of a job file: keys at the top, and tables of keys. Trees are
merged key by key, and so are `TABLES_WITHIN`; the value of a key, even a range table, is replaced
whole. This module knows no other keys of a job, and no limits: it returns a text, and validating
that text validates the merged job.
"""

import datetime
import difflib
import functools
import json
import re
import tomllib
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from hpcsweep.earthquakes.text_files import read_bytes
from hpcsweep.job.job import JobError

EXTENDS = "extends"
UNSET = "unset"
"""Value that takes an inherited key away."""
INDEXED = re.compile(r"(?=.*\[)\w+(?:\.\w+|\[\d{1,6}\]){1,6}")
"""A key of one of several tables, or one value of a list: structure.contact[0].gap, gap[2]."""
TABLES_WITHIN = ("structure.model", "structure.matrices")
"""Tables in tables that are merged, too; others are values."""
NOT_INHERITED = ("name", "title", "part")
MAX_BASES = 8
"""Files that one job may be built on; the shipped jobs need at most four."""
MAX_TEXT = 2**24
"""Characters of a job; ten seconds of parsing."""
MAX_DEPTH = 8
MAX_WORD = 4096
"""Characters of a key or a word; the path of another job is the longest."""
LONG_DOTS = re.compile(r"^\s*\[*\s*(?:[\w\"'-]+\s*\.\s*){8}", re.MULTILINE)
RUN = re.compile(r"[\d_]+|[\[{]+")
LONGEST_RUN = 1000
"""Digits or brackets in a row from which on the parser gives up, without a word where."""
MAX_SHOWN = 80
"""Characters of a setting that an error shows."""
PART = re.compile(r"\"[^\"]*\"|'[^']*'|[^.]+")
BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")

Order = Mapping[str, Sequence[str]]
"""Keys in the order in which they are written: of the top (``""``) and of each table."""


def resolve(
    path: Path,
    settings: Sequence[str],
    order: Callable[[], Order],
    inherit: Callable[[dict, set[str]], list[str]] | None = None,
) -> tuple[str, str, list[str]]:
    """Read a job file with all that it extends and all that the command line sets.

    Parameters
    ----------
    path : Path
    settings : sequence of str
        ``TABLE.KEY=VALUE`` each, the value in TOML; later ones replace earlier ones.
    order : callable
        Return the order in which the keys are written.
    inherit : callable, optional
        Given the whole tree and the job's own keys, drop inherited ones of no use; return messages.

    Returns
    -------
    text : str
        The whole job; exactly the file's own text where it extends nothing and nothing is set.
    source : str
        Origin of the text, named in errors.
    notes : list of str
        Messages of `inherit`.

    Raises
    ------
    JobError
        If a file cannot be read or is not TOML, if the files are circular or too many, or if a
        setting is not of the form above.
    """
    text, tree = _read(path)
    bases = _read_bases(path, tree)
    layers = [_parse_setting(setting) for setting in settings]
    if not bases and not layers:
        return text, str(path), []
    made_of = [path.name, *(f"extends {base.name}" for base, _ in bases)]
    source = str(path)
    if bases:
        source += f" (extends {', '.join(base.name for base, _ in bases)})"
    if layers:
        made_of += [f"with {setting}" for setting in settings]
        source += f" with {' '.join(_option(setting) for setting in settings)}"
    whole: dict = functools.reduce(merge, (*(base for _, base in reversed(bases)), tree), {})
    for setting, layer in zip(settings, layers, strict=True):
        key, _, value = (part.strip() for part in setting.partition("="))
        if not layer:
            said = _option(setting)
            whole = with_value(whole, key, parse_toml(f"x = {value}", said)["x"], said)
        whole = merge(whole, layer)
    keys_of_job = {
        f"{table}.{key}"
        for layer in (tree, *layers)
        for table, keys in layer.items()
        if isinstance(keys, Mapping)
        for key in keys
    }
    keys = order()
    whole = _without_unset(whole, keys)
    notes = inherit(whole, keys_of_job) if inherit else []
    try:
        text = write(whole, keys)
    except (ValueError, RecursionError) as error:  # numbers too long, brackets nested too deeply
        raise JobError(f"{source}: cannot be written as TOML: {error}") from None
    made_of += notes
    return "".join(f"# {_printable(line)}\n" for line in made_of) + text, source, notes


def _without_unset(tree: Mapping, order: Order, keys: Sequence[str] | None = None) -> dict:
    """Return a tree without unset keys and tables left empty; unknown keys stay."""
    kept = {
        key: _without_unset(value, {}, order.get(key)) if isinstance(value, Mapping) else value
        for key, value in tree.items()
        if value != UNSET or (keys and key not in keys)
    }
    return {key: value for key, value in kept.items() if value != {} or tree[key] == {}}


def with_value(whole: Mapping, key: str, value: object, said: str) -> dict:
    """Return a tree with a new value of a key, which may be `INDEXED`.

    Raises
    ------
    JobError
        If there is no such place; the message begins with `said`.
    """
    return _replaced(whole, re.findall(r"\w+|\[\d+\]", key), value, said, "")


def _replaced(below: Any, steps: list[str], value: object, said: str, owner: str) -> Any:
    """Return the content of the key `owner` with a new value at the end of the steps below it."""
    if not steps:
        return value
    step, *rest = steps
    if step[0] != "[":
        if below is not None and not isinstance(below, Mapping):
            raise JobError("must be a table", owner, said)
        table, full = below or {}, f"{owner}.{step}" if owner else step
        return {**table, step: _replaced(table.get(step), rest, value, said, full)}
    place, listed = int(step[1:-1]), below if isinstance(below, list) else []
    count, full = len(listed), owner + step
    if rest and rest[0][0] != "[" and place >= count:
        there = "is 1 table" if count == 1 else f"are {count} tables"
        raise JobError(f"there {there} {owner}, counted from 0", "", said)
    if place > count or (below is not None and not isinstance(below, list)):
        raise JobError(f": {owner} must be a list with that place, is {below!r:.60}", full, said)
    inner = _replaced(listed[place] if place < count else None, rest, value, said, full)
    return [*listed[:place], inner, *listed[place + 1 :]]


def merge(base: Mapping, layer: Mapping, within: str = "") -> dict:
    """Merge a tree over another: tables key by key, the value of a key whole."""
    merged = dict(base)
    for key, value in layer.items():
        below = merged.get(key)
        is_table = not within or f"{within}.{key}" in TABLES_WITHIN
        if is_table and isinstance(below, Mapping) and isinstance(value, Mapping):
            value = merge(below, value, f"{within}.{key}" if within else key)
        merged[key] = value
    return merged


def write(tree: Mapping, order: Order) -> str:
    """Return a tree as TOML; ``tomllib`` reads an equal tree from it.

    Keys at the top come first, then each table under its header, each in the given order; other
    keys follow in their own order. Floats are written with the fewest digits that round-trip,
    tables within a table inline.
    """
    keys = _ordered(tree, order.get("", ()))
    parts = [_write_pairs(tree, (key for key in keys if not isinstance(tree[key], Mapping)))]
    for key in (key for key in keys if isinstance(tree[key], Mapping)):
        table = tree[key]
        pairs = _write_pairs(table, _ordered(table, order.get(key, ())))
        parts.append(f"[{_write_key(key)}]\n{pairs}")
    return "\n".join(part for part in parts if part)


def _read(path: Path) -> tuple[str, dict]:
    """Read the text and the tree of a file."""
    try:
        text = read_bytes(path, MAX_TEXT).decode("utf-8")
    except UnicodeDecodeError as error:
        raise JobError(f"{path}: not a text file in UTF-8 (byte {error.start})") from None
    except (OSError, ValueError) as error:
        said = getattr(error, "strerror", None) or error
        raise JobError(f"{path}: cannot be read: {said}") from None
    return text, parse_toml(text, str(path))


def parse_toml(text: str, source: str, otherwise: str = "") -> dict:
    """Parse a text within the limits of size, depth and names of a job.

    Raises
    ------
    JobError
        If it is not TOML, of which `otherwise` is said, or exceeds the limits.
    """
    if len(text) > MAX_TEXT:
        raise JobError(f"{source}: has more than {MAX_TEXT} characters, the most a job may have")
    if LONG_DOTS.search(text):
        raise JobError(f"{source}: a key has more than {MAX_DEPTH} parts")
    try:
        tree = tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # RecursionError: brackets nested too deeply
        fault = otherwise or f"not valid TOML: {_unreadable(text)}{str(error)[:200]}"
        raise JobError(f"{source}: {fault}") from None
    _check_size(tree, source)
    return tree


def _unreadable(text: str) -> str:
    """Return the key whose value the parser gives up on without saying where, or nothing."""
    for run in RUN.finditer(text):
        if run.end() - run.start() > LONGEST_RUN:
            key, equals, _ = text[text.rfind("\n", 0, run.start()) + 1 :][:MAX_SHOWN].partition("=")
            return f"{key.strip()}: " if equals else ""
    return ""


def _check_size(tree: dict, source: str) -> None:
    """Refuse keys, words and whole numbers that are too long, and brackets nested too deeply."""
    waiting: list[tuple[str, object, int]] = [("", tree, 0)]
    while waiting:
        full, value, depth = waiting.pop()
        if depth > MAX_DEPTH:
            raise JobError(f"{source}: {full}: its brackets are more than {MAX_DEPTH} deep")
        if isinstance(value, dict):
            for key, item in value.items():
                if len(key) > MAX_WORD:
                    raise JobError(f"{source}: key {key[:20]!r}...: {_too_long(key)}")
                waiting.append((f"{full}.{key}" if full else key, item, depth + 1))
        elif isinstance(value, list):
            tables = any(isinstance(item, dict) for item in value)
            waiting += [
                (f"{full}[{i}]" if tables else full, item, depth + 1)
                for i, item in enumerate(value)
            ]
        elif isinstance(value, str) and len(value) > MAX_WORD:
            raise JobError(f"{source}: {full} = {value[:20]!r}...: {_too_long(value)}")
        elif isinstance(value, int) and not -(2**63) <= value < 2**63:
            bits = value.bit_length()
            raise JobError(f"{source}: {full}: a whole number of {bits} bits does not fit into 64")


def _too_long(word: str) -> str:
    return f"has {len(word)} characters, the most are {MAX_WORD}"


def _read_bases(path: Path, tree: dict) -> list[tuple[Path, dict]]:
    """Read the files that a tree extends, nearest first; remove `extends` from all trees.

    The name, title and part of a base are not inherited.
    """
    bases: list[tuple[Path, dict]] = []
    met = [path.resolve()]
    while True:
        for key in tree:  # a misspelt one, which later validation does not know
            if key != EXTENDS and difflib.get_close_matches(key, [EXTENDS], cutoff=0.8):
                raise JobError(f"{path}: unknown key {key!r}; did you mean {EXTENDS!r}?")
        if EXTENDS not in tree:
            return bases
        base = tree.pop(EXTENDS)
        where = f"{path}: {EXTENDS} = {base!r}"
        if not isinstance(base, str) or not base.isprintable() or not base:
            raise JobError(f"{where}: must be the name of one job file")
        if len(bases) == MAX_BASES:
            raise JobError(f"{where}: a job may be built on {MAX_BASES} files at most")
        path = path.parent / base
        try:
            _, tree = _read(path)
        except JobError as error:
            raise JobError(f"{where}: {error}") from None
        met.append(path.resolve())
        if met[-1] in met[:-1]:
            circle = " -> ".join(file.name for file in met[met.index(met[-1]) :])
            raise JobError(f"{where}: must not lead back to a file before it: {circle}")
        for key in NOT_INHERITED:
            tree.pop(key, None)
        bases.append((path, tree))


def _parse_setting(setting: str) -> dict:
    """Read ``TABLE.KEY=VALUE``, which is a line of TOML, as a tree of one key."""
    option = _option(setting)
    key, equals, value = (part.strip() for part in setting.partition("="))
    if not setting.isprintable() or not equals or not key or key.startswith("#"):
        raise JobError(f"{option}: must be TABLE.KEY=VALUE")
    if key == EXTENDS:
        raise JobError(f"{option}: {EXTENDS!r} can only be said in a job file")
    if INDEXED.fullmatch(key):
        parse_toml(f"x = {value}", option)
        return {}
    parts = PART.findall(key)
    if len(parts) > 2:
        whole = ".".join(parts[:2])
        raise JobError(f"{option}: must be TABLE.KEY=VALUE; the value of {whole} is set whole")
    is_word = value[:1].isalpha() and BARE_KEY.fullmatch(value) and len(value) <= MAX_SHOWN
    hint = f"; a string needs quotes: --set '{key}=\"{value}\"'" if is_word else ""
    return parse_toml(setting, option, f"not a key and a value of TOML{hint}")


def _option(setting: str) -> str:
    """Format a setting as given, on one line, truncated if long."""
    shown = setting if len(setting) <= MAX_SHOWN else f"{setting[: MAX_SHOWN - 3]}..."
    return f"--set {shown if shown.isprintable() else repr(shown)}"


def _ordered(keys: Iterable[str], order: Sequence[str]) -> list[str]:
    """Sort keys as in `order`; others keep their order, at the end."""
    place = {key: index for index, key in enumerate(order)}
    return sorted(keys, key=lambda key: place.get(key, len(order)))


def _write_pairs(table: Mapping, keys: Iterable[str]) -> str:
    return "".join(f"{_write_key(key)} = {write_value(table[key])}\n" for key in keys)


@functools.lru_cache(maxsize=1024)
def _write_key(key: str) -> str:
    return key if BARE_KEY.fullmatch(key) else _write_string(key)


def _write_string(text: str) -> str:
    # a basic string of TOML has the escapes of JSON, and must escape one more character
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def write_value(value: object) -> str:
    """Return the TOML of any value that ``tomllib`` returns."""
    if type(value) in (float, int):
        return repr(value)
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, list):
        return f"[{', '.join(map(write_value, value))}]"
    if isinstance(value, str):
        return _write_string(value)
    if isinstance(value, dict):
        pairs = (f"{_write_key(key)} = {write_value(item)}" for key, item in value.items())
        return f"{{{', '.join(pairs)}}}"
    if isinstance(value, datetime.date | datetime.time):
        return value.isoformat()
    raise TypeError(f"a {type(value).__name__} has no form in TOML")


def _printable(text: str) -> str:
    """Return a text that fits into one line of comment."""
    return "".join(char if char.isprintable() else "?" for char in text)
