"""The branches of a line, and the curves through their special points.

The special points of the branches along A lie, over the frequency too, on curves. Each line follows
those through its own special points, of orbits up to `max_orbit_period`, within its *strip*, which
reaches half way to the next line on either side and, at the ends, to `curve_span`. So the strips
cover the plane without overlap, and a line stays a task that depends on no other. A curve is found
in each strip in which it crosses the line.
"""

import hashlib

import numpy as np

from hpcsweep.dynamics.continuation.borders import catalogue_of
from hpcsweep.dynamics.continuation.branch import Limits
from hpcsweep.dynamics.continuation.catalogue import Catalogue
from hpcsweep.dynamics.continuation.cycle import continued
from hpcsweep.dynamics.continuation.events import Kind, n_unstable
from hpcsweep.dynamics.continuation.forced import ForcedMap
from hpcsweep.dynamics.continuation.plane import KINDS, Plane, curves_through
from hpcsweep.dynamics.continuation.search import search
from hpcsweep.dynamics.families import told_of_sliders
from hpcsweep.dynamics.starts import box_of, starting_states, usual_reach
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.records import normalised_drift
from hpcsweep.studies.blocks import Poll, Rows
from hpcsweep.studies.branches.keys import BranchGrid
from hpcsweep.studies.branches.variables import End, Met, Origin, Reason
from hpcsweep.studies.seeds import Seeds
from hpcsweep.studies.variables import empty_results

PLANE = ("amplitude", "omega")
REACH = 0.01
"""Largest distance of a seed from the orbit that Newton's method finds, in units of the state."""
NO_SLIP = 1e-9
"""Slip over an orbit that is rounding, in units of lengths."""


def line_of(study: BranchGrid, line: int, seeds: Seeds, poll: Poll = None) -> Rows:
    """Follow the branches of a line.

    Parameters
    ----------
    study : BranchGrid
    line : int
    seeds : Seeds
        Motions of the files on it.
    poll : callable, optional
        Called before each forcing period; may raise to leave.

    Returns
    -------
    dict of str to ndarray
        The variables of the study, first axis of size 1.
    """
    omega, amplitude = float(study.omega[line]), float(study.amplitude[line])
    forced = study.forced(line, poll)
    low, high = study.span
    longest = study.settings.max_orbit_period
    catalogue = catalogue_of(
        forced,
        Limits(low, high, study.steps, study.largest_step),
        high - low,
        longest,
        study.max_branches,
        study.max_points,
    )
    rows = empty_results(study.of_run, study.structure, 1, **study.dimensions)
    _take(rows, study, forced, catalogue, seeds)
    catalogue.grow()
    if study.starts:
        box = box_of(None, usual_reach(study.structure))
        states = starting_states(box, study.starts, study.seed, omega, amplitude)
        states = np.pad(states, ((0, 0), (0, forced.size - states.shape[1])))
        search(catalogue, forced, states / forced.units, study.span, longest)
        catalogue.grow()
    store_branches(rows, forced, catalogue)
    periods = forced.periods
    if study.curves:
        periods += _store_curves(rows, study, line, catalogue, poll)
    rows["cycles"][0] = min(periods, np.iinfo(np.int32).max)
    rows["outcome"][0] = Outcome.COMPLETE
    return rows


def _take(
    rows: dict, study: BranchGrid, forced: ForcedMap, catalogue: Catalogue, seeds: Seeds
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
            points = seed.points[: seed.period] / forced.units
            points = continued(forced, points, value, seed.period)
            branch, distance = catalogue.add(points, value)
        except ArithmeticError:
            rows["seed_reason"][0, k] = Reason.NO_ORBIT
            continue
        rows["seed_distance"][0, k] = distance
        if not distance <= REACH:
            rows["seed_reason"][0, k] = Reason.ANOTHER_ORBIT
        elif branch < 0:
            rows["seed_reason"][0, k] = Reason.NO_ROOM
        else:
            rows["seed_branch"][0, k] = branch + 1
            covered += 1
    rows["n_covered"][0] = covered


def _checksum(seeds: Seeds) -> int:
    hashed = hashlib.blake2b(digest_size=8)
    for seed in seeds.periodic:
        hashed.update(np.array([seed.omega, seed.amplitude, seed.period], "<f8").tobytes())
        hashed.update(np.ascontiguousarray(seed.points, "<f8").tobytes())
    return int.from_bytes(hashed.digest(), "little")


def store_branches(rows: dict, forced: ForcedMap, catalogue: Catalogue) -> None:
    """Store all branches, their points and their special points, as many as there is room for."""
    _store_points(rows, forced, catalogue)
    _store_specials(rows, forced, catalogue)
    rows["n_branches"][0] = len(catalogue.branches)
    for k, branch in enumerate(catalogue.branches):
        rows["branch_id"][0, k] = k + 1
        rows["branch_period"][0, k] = branch.curve.period
        origin = Origin.SEARCH if branch.searched else Origin.SEED
        rows["found_by"][0, k] = Origin.LEAVING if branch.parent >= 0 else origin
        rows["parent"][0, k] = branch.parent + 1
        for name, why in zip(("begins", "ends"), branch.ends, strict=True):
            rows[name][0, k] = End[why.upper().replace(" ", "_")]


def _store_points(rows: dict, forced: ForcedMap, catalogue: Catalogue) -> None:
    at = 0
    for k, branch in enumerate(catalogue.branches):
        for orbit in branch.points:
            points, value = branch.curve.split(orbit.y)
            seen = forced.observe(points, value)
            rows["step_branch"][0, at], rows["value"][0, at] = k + 1, value
            rows["stable"][0, at] = abs(orbit.multipliers[0]) < 1.0
            rows["contact"][0, at] = seen.contact
            drift = normalised_drift(seen.peak_drift, *forced.at(value)[1:])
            rows["drift"][0, at] = drift
            sliders = told_of_sliders(forced.structure, seen.slid, len(points), NO_SLIP)
            for name in sliders.keys() & rows.keys():
                rows[name][0, at] = sliders[name]
            rows["point"][0, at] = points[0] * forced.units
            rows["multiplier_real"][0, at] = orbit.multipliers.real
            rows["multiplier_imag"][0, at] = orbit.multipliers.imag
            at += 1


def _store_specials(rows: dict, forced: ForcedMap, catalogue: Catalogue) -> None:
    at = first = 0
    numbers = forced.structure.contact_numbers
    for k, branch in enumerate(catalogue.branches):
        for step, special in branch.specials:
            if at < rows["special_kind"].shape[1]:
                points, value = branch.curve.split(special.at.y)
                rows["special_branch"][0, at], rows["special_kind"][0, at] = k + 1, special.kind
                rows["special_value"][0, at], rows["special_step"][0, at] = value, first + step
                rows["special_point"][0, at] = points[0] * forced.units
                rows["criticality"][0, at] = special.criticality
                rows["leads_to"][0, at] = special.leads_to + 1
                if special.change:
                    closed, slid = special.change[: len(numbers)], special.change[len(numbers) :]
                    grazing = [1 << (n - 1) for n, c in zip(numbers, closed, strict=True) if c]
                    rows["change"][0, at] = sum(slid if special.kind is Kind.SLIP else closed)
                    rows["special_contact"][0, at] = sum(grazing)
                at += 1
        first += len(branch.points)


def _strip(study: BranchGrid, line: int) -> tuple[float, float]:
    """Return the lowest and highest frequency of the strip of a line."""
    omega, (low, high) = float(study.omega[line]), study.curve_span
    below, above = study.omega[study.omega < omega], study.omega[study.omega > omega]
    return (
        0.5 * (omega + float(below.max())) if below.size else low,
        0.5 * (omega + float(above.min())) if above.size else high,
    )


def _store_curves(
    rows: Rows, study: BranchGrid, line: int, catalogue: Catalogue, poll: Poll
) -> int:
    """Follow and store the curves of a line; return the forcing periods that it took."""
    omega = float(study.omega[line])
    pair = ForcedMap(
        *(study.structure, float(study.amplitude[line]), omega, PLANE, study.settings.rtol, poll)
    )
    scale = np.array([high - low for low, high in (study.span, study.curve_span)])
    plane = Plane(pair, omega, (study.span, _strip(study, line)), scale)
    curves, on = curves_through(
        catalogue,
        plane,
        [KINDS[name] for name in study.curves],
        study.settings.max_orbit_period,
        Limits(-np.inf, np.inf, study.steps, study.largest_step),
        rows["curve_id"].shape[1],
        rows["curve_of_step"].shape[1],
    )
    places = (
        (number, k)
        for number, branch in enumerate(catalogue.branches)
        for k in range(len(branch.specials))
    )
    for at, place in zip(range(rows["special_curve"].shape[1]), places, strict=False):
        rows["special_curve"][0, at] = on.get(place, -1) + 1
    rows["n_curves"][0] = len(curves)
    at = met = 0
    for number, arc in enumerate(curves, 1):
        locus = arc.curve
        rows["curve_id"][0, number - 1] = number
        rows["curve_kind"][0, number - 1] = locus.kind
        rows["curve_period"][0, number - 1] = locus.period
        for name, why in zip(("curve_begins", "curve_ends"), arc.ends, strict=True):
            rows[name][0, number - 1] = End[why.split(" 1:")[0].upper().replace(" ", "_")]
        for point in arc.points:
            points, value = locus.split(point.y)
            rows["curve_of_step"][0, at] = number
            rows["curve_amplitude"][0, at], rows["curve_omega"][0, at] = value
            rows["curve_point"][0, at] = points[0] * pair.units
            rows["curve_unstable"][0, at] = n_unstable(point.multipliers)
            at += 1
        for _, special in arc.specials[: rows["meeting_curve"].shape[1] - met]:
            rows["meeting_curve"][0, met] = number
            rows["meeting_kind"][0, met] = Met[special.kind.name]
            value = locus.split(special.at.y)[1]
            rows["meeting_amplitude"][0, met], rows["meeting_omega"][0, met] = value
            met += 1
    return pair.periods
