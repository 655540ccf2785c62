"""Branches of structures that yield, against scipy's DOP853 from event to event."""

import cmath
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import hpcsweep
from hpcsweep.dynamics.classify import Shakedown
from hpcsweep.dynamics.continuation.events import Kind
from hpcsweep.job import JobError, parse_job

GAP, KAPPA, LOOKS = 0.267, 100.0, 150


def hysteretic(alpha=0.1):
    """Return the oscillator of Kalmar-Nagy and Shekhawat, as in hysteresis.toml."""
    slider = hpcsweep.Slider((1.0,), 1.0 - alpha, 1.0 - alpha)
    return hpcsweep.Structure.from_matrices(
        [1.0], [[alpha]], [], damping=[[0.04]], sliders=[slider]
    )


def pounding():
    """Return the oscillator of yielding-basins.toml, beside a stop."""
    stop, slider = hpcsweep.Contact((1.0,), GAP, KAPPA), hpcsweep.Slider((1.0,), 0.8, 0.8)
    return hpcsweep.Structure.from_matrices(
        [1.0], [[0.2]], [stop], damping=[[0.2]], sliders=[slider]
    )


def seed(structure, amplitude, omega, start=(0.0, 0.0, 0.0)):
    return hpcsweep.stroboscopic_points(structure, amplitude, omega, list(start), 400)[-1]


def carried(structure, amplitude, omega, state):
    """Return (u, u', p) after a forcing period, and the largest |u|; it slips at |u - p| = 1.

    Sticks, slips up or down, is before the stop or past it: DOP853 within, to the first event.
    """
    alpha, c = structure.matrices.stiffness[0][0], structure.matrices.damping[0][0]
    end, t, p, reach = 2.0 * math.pi / omega, 0.0, state[2], 0.0
    z, slip, past = np.array(state[:2]), 0, bool(structure.contacts) and state[0] > GAP
    if abs(abs(z[0] - p) - 1.0) < 1e-12 and z[1] * (z[0] - p) > 0.0:
        slip = round(z[0] - p)
    while t < end:

        def rates(t, z, slip=slip, p=p, past=past):
            force = (1.0 - alpha) * (slip or z[0] - p) + past * KAPPA * (z[0] - GAP)
            return [z[1], -amplitude * math.sin(omega * t) - force - alpha * z[0] - c * z[1]]

        events = [lambda _, z: z[1], lambda _, z, p=p: abs(z[0] - p) - 1.0]
        events += [lambda _, z, past=past: (GAP - z[0]) * (1 if past else -1)]
        looked = (True, not slip, bool(structure.contacts))
        for event, ends in zip(events, (slip != 0, True, True), strict=True):
            event.terminal, event.direction = ends, 0.0 if event is events[0] else 1.0
        used = [event for event, looks in zip(events, looked, strict=True) if looks]
        more = {"rtol": 1e-13, "atol": 1e-14, "max_step": end / LOOKS}
        done = solve_ivp(rates, (t, end), z, "DOP853", events=used, **more)
        t, z = done.t[-1], done.y[:, -1]
        reach = max([reach, *abs(done.y[0]), *(abs(y[0]) for ys in done.y_events for y in ys)])
        hit = used[int(np.argmax([times.size and times[-1] == t for times in done.t_events]))]
        p = z[0] - slip if slip else p
        if t < end:
            past = past != (hit is events[2])
            slip = 0 if hit is events[0] else round(z[0] - p) if hit is events[1] else slip
    return np.array([*z, p]), reach


def check(structure, omega, branch, places):
    """Compare orbits of a branch over the amplitude with DOP853."""
    for k in places:
        state = branch.point.values[k]
        end, reach = carried(structure, float(branch.value[k]), omega, state)
        np.testing.assert_allclose(end, state, atol=1e-11)
        assert reach == pytest.approx(float(branch.ductility[k, 0]), abs=1e-11)


def specials(branch):
    kinds = [Kind(code).name.lower() for code in branch.special_kind.values]
    return list(zip(kinds, branch.special_value.values.tolist(), strict=True))


def test_a_branch_goes_from_elastic_orbits_to_those_that_yield():
    """The border is where the elastic orbit reaches 1; multipliers are those of both sides."""
    structure, omega = hysteretic(), 0.8
    border = abs(complex(1.0 - omega**2, 0.04 * omega))
    at = seed(structure, 0.5, omega)
    found = hpcsweep.branch(structure, 0.5, omega, at, 1, span=(0.33, 0.5), largest_step=0.3)
    assert (found.attrs["begins"], found.attrs["ends"]) == ("end of the span",) * 2
    ((kind, value),) = specials(found)
    assert kind == "slip"
    assert value == pytest.approx(border, abs=1e-8)
    assert found.slip_change.values.tolist() == [[2]]
    beside = found.value.values - border
    yields = found.shakedown.values == Shakedown.PLASTIC
    assert yields[abs(beside) > 1e-6].tolist() == (beside[abs(beside) > 1e-6] > 0.0).tolist()
    exact = cmath.exp(complex(-0.02, math.sqrt(1.0 - 0.02**2)) * 2.0 * math.pi / omega)
    elastic = found.multiplier.values[beside < -1e-6]
    np.testing.assert_allclose(abs(elastic[:, :2]), abs(exact), rtol=1e-8)
    assert not elastic[:, 2].any()  # of p, which sticks: the 1 of the family is left out
    check(structure, omega, found, np.linspace(0, found.sizes["step"] - 1, 4).astype(int))
    assert found.stable.values.all()


def test_multipliers_on_a_branch_are_those_of_an_independent_map():
    structure, omega, amplitude = hysteretic(), 0.8, 0.5
    at = seed(structure, amplitude, omega)
    found = hpcsweep.branch(structure, amplitude, omega, at, 1, span=(amplitude, 0.51))
    state, step = found.point.values[0], 1e-5
    # what slips forgets p, so that (u, u') are enough; where it sticks, p keeps
    ends = [
        [carried(structure, amplitude, omega, state + way * step * e)[0] for way in (1, -1)]
        for e in np.eye(3)
    ]
    matrix = np.array([(above - below) / (2.0 * step) for above, below in ends]).T
    own = sorted(np.linalg.eigvals(matrix), key=abs)
    np.testing.assert_allclose(sorted(found.multiplier.values[0], key=abs), own, atol=1e-6)


@pytest.mark.slow
def test_beside_a_stop_branches_fold():
    """An orbit that has shaken down grazes, folds, repels, folds again, and begins to yield."""
    structure, omega = pounding(), 1.218
    at = seed(structure, 0.36, omega, (-1.5, 0.0, -0.5))
    found = hpcsweep.branch(structure, 0.36, omega, at, 1, span=(0.2, 0.45), largest_step=0.3)
    told = specials(found)
    assert [kind for kind, _ in told] == ["grazing", "fold", "fold", "slip"]
    (_, grazing), (_, first), (_, second), (_, border) = told
    assert second < border < grazing < first
    assert found.contact_change.values[0].tolist() == [1]
    near = np.abs(found.value.values[:, None] - found.special_value.values).min(axis=1)
    far = np.flatnonzero(near > 1e-3)
    check(structure, omega, found, far[:: max(len(far) // 5, 1)])
    repels = found.stable.values[far] == 0
    assert repels.any()
    assert np.all(
        (found.value.values[far][repels] > second) & (found.value.values[far][repels] < first)
    )
    folds = found.special_multiplier.values[1:3]
    np.testing.assert_allclose(np.abs(folds - 1.0).min(axis=1), 0.0, atol=1e-6)


def test_a_branch_ends_where_the_next_test_drags_p_along():
    structure, omega = pounding(), 1.218
    at = seed(structure, 0.906, omega, (-0.6471, -0.4972, 0.0))
    found = hpcsweep.branch(structure, 0.906, omega, at, 1, span=(0.9, 1.0), largest_step=0.3)
    assert found.attrs["ends"] == "border"
    assert found.slip_change.values.tolist() == [[1]]
    edge = found.isel(step=-1)
    assert float(edge.ductility[0]) == pytest.approx(1.0, abs=1e-9)
    for amplitude, moved in ((float(edge.value) - 1e-6, False), (float(edge.value) + 1e-3, True)):
        p = seed(structure, amplitude, omega, edge.point.values)[2] - edge.point.values[2]
        assert (abs(p) > 1e-4) == moved


@pytest.mark.slow
def test_the_hysteretic_resonance_over_the_frequency():
    """No folds, no doublings, all stable (Kalmar-Nagy and Shekhawat); and its peak by DOP853."""
    structure, amplitude = hysteretic(), 0.6
    at = seed(structure, amplitude, 0.8)
    found = hpcsweep.branch(structure, amplitude, 0.8, at, 1, "omega", span=(0.1, 1.6))
    assert found.stable.values.all()
    assert {kind for kind, _ in specials(found)} == {"slip"}
    last = specials(found)[-1][1]
    assert abs(complex(1.0 - last**2, 0.04 * last)) == pytest.approx(amplitude, abs=1e-7)
    for k in np.linspace(5, found.sizes["step"] - 5, 12).astype(int):
        state, omega = found.point.values[k], float(found.value[k])
        end, reach = carried(structure, amplitude, omega, state)
        np.testing.assert_allclose(end, state, atol=1e-10)
        assert reach == pytest.approx(float(found.ductility[k, 0]), abs=1e-10)


JOB = """
[structure]
matrices = {mass = [1.0], stiffness = [[%s]], damping = [[0.04]]}
[[structure.slider]]
direction = [1.0]
stiffness = 0.9
strength = 0.9
[study]
kind = "branches"
[sweep]
omega = [0.8]
amplitude = {from = 0.3, to = 0.5, count = 3}
[branches]
seeds = "none.h5"
"""


@pytest.mark.slow
def test_what_is_not_followed_is_refused_in_one_line():
    plain, structure = hysteretic(0.0), hysteretic()
    with pytest.raises(ValueError, match=r"^structure must have hardening for branches: [^\n]*$"):
        hpcsweep.branch(plain, 0.5, 0.8, [0.0] * 3, 1, span=(0.1, 0.6))
    with pytest.raises(JobError, match=r"study.kind = 'branches': structure must have hardening"):
        parse_job(JOB % 0.0, "job.toml", "job")
    with pytest.raises(JobError, match=r"branches.curves = .*must be \[\] where springs yield"):
        parse_job(JOB % 0.1 + 'curves = ["fold"]\n', "job.toml", "job")
    at = seed(structure, 0.5, 0.8)
    special = hpcsweep.branch(structure, 0.5, 0.8, at, 1, span=(0.3, 0.6)).isel(special=0)
    with pytest.raises(ValueError, match="curves of theirs are not followed"):
        hpcsweep.curve(structure, special, span=((0.1, 0.6), (0.7, 0.9)))
