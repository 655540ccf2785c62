"""Find attractors at one forcing frequency: at each amplitude of a path, or a single point."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hpcsweep.dynamics.attractor import Found, Portrait
from hpcsweep.dynamics.attractors import AttractorSearch
from hpcsweep.dynamics.basins import portrait
from hpcsweep.dynamics.known import matched
from hpcsweep.dynamics.starts import box_of, starting_states, usual_reach
from hpcsweep.model import arguments
from hpcsweep.model.confinement import demand_confined
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.solver import SOLVERS, loaded, make_solver
from hpcsweep.studies.attractors.search import UNSTORED, SearchLimits, store_attractor
from hpcsweep.studies.attractors.variables import LIFETIME, attractor_variables
from hpcsweep.studies.blocks import Amplitudes, Poll, Rows
from hpcsweep.studies.settings import SweepSettings
from hpcsweep.studies.sweep.classification import more_variables
from hpcsweep.studies.variables import empty_results


@dataclass(frozen=True, eq=False)
class Carried:
    """State that an amplitude inherits from the previous one.

    Attributes
    ----------
    seeds : ndarray, shape (m, 2n)
    ids : tuple of int
        Identities of m attractors; empty for a seed that is not of an attractor.
    points : list of m arrays, shapes (k, 2n)
    last_id : int
    """

    seeds: np.ndarray
    ids: tuple[int, ...]
    points: list[np.ndarray]
    last_id: int

    @classmethod
    def of(cls, state: np.ndarray, size: int, slots: int) -> "Carried":
        """Read an `end_state`, or the initial state of a path, shape (2n,)."""
        if state.size == size:
            return cls(state[None], (), [], 0)
        each = state[1:].reshape(slots, -1)
        held = each[each[:, 0] > 0]
        points = [row[2:].reshape(-1, size)[: int(row[1])] for row in held]
        seeds = np.array([orbit[-1] for orbit in points]).reshape(-1, size)
        return cls(seeds, tuple(held[:, 0].astype(int).tolist()), points, int(state[0]))


class AttractorRuns:
    """Attractors of one structure at one forcing frequency.

    Parameters
    ----------
    structure : Structure
    omega : float
    settings : SweepSettings
    limits : Limits
    """

    def __init__(
        self, structure: Structure, omega: float, settings: SweepSettings, limits: SearchLimits
    ):
        self._structure, self._settings, self._limits = structure, settings, limits
        self._omega = omega

    def at(self, amplitude: float, seeds: np.ndarray, poll: Poll = None) -> Portrait:
        """Find the attractors at an amplitude."""
        limits, settings = self._limits, self._settings
        self._measured = self._structure.measured_at(self._omega, amplitude)
        made = settings.solver, self._measured, self._omega, settings.rtol
        self._solver = make_solver(*made, yields=True)
        box = np.array(limits.box)
        starts = starting_states(box, limits.starts, limits.seed, self._omega, amplitude)
        starts = self._measured.slipped(starts)
        search = AttractorSearch(
            self._solver, amplitude, settings, limits.max_cycles, limits.confidence, poll
        )
        return portrait(search, seeds, starts)

    def follow(self, amplitudes: Amplitudes, state: np.ndarray, poll: Poll = None) -> Rows:
        """Find the attractors of consecutive amplitudes.

        Parameters
        ----------
        amplitudes : sequence of k floats
        state : ndarray
            `Attractors.end_state` of the previous amplitude, or the initial state of a path.
        poll : callable, optional
            Called before each amplitude and each start; may raise to leave.

        Returns
        -------
        dict of str to ndarray
            The variables of the study, first axis the k amplitudes.
        """
        carried = Carried.of(state, self._structure.state_units.size, self._limits.max_attractors)
        result = empty_results(
            attractor_variables(self._settings, self._structure),
            self._structure,
            len(amplitudes),
            attractor=self._limits.max_attractors,
            cycle=self._settings.stored_points,
            **self._settings.sizes,
        )
        for index, amplitude in enumerate(amplitudes):
            if poll is not None:
                poll()
            portrait = self.at(float(amplitude), carried.seeds, poll)
            carried = self._store(result, index, portrait, carried, float(amplitude), poll)
        return result

    def _store(
        self, result, index: int, portrait: Portrait, before: Carried, amplitude: float, poll: Poll
    ) -> Carried:
        """Store the attractors of an amplitude; return the state that the next one inherits."""
        room = result["poincare"].shape[2]
        order = np.argsort([-attractor.hits for attractor in portrait.attractors], kind="stable")
        kept = [portrait.attractors[k] for k in order[: self._limits.max_attractors].tolist()]
        points = [attractor.points[-room:] for attractor in kept]
        ids, last_id = self._identities(points, before)
        place = sorted(range(len(kept)), key=lambda k: (-kept[k].hits, ids[k]))
        kept, points = [kept[k] for k in place], [points[k] for k in place]
        ids = [ids[k] for k in place]
        for slot, (attractor, orbit, number) in enumerate(zip(kept, points, ids, strict=True)):
            values = {"attractor_id": number, "point": orbit[-1], "n_points": len(orbit)}
            moved = self._solver, amplitude, attractor.points, attractor.orbit_period
            values |= more_variables(*moved, self._settings, poll)
            store_attractor(result, (index, slot), self._measured, attractor, **values)
            result["poincare"][index, slot, : len(orbit)] = orbit
        for name, label in UNSTORED.items():
            result[f"n_{name}"][index] = (portrait.labels == label).sum()
        result["n_transient"][index] = portrait.n_transient
        result["outcome"][index] = portrait.outcome
        for name, value in zip(LIFETIME, portrait.lifetime, strict=True):
            result[name][index] = value
        result["n_attractors"][index], result["last_id"][index] = len(portrait.attractors), last_id
        hits = sum(attractor.hits for attractor in kept)
        result["n_elsewhere"][index] = (portrait.labels >= 0).sum() - hits
        result["cycles"][index] = min(portrait.cycles, np.iinfo(np.int32).max)
        seeds = np.array([orbit[-1] for orbit in points]).reshape(-1, before.seeds.shape[1])
        return Carried(seeds, tuple(ids), points, last_id)

    def _identities(self, points: Sequence[np.ndarray], before: Carried) -> tuple[list[int], int]:
        """Return for each attractor the identity of the one that it continues, or a new one."""
        units = self._measured.state_units
        pairs = matched(
            [orbit / units for orbit in before.points],
            [orbit / units for orbit in points],
            self._limits.match_distance,
        )
        identity = {now: before.ids[then] for then, now in pairs}
        ids, last_id = [], before.last_id
        for place in range(len(points)):
            if place not in identity:
                last_id += 1
                identity[place] = last_id
            ids.append(identity[place])
        return ids, last_id


def attractors(
    structure: Structure,
    amplitude: float,
    omega: float,
    *,
    starts: int = SearchLimits.starts,
    box=None,
    seed: int = SearchLimits.seed,
    states=(),
    confidence: float = SearchLimits.confidence,
    max_cycles: int = SearchLimits.max_cycles,
    max_orbit_period: int = 16,
    period_tolerance: float = 1e-6,
    solver: str = "flow",
    rtol: float | None = None,
) -> Found:
    """Find all attractors at a point, with their shares of a box of starting states.

    An attractor whose basin fills the share s of the box is missed with probability (1 - s)^starts:
    a share of 1 % with probability 1 % by 459 starts (`hpcsweep.dynamics.shares.starts_needed`).

    Parameters
    ----------
    structure : Structure
    amplitude, omega : float
        A and Omega of the ground acceleration A sin(Omega tau) (10).
    starts, seed : int
        Number of starting states, a low-discrepancy sequence in the box, and its seed.
    box : array_like, shape (2n, 2), optional
        Lowest and highest value of each component of (u, v), in gaps and gaps omega_0. Default:
        -1 to 1 gap, and -1 to 1 gap omega_0. Sliders slip from p = 0 as far as they must.
    states : array_like, shape (m, 2n), of L sliders (m, 2n + L)
        Further states from which motions are followed; they do not count for shares.
    confidence : float
        Confidence of the Clopper-Pearson intervals of the shares.
    max_cycles : int
        Forcing periods after which a motion is left undecided.
    max_orbit_period : int
        Longest orbit period sought by its closing, in forcing periods.
    period_tolerance : float
        Points closer than this, in units of the state, count as equal.
    solver : {"flow", "bdf"}
    rtol : float, optional
        Relative tolerance of the solver; default the solver's own.

    Returns
    -------
    list of Attractor
        In order of decreasing share; see `hpcsweep.dynamics.attractor.Attractor`, and of sliders
        `hpcsweep.dynamics.families`. Shares are of all starts: less than 1 in all where some were
        not classified or failed. `n_transient` and `lifetime` of the list tell of transient chaos.

    Raises
    ------
    ValueError
        If an argument is of the wrong kind or outside its range; one line names it.
    ArithmeticError
        If the solver fails from every start.

    References
    ----------
    Clopper and Pearson, Biometrika 26 (1934) 404.

    Examples
    --------
    A floor that hardly reaches its stop: a motion without contact and one of period 5 share all.

    >>> floor = hpcsweep.Structure(
    ...     n_floors=1, stiffness_ratio=29.0, gap=1.26, damping_ratio=0.01, sharpness=math.inf
    ... )
    >>> found = hpcsweep.attractors(floor, amplitude=0.44912, omega=0.801, starts=40)
    >>> sorted((attractor.orbit_period, attractor.contact) for attractor in found)
    [(1, 0), (5, 1)]
    >>> round(sum(attractor.share for attractor in found), 12)
    1.0
    """
    arguments.instance("structure", structure, Structure)
    seeds = arguments.finite_vectors("states", states, structure.state_units.size)
    name = arguments.choice("solver", solver, SOLVERS)
    settings = SweepSettings(
        max_orbit_period=arguments.count("max_orbit_period", max_orbit_period, 1, 1000),
        period_tolerance=arguments.positive("period_tolerance", period_tolerance),
        solver=name,
        rtol=SOLVERS[name].rtol if rtol is None else rtol,
    )
    limits = SearchLimits(
        box=tuple(map(tuple, box_of(box, usual_reach(structure)).tolist())),
        starts=arguments.count("starts", starts, 1, 10**9),
        seed=arguments.count("seed", seed, 0, 2**62),
        confidence=arguments.number("confidence", confidence, "between 0 and 1", 1e-9, 1 - 1e-9),
        max_cycles=arguments.count("max_cycles", max_cycles, 1),
    )
    demand_confined(structure, amplitude := arguments.finite("amplitude", amplitude))
    reach = np.vstack((structure.slipped(np.abs(np.array(limits.box)).max(axis=1)), seeds))
    moving = loaded(structure.within_reach(amplitude, reach), name)
    runs = AttractorRuns(moving, arguments.forcing_frequency("omega", omega), settings, limits)
    portrait = runs.at(amplitude, seeds)
    if portrait.outcome is not Outcome.COMPLETE:
        raise ArithmeticError(f"{name}: {portrait.outcome.name} from every start")
    by_share = sorted(portrait.attractors, key=lambda attractor: -attractor.hits)
    return Found(by_share, portrait.n_transient, portrait.lifetime)
