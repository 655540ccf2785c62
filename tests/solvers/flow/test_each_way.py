"""One short motion of each way of advancing: the numbers that `each_way.json` keeps.

As plain Python, where an index out of bounds is an error, a motion has to go its way, too: the
functions named beside it are called. As a script it writes the numbers of this process anew.
"""

import json
import math
import sys
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numba
import numpy as np
import pytest
from together import together
from tools import flat

import hpcsweep
from hpcsweep import Building, Contact, Slider, Structure
from hpcsweep.kernels.simd.vectors import LANES
from hpcsweep.solvers.flow import FlowMap
from hpcsweep.solvers.flow.orbit.batch import Rules
from hpcsweep.solvers.flow.record_map import RecordMap
from hpcsweep.solvers.flow.state import shared, tables
from hpcsweep.solvers.free_motion import FreeMotion
from hpcsweep.solvers.solver import make_solver

KEPT = Path(__file__).with_suffix(".json")
ROUNDING, IN_LAYER, OF_KINKS = 1e-11, 1e-8, 1e-5
"""Of numbers, in the largest of their kind: of exact steps; with layers, in which the lengths of
steps jump with rounding; of integrals of moduli and of differences there."""
SPRINGS = np.array([[40.0, -20, 0], [-20, 40, -20], [0, -20, 20]])
STOPS = [Contact((0, 0, 1), 0.2, 500.0), Contact((0, 1, 0), 0.15, 300.0)]
LOSSY = [Contact((0, 0, 1), 0.3, 500.0, damping=5.0), Contact((-1, 1, 0), 0.1, 300.0)]
BRACES = [Slider((-1, 1, 0), 10.0, 0.2), Slider((0, -1, 1), 10.0, 0.1)]
WORN = {"theta_p": 0.01, "theta_pc": 0.05, "Lambda": 0.4, "rule": "pinching"}
WORN |= {"kappa_f": 0.3, "kappa_d": 0.5}
COUPLED = np.diag([0.3, 0.1, 0.7])
START = np.array([0.1, 0.2, 0.25, 0.3, 0.5, 0.9])
FAST = np.array([0.5, 0.99, 0.985, 0.0, 0.0, 0.4])
SLOW = np.array([0.5, 0.9, 0.9922, 0.05, -0.1, 0.13])
YIELDING = {"yield_drift": 0.01, "hardening": 0.05}
EIGHT = np.eye(8) - np.eye(8, k=-1)


def of(contacts=(), **more) -> Structure:
    if "damping" not in more:
        more["damping_ratio"] = (0.02, 0.3, 1.5)
    return Structure.from_matrices((1.0,) * 3, SPRINGS, contacts, **more)


def towers(contact=None, gap=0.01, **more) -> Structure:
    both = [Building([2.5e5] * n, k, **(more or YIELDING)) for n, k in ((2, 3e8), (3, 2e8))]
    return hpcsweep.adjacent(both, gap=gap, stiffness=2e9, **(contact or {}))


def noise(n: int, dt: float, size: float) -> tuple[np.ndarray, float]:
    return size * np.random.default_rng(1).standard_normal(n), dt


def lanes_are_padded(own) -> None:
    """Assert that what eights of accelerations have beyond the last floor is 0."""
    beyond = np.arange(own.end.size // 2) >= own.poly.shape[1]
    assert not own.end.reshape(-1, 2, LANES).swapaxes(0, 1).reshape(2, -1)[:, beyond].any()


def motion(structure, omega=3.0, amplitude=3.0, start=START) -> dict[str, np.ndarray]:
    """What is told of one period: all that is gathered, the tangent map, and the fast way alone."""
    start = np.r_[start, np.zeros(structure.state_units.size - start.size)]
    solver = make_solver("flow", structure, omega, 1e-9, yields=True)
    seen = solver.observe(start, amplitude, 1, True, True, measures=shared.ANY_MEASURE)
    lanes_are_padded(solver._shared.outputs)
    end = solver.advance(start, amplitude, 1).state
    told = {"points": np.r_[seen.points.ravel(), end], "measures": flat(seen.measures)}
    told["norm"] = seen.modal_norm
    if structure.sliders:
        return told | {"slid": np.concatenate([np.ravel(v) for v in seen.slid.values()])}
    return told | {"tangent": solver.monodromy(start, amplitude, 1)[1], "growth": seen.growth}


def response(structure, samples, scale=1.0, at_samples=False, **more) -> dict[str, np.ndarray]:
    samples, dt = samples
    solver = RecordMap(structure, dt, **more)
    found = solver.respond(samples, scale, 0.3 * dt, at_samples=at_samples)
    if not at_samples:
        lanes_are_padded(solver._shared.outputs)
    told = {name: value for name, value in vars(found).items() if not name.endswith("time")}
    told = told | {"energy": found.energy} if more.get("energy") else told
    return {k: np.asarray(v, float) for k, v in told.items() if np.ndim(v) and np.size(v)}


def free() -> dict[str, np.ndarray]:
    structure = Structure(3, 1000.0, math.inf, 0.05)
    window = FreeMotion(structure, 0.3, 100, 3, 1e-6).window(np.zeros(6), 1e-3)
    return {"points": window.points}


def orbits() -> dict[str, np.ndarray]:
    """Runs in a row, with Newton's method: to an orbit with impacts, and a closed form."""
    structure = Structure(1, 100.0, math.inf, 0.2)
    rules = Rules(2, 1e-8, 1e-6, 1e-3, 60, 4)
    found = FlowMap(structure, 0.8).follow_orbits(np.array([0.5]), np.zeros(2), rules, None)
    return {"points": found.state, "period": found.orbits.length}


class Way(NamedTuple):
    """A motion that goes a way: functions that are called on it, and what its numbers are like."""

    functions: str
    move: Callable[[], dict[str, np.ndarray]]
    error: float = ROUNDING
    in_modes: bool = False


WAYS = {
    "without contact": Way("free.is_free", free),
    "tables": Way(
        "events.coast ending.end_at_event propagators.product propagators.tangent_of_steps",
        lambda: motion(of(STOPS, harmonics=((1, 1.0, 0.3), (3, 0.5, 0.1)))),
    ),
    "fast passages": Way(
        "crossing.add_kick tangent.passage_tangent gather._integrate_again",
        lambda: motion(Structure(3, 1000.0, 1e4, 0.0), 2 * math.pi, 0.02, FAST),
        IN_LAYER,
    ),
    "one contact in its layer": Way(
        "equation.take_step equation.step_tangent equation.write_part",
        lambda: motion(
            Structure(3, 1000.0, 1e4, 0.05), 2 * math.pi, 0.02, SLOW - 0.09 * EIGHT[5, :6]
        ),
        IN_LAYER,
    ),
    "soft layers": Way(
        "step.volterra_steps tables.have_part measures.measure_layer_step",
        lambda: motion(of(STOPS, sharpness=20.0), 18.0),
        IN_LAYER,
    ),
    "collocation": Way(
        "scheme.collocate variations.layer_tangent measures.measure_layer_step",
        lambda: motion(of(STOPS, sharpness=20.0, damping=COUPLED), 18.0),
        IN_LAYER,
    ),
    "dashpots": Way(
        "march.march_elements contacts.change_tangent peaks._raise_force",
        lambda: motion(of(LOSSY, damping=COUPLED)),
    ),
    "sliders": Way(
        "elements.pass_guard yielding_map._march", lambda: motion(of(LOSSY, sliders=BRACES))
    ),
    "sliders in layers": Way(
        "elements.visit_layers scheme.add_sliders_at_stages",
        lambda: motion(of(STOPS, sliders=BRACES, sharpness=20.0), 9.0, 9.0),
        IN_LAYER,
    ),
    "orbits": Way("newton.newton_orbit transient.watch_motion batch._finish", orbits),
    "records": Way(
        "interval.march_interval accelerations._ends_by_tables",
        lambda: response(towers(damping_ratio=0.05), noise(50, 0.02, 6.0), base_shear=True),
    ),
    "records at samples": Way(
        "record._sample_peaks",
        lambda: response(towers(), noise(50, 0.02, 6.0), at_samples=True),
    ),
    "records that yield and pound": Way(
        "series.expand_series accelerations._ends_in_series",
        lambda: response(towers(), noise(80, 0.02, 6.0)),
    ),
    "records that degrade": Way(
        "degrading._begin_excursion elements._turn degrading._towards_global",
        lambda: response(
            towers(yield_drift=0.01, collapse_drift=0.5, backbone=WORN), noise(80, 0.02, 12.0)
        ),
    ),
    "records with dashpots and limits": Way(
        "interval._pass_guard energies.energies_on_segment record_map._end",
        lambda: response(
            towers(
                contact={"restitution": 0.6}, yield_drift=0.01, hardening=0.05, collapse_drift=0.05
            ),
            noise(80, 0.02, 12.0),
            energy=True,
        ),
    ),
    "records in layers": Way(
        "elements.visit_layers accelerations._acceleration_at",
        lambda: response(of(STOPS, sliders=BRACES, sharpness=20.0), noise(10, 0.2, 8.0)),
        IN_LAYER,
    ),
    "series without tables": Way(
        "series.expand_series",
        lambda: response(
            Structure.from_matrices(
                np.ones(8),
                0.3 * EIGHT.T @ EIGHT,
                [Contact(np.eye(8)[7], 0.8, 50.0)],
                damping=0.3 * EIGHT.T @ EIGHT,
                sliders=[Slider(row, 5.0, 1.0) for row in EIGHT],
            ),
            noise(20, 0.3, 4.0),
        ),
    ),
    "strides": Way(
        "strides.stride events.look_ahead spectral._write_exponential",
        lambda: motion(of(STOPS), amplitude=1.0),
        in_modes=True,
    ),
    "steps in modes": Way(
        "spectral.modal_step spectral.spectral_step",
        lambda: motion(of(LOSSY, damping=COUPLED)),
        in_modes=True,
    ),
    "coupled layers": Way(
        "equation.step_tangent equation.write_part",
        lambda: motion(of(STOPS, sharpness=400.0), 9.0, 9.0),
        IN_LAYER,
        in_modes=True,
    ),
    "records in modes": Way(
        "accelerations._ends_in_modes accelerations._ends_of_polynomial accelerations._add_forcing",
        lambda: response(towers(gap=0.004), noise(60, 0.02, 8.0), base_shear=True),
        in_modes=True,
    ),
    "yielding records in modes": Way(
        "accelerations._ends_of_polynomial elements.change",
        lambda: response(of(LOSSY, sliders=BRACES, damping=COUPLED), noise(60, 0.05, 8.0)),
        in_modes=True,
    ),
}


def go(way: Way) -> dict[str, list[float]]:
    """Return what tells whether numbers differ: of each kind their size, and two sums of all."""
    with pytest.MonkeyPatch.context() as patched:
        for name in ("LARGE", "LARGE_COUPLED", "LARGE_SPARED") if way.in_modes else ():
            patched.setattr(tables, name, 1)  # as large structures do
        shared._pattern_of.cache_clear()
        told = way.move()
    shared._pattern_of.cache_clear()
    found = {}
    for name, value in told.items():
        flat = np.nan_to_num(np.ravel(value).astype(float))
        angle = np.arange(1.0, flat.size + 1.0)
        found[name] = [np.abs(flat).max(), np.cos(angle) @ flat, np.sin(angle) @ flat]
    return found


@together("name", WAYS)
def test_a_motion_of_each_way_is_the_one_kept(name):
    way, kept, called = WAYS[name], json.loads(KEPT.read_text())[name], set()
    if numba.config.DISABLE_JIT:
        sys.setprofile(lambda frame, event, _: event == "call" and called.add(frame.f_code))
    try:
        found = go(way)
    finally:
        sys.setprofile(None)
    if numba.config.DISABLE_JIT:
        names = {f"{Path(one.co_filename).stem}.{one.co_name}" for one in called}
        assert set(way.functions.split()) - names == set()
    assert found.keys() == kept.keys()
    for kind, values in found.items():
        coarse = kind in ("norm", "slid") and way.error != ROUNDING
        error = (OF_KINKS if coarse else way.error) * max(kept[kind][0], 1e-3)
        np.testing.assert_allclose(values, kept[kind], rtol=0, atol=error, err_msg=kind)


if __name__ == "__main__":
    lines = [f"{json.dumps(name)}: {json.dumps(go(way))}" for name, way in WAYS.items()]
    KEPT.write_text("{" + ",\n".join(lines) + "}\n")
