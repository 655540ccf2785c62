"""What the header lines of a record say: number of samples, time between them, and units.

Formats differ in their words, so those words are looked for which have one meaning in all: ``NPTS``
and ``DT``, ``Number of Data``, ``SAMPLING_INTERVAL_S``, ``4 points of accel data equally spaced at
.020 sec, in cm/sec2``. A unit is what stands in brackets, after *units of*, after *acceleration
in*, or beside the name of a column. What is said of peaks is not said of the samples.
"""

import math
import re
from collections.abc import Iterator
from fractions import Fraction
from typing import NamedTuple

from hpcsweep.earthquakes.units import Unit, in_seconds, leading_unit, unit_of
from hpcsweep.model.arguments import shown

NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[EeDd][-+]?\d+)?"
NUMBERS = re.compile(NUMBER)


def _pattern(text: str) -> re.Pattern:
    return re.compile(text, re.IGNORECASE)


_VALUE = rf"(?P<before>\s*[(\[][^)\]]*[)\]]|_[a-z]+\b)?\s*[=:]?\s*(?P<value>{NUMBER})" + (
    r"\s*[(\[]?(?P<after>[a-zµμ]+)?"
)
COUNT = _pattern(
    r"(?<![a-z])(?P<label>npts|n_?data|n_?points|n_?samples|num_?(?:points|samples|data)|"
    r"(?:number|no\.?|num)[ _]of[ _](?:the[ _])?(?:data|points|samples|values|acc\w*)"
    r"(?:[ _](?:data|points|samples|values))?|(?:data )?(?:points|samples)(?=\s*[=:]))"
    r"\s*[=:]?\s*(?P<value>\d{1,18})(?![\d.])"
)
COUNTED = _pattern(
    r"(?<![\w.+-])(?P<value>\d{1,18})\s+(?P<label>(?:data )?(?:points|pts|samples)\b)"
    r"(?!\s*(?:/|per\b|a\b|across\b|(?:in|on)\s+(?:a|an?other|each|every|one)\b))"
)
STEP = _pattern(
    r"(?<![a-z])(?P<label>dt|delta[ _-]?t|(?:time|sampl(?:e|ing))[ _-]?"
    r"(?:step|increment|interval|spacing|period)|time between samples|"
    r"(?:spaced|points|samples|data|values)\s+(?:at|every)|(?:intervals|steps|spacing) of)" + _VALUE
)
RATE = _pattern(
    r"(?<![a-z])(?P<label>sampl(?:e|ing)s?[ _-]?(?:rate|freq\w*)|samples[ _-]per[ _-]sec\w*|sps)"
    + _VALUE
)
RATED = _pattern(
    rf"(?<![\w.])(?P<value>{NUMBER})\s*(?P<label>(?:samples|points)\s*(?:/|per)\s*s\w*|sps)"
    r"(?P<before>(?!))?(?P<after>(?!))?"
)
BOTH = _pattern(r"\bnpts\b.*\bdt\b|\bdt\b.*\bnpts\b")
PEAK = _pattern(r"\b(?:pga|pgv|pgd|peaks?|max\w*|min(?:\.|imum\w*|ima)?(?![a-z])|largest)\b")
CLAUSE = _pattern(
    r"\b(?:in\s+)?unit(?:s\b|\b(?=\s*(?:of\b|is\b|in\b|for\b|[:=(\[])))(?:\s*(?:\b(?:of|are|is|"
    r"in(?!\s*(?:[/*.^-]|per))|for|the|acc\w*|data|samples?|values|time|series|histor\w+)\b|[=:]))*"
    r"\s*(?P<rest>[^\d\s:=].*)"
)
UNIT = _pattern(r"\bunit\s+(?P<rest>\S.*)")
"""As in *unit g, acceleration*; not in *unit 2*."""
IN = _pattern(
    r"\b(?P<what>acc\w*|veloc\w*|displ\w*|data|samples|values|amplitudes?|times?|t)\b\.?(?:\s+(?:time|series|histor(?:y|ies)|data|values|records?|trace|samples))*"
    r"\s+(?:(?:is|are)\s+)?in\s+(?!units?\b|the\b)(?=(?P<rest>[^;,]*))"
)
BRACKETED = _pattern(rf"[(\[]\s*([^()\[\]]*?)\s*[)\]](\s*[=:]?\s*{NUMBER})?")
ACCELERATION = _pattern(
    r"(?:(?<![a-z])acc(?:el(?!ero)[a-z]*|eleration\w*|s)?\.?"
    r"(?:\s+(?:time|series|histor\w+|data|values|records?|trace|samples))*|\A\W*ag?)\W*\Z"
)
"""The name of a column, or the end of a line before its unit."""
TIME = _pattern(r"\W*(?:t|times?)\W*")
KINDS = _pattern(
    r"\bdata.?type\s*[:=]?\s*(?P<type>(?:vel|dis|spec)\w*|s[adv]\b)|"
    r"\b(?P<what>velocity|displacement)\s+(?:time|data|trace|histor|series|record)"
)
OTHER_COLUMN = re.compile(r"\W*(?:v|[Vv]el\w*|VEL\w*|d|[Dd]isp\w*|DISP\w*)\b")
IN_COLUMNS = _pattern(
    r"\W*(?:t|time)\b\s*(?:[\[(][^)\]]*[)\]]\s*(?=,|(?:a|acc|v|d|u|x)[a-z]*\b|\w+\s*[\[(])|,|"
    r"(?:in\s+)?[a-zµμ]+\s*,|(?:a|acc|vel|dis)[a-z]*\b)"
)
"""Names of columns, of which the first is time; separators are commas."""
REMARK = _pattern(
    r"(?:[nsewudxyzlrth/+.,\d\s°-]|deg|up|down|comp(?:onent)?|(?:un)?corr\w*|(?:un)?filt\w*|hori\w*|"
    r"vert\w*|long\w*|trans\w*|north|south|east|west|base\w*|(?:un)?processed|band\S*|low\S*|"
    r"high\S*|\d*[fe]\d+\.\d+)*"
)
"""What else stands behind the name of a column: directions, corrections, formats."""
OTHER_UNIT = _pattern(r"\W*(?:counts?|cnts?|m?v|volts?|lsb|adc|digits?|raw|\S+/s\S*)\W*")
"""What is a unit of something else."""
WRITTEN_UNIT = _pattern(r"\S+|\S*[/^*²%\d].*")
"""A word, or words of which the first is written like a unit, be it known or not."""
SECOND = Unit(Fraction(1), time=1)


Said = tuple[str, Unit | None]
"""Words that name a unit, and the unit, None if it is not known."""


class Header(NamedTuple):
    """What is said of the samples; empty, or None, where nothing is."""

    counts: dict[str, int]
    steps: dict[str, float]
    """Seconds, by the words that say it."""
    units: dict[Unit, str]
    """Of acceleration, with the words that name it."""
    time: Unit | None
    """Of a column of times, where it is named."""
    unknown: str | None
    """Words that name a unit which is not known."""


def says(line: str) -> bool:
    """Return whether a line tells the number of samples or the time between them."""
    patterns = COUNT, COUNTED, STEP, RATE, RATED
    return "npts" in line.lower() or any(pattern.search(line) for pattern in patterns)


def read_header(lines: list[str]) -> Header:
    """Read the header lines of a file.

    Raises
    ------
    ValueError
        If they tell of no acceleration, or are no count, time or unit where one is named.
    """
    counts: dict[str, int] = {}
    steps: dict[str, float] = {}
    units: dict[Unit, str] = {}
    times: dict[Unit, str] = {}
    unknown = None
    for i, line in enumerate(lines):
        if BOTH.search(line) and not (COUNT.search(line) and STEP.search(line)):
            counts["NPTS"], steps["DT"] = _both(line)
        else:
            matches = (named for pattern in (COUNT, COUNTED) for named in pattern.finditer(line))
            counts |= {named["label"]: int(named["value"]) for named in matches}
            steps |= _steps(line)
        for words, unit in _named(line, i == len(lines) - 1):
            if unit is None:
                unknown = words
            else:
                (times if unit.kind == "time" else units).setdefault(unit, words)
    for named in (units, times):
        if len(named) > 1:
            raise ValueError(f"must name one unit, names {' and '.join(named.values())}")
    return Header(counts, steps, units, next(iter(times), None), unknown)


def _both(line: str) -> tuple[int, float]:
    """Find NPTS and DT before or after both names."""
    before, _, after = re.split(r"(NPTS)", line, maxsplit=1, flags=re.IGNORECASE)
    pair = NUMBERS.findall(before)[-2:] or NUMBERS.findall(after)[:2]
    if len(pair) != 2 or not pair[0].isdigit():
        raise ValueError(f"NPTS and DT must be a count and a time, are {shown(line.strip())}")
    return int(pair[0]), number(pair[1])


def _steps(line: str) -> dict[str, float]:
    steps = {}
    for pattern in (STEP, RATE, RATED):
        for match in pattern.finditer(line):
            value, label = number(match["value"]), match["label"]
            if not 0 < value < math.inf:
                raise ValueError(f"{label} must be above 0, is {value!r}")
            unit = unit_of(match["after"] or "")
            if unit is None and match["before"]:
                unit = unit_of(match["before"].replace("_", " "))
                if unit is None:
                    raise ValueError(f"the unit of {label} is not known: {match['before'].strip()}")
            kind = unit.kind if unit else ""
            if unit is not None and kind in ("time", "frequency"):
                value = in_seconds(value, unit)
            is_rate = kind == "frequency" or (kind != "time" and pattern is not STEP)
            steps[label] = 1.0 / value if is_rate else value
    return steps


def number(text: str) -> float:
    """Read a number, with Fortran's D among the exponents."""
    return float(text.replace("D", "E").replace("d", "e"))


def _named(line: str, is_last: bool) -> Iterator[Said]:
    """Iterate over the units of acceleration and of a column of times that a line names.

    Raises
    ------
    ValueError
        If it names a unit of velocity or displacement.
    """
    line = re.sub(r"(?<=[A-Za-z])_|_(?=[A-Za-z])", " ", line)
    parts = [part for part in map(_without_peaks, re.split(r"[;,\t]", line)) if part.strip()]
    line = ", ".join(parts)
    if other := KINDS.search(line):
        raise ValueError(f"must hold accelerations, is of {other['type'] or other['what']}")
    clause = CLAUSE.search(line)
    if not clause and (clause := UNIT.search(line)):
        is_of_samples = ACCELERATION.search(line) and leading_unit(clause["rest"])
        clause = clause if is_of_samples else None
    if clause:
        yield from _of_clause(clause["rest"])
        line = line[: clause.start()]
        parts = line.split(", ")
    for match in IN.finditer(line):
        words, unit = match["rest"], leading_unit(match["rest"])
        if unit or WRITTEN_UNIT.fullmatch(words):
            yield from _judged(match["what"], words, unit, unit is not None)
    in_columns = bool(IN_COLUMNS.match(line))
    about = in_columns or bool(re.search(r"\bacc", line, re.IGNORECASE))
    for j, part in enumerate(parts):
        at = 0
        for match in BRACKETED.finditer(part):
            if not match[2]:  # no number: that is the value of something else
                what, words = part[at : match.start()], match[1]
                yield from _judged(what, words, unit_of(words), in_columns)
            at = match.end()
        if about:
            yield from _of_cell(BRACKETED.sub(" ", part), in_columns)
        if is_last and in_columns and j and OTHER_COLUMN.match(part):
            raise ValueError(f"must hold accelerations, has a column {part.strip()}")
    yield from _compound(line)


def _without_peaks(part: str) -> str:
    match = PEAK.search(part)
    if match is None:
        return part
    said = part[: match.start()]
    return said if CLAUSE.search(said) else ""


def _samples(words: str, unit: Unit | None) -> Said:
    """Return what is said of samples; refuse a unit of velocity or displacement."""
    if unit is None or unit.kind in ("time", "frequency"):
        return words, None
    if unit.kind != "acceleration":
        raise ValueError(f"must hold accelerations, has the unit {words}, of {unit.kind}")
    return words, unit


def _of_clause(rest: str) -> Iterator[Said]:
    """Read what stands after *units of*: one unit, or several."""
    items = re.split(r"[;,()\[\]]|\band\b", rest.strip(" ([{\"'"))
    units = [(item, unit) for item in items if (unit := leading_unit(item))]
    others = [said for said in units if said[1].kind not in ("time", "acceleration")]
    accelerations = [said for said in units if said[1].kind == "acceleration"]
    yield from (said for said in units if said[1].kind == "time")
    if units:
        yield from accelerations or (_samples(*said) for said in others)
    else:
        yield items[0], None


def _judged(what: str, words: str, unit: Unit | None, is_named: bool) -> Iterator[Said]:
    """Judge words in the place of a unit of something, which may be the name of a column."""
    words, kind = " ".join(words.split()), unit.kind if unit else ""
    if kind == "acceleration":
        yield words, unit
    elif TIME.fullmatch(what):
        if kind == "time":
            yield words, unit
        elif is_named:
            raise ValueError(f"the unit of times is not known: {words}")
    elif is_named or ACCELERATION.search(what) or OTHER_COLUMN.fullmatch(what.strip()):
        is_remark = REMARK.fullmatch(words.partition(" ")[0]) or words.count(" ") > 2
        if kind in ("velocity", "displacement", "frequency") or not is_remark:
            yield _samples(words, unit)


def _of_cell(part: str, in_columns: bool) -> Iterator[Said]:
    """Read a unit beside the name of a column, or in a column of its own, without brackets."""
    names = r"acc[a-z]*|times?|ag?|t" if in_columns else r"acc[a-z]*"
    name = re.match(rf"\W*(?:\w+\s+)*?({names})\b[.\s:=/]*", part, re.IGNORECASE)
    words = part[name.end() :] if name else part
    unit = unit_of(words)
    if unit or OTHER_UNIT.fullmatch(words):
        yield from _judged(name[1] if name else "", words, unit, bool(name or not unit))


def _compound(line: str) -> Iterator[Said]:
    """Find units of acceleration that are no word of a language, as cm/s2, anywhere."""
    words = re.split(r"[\s,;:=()\[\]]+", line)
    for before, word in zip(["", *words], words, strict=False):
        if re.search(r"[/^²\d]", word) and not NUMBERS.fullmatch(before):
            unit = unit_of(word)
            if unit is not None and unit.kind == "acceleration":
                yield word, unit
