"""Linear forces at all stages of a collocation step: products of banded matrices."""

from hpcsweep.kernels.compile import inlined
from hpcsweep.kernels.simd.vectors import fma, load, store
from hpcsweep.solvers.flow.rules.tableau import N_STAGES


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


@inlined
def less_linear_of_four(i, u, v, model, out):
    """Subtract like `less_linear` from the rows i to i + 3 of `out`.

    Each sum waits for its terms one by one; four sums wait together.
    """
    row = i * N_STAGES
    forces = (
        load(out, row),
        load(out, row + N_STAGES),
        load(out, row + 2 * N_STAGES),
        load(out, row + 3 * N_STAGES),
    )
    forces = _less_products_of_four(forces, i, model.stiffness, model.bandwidth, u)
    forces = _less_products_of_four(forces, i, model.damping, model.damping_bandwidth, v)
    store(out, row, forces[0])
    store(out, row + N_STAGES, forces[1])
    store(out, row + 2 * N_STAGES, forces[2])
    store(out, row + 3 * N_STAGES, forces[3])


@inlined
def _less_products_of_four(forces, i, matrix, bandwidth, values):
    """Subtract the products of the rows i to i + 3 of a matrix with values from four Lanes."""
    first, second, third, fourth = forces
    for k in range(max(i - bandwidth, 0), min(i + bandwidth + 4, values.shape[0])):
        x = load(values, k * N_STAGES)
        first = fma(-matrix[i, k], x, first)
        second = fma(-matrix[i + 1, k], x, second)
        third = fma(-matrix[i + 2, k], x, third)
        fourth = fma(-matrix[i + 3, k], x, fourth)
    return first, second, third, fourth
