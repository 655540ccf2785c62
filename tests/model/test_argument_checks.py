"""Functions that check arguments: what each takes, in which form, and what it refuses."""

import math
from collections.abc import Callable
from decimal import Decimal
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from together import together

from hpcsweep.model import arguments

HUGE = 10**400
LONG = 10**5000
"""Python refuses to write its digits."""
ODD = {
    "set": {0.1, 0.2},
    "dict": {0: 0.1},
    "text": "0.1",
    "bytes": b"0.1",
    "None": None,
    "bool": True,
    "complex": 0.1 + 0.2j,
    "huge": HUGE,
    "long": LONG,
    "decimal": Decimal("0.1"),
    "object array": np.array([None, {}], object),
    "wrong shape": np.zeros((2, 3, 4)),
    "ragged": [[1.0], [1.0, 2.0]],
    "empty": [],
    "function": len,
    "type": float,
    "range of texts": ["a", "b"],
}
NO_COUNT = {
    **ODD,
    "half": 0.5,
    "whole float": 2.0,
    "fraction": Fraction(7, 2),
    "whole fraction": Fraction(4, 2),
    "negative": -1,
    "nan": math.nan,
    "inf": math.inf,
}
NOT_FINITE = {**ODD, "nan": math.nan, "inf": math.inf, "minus inf": -math.inf}
NOT_POSITIVE = {**NOT_FINITE, "zero": 0.0, "negative": -0.1, "minus huge": -HUGE}
NO_VECTOR = {
    **{name: value for name, value in ODD.items() if name not in ("huge", "long")},
    "number": 0.1,
    "short": [0.0] * 3,
    "long list": [0.0] * 5,
    "columns": np.zeros((4, 1)),
    "with text": [0.0, 0.0, 0.0, "x"],
    "with None": [0.0, 0.0, 0.0, None],
    "with huge": [0.0, 0.0, 0.0, HUGE],
    "of complex": [0.0, 0.0, 0.0, 1j],
    "of bools": [True] * 4,
    "of sets": [{1}, {2}, {3}, {4}],
    "dates": np.zeros(4, "M8[s]"),
}
NO_FINITE_VECTOR = {
    **NO_VECTOR,
    "nan": [math.nan] * 4,
    "inf": np.array([0.0, 0.0, 0.0, math.inf]),
}
NO_FILE = {
    **{name: value for name, value in ODD.items() if name != "text"},
    "nothing": "",
    "number": 3,
    "NUL": "a\0b",
    "two lines": "a\nb",
    "long part": "x" * 256,
    "long": "x/" * 2048,
    "half a character": "\ud800",
}


def without(odd: dict, *names: str) -> dict:
    """Return odd values without some that a function takes."""
    return {name: value for name, value in odd.items() if name not in names}


REFUSED: dict[str, tuple[Callable, dict]] = {
    "real": (arguments.real, ODD),
    "number": (arguments.number, {**ODD, "nan": math.nan}),
    "number in a range": (
        lambda name, value: arguments.number(name, value, "from 0 to 1", 0.0, 1.0),
        {"below": -1e-300, "above": 1.0 + 1e-15, "inf": math.inf, "nan": math.nan},
    ),
    "finite": (arguments.finite, NOT_FINITE),
    "positive": (arguments.positive, NOT_POSITIVE),
    "count": (arguments.count, NO_COUNT),
    "count in a range": (
        lambda name, value: arguments.count(name, value, 2, 5),
        {"below": 1, "above": 6},
    ),
    "vector": (lambda name, value: arguments.vector(name, value, 4), NO_VECTOR),
    "finite_vector": (
        lambda name, value: arguments.finite_vector(name, value, 4),
        NO_FINITE_VECTOR,
    ),
    "finite_vectors": (
        lambda name, value: arguments.finite_vectors(name, value, 4),
        {**without(ODD, "empty"), "flat": [0.0] * 4, "nan": [[math.nan] * 4]},
    ),
    "array": (arguments.array, without(ODD, "huge", "long", "wrong shape", "empty")),
    "rows": (arguments.rows, {**ODD, "a number": 1.0, "one axis": [1.0, 2.0]}),
    "words": (arguments.words, {**without(ODD, "empty", "range of texts"), "numbers": [1, 2]}),
    "choice": (
        lambda name, value: arguments.choice(name, value, ("a", "b")),
        {**ODD, "other": "c"},
    ),
    "instance": (lambda name, value: arguments.instance(name, value, Fraction), ODD),
    "file_name": (arguments.file_name, NO_FILE),
}


@together("name", REFUSED)
def test_odd_values_are_refused_in_one_line_by_their_name(name):
    check, values = REFUSED[name]
    for odd, value in values.items():
        try:
            taken = check("given", value)
        except ValueError as error:
            said = str(error)
            assert said.startswith("given must "), (odd, said)
            assert len(said.splitlines()) == 1, (odd, said)
            assert len(said) < 200, odd
        else:
            pytest.fail(f"{odd} is taken as {taken!r}")


@together(
    "found, right",
    [
        (arguments.real("x", np.float32(0.5)), 0.5),
        (arguments.real("x", np.array(2)), 2.0),
        (arguments.real("x", Fraction(1, 4)), 0.25),
        (arguments.number("x", -math.inf), -math.inf),
        (arguments.number("x", 1, "from 0 to 1", 0.0, 1.0), 1.0),
        (arguments.positive("x", 5e-324), 5e-324),
        (arguments.count("x", np.uint8(3)), 3),
        (arguments.count("x", np.array(5), 2, 5), 5),
        (arguments.array("x", 0.5).tolist(), 0.5),
        (arguments.array("x", [Fraction(1, 2), 10**30]).tolist(), [0.5, 1e30]),
        (arguments.vector("x", (0, Fraction(1, 2), math.nan), 3).tolist()[:2], [0.0, 0.5]),
        (arguments.finite_vectors("x", [[1, 2], [3, 4]], 2).tolist(), [[1.0, 2.0], [3.0, 4.0]]),
        (arguments.finite_vectors("x", [], 2).shape, (0, 2)),
        (arguments.rows("x", [[1], [2]]).shape, (2, 1)),
        (arguments.words("x", ["a", "b"]), ("a", "b")),
        (arguments.words("x", []), ()),
        (arguments.choice("x", "b", ("a", "b")), "b"),
        (arguments.file_name("x", Path("a") / "b"), str(Path("a") / "b")),
        (arguments.file_name("x", "\udcff"), "\udcff"),  # of bytes that are not UTF-8
    ],
)
def test_what_is_right_is_returned_in_the_form_that_is_needed(found, right):
    assert found == right
    assert type(found) is type(right)


def test_vectors_are_copies():
    given = np.zeros(4)
    arguments.vector("x", given, 4)[0] = 1.0
    assert given[0] == 0.0


@together(
    "value, text",
    [
        (HUGE, "a whole number of 1329 bits"),
        (LONG, "a whole number of 16610 bits"),
        ([LONG], "a list"),
        ("x" * 1000, "'xxxxxxxxxxxx...xxxxxxxxxxxxx'"),
        (list(range(10**6)), "[0, 1, 2, 3, 4, 5, ...]"),
        (np.zeros((30, 30)), "an array of float64, shape (30, 30)"),
        ("two\nlines", r"'two\nlines'"),
        (np.zeros((2, 2)), "an array of float64, shape (2, 2)"),
    ],
)
def test_values_are_shown_on_one_short_line(value, text):
    shown = arguments.shown(value)
    # Python 3.14 says of a number in a list how long it is, before others refuse
    assert shown == text or (value == [LONG] and shown.startswith("[<int instance"))
