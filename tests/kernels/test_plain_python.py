"""Kernels as plain Python (NUMBA_DISABLE_JIT=1) agree with the compiled ones to rounding.

As a script it writes what the kernels of this process give: ``test_plain_python.py OUT.npz``.
"""

import math
import subprocess
import sys

import numba
import numpy as np
import pytest
from tools import environment

from hpcsweep.model.structure import Structure
from hpcsweep.solvers.flow import FlowMap

OMEGA = 0.445
SMOOTH, SOFT, STOP = 1e4, 50.0, math.inf
PERIODS = {
    # floors, sharpness, amplitude, displacement and velocity of every floor at the start
    "one floor, no contact": (1, SMOOTH, 0.01, 0.2, 0.1),
    "one floor, layer": (1, SOFT, 0.25, 0.9, 0.4),
    "two floors, fast passages": (2, SMOOTH, 0.06, 0.9, 0.4),
    "two floors, stop without layer": (2, STOP, 0.06, 0.9, 0.4),
    "two floors, layer": (2, SOFT, 0.06, 0.9, 0.4),
    "three floors, passages and layer": (3, SMOOTH, 0.06, 0.9, 0.2),
    "three floors, stop without layer": (3, STOP, 0.25, 0.9, 0.4),
    "at rest at the stop": (2, STOP, 0.06, 1.0, 0.0),
}
GRAZING = {"graze, no layer": (3, STOP), "graze in the layer": (3, SMOOTH)}
ORBITS = {
    # near: distance from which on Newton's method tries to jump, 0: never
    "closes": (1, STOP, 0.03, 0.0),
    "jump": (2, SMOOTH, 0.04, 1e-3),
}


def damped(n, sharpness):
    return Structure(n, 1000.0, sharpness, 0.2)


def results() -> dict[str, np.ndarray]:
    """Everything that is compared, by case and quantity."""
    found = {}

    def observe(case, structure, amplitude, z):
        flow = FlowMap(structure, OMEGA)
        seen = flow.observe(z, amplitude, 1, modal_norm=True, growth=True)
        _, matrix = flow.monodromy(z, amplitude, 1)
        found[f"{case}: visits"] = flow.counts[1] > 0, flow.counts[3] > 0
        found[f"{case}: points"] = seen.points
        found[f"{case}: exact"] = seen.contact, seen.outcome
        found[f"{case}: drift"] = seen.peak_drift
        found[f"{case}: growth"] = seen.growth
        found[f"{case}: modal norm"] = seen.modal_norm
        found[f"{case}: monodromy"] = matrix

    for case, (n, sharpness, amplitude, u, v) in PERIODS.items():
        structure = Structure(n, 1000.0, sharpness)
        observe(case, structure, amplitude, np.repeat([u, v], n))
    for case, (n, sharpness) in GRAZING.items():
        structure = Structure(n, 1000.0, sharpness)
        critical = structure.grazing_amplitude(OMEGA) * (1 + 1e-6)
        response = structure.linear_steady_state(OMEGA) * critical
        observe(case, structure, critical, np.append(response.imag, OMEGA * response.real))
    for case, (n, sharpness, amplitude, near) in ORBITS.items():
        flow = FlowMap(damped(n, sharpness), OMEGA)
        end = flow.settle(np.zeros(2 * n), amplitude, 40, 2, 1e-8, 1e-6, near)
        found[f"{case}: orbit"] = end.state
        found[f"{case}: exact"] = end.n_periods, end.n_newton, end.period, end.outcome
        found[f"{case}: multiplier"] = end.multiplier
    return {name: np.asarray(value) for name, value in found.items()}


TOLERANCES = {"drift": 1e-12, "points": 1e-12, "orbit": 1e-12}
"""Relative to the largest entry; of what is not named: the tangent map sums up more."""
OTHERWISE = 1e-11
AT_GRAZING = 1e-8
"""Of the tangent map where the speed v at the stop is 1e-3: it has terms 1 / v, and the rounding of
the state changes v by 1e-16 / v."""
MODAL_IN_LAYER = 1e-6
"""The step lengths in a layer jump with the rounding of the state, and the Gauss rule of a step
with a kink of |q_j| in it with them: compiled kernels, too, give norms that differ by 3e-7 where
the start differs by 1e-15."""


@pytest.fixture(scope="module")
def both(tmp_path_factory):
    if numba.config.DISABLE_JIT:
        pytest.skip("nothing is compiled here")
    out = tmp_path_factory.mktemp("plain") / "plain.npz"
    paths = ":".join(filter(None, sys.path))
    subprocess.run(
        [sys.executable, __file__, str(out)],
        check=True,
        env=environment(NUMBA_DISABLE_JIT="1", PYTHONPATH=paths),
    )
    with np.load(out) as plain:
        return results(), dict(plain)


@pytest.mark.slow
@pytest.mark.parametrize("case", [*PERIODS, *GRAZING, *ORBITS])
def test_plain_kernels_agree_with_compiled_ones(both, case):
    compiled, plain = both
    names = [name for name in compiled if name.startswith(f"{case}:")]
    assert names
    assert [name for name in plain if name.startswith(f"{case}:")] == names
    in_layer = compiled.get(f"{case}: visits", (False, False))[1]
    for name in names:
        quantity = name.split(": ")[1]
        tolerance = TOLERANCES.get(quantity, OTHERWISE)
        if quantity in ("exact", "visits"):
            tolerance = 0.0
        if case in GRAZING and quantity in ("monodromy", "growth"):
            tolerance = AT_GRAZING
        if quantity == "modal norm" and in_layer:
            tolerance = MODAL_IN_LAYER
        scale = max(1.0, np.abs(np.nan_to_num(compiled[name])).max())
        assert np.allclose(
            plain[name], compiled[name], rtol=0, atol=tolerance * scale, equal_nan=True
        ), name


@pytest.mark.slow
def test_the_cases_reach_what_they_are_for(both):
    compiled, _ = both
    passes, visits = np.array([compiled[f"{case}: visits"] for case in PERIODS]).T
    assert passes.any()
    assert visits.any()
    assert compiled["two floors, stop without layer: visits"].tolist() == [True, False]
    assert compiled["three floors, passages and layer: visits"].tolist() == [True, True]
    assert compiled["closes: exact"][2] == 1
    assert math.isnan(compiled["closes: multiplier"])
    assert compiled["jump: exact"][2] == 1
    assert 0 < compiled["jump: multiplier"] < 1


def test_plain_kernels_refuse_what_lies_beyond_an_array():
    code = (
        "import numpy as np, pytest\n"
        "from hpcsweep.kernels.simd.vectors import LANES, load, store\n"
        "array = np.zeros((2, LANES))\n"
        "store(array, LANES, load(array, 0) + 1.0)\n"
        "assert array.tolist() == [[0.0] * LANES, [1.0] * LANES]\n"
        "for call in (lambda: load(array, LANES + 1), lambda: store(array[:, 1:], 0, 1.0)):\n"
        "    with pytest.raises(IndexError):\n"
        "        call()\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True, env=environment(NUMBA_DISABLE_JIT="1"))


if __name__ == "__main__":
    np.savez(sys.argv[1], **results())
