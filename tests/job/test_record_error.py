"""The error of a reduced model under records, as stated by a job, against all modes."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import DOP853
from scipy.linalg import eigh
from scipy.optimize import brentq

from hpcsweep import Contact, history
from hpcsweep.campaign.describe import describe
from hpcsweep.job import JobError, load_job
from hpcsweep.job.tree import write_value
from hpcsweep.model import finite_elements
from hpcsweep.model.finite_elements import FiniteElements

JOB = """\
study = {{kind = "records"}}
units = {{length = "m", mass = "kg", time = "s"}}
[structure]
damping_ratio = 0.05
[structure.model]
file = "frame.npz"
outputs = {outputs}
reduce = {reduce}
[[structure.contact]]
direction = {direction}
gap = {gap}
stiffness = {stiffness}
[records]
synthetic = {{count = 2, seed = {seed}, duration = 8.0}}
scale = {{by = "pga", values = [1.0, 3.0]}}
"""
RTOL, ATOL, TIME = 1e-9, 1e-12, 1e-15


def frame(rng, n: int, period: float) -> tuple[np.ndarray, np.ndarray]:
    """Return masses and the stiffness of storeys that shear, with columns that bend."""
    stiffness = np.zeros((n, n))
    for i in range(n):
        row = np.eye(n)[i] - (np.eye(n)[i - 1] if i else 0.0)
        stiffness += 10.0 ** rng.uniform(-0.3, 0.3) * np.outer(row, row)
    for i in range(1, n - 1):
        row = np.eye(n)[i - 1] - 2.0 * np.eye(n)[i] + np.eye(n)[i + 1]
        stiffness += 10.0 ** rng.uniform(-1, 1) * np.outer(row, row)
    mass = 10.0 ** rng.uniform(4.8, 5.2, n)
    turned = stiffness / np.sqrt(np.outer(mass, mass))
    return mass, stiffness * (2 * np.pi / period) ** 2 / np.linalg.eigvalsh(turned)[0]


def case(seed: int, sizes: tuple[int, int]) -> tuple[FiniteElements, dict]:
    """Return one frame beside a stop, or two frames, and the keys of a job."""
    rng = np.random.default_rng(seed)
    n, m = (int(rng.integers(*sizes)) for _ in range(2))
    mass, stiffness = frame(rng, n, rng.uniform(0.4, 1.5))
    direction, outputs = {str(int(rng.integers(n // 2, n)) + 1): 1.0}, [str(n), str(n // 2)]
    kappa = stiffness[-1, -1] * 10.0 ** rng.uniform(-1, 1)
    if rng.random() < 0.5:
        other, beside = frame(rng, m, rng.uniform(0.3, 0.8))
        direction, outputs = {str(min(n, m)): 1.0, str(n + m): -1.0}, [str(n), str(n + m)]
        mass = np.concatenate((mass, other))
        stiffness = np.block([[stiffness, np.zeros((n, m))], [np.zeros((m, n)), beside]])
    given = {
        "outputs": outputs,
        "direction": direction,
        "stiffness": float(kappa),
        "seed": seed + 1,
    }
    np.savez("frame.npz", K=stiffness, M=mass)
    return FiniteElements(mass, stiffness), given | {"share": float(rng.uniform(0.2, 0.8))}


def loaded(given: dict, reduce: dict, gap: float):
    keys = {**given, "reduce": reduce, "gap": gap}
    told = {key: write_value(value) for key, value in keys.items()}
    Path("job.toml").write_text(JOB.format(**told))
    return load_job("job.toml")


def with_contact(given: dict, reduce: dict):
    """Return the job whose gap is a part of what the first record closes."""
    study = loaded(given, reduce, 1e3).study
    closed = history(study.structure, study.record(0), float(study.factor[0, -1])).approach
    return loaded(given, reduce, float(closed.max() * given["share"]))


def all_modes(model: FiniteElements, given: dict, contact, record, scale: float):
    """Return displacements at the samples and the largest force, by our own solver."""
    hit = Contact(given["direction"], contact.gap, contact.stiffness)
    whole = model.structure([hit], outputs=given["outputs"], damping_ratio=0.05)
    seen = history(whole, record, scale)
    at = [whole.floor_names.index(name) for name in given["outputs"]]
    return seen.displacement[:, at], seen.peak_force.max()


def zero(function, inside, start: float, end: float):
    """Return the time at which a function of (t, z) is 0, and z, from what is inside a step."""
    t = brentq(lambda t: function(t, inside(t)), start, end, xtol=TIME)
    return t, inside(t)


def until_event(rate, t: float, end: float, z, depth, closed: bool):
    """Integrate z' = rate(t, z) until the sign of depth . (z, 1) is not that of `closed`, or `end`.

    Returns time and state there, and the largest depth, at which its rate vanishes.
    """

    def past(t, z):
        return depth[:-1] @ z + depth[-1]

    def rises(t, z):
        return depth[:-1] @ rate(t, z)

    most, solver = 0.0, DOP853(rate, t, z, end, rtol=RTOL, atol=ATOL)
    while solver.status == "running":
        before = solver.t, solver.y
        solver.step()
        after = solver.t, solver.y
        most = max(most, past(*after))
        if rises(*before) > 0 > rises(*after):
            most = max(most, past(*zero(rises, solver.dense_output(), before[0], solver.t)))
        if (past(*after) > 0) != closed:
            # it may close and open in a step, or, by rounding, be not yet what it was at its start
            inside, parts = solver.dense_output(), np.linspace(before[0], solver.t, 33)
            same = np.array([(past(t, inside(t)) > 0) == closed for t in parts])
            at = np.flatnonzero(same[:-1] & ~same[1:])
            return *(zero(past, inside, *parts[at[0] : at[0] + 2]) if at.size else before), most
    return *after, most


def explicit(model: FiniteElements, given: dict, contact, record, scale: float):
    """Return the same by DOP853 on all of M, K and C, from sample to sample and event to event."""
    mass, stiffness = model.mass.diagonal(), model.stiffness.toarray()
    squared, shapes = eigh(stiffness, np.diag(mass))
    weighted, n = mass[:, None] * shapes, len(mass)
    damping = weighted @ np.diag(2 * 0.05 * np.sqrt(squared)) @ weighted.T
    depth = np.append(np.zeros(2 * n), -contact.gap)
    for name, share in given["direction"].items():
        depth[int(name) - 1] = share
    free = np.vstack((np.eye(n, 2 * n, n), -np.hstack((stiffness, damping)) / mass[:, None]))
    push = np.append(np.zeros(n), -contact.stiffness * depth[:n] / mass)
    base, ground = np.repeat((0.0, -1.0), n), scale * np.array(record.acceleration)
    closed, z, most, points = False, np.zeros(2 * n), 0.0, [np.zeros(2 * n)]
    for first, second in pairwise(ground):
        slope, t = (second - first) / record.dt, 0.0
        while t < record.dt:
            matrix = free + closed * np.outer(push, depth[:-1])
            shift = closed * push * depth[-1]

            def rate(t, z, matrix=matrix, shift=shift, first=first, slope=slope):
                return matrix @ z + ((first + slope * t) * base + shift)

            t, z, reached = until_event(rate, t, record.dt, z, depth, closed)
            most, closed = max(most, reached), closed != (t < record.dt)
        points.append(z)
    at = [int(name) - 1 for name in given["outputs"]]
    return np.array(points)[:, at], contact.stiffness * most


def true_errors(model: FiniteElements, given: dict, job, exact) -> tuple[float, float]:
    """Return the largest errors of displacements and forces against all modes."""
    (contact,) = job.structure.contacts
    at = [job.structure.floor_names.index(name) for name in given["outputs"]]
    error = force_error = 0.0
    for i, s in np.ndindex(job.study.factor.shape):
        record, scale = job.study.record(i), float(job.study.factor[i, s])
        few = history(job.structure, record, scale)
        moved, force = exact(model, given, contact, record, scale)
        off = np.abs(few.displacement[:, at] - moved).max(axis=0) / np.abs(moved).max(axis=0)
        error = max(error, off.max())
        if force:
            force_error = max(force_error, abs(few.peak_force.max() / force - 1.0))
    return error, force_error


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def test_the_stated_errors_of_records_hold_and_are_told():
    model, given = case(2, (10, 14))
    job = with_contact(given, {"modes": 2})
    error, force_error = true_errors(model, given, job, all_modes)
    stated = job.structure.reduction
    assert 0.01 < error < stated.error < 10.0 * error
    assert 0.01 < force_error < stated.force_error < 10.0 * force_error
    told = dict(describe(job))["reduced to"]
    said = f"{stated.error:.2g} and {stated.force_error:.2g} of forces of contacts under the"
    assert said.replace(" and", " of displacements and") in told


def test_few_modes_are_warned_of_by_their_mass():
    _, given = case(1, (10, 14))
    for modes, is_told in ((1, True), (8, False)):
        job = loaded(given, {"modes": modes}, 1.0)
        share = sum(job.structure.reduction.shares)
        told = any(f"have {share:.3g} of the mass" in text for _, text in describe(job))
        assert (share < 0.9) == told == is_told


def test_modes_are_added_until_the_error_of_records_is_as_asked(monkeypatch):
    _, given = case(3, (10, 14))
    few = with_contact(given, {"modes": 1}).structure
    gap = few.contacts[0].gap
    found = loaded(given, {"error": 0.3}, gap).structure.reduction
    assert found.error <= 0.3 < few.reduction.error
    assert found.modes > 1
    monkeypatch.setattr(finite_elements, "MAX_REDUCED", 6)
    with pytest.raises(JobError, match=r"structure.model.reduce.error must be at least .* under i"):
        loaded(given, {"error": 0.04}, gap)


@pytest.mark.slow
def test_of_20_random_frames_the_true_error_is_within_the_stated_one_in_19():
    within = 0
    for seed in range(20):
        model, given = case(seed, (20, 50))
        job = with_contact(given, {"modes": 3 + seed % 6})
        error, force_error = true_errors(model, given, job, explicit)
        stated = job.structure.reduction
        within += error <= stated.error and force_error <= stated.force_error
    assert within >= 19
