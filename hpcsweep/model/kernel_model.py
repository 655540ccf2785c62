"""What the kernels know of a structure and its forcing, as one value."""

from typing import NamedTuple

import numpy as np

from hpcsweep.model.structure import Structure


class Model(NamedTuple):
    """A structure at one forcing frequency (units: `hpcsweep.model.structure`)."""

    stiffness: np.ndarray
    """(n, n): K."""
    damping: np.ndarray
    """(n, n): 2 gamma C."""
    modal_transform: np.ndarray
    """(n, n): Phi^-1, row j gives modal coordinate j."""
    stiffness_bound: float
    """Of the norm of K."""
    bandwidth: int
    """K_ij = 0 where |i - j| is greater."""
    beta: float
    rho: float
    omega: float
    layer: float
    """Half-width of the contact layer: |x| beyond it is linear; 0 if rho is infinite."""


def kernel_model(structure: Structure, omega: float) -> Model:
    """Make what the kernels know of a structure at forcing frequency Omega."""
    # writable copies, of one order: all structures share the compiled kernels
    return Model(
        stiffness=np.array(structure.stiffness_matrix, order="C"),
        damping=np.array(structure.damping_matrix, order="C"),
        modal_transform=np.array(structure.modal_transform, order="C"),
        stiffness_bound=float(structure.stiffness_bound),
        bandwidth=int(structure.bandwidth),
        beta=float(structure.stiffness_ratio),
        rho=float(structure.sharpness),
        omega=float(omega),
        layer=float(structure.layer_half_width),
    )
