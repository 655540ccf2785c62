"""Floor response spectra, against integrations that share nothing with them."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from together import together

from hpcsweep import Contact, Record, Slider, Structure, floor_spectra, response, spectrum

RATIO, FLOOR = 0.05, 1


def neighbours(contacts=(), **more) -> Structure:
    """Two buildings of two storeys side by side."""
    k = 100.0
    stiffness = np.array([[2 * k, -k, 0, 0], [-k, k, 0, 0], [0, 0, 3 * k, -k], [0, 0, -k, k]])
    return Structure.from_matrices(np.ones(4), stiffness, contacts, damping_ratio=0.05, **more)


def between(gap: float, damping: float = 0.0, tension: bool = False) -> list[Contact]:
    looks = {"stiffness": 5e3, "damping": damping, "tension": tension}
    return [Contact((0, 1, 0, -1), gap, **looks), Contact((1, 0, -1, 0), 1.5 * gap, **looks)]


def noise(n: int) -> Record:
    return Record(3.0 * np.random.default_rng(3).standard_normal(n), 0.02)


def integrated(structure: Structure, record: Record, omegas: np.ndarray) -> np.ndarray:
    """scipy's DOP853 on equations written down here, from event to event; peaks are events, too."""
    n, p = structure.n_floors, omegas.size
    inverse, rows = np.linalg.inv(structure.mass_matrix), structure.directions
    contacts = structure.contacts
    gaps, kappa, drag = np.array([(c.gap, c.stiffness, c.damping) for c in contacts]).T

    def rates(time, y, start, before, slope, closed):
        u, v, x, w = np.split(y, [n, 2 * n, 2 * n + p])
        ground = before + slope * (time - start)
        force = np.where(closed, kappa * (rows @ u - gaps) + drag * (rows @ v), 0.0)
        inner = structure.damping_matrix @ v + structure.stiffness_matrix @ u + rows.T @ force
        moved = inverse @ (structure.forcing_vector * ground - inner)
        floor = moved[FLOOR] + ground
        return np.concatenate((v, moved, w, -floor - 2 * RATIO * omegas * w - omegas**2 * x))

    def stop(k):
        def event(time, y, *_):
            return rows[k] @ y[:n] - gaps[k]

        event.terminal, event.direction = True, -1.0 if closed[k] else 1.0
        return event

    tops = [lambda time, y, *_, i=i: y[2 * n + p + i] for i in range(p)]
    y, closed, largest, passed = np.zeros(2 * (n + p)), np.zeros(2, bool), np.zeros(p), 0
    for j, (before, after) in enumerate(zip(record.acceleration, record.acceleration[1:])):  # noqa: B905
        time, end = record.dt * j, record.dt * (j + 1)
        slope = (after - before) / record.dt
        while time < end:
            done = solve_ivp(
                *(rates, (time, end), y, "DOP853"),
                args=(record.dt * j, before, slope, closed.copy()),
                events=[stop(0), stop(1), *tops],
                rtol=1e-12,
                atol=1e-15,
                max_step=record.dt / 4,
            )
            time, y = done.t[-1], done.y[:, -1].copy()
            for k in (0, 1):
                closed[k] ^= bool(done.t_events[k].size)
                passed += done.t_events[k].size
            for i in range(p):
                states = done.y_events[2 + i]
                found = np.abs(states[:, 2 * n + i]) if states.size else np.zeros(0)
                largest[i] = max(largest[i], abs(y[2 * n + i]), *found.tolist())
    assert passed > 6
    return largest


@together("damping", [0.0, 10.0])
def test_by_a_tight_integration_from_contact_to_contact(damping):
    structure, record = neighbours(between(0.002, damping, True)), noise(40)
    periods = np.array([0.06, 0.3, 0.628])
    found = floor_spectra(structure, record, periods, RATIO, places=["2"])
    omegas = 2.0 * math.pi / periods
    expected = integrated(structure, record, omegas)
    np.testing.assert_allclose(found.displacement, [expected], rtol=1e-10)
    np.testing.assert_array_equal(found.acceleration, omegas**2 * found.displacement)


def with_oscillator(structure: Structure, omega: float, mass: float) -> Structure:
    """The structure with an oscillator that weighs next to nothing on a floor."""
    n = structure.n_floors
    along, given = np.zeros(n + 1), structure.influence[FLOOR]
    along[[n, FLOOR]] = 1.0, -1.0

    def more(matrix, own):
        return np.pad(matrix, (0, 1)) + mass * own * np.outer(along, along)

    masses = np.pad(structure.mass_matrix, (0, 1))
    masses[n, n] = mass
    wider = [
        [replace(one, direction=(*one.direction, 0.0)) for one in listed]
        for listed in (structure.contacts, structure.sliders)
    ]
    return Structure.from_matrices(
        masses,
        more(structure.elastic_stiffness, omega**2),
        wider[0],
        damping=more(structure.damping_matrix, 2.0 * RATIO * omega),
        forcing=np.append(structure.forcing_vector, -mass * structure.shakes * given),
        drift=[along],
        sharpness=structure.sharpness,
        sliders=wider[1],
    )


SLIDERS = [Slider((0, 0, -1.0, 1.0), 50.0, 1.0), Slider((1.0, 0, 0, 0), 60.0, 2.0)]
KINDS = {
    "sharp": neighbours(between(0.01)),
    "lets go": neighbours(between(0.01, 10.0)),
    "smooth": neighbours(between(0.01), sharpness=2e3),
    "pressed": neighbours(between(-0.01)),
    "yields": neighbours(between(0.01), sliders=SLIDERS),
    "forces": neighbours(between(0.01), forcing=[1.0, 2.0, 0.0, 1.0]),
    "aslant": neighbours(between(0.01), influence=[0.7, -0.6, 1.0, 0.0]),
}


@pytest.mark.parametrize("kind", KINDS)
def test_by_oscillators_that_weigh_next_to_nothing(kind):
    """The flow map with them: its own peaks over continuous time, off by their mass."""
    structure, periods = KINDS[kind], [0.06, 0.3, 0.9]
    record = noise(30 if kind == "smooth" else 80)
    found = floor_spectra(structure, record, periods, RATIO, 1.5, tail=0.5, places=["2"])
    expected = [
        response(with_oscillator(structure, 2 * math.pi / one, 1e-12), record, 1.5, 0.5).drift[0]
        for one in periods
    ]
    np.testing.assert_allclose(found.displacement[0], expected, rtol=1e-10)


def test_a_rigid_floor_has_the_spectrum_of_the_ground():
    rigid = Structure.from_matrices([1.0], [[1e10]], [], damping_ratio=0.05)
    record, periods = noise(100), [0.1, 0.5, 2.0]
    found = floor_spectra(rigid, record, periods)
    np.testing.assert_allclose(found.displacement[0], spectrum(record, periods)[0], rtol=1e-6)


def test_what_is_refused_names_the_argument():
    for more, said in (
        ({"periods": [0.001]}, "periods must be from 0.01 to"),
        ({"periods": [1.0], "places": ["A3"]}, "places must be floors, of 1, 2, 3, 4"),
        ({"periods": [1.0], "damping_ratio": 1.0}, "damping_ratio must be from 0 to below 1"),
    ):
        with pytest.raises(ValueError, match=said):
            floor_spectra(KINDS["sharp"], noise(10), **more)
