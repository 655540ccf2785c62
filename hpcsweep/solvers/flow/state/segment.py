"""A segment of linear motion and its ending; see `period`."""

from typing import NamedTuple

import numpy as np

from hpcsweep.kernels.compile import inlined
from hpcsweep.kernels.compile.entry_points import type_of


class Segment(NamedTuple):
    """A step of the linear motion of one contact set."""

    key: np.uint64
    """Contact set."""
    index: int
    """Of its table."""
    h: float
    """Length of a full step."""
    tau: float
    """Start."""
    end: float
    """End of the period."""


class Stretch(NamedTuple):
    """A part of a forcing period or of a sample interval of a record."""

    tau: float
    """Start."""
    end: float


class Ending(NamedTuple):
    """Ending of a segment."""

    span: float
    """Its length."""
    contact: int
    """The contact at its end, -1 if there is none."""
    how: int
    """How it passes its stop (`passage`). Unless the passage is integrated the state after it is in
    z, that before it in ``work.z_end``, the forcing is in ``work.forcing``."""
    beyond: bool
    """Whether the stop is reached after this step: try again from the edge of the layer."""
    rounded: bool
    """Whether it is passing a stop without layer, already past it by rounding: the contact set
    changes, the state does not. Testing distances again would also change all contacts with stops
    at the same place."""
    jerk: float
    """At the stop, see `pass_layer`."""
    promised: np.uint64


SEGMENT = type_of(Segment(np.uint64(0), 0, 0.0, 0.0, 0.0))


@inlined
def time_of(tau, model):
    """Return the time at tau of a sample interval of a record; tau of a forcing period."""
    return model.ramp[0, 2] + tau if model.ramp.shape[0] > 0 else tau
