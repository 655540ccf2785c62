"""Steps in modes (`step.spectral`): equal to those of tables, and right where there are none."""

import math

import numpy as np
import pytest
from reference import reference_points
from tools import flat

import hpcsweep
from hpcsweep import Building, Contact, Slider
from hpcsweep.model.kernel_model import kernel_model
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.flow import FlowMap
from hpcsweep.solvers.flow.record_map import RecordMap
from hpcsweep.solvers.flow.state import shared, tables
from hpcsweep.solvers.outcome import Outcome

SPRINGS = np.array([[40.0, -20, 0], [-20, 40, -20], [0, -20, 20]])
STOPS = [Contact((0, 0, 1), 0.3, 500.0), Contact((-1, 1, 0), 0.1, 300.0)]
LOSSY = [Contact((0, 0, 1), 0.3, 500.0, damping=5.0), Contact((-1, 1, 0), 0.1, 300.0)]
BRACES = [Slider((-1, 1, 0), 10.0, 0.2), Slider((0, -1, 1), 10.0, 0.1)]
COUPLED = np.diag([0.3, 0.1, 0.7])


def of(contacts=STOPS, **more):
    if "damping" not in more:
        more["damping_ratio"] = (0.02, 0.3, 1.5)
    return Structure.from_matrices((1.0,) * 3, SPRINGS, contacts, **more)


@pytest.fixture
def twice(monkeypatch):
    """Return what makes something of a small structure, by tables, then in modes."""

    def make(of_solver):
        found = []
        for least in (100, 1):
            for name in ("LARGE", "LARGE_COUPLED", "LARGE_SPARED"):
                monkeypatch.setattr(tables, name, least)
            shared._pattern_of.cache_clear()
            found.append(of_solver())
        shared._pattern_of.cache_clear()
        return found

    return make


@pytest.mark.parametrize(
    "structure",
    [
        of(),
        of(damping=COUPLED, harmonics=((1, 1.0, 0.3), (3, 0.5, 0.1))),
        of(LOSSY),
        of(LOSSY, damping=COUPLED),
    ],
    ids=["elastic", "coupled damping", "dashpots", "both"],
)
def test_periods_equal_those_of_tables(structure, twice):
    state = np.array([0.1, 0.2, 0.25, 0.3, 0.5, 0.9])

    def gather():
        flow = FlowMap(structure, 3.0)
        seen = flow.observe(state, 3.0, 3, modal_norm=True, measures=shared.ANY_MEASURE)
        return seen.points, seen.modal_norm, flat(seen.measures), *flow.monodromy(state, 3.0, 3)

    for table, mode in zip(*twice(gather), strict=True):
        np.testing.assert_allclose(mode, table, rtol=1e-9, atol=1e-11)


TOWERS = [Building(mass=[2.5e5] * n, storey_stiffness=k) for n, k in ((2, 3e8), (3, 2e8))]


@pytest.mark.parametrize(
    ("structure", "scale", "more"),
    [
        (hpcsweep.adjacent(TOWERS, gap=0.002, stiffness=2e9), 3.0, {"base_shear": True}),
        (hpcsweep.adjacent(TOWERS, gap=0.002, stiffness=2e9, restitution=0.6), 3.0, {}),
        (of(sliders=BRACES), 4.0, {}),
        (of(LOSSY, sliders=BRACES, damping=COUPLED), 4.0, {"energy": True}),
        (of(sharpness=2000.0), 4.0, {}),
    ],
    ids=["pounding", "dashpots", "sliders", "energies", "smooth"],
)
def test_records_equal_those_of_tables(structure, scale, more, twice):
    record = hpcsweep.synthetic_records(1, seed=1, dt=0.05, duration=10.0, rms=1.0)[0]

    def respond():
        return RecordMap(structure, record.dt, **more).respond(record.acceleration, scale)

    table, mode = map(vars, twice(respond))
    assert table["impacts"].sum() > 0 or table["excursions"].sum() > 0
    for name, value in table.items():
        if isinstance(value, np.ndarray) and not name.endswith("time"):
            np.testing.assert_allclose(mode[name], value, rtol=1e-9, atol=1e-11, err_msg=name)


def chain(n, m, sharpness=math.inf):
    """A chain of n masses, m of which have stops ahead, the top first."""
    springs = 0.4 * n * n * (2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1))
    springs[-1, -1] *= 0.5
    rows = [n - 1 - k * n // m for k in range(m)]
    stops = [Contact(tuple(np.eye(n)[i]), (i + 1) / n, 50.0 * n) for i in rows]
    return Structure.from_matrices(
        (1.0,) * n, springs, stops, damping_ratio=0.03, sharpness=sharpness
    )


@pytest.mark.parametrize("n", [40, 64, 135, pytest.param(512, marks=pytest.mark.slow)])
def test_many_rows_agree_with_the_reference(n):
    structure = chain(n, 10)
    omega = 1.5 * float(structure.frequencies[min(n, 135) // 10])
    state = np.concatenate((np.linspace(0.0, 1.1, n), np.linspace(0.0, 0.8, n)))
    points, outcome = FlowMap(structure, omega).points(state, 5.0, 1)
    assert outcome is Outcome.COMPLETE
    expected = reference_points(structure, 5.0, omega, state, 1)
    assert np.abs(points - expected).max() < 2e-12 * max(1.0, np.abs(expected).max())


def test_base_shears_beside_series_are_without_contacts(twice):
    """Two towers that yield and pound: steps in modes, and series after each change."""
    both = [
        Building([2.5e5] * n, k, yield_drift=0.01, hardening=0.05) for n, k in ((2, 3e8), (3, 2e8))
    ]
    structure = hpcsweep.adjacent(both, gap=0.004, stiffness=2e9)
    samples = 12.0 * np.random.default_rng(2).standard_normal(80)

    def response():
        return RecordMap(structure, 0.02, base_shear=True).respond(samples, 1.0, 0.01)

    by_tables, in_modes = twice(response)
    assert by_tables.impacts.min() > 0
    assert by_tables.excursions.min() > 0
    np.testing.assert_allclose(in_modes.base_shear, by_tables.base_shear, rtol=1e-12)


def test_a_large_structure_keeps_no_propagators():
    small = shared.new_shared(kernel_model(chain(8, 4), 1.0), 1e-9, 1)
    large = shared.new_shared(kernel_model(chain(64, 10), 1.0), 1e-9, 1)
    assert small.tables.poly.nbytes > 0 == large.tables.poly.nbytes
    assert large.tables.spectrum.damping.size == 0
