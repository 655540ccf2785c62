"""What is handed to a public call by mistake is refused in one line that names it."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
import pytest
from claims import judge_files
from scipy.integrate import solve_ivp
from together import together
from tools import SMALL

import hpcsweep
from hpcsweep.campaign import run as campaign
from hpcsweep.campaign.status import status
from hpcsweep.campaign.summary import summarize
from hpcsweep.checks.validate import validate
from hpcsweep.job import load_job, parse_job
from hpcsweep.parallel.mpi import Serial
from hpcsweep.solvers.bdf import BdfMap
from hpcsweep.solvers.flow import FlowMap
from hpcsweep.solvers.solver import make_solver
from hpcsweep.solvers.trajectory import trajectory
from hpcsweep.store import Frames, job_of, open_layout, pack, read_layout

NO_COUNT = {"half": 0.5}
NO_NUMBER = {"dict": {0: 0.1}}
NOT_FINITE = {"inf": math.inf}
NOT_POSITIVE = {"zero": 0.0}
NO_STATE = {"short": [0.0] * 3}
NO_FINITE_STATE = {"nan": [math.nan] * 4}
NO_LABELS = {"number": 0.5}
NO_STRUCTURE = {"class": hpcsweep.Structure}
NO_WORD = {"other": "euler"}
"""One value that the check of each kind of argument refuses, and no laxer one does: see
`tests/model/test_argument_checks.py` for all that is odd."""

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
    bad = {"state": NO_STATE, "amplitude": NO_NUMBER, "n_periods": NO_COUNT}
    closing = {"max_period": 4, "settled": 1e-8, "same": 1e-6, "near": 0.0}

    def method(name: str) -> Callable:
        return lambda **given: getattr(make(PAIR, 0.6, 1e-6), name)(**given)

    calls = {name: Call(method(name), motion, bad) for name in ("advance", "points", "monodromy")}
    calls["observe"] = Call(method("observe"), {**motion, "growth": True}, bad)
    no_number = dict.fromkeys(("settled", "same", "near"), NO_NUMBER)
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
NO_POINTS = {"one axis": [1.0, 2.0]}
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
    "lyapunov_spectrum": Call(
        hpcsweep.lyapunov_spectrum,
        {**ABOUT, "error": 0.1, "max_cycles": 20, "classify_cycles": 0, "solver": "flow"},
        {
            **NOT_ABOUT,
            "error": NOT_POSITIVE,
            "max_cycles": {**NO_COUNT, "few": 19},
            "classify_cycles": NO_COUNT,
            "solver": NO_WORD,
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
}


def cases(calls: dict[str, Call]) -> list:
    """Return every odd value of every argument of every call."""
    return [
        (call, argument, value)
        for call in calls.values()
        for argument, values in call.bad.items()
        for value in values.values()
    ]


def refused(call: Callable, argument: str) -> None:
    with pytest.raises(ValueError, match=argument) as error:
        call()
    said = str(error.value)
    assert said.startswith(argument)
    assert len(said.splitlines()) == 1
    assert len(said) < 200
    assert any(word in said for word in ("must", "has shape"))


def moved(t, z):
    """Return the velocity and acceleration of the pair without contact, from its matrices."""
    u, v = z[:2], z[2:]
    force = -0.02 * math.sin(0.6 * t)
    return [*v, *(force - PAIR.stiffness_matrix @ u - PAIR.damping_matrix @ v)]


AFTER = solve_ivp(
    moved,
    (0, 4 * math.pi / 0.6),
    STATE,
    "DOP853",
    rtol=1e-11,
    atol=1e-13,
    t_eval=[2 * math.pi / 0.6, 4 * math.pi / 0.6],
).y.T
"""The state after one forcing period, and after two."""
STEADY = np.linalg.solve(
    PAIR.stiffness_matrix + 0.3j * PAIR.damping_matrix - 0.09 * np.eye(2), [-1.0, -1.0]
)
RIGHT = {
    "Structure": lambda found: found.n_floors == 2 and found.sharpness == 1000.0,
    "linear_steady_state": lambda found: np.allclose(found, STEADY, rtol=1e-12),
    "grazing_amplitude": lambda found: math.isclose(found, 1.0 / np.abs(STEADY).max()),
    "stroboscopic_points": lambda found: np.allclose(found, AFTER, atol=1e-9),
    "lyapunov_spectrum": lambda found: (
        found.n_periods == 20 and math.isclose(found.exponents.sum(), -0.1 * PAIR.frequencies.sum())
    ),
    "trajectory": lambda found: np.allclose(found[[0, -1]], [STATE, AFTER[0]], atol=1e-9),
    "make_solver": lambda found: found.structure is PAIR and found.omega == 0.6,
    "advance": lambda found: np.allclose(found.state, AFTER[1], atol=1e-4),
    "points": lambda found: np.allclose(found[0], AFTER, atol=1e-4),
    "monodromy": lambda found: np.allclose(found[0], AFTER[1], atol=1e-4),
    "observe": lambda found: np.allclose(found.points, AFTER, atol=1e-4),
    "settle": lambda found: np.allclose(found.state, AFTER[1], atol=1e-4),
    "made": lambda found: found.structure is PAIR and found.omega == 0.6,
}
"""By the name of a call, whether it returned what it must, from the matrices or by hand."""


def test_what_is_right_is_taken():
    for name, call in CALLS.items():
        assert RIGHT[name.rpartition(".")[2]](call.function(**call.good)), name


@together("call, argument, value", cases(CALLS))
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


@together("name", OF_FILES)
def test_what_is_no_path_is_refused(name):
    refused(lambda: OF_FILES[name]("a\0b"), "path")


@together("odd", ["a.h5", [1, 2], {"a.h5"}])
def test_what_are_no_paths_is_refused(odd):
    refused(lambda: judge_files(odd), "paths")


def test_odd_counts_for_a_file_are_refused(results):
    refused(lambda: validate(results, samples=0.5), "samples")
    refused(lambda: validate(results, samples=0, seed=0.5), "seed")
    frames = Frames(results)
    try:
        refused(lambda: frames.dataset(0.5), "frame")
        refused(lambda: frames.dataset(frames.study.n_frames), "frame")
        refused(lambda: frames.read(0.5, ("drift",)), "frame")
        refused(lambda: frames.gather(["drift"], [0.5]), "frame")
    finally:
        frames.close()


def test_odd_names_and_texts_are_refused(results, tmp_path):
    frames = Frames(results)
    try:
        refused(lambda: frames.read(0, "drift"), "names")
        refused(lambda: frames.gather("drift"), "names")
        refused(lambda: frames.gather(["drift"], direction=1), "direction")
    finally:
        frames.close()
    refused(lambda: load_job(tmp_path / "job.toml", "a.b=1"), "settings")


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


MASKED = np.ma.masked_array([1.0, 2.0], [False, True])
FRAME = hpcsweep.Structure(2, 100.0, math.inf, 0.05)
SINE = hpcsweep.Record(np.sin(0.1 * np.arange(60)), 0.02)
FRICTION = hpcsweep.Slider((1.0,), 1e16, 0.3)


def moved(**given):
    """One period, with odd arguments."""
    usual = {"amplitude": 0.01, "omega": 0.5, "state": [0.0] * 4, "n_periods": 1}
    return hpcsweep.stroboscopic_points(FRAME, **(usual | given))


def curved(**given):
    """A curve through a special point, with odd arguments."""
    stop = hpcsweep.Structure(1, sharpness=math.inf)
    found = hpcsweep.branch(stop, 0.05, 1.0, [0.5, 0.0], 1, span=(0.02, 0.2))
    return hpcsweep.curve(stop, found.isel(special=0), **given)


@together(
    "call, named",
    [
        (lambda: hpcsweep.Structure(matrices=3), "matrices"),
        (lambda: hpcsweep.Structure(unreached=1), "unreached"),
        (lambda: hpcsweep.Structure(unreached="ab"), "unreached"),
        (lambda: hpcsweep.Structure(harmonics=np.array(2.0)), "harmonics"),
        (lambda: hpcsweep.Structure.from_matrices(np.array(2.0), [[1.0]], []), "matrices.mass"),
        (lambda: hpcsweep.Structure.from_matrices([1.0], [[1.0]], np.array(2.0)), "contacts"),
        (lambda: hpcsweep.Structure.from_matrices(MASKED, np.eye(2), []), "matrices.mass"),
        (
            lambda: hpcsweep.Structure.from_matrices([1.0], [[1.0]], [], sliders=[FRICTION]),
            "slider.stiffness",
        ),
        (lambda: hpcsweep.adjacent(3, 0.1, 1.0), "building"),
        (lambda: hpcsweep.adjacent(MASKED, 0.1, 1.0), "building"),
        (lambda: hpcsweep.Record(MASKED, 0.1), "acceleration"),
        (lambda: hpcsweep.history(FRAME, SINE, poll=3), "poll"),
        (lambda: hpcsweep.floor_spectra(FRAME, SINE, [1.0], poll=3), "poll"),
        (lambda: hpcsweep.floor_spectra(FRAME, SINE, [1.0], places=3), "places"),
        (lambda: hpcsweep.attractors(FRAME, 0.01, 0.5, box=10**400), "box"),
        (lambda: hpcsweep.attractors(FRAME, 0.01, 0.5, states=np.array(2.0)), "states"),
        (lambda: hpcsweep.attractors(FRAME, 0.01, 1e300), "omega"),
        (lambda: hpcsweep.orbit(FRAME, 0.01, 1e300, [0.0] * 4, 1), "omega"),
        (lambda: hpcsweep.lyapunov_spectrum(FRAME, 0.01, 1e-300, [0.0] * 4), "omega"),
        (lambda: hpcsweep.trajectory(FRAME, 0.01, 1e-300, [0.0] * 4), "omega"),
        (lambda: moved(omega=1e300), "omega"),
        (lambda: moved(state=np.ma.masked_array([0.0] * 4, [0, 0, 0, 1])), "state"),
        (lambda: moved(amplitude=np.ma.masked), "amplitude"),
        (lambda: hpcsweep.branch(FRAME, 0.01, 0.5, [0.0] * 4, 1, parameter=3), "parameter"),
        (lambda: hpcsweep.branch(FRAME, 0.01, 0.5, [0.0] * 4, 1, parameter=[]), "parameter"),
        (lambda: curved(parameters=3), "parameters"),
        (lambda: curved(parameters=("omega", "omega")), "parameters"),
        (lambda: curved(parameters=("omega", 1.0)), "parameter"),
        (lambda: hpcsweep.read_model(3), "path"),
        (lambda: hpcsweep.meanings(3), "variable"),
    ],
)
def test_an_odd_kind_of_value_is_refused_by_name(call, named):
    with pytest.raises(ValueError, match=rf"^{named}\b.* must be [^\n]*$|^{named} must be [^\n]*$"):
        call()
