"""The flow map under a ground-motion record; see `record.march`."""

import math
from collections.abc import Callable

import numpy as np

from hpcsweep.kernels.compile.entry_points import EntryPoint, with_called
from hpcsweep.kernels.compile.warm import load_all
from hpcsweep.model.kernel_model import record_model
from hpcsweep.model.structure import Structure
from hpcsweep.model.units import Units
from hpcsweep.solvers.arguments import solver_arguments
from hpcsweep.solvers.flow.flow_map import LAYER_TOLERANCE, MAX_STEPS
from hpcsweep.solvers.flow.layer.elements import visit_layers
from hpcsweep.solvers.flow.layer.measures import measure_layer_step
from hpcsweep.solvers.flow.march.record import (
    ALL_PEAKS,
    PEAKS_AT_SAMPLES,
    WITH_ENERGY,
    march_record,
)
from hpcsweep.solvers.flow.observe.gathered import reset
from hpcsweep.solvers.flow.state.shared import SHARED, new_shared
from hpcsweep.solvers.outcome import COLLAPSED, Outcome
from hpcsweep.solvers.polling import Polling
from hpcsweep.solvers.record_response import (
    NONE_SLID,
    Ended,
    Response,
    Slid,
    energy_of,
    intervals,
    response_of,
)
from hpcsweep.solvers.sliders import Sliders

KERNELS = with_called(march_record, measure_layer_step)
"""All that responses to records call, but for structures with elements and smooth contacts."""


def kernels_of(structure: Structure, energy: bool = False) -> list[EntryPoint]:
    """Return what responses of a structure, and their energies, call."""
    smooth = structure.layer_half_width > 0.0 and (structure.sliders or energy)
    return with_called(*KERNELS, visit_layers) if smooth else KERNELS


class RecordMap:
    """Respond to ground-motion records of one sample interval, at any scale.

    Parameters
    ----------
    structure : Structure
    dt : float
        Time between two samples.
    rtol : float
        As of `FlowMap`.
    one_sided : int
        So many of the structure's last drifts are of row . u in place of |row . u|.
    base_shear, energy : bool
        Whether the responses have these.
    """

    def __init__(
        self,
        structure: Structure,
        dt: float,
        rtol: float = 1e-9,
        *,
        one_sided: int = 0,
        base_shear: bool = False,
        energy: bool = False,
    ):
        self.structure, self.dt, self.rtol = solver_arguments(structure, dt, rtol, yields=True)
        self._energy = energy
        model = record_model(structure, self.dt, base_shear, energy)
        self._units = Units(structure, model)
        tolerance = min(LAYER_TOLERANCE * self.rtol, 1e-9)
        last = len(structure.drift_rows)
        sided, watched = slice(last - one_sided, last), model.watched.copy()
        rows = np.vstack((np.eye(structure.n_floors), model.rows))[model.drift_rows[sided, 0]]
        watched[sided, 2] = np.sign((rows * structure.drift_rows[sided]).sum(axis=1))
        model = model._replace(watched=watched)
        self._shared, self._packed = SHARED.place(new_shared(model, tolerance, MAX_STEPS))
        self._sliders = Sliders(structure, model.elements)
        self._polling = Polling()
        load_all(kernels_of(structure, energy))

    def respond(
        self,
        acceleration: np.ndarray,
        scale: float = 1.0,
        tail: float = 0.0,
        state: np.ndarray | None = None,
        poll: Callable[[], None] | None = None,
        at_samples: bool = False,
    ) -> Response:
        """Return the response to a record; see `hpcsweep.solvers.response.response`.

        Sliders start from rest.
        """
        reset(self._shared.tally)
        z = self._at_rest()
        if state is not None:
            z = self._units.into(state)
        samples = np.array(acceleration, dtype=float)  # the kernels take what can be written
        start = self._units.out_of(z).copy()
        wanted = PEAKS_AT_SAMPLES if at_samples else WITH_ENERGY if self._energy else ALL_PEAKS
        done, outcome, collapsed = self._advance(z, samples, scale, tail, poll, wanted)
        model, tally, structure = self._shared.model, self._shared.tally, self.structure
        ended = Ended(self._units.out_of(z).copy(), done, outcome, collapsed)
        slid = self._slid(z)
        response = response_of(structure, model, tally, slid, ended)
        if not self._energy:
            return response
        return energy_of(structure, response, slid, start, tally.energy)

    def _slid(self, z: np.ndarray) -> Slid:
        """Return what the sliders have done, up to the state z at the end."""
        model, modes = self._shared.model, self._shared.modes
        sliders = self._sliders
        if not self.structure.sliders:
            return NONE_SLID
        state, change = sliders.plastic(z, modes)
        none = np.full(state.size, math.nan)
        rows, drifts = model.elements.rows[sliders.own].tolist(), model.drift_rows.tolist()
        slid = Slid(
            elongation=self._shared.tally.peaks[[drifts.index(row) for row in rows]],
            force=sliders.force(z, modes.mode, modes.state),
            plastic=sliders.sign * state,
            path=modes.path[sliders.own] + change,
            excursions=modes.taken[sliders.own] + sliders.slips(z, modes),
            stiffness=np.ones(state.size),
            lost=none,
            largest=none,
        )
        if not sliders.memory.size:
            return slid
        which, of_these = sliders.degraded(z, modes, self.structure.frequency_unit)
        values = {k: np.where(which, v, getattr(slid, k)) for k, v in of_these.items()}
        return slid._replace(**values)

    def _advance(self, z, samples, scale, tail, poll, wanted) -> tuple[float, Outcome, bool]:
        """Advance z over a record and its tail, in place.

        Return the time reached, and whether the motion has collapsed there.
        """
        amplitude = scale / self._units.amplitude_unit
        period = self._shared.model.period
        whole, rest = intervals(len(samples), self.dt, tail)
        for first, last in self._polling.cut(whole, poll):
            part = (first, last, period)
            done, outcome = self._march(z, samples, amplitude, part, wanted)
            if outcome != Outcome.COMPLETE:
                return self._end(outcome, (first + done) * self.dt)
        if rest > 0.0:
            part = (whole, whole + 1, rest * self.structure.frequency_unit)
            done, outcome = self._march(z, samples, amplitude, part, wanted)
            if outcome != Outcome.COMPLETE:
                return self._end(outcome, whole * self.dt)
        return whole * self.dt + rest, Outcome.COMPLETE, False

    def _end(self, outcome: int, reached: float) -> tuple[float, Outcome, bool]:
        """Return the end of a motion that has collapsed, or failed after the time `reached`."""
        if outcome != COLLAPSED:
            return reached, Outcome(outcome), False
        model = self._shared.model
        limits = slice(len(model.contacts.row), -len(self.structure.sliders))
        time = float(self._shared.modes.path[limits].max())
        return time / self.structure.frequency_unit, Outcome.COMPLETE, True

    def _at_rest(self) -> np.ndarray:
        """Put elements to rest; return the state of the kernels."""
        modes, elements = self._shared.modes, self._shared.model.elements
        reset(modes)
        modes.mode[:] = elements.first
        modes.state[len(elements.rows) :] = self._sliders.memory.ravel()
        return self._units.into(self.structure.rest)

    def _march(self, z, samples, amplitude, part, wanted, points=None):
        points = np.empty((0, z.size)) if points is None else points
        return march_record(self._packed, z, samples, amplitude, part, wanted, points)
