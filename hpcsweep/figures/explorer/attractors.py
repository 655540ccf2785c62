"""Show a study of attractors in the explorer, with attractors in place of directions."""

from dataclasses import replace

import numpy as np

from hpcsweep.dynamics.classify import MOTION, MotionClass
from hpcsweep.figures.attractors import DIMENSION, attractor_classes

VALUES = ("share", "number")
"""Values that only attractors have."""


def as_runs(frame, by_share: bool = False):
    """Return the attractors of a frame, slot by slot, as the runs of directions.

    Parameters
    ----------
    frame : xarray.Dataset
        One frame of a study of attractors.
    by_share : bool
        Whether slots are by falling share, so that an attractor keeps none.

    Returns
    -------
    xarray.Dataset
        Dimensions (direction, frame, along, ...): a direction is a slot, which an attractor keeps
        along the path. Where a slot has no attractor the motion is not computed.
    """
    runs = frame.isel(direction=0, drop=True).rename({DIMENSION: "direction"})
    fixed, along = runs["outcome"].dims
    order = runs["attractor_id"].isel({fixed: 0}).transpose(along, "direction").values
    order = np.argsort(order == 0, axis=1, kind="stable") if by_share else slots(order)
    each = (along, np.arange(len(order)))
    runs = runs.isel({"direction": ((along, "direction"), order), along: each})
    held = runs["attractor_id"] > 0
    for name in ("outcome", "cycles"):
        runs[name] = runs[name].where(held, runs[name].dtype.type(0))
    runs["number"] = runs["n_attractors"].where(held)
    runs["share"] = runs["share"].where(held)
    runs[MOTION] = runs["attractor_id"].dims, attractor_classes(runs)
    return runs.transpose("direction", fixed, along, ...)


def slots(identity: np.ndarray) -> np.ndarray:
    """Return which attractor each slot has at each amplitude: the one that it had before.

    A new one takes a slot that no other had at the amplitude before, if there is one.

    Parameters
    ----------
    identity : ndarray of int, shape (n_amplitudes, K)
        Identity of each attractor along the amplitudes, 0 for none.

    Returns
    -------
    ndarray of int, shape (n_amplitudes, K)
        Indices of attractors, and of empty places, a permutation at each amplitude.
    """
    order = np.empty_like(identity)
    before = np.zeros(identity.shape[1], identity.dtype)
    for taken, row in zip(order, identity, strict=True):
        places = {number: place for place, number in enumerate(row.tolist()) if number}
        taken[:] = [places.get(number, -1) for number in before.tolist()]
        new = [place for place in np.flatnonzero(row) if place not in taken]
        free = sorted(np.flatnonzero(taken < 0), key=lambda slot: before[slot] != 0)
        taken[free] = [*new, *np.setdiff1d(np.arange(row.size), [*taken, *new])]
        before = row[taken]
    return order


def as_study(study, by_share: bool = False):
    """Name the slots of a gathered study, and drop empty ones.

    Parameters
    ----------
    study : hpcsweep.figures.explorer.page_data.PageData
    by_share : bool
        See `as_runs`.
    """
    used = np.flatnonzero((study.runs["motion"] != MotionClass.NOT_COMPUTED).any(axis=(0, 2)))
    n = int(used.max(initial=0)) + 1
    return replace(
        study,
        directions=tuple(str(k + 1) for k in range(n)),
        words=tuple(f"attractor {k + 1}{' by share' * by_share}" for k in range(n)),
        runs={name: numbers[:, :n] for name, numbers in study.runs.items()},
        thinned={**study.thinned, "of_points": study.thinned["points"]},
        each=DIMENSION,
    )
