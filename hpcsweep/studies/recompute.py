"""Recompute a stored run, with the other solver and as it was.

With the other solver, at a tight tolerance (`flow` itself of systems that `bdf` is not for):

periodic run (period p)
    From the stored last point, p forcing periods: every point on the way must equal the stored one,
    so that the orbit closes. Where the run ended on the orbit (by a skip rule), contact set, drift
    and modal norms must be those of the orbit; otherwise they must not exceed the stored ones.
aperiodic run
    From a few stored points, one forcing period each: the result must be the next stored point; of
    the first, contacts and peaks within the stored ones, which takes `bdf` three times as long. A
    longer comparison would measure chaos, not errors.

The allowed difference is that of the two tolerances, times the growth of the tangent map on the
way.

As it was: the whole run from the stored state of the previous run, by ``flow``. This verifies the
path: if the run was periodic and the file's solver is ``flow``, the points must be the same.
"""

from typing import Any

import numpy as np

from hpcsweep.dynamics.classify import Shakedown
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.offers import TANGENTS
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.records import Observation, normalised_drift
from hpcsweep.solvers.skip_rule import SkipRule
from hpcsweep.solvers.solver import SOLVERS, make_solver, witness_of
from hpcsweep.studies.blocks import Block, Rows
from hpcsweep.studies.quantities import DRIFT, MEASURES
from hpcsweep.studies.run_names import run_name
from hpcsweep.studies.settings import SweepSettings
from hpcsweep.studies.study import RunAgain, Study
from hpcsweep.studies.variable import CONTACT_SET
from hpcsweep.studies.variables import RUN_VARIABLES, empty_results, store_measures

STEPS = 3
"""Forcing periods of an aperiodic run that are computed again."""
ERROR_GROWTH = 0.7
"""Power of beta / 1000 with which the error of a period grows beyond beta = 1000."""
MODAL_ALLOWED = 2e-4
"""Difference allowed a modal norm: a mean of |q_j| / ||q||, which turns within a short time where
the largest q_j changes sign; the quadrature of `bdf` errs by some 1e-5 there."""
MIN_ALLOWED = 1e-7
"""Smallest difference allowed; closed forms and integrators meet no closer."""


def compute_again(study: Study, block: Block, row: int, run: dict, whole: Rows) -> RunAgain:
    """Recompute one complete run.

    Parameters
    ----------
    study : Study
    block : Block
    row : int
        Of the block.
    run : dict of str to ndarray
        The run's variables.
    whole : dict of str to ndarray
        The run as `flow` computes it from the end of the previous one, first axis 1.

    Returns
    -------
    RunAgain
    """
    other = witness_of(study.settings.solver, study.structure)
    described, home = study.describe(block.run(row)), study.structure_at(block.run(row)[-1])
    point = described["omega"], described["amplitude"]
    compared = []
    for motion in study.motions(run):
        forcing = motion.get("omega", point[0]), motion.get("amplitude", point[1])
        moving = motion.get("structure", home).measured_at(*forcing), forcing[0]
        solver, tangent = (
            make_solver(name, *moving, SOLVERS[name].tight, yields=True) for name in (other, "flow")
        )
        again = RunAgain(run_name(described), other, *forcing, int(motion["orbit_period"]))
        try:
            _compare_points(study.settings, again, solver, tangent, motion)
        except ArithmeticError as error:
            again.compared, again.difference = f"nothing: {error}", None
        compared.append(again)
    nothing = RunAgain(run_name(described), other, *point, compared="nothing: no motion is held")
    again = max(compared, key=_badness, default=nothing)
    _compare_whole(study, again, run, whole)
    return again


def _badness(again: RunAgain) -> tuple[bool, float]:
    """Sort key of the motions of a run: those with a problem last, then by difference."""
    if again.difference is None or not again.allowed:
        return bool(again.problem), -1.0
    return bool(again.problem), again.difference / again.allowed


def _allowed(settings: SweepSettings, structure: Structure, other: str, growth: float) -> float:
    stiff = max(structure.stiffest_contact / 1000.0, 1.0) ** ERROR_GROWTH
    stored, witness = SOLVERS[settings.solver], SOLVERS[other]
    error = stored.period_error * settings.rtol + witness.period_error * witness.tight
    return max(error * stiff, MIN_ALLOWED) * max(growth, 1.0)


def _norm(tangent: np.ndarray, units: np.ndarray) -> float:
    """Return the growth of a tangent map; 1, the strictest value, if it is unknown."""
    scaled = tangent * units / units[:, None]
    return float(np.linalg.norm(scaled, 2)) if np.all(np.isfinite(scaled)) else 1.0


def _apart(structure: Structure, states: np.ndarray, stored: np.ndarray) -> float:
    """Return the largest difference of states, in their units, relative to a steady drift."""
    apart = structure.without_drift(states - stored)
    return float((np.abs(apart) / structure.state_units).max())


def _compare_points(settings: SweepSettings, again: RunAgain, solver, tangent, run: dict) -> None:
    """Integrate once around an orbit, or from a few points of an aperiodic run to the next ones."""
    structure, period = solver.structure, again.orbit_period
    units = structure.state_units
    off_path = int(run.get("classification_cycles", 0)) > 0
    if "poincare" not in run and (off_path or not period):
        what = "point of the motion that was classified" if period else "points of an aperiodic run"
        again.compared = f"nothing: the file holds no {what}"
        return
    if period:
        stored = run["poincare"][:period] if "poincare" in run else run["final_state"][None]
        ways = [(stored[-1] if off_path else run["final_state"], stored)]
        again.compared = f"{len(stored)} points once round the orbit"
    else:
        points = run["poincare"][: int(run["n_points"])]
        places = np.unique(np.linspace(0, len(points) - 2, STEPS).astype(int)).tolist()
        ways = [(points[k], points[k + 1 : k + 2]) for k in places if len(points) > 1]
        again.compared = f"{len(ways)} points, each carried to the next"
    on_orbit = bool(period) and (int(run["skip_rule"]) != SkipRule.NONE or off_path)
    n_periods = period or 1
    for k, (z, stored) in enumerate(ways):
        if k:
            points, outcome = solver.points(z, again.amplitude, n_periods)
        else:
            measures = settings.measures
            seen = solver.observe(z, again.amplitude, n_periods, True, measures=measures)
            points, outcome = seen.points, seen.outcome
        if outcome is not Outcome.COMPLETE:
            raise ArithmeticError(f"{again.solver}: {outcome.name}")
        growth, product = 1.0, np.eye(z.size)
        for _ in range(n_periods * TANGENTS.of(structure)):
            z, step = tangent.monodromy(z, again.amplitude, 1)
            product = step @ product
            growth = max(growth, _norm(product, units))
        difference = _apart(structure, points[-len(stored) :], stored)
        allowed = _allowed(settings, structure, again.solver, growth)
        if period and not on_orbit:
            # the points are only known to repeat within this
            allowed += settings.period_tolerance * growth
        if again.difference is None or difference / allowed > _badness(again)[1]:
            again.difference, again.allowed = difference, allowed
        ratchets = int(run.get("shakedown", 0)) == Shakedown.RATCHETING  # each period farther on
        if not k and not ratchets:
            _judge_metrics(structure, again, seen, run, on_orbit)
    if again.difference is not None and not again.difference <= (again.allowed or 0.0):
        again.problem = (
            f"{again.solver} finds points that differ by {again.difference:.2g}, allowed are "
            f"{again.allowed:.2g} ({again.compared})"
        )


def _judge_metrics(
    structure: Structure, again: RunAgain, seen: Observation, run: dict, equal: bool
) -> None:
    """Compare what a variable of the run declares to be comparable with a part of its window.

    Sets of contacts, peaks that are lengths, and means over the modes; they are those of the run
    where they are to be `equal`, else no more than these.
    """
    if again.problem:
        return
    computed: dict[str, Any] = {"contact": seen.contact, "modal_norm": seen.modal_norm}
    computed["drift"] = normalised_drift(seen.peak_drift, again.amplitude, again.omega)
    peaks = [v for v in RUN_VARIABLES if v.name in run and v.name in MEASURES]
    rows = empty_results(peaks, structure, 1)
    store_measures(rows, structure, seen.measures)
    computed |= {name: values[0] for name, values in rows.items()}
    lengths = {"length": 1.0, DRIFT.units: again.amplitude / again.omega**2}
    allowed = 2 * (MIN_ALLOWED if again.allowed is None else again.allowed) * structure.length_unit
    for v in RUN_VARIABLES:
        if v.name not in run or v.name not in computed:
            continue
        value, stored, wrong = computed[v.name], run[v.name], np.array(False)
        if v.flags == CONTACT_SET:
            wrong = value != stored if equal else np.array(value & ~int(stored))
        elif v.units in lengths and again.amplitude:
            excess = (value - stored) * lengths[v.units]
            wrong = (abs(excess) if equal else excess) > allowed
        elif v.dims == ("mode",) and equal and again.amplitude:
            wrong = ~np.isclose(value, stored, rtol=0, atol=MODAL_ALLOWED, equal_nan=True)
        if wrong.any():
            again.problem = (
                f"{again.solver} finds {v.name} {_short(value)}, stored is {_short(stored)}"
            )
            return


def is_equal(run: dict, whole: Rows) -> bool:
    """Return whether all that a stored run and one computed again both hold is the same."""
    return all(whole[name][0].tobytes() == run[name].tobytes() for name in run.keys() & whole)


def _short(values: np.ndarray | float) -> str:
    return " ".join(f"{value:.9g}" for value in np.ravel(values))


def _compare_whole(study: Study, again: RunAgain, run: dict, whole: Rows) -> None:
    """Compare the whole run, recomputed by `flow`."""
    is_flow = study.settings.solver == "flow"
    if is_flow and is_equal(run, whole):
        again.whole_run = "equal"
        return
    again.whole_run = "other"
    stored = study.motions(run)
    computed = study.motions({name: values[0] for name, values in whole.items()})
    if len(stored) != len(computed):
        if is_flow and not again.problem:
            again.problem = f"computed again it holds {len(computed)} motions, stored {len(stored)}"
        return
    allowed = again.allowed if again.allowed is not None else MIN_ALLOWED
    ends = [
        (_apart(study.structure, new["final_state"], old["final_state"]), new["orbit_period"], old)
        for new, old in zip(computed, stored, strict=True)
    ]
    if all(far <= 10 * allowed and period == old["orbit_period"] for far, period, old in ends):
        again.whole_run = "same"
    elif is_flow and again.orbit_period and not again.problem:
        difference, period, old = max(ends, key=lambda end: end[0])
        again.problem = (
            f"from the state stored before it, the run ends {difference:.2g} away from the stored "
            f"end, with period {int(period)} in place of {int(old['orbit_period'])}"
        )
