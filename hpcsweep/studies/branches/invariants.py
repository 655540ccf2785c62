"""Invariants of the results of a study of branches."""

import numpy as np

from hpcsweep.studies.blocks import Rows
from hpcsweep.studies.branches.keys import BranchGrid
from hpcsweep.studies.invariants import Broken, misnumbered

ROUNDING = 1e-9


def broken_relations(study: BranchGrid, rows: Rows) -> Broken:
    """Check k lines against the relations of `hpcsweep.studies.branches.branches`."""
    broken = {**_of_branches(rows), **_of_points(study, rows), **_of_seeds(rows)}
    return broken | (_of_curves(study, rows) if study.curves else {})


def _of_branches(rows: Rows) -> Broken:
    ids = rows["branch_id"]
    held = ids > 0
    return {
        "branches are numbered from 1": misnumbered(ids),
        "n_branches counts them": held.sum(axis=1) != rows["n_branches"],
        "a branch leaves one found before it": (held & (rows["parent"] >= ids)).any(axis=1),
    }


def _of_points(study: BranchGrid, rows: Rows) -> Broken:
    branch, value = rows["step_branch"], rows["value"]
    held = branch > 0
    with np.errstate(invalid="ignore"):
        size = np.hypot(rows["multiplier_real"], rows["multiplier_imag"])
        steady = size.max(axis=2) < 1.0
    special = rows["special_branch"] > 0
    step = rows["special_step"]
    return {
        "points come branch after branch": (
            (np.diff(branch, axis=1) < 0) & (branch[:, 1:] > 0)
        ).any(axis=1),
        "values lie in the span": (held & ~_inside(value, study.span)).any(axis=1),
        "stable is that of the multipliers": (held & (steady != (rows["stable"] > 0))).any(axis=1),
        "special points are at steps": (special & (step >= branch.shape[1])).any(axis=1),
    }


def _of_curves(study: BranchGrid, rows: Rows) -> Broken:
    ids, step = rows["curve_id"], rows["curve_of_step"]
    n_curves = rows["n_curves"][:, None]
    inside = _inside(rows["curve_amplitude"], study.span)
    inside &= _inside(rows["curve_omega"], study.curve_span)
    return {
        "curves are numbered from 1": misnumbered(ids),
        "n_curves counts them": (ids > 0).sum(axis=1) != rows["n_curves"],
        "points of curves lie in the spans": ((step > 0) & ~inside).any(axis=1),
        "points, meetings and special points are on curves of the line": (
            (step > n_curves).any(axis=1)
            | (rows["meeting_curve"] > n_curves).any(axis=1)
            | (rows["special_curve"] > n_curves).any(axis=1)
        ),
    }


def _of_seeds(rows: Rows) -> Broken:
    held, branch = rows["seed_period"] > 0, rows["seed_branch"]
    return {
        "each seed lies on a branch, or is told why not": (
            held & ((branch > 0) == (rows["seed_reason"] > 0))
        ).any(axis=1),
        "seeds lie on branches of the line": (branch > rows["n_branches"][:, None]).any(axis=1),
        "n_covered counts those on a branch": (branch > 0).sum(axis=1) != rows["n_covered"],
        "seeds are counted": (rows["n_seeds"] < held.sum(axis=1)),
    }


def _inside(values: np.ndarray, span: tuple[float, float]) -> np.ndarray:
    low, high = span
    slack = ROUNDING * (high - low)
    with np.errstate(invalid="ignore"):
        return (values >= low - slack) & (values <= high + slack)
