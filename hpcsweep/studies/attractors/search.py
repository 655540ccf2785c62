"""Common parts of studies of attractors: limits, allocation, orbits to validate."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from hpcsweep.dynamics.attractor import ELSEWHERE, FAILED, UNDECIDED, Attractor
from hpcsweep.dynamics.classify import MotionClass
from hpcsweep.dynamics.shares import starts_needed
from hpcsweep.dynamics.starts import usual_reach
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.skip_rule import SkipRule
from hpcsweep.studies.blocks import Rows
from hpcsweep.studies.keys import Key
from hpcsweep.studies.quantities import MEASURES
from hpcsweep.studies.variable import Variable
from hpcsweep.studies.variables import store_measures

STARTS = Key(
    "starts",
    "starting states at each point, or of basins on the slice, that find the attractors; so many "
    "miss one of 1 % with a probability of 1 %",
    starts_needed(0.01, 0.01),
    (1, 100_000_000),
)
SEED = Key("seed", "of the sequence of starts", 0, (0, 2**62))
MAX_ATTRACTORS = Key(
    "max_attractors",
    "attractors stored at a point, or listed for basins, those with the largest shares",
    8,
    (1, 64),
)
MAX_CYCLES = Key(
    "max_cycles",
    "forcing periods for which a motion is followed to classify it, after a transient as long, or "
    "of `sweep.transient_cycles` if that is shorter; the motions without period that are tested "
    "together must outlive 24 times as many at a confidence of 95 %",
    5000,
    (1, 10_000_000),
)
SEARCH = (STARTS, SEED, MAX_ATTRACTORS, MAX_CYCLES)
CONFIDENCE = Key(
    "confidence", "confidence level of the intervals of shares", 0.95, (0.5, 1.0 - 1e-9)
)
MATCH_DISTANCE = Key(
    "match_distance",
    "largest distance, in units of the state, at which an attractor keeps the identity of one at "
    "the amplitude before",
    0.2,
    (1e-9, 1e6),
)

DISPLACEMENT, VELOCITY = (
    Key(
        name,
        "box of the starts: `[low, high]`, or a list of n such pairs",
        told=f"minus to plus the widest gap{times}",
    )
    for name, times in (
        ("displacement", ""),
        ("velocity", " times omega_0 (with units of your own: times the lowest natural frequency)"),
    )
)
KEYS = STARTS, SEED, DISPLACEMENT, VELOCITY, MAX_ATTRACTORS, CONFIDENCE, MAX_CYCLES, MATCH_DISTANCE


@dataclass(frozen=True, eq=False)
class SearchLimits:
    """Limits of the search of attractors at a point.

    Attributes
    ----------
    box : tuple of 2n pairs of float
        Lowest and highest value of each component of the starts.
    starts, seed : int
        Starts a point, and the seed of their sequence.
    max_attractors : int
        Most attractors stored of a point: those with the largest shares.
    confidence : float
        Confidence of the intervals of the shares.
    max_cycles : int
        Forcing periods after which a motion is left undecided.
    match_distance : float
        Largest distance, in units of the state, between attractors of neighbouring amplitudes that
        share an identity.
    """

    box: tuple[tuple[float, float], ...]
    starts: int = STARTS.default
    seed: int = SEED.default
    max_attractors: int = MAX_ATTRACTORS.default
    confidence: float = CONFIDENCE.default
    max_cycles: int = MAX_CYCLES.default
    match_distance: float = MATCH_DISTANCE.default


def read_limits(values, what: str) -> dict[str, Any]:
    """Read the limits of a search, and refuse keys of runs that it does not use.

    Parameters
    ----------
    values
        Values of the job.
    what : str
        What the study searches, for messages.
    """
    if values.get("solver.skip", "all") != "all":
        asked = values.get("solver.skip")
        raise values.error("solver.skip", asked, 'must be "all": every motion is classified')
    if values.has("sweep.classify_cycles"):
        asked = values.get("sweep.classify_cycles")
        raise values.error("sweep.classify_cycles", asked, f"is study.max_cycles of {what}")
    return {key.name: values.read("study", key) for key in SEARCH}


def read_search(values, structures: Iterable[Structure]) -> dict[str, Any]:
    """Read the fields of `SearchLimits`; the box is one for all structures along a path."""
    reach = np.max([usual_reach(structure) for structure in structures], axis=0)
    n = len(reach) // 2
    limits = read_limits(values, "attractors")
    limits |= {key.name: values.read("study", key) for key in (CONFIDENCE, MATCH_DISTANCE)}
    box: list[tuple[float, float]] = []
    for key, most in (("study.displacement", reach[0]), ("study.velocity", reach[-1])):
        asked = values.get(key, [-float(most), float(most)])
        several = isinstance(asked, list) and asked and isinstance(asked[0], list)
        limit = f"must be [low, high], or a list of n = {n} such pairs"
        pairs = values.spans(key, asked, asked if several else [asked] * n, limit)
        if len(pairs) != n:
            raise values.error(key, asked, limit)
        box += map(tuple, pairs.tolist())
    return limits | {"box": tuple(box)}


def store_attractor(
    result: Rows, at: tuple[int, int], structure: Structure, motion: Attractor, **values: Any
) -> None:
    """Store one attractor, and `values`, at a run and a slot, by the names of the variables."""
    for name, value in (vars(motion) | motion.sliders | {"motion": motion.kind} | values).items():
        if name in result:
            result[name][at] = value
    rows = {name: result[name][at][None] for name in MEASURES if name in result}
    store_measures(rows, structure, motion.measures)


def attractors_as_runs(variables: list[Variable], run: Rows) -> list[Rows]:
    """Return each attractor of a run as a motion of a run; `final_state` is its `point`."""
    named = [v.name for v in variables if "attractor" in v.dims and v.name in run]
    motions = []
    for k in np.flatnonzero(run["attractor_id"]):
        motion = {name: run[name][k] for name in named}
        motion["final_state"] = motion["point"]
        motion["skip_rule"] = np.int8(SkipRule.NEWTON)
        motions.append(motion)
    return motions


KINDS = (MotionClass.PERIODIC, MotionClass.QUASI_PERIODIC, MotionClass.CHAOTIC)
"""What an attractor may be."""
UNSTORED = {"undecided": UNDECIDED, "failed": FAILED, "elsewhere": ELSEWHERE}
"""Starts that reached no attractor of the file."""
COUNTS = tuple(f"n_{name}" for name in UNSTORED)
"""The variables that count them."""


def count_starts(done: np.ndarray, runs: Rows, starts_of_each: int) -> dict[str, Any]:
    """Return, for ``status``, the counts of the starts of runs that are `done`."""
    starts, cycles = int(done.sum()) * starts_of_each, float(runs["cycles"][done].sum())
    return {
        "starts": starts,
        "periods_per_start": cycles / starts if starts else None,
        **{f"starts_{name}": int(runs[f"n_{name}"][done].sum()) for name in UNSTORED},
    }
