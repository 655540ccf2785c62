"""Impacts of contacts against an explicit method of high order with events; both solvers."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hpcsweep.model.equations import MODEL, derivative
from hpcsweep.model.kernel_model import kernel_model
from hpcsweep.model.observed import CLOSINGS, FORCE, IMPACT, SPEED, TIME
from hpcsweep.model.structure import Structure
from hpcsweep.model.units import Units
from hpcsweep.solvers.bdf import BdfMap
from hpcsweep.solvers.flow import FlowMap

PERIODS = 2
BOTH = {"gap": 0.4, "gap_left": 0.6}
CASES = [
    # by passages in closed form, fast and slow; without a layer; in wide layers by long steps; SI
    (Structure(3, 300.0, 1e4), 0.3, 0.445),
    (Structure(2, 500.0, 600.0, **BOTH), 0.3, 0.5),
    (Structure(2, 300.0, math.inf, **BOTH), 0.3, 0.6),
    (Structure(1, 400.0, 50.0, 0.05, gap=0.2, gap_left=0.8), 0.1, 0.99),
    (
        Structure(2, 20.0, 2e3, 0.03, mass=(2e5, 1e5), storey_stiffness=(3e7, 2e7), gap=0.02),
        3.0,
        7.0,
    ),
]


def start_of(structure, rng) -> np.ndarray:
    n = structure.n_floors
    z = np.concatenate((rng.uniform(-0.2, 0.9, n), rng.uniform(-0.3, 0.3, n)))
    return z * np.array(structure.state_units)


def reference(structure, amplitude, omega, start) -> np.ndarray:
    """Closings, speed, force over stiffness and time of each contact, (4, m), a period."""
    model = kernel_model(structure, omega)
    packed, units = MODEL.pack(model), Units(structure, model)
    size, contacts, rho = amplitude / units.amplitude_unit, model.contacts, model.rho
    rows, m = model.stiffness.shape[0], contacts.row.size

    def distances(y):
        return contacts.sign * y[contacts.row] - contacts.gap

    def rates(t, y):
        x = distances(y)
        with np.errstate(over="ignore"):
            share = x > 0 if rho == math.inf else 1 / (1 + np.exp(-rho * x))
        return np.concatenate((derivative(t, y[: 2 * rows], size, packed), x * share))

    events = [lambda t, y, k=k: distances(y)[k] for k in range(m)]
    y = np.concatenate((units.into(start), np.zeros(m)))
    found, closed = np.zeros((4, m)), distances(y) >= 0
    for _ in range(PERIODS):
        done = solve_ivp(
            rates,
            (0.0, model.period),
            y,
            "DOP853",
            events=events,
            rtol=1e-12,
            atol=1e-14,
            max_step=model.period / 400,
        )
        for k in range(m):
            begun = 0.0
            for t, at in zip(done.t_events[k], done.y_events[k], strict=True):
                if closed[k]:
                    found[TIME, k] += t - begun
                else:
                    found[CLOSINGS, k] += 1
                    found[SPEED, k] = max(found[SPEED, k], abs(at[rows + contacts.row[k]]))
                begun, closed[k] = t, not closed[k]
            found[TIME, k] += closed[k] * (model.period - begun)
        y = done.y[:, -1]
    found[FORCE] = y[2 * rows :]
    length, rate = structure.length_unit, structure.frequency_unit
    found[SPEED] *= length * rate
    found[FORCE] *= length / rate / PERIODS
    found[CLOSINGS] /= PERIODS
    found[TIME] /= PERIODS * model.period
    return found


def compare(seen, expected, structure, tolerance) -> None:
    impacts = np.empty(expected.shape)
    measures, spring = seen.measures, structure.force_per_length
    impacts[CLOSINGS], impacts[SPEED] = measures.impacts, measures.impact_velocity
    impacts[FORCE], impacts[TIME] = measures.impulse / spring, measures.contact_share
    length, rate = structure.length_unit, structure.frequency_unit
    scale = np.array([1.0, length * rate, length / rate, 1.0])[:, None]
    np.testing.assert_array_equal(impacts[CLOSINGS], expected[CLOSINGS])
    np.testing.assert_allclose(impacts / scale, expected / scale, rtol=0, atol=tolerance)


@pytest.mark.parametrize(
    ("structure", "amplitude", "omega"),
    [
        CASES[0],
        *(pytest.param(*case, marks=pytest.mark.slow) for case in CASES[1:]),
    ],
)
def test_impacts_are_those_of_the_motion(structure, amplitude, omega):
    start = start_of(structure, np.random.default_rng(3))
    expected = reference(structure, amplitude, omega, start)
    assert expected[CLOSINGS].any()
    flow = FlowMap(structure, omega).observe(start, amplitude, PERIODS, measures=IMPACT)
    compare(flow, expected, structure, 2e-8)
    bdf = BdfMap(structure, omega, 1e-9).observe(start, amplitude, PERIODS, measures=IMPACT)
    compare(bdf, expected, structure, 1e-4)


@pytest.mark.slow
def test_impacts_of_random_structures():
    """Closings are equal, impulses and times are right to 1e-8, speeds in wide layers to 1e-7."""
    rng = np.random.default_rng(1)
    n_closings = 0
    for _ in range(20):
        n, beta = int(rng.integers(1, 5)), 10 ** rng.uniform(0.5, 4)
        rho = math.inf if rng.random() < 0.2 else 10 ** rng.uniform(0.5, 5)
        gaps = dict(zip(BOTH, rng.uniform(0.3, 1, 2), strict=True)) if rng.random() < 0.5 else {}
        structure = Structure(n, beta, rho, rng.uniform(0.01, 0.2), **gaps)
        omega, amplitude = rng.uniform(0.2, 1.5), rng.uniform(0.02, 0.6)
        start = start_of(structure, rng)
        flow = FlowMap(structure, omega).observe(start, amplitude, PERIODS, measures=IMPACT)
        expected = reference(structure, amplitude, omega, start)
        compare(flow, expected, structure, 1e-7)
        n_closings += expected[CLOSINGS].sum()
    assert n_closings > 25
