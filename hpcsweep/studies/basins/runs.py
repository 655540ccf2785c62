"""Classify starts on a slice of the initial states, in rows or each on its own."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from hpcsweep.dynamics.attractor import ELSEWHERE, FAILED, UNDECIDED
from hpcsweep.dynamics.basins import Basins
from hpcsweep.dynamics.starts import starting_states
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.solver import make_solver
from hpcsweep.studies.attractors.search import store_values
from hpcsweep.studies.basins.variables import basin_variables, is_of_attractors
from hpcsweep.studies.blocks import Poll, Rows
from hpcsweep.studies.settings import SweepSettings
from hpcsweep.studies.variables import empty_results


@dataclass(frozen=True)
class Slice:
    """A slice of starts, and the limits of the search of its attractors.

    Attributes
    ----------
    components : tuple of two int
    horizontal, vertical : tuple of two float
        Least and greatest value of either component.
    state : tuple of 2n float
        State with the other components of all starts.
    starts, seed, max_attractors, max_cycles : int
        See `hpcsweep.studies.basins.slice.SliceGrid`.
    """

    components: tuple[int, int]
    horizontal: tuple[float, float]
    vertical: tuple[float, float]
    state: tuple[float, ...]
    starts: int
    seed: int
    max_attractors: int
    max_cycles: int


class SliceRuns:
    """Starts of one slice at one point.

    Parameters
    ----------
    structure : Structure
    omega, amplitude : float
    settings : SweepSettings
    shape : Slice
    """

    def __init__(
        self,
        structure: Structure,
        omega: float,
        amplitude: float,
        settings: SweepSettings,
        shape: Slice,
    ):
        self._structure, self._settings, self._slice = structure, settings, shape
        self._omega, self._amplitude = omega, amplitude
        measured = structure.measured_at(omega, amplitude)
        self._solver = make_solver(settings.solver, measured, omega, settings.rtol)
        self._basins: Basins | None = None

    def row(self, horizontal: np.ndarray, ordinate: float, poll: Poll = None) -> Rows:
        """Return the attractors that the starts of a row reach.

        Parameters
        ----------
        horizontal : ndarray, shape (k,)
            First component of the slice of the starts.
        ordinate : float
            Second component.
        poll : callable, optional
            Called before each start and within long ones; may raise to leave.

        Returns
        -------
        dict of str to ndarray
            The variables of the study, first axis of size 1.
        """
        basins = self._known(poll)
        labels, cycles = basins.labels(self._states(horizontal, ordinate), poll)
        row = empty_results(
            basin_variables(self._settings),
            self._structure,
            1,
            attractor=self._slice.max_attractors,
            column=horizontal.size,
        )
        row |= self.attractors(poll)
        row["label"][0] = np.where(labels >= 0, labels + 1, labels)
        for slot in range(len(basins.attractors)):
            row["hits"][0, slot] = (labels == slot).sum()
        row["n_undecided"][0] = (labels == UNDECIDED).sum()
        row["n_failed"][0] = (labels == FAILED).sum()
        row["n_elsewhere"][0] = (labels == ELSEWHERE).sum()
        row["cycles"][0] = min(cycles, np.iinfo(np.int32).max)
        failed = bool(np.all(labels == FAILED))
        row["outcome"][0] = Outcome.SOLVER_FAILED if failed else Outcome.COMPLETE
        return row

    def starts(self, horizontal: np.ndarray, ordinate: float, poll: Poll = None) -> Rows:
        """Return the attractor that each of some starts reaches, on its own; as of `row`.

        Returns
        -------
        dict of str to ndarray
            `START_VARIABLES` of the study, first axis the starts.
        """
        labels, cycles = self._known(poll).alone(self._states(horizontal, ordinate), poll)
        failed = labels == FAILED
        return {
            "label": np.where(labels >= 0, labels + 1, labels).astype(np.int8),
            "cycles": np.minimum(cycles, np.iinfo(np.int32).max).astype(np.int32),
            "outcome": np.where(failed, Outcome.SOLVER_FAILED, Outcome.COMPLETE).astype(np.int8),
        }

    def attractors(self, poll: Poll = None) -> Rows:
        """Return the attractors of the slice, arrays of shape (1, max_attractors, ...)."""
        variables = [v for v in basin_variables(self._settings) if is_of_attractors(v)]
        most = self._slice.max_attractors
        found = empty_results(variables, self._structure, 1, attractor=most)
        for slot, one in enumerate(self._known(poll).attractors):
            known = {"attractor_id": slot + 1, "point": one.points[-1]}
            store_values(found, (0, slot), self._solver.structure, one, **known)
        return found

    def _states(self, horizontal: np.ndarray, ordinate: float) -> np.ndarray:
        """Return starts of a row, shape (k, 2n)."""
        first, second = self._slice.components
        states = np.tile(np.array(self._slice.state), (horizontal.size, 1))
        states[:, first], states[:, second] = horizontal, ordinate
        return states

    def _known(self, poll: Poll) -> Basins:
        """Find the attractors, once."""
        if self._basins is None:
            shape, state = self._slice, np.array(self._slice.state)
            box = np.stack((state, state), axis=1)
            box[shape.components[0]], box[shape.components[1]] = shape.horizontal, shape.vertical
            point = self._omega, self._amplitude
            self._basins = Basins(
                self._solver,
                self._amplitude,
                starting_states(box, shape.starts, shape.seed, *point),
                self._settings,
                shape.max_cycles,
                shape.max_attractors,
                poll,
            )
        return self._basins


@lru_cache(maxsize=2)
def slice_runs(
    structure: Structure, omega: float, amplitude: float, settings: SweepSettings, shape: Slice
) -> SliceRuns:
    """Return the rows of a slice; the attractors of the last two slices are cached."""
    return SliceRuns(structure, omega, amplitude, settings, shape)
