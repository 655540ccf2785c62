"""The curves of a study of branches: its keys, and what a line adds to them.

The special points of the branches along A lie, over the frequency too, on curves. Each line follows
those through its own special points, of orbits up to `max_orbit_period`, within its *strip*, which
reaches half way to the next line on either side and, at the ends, to `curve_span`. So the strips
cover the plane without overlap, and a line stays a task that depends on no other. A curve is found
in each strip in which it crosses the line.
"""

from typing import TYPE_CHECKING

import numpy as np

from hpcsweep.dynamics.continuation.branch import Limits
from hpcsweep.dynamics.continuation.catalogue import Catalogue
from hpcsweep.dynamics.continuation.events import n_unstable
from hpcsweep.dynamics.continuation.forced import ForcedMap
from hpcsweep.dynamics.continuation.plane import KINDS, Plane, curves_through
from hpcsweep.studies.blocks import Poll, Rows
from hpcsweep.studies.branches.keys import pair_of
from hpcsweep.studies.branches.variables import End, Met

if TYPE_CHECKING:
    from hpcsweep.studies.branches.branches import Branches

PLANE = ("amplitude", "omega")


def read_curves(values, parameter: str, omega: np.ndarray) -> dict:
    """Read which curves are followed, and over which frequencies."""
    given = values.choices("branches.curves", values.get("branches.curves", []), KINDS)
    if given and parameter != "amplitude":
        limit = 'must be "amplitude" where branches.curves are followed'
        raise values.error("branches.parameter", parameter, limit)
    whole = [float(omega.min()), float(omega.max())]
    span, low, high = pair_of(values, "branches.curve_span", whole)
    values.check_range("branches.curve_span", omega=(low, high))
    if given and not (low < high and low <= omega.min() and omega.max() <= high):
        raise values.error("branches.curve_span", span, "must be two ends that hold sweep.omega")
    kinds = tuple(name for name in KINDS if name in given)
    return {"curves": kinds, "curve_span": (low, high) if kinds else None}


def strip(study: "Branches", line: int) -> tuple[float, float]:
    """Return the lowest and highest frequency of the strip of a line."""
    assert study.curve_span is not None
    own, (low, high) = float(study.omega[line]), study.curve_span
    below, above = study.omega[study.omega < own], study.omega[study.omega > own]
    return (
        0.5 * (own + float(below.max())) if below.size else low,
        0.5 * (own + float(above.min())) if above.size else high,
    )


def store_curves(rows: Rows, study: "Branches", line: int, catalogue: Catalogue, poll: Poll) -> int:
    """Follow and store the curves of a line; return the forcing periods that it took."""
    assert study.curve_span is not None
    omega = float(study.omega[line])
    pair = ForcedMap(
        *(study.structure, float(study.amplitude[line]), omega, PLANE, study.settings.rtol, poll)
    )
    scale = np.array([high - low for low, high in (study.span, study.curve_span)])
    plane = Plane(pair, omega, (study.span, strip(study, line)), scale)
    curves, on = curves_through(
        catalogue,
        plane,
        [KINDS[name] for name in study.curves],
        study.settings.max_orbit_period,
        Limits(-np.inf, np.inf, study.steps, study.largest_step),
        rows["curve_id"].shape[1],
        rows["curve_of_step"].shape[1],
    )
    places = (
        (number, k)
        for number, branch in enumerate(catalogue.branches)
        for k in range(len(branch.arc.specials))
    )
    for at, place in zip(range(rows["special_curve"].shape[1]), places, strict=False):
        rows["special_curve"][0, at] = on.get(place, -1) + 1
    rows["n_curves"][0] = len(curves)
    at = met = 0
    for number, arc in enumerate(curves, 1):
        own = arc.curve
        rows["curve_id"][0, number - 1] = number
        rows["curve_kind"][0, number - 1] = own.kind
        rows["curve_period"][0, number - 1] = own.period
        for name, why in zip(("curve_begins", "curve_ends"), arc.ends, strict=True):
            rows[name][0, number - 1] = End[why.split(" 1:")[0].upper().replace(" ", "_")]
        for one in arc.points:
            points, value = own.split(one.y)
            rows["curve_of_step"][0, at] = number
            rows["curve_amplitude"][0, at], rows["curve_omega"][0, at] = value
            rows["curve_point"][0, at] = points[0] * pair.units
            rows["curve_unstable"][0, at] = n_unstable(one.multipliers)
            at += 1
        for _, special in arc.specials[: rows["meeting_curve"].shape[1] - met]:
            rows["meeting_curve"][0, met] = number
            rows["meeting_kind"][0, met] = Met[special.kind.name]
            value = own.split(special.at.y)[1]
            rows["meeting_amplitude"][0, met], rows["meeting_omega"][0, met] = value
            met += 1
    return pair.periods
