r"""Sliders in the equations of a step inside a layer, where the set of those that slip is constant.

Of a slider j the matrices of a model have the spring, k_j b_j b_j^T, as if it stuck. In any mode
its force is -k_j (y - q) while it sticks and k_j q while it slips (`hpcsweep.model.elements`), so
that, M^-1 b_j over b_j . M^-1 b_j being r_j and s_j what its elongation feels of k_j,

    u'' = G(tau, u, u') + sum_j s_j (q_j + m_j y_j) r_j,        y_j = b_j . u,

G that of the contacts and m_j = 1 where it slips, else 0. q_j is constant between changes: p while
it sticks, -+delta while it slips. So the equation is as smooth as without sliders, its linear part
is that of the set, and no error of a step comes from them.
"""

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.simd.vectors import fma, load, store
from hpcsweep.solvers.flow.rules.tableau import N_STAGES


@inlined
def write_sliders(modes, elements, stage):
    """Write s_j q_j and s_j m_j of the present modes into the workspace of a layer."""
    n_sliders = elements.stiffness.shape[0]
    first = modes.mode.shape[0] - n_sliders
    for j in range(n_sliders):
        mode, stiff = modes.mode[first + j], elements.stiffness[j]
        share = elements.load[mode, 0] + elements.load[mode, 1] * modes.state[first + j]
        stage.pushed[j] = stiff * share
        stage.taken[j] = stiff if elements.sets[mode, 1] else 0.0


@kernel
def add_sliders(z, elements, stage, out):
    """Add the accelerations by the sliders in a state z to `out`, shape (R,)."""
    first = elements.rows.shape[0] - elements.stiffness.shape[0]
    for j in range(elements.stiffness.shape[0]):
        i, below = elements.rows[first + j]
        y = z[i] - z[below] if below >= 0 else z[i]
        force = fma(stage.taken[j], y, stage.pushed[j])
        for row in range(out.shape[0]):
            out[row] += force * elements.kick[j, row]


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
