"""The response to a ground-motion record by `bdf_steps`: each sample interval a time of its own."""

from collections.abc import Callable

import numpy as np
from numpy.polynomial import chebyshev

from hpcsweep.model.kernel_model import record_model
from hpcsweep.model.structure import Structure
from hpcsweep.model.units import Units
from hpcsweep.solvers.arguments import solver_arguments
from hpcsweep.solvers.bdf_steps import BdfSteps
from hpcsweep.solvers.measures import IMPACT_FLAG
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.record_response import Response, intervals, response_of
from hpcsweep.solvers.step_tally import TOP_NODES, StepTally, largest, top_times


class BdfRecordMap:
    """Respond to ground-motion records of one sample interval by scipy's BDF.

    Parameters
    ----------
    structure : Structure
    dt : float
        Time between two samples.
    rtol : float
        As of `BdfMap`.
    """

    def __init__(self, structure: Structure, dt: float, rtol: float = 1e-6):
        self.structure, self.dt, rtol = solver_arguments(structure, dt, rtol)
        self._steps = BdfSteps(record_model(structure, self.dt), rtol)
        self._model = self._steps.model
        self._units = Units(structure, self._model)

    def respond(
        self,
        acceleration: np.ndarray,
        scale: float = 1.0,
        tail: float = 0.0,
        state: np.ndarray | None = None,
        poll: Callable[[], None] | None = None,
        at_samples: bool = False,
    ) -> Response:
        """Return the response to a record; see `hpcsweep.solvers.response.response`."""
        model = self._model
        z = self._units.into(self.structure.rest if state is None else state)
        amplitude = scale / self._units.amplitude_unit
        whole, rest = intervals(len(acceleration), self.dt, tail)
        lengths = [model.period] * whole
        if rest > 0.0:
            lengths.append(rest * self.structure.frequency_unit)
        impacts = StepTally(model, False, IMPACT_FLAG, in_segments=self._steps.in_segments)
        peaks = _Peaks(self.structure, self._steps, amplitude)
        samples = np.append(acceleration, 0.0)

        def on_step(dense, start, end, field):
            if not at_samples:
                impacts.add(dense, start, end, field)
                peaks.add(dense, start, end, field)

        time, outcome = 0.0, Outcome.COMPLETE
        for j, length in enumerate(lengths):
            model.ramp[0] = 0.0, 0.0, time
            if j + 1 < len(acceleration):
                model.ramp[0, :2] = samples[j], (samples[j + 1] - samples[j]) / model.period
            peaks.begun = time
            z, outcome = self._steps.advance(z, amplitude, length, poll, on_step)
            if outcome is not Outcome.COMPLETE:
                break
            time += length
            if at_samples:
                peaks.add_sample(z, length, self._steps.field(z, length, amplitude))
        return response_of(
            self.structure,
            peaks.peaks,
            peaks.times,
            impacts.impacts,
            self._units.out_of(z).copy(),
            time / self.structure.frequency_unit,
            outcome,
        )


class _Peaks:
    """Largest values of drifts, floors, absolute accelerations and contact forces, and when."""

    def __init__(self, structure: Structure, steps: BdfSteps, amplitude: float):
        self._model, self._amplitude = steps.model, amplitude
        model = steps.model
        self._floors = structure.n_floors
        self._tally = StepTally(model, False, in_segments=steps.in_segments)
        n = model.stiffness.shape[0]
        unit = np.vstack((np.eye(n), np.zeros(n)))
        upper, lower = model.drift_rows.T
        self._rows = np.concatenate((unit[upper] - unit[lower], unit[: self._floors]))
        size = len(self._rows) + self._floors + model.contacts.gap.size
        self.peaks, self.times = np.zeros(size), np.zeros(size)
        self.begun = 0.0

    def values(self, times, states, field) -> np.ndarray:
        """Return all outputs at times (k,) and states (2R, k), shape (P, k)."""
        model, n = self._model, self._model.stiffness.shape[0]
        found = [self._rows @ states[:n], np.empty((self._floors, len(times)))]
        for at, (time, z) in enumerate(zip(times, states.T, strict=True)):
            value, rate, _ = model.ramp[0]
            ground = self._amplitude * (value + rate * time)
            found[1][:, at] = field(time, z)[n:][: self._floors] + model.ground * ground
        contacts = range(model.contacts.gap.size)
        return np.concatenate((*found, *(self._tally.force(k, states)[None] for k in contacts)))

    def add(self, dense, start: float, end: float, field) -> None:
        """Raise the peaks by a step."""
        times = top_times(start, end)
        values = self.values(times, dense(times), field)
        two_sided = np.arange(len(self.peaks)) < len(self.peaks) - self._model.contacts.gap.size
        bound = np.abs(chebyshev.chebfit(TOP_NODES, values.T, len(TOP_NODES) - 1)).sum(axis=0)
        for p in np.flatnonzero(bound > self.peaks):
            for sign in (1.0, -1.0) if two_sided[p] else (1.0,):
                found, time = largest(sign * values[p], start, end)
                if found > self.peaks[p]:
                    self.peaks[p], self.times[p] = found, self.begun + time

    def add_sample(self, z: np.ndarray, length: float, field) -> None:
        """Raise the peaks by a state at a sample."""
        now = np.abs(self.values([length], z[:, None], field)[:, 0])
        higher = now > self.peaks
        self.peaks[higher], self.times[higher] = now[higher], self.begun + length
