"""What rows of displacements do over forcing periods: `FlowMap.rows_of` and `output.rows`."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import hpcsweep
from hpcsweep.job import JobError, parse_job
from hpcsweep.solvers.solver import make_solver

ROWS = np.array([[1.0, 0.0], [1.0, -1.0], [0.3, 0.7]])
MASS, STIFFNESS, FORCING = np.diag([2.0, 1.5]), np.array([[5.0, -1.0], [-1.0, 3.0]]), [1.0, -0.4]
DAMPING, ACROSS = 0.04 * STIFFNESS, np.array([1.0, -1.0])
A, OMEGA, ORDERS, GAP = 1.3, 1.1, 3, 0.1


def rows_of(structure, state, omega=OMEGA, amplitude=A):
    """Return points of a motion and what its rows do in the period after each."""
    solver = make_solver("flow", structure, omega, 1e-11, yields=True)
    points = solver.points(state, amplitude, 5)[0]
    return points, solver.rows_of(points[-2:-1], amplitude, ROWS, ORDERS)


def structure(*contacts, **more):
    return hpcsweep.Structure.from_matrices(
        MASS, STIFFNESS, contacts, damping=DAMPING, forcing=FORCING, sharpness=math.inf, **more
    )


def test_rows_of_a_linear_motion_are_those_of_its_closed_form():
    free = structure()
    impedance = STIFFNESS - OMEGA**2 * MASS + 1j * OMEGA * DAMPING
    steady = A * np.linalg.solve(impedance, FORCING)  # u = Im(steady exp(i Omega tau))
    start = np.concatenate((steady.imag, OMEGA * steady.real))
    seen, of_rows = rows_of(free, start)[1], ROWS @ steady
    size, nothing = np.abs(of_rows), np.zeros((3, ORDERS - 1))
    assert np.allclose((seen.high, seen.low), (size, -size), rtol=1e-12)
    assert np.allclose(seen.rms, size / math.sqrt(2), rtol=1e-12)
    assert np.allclose(seen.amplitude, np.column_stack((size, nothing)), atol=1e-13)
    assert np.allclose(seen.phase[:, 0], np.angle(of_rows), rtol=1e-12)
    assert np.abs(seen.mean).max() < 1e-13


class Integrated:
    """The same by DOP853, integrals as further states, contacts and sliders by events."""

    def __init__(self, contact, slider=None):
        self.gap, self.stiffness, self.restitution = contact
        self.slider, self.closed, self.slips, self.plastic = slider, False, 0, 0.0

    def field(self, t, s):
        u, v, y = s[:2], s[2:4], ROWS @ s[:2]
        force = np.array(FORCING) * A * math.sin(OMEGA * t) - STIFFNESS @ u - DAMPING @ v
        if self.closed:
            force = force - ACROSS * self.stiffness * (ACROSS @ u - self.gap)
        if self.slider:
            spring, strength = self.slider
            elastic = spring * (u[0] - self.plastic)
            force[0] -= self.slips * strength if self.slips else elastic
        waves = [f(h * OMEGA * t) for h in range(1, ORDERS + 1) for f in (math.cos, math.sin)]
        integrals = np.column_stack((y, y * y, np.outer(y, waves)))
        return np.concatenate((v, np.linalg.solve(MASS, force), integrals.ravel()))

    def events(self):
        def passes(_, s):
            return ACROSS @ s[:2] - self.gap

        def slides(_, s):
            spring, strength = self.slider
            value = spring * abs(s[0] - self.plastic) - strength
            return s[2] * self.slips if self.slips else value

        passes.direction, slides.direction = (-1 if self.closed else 1), (-1 if self.slips else 1)
        passes.terminal = slides.terminal = True
        turns = [lambda _, s, row=row: row @ s[2:4] for row in ROWS]
        return [passes, *([slides] if self.slider else []), *turns]

    def over_a_period(self, state):
        t, period, s = (
            0.0,
            2 * math.pi / OMEGA,
            np.append(state[:4], np.zeros(3 * (2 + 2 * ORDERS))),
        )
        self.closed = self.restitution is None and ACROSS @ s[:2] > self.gap
        if self.slider:
            self.plastic = state[4]
            over = self.slider[0] * (s[0] - self.plastic) / self.slider[1]
            self.slips = int(np.sign(over)) if abs(over) > 1 - 1e-12 and over * s[2] > 0 else 0
        seen = [ROWS @ s[:2]]
        while t < period:
            tight = {"rtol": 1e-13, "atol": 1e-15, "max_step": period / 60}
            step = solve_ivp(self.field, (t, period), s, "DOP853", events=self.events(), **tight)
            t, s = float(step.t[-1]), step.y[:, -1].copy()
            seen += [ROWS @ x[:2] for turns in step.y_events for x in turns] + [ROWS @ s[:2]]
            if step.status == 1 and len(step.t_events[0]):
                if self.restitution is None:
                    self.closed = not self.closed
                else:
                    kick = np.linalg.solve(MASS, ACROSS)
                    s[2:4] -= (1 + self.restitution) * (ACROSS @ s[2:4]) / (ACROSS @ kick) * kick
            elif step.status == 1:
                if self.slips:
                    self.plastic = s[0] - self.slips * self.slider[1] / self.slider[0]
                self.slips = 0 if self.slips else int(np.sign(s[0] - self.plastic))
        mean, square, *waves = s[4:].reshape(3, -1).T / period
        cosine, sine = 2 * np.reshape(waves, (ORDERS, 2, 3)).transpose(1, 2, 0)
        turned = cosine + 1j * sine
        return np.min(seen, axis=0), np.max(seen, axis=0), mean, np.sqrt(square), turned


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["elastic", "rigid", "slider"])
def test_rows_are_those_of_an_independent_integration(kind):
    stiffness, restitution = (math.inf, 0.6) if kind == "rigid" else (60.0, None)
    slider = (5.0, 0.5) if kind == "slider" else None
    more = {"restitution": restitution} if restitution else {}
    sliders = {"sliders": [hpcsweep.Slider([1.0, 0.0], *slider)]} if slider else {}
    made = structure(hpcsweep.Contact(ACROSS, GAP, stiffness, **more), **sliders)
    points, seen = rows_of(made, np.zeros(made.state_units.size))
    low, high, mean, rms, turned = Integrated((GAP, 60.0, restitution), slider).over_a_period(
        points[-2]
    )
    assert high[1] > GAP - 1e-12
    for value, other in zip(seen[:4], (low, high, mean, rms), strict=True):
        assert np.abs(value - other).max() < 1e-10
    harmonics = seen.amplitude * np.exp(1j * (0.5 * np.pi - seen.phase))
    assert np.abs(harmonics - turned).max() < 1e-10


def test_rows_of_a_smooth_stop_are_those_of_a_sharp_one_within_its_layer():
    seen = []
    for sharpness in (1e5, math.inf):
        made = hpcsweep.Structure(2, sharpness=sharpness, stiffness_ratio=50.0)
        solver = make_solver("flow", made, 0.6, 1e-10)
        seen.append(solver.rows_of(np.zeros((1, 4)), 0.5, ROWS, ORDERS))
    assert seen[1].high[0] > 1.0
    for smooth, sharp in zip(*(one[:5] for one in seen), strict=True):
        assert np.abs(smooth - sharp).max() < 1e-3


JOB = """
[structure]
n_floors = 1
sharpness = inf
gap_left = 1.0
[sweep]
omega = [0.5]
amplitude = [0.1, 0.9]
[output]
rows = ["1", "contact:2"]
harmonics = 2
"""


def test_a_sweep_stores_what_rows_do_whether_a_run_touches_or_not():
    study = parse_job(JOB, "rows.toml", "rows").study
    rows = study.runs_of(study.structure, 0.5).follow(study.amplitude, study.initial_state)
    low, high = rows["row_low"][:, 0], rows["row_high"][:, 0]
    assert high[0] < 1.0 < high[1]
    assert np.array_equal(rows["row_range"][:, 0], 0.5 * (high - low))
    assert np.array_equal(rows["row_high"][:, 1], -low)  # the stop on the left


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("contact:2", "contact:9"), "output.rows = 'contact:9': must be one of 1, 1L"),
        (("contact:2", "7"), "output.rows = '7': must be a floor, 1 to 1"),
        (("harmonics = 2", "harmonics = 17"), "output.harmonics"),
        (("[sweep]", '[solver]\nmethod = "bdf"\n[sweep]'), "must be empty with solver.method bdf"),
    ],
)
def test_rows_that_are_none_are_refused_on_one_line(change, message):
    with pytest.raises(JobError) as caught:
        parse_job(JOB.replace(*change), "rows.toml", "rows")
    assert message in str(caught.value)
