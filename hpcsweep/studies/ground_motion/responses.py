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

import contextlib
import math
from collections import OrderedDict
from dataclasses import replace
from functools import cached_property, lru_cache

import numpy as np

from hpcsweep.earthquakes.floor_spectra import floor_spectra
from hpcsweep.model.record import Record
from hpcsweep.model.structure import Structure
from hpcsweep.solvers import response
from hpcsweep.solvers.history import history
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.skip_rule import SkipRule
from hpcsweep.studies.blocks import Poll, Rows
from hpcsweep.studies.ground_motion.variables import FLOOR_SPECTRUM, HISTORY, FloorSpectra, peaks_of
from hpcsweep.studies.quantities import POWERS
from hpcsweep.studies.settings import SweepSettings
from hpcsweep.studies.variable import Variable

SKIP_RULES = ("linear", "ratio")
DIGITS = 15
"""Of a ratio: quotients that are equal but for rounding become so."""
BELOW = 1.0 - 1e-9
"""Part of the scale of first contact up to which a motion is taken for linear."""
MAX_KEPT = 48_000_000
"""Bytes of responses that a process keeps."""


class RecordResponses:
    """Responses of a structure to records.

    Parameters
    ----------
    structure : Structure
    settings : SweepSettings
        Solver, rtol, rules and groups of results.
    tail : float
        Time of free motion after each record.
    step : float
        Of the histories, if they are stored: computed plainly, whatever the rules ...
    floors : FloorSpectra
        ... and so are these.
    shapes : dict of Variable to tuple of int
        Shape of each variable of a run.
    """

    def __init__(
        self,
        structure: Structure,
        settings: SweepSettings,
        tail: float,
        step: float,
        floors: FloorSpectra,
        shapes: dict[Variable, tuple[int, ...]],
    ):
        self.structure, self._settings, self._tail = structure, settings, tail
        self._step, self._floors, self._shapes = step, floors, shapes
        self._peaks, self._alone = peaks_of(structure, settings)
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

    def _unknown(self, peaks: list[Variable], **more: int) -> np.ndarray:
        """Return values of peaks by their names, and so many of others, that are not known."""
        shapes = {variable.name: shape for variable, shape in self._shapes.items()}
        form = [(peak.name, float, shapes[peak.name]) for peak in peaks]
        form += [(name, float, (size,)) for name, size in more.items()]
        return np.full((), math.nan, np.dtype(form))

    def rows(self, record: Record, factors: np.ndarray, poll: Poll = None) -> Rows:
        """Compute responses to a record at scales, by variable name; first axis scales."""
        digest = record.digest
        free, first = self.free(record)
        rows = {
            variable.name: np.full((factors.size, *shape), variable.missing, variable.dtype)
            for variable, shape in self._shapes.items()
        }
        for k, factor in enumerate(factors.tolist()):
            scale = self.ratio(factor)
            rule = SkipRule.LINEAR if scale <= first else SkipRule.NONE
            values, outcome = free, Outcome.COMPLETE
            if rule is SkipRule.NONE:
                values, outcome = self._respond(record, digest, scale, poll)
            rows["skip_rule"][k], rows["outcome"][k] = rule, outcome
            for peak in self._alone:
                rows[peak.name][k] = free[peak.name] * factor
            if outcome is not Outcome.COMPLETE:
                continue
            for peak in self._peaks:
                power = POWERS.get(peak.units, 1)
                grown = factor**power if rule is SkipRule.LINEAR else (factor / scale) ** power
                rows[peak.name][k] = values[peak.name] * grown
            if rule is SkipRule.LINEAR and "ductility" in rows:
                rows["ductility"][k] *= scale  # the elongation grows, that of yielding does not
            self._add_motion(rows, k, record, factor, poll)
        return rows

    def _add_motion(self, rows: Rows, k: int, record: Record, factor: float, poll: Poll) -> None:
        """Add the motion itself and floor spectra to row k, if they are stored."""
        structure, tail, rtol = self.structure, self._tail, self._settings.rtol
        if self._step:
            seen = history(structure, record, factor, tail, self._step, rtol=rtol, poll=poll)
            for name in rows.keys() & {variable.name for variable in HISTORY}:
                values = getattr(seen, name.removeprefix("history_"))
                rows[name][k, : len(values)] = values
        if self._floors.periods:
            spectra = floor_spectra(
                structure,
                record,
                self._floors.periods,
                self._floors.damping_ratio,
                factor,
                tail,
                places=self._floors.places,
                rtol=rtol,
                poll=poll,
            )
            rows[FLOOR_SPECTRUM.name][k] = spectra.acceleration

    def prepare(self, record: Record) -> None:
        """Make the tables that the runs of all records have in common, unless they are kept."""
        more = wanted(self._settings)
        response.linear_map(self.computed, record.dt, *more)
        _map(self.computed, record.dt, self._settings.rtol, *more)

    def free(self, record: Record) -> tuple[np.ndarray, float]:
        """Return the response without contacts by name, and the scale up to which it is that."""
        key = (self.computed, self._settings, self._tail, record.digest, None)
        kept = KEPT.get(key)
        if kept is None:
            limited = int((self.structure.drift_limits < math.inf).sum())
            n_contacts = len(self.structure.contacts)
            n_reached = n_contacts + len(self.structure.sliders) + limited
            peaks = self._peaks + self._alone
            values, outcome = self._unknown(peaks, reach=n_reached), Outcome.NON_FINITE
            with contextlib.suppress(ArithmeticError):
                more = wanted(self._settings)
                linear, reach = response.linear_response(self.computed, record, self._tail, *more)
                values["reach"] = reach
                for peak in peaks:
                    of_gaps = peak.source == "reach"
                    values[peak.name] = reach[:n_contacts] if of_gaps else peak.of(linear)
                outcome = Outcome.COMPLETE
            kept = values, outcome
            KEPT.put(key, kept)
        values, outcome = kept
        if not self._linear or outcome is not Outcome.COMPLETE:
            return values, -math.inf
        return values, response.scale_of_contact(self.computed, values["reach"]) * BELOW

    def _respond(
        self, record: Record, digest: str, scale: float, poll: Poll
    ) -> tuple[np.ndarray, Outcome]:
        """Return the response of `computed` at a scale by name, and its outcome."""
        key = (self.computed, self._settings, self._tail, digest, scale)
        if self._ratio and (kept := KEPT.get(key)):
            return kept
        response = respond(self.computed, record, scale, self._tail, self._settings, poll=poll)
        values = self._unknown(self._peaks)
        for peak in self._peaks:
            values[peak.name] = peak.of(response)
        if self._ratio:
            KEPT.put(key, (values, response.outcome))
        return values, response.outcome


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
) -> response.Response:
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
        sliders=[replace(slider, strength=slider.strength / unit) for slider in structure.sliders],
        collapse_drift=None
        if structure.collapse_drift is None
        else (structure.drift_limits / unit).tolist(),
    )


@lru_cache(maxsize=8)
def _map(structure: Structure, dt: float, rtol: float, base_shear: bool, energy: bool):
    return response.record_map(structure, dt, rtol, base_shear=base_shear, energy=energy)


class _Kept(OrderedDict[tuple, tuple[np.ndarray, Outcome]]):
    """Cache of the latest responses, as many of the last one's size as have `MAX_KEPT` bytes."""

    def get(self, key: tuple) -> tuple[np.ndarray, Outcome] | None:  # type: ignore[override]
        """Return the cached response of a key, or None."""
        if key in self:
            self.move_to_end(key)
        return super().get(key)

    def put(self, key: tuple, response: tuple[np.ndarray, Outcome]) -> None:
        """Cache a response."""
        self[key] = response
        while len(self) * response[0].nbytes > MAX_KEPT:
            self.popitem(last=False)


KEPT = _Kept()
