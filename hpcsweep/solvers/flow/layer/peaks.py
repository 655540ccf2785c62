"""Peaks of drifts, floors and contacts over a step inside a layer, from its stages."""

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.simd.vectors import LANES, load
from hpcsweep.model.kernel_model import CONTACT
from hpcsweep.solvers.flow.layer.bounds import beyond, keeps_sign, range_of
from hpcsweep.solvers.flow.layer.interpolant import highest_near, interpolate
from hpcsweep.solvers.flow.layer.observation import ends_of, highest_of
from hpcsweep.solvers.flow.observe.peaks import DISPLACEMENT_KINDS, rows_of_kind
from hpcsweep.solvers.flow.rules.tableau import N_STAGES, NODES
from hpcsweep.solvers.flow.state.segment import time_of

NEAR_PEAK = 1e-6
"""Relative distance below the peak so far within which a maximum is evaluated exactly."""


@inlined
def displacements_in_layer(tau, h, z0, z1, wanted, only_look, shared):
    """Raise the requested peaks of displacements over one step from state z0 to state z1.

    With `only_look` they are raised to the ends at most; return then whether one may be higher
    between them.
    """
    model, tally, work = shared.model, shared.tally, shared.work
    ways, time = work.ways, time_of(tau, model)
    n = model.stiffness.shape[0]
    for kind in range(DISPLACEMENT_KINDS):
        flag, first, count = rows_of_kind(kind, shared)
        if wanted & flag == 0:
            continue
        for k in range(count):
            p = first + k
            gap = model.contacts.gap[k] if flag == CONTACT else 0.0
            i, below, side, _ = model.watched[p]
            value, way = z0[i], ways[i]
            if below >= 0:
                value, way = value - z0[below], way + ways[below]
            for sign in (1.0, -1.0):
                if side * sign < 0.0 or not sign * value + way - gap > tally.peaks[p]:
                    continue
                start, end = ends_of(i, below, sign, z0, z1, n, work)
                inner, speeds = load(work.layer.u, i * LANES), load(work.layer.v, i * LANES)
                if below >= 0:
                    inner = inner - load(work.layer.u, below * LANES)
                    speeds = speeds - load(work.layer.v, below * LANES)
                bottom, top = range_of(inner * sign, start[0], end[0])
                if not beyond(bottom, top) - gap > tally.peaks[p]:
                    continue
                slowest, fastest = range_of(speeds * sign, start[1], end[1])
                if keeps_sign(slowest, fastest):
                    top = max(start[0], end[0]) - gap
                    if top > tally.peaks[p]:
                        tally.peaks[p] = top
                        tally.times[p] = time + (h if end[0] > start[0] else 0.0)
                    continue
                if only_look:
                    return True
                peak, s = highest_of(h, i, below, sign, z0, z1, n, work)
                if s < 0.0:
                    s = _place_of(peak, start, end, work)
                elif peak - gap > (1.0 - NEAR_PEAK) * tally.peaks[p]:
                    interpolate(h, start, end, work)
                    peak = highest_near(s, peak, work)
                if peak - gap > tally.peaks[p]:
                    tally.peaks[p], tally.times[p] = peak - gap, time + s * h
    return False


@kernel
def _place_of(peak, start, end, work):
    """Return at which part of a step an end or a stage has the largest value, `highest_of`."""
    if start[0] == peak:
        return 0.0
    for k in range(N_STAGES):
        if work.stage_u[k] == peak:
            return NODES[k]
    return 1.0
