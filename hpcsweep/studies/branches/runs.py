"""The branches of a line."""

import hashlib

import numpy as np

from hpcsweep.dynamics.continuation.branch import Limits
from hpcsweep.dynamics.continuation.catalogue import Catalogue
from hpcsweep.dynamics.continuation.cycle import continued
from hpcsweep.dynamics.continuation.events import Kind
from hpcsweep.dynamics.continuation.forced import ForcedMap
from hpcsweep.dynamics.continuation.search import search
from hpcsweep.dynamics.starts import box_of, starting_states, usual_reach
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.records import normalised_drift
from hpcsweep.studies.blocks import Poll, Rows
from hpcsweep.studies.branches.branches import Branches
from hpcsweep.studies.branches.curves import store_curves
from hpcsweep.studies.branches.variables import End, Origin, Reason
from hpcsweep.studies.seeds import Seed, Seeds
from hpcsweep.studies.variables import empty_results

REACH = 0.01
"""Largest distance of a seed from the orbit that Newton's method finds, in units of the state."""


def line_of(study: Branches, line: int, poll: Poll = None) -> Rows:
    """Follow the branches of a line.

    Parameters
    ----------
    study : Branches
    line : int
    poll : callable, optional
        Called before each forcing period; may raise to leave.

    Returns
    -------
    dict of str to ndarray
        The variables of the study, first axis of size 1.
    """
    omega, amplitude = float(study.omega[line]), float(study.amplitude[line])
    seeds = study.seeds_of(line)
    forced = ForcedMap(
        study.structure, amplitude, omega, study.parameter, study.settings.rtol, poll
    )
    low, high = study.span
    longest = study.settings.max_orbit_period
    catalogue = Catalogue(
        forced,
        Limits(low, high, study.steps, study.largest_step),
        high - low,
        longest,
        study.max_branches,
        study.max_points,
        forced.is_costly,
    )
    rows = empty_results(study.variables, study.structure, 1, **study.dimensions)
    _take(rows, study, forced, catalogue, seeds)
    catalogue.grow()
    if study.starts:
        box = box_of(None, usual_reach(study.structure))
        states = starting_states(box, study.starts, study.seed, omega, amplitude)
        search(catalogue, forced, states / forced.units, study.span, longest)
        catalogue.grow()
    _store_branches(rows, catalogue)
    _store_points(rows, forced, catalogue)
    _store_specials(rows, study, forced, catalogue)
    periods = forced.periods
    if study.curves:
        periods += store_curves(rows, study, line, catalogue, poll)
    rows["cycles"][0] = min(periods, np.iinfo(np.int32).max)
    rows["outcome"][0] = Outcome.COMPLETE
    return rows


def _take(
    rows: dict, study: Branches, forced: ForcedMap, catalogue: Catalogue, seeds: Seeds
) -> None:
    """Take the seeds one after the other, and tell of each where it lies."""
    rows["n_seeds"][0], rows["n_others"][0] = len(seeds.periodic), seeds.n_others
    rows["seeds_checksum"][0] = _checksum(seeds)
    covered = 0
    for k, seed in enumerate(seeds.periodic[: study.max_seeds]):
        value = {"omega": seed.omega, "amplitude": seed.amplitude}.get(
            study.parameter, forced.value
        )
        rows["seed_value"][0, k], rows["seed_period"][0, k] = value, seed.period
        rows["seed_point"][0, k] = seed.points[0]
        try:
            points = _whole(seed, forced, value)
            place = catalogue.add(points, value)
        except ArithmeticError:
            rows["seed_reason"][0, k] = Reason.NO_ORBIT
            continue
        rows["seed_distance"][0, k] = place.distance
        if not place.distance <= REACH:
            rows["seed_reason"][0, k] = Reason.ANOTHER_ORBIT
        elif place.branch < 0:
            rows["seed_reason"][0, k] = Reason.NO_ROOM
        else:
            rows["seed_branch"][0, k] = place.branch + 1
            covered += 1
    rows["n_covered"][0] = covered


def _whole(seed: Seed, forced: ForcedMap, value: float) -> np.ndarray:
    """Return all points of the orbit of a seed, in units of the state, shape (p, 2n)."""
    known = seed.points[: seed.period] / forced.units
    return continued(forced, known, value, seed.period)


def _checksum(seeds: Seeds) -> int:
    hashed = hashlib.blake2b(digest_size=8)
    for seed in seeds.periodic:
        hashed.update(np.array([seed.omega, seed.amplitude, seed.period], "<f8").tobytes())
        hashed.update(np.ascontiguousarray(seed.points, "<f8").tobytes())
    return int.from_bytes(hashed.digest(), "little")


def _store_branches(rows: dict, catalogue: Catalogue) -> None:
    rows["n_branches"][0] = len(catalogue.branches)
    for k, branch in enumerate(catalogue.branches):
        rows["branch_id"][0, k] = k + 1
        rows["branch_period"][0, k] = branch.arc.curve.period
        origin = Origin.SEARCH if branch.searched else Origin.SEED
        rows["found_by"][0, k] = Origin.LEAVING if branch.parent >= 0 else origin
        rows["parent"][0, k] = branch.parent + 1
        for name, why in zip(("begins", "ends"), branch.arc.ends, strict=True):
            rows[name][0, k] = End[why.upper().replace(" ", "_")]


def _store_points(rows: dict, forced: ForcedMap, catalogue: Catalogue) -> None:
    at = 0
    for k, branch in enumerate(catalogue.branches):
        for one in branch.arc.points:
            points, value = branch.arc.curve.split(one.y)
            seen = forced.observe(points, value)
            rows["step_branch"][0, at], rows["value"][0, at] = k + 1, value
            rows["stable"][0, at] = abs(one.multipliers[0]) < 1.0
            rows["contact"][0, at] = seen.contact
            drift = normalised_drift(seen.peak_drift, *forced.at(value)[1:])
            rows["drift"][0, at] = drift
            rows["point"][0, at] = points[0] * forced.units
            rows["multiplier_real"][0, at] = one.multipliers.real
            rows["multiplier_imag"][0, at] = one.multipliers.imag
            at += 1


def _store_specials(rows: dict, study: Branches, forced: ForcedMap, catalogue: Catalogue) -> None:
    at = first = 0
    numbers = study.structure.contact_numbers
    for k, branch in enumerate(catalogue.branches):
        for step, one in branch.arc.specials:
            if at < rows["special_kind"].shape[1]:
                points, value = branch.arc.curve.split(one.at.y)
                rows["special_branch"][0, at], rows["special_kind"][0, at] = k + 1, one.kind
                rows["special_value"][0, at], rows["special_step"][0, at] = value, first + step
                rows["special_point"][0, at] = points[0] * forced.units
                rows["criticality"][0, at] = one.criticality
                rows["leads_to"][0, at] = one.leads_to + 1
                if one.kind is Kind.GRAZING:
                    grazing = [1 << (n - 1) for n, c in zip(numbers, one.change, strict=True) if c]
                    rows["change"][0, at] = sum(one.change)
                    rows["special_contact"][0, at] = sum(grazing)
                at += 1
        first += len(branch.arc.points)
