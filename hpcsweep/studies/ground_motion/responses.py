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

The motion without contacts of what yields takes a run of its own at scales above: of the structure
without its contacts, in units of its largest elongation at which a slider slips, so that runs which
differ in gaps alone share it. How far it reaches to each contact is the gap that would not close.

Neither holds for a smooth stop, which pushes at any distance and whose sharpness is a length: there
every run is computed as it is.
"""

import contextlib
import math
from collections import OrderedDict
from dataclasses import replace
from functools import cached_property, lru_cache, partial

import numpy as np

from hpcsweep.earthquakes.floor_spectra import floor_spectra
from hpcsweep.model.record import Record
from hpcsweep.model.structure import Structure
from hpcsweep.solvers import response
from hpcsweep.solvers.history import history
from hpcsweep.solvers.offers import LINEAR
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.skip_rule import SkipRule
from hpcsweep.studies.blocks import Poll, Rows
from hpcsweep.studies.ground_motion.variables import (
    FLOOR_SPECTRUM,
    HISTORY,
    SPECTRUM_ALONE,
    FloorSpectra,
    peaks_of,
)
from hpcsweep.studies.quantities import POWERS
from hpcsweep.studies.settings import SweepSettings
from hpcsweep.studies.variable import Variable

SKIP_RULES = ("linear", "ratio")
DIGITS = 15
"""Of a ratio: quotients that are equal but for rounding become so."""
BELOW = 1.0 - 1e-9
"""Part of the scale of first contact up to which a motion is taken for linear."""
DUCTILITIES = {"ductility", "ductility_alone"}
FORCES = "strength", "kinetic", "returns"
"""Of sliders."""
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
    def _without_contacts(self) -> tuple[Structure, float] | None:
        """The structure without contacts in a unit of length, and that; None: its motion is linear.

        Its drifts are those of the structure, elongations of sliders, and approaches of contacts.
        """
        structure = self.structure
        if not self._alone or not structure.contacts or LINEAR.of(structure):
            return None
        is_scaled = "ratio" in self._settings.skip
        unit = max(slider.limit for slider in structure.sliders) if is_scaled else 1.0
        rows = structure.slider_directions, structure.directions
        return with_lengths_in(structure.without_contacts(), unit, *rows), unit

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
        return _rounded(factor / self._largest) if self._largest else 1.0

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
            beside, of_beside = free, 1.0
            if rule is SkipRule.NONE and self._without_contacts:
                beside, of_beside = self._beside(record, digest, factor, poll)
            for peak in self._alone:
                grown = (factor / of_beside) ** POWERS.get(peak.units, 1)
                rows[peak.name][k] = beside[peak.name] * grown
            if outcome is not Outcome.COMPLETE:
                continue
            for peak in self._peaks:
                power = POWERS.get(peak.units, 1)
                grown = factor**power if rule is SkipRule.LINEAR else (factor / scale) ** power
                rows[peak.name][k] = values[peak.name] * grown
            for name in rows.keys() & DUCTILITIES if rule is SkipRule.LINEAR else ():
                rows[name][k] *= scale  # the elongation grows, that of yielding does not
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
        if not self._floors.periods:
            return
        periods, ratio, places = self._floors
        of = partial(floor_spectra, places=places, rtol=rtol, poll=poll)
        spectra = of(structure, record, periods, ratio, factor, tail)
        rows[FLOOR_SPECTRUM.name][k] = spectra.acceleration
        if SPECTRUM_ALONE.name in rows:
            if rows["skip_rule"][k] == SkipRule.NONE:
                free = structure.without_contacts()
                spectra = of(free, record, periods, ratio, factor, tail)
            rows[SPECTRUM_ALONE.name][k] = spectra.acceleration

    def prepare(self, record: Record) -> None:
        """Make the tables that the runs of all records have in common, unless they are kept."""
        more = wanted(self._settings)
        response.linear_map(self.computed, record.dt, *more)
        _map(self.computed, record.dt, self._settings.rtol, 0, *more)
        if self._without_contacts:
            apart, n_contacts = self._without_contacts[0], len(self.structure.contacts)
            _map(apart, record.dt, self._settings.rtol, n_contacts, False, False)

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

    def _beside(
        self, record: Record, digest: str, factor: float, poll: Poll
    ) -> tuple[np.ndarray, float]:
        """Return the response without contacts by name, and the scale at which it is that."""
        structure, unit = self._without_contacts  # type: ignore[misc]
        scale, settings = _rounded(factor / unit), replace(self._settings, metrics=frozenset())
        key = (structure, settings, self._tail, digest, scale)
        if kept := KEPT.get(key):
            return kept[0], scale
        n, k = len(self.structure.drift_rows), len(self.structure.contacts)
        ended = respond(structure, record, scale, self._tail, settings, poll, k)
        values, drifts = self._unknown(self._alone), ended.storey_drift
        if ended.outcome is Outcome.COMPLETE:
            left = ended.residual_drift[:n]
            own = replace(ended, storey_drift=drifts[:n], residual_drift=left)
            for peak in self._alone:
                values[peak.name] = drifts[-k:] if peak.source == "reach" else peak.of(own)
        KEPT.put(key, (values, ended.outcome))
        return values, scale

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
    one_sided: int = 0,
) -> response.Response:
    """Return the response of a structure, unscaled, to a record at a scale; see `RecordMap`."""
    solver = _map(structure, record.dt, settings.rtol, one_sided, *wanted(settings))
    return solver.respond(record.acceleration, scale, tail, poll=poll)


def with_lengths_in(structure: Structure, unit: float, *more: np.ndarray) -> Structure:
    """Return the structure by its matrices, with its gaps and strengths in a unit of length.

    Further rows, shape (any, n), are drifts behind its own.
    """
    drift = np.vstack((structure.drift_rows, *more))
    limits = np.full(len(drift), math.inf)
    limits[: len(structure.drift_rows)] = structure.drift_limits / unit
    return Structure.from_matrices(
        structure.mass_matrix,
        structure.elastic_stiffness,
        [replace(contact, gap=contact.gap / unit) for contact in structure.contacts],
        damping=structure.damping_matrix,
        **structure.load,
        drift=drift,
        sharpness=structure.sharpness,
        sliders=[
            replace(
                slider,
                **{key: f / unit for key in FORCES if (f := getattr(slider, key))},
                backbone=slider.backbone and slider.backbone.measured_by(unit),
            )
            for slider in structure.sliders
        ],
        collapse_drift=None if structure.collapse_drift is None else limits.tolist(),
    )


@lru_cache(maxsize=8)
def _map(structure: Structure, dt: float, rtol: float, sided: int, base_shear: bool, energy: bool):
    more = {"base_shear": base_shear, "energy": energy}
    return response.record_map(structure, dt, rtol, one_sided=sided, **more)


def _rounded(ratio: float) -> float:
    return float(f"{ratio:.{DIGITS - 1}e}")


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
