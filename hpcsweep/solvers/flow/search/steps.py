"""Linear steps: one, or as many in a row as no contact is in the way of."""

from hpcsweep.kernels.compile import inlined
from hpcsweep.solvers.flow.linear.forcing import turn_forcing
from hpcsweep.solvers.flow.linear.polynomials import evaluate_rows, expand_rows
from hpcsweep.solvers.flow.search.events import is_clear
from hpcsweep.solvers.flow.state.tables import product, product_of_moduli


@inlined
def coast(segment, steps_left, model, tables, work):
    """Take linear steps while no contact can reach the edge of its layer (proved) and time remains.

    Returns
    -------
    tau : float
    n_steps : int
        ``work.x`` holds the augmented state there.
    known : bool
        Whether ``work.wide`` and ``work.bounds`` are those of a step from there.
    """
    key, index, h, tau, end = segment
    x, wide, bounds = work.x, work.wide, work.bounds
    places = model.contacts.places
    n_steps = 0
    while tau + h < end and n_steps < steps_left:
        product(tables.step, index, x, wide)
        product_of_moduli(tables.bound4, index, x, bounds)
        for k in range(places.shape[0]):
            if not is_clear(key, k, h, x, wide, model, bounds[places[k, 0]]):
                return tau, n_steps, True
        for row in range(work.z_end.shape[0]):
            x[row] = wide[row]
        turn_forcing(x, work.z_end.shape[0], tables, index)
        tau += h
        n_steps += 1
    return tau, n_steps, False


@inlined
def take_step(segment, known, tables, work):
    """Take one linear step from ``work.x`` to ``work.z_end``, at most to the end of the period.

    Returns
    -------
    float
        Length of the step.
    """
    index, x = segment.index, work.x
    for row in range(work.z_end.shape[0]):
        work.expanded[row] = False
    span = segment.h
    if segment.tau + segment.h < segment.end:
        if not known:
            product(tables.step, index, x, work.wide)
        for row in range(work.z_end.shape[0]):
            work.z_end[row] = work.wide[row]
    else:
        span = segment.end - segment.tau
        expand_rows(tables.poly, index, x, work.rows, work.expanded, work.z_end.shape[0])
        evaluate_rows(work.rows, segment.h, span, work.z_end)
    if not known:
        product_of_moduli(tables.bound4, index, x, work.bounds)
    return span
