"""Tables of a step with one contact in its layer: responses to the state and to the force.

For the linear motion exp(M s) of a contact set, the unit impulse e of the contact, and a step h,
with the Gauss nodes c_j of `solitary_rule` and their Lagrange polynomials l_k on [0, 1]::

    linear:    the distance at the nodes, d exp(M c_j h) x
    response:  its change by a unit force at node k, int_0^(c_j h) d exp(M (c_j h - s)) e l_k ds
    step:      the state at the end, exp(M h) x
    kick:      its change by a unit force at node k, w_k h exp(M (1 - c_k) h) e

exp(M s) is that of `flow.tables`, of degree 15 in s, so that the Gauss rule of as many nodes on
[0, c_j h] integrates the response exactly. The steps are h 2^(-l / 2), h the step of the table of c
and l = 0, 1, .., so that each table serves often.
"""

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.compile.entry_points import BYTES, INT, entry_point
from hpcsweep.kernels.simd.vectors import LANES, combine, load, store
from hpcsweep.solvers.flow.linear.polynomials import evaluate
from hpcsweep.solvers.flow.rules.solitary_rule import LAGRANGE, N_NODES, NODES, WEIGHTS
from hpcsweep.solvers.flow.state.responses import forget
from hpcsweep.solvers.flow.state.shared import read_shared
from hpcsweep.solvers.flow.state.tables import N_COEFFICIENTS, ZERO


@inlined
def response_table(index, contact, level, packed, responses):
    """Return the table of such a step, without a call where it exists."""
    place = responses.place[index, contact, level]
    return place if place >= 0 else build_response(index, contact, level, packed)


@kernel
def impulse_row(poly, row, contact, model, out):
    """Write row `row` of exp(M s) e of a contact, coefficients in sigma, into `out`."""
    n, n_rows = model.modal_transform.shape[0], model.stiffness.shape[0]
    for p in range(N_COEFFICIENTS):
        out[p] = 0.0
        for i in range(n):
            out[p] += poly[row, n_rows + i, p] * model.contacts.kick[contact, i]


@entry_point(INT, INT, INT, INT, BYTES)
def build_response(index, contact, level, packed):
    """Build the table of a step; return its index.

    Parameters
    ----------
    index : int
        Index of the table of the contact set.
    contact : int
    level : int
        The step is that of the table over 2^(level / 2).
    packed : ndarray of bytes
        A packed `Shared`.
    """
    shared = read_shared(packed)
    model, responses = shared.model, shared.responses
    if responses.count[0] == responses.step.shape[0]:
        forget(responses)
    place = responses.count[0]
    responses.count[0] = place + 1
    poly = shared.tables.poly[index]
    contacts = model.contacts
    row, sign = contacts.row[contact], contacts.sign[contact]
    span = 2.0 * 2.0 ** (-0.5 * level)
    h = 0.5 * span * shared.tables.h[index]
    n_rows = poly.shape[0]
    linear, response = responses.linear[place], responses.response[place]
    step, kick = responses.step[place], responses.kick[place]
    impulse, values, column = responses.impulse, responses.values, responses.column
    for x in range(poly.shape[1]):
        for block in range(0, N_NODES, LANES):
            sigma = load(NODES, block) * span - 1.0
            store(linear, x * N_NODES + block, evaluate(poly[row, x], sigma) * sign)
        for i in range(n_rows):
            step[x, i] = evaluate(poly[i, x], span - 1.0)
    for i in range(n_rows):
        impulse_row(poly, i, contact, model, impulse)
        for block in range(0, N_NODES, LANES):
            later = evaluate(impulse, (1.0 - load(NODES, block)) * span - 1.0)
            store(values, block, later * load(WEIGHTS, block) * h)
        for k in range(N_NODES):
            kick[k, i] = values[k]
    impulse_row(poly, row, contact, model, impulse)
    for j in range(N_NODES):
        part = NODES[j]
        for block in range(0, N_NODES, LANES):
            later = evaluate(impulse, (1.0 - load(NODES, block)) * (span * part) - 1.0)
            store(values, block, later * load(WEIGHTS, block) * (sign * h * part))
        for block in range(0, N_NODES, LANES):
            at = j * N_NODES * N_NODES + block
            combine(column, block, ZERO, 0, 1.0, LAGRANGE, at, N_NODES, values, 0, N_NODES)
        for k in range(N_NODES):
            response[k, j] = column[k]
    responses.place[index, contact, level] = place
    return place
