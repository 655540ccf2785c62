r"""Compute responses of a structure to a record at many scales, with two rules that spare work.

From rest, with sharp contacts (dashpots too), the equations are homogeneous in lengths: with u(t)
the response of gaps g at scale s, L u(t) is that of gaps L g at scale L s, forces and velocities
grow with L, energies with its square, times and counts stay. Sliders scale likewise, with the
elongation at which they slip, and limits of drifts, beside the gaps. So is the static equilibrium
of pressed contacts from which it starts, gaps below 0.

ratio
    So only s / |g| matters, |g| being the largest gap and the proportions of the others given. A
    run is computed with the gaps g / |g| at the scale s / |g|, rounded to `DIGITS` digits, and
    rescaled to s. Another run of the same ratio, at another scale of the record or in another part
    of a job that varies gaps, is the same. A process caches its runs, and computes the same numbers
    without the cache: results do not depend on ranks or on order. Where all gaps are 0 one run
    serves all scales.
linear
    Without contacts and sliders the motion is proportional to s at all scales, and it is the motion
    up to the scale at which its reach, max_t d_k . u, comes to a gap, or max_t |b_j . u| to where a
    slider slips, or a drift to its limit (`first_contact_scale`): at none where a contact is
    pressed.

Neither holds for a smooth stop, which pushes at any distance and whose sharpness is a length: there
every run is computed as it is.
"""

import math
from collections import OrderedDict
from dataclasses import replace
from functools import cached_property, lru_cache

import numpy as np

from hpcsweep.earthquakes.floor_spectra import floor_spectra
from hpcsweep.model.record import Record
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.history import history
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.record_response import Energy
from hpcsweep.solvers.response import (
    Response,
    linear_map,
    linear_response,
    record_map,
    scale_of_contact,
)
from hpcsweep.solvers.skip_rule import SkipRule
from hpcsweep.studies.blocks import Poll, Rows
from hpcsweep.studies.ground_motion.floors import FLOOR_SPECTRUM, FloorSpectra
from hpcsweep.studies.ground_motion.variables import (
    HISTORY,
    RUN,
    pack,
    peaks_of,
)
from hpcsweep.studies.settings import SweepSettings

SKIP_RULES = ("linear", "ratio")
DIGITS = 15
"""Of a ratio: quotients that are equal but for rounding become so."""
BELOW = 1.0 - 1e-9
"""Part of the scale of first contact up to which a motion is taken for linear."""
MAX_KEPT = 6_000_000
"""Numbers of responses that a process keeps, 50 MB."""


class RecordResponses:
    """Responses of a structure to records.

    Parameters
    ----------
    structure : Structure
    settings : SweepSettings
        Solver, rtol, rules and groups of results.
    tail : float
        Time of free motion after each record.
    step, n_instants : float, int
        Of the histories, if they are stored: computed plainly, whatever the rules ...
    floors : FloorSpectra
        ... and so are these.
    """

    def __init__(
        self,
        structure: Structure,
        settings: SweepSettings,
        tail: float,
        step: float,
        n_instants: int,
        floors: FloorSpectra,
    ):
        self.structure, self._settings, self._tail = structure, settings, tail
        self._step, self._n_instants, self._floors = step, n_instants, floors
        self._own, self._alone = peaks_of(structure, settings)
        sharp = structure.sharpness == math.inf or not structure.contacts
        self._linear = sharp and "linear" in settings.skip
        self._ratio = sharp and "ratio" in settings.skip

    @cached_property
    def _largest(self) -> float:
        """Largest gap of the structure, of either sign, or elongation at which a slider slips.

        1 where ratios are not used.
        """
        if not self._ratio:
            return 1.0
        lengths = [abs(contact.gap) for contact in self.structure.contacts]
        lengths += [slider.limit for slider in self.structure.sliders]
        return max(lengths, default=0.0)

    @cached_property
    def computed(self) -> Structure:
        """The structure whose responses are computed: with gaps in units of the largest."""
        if not self._ratio or self._largest == 0.0:
            return self.structure
        return with_lengths_in(self.structure, self._largest)

    def ratio(self, factor: float) -> float:
        """Return the scale at which `computed` responds like the structure at a scale."""
        if not self._ratio:
            return factor
        if self._largest == 0.0:
            return 1.0
        return float(f"{factor / self._largest:.{DIGITS - 1}e}")

    def rows(self, record: Record, factors: np.ndarray, poll: Poll = None) -> Rows:
        """Compute responses to a record at scales, by variable name; first axis scales."""
        digest = record.digest
        free, alone, first = self.free(record)
        told: dict[str, list] = {"outcome": [], "skip_rule": []}
        found = []
        for factor in factors.tolist():
            scale = self.ratio(factor)
            is_linear = scale <= first
            if is_linear:
                more = self._powers("linear_power") - self._powers("power")
                outcome = Outcome.COMPLETE
                own = free * factor ** self._powers("power") * scale**more
            else:
                row, outcome = self._respond(record, digest, scale, poll)
                own = row * (factor / scale) ** self._powers("power")
            found.append(np.concatenate((own, alone * factor)))
            told["outcome"].append(outcome)
            told["skip_rule"].append(SkipRule.LINEAR if is_linear else SkipRule.NONE)
        motion = self._histories(record, factors, told["outcome"], poll) if self._step else {}
        return (
            self._by_name(np.array(found))
            | motion
            | self._floor_spectra(record, factors, told["outcome"], poll)
            | {name: np.array(values, np.int8) for name, values in told.items()}
        )

    def _histories(self, record, factors, outcomes, poll: Poll) -> Rows:
        """Compute the motion itself at the instants, by variable name; NaN where there is none."""
        structure, n = self.structure, self.structure.n_floors
        counts = (n, n, len(structure.contacts), len(structure.sliders))
        sizes = dict(zip((one.name for one in HISTORY), counts, strict=True))
        found = {
            name: np.full((factors.size, self._n_instants, size), math.nan)
            for name, size in sizes.items()
            if size
        }
        for k, (factor, outcome) in enumerate(zip(factors.tolist(), outcomes, strict=True)):
            if outcome is Outcome.COMPLETE:
                seen = history(
                    *(self.structure, record, factor, self._tail, self._step),
                    rtol=self._settings.rtol,
                    poll=poll,
                )
                motion = seen.displacement, seen.velocity, seen.force, seen.slider_force
                for name, values in zip(sizes, motion, strict=True):
                    if name in found:
                        found[name][k, : len(values)] = values
        return found

    def _floor_spectra(self, record, factors, outcomes, poll: Poll) -> Rows:
        """Compute the floor spectra, by variable name; NaN where there is no motion."""
        periods, ratio, places = self._floors
        if not periods:
            return {}
        found = np.full((factors.size, len(places), len(periods)), math.nan)
        for k, (factor, outcome) in enumerate(zip(factors.tolist(), outcomes, strict=True)):
            if outcome is Outcome.COMPLETE:
                seen = floor_spectra(
                    *(self.structure, record, periods, ratio, factor, self._tail),
                    places=places,
                    rtol=self._settings.rtol,
                    poll=poll,
                )
                found[k] = seen.acceleration
        return {FLOOR_SPECTRUM.name: found}

    def prepare(self, record: Record) -> None:
        """Make the tables that the runs of all records have in common, unless they are kept."""
        more = wanted(self._settings)
        linear_map(self.computed, record.dt, *more)
        _map(self.computed, record.dt, self._settings.rtol, *more)

    def free(self, record: Record) -> tuple[np.ndarray, np.ndarray, float]:
        """Return the response without contacts, the results of it, and its largest scale."""
        key = (self.computed, self._settings, self._tail, record.digest, None)
        kept = KEPT.get(key)
        if kept is None:
            try:
                more = wanted(self._settings)
                linear, reach = linear_response(self.computed, record, self._tail, *more)
            except ArithmeticError:
                size = int(np.sum(self._sizes)) + len(self.structure.contacts)
                size += len(self.structure.sliders)
                size += int((self.structure.drift_limits < math.inf).sum())
                kept = np.full(size, math.nan), Outcome.NON_FINITE
            else:
                gaps = reach[: len(self.structure.contacts)]
                own, alone = pack(linear, gaps, self._own), pack(linear, gaps, self._alone)
                kept = np.concatenate((own, alone, reach)), Outcome.COMPLETE
            KEPT.put(key, kept)
        ends = int(np.sum(self._sizes[: len(self._own)])), int(np.sum(self._sizes))
        own, alone, reach = np.split(kept[0], ends)
        is_known = self._linear and kept[1] is Outcome.COMPLETE
        first = scale_of_contact(self.computed, reach) * BELOW if is_known else -math.inf
        return own, alone, first

    def _respond(self, record: Record, digest: str, scale: float, poll: Poll):
        """Return the packed response of `computed` at a scale, and its outcome."""
        key = (self.computed, self._settings, self._tail, digest, scale)
        if self._ratio and (kept := KEPT.get(key)):
            return kept
        response = respond(self.computed, record, scale, self._tail, self._settings, poll=poll)
        row = pack(response, np.empty(0), self._own)
        if response.outcome is not Outcome.COMPLETE:
            row = np.full(row.size, math.nan)
        if self._ratio:
            KEPT.put(key, (row, response.outcome))
        return row, response.outcome

    @cached_property
    def _sizes(self) -> list[int]:
        """Numbers of each peak."""
        n = self.structure.n_floors
        sizes = {
            "floor": n,
            "state": 2 * n,
            "storey": len(self.structure.drift_rows),
            "stop": len(self.structure.contacts),
            "slider": len(self.structure.sliders),
            "building": len(self.structure.base_rows),
            "energy": len(Energy._fields),
            RUN[-1]: 1,
        }
        return [sizes[peak.variable.dims[-1]] for peak in (*self._own, *self._alone)]

    def _powers(self, name: str) -> np.ndarray:
        """Power of the scale for each number of a run's own response; a field of `Peak`."""
        sizes = self._sizes[: len(self._own)]
        return np.repeat([float(getattr(peak, name)) for peak in self._own], sizes)

    def _by_name(self, rows: np.ndarray) -> Rows:
        ends = np.cumsum(self._sizes)[:-1]
        peaks = [peak.variable for peak in (*self._own, *self._alone)]
        named = zip(peaks, np.split(rows, ends, axis=1), strict=True)
        return {
            one.name: np.ascontiguousarray(
                values if one.dtype == "<f8" else np.nan_to_num(values), one.dtype
            ).reshape(len(rows), *values.shape[1 : len(one.dims) - 1])
            for one, values in named
        }


def wanted(settings: SweepSettings) -> tuple[bool, bool]:
    """Return whether base shears and energies are."""
    return "base_shear" in settings.metrics, "energy" in settings.metrics


def respond(
    structure: Structure,
    record: Record,
    scale: float,
    tail: float,
    settings: SweepSettings,
    poll: Poll = None,
) -> Response:
    """Return the response of a structure, unscaled, to a record at a scale."""
    solver = _map(structure, record.dt, settings.rtol, *wanted(settings))
    return solver.respond(record.acceleration, scale, tail, poll=poll)


def with_lengths_in(structure: Structure, unit: float) -> Structure:
    """Return the structure by its matrices, with its gaps and strengths in a unit of length."""
    return Structure.from_matrices(
        structure.mass_matrix,
        structure.elastic_stiffness,
        [replace(contact, gap=contact.gap / unit) for contact in structure.contacts],
        damping=structure.damping_matrix,
        **structure.load,
        drift=structure.drift_rows,
        sharpness=structure.sharpness,
        sliders=[replace(one, strength=one.strength / unit) for one in structure.sliders],
        collapse_drift=None
        if structure.collapse_drift is None
        else (structure.drift_limits / unit).tolist(),
    )


@lru_cache(maxsize=8)
def _map(structure: Structure, dt: float, rtol: float, base_shear: bool, energy: bool):
    return record_map(structure, dt, rtol, base_shear=base_shear, energy=energy)


class _Kept:
    """Cache of the latest responses, up to `MAX_KEPT` numbers."""

    def __init__(self):
        self._rows: OrderedDict[tuple, tuple[np.ndarray, Outcome]] = OrderedDict()
        self._numbers = 0

    def get(self, key: tuple) -> tuple[np.ndarray, Outcome] | None:
        """Return the cached response of a key, or None."""
        found = self._rows.get(key)
        if found is not None:
            self._rows.move_to_end(key)
        return found

    def put(self, key: tuple, found: tuple[np.ndarray, Outcome]) -> None:
        """Cache a response."""
        self._rows[key] = found
        self._numbers += found[0].size
        while self._numbers > MAX_KEPT:
            _, (row, _) = self._rows.popitem(last=False)
            self._numbers -= row.size

    def clear(self) -> None:
        """Clear the cache."""
        self.__init__()  # type: ignore[misc]


KEPT = _Kept()
