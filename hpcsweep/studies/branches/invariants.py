"""Invariants of the results of a study of branches."""

from typing import Any

import numpy as np

from hpcsweep.studies.invariants import listed, of_outcome

ROUNDING = 1e-9


def broken_invariants(study, rows: dict[str, np.ndarray]) -> list[tuple[int, str]]:
    """Check k lines against what `hpcsweep.studies.branches.branches` says of its results.

    Parameters
    ----------
    study : Branches
    rows : dict of str to ndarray
        The file's variables, first axis the k lines.

    Returns
    -------
    list of (int, str)
        Row and what is wrong there.
    """
    broken = {**_of_branches(rows), **_of_points(study, rows), **_of_seeds(rows)}
    return listed(broken | (_of_curves(study, rows) if study.curves else {}))


def _of_branches(rows: dict) -> dict[str, Any]:
    ids = rows["branch_id"]
    held = ids > 0
    number = np.arange(1, ids.shape[1] + 1)
    return {
        **of_outcome(rows["outcome"]),
        "cycles is at least 0": rows["cycles"] < 0,
        "branches are numbered from 1": (held & (ids != number)).any(axis=1),
        "n_branches counts them": held.sum(axis=1) != rows["n_branches"],
        "branches have a period, an origin and two ends": (
            held & ~((rows["branch_period"] > 0) & (rows["found_by"] > 0))
            | held & ~((rows["begins"] > 0) & (rows["ends"] > 0))
        ).any(axis=1),
        "a branch leaves one found before it": (held & (rows["parent"] >= ids)).any(axis=1),
    }


def _of_points(study, rows: dict) -> dict[str, Any]:
    branch, value = rows["step_branch"], rows["value"]
    held = branch > 0
    low, high = study.span
    slack = ROUNDING * (high - low)
    with np.errstate(invalid="ignore"):
        inside = (value >= low - slack) & (value <= high + slack)
        size = np.hypot(rows["multiplier_real"], rows["multiplier_imag"])
        steady = size.max(axis=2) < 1.0
    special = rows["special_branch"] > 0
    step = rows["special_step"]
    return {
        "points come branch after branch": (
            (np.diff(branch, axis=1) < 0) & (branch[:, 1:] > 0)
        ).any(axis=1),
        "values lie in the span": (held & ~inside).any(axis=1),
        "point is finite": (held & ~np.isfinite(rows["point"]).all(axis=2)).any(axis=1),
        "stable is that of the multipliers": (held & (steady != (rows["stable"] > 0))).any(axis=1),
        "special points have a kind and a step": (
            special & ~((rows["special_kind"] > 0) & (step >= 0) & (step < branch.shape[1]))
        ).any(axis=1),
    }


def _of_curves(study, rows: dict) -> dict[str, Any]:
    ids, step = rows["curve_id"], rows["curve_of_step"]
    number, n_curves = np.arange(1, ids.shape[1] + 1), rows["n_curves"][:, None]
    outside = np.zeros(step.shape, bool)
    for name, (low, high) in (("amplitude", study.span), ("omega", study.curve_span)):
        slack = ROUNDING * (high - low)
        at = rows[f"curve_{name}"]
        with np.errstate(invalid="ignore"):
            outside |= ~((at >= low - slack) & (at <= high + slack))
    return {
        "curves are numbered from 1": ((ids > 0) & (ids != number)).any(axis=1),
        "n_curves counts them": (ids > 0).sum(axis=1) != rows["n_curves"],
        "curves have a kind, a period and two ends": (
            (ids > 0) & ~((rows["curve_kind"] > 0) & (rows["curve_period"] > 0))
            | (ids > 0) & ~((rows["curve_begins"] > 0) & (rows["curve_ends"] > 0))
        ).any(axis=1),
        "points of curves lie in the spans": ((step > 0) & outside).any(axis=1),
        "points, meetings and special points are on curves of the line": (
            (step > n_curves).any(axis=1)
            | (rows["meeting_curve"] > n_curves).any(axis=1)
            | (rows["special_curve"] > n_curves).any(axis=1)
        ),
    }


def _of_seeds(rows: dict) -> dict[str, Any]:
    held, branch = rows["seed_period"] > 0, rows["seed_branch"]
    return {
        "each seed lies on a branch, or is told why not": (
            held & ((branch > 0) == (rows["seed_reason"] > 0))
        ).any(axis=1),
        "seeds lie on branches of the line": (branch > rows["n_branches"][:, None]).any(axis=1),
        "n_covered counts those on a branch": (branch > 0).sum(axis=1) != rows["n_covered"],
        "seeds are counted": (rows["n_seeds"] < held.sum(axis=1)),
    }
