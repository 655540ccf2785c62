"""Read values of a job file, a method per type; errors name file, key, value and limit."""

import difflib
import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from fractions import Fraction
from typing import Any

import numpy as np

from hpcsweep.job.formula import formula
from hpcsweep.job.job import JobError
from hpcsweep.model.arguments import MAX_OMEGA, MIN_OMEGA
from hpcsweep.studies.keys import Key
from hpcsweep.studies.path_grid import Tie

PAIRS = "pounding"
"""Name of a table that may be one for each two neighbours."""
RANGE_KEYS = ("from", "to", "count", "step")
MAX_VALUES = 10_000_000
"""Frames or amplitudes of one job."""


RANGES = {
    "omega": ("Omega", "", MIN_OMEGA, MAX_OMEGA),
    "amplitude": ("A", "0, or ", 1e-250, 1e250),
}
"""Beyond these limits a run leaves double precision, or one forcing period takes over a minute; an
amplitude may be 0."""
MAX_END = 1e200
"""Of the ends of a span."""
LEAST, LARGEST = 1e-12, 1e12
"""Of quantities above 0, in whatever units."""
NEAR = 0.6
"""Similarity from which on a known key is taken for the one that is meant."""


MEANT = {
    **dict.fromkeys(("beta", "contact_stiffness"), "stiffness_ratio"),
    **dict.fromkeys(("zeta", "damping", "xi"), "damping_ratio"),
    **dict.fromkeys(("rho", "smoothness"), "sharpness"),
    **dict.fromkeys(("e", "coefficient_of_restitution"), "restitution"),
    **dict.fromkeys(("n", "floors", "storeys", "n_storeys"), "n_floors"),
    **dict.fromkeys(("k", "stiffness", "storey_stiffnesses"), "storey_stiffness"),
    **dict.fromkeys(("m", "masses"), "mass"),
    **dict.fromkeys(("w", "Omega", "omegas"), "omega"),
    **dict.fromkeys(("f", "hertz", "freq", "frequencies"), "frequency"),
    **dict.fromkeys(("A", "amplitudes"), "amplitude"),
    **dict.fromkeys(("solver", "name"), "method"),
    **dict.fromkeys(("tolerance", "tol"), "rtol"),
    "direction": "directions",
    "periods": "sampling_cycles",
}
"""Keys by other names that people give them."""


class Values:
    """Reader of the values of one job.

    Parameters
    ----------
    source : str
        Named in errors.
    tree : mapping
        The parsed job file: tables by name, and keys outside tables.

    Attributes
    ----------
    defaults : dict of str to object
        Of the keys that were read and are not given.
    """

    def __init__(self, source: str, tree: Mapping):
        self.source = source
        self.tree = tree
        self.defaults: dict[str, object] = {}

    def error(self, key: str, value: object, limit: str) -> JobError:
        """Return the error for a value that is not allowed."""
        shown = repr(float(value) if isinstance(value, np.floating) else value)
        if len(shown) > 60:
            shown = shown[:57] + "..."
        return JobError(limit, key, self.source, shown)

    def unread(self, key: str, error: Exception) -> JobError:
        """Return the error of a file of a key that cannot be read."""
        said = str(error)
        if isinstance(error, OSError) and error.filename:
            said = f"{error.filename}: {error.strerror}"
        return JobError(f"{self.source}: {key}: {said}")

    def missing(self, key: str) -> JobError:
        """Return the error for a key that is needed."""
        return JobError("is missing", key, self.source)

    def check_tables(
        self, keys: Mapping[str, Sequence[str]], elsewhere: Callable[[], Mapping[str, str]]
    ) -> None:
        """Refuse unknown keys.

        Parameters
        ----------
        keys : mapping of str to sequence of str
            Keys of each table; under '' those outside tables, including tables.
        elsewhere : callable
            Return full names of keys that are known in other cases, and these cases.
        """
        for table, allowed in keys.items():
            tree = self.table(table) if table else self.tree
            self.check_keys(table, tree, allowed, keys, elsewhere)

    def check_keys(self, table, tree, allowed, keys=None, elsewhere=None) -> None:
        """Refuse unknown keys of a table; see `check_tables`."""
        for key in tree:
            if key in allowed:
                continue
            full = f"{table}.{key}" if table else key
            if elsewhere and full in (others := elsewhere()):
                hint = f"it goes with {others[full]}"
            else:
                hint = _hint(key, allowed, keys or {})
            raise JobError(f"; {hint}", f"unknown key {full!r}", self.source)

    def check_table(self, key: str, table, allowed, needed) -> None:
        """Refuse a value that is not a table of known keys, or lacks a required one."""
        if not isinstance(table, Mapping):
            raise self.error(key, table, f"must be a table of {', '.join(allowed)}")
        self.check_keys(key, table, allowed)
        for name in needed:
            if name not in table:
                raise self.missing(f"{key}.{name}")

    def has(self, key: str) -> bool:
        """Return whether a key of a table is given."""
        table, name = key.split(".", 1)
        return name in self.tree.get(table, {})

    def table(self, name: str) -> Mapping:
        """Return a whole table, empty if it is absent, or several of `PAIRS`."""
        table = self.tree.get(name, {})
        if name == PAIRS and isinstance(table, list):
            return {}
        if not isinstance(table, Mapping):
            raise self.error(name, table, "must be a table")
        return table

    def top(self, key: str, default: object) -> object:
        """Return the value of a key outside tables."""
        return self.tree.get(key, default)

    def get(self, key: str, default: object = None) -> object:
        """Return the value of a key; one without a default is required."""
        table, name = key.split(".", 1)
        if name in self.tree.get(table, {}):
            return self.tree[table][name]
        if default is None:
            raise self.missing(key)
        self.defaults[key] = default
        return default

    def read(self, table: str, key: Key) -> Any:
        """Return the value of a key as it is declared: of its default's type, within its limits."""
        name = f"{table}.{key.name}"
        value = self.get(name, key.default)
        if isinstance(key.default, bool):
            return self.flag(name, value)
        if isinstance(key.default, int):
            return self.whole(name, value, *key.limits)
        if isinstance(key.default, float):
            return self.within(name, value, *key.limits)
        return self.choice(name, value, key.limits)

    def number(self, key: str, value: object) -> float:
        """Return a value that must be a number as a float."""
        if isinstance(value, bool) or not isinstance(value, int | float) or math.isnan(value):
            raise self.error(key, value, "must be a number")
        return float(value)  # whole numbers have 64 bits

    def within(self, key: str, value: object, least: float, most: float, limit: str = "") -> float:
        """Return a number within bounds; `limit` is said before them."""
        number = self.number(key, value)
        if not least <= number <= most:
            raise self.error(key, value, f"must be {limit}from {least:g} to {most:g}")
        return number

    def positive(
        self, key: str, value: object, least: float = LEAST, most: float = LARGEST
    ) -> float:
        """Return a number above 0, by default within the range that any unit gives it."""
        return self.within(key, value, least, most, "above 0, ")

    def whole(self, key: str, value: object, least: int, most: int) -> int:
        """Return a whole number within bounds."""
        if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= most:
            raise self.error(key, value, f"must be a whole number from {least} to {most}")
        return value

    def flag(self, key: str, value: object) -> bool:
        """Return true or false."""
        if not isinstance(value, bool):
            raise self.error(key, value, "must be true or false")
        return value

    def choice(self, key: str, value: object, allowed: Iterable[str]) -> str:
        """Return one of the known words."""
        words = tuple(allowed)
        if not isinstance(value, str) or value not in words:
            raise self.error(key, value, f"must be one of {', '.join(words)}")
        return value

    def choices(self, key: str, value: object, allowed: Iterable[str]) -> tuple[str, ...]:
        """Return a list of known words, each once."""
        words = tuple(allowed)
        if not isinstance(value, list) or not all(isinstance(x, str) and x in words for x in value):
            raise self.error(key, value, f"must be a list of {', '.join(words)}")
        if len(set(value)) < len(value):
            raise self.error(key, value, "must not hold a word twice")
        return tuple(value)

    def names(self, key: str, value: object, what: str) -> tuple[str, ...]:
        """Return the names of one file or several; `what` describes them in the error."""
        listed = value if isinstance(value, list) else [value]
        if not listed or not all(isinstance(x, str) and x and x.isprintable() for x in listed):
            raise self.error(key, value, f"must be {what}")
        return tuple(listed)

    def numbers(
        self, key: str, content: object, ascending: bool, most: int = MAX_VALUES
    ) -> np.ndarray:
        """Return a number, a list of numbers, or a range table; `most` are counted beforehand.

        None: it is missing.
        """
        if content is None:
            raise self.missing(key)
        if isinstance(content, Mapping):
            return self._range(key, content, most)
        listed = content if isinstance(content, list) else [content]
        if not listed:
            raise self.error(key, content, "must not be empty")
        if len(listed) > most:
            raise self.error(key, content, f"must have at most {most} values, has {len(listed)}")
        values = np.array([self.number(key, value) for value in listed])
        if not np.all(np.isfinite(values)):
            raise self.error(key, content, "must be finite")
        if ascending and np.any(np.diff(values) <= 0):
            place = int(np.argmax(np.diff(values) <= 0))
            before, after = values[place : place + 2].tolist()
            raise self.error(key, content, f"must ascend, but {before!r} is followed by {after!r}")
        if np.unique(values).size != values.size:
            raise self.error(key, content, "must not hold a value twice")
        return values

    def pairs(self, key: str, value: object, listed: object, limit: str) -> np.ndarray:
        """Return listed pairs of numbers, shape (k, 2), of which the value is made."""
        if not isinstance(listed, list) or not listed:
            raise self.error(key, value, limit)
        if not all(isinstance(pair, list) and len(pair) == 2 for pair in listed):
            raise self.error(key, value, limit)
        return np.array([[self.number(key, end) for end in pair] for pair in listed])

    def spans(self, key: str, value: object, listed: object, limit: str) -> np.ndarray:
        """Return listed pairs of a low and a high number, as `pairs` does."""
        spans = self.pairs(key, value, listed, limit)
        low, high = spans.T
        if not np.all((low >= -MAX_END) & (low < high) & (high <= MAX_END)):
            limit = f"must have low below high, both at most {MAX_END:g}"
            raise self.error(key, value, limit)
        return spans

    def forcing(self, name: str) -> np.ndarray:
        """Read the frequencies ``omega`` or the amplitudes ``amplitude``, ascending, of a sweep.

        In place of frequencies Omega ``frequency`` is in cycles per unit of time.
        """
        key, cycles, unit = f"sweep.{name}", "sweep.frequency", 1.0
        if name == "omega" and self.has(cycles):
            if self.has(key):
                limit = f'does not go with {key}: remove one (= "unset" where it is inherited)'
                raise self.error(cycles, self.get(cycles), limit)
            key, unit = cycles, 2.0 * math.pi
        content = self.get(key)
        if isinstance(content, str):
            limit = "must be numbers: formulas are of paths (sweeps, attractors), no single points"
            raise self.error(key, content, limit)
        numbers = self.numbers(key, content, ascending=name == "amplitude")
        self.check_range(key, unit, **{name: numbers})
        return unit * numbers

    def check_range(self, key: str, unit: float = 1.0, **forcing: Any) -> None:
        """Refuse frequencies ``omega``, in a unit, and amplitudes that no solver can start from."""
        for name, numbers in forcing.items():
            symbol, zero, least, most = RANGES[name]
            values = np.asarray(numbers)
            inside = (least <= unit * values) & (unit * values <= most)
            wrong = values[~(inside | ((values == 0) & bool(zero)))]
            if wrong.size:
                symbol += " / 2 pi" * (unit != 1.0)
                limit = f"{symbol} must be {zero}from {least / unit:.4g} to {most / unit:.4g}"
                raise self.error(key, wrong[0], limit)

    def tie(self, key: str, text: str, names: Collection[str]) -> Tie:
        """Read a formula that gives Omega or A from named parameters."""
        try:
            value, text = formula(text, names)
        except ValueError as error:
            raise self.error(key, text, str(error)) from None
        return Tie(key.removeprefix("sweep."), text, value)

    def tied(self, key: str, text: str, parameters: Mapping[str, np.ndarray]) -> np.ndarray:
        """Return Omega or A by a formula at each value of its parameters."""
        value = self.tie(key, text, parameters).of
        _, zero, least, most = RANGES[key.removeprefix("sweep.")]
        tied = np.empty(np.shape(next(iter(parameters.values()))))
        for place in np.ndindex(tied.shape):
            at = {name: float(numbers[place]) for name, numbers in parameters.items()}
            tied[place] = value(**at)
            if not least <= tied[place] <= most and not (zero and tied[place] == 0):
                where = ", ".join(f"{name} = {number:.6g}" for name, number in at.items())
                result = "overflows" if math.isinf(tied[place]) else f"is {tied[place]:.6g}"
                limit = f"must be {zero}from {least:g} to {most:g}, {result} at {where}"
                raise self.error(key, text, limit)
        return tied

    def _range(self, key: str, table: Mapping, most: int) -> np.ndarray:
        self.check_table(key, table, RANGE_KEYS, ("from", "to"))
        low, high = (self.within(f"{key}.{k}", table[k], -1e300, 1e300) for k in ("from", "to"))
        if not low < high:
            raise self.error(f"{key}.from", low, f"must be less than to = {high!r}")
        if ("count" in table) == ("step" in table):
            raise JobError("needs either count or step beside from and to", key, self.source)
        if "count" in table:
            count = self.whole(f"{key}.count", table["count"], 2, most)
            return _grid(low, (Fraction(repr(high)) - Fraction(repr(low))) / (count - 1), count)
        step = self.number(f"{key}.step", table["step"])
        if not (0 < step <= high - low and (high - low) / step < most):
            limit = f"above 0, at most to - from = {high - low:g}, and give at most {most} values"
            raise self.error(f"{key}.step", step, f"must be {limit}")
        n_steps = math.floor((high - low) / step * (1 + 1e-12) + 1e-9)
        return _grid(low, Fraction(repr(step)), n_steps + 1)


def _hint(key: str, allowed: Sequence[str], keys: Mapping[str, Sequence[str]]) -> str:
    """Suggest the key meant by an unknown one: by meaning, by place, by spelling."""
    meant = MEANT.get(key)
    if meant in allowed:
        return f"did you mean {meant!r}?"
    if homes := [table for table in keys if key in keys[table]]:
        return f"it belongs in [{homes[0]}]" if homes[0] else "it belongs at the top of the file"
    if meant and (homes := [table for table in keys if table and meant in keys[table]]):
        return f"did you mean '{homes[0]}.{meant}'?"
    if near := difflib.get_close_matches(key, allowed, n=1, cutoff=NEAR):
        return f"did you mean {near[0]!r}?"
    return f"known are {', '.join(allowed)}"


def _grid(low: float, step: Fraction, count: int) -> np.ndarray:
    """Return the numbers nearest to low + k step, low as it is written: 0.06, not 0.059999...

    A quotient of whole numbers is rounded once by Python, whatever their size, and by numpy where
    both are exact in double precision.
    """
    first = Fraction(repr(low))
    unit = math.lcm(first.denominator, step.denominator)
    start, way = int(first * unit), int(step * unit)
    if max(unit, abs(start), abs(start + (count - 1) * way), way) < 2**53:
        return (start + way * np.arange(count)) / unit
    return np.fromiter(((start + k * way) / unit for k in range(count)), float, count)
