"""What is handed to a public call by mistake is refused in one line that names it."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction

import numpy as np
import pytest
from claims import judge_files
from tools import SMALL

import hpcsweep
from hpcsweep.campaign import run as campaign
from hpcsweep.campaign.status import status
from hpcsweep.campaign.summary import summarize
from hpcsweep.checks.validate import validate
from hpcsweep.dynamics import classify, orbit, stability
from hpcsweep.figures.diagrams import orbit_diagram
from hpcsweep.job import load_job, parse_job
from hpcsweep.model import arguments
from hpcsweep.parallel.mpi import Serial
from hpcsweep.solvers.bdf import BdfMap
from hpcsweep.solvers.flow import FlowMap
from hpcsweep.solvers.solver import make_solver
from hpcsweep.solvers.trajectory import trajectory
from hpcsweep.store import Frames, job_of, open_layout, pack, read_layout

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
NO_NUMBER = {**ODD, "nan": math.nan}
NOT_FINITE = {**NO_NUMBER, "inf": math.inf, "minus inf": -math.inf}
NOT_POSITIVE = {**NOT_FINITE, "zero": 0.0, "negative": -0.1, "minus huge": -HUGE}
NO_STATE = {
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
NO_FINITE_STATE = {**NO_STATE, "nan": [math.nan] * 4, "inf": np.array([0.0, 0.0, 0.0, math.inf])}
NO_LABELS = {k: v for k, v in NO_COUNT.items() if k not in ("empty", "range of texts")}
NO_PATH = {**{k: v for k, v in ODD.items() if k != "text"}, "nothing": "", "number": 3}
NO_STRUCTURE = {**ODD, "class": hpcsweep.Structure}
NO_WORD = {**ODD, "other": "euler"}

PAIR = hpcsweep.Structure(2)
STATE = np.zeros(4)


@dataclass
class Call:
    """A public call with good arguments, and what none of its arguments may be."""

    function: Callable
    good: dict
    bad: dict[str, dict]


def solver_calls(make: Callable) -> dict[str, Call]:
    """Return the calls of a solver's methods."""
    motion = {"state": STATE, "amplitude": 0.02, "n_periods": 2}
    bad = {"state": NO_STATE, "amplitude": ODD, "n_periods": NO_COUNT}
    closing = {"max_period": 4, "settled": 1e-8, "same": 1e-6, "near": 0.0}

    def method(name: str) -> Callable:
        return lambda **given: getattr(make(PAIR, 0.6, 1e-6), name)(**given)

    calls = {name: Call(method(name), motion, bad) for name in ("advance", "points", "monodromy")}
    calls["observe"] = Call(method("observe"), {**motion, "growth": True}, bad)
    no_number = dict.fromkeys(("settled", "same", "near"), ODD)
    no_closing = {"max_period": {**NO_COUNT, "zero": 0}, **no_number}
    calls["settle"] = Call(
        method("settle"), {**motion, **closing}, {**bad, **(no_closing if make is FlowMap else {})}
    )
    made_of = {"structure": PAIR, "omega": 0.6, "rtol": 1e-6}
    no_solver = {"structure": NO_STRUCTURE, "omega": NOT_POSITIVE}
    calls["made"] = Call(make, made_of, {**no_solver, "rtol": {**NOT_POSITIVE, "one": 1.0}})
    return {f"{make.__name__}.{name}": call for name, call in calls.items()}


ABOUT = {"structure": PAIR, "amplitude": 0.02, "omega": 0.6, "state": STATE}
NOT_ABOUT = {
    "structure": NO_STRUCTURE,
    "amplitude": NOT_FINITE,
    "omega": NOT_POSITIVE,
    "state": NO_FINITE_STATE,
}
POINTS = np.tile([[0.1, 0.2], [0.3, 0.1]], (10, 1))
NO_POINTS = {**ODD, "a number": 1.0, "one axis": [1.0, 2.0]}
CALLS = {
    "Structure": Call(
        hpcsweep.Structure,
        {"n_floors": 2, "stiffness_ratio": 10.0, "sharpness": 1e3, "damping_ratio": 0.05},
        {
            "n_floors": {**NO_COUNT, "zero": 0, "many": 65},
            "stiffness_ratio": {**NOT_FINITE, "negative": -1.0},
            "sharpness": {**NO_NUMBER, "negative": -1.0},
            "damping_ratio": {**NOT_FINITE, "negative": -1.0, "three": [0.1] * 3},
        },
    ),
    "linear_steady_state": Call(
        PAIR.linear_steady_state, {"omega": 0.3}, {"omega": {**NOT_FINITE, "large": 1e200}}
    ),
    "grazing_amplitude": Call(PAIR.grazing_amplitude, {"omega": 0.3}, {"omega": NOT_FINITE}),
    "stroboscopic_points": Call(
        hpcsweep.stroboscopic_points,
        {**ABOUT, "n_periods": 2, "solver": "flow", "rtol": 1e-9},
        {
            **NOT_ABOUT,
            "n_periods": {**NO_COUNT, "more than memory": 10**12},
            "solver": NO_WORD,
            "rtol": {**NOT_POSITIVE, "one": 1.0},
        },
    ),
    "trajectory": Call(
        trajectory, {**ABOUT, "n_samples": 5}, {**NOT_ABOUT, "n_samples": {**NO_COUNT, "one": 1}}
    ),
    "make_solver": Call(
        lambda solver, **rest: make_solver(solver, **rest),
        {"solver": "flow", "structure": PAIR, "omega": 0.6, "rtol": 1e-6},
        {
            "solver": NO_WORD,
            "structure": NO_STRUCTURE,
            "omega": NOT_POSITIVE,
            "rtol": {**NOT_POSITIVE, "two": 2},
        },
    ),
    **solver_calls(FlowMap),
    **solver_calls(BdfMap),
    "orbit_period": Call(
        orbit.orbit_period,
        {"points": POINTS, "max_period": 4, "tolerance": 1e-6},
        {"points": NO_POINTS, "max_period": {**NO_COUNT, "zero": 0}, "tolerance": NO_NUMBER},
    ),
    "floquet_multipliers": Call(
        stability.floquet_multipliers,
        {"matrix": np.eye(4)},
        {"matrix": {**NO_POINTS, "oblong": np.ones((2, 3)), "nan": np.full((2, 2), math.nan)}},
    ),
    "orbit_exponent": Call(
        lambda **given: stability.orbit_exponent(FlowMap(PAIR, 0.6), **given),
        {"state": STATE, "amplitude": 0.02, "period": 1},
        {"state": NO_STATE, "amplitude": ODD, "period": {**NO_COUNT, "zero": 0}},
    ),
    "classify_points": Call(
        classify.classify_points,
        {"points": POINTS, "growth": 0.0, "tolerance": 1e-6},
        {"points": NO_POINTS, "growth": ODD, "tolerance": NO_NUMBER},
    ),
    "on_closed_curve": Call(classify.on_closed_curve, {"points": POINTS}, {"points": NO_POINTS}),
    "contact_name": Call(
        classify.contact_name,
        {"contact": 3, "labels": 2},
        {"contact": NO_COUNT, "labels": NO_LABELS},
    ),
}


def cases(calls: dict[str, Call]) -> list:
    """Return every odd value of every argument of every call."""
    return [
        pytest.param(call, argument, value, id=f"{name}-{argument}-{odd}")
        for name, call in calls.items()
        for argument, values in call.bad.items()
        for odd, value in values.items()
    ]


def refused(call: Callable, argument: str) -> None:
    with pytest.raises(ValueError, match=argument) as error:
        call()
    said = str(error.value)
    assert said.startswith(argument)
    assert len(said.splitlines()) == 1
    assert len(said) < 200
    assert any(word in said for word in ("must", "has shape"))


@pytest.mark.parametrize("name", CALLS)
def test_what_is_right_is_taken(name):
    assert CALLS[name].function(**CALLS[name].good) is not None


@pytest.mark.parametrize(("call", "argument", "value"), cases(CALLS))
def test_an_odd_value_is_refused_by_its_name(call, argument, value):
    refused(lambda: call.function(**{**call.good, argument: value}), argument)


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    path = tmp_path_factory.mktemp("arguments") / "small.h5"
    text = SMALL.replace("count = 4", "count = 2").replace("count = 11", "count = 3")
    assert campaign.run(parse_job(text, "small", "small"), path, Serial()) == 0
    return path


OF_FILES = {
    "open_results": hpcsweep.open_results,
    "job_of": job_of,
    "open_layout": open_layout,
    "read_layout": read_layout,
    "Frames": Frames,
    "pack": pack,
    "validate": validate,
    "status": status,
    "summarize": summarize,
    "load_job": load_job,
}


@pytest.mark.parametrize("odd", NO_PATH)
@pytest.mark.parametrize("name", OF_FILES)
def test_what_is_no_path_is_refused(name, odd):
    refused(lambda: OF_FILES[name](NO_PATH[odd]), "path")


NO_PATHS = {**NO_PATH, "one path": "a.h5", "of numbers": [1, 2]}
"""What is no sequence of paths; one that is empty, or of texts, is one."""


@pytest.mark.parametrize("odd", sorted(NO_PATHS.keys() - {"empty", "range of texts"}))
def test_what_are_no_paths_is_refused(odd):
    refused(lambda: judge_files(NO_PATHS[odd]), "paths")


@pytest.mark.parametrize("odd", NO_COUNT)
def test_odd_counts_for_a_file_are_refused(odd, results):
    value = NO_COUNT[odd]
    refused(lambda: validate(results, samples=value), "samples")
    refused(lambda: validate(results, samples=0, seed=value), "seed")
    frames = Frames(results)
    try:
        refused(lambda: frames.dataset(value), "frame")
        refused(lambda: frames.read(value, ("drift",)), "frame")
        refused(lambda: frames.gather(["drift"], [value]), "frame")
    finally:
        frames.close()


@pytest.mark.parametrize("odd", [name for name in ODD if name not in ("empty", "range of texts")])
def test_odd_names_and_texts_are_refused(odd, results, tmp_path):
    value = ODD[odd]
    frames = Frames(results)
    try:
        refused(lambda: frames.read(0, value), "names")
        refused(lambda: frames.gather(value), "names")
        if value is not None:
            refused(lambda: frames.gather(["drift"], direction=value), "direction")
    finally:
        frames.close()
    if not isinstance(value, str):
        refused(lambda: parse_job(value, "job", "job"), "text")
        refused(lambda: parse_job(SMALL, value, "job"), "source")
        refused(lambda: parse_job(SMALL, "job", value), "default_name")
    refused(lambda: load_job(tmp_path / "job.toml", value), "settings")
    opened = hpcsweep.open_results(results)
    refused(lambda: classify.classify(value, job_of(results).settings), "results")
    refused(lambda: classify.classify(opened, value), "settings")
    if value is not None:
        picture = tmp_path / "x.png"
        refused(lambda: orbit_diagram.draw(opened, picture, omega=value), "omega")
        assert not picture.exists()


def test_numbers_of_numpy_fractions_and_arrays_without_dimensions_are_numbers():
    plain = hpcsweep.stroboscopic_points(PAIR, 0.25, 0.5, [0.0, 0.5, 0.0, 0.25], 3)
    other = hpcsweep.stroboscopic_points(
        hpcsweep.Structure(np.int64(2), np.float32(1000.0), 10**4, Fraction(1, 20)),
        Fraction(1, 4),
        np.array(0.5),
        [0, Fraction(1, 2), np.float32(0), 0.25],
        np.uint8(3),
        rtol=np.float64(1e-9),
    )
    assert np.array_equal(plain, other)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (HUGE, "a whole number of 1329 bits"),
        (LONG, "a whole number of 16610 bits"),
        ("x" * 1000, "'xxxxxxxxxxxx...xxxxxxxxxxxxx'"),
        (list(range(10**6)), "[0, 1, 2, 3, 4, 5, ...]"),
        (np.zeros((30, 30)), "an array of float64, shape (30, 30)"),
        ("two\nlines", r"'two\nlines'"),
        (np.zeros((2, 2)), "an array of float64, shape (2, 2)"),
    ],
    ids=lambda value: value if isinstance(value, str) and len(value) < 60 else "of",
)
def test_values_are_shown_on_one_short_line(value, text):
    assert arguments.shown(value) == text
