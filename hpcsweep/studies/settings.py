"""Settings of runs, as the numerical core reads them."""

from dataclasses import dataclass

from hpcsweep.studies.keys import Key
from hpcsweep.studies.quantities import FLAGS, METRIC_KEYS

SKIP_RULES = ("linear", "converged", "newton")
"""Rules by which periods are not integrated because their result is known; see `sweep`."""
MAX_CYCLES = 10_000_000
TRANSIENT = Key("transient_cycles", "forcing periods discarded at each run", 100, (0, MAX_CYCLES))
SAMPLING = Key(
    "sampling_cycles",
    "forcing periods of the steady window, of which results are",
    100,
    (1, MAX_CYCLES),
)
SPECTRUM_ERROR = Key(
    "spectrum_error",
    "requested error of each exponent of `output.lyapunov_spectrum`, half its 95 % confidence "
    "interval, per unit of time",
    1e-3,
    (1e-12, 1e12),
)
SPECTRUM_CYCLES = Key(
    "spectrum_cycles",
    "most forcing periods over which these exponents are averaged",
    20_000,
    (20, MAX_CYCLES),
)


@dataclass(frozen=True)
class SweepSettings:
    """Settings of every run of a sweep.

    Parameters
    ----------
    transient_cycles, sampling_cycles : int
        Forcing periods discarded, and forcing periods of the steady-state window after them.
    max_orbit_period : int
        Longest orbit period to look for, in forcing periods; at most half of `sampling_cycles`, so
        that each period found is seen at least twice.
    period_tolerance : float
        Two stroboscopic points are the same if no coordinate differs by more
        than this, in units of the state.
    solver : str
        ``"flow"`` or ``"bdf"``.
    rtol : float
        Relative tolerance of the solver.
    skip : frozenset of str
        Allowed ones of `SKIP_RULES`; empty for the window procedure.
    metrics : frozenset of str
        The `METRICS` to compute.
    max_points : int, optional
        Most stroboscopic points stored of a run, its last ones; default the whole window.
        At least 2 `max_orbit_period`, so that an orbit is stored whole and the stored points
        show whether the run has one. Nothing else depends on it.
    classify_cycles : int, optional
        Forcing periods for which a run is continued, off its path, if the window leaves its motion
        open (`classification`). 0: none, but a period is claimed only of points that have closed.
        None is the window procedure: a period is claimed of points that repeat.
    spectrum_error : float
        Requested error of Lyapunov exponents, per unit of time.
    spectrum_cycles : int
        Most forcing periods over which they are averaged.
    rows : tuple of str
        Words of `model.coordinates` of which `quantities.ROWS` are stored ...
    n_harmonics : int
        ... and how many harmonics of each.
    """

    transient_cycles: int = TRANSIENT.default
    sampling_cycles: int = SAMPLING.default
    max_orbit_period: int = 16
    period_tolerance: float = 1e-6
    solver: str = "flow"
    rtol: float = 1e-9
    skip: frozenset[str] = frozenset(SKIP_RULES)
    metrics: frozenset[str] = frozenset(key.name for key in METRIC_KEYS if key.default)
    max_points: int | None = None
    classify_cycles: int | None = None
    spectrum_error: float = SPECTRUM_ERROR.default
    spectrum_cycles: int = SPECTRUM_CYCLES.default
    rows: tuple[str, ...] = ()
    n_harmonics: int = 1

    @property
    def measures(self) -> int:
        """Flags of the requested measures, 0 for none."""
        return sum({flag for name, flag in FLAGS.items() if name in self.metrics})

    @property
    def sizes(self) -> dict[str, int]:
        """Sizes of the dimensions of what rows do."""
        return {"coordinate": len(self.rows), "harmonic": self.n_harmonics}

    @property
    def stored_points(self) -> int:
        """Number of stroboscopic points stored of a run."""
        if self.max_points is None:
            return self.sampling_cycles
        return min(self.max_points, self.sampling_cycles)
