"""Evidence for the claims: read from files, or integrated from their states.

Small steps where the sweep's are too coarse, longer windows, impacts of an orbit, the end of a
branch: all start from a stored final state and use `flow`.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from claims.coexistence import BranchEnd
from claims.data import Sweep, stretches
from claims.judgement import Hits, windows
from claims.words import C3, C23
from hpcsweep.dynamics.stability import floquet_multipliers
from hpcsweep.model.equations import MODEL, derivative
from hpcsweep.model.kernel_model import kernel_model
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.linear import LinearOrbit
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.solver import make_solver
from hpcsweep.studies.quantities import METRICS
from hpcsweep.studies.settings import SweepSettings
from hpcsweep.studies.sweep.runs import frame_runs

GAMMA = 0.05
RESONANCE, PROBE = 0.445, 0.09877
"""Omega of Figure 3, and the amplitude that the paper calls chaotic."""
RTOL = 1e-9
FINE_RUNS = 40
"""Runs between two of a sweep, where its steps are too coarse."""
LATE_RUNS = 120
LONG_TRANSIENT = 200
"""Forcing periods of transient and window near grazing, where transients are long."""
LONG_WINDOW = 1000
"""Forcing periods of the steady window at the amplitude called chaotic."""
BRANCH_RUNS = 200
BRANCH_STEP = 1e-6
"""Step, in the sweep's, below which the end of a branch is reached."""
LINEAR_RUNS = 5
LINEAR_DECAY = 40.0
"""Transients have decayed to exp(-this) before the closed form is compared."""


def variant_of(structure: Structure) -> str:
    """Return the name of the damping: 'printed', 'described', or the ratios.

    As printed every zeta_i is gamma = 0.05; as the text describes the motion, zeta_i is
    gamma / (2 omega_i^2).
    """
    ratios = structure.damping_ratios
    if np.allclose(ratios, GAMMA, rtol=1e-6):
        return "printed"
    if np.allclose(ratios, GAMMA / (2 * structure.frequencies**2), rtol=1e-4):
        return "described"
    return "zeta = " + ", ".join(f"{ratio:.4g}" for ratio in ratios)


class Study:
    """A structure's sweep at one frequency, and motions integrated from it.

    Parameters
    ----------
    structure : Structure
    sweep : Sweep
    """

    def __init__(self, structure: Structure, sweep: Sweep, settings: SweepSettings):
        self.structure, self.sweep = structure, sweep
        self.solver = make_solver("flow", structure, sweep.omega, RTOL)
        self._settings = replace(
            settings, solver="flow", rtol=RTOL, skip=frozenset(), metrics=frozenset(METRICS)
        )

    def follow(self, amplitudes: np.ndarray, starts: Sequence[np.ndarray], **settings) -> Sweep:
        """Sweep amplitudes up from the first start and, if there is one, down from the second."""
        chosen = replace(self._settings, **settings)
        parts = []
        for direction, start in enumerate(starts):
            order = slice(None) if direction == 0 else slice(None, None, -1)
            result = frame_runs(self.structure, self.sweep.omega, chosen).follow(
                amplitudes[order], np.array(start)
            )
            parts.append({name: values[order] for name, values in result.items()})
        arrays = {name: np.stack([part[name] for part in parts]) for name in parts[0]}
        return make_sweep(
            self.sweep.omega, amplitudes, ("up", "down")[: len(starts)], arrays, chosen
        )

    def grazing(self) -> Sweep | None:
        """Sweep up in small steps from the last run without contact to the first P1 C3."""
        sweep = self.sweep
        touching = np.flatnonzero((sweep.contact[0] != 0) & sweep.valid[0])
        if not touching.size or touching[0] == 0:
            return None
        last_free = touching[0] - 1
        settled = (sweep.period[0] == 1) & (sweep.contact[0] == C3)
        settled[: touching[0]] = False
        if not settled.any():
            return None
        ends = sweep.amplitude[last_free], sweep.amplitude[int(np.argmax(settled))]
        fine = np.linspace(*ends, FINE_RUNS + 1)
        return self.follow(
            fine,
            [sweep.state[0, last_free]],
            transient_cycles=LONG_TRANSIENT,
            sampling_cycles=LONG_TRANSIENT,
        )

    def gaps(self, periods: Sequence[int]) -> list[Sweep]:
        """Sweep up in small steps between consecutive windows of these periods."""
        sweep = self.sweep
        found = [window for window in windows(sweep) if window[0] in periods]
        return [
            self.follow(
                np.linspace(sweep.amplitude[here[2]], sweep.amplitude[there[1]], FINE_RUNS + 1),
                [sweep.state[0, here[2]]],
            )
            for here, there in pairwise(found)
        ]

    def late(self) -> Sweep | None:
        """Sweep in small steps, both ways, over the windows of P6 and P4 on the way up."""
        sweep = self.sweep
        place = {period: (first, last) for period, first, last in windows(sweep)}
        if not sweep.both() or 6 not in place or 4 not in place:
            return None
        first, last = sorted((place[6][1], place[4][0]))
        fine = np.linspace(sweep.amplitude[first], sweep.amplitude[last], LATE_RUNS + 1)
        return self.follow(fine, [sweep.state[0, first], sweep.state[1, last]])

    def hits(self, periods: Sequence[int]) -> list[Hits]:
        """Count the impacts of the orbit in the middle of each window of these periods."""
        counted = []
        for period, first, last in windows(self.sweep):
            if period in periods:
                middle = (first + last) // 2
                amplitude = float(self.sweep.amplitude[middle])
                state = self.sweep.state[0, middle]
                counted.append(self.count_hits(state, amplitude, period))
        return counted

    def count_hits(self, state: np.ndarray, amplitude: float, period: int) -> Hits:
        """Count the impacts of each floor, u_i rising through 1, over one orbit from `state`."""
        from scipy.integrate import solve_ivp

        s, omega = self.structure, self.sweep.omega
        n = s.n_floors
        forcing_period = 2 * math.pi / omega

        model = kernel_model(s, omega)
        packed = MODEL.pack(model)

        def motion(tau, z):
            return derivative(tau, z, amplitude, packed)

        def event(floor):
            def height(_tau, z):
                return z[floor] - 1.0

            height.direction = 1.0  # type: ignore[attr-defined]  # scipy reads it there
            return height

        done = solve_ivp(
            motion,
            (0.0, period * forcing_period),
            state,
            method="LSODA",
            rtol=RTOL,
            atol=RTOL,
            max_step=forcing_period / 100,
            events=[event(floor) for floor in range(n)],
        )
        cycles = np.zeros(n, int)
        z = np.array(state)
        for _ in range(period):
            seen = self.solver.observe(z, amplitude, 1)
            cycles += [seen.contact >> floor & 1 for floor in range(n)]
            z = seen.points[-1]
        return Hits(
            period,
            amplitude,
            tuple(len(times) for times in done.t_events),
            tuple(int(count) for count in cycles),
        )

    def probe(self, amplitude: float = PROBE) -> Sweep | None:
        """Run one amplitude from its neighbours, below and above, with a long window."""
        sweep = self.sweep
        above = int(np.searchsorted(sweep.amplitude, amplitude))
        if not 0 < above < sweep.amplitude.size:
            return None
        starts = [sweep.state[0, above - 1]]
        if sweep.both():
            starts.append(sweep.state[1, above])
        return self.follow(np.array([amplitude]), starts, sampling_cycles=LONG_WINDOW)

    def branch_end(self) -> BranchEnd | None:
        """Follow P1 C23 to its upper end on the way up, in steps halved where it is lost.

        The sweep's own steps may leave it before its end.
        """
        sweep = self.sweep
        found = stretches((sweep.period[0] == 1) & (sweep.contact[0] == C23) & sweep.valid[0])
        if not found or found[-1][1] == sweep.amplitude.size - 1:
            return None
        last = found[-1][1]
        amplitude, state = float(sweep.amplitude[last]), sweep.state[0, last]
        step = float(sweep.amplitude[last + 1]) - amplitude
        least = step * BRANCH_STEP
        _, matrix = self.solver.monodromy(state, amplitude, 1)
        multipliers = floquet_multipliers(matrix)
        for _ in range(BRANCH_RUNS):
            if step < least:
                break
            run = self.follow(
                np.array([amplitude + step]),
                [state],
                transient_cycles=LONG_WINDOW,
                skip=frozenset(("converged", "newton")),
            )
            here = run.state[0, 0]
            _, matrix = self.solver.monodromy(here, amplitude + step, 1)
            found_here = floquet_multipliers(matrix)
            # slow motion past a fold also repeats to the tolerance, but does not attract
            on_branch = run.period[0, 0] == 1 and run.contact[0, 0] == C23
            if on_branch and abs(found_here[0]) < 1:
                amplitude, state, multipliers = amplitude + step, here, found_here
            else:
                step /= 2
        return BranchEnd(amplitude, multipliers)

    def free_norm(self) -> np.ndarray:
        """Return the mean modal norms without contact, in closed form, shape (n,)."""
        orbit = LinearOrbit(self.structure, self.sweep.omega)
        amplitude = 0.1 * self.structure.grazing_amplitude(self.sweep.omega)
        window = orbit.window(amplitude)
        assert window is not None, "a tenth of the grazing amplitude is linear"
        return window.modal_norm

    def linear_distance(self) -> tuple[np.ndarray, np.ndarray]:
        """Integrate runs without contact; return amplitudes and distances to the closed form."""
        sweep = self.sweep
        free = np.flatnonzero((sweep.contact[0] == 0) & sweep.valid[0])
        if not free.size:
            return np.empty(0), np.empty(0)
        chosen = free[np.unique(np.linspace(0, free.size - 1, LINEAR_RUNS).astype(int))]
        orbit = LinearOrbit(self.structure, sweep.omega)
        forcing_period = 2 * math.pi / sweep.omega
        cycles = math.ceil(LINEAR_DECAY / (-orbit.lyapunov_exponent * forcing_period))
        distance = []
        for k in chosen:
            amplitude = float(sweep.amplitude[k])
            # away from the orbit, so that the solver has to find it
            done = self.solver.advance(0.9 * sweep.state[0, k], amplitude, cycles)
            distance.append(np.abs(done.state - orbit.state(amplitude)).max())
        return sweep.amplitude[chosen], np.array(distance)


def make_sweep(omega, amplitude, directions, arrays: dict, settings: SweepSettings) -> Sweep:
    """Make a `Sweep` of the variables of a file or of `FrameRuns.follow`, axes (direction, run)."""
    valid = arrays["outcome"] == Outcome.COMPLETE
    shape = valid.shape
    n = arrays["final_state"].shape[-1] // 2
    window = settings.sampling_cycles * 2 * math.pi / omega
    nothing = np.full(shape, np.nan)
    return Sweep(
        omega=omega,
        amplitude=np.asarray(amplitude),
        directions=tuple(directions),
        period=arrays["orbit_period"].astype(int),
        contact=arrays["contact"].astype(int),
        growth=arrays.get("lyapunov", nothing) * window,
        drift=arrays["drift"],
        modal_norm=arrays.get("modal_norm", np.full((*shape, n), np.nan)),
        state=_last_points(arrays),
        points=arrays["poincare"],
        valid=valid,
        motion=arrays.get("motion"),
    )


def _last_points(arrays: dict) -> np.ndarray:
    """Return the last point of every motion: on the path, or as classified off it."""
    if "classification_cycles" not in arrays:
        return arrays["final_state"]
    last = np.maximum(arrays["n_points"], 1)[..., None, None] - 1
    classified = np.take_along_axis(arrays["poincare"], last, axis=2)[:, :, 0]
    return np.where(
        (arrays["classification_cycles"] > 0)[..., None], classified, arrays["final_state"]
    )
