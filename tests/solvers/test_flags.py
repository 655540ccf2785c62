"""Sliders that slip back home, flags, under records: an integration from event to event."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import hpcsweep
from hpcsweep.job import JobError, parse_job


class Flag:
    """One storey with a flag, by its own law, and scipy's DOP853 up to each of its corners.

    The flag's force is kappa y through home, s S and s R on the outer and the inner line of the
    side s, and kappa y + offset between these.
    """

    def __init__(self, mass, damping, stiffness, yields, hardening, beta):
        self.mass, self.damping, self.elastic = mass, damping, hardening * stiffness
        self.kappa, self.outer = stiffness - self.elastic, (1.0 - hardening) * yields
        self.inner = (1.0 - beta) * self.outer
        self.line, self.side, self.offset, self.changes = "home", 1, 0.0, 0

    def force(self, y):
        across = self.kappa * y
        lines = {"home": across, "between": across + self.offset}
        return (lines | {"out": self.side * self.outer, "back": self.side * self.inner})[self.line]

    def corners(self):
        """List where a line ends, which way it is passed, and the line and side that follow."""
        s, out, back = self.side, self.outer, self.inner
        at = {
            "home": [(lambda y, t=t: self.kappa * y[0] - t * out, t, "out", t) for t in (1, -1)],
            "out": [(lambda y: y[1], -s, "between", s)],
            "back": [
                (lambda y: y[1], s, "between", s),
                (lambda y: self.kappa * y[0] - s * back, -s, "home", s),
            ],
            "between": [
                (lambda y: self.kappa * y[0] + self.offset - s * out, s, "out", s),
                (lambda y: self.kappa * y[0] + self.offset - s * back, -s, "back", s),
            ],
        }
        return at[self.line]

    def run(self, ground, dt):
        """Return the state at the end."""
        y = np.zeros(2)
        for i, (first, last) in enumerate(pairwise(ground)):
            t, start, end = i * dt, i * dt, (i + 1) * dt

            def field(t, y, first=first, last=last, start=start):
                a = first + (last - first) * (t - start) / dt
                pull = self.damping * y[1] + self.elastic * y[0] + self.force(y[0])
                return [y[1], -a - pull / self.mass]

            while t < end:
                ends = []
                for corner, way, *_ in self.corners():
                    ends.append(lambda t, y, corner=corner: corner(y))
                    ends[-1].terminal, ends[-1].direction = True, way
                of = {"events": ends, "rtol": 1e-13, "atol": 1e-15, "max_step": dt}
                found = solve_ivp(field, (t, end), y, "DOP853", **of)
                t, y = found.t[-1], found.y[:, -1]
                for hit, (_, _, line, side) in zip(found.t_events, self.corners(), strict=True):
                    if found.status == 1 and hit.size:
                        self.offset = self.force(y[0]) - self.kappa * y[0]
                        self.line, self.side, self.changes = line, side, self.changes + 1
                        break
        return y


@pytest.mark.parametrize(
    "seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(1, 20))]
)
def test_random_storeys_move_as_their_flags(seed):
    rng = np.random.default_rng(seed)
    mass, period = 10.0 ** rng.uniform(4.0, 6.0), rng.uniform(0.2, 1.5)
    stiffness, ratio = mass * (2.0 * np.pi / period) ** 2, rng.uniform(0.01, 0.1)
    hardening, beta = rng.uniform(-0.02, 0.2), 1.0 - (seed > 0) * rng.uniform(0.0, 0.9)
    n_samples = 200 if seed else 60
    ground = np.cumsum(rng.standard_normal(n_samples))
    ground -= np.linspace(ground[0], ground[-1], n_samples)
    ground *= rng.uniform(2.0, 6.0) / np.abs(ground).max()
    yields = rng.uniform(0.1, 0.4) * mass * np.abs(ground).max()
    reference = Flag(
        mass, 2 * ratio * np.sqrt(stiffness * mass), stiffness, yields, hardening, beta
    )
    building = hpcsweep.Building(
        mass,
        stiffness,
        damping_ratio=ratio,
        yield_force=yields,
        hardening=hardening,
        flag_height=beta,
        collapse_drift=1e4 * yields / stiffness,
    )
    found = hpcsweep.response(building.structure, hpcsweep.Record(ground, 0.04), energy=True)
    end = reference.run(ground, 0.04) / [1.0, 2.0 * np.pi / period]
    ours = found.final_state / [1.0, 2.0 * np.pi / period]
    np.testing.assert_allclose(ours, end, rtol=0, atol=1e-12 * found.displacement[0])
    force = reference.force(found.final_state[0])
    np.testing.assert_allclose(found.final_slider_force, force, atol=1e-10 * yields)
    assert found.excursions[0] > 0
    assert reference.changes > 0
    assert abs(found.energy.balance) < 1e-13


def test_flags_come_home_and_other_storeys_do_not():
    """What is left after a minute is what is foreseen, beside a stop and a storey that stays."""
    flag = {"yield_drift": [0.01, 0.006, 0.003], "hardening": 0.02, "storey_stiffness": 1e8}
    frame = hpcsweep.Building([2e5] * 3, flag_height=[0.9, 0.0, 0.6], **flag)
    ground = hpcsweep.synthetic_records(1, seed=3, duration=10.0, rms=3.0)[0]
    early = hpcsweep.response(frame.structure, ground, energy=True)
    late = hpcsweep.response(frame.structure, ground, tail=60.0)
    assert early.excursions.min() > 3
    assert np.abs(late.plastic[[0, 2]]).max() < 1e-15
    np.testing.assert_allclose(late.residual_displacement, late.final_state[:3], atol=1e-9)
    assert late.residual_drift[[0, 2]] == pytest.approx([0.0, 0.0], abs=1e-15)
    assert abs(late.residual_drift[1]) > 1e-3
    assert abs(early.energy.balance) < 1e-13


def test_a_flag_that_its_weight_holds_out_stays_there():
    """P-Delta takes more of its force than comes back, less than it yields with."""
    of = {"yield_force": 2e5, "flag_height": 0.9, "hardening": 0.05, "storey_height": 3.0}
    held = hpcsweep.Building(
        2e5, 2e7, **of, p_delta=True, weight=4e6, collapse_drift=3.0, damping_ratio=0.1
    )
    push = hpcsweep.Record(np.append(2.0 * np.sin(np.arange(0.0, 1.0, 0.02) * 3.0), 0.0), 0.02)
    late = hpcsweep.response(held.structure, push, tail=60.0)
    assert not late.collapsed
    assert abs(late.plastic[0]) > 0.1
    np.testing.assert_allclose(late.residual_drift, late.final_state[:1], rtol=1e-6)


WRONG = [
    ({"returns": 1.0}, "slider.returns must be from 0 to below strength, 1, is 1.0"),
    ({"returns": 0.5, "kinetic": 0.7}, "slider.returns and kinetic must not be given both"),
]


def test_flags_that_are_none_are_refused():
    for wrong, message in WRONG:
        with pytest.raises(ValueError, match=message):
            hpcsweep.Slider((1.0,), 1.0, 1.0, **wrong)
    with pytest.raises(ValueError, match="flag_height goes with yield_force or yield_drift"):
        _ = hpcsweep.Building(1.0, flag_height=0.5).structure.sliders
    flag = hpcsweep.Building(1.0, yield_drift=1.0, flag_height=0.5).structure
    with pytest.raises(ValueError, match="must be without sliders that slip back"):
        hpcsweep.stroboscopic_points(flag, 1.0, 1.0, [0.0, 0.0, 0.0], 1)
    text = "[[building]]\nmass = 1.0\nstorey_stiffness = 1.0\nyield_drift = 1.0\n"
    text += "flag_height = 0.5\n[sweep]\nomega = 1.0\namplitude = [1.0]\n"
    with pytest.raises(JobError, match="must be without sliders that slip back or degrade: fl"):
        parse_job(text, "job", "job")
