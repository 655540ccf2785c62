"""Classify starts on a slice of the initial states, in rows or each on its own."""

import numpy as np

from hpcsweep.dynamics.attractor import FAILED
from hpcsweep.dynamics.attractors import AttractorSearch
from hpcsweep.dynamics.basins import CONFIDENCE, StateBasins
from hpcsweep.dynamics.starts import starting_states
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.solver import make_solver
from hpcsweep.studies.attractors.search import UNSTORED, store_attractor
from hpcsweep.studies.attractors.variables import basin_variables, of_attractors
from hpcsweep.studies.basins.slice import SliceGrid
from hpcsweep.studies.blocks import Poll, Rows
from hpcsweep.studies.variables import empty_results


class SliceRuns:
    """Starts of one slice at one point.

    Parameters
    ----------
    study : SliceGrid
    """

    def __init__(self, study: SliceGrid):
        self._study, self._structure, self._settings = study, study.moving, study.settings
        self._point = self._omega, self._amplitude = (
            float(study.omega[0]),
            float(study.amplitude[0]),
        )
        measured = self._structure.measured_at(*self._point)
        self._solver = make_solver(
            *(self._settings.solver, measured, self._omega, self._settings.rtol), yields=True
        )
        self._basins: StateBasins | None = None

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
            basin_variables(self._settings, self._structure),
            self._structure,
            1,
            attractor=self._study.max_attractors,
            column=horizontal.size,
        )
        row |= self.attractors(poll)
        row["label"][0] = np.where(labels >= 0, labels + 1, labels)
        for slot in range(len(basins.attractors)):
            row["hits"][0, slot] = (labels == slot).sum()
        for name, label in UNSTORED.items():
            row[f"n_{name}"][0] = (labels == label).sum()
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
        variables = of_attractors(self._settings, self._structure)
        rows = empty_results(variables, self._structure, 1, attractor=self._study.max_attractors)
        for slot, attractor in enumerate(self._known(poll).attractors):
            values = {"attractor_id": slot + 1, "point": attractor.points[-1]}
            store_attractor(rows, (0, slot), self._solver.structure, attractor, **values)
        return rows

    def _states(self, horizontal: np.ndarray, ordinate: float) -> np.ndarray:
        """Return starts of a row, shape (k, 2n), whose sliders have slipped as they must."""
        return self._structure.slipped(self._study.at(horizontal, ordinate))

    def _known(self, poll: Poll) -> StateBasins:
        """Find the attractors, once."""
        if self._basins is None:
            study = self._study
            box = np.stack((study.initial_state, study.initial_state), axis=1)
            places = study.two_places()
            for k, values in zip(places, (study.horizontal, study.vertical), strict=True):
                box[k] = values[[0, -1]]
            search = AttractorSearch(
                self._solver, self._amplitude, self._settings, study.max_cycles, CONFIDENCE, poll
            )
            starts = starting_states(box, study.starts, study.seed, *self._point)
            starts = self._structure.slipped(study.at(*starts[:, places].T))
            self._basins = StateBasins(search, starts, study.max_attractors)
        return self._basins
