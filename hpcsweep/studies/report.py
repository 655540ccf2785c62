"""Base of studies over frequency and amplitude: what users are told of them and their runs."""

from collections.abc import Iterator
from typing import Any, ClassVar

import numpy as np

from hpcsweep.model.description import few
from hpcsweep.model.structure import Structure
from hpcsweep.model.unit_names import known_unit, unit_of
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.skip_rule import SkipRule
from hpcsweep.studies.settings import SweepSettings
from hpcsweep.studies.starting_range import starting_range
from hpcsweep.studies.tally import RunTally

FAR = 3.0
"""Least ratio of every frequency to every natural one that counts as far from resonance."""
WIDE = 0.05
"""Least amplitude step, over the smallest grazing amplitude, that disturbs a sweep."""
MAX_FRAMES = 200
"""Frames whose amplitudes and grazing are examined."""


class RunReport:
    """Descriptions of a grid of runs for users; see `hpcsweep.studies.study.Report`."""

    structure: Structure
    settings: SweepSettings
    omega: np.ndarray
    directions: tuple[str, ...]
    carried: ClassVar[tuple[str, ...]] = ("final_state",)
    is_path: ClassVar[bool] = True
    """Whether a run starts from what another one left."""

    @property
    def n_frames(self) -> int:
        """Number of frames."""
        return self.omega.size

    def amplitudes_of(self, frame: int) -> np.ndarray:
        """Return the amplitudes of a frame, ascending, shape (n_amplitudes,)."""
        raise NotImplementedError

    @property
    def covered(self) -> tuple[np.ndarray, np.ndarray]:
        """Frequencies and amplitudes of the motions, ascending or their range."""
        frames = range(min(self.n_frames, MAX_FRAMES))
        return self.omega, np.unique(np.concatenate([self.amplitudes_of(k) for k in frames]))

    @property
    def starting_range(self) -> dict[str, tuple[int, float, float]]:
        """Component and range of drawn or gridded starts, by name; empty if there are none."""
        return {}

    def motions(self, run: dict[str, np.ndarray]) -> list[dict[str, Any]]:
        """Return the one motion of a run."""
        return [run]

    def count(self, done: np.ndarray, runs: dict[str, np.ndarray]) -> dict[str, Any]:
        """Count runs by skip rule, and runs without an orbit."""
        complete, of = done & (runs["outcome"] == Outcome.COMPLETE), self.settings
        return {
            "periods_per_run_window": of.transient_cycles + of.sampling_cycles,
            "runs_spared": {
                rule.name.lower(): int((done & (runs["skip_rule"] == rule)).sum())
                for rule in SkipRule
                if rule is not SkipRule.NONE
            },
            "no_period_found": int((complete & (runs["orbit_period"] == 0)).sum()),
        }

    def tally(self) -> Any:
        """Return a tally of runs for ``summary``."""
        return RunTally(self)

    def describe(self, run: tuple[int, ...]) -> dict[str, Any]:
        """Describe a run: ``direction``, ``omega``, ``amplitude``."""
        direction, frame, at = run
        omega, amplitude = float(self.omega[frame]), float(self.amplitudes_of(frame)[at])
        return {"direction": self.directions[direction], "omega": omega, "amplitude": amplitude}

    def describe_task(self, task: int) -> str:
        """Describe a task by its frequency and other properties."""
        raise NotImplementedError

    def lines(self) -> Iterator[str]:
        """List the ranges of frequency and amplitude, of first contact, and of the starts."""
        structure, (omega, amplitude) = self.structure, self.covered
        unit = known_unit(structure, "acceleration")
        named = structure.unit_names.time
        cycles = unit_of(structure, "cycles") if named else "cycles per unit of time"
        turns = f"{_range(omega / (2 * np.pi))} {cycles}"
        yield f"frequency:  {_range(omega)}{known_unit(structure, 'frequency')} = {turns}"
        yield f"amplitude:  {_range(amplitude)}{unit}"
        omegas, grazes = _grazing_amplitudes(structure, omega)
        if np.isfinite(grazes).any():
            least = int(grazes.argmin())
            most = int(np.where(np.isfinite(grazes), grazes, 0).argmax())
            ends = dict.fromkeys((least, most))
            text = " to ".join(f"{grazes[k]:.6g}{unit} (Omega = {omegas[k]:.6g})" for k in ends)
            yield f"grazing:    the free motion first touches at A = {text}"
        else:
            yield "grazing:    there is no contact"
        for line in starting_range(self):
            yield f"starts:     {line}"

    def warnings(self) -> Iterator[str]:
        """Return one line for each thing that looks like a mistake in what drives the structure."""
        structure, (omega, amplitude) = self.structure, self.covered
        natural = structure.frequencies
        orders = np.array([order for order, _, _ in structure.forcing.terms])
        ratio = np.abs(np.log(np.outer(orders, omega).ravel()[:, None] / natural))
        if ratio.min() > np.log(FAR):
            yield (
                f"every frequency ({few(tuple(np.unique(omega).tolist()))}) is more than {FAR:g} "
                f"times off every natural one (the lowest {natural[0]:.6g})"
            )
        _, grazes = _grazing_amplitudes(structure, omega)
        continues = self.is_path and "final_state" in self.carried
        if amplitude.size > 1 and continues and 0 < grazes.min() < np.inf:
            step, least = float(np.diff(amplitude).max()), float(grazes.min())
            if step > WIDE * least and amplitude.max() > least:
                yield (
                    f"an amplitude step of {step:.4g} is {step / least:.2g} of the smallest "
                    f"grazing amplitude {least:.4g}: the transient after a step touches where the "
                    "steady motion does not"
                )


def _range(values: np.ndarray) -> str:
    """Format the lowest and the highest of some values, or the only one."""
    return " to ".join(dict.fromkeys(f"{value:.6g}" for value in (values.min(), values.max())))


def _grazing_amplitudes(structure: Structure, omega: np.ndarray) -> np.ndarray:
    """Return frequencies and the grazing amplitude at each, inf where nothing grazes."""
    omegas = np.unique(omega)
    if omegas.size > MAX_FRAMES:
        omegas = omegas[np.linspace(0, omegas.size - 1, MAX_FRAMES).astype(int)]
    found = []
    for each in omegas.tolist():
        try:
            found.append(structure.grazing_amplitude(each))
        except ZeroDivisionError:
            found.append(0.0)
    return np.array([omegas, found])
