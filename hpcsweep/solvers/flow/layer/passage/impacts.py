r"""The impact of a passage in closed form: its force, time and closing speed.

A passage adds the effect of the layer to the impact on linear segments (`observe.impacts`). With r
of `crossing` the true force is that of the spring less r, along the true path, while a segment has
the motion y that is linear up to, and from, the time 0 of the passage. On the side beyond the stop
the two differ by the effect of r after (or before) that time, g(t) = t - c t^2 / 2 + (b - beta) t^3
/ 6 + ... being the displacement by a unit of impulse, c = d . D e and b = d . (D^2 - K) e, so that

    int F dt = beta int y dt - J,    J = M_0 - beta (M_2 / 2 + c M_3 / 6 + (b - beta) M_4 / 24),

M_0 = int r dt of both sides and M_k = int t^k r dt of that beyond. J is what `crossing.add_kick`
adds along e. With m_k = int s^k r ds of the arriving side alone, s from the stop, the true motion
is at the stop at the time d of the linear one, p, earlier on the way in, later on the way out,
where

    p(d) = m_1 + c m_2 / 2 + b m_3 / 6,    with the speed    p'(d) + m_0 + c m_1 + b m_2 / 2,

with beta less in b if that side is the one beyond.
"""

import numpy as np

from hpcsweep.kernels.compile import kernel
from hpcsweep.kernels.simd.vectors import total
from hpcsweep.solvers.flow.layer.passage.crossing import at_stop, half_passage, since_linear, sums
from hpcsweep.solvers.flow.observe.impacts import record
from hpcsweep.solvers.flow.state.state import contact_bit
from hpcsweep.solvers.flow.step.polynomials import value_and_slope
from hpcsweep.solvers.measures import FORCE, TIME


@kernel
def passage_at_end(segment, ending, model, tally, step):
    """Add the passage of an elastic contact through its layer at the end of a segment.

    ``step.a`` has the accelerations there without the force of the contact, ``step.z_end`` the
    state after the passage.
    """
    contacts, k = model.contacts, ending.contact
    row, sign, beta = contacts.row[k], contacts.sign[k], contacts.beta[k]
    closing = segment.key & contact_bit(k) == np.uint64(0)
    _, v = value_and_slope(step.rows, row, segment.h, ending.span)
    v *= sign
    a = sign * step.a[row]
    inner = sign * contacts.damped[k, row]
    bend = sign * contacts.bent[k, row] - beta
    stop = at_stop(v, a, sign * ending.jerk, beta, model.rho)
    free, _, _ = half_passage(-1.0, stop)
    contact, _, _ = half_passage(1.0, stop)
    m0, _, _, m2, _, m3, m4 = since_linear(sums(free, contact), stop)
    m = free if closing else contact
    arriving = bend + beta if closing else bend
    gone = total(m[1]) + 0.5 * inner * total(m[2]) + arriving * total(m[3]) / 6.0
    d = gone / v
    d = gone / (v + 0.5 * a * d)
    speed = abs(v + a * d + total(m[0]) + inner * total(m[1]) + 0.5 * arriving * total(m[2]))
    early = abs(d)
    kick = m0 - beta * (0.5 * m2 + inner * m3 / 6.0 + bend * m4 / 24.0)
    tally.impacts[FORCE, k] -= kick / beta
    tally.impacts[TIME, k] += early
    record(k, closing, speed, step.z_end, model, tally)
