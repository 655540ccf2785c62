r"""Steps inside a layer: their limits, Gauss collocation of order 16, its error.

Limits, whatever the scheme
---------------------------

The sigmoid has poles at y = rho x = +-i pi (2 m + 1). A Gauss rule of N nodes on a step from 0 to L
converges as kappa^(-2 N), kappa the parameter of the Bernstein ellipse about the step on which the
nearest pole p lies: |p| + |p - L| = E L / 2 with E = kappa + 1 / kappa. Hence::

    L = (E |p| - 2 Re p) / (E^2 / 4 - 1).

In y, counted from where the step starts, p = -y + i pi; in time see `volterra.plan`.

Motion while a contact is inside its layer: Gauss collocation of order 16
-------------------------------------------------------------------------
The whole smooth equation (19) is integrated, with any number of contacts in their layers. On a
step of length h the accelerations G_j at the `N_STAGES` Gauss nodes c_j satisfy

    V_j = v_0 + h sum_k A_jk G_k,      U_j = u_0 + h c_j v_0 + h^2 sum_k (A^2)_jk G_k,
    G_j = G(tau + c_j h, U_j, V_j)

(implicit Runge-Kutta of Gauss type, order 2 N_STAGES; Hairer, Norsett and Wanner, Solving
Ordinary Differential Equations I, II.7), solved by fixed-point iteration from the
accelerations at the start.

The error of a collocation step (`scheme`)
------------------------------------------
The error of the velocity is the error of the Gauss rule along the collocation polynomial, and that
is measured by a rule of 17 points, exact to degree 16, which adds to the Gauss nodes the nodes of
Kronrod (Laurie, Math. Comp. 66 (1997) 1133) with the start of the step in place of the first. The
same difference with the weight 2 s - 1 detects residuals whose mean vanishes.

Sliders in the equations of a step inside a layer, where the set of those that slip is constant.

Of a slider j the matrices of a model have the spring, k_j b_j b_j^T, as if it stuck. In any mode
its force is -k_j (y - q) while it sticks and k_j q while it slips (`hpcsweep.model.elements`), so
that, M^-1 b_j over b_j . M^-1 b_j being r_j and s_j what its elongation feels of k_j,

    u'' = G(tau, u, u') + sum_j s_j (q_j + m_j y_j) r_j,        y_j = b_j . u,

G that of the contacts and m_j = 1 where it slips, else 0. q_j is constant between changes: p while
it sticks, -+delta while it slips. So the equation is as smooth as without sliders, its linear part
is that of the set, and no error of a step comes from them.
"""

import math

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.simd.vectors import (
    LANES,
    fma,
    greatest,
    load,
    local_matrix,
    maximum,
    modulus,
    store,
    total,
)
from hpcsweep.model.contact import (
    FAR,
    MAX_STIFFNESS,
    STIFFEST,
    contact_force,
    contact_forces,
    contact_stiffness,
    less_contact_forces,
)
from hpcsweep.solvers.flow.rules.tableau import (
    ADDED_SLOPE,
    CHECK_ADDED,
    CHECK_GAUSS,
    CHECK_NODES,
    CHECK_ROWS,
    CHECK_START,
    GAUSS_SLOPE,
    N_STAGES,
    NODES,
    POSITION_ROWS,
    POSITION_WEIGHTS,
    SPEED_ROWS,
    WEIGHTS,
)
from hpcsweep.solvers.flow.state.state import approach_speed, distance
from hpcsweep.solvers.flow.step.forcing import SHORT_ANGLE, short_turn


@inlined
def reach(size, ahead, ellipse):
    """Return the length of the step on whose ellipse a pole lies; see the module.

    Parameters
    ----------
    size, ahead : float
        Distance of the pole from the start of the step, and its component along the step.
    ellipse : float
        E
    """
    return (ellipse * size - 2.0 * ahead) / (0.25 * ellipse**2 - 1.0)


@kernel
def stiffness_up_to(x, beta, rho):
    """Return the largest stiffness of a contact up to a distance x past its stop.

    The stiffness of a contact that is switched on is negative at first.
    """
    if rho * x >= STIFFEST:
        return MAX_STIFFNESS * beta
    return contact_stiffness(x, beta, rho) if rho * x > -FAR else 0.0


@kernel
def allowed_error(z, tolerance):
    """Return the allowed error of a step that ends in state z."""
    size = 1.0
    for value in z:
        size = max(size, abs(value))
    return tolerance * size


@inlined
def less_linear(force, i, u, v, model):
    """Subtract the linear forces on floor i at all stages from `force` (Lanes)."""
    force = _less_products(force, i, model.stiffness, model.bandwidth, u)
    return _less_products(force, i, model.damping, model.damping_bandwidth, v)


@inlined
def _less_products(force, i, matrix, bandwidth, values):
    """Subtract the product of row i of a matrix with values from `force`."""
    for k in range(max(i - bandwidth, 0), min(i + bandwidth + 1, values.shape[0])):
        force = fma(-matrix[i, k], load(values, k * N_STAGES), force)
    return force


MAX_ITERATIONS = 40
UNCHECKED = 1e-9
"""Relative error below which the iteration is checked."""
CONVERGED = 2e-15
"""Remaining relative error of the iteration, of the accelerations or of the velocity over h."""


@inlined
def _stage_accelerations(stage, model, out):
    """Evaluate G at all stages of a `LayerWorkspace` into `out`, shape (R, N_STAGES)."""
    contacts, u, v, ground, active = model.contacts, stage.u, stage.v, stage.ground, stage.active
    for i in range(u.shape[0]):
        force = less_linear(load(ground, 0) * model.forcing[i], i, u, v, model)
        k = contacts.solo[i]
        if k >= 0 and active[k] > 0:
            x = distances(k, u, contacts)
            stiff = contacts.beta[k] * contacts.sign[k]
            if active[k] == 1:
                force = fma(x, -stiff, force)
            else:
                force = less_contact_forces(force, x, stiff, model.rho)
        store(out, i * N_STAGES, force)
    for other in range(contacts.others.shape[0]):
        k = contacts.others[other]
        if active[k] == 0:
            continue
        x = distances(k, u, contacts)
        for p in range(contacts.first[k], contacts.first[k + 1]):
            row = contacts.push_row[p] * N_STAGES
            stiff = contacts.beta[k] * contacts.push[p]
            if active[k] == 1:
                force = fma(x, -stiff, load(out, row))
            else:
                force = less_contact_forces(load(out, row), x, stiff, model.rho)
            store(out, row, force)
    add_sliders_at_stages(model.elements, stage, out)


@inlined
def accelerations_at_stages(tau, h, z, amplitude, pairs, model, work):
    """Evaluate G at stages whose displacements and velocities are in ``work.step.layer``.

    Parameters
    ----------
    tau, h, z, amplitude, pairs, model
        As in `collocate`.
    work : Workspace
    """
    stage = work.step.layer
    _forcing_at_stages(tau, h, amplitude, pairs, model, stage.ground)
    _find_active(h, z, work.step.a, model, stage.active)
    _stage_accelerations(stage, model, stage.g)


@inlined
def distances(k, u, contacts):
    """Return the distance of contact k past its stop at all stages."""
    return fma(load(u, contacts.row[k] * N_STAGES), contacts.sign[k], -contacts.gap[k])


@inlined
def _forcing_at_stages(tau, h, amplitude, pairs, model, out):
    """Write G at the stages into `out`, on short steps by the addition theorem."""
    for k in range(model.harmonics.shape[0]):
        rate = model.harmonics[k, 0] * model.omega
        angle = rate * h
        if angle > SHORT_ANGLE:
            size, phase = amplitude * model.harmonics[k, 1], model.harmonics[k, 2]
            for j in range(N_STAGES):
                value = size * math.sin(rate * (tau + NODES[j] * h) + phase)
                out[j] = value if k == 0 else out[j] + value
            continue
        s, c = short_turn(load(NODES, 0) * angle)
        values = fma(s, pairs[2 * k + 1], c * pairs[2 * k])
        store(out, 0, values if k == 0 else load(out, 0) + values)
    for k in range(model.ramp.shape[0]):
        at = 2 * (model.harmonics.shape[0] + k)
        values = fma(load(NODES, 0), h * pairs[at + 1], pairs[at])
        store(out, 0, values if at == 0 else load(out, 0) + values)


@inlined
def _find_active(h, z, a, model, active):
    """Return for each contact whether its sigmoid is 0, 1 or neither within twice its path."""
    contacts = model.contacts
    for k in range(contacts.row.shape[0]):
        x, v = distance(k, z, contacts), approach_speed(k, z, contacts)
        way = 2.0 * h * (abs(v) + abs(a[contacts.row[k]]) * h)
        if model.rho * (abs(x) - way) > FAR:
            active[k] = 1 if x > 0.0 else 0
        else:
            active[k] = 2


@kernel
def iterations_needed(square):
    """Return the number of iterations that reduce the error to `UNCHECKED` of the first.

    The error is integrated twice an iteration: after k it is at most square^k / (2 k)! of the
    first, `square` = h^2 |dG/du|.

    Returns
    -------
    n_iterations : int
    ratio : float
        Factor by which the next iteration reduces the error.
    """
    error = 1.0
    k = 0
    while error > UNCHECKED and k < MAX_ITERATIONS:
        k += 1
        error *= square / (2 * k * (2 * k - 1))
    return k, square / ((2 * k + 2) * (2 * k + 1))


@inlined
def weighted(rows, g, i):
    """Sum the rows with the factors g[i], even and odd ones separately, which is twice as fast."""
    even, odd = load(rows, 0) * g[i, 0], load(rows, N_STAGES) * g[i, 1]
    for k in range(2, N_STAGES, 2):
        even = fma(load(rows, k * N_STAGES), g[i, k], even)
        odd = fma(load(rows, (k + 1) * N_STAGES), g[i, k + 1], odd)
    return even + odd


@inlined
def stages(h, free, speeds, g, u, v):
    """Write displacements and velocities at the stages from the accelerations g."""
    for i in range(u.shape[0]):
        row = i * N_STAGES
        store(u, row, fma(weighted(POSITION_ROWS, g, i), h * h, load(free, row)))
        store(v, row, fma(weighted(SPEED_ROWS, g, i), h, load(speeds, row)))


@inlined
def replace(g, fresh):
    """Write `fresh` into g; return the largest change and the largest entry, NaN if one is."""
    change = load(fresh, 0) * 0.0
    size = change
    for at in range(0, g.size, LANES):
        new = load(fresh, at)
        change = greatest(change, modulus(new - load(g, at)))
        size = greatest(size, modulus(new))
        store(g, at, new)
    return maximum(change), maximum(size)


@inlined
def collocate(step, z, a, amplitude, pairs, stiffness, model, work):
    """Solve the collocation equations of one step.

    Parameters
    ----------
    step : Segment
        Its start `tau`, and its length.
    z : ndarray, shape (2R,)
        State at `tau`; not changed.
    a : ndarray, shape (n,)
        Accelerations at `tau`, the first guess.
    amplitude : float
        A.
    pairs : ndarray
        The forcing at `tau`, see `forcing`.
    stiffness : float
        Largest |dG/du| expected.
    work : LayerWorkspace
        Receives the stages.

    Returns
    -------
    bool
        Whether the iteration converged.
    """
    tau, h = step.tau, step.h
    u, v, g, n = work.u, work.v, work.g, a.shape[0]
    fresh = local_matrix(n, N_STAGES)
    free, speeds = local_matrix(n, N_STAGES), local_matrix(n, N_STAGES)
    _forcing_at_stages(tau, h, amplitude, pairs, model, work.ground)
    _find_active(h, z, a, model, work.active)
    nodes = load(NODES, 0)
    half_squares = nodes * nodes * 0.5
    speed = 0.0
    for i in range(n):
        row = i * N_STAGES
        speed = max(speed, abs(z[n + i]))
        free_stages = fma(nodes, h * z[n + i], z[i])
        store(free, row, free_stages)
        store(speeds, row, z[n + i])
        store(u, row, fma(half_squares, h * h * a[i], free_stages))
        store(v, row, fma(nodes, h * a[i], z[n + i]))
    _stage_accelerations(work, model, g)
    unchecked, ratio = iterations_needed(h * h * stiffness)
    for _ in range(unchecked - 1):
        stages(h, free, speeds, g, u, v)
        _stage_accelerations(work, model, g)
    first = previous = math.inf
    for _ in range(MAX_ITERATIONS):
        stages(h, free, speeds, g, u, v)
        _stage_accelerations(work, model, fresh)
        change, size = replace(g, fresh)
        if not size < math.inf:
            return False
        rounding = CONVERGED * (size + speed / h)
        if previous < math.inf:
            ratio = change / previous
        # the next change is smaller by at least that ratio
        if change <= rounding or (ratio < 0.5 and change * ratio <= rounding):
            return True
        if change >= previous and change <= 100.0 * rounding:
            return True
        if change > 4.0 * previous and change > 100.0 * first and change > 1e3 * rounding:
            return False
        if first == math.inf:
            first = change
        previous = change
    return False


@inlined
def integrals(g, i):
    """Integrate row i of the accelerations g twice and once over the step, divided by h^2 and h."""
    row = load(g, i * N_STAGES)
    return total(load(POSITION_WEIGHTS, 0) * row), total(load(WEIGHTS, 0) * row)


@inlined
def finish(h, z, g, out):
    """Write the state at the end of the step into `out`, shape (2R,)."""
    n = g.shape[0]
    for i in range(n):
        du, dv = integrals(g, i)
        out[i] = fma(h, fma(h, du, z[n + i]), z[i])
        out[n + i] = fma(h, dv, z[n + i])


@inlined
def quadrature_error(h, z, model, work):
    """Estimate the velocity error of the step from z that `collocate` has left in `work`.

    See the module. Only the forces of contacts inside their layers count: all others are
    linear, and resolved far better. That of the integral of each force is left in ``missed``.
    """
    contacts, rho = model.contacts, model.rho
    worst = 0.0
    for k in range(contacts.row.shape[0]):
        if work.active[k] != 2:
            continue
        sign, beta = contacts.sign[k], contacts.beta[k]
        x0 = distance(k, z, contacts)
        start = contact_force(x0, beta * CHECK_START, rho)
        gauss = contact_forces(distances(k, work.u, contacts), beta, rho) * load(CHECK_GAUSS, 0)
        x = fma(load(CHECK_NODES, 0), h * approach_speed(k, z, contacts), x0)
        x = fma(weighted(CHECK_ROWS, work.g, contacts.row[k]), h * h * sign, x)
        added = contact_forces(x, beta, rho) * load(CHECK_ADDED, 0)
        mean = start + total(gauss + added)
        slope = total(gauss * load(GAUSS_SLOPE, 0) + added * load(ADDED_SLOPE, 0)) - start
        worst = max(worst, max(abs(mean), abs(slope)) * contacts.gain[k])
        work.missed[k] = h * abs(mean)
    return h * worst


@inlined
def write_sliders(modes, elements, slopes, stage):
    """Write s_j q_j and s_j m_j of the present modes into the workspace of a layer."""
    n_sliders = elements.stiffness.shape[0]
    first = modes.mode.shape[0] - n_sliders
    for j in range(n_sliders):
        mode, stiff = modes.mode[first + j], elements.stiffness[j]
        share = elements.load[mode, 0] + elements.load[mode, 1] * modes.state[first + j]
        stage.pushed[j] = stiff * share
        stage.taken[j] = stiff * (1.0 - slopes[j]) if elements.sets[mode, 1] else 0.0


@kernel
def add_sliders_at_stages(elements, stage, out):
    """Add the accelerations by the sliders at all stages to `out`, shape (R, N_STAGES)."""
    first = elements.rows.shape[0] - elements.stiffness.shape[0]
    for j in range(elements.stiffness.shape[0]):
        i, below = elements.rows[first + j]
        y = load(stage.u, i * N_STAGES)
        if below >= 0:
            y = y - load(stage.u, below * N_STAGES)
        force = y * stage.taken[j] + stage.pushed[j]
        for row in range(out.shape[0]):
            at = row * N_STAGES
            store(out, at, fma(force, elements.kick[j, row], load(out, at)))
