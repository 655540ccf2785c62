"""The structure: n equal storeys on a fixed base beside a rigid stop.

Units, used throughout the package: lengths are measured in gaps (the distance from the floors
at rest to the stop, so that the stop is at 1), time in 1/omega_0 with omega_0 = sqrt(k/m) of
one storey. Equation numbers are those of Christopher, Dobson and Alexander, "Exploring the
Dynamics of Base-Excited Structures Impacting a Rigid Stop".
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from numbers import Real
from typing import Any

import numpy as np

from hpcsweep.model.arguments import count, plain, refused
from hpcsweep.model.arguments import number as _number
from hpcsweep.model.contact import layer_half_width

MAX_FLOORS = 64
"""Contact sets are stored as the bits of one 64-bit integer."""
MAX_OMEGA = 1e150
"""Of the closed forms, which square it."""


@dataclass(frozen=True)
class Structure:
    """Parameters of the structure and its stop, validated.

    The equation of motion is (8) with (5), (9) and (10)::

        u'' + 2 gamma C u' + K u + beta S(u) (u - 1) = -1 A sin(Omega tau)

    Parameters
    ----------
    n_floors : int
        Number of storeys n, 1 to 64.
    stiffness_ratio : float
        Contact-to-storey stiffness ratio beta >= 0 (7); 0 means no stop.
    sharpness : float
        rho >= 0 of the sigmoid contact spring (5); ``math.inf`` is the piecewise linear stop,
        0 a pre-tensioned linear spring of stiffness beta/2.
    damping_ratio : float or sequence of n floats
        Damping ratio zeta_i >= 0 of every mode of the free structure, or one per mode, lowest
        frequency first (12).

    Raises
    ------
    ValueError
        If a value is of the wrong kind or outside its range; the message names it.
    """

    n_floors: int = 3
    stiffness_ratio: float = 1000.0
    sharpness: float = 1e4
    damping_ratio: float | Sequence[float] = 0.05
    _ratios: tuple[float, ...] = field(init=False, repr=False, compare=True, default=())

    def __post_init__(self) -> None:
        object.__setattr__(self, "n_floors", count("n_floors", self.n_floors, 1, MAX_FLOORS))
        beta = _number("stiffness_ratio", self.stiffness_ratio)
        if not 0 <= beta < math.inf:
            raise ValueError(f"stiffness_ratio must be finite and at least 0, is {beta!r}")
        object.__setattr__(self, "stiffness_ratio", beta)
        rho = _number("sharpness", self.sharpness)
        if not rho >= 0:
            raise ValueError(f"sharpness must be at least 0 (inf is allowed), is {rho!r}")
        object.__setattr__(self, "sharpness", rho)
        object.__setattr__(self, "_ratios", self._validated_damping())
        if not isinstance(self.damping_ratio, Real):
            object.__setattr__(self, "damping_ratio", self._ratios)

    def _validated_damping(self) -> tuple[float, ...]:
        given: Any = plain(self.damping_ratio)
        if isinstance(given, Real):
            ratios = (_number("damping_ratio", given),) * self.n_floors
        elif isinstance(given, str | bytes) or not isinstance(given, Sequence | np.ndarray):
            raise refused("damping_ratio", "a number or one per mode", given)
        else:
            if len(given) != self.n_floors:
                raise ValueError(
                    f"damping_ratio must be one number or one per mode: {self.n_floors} are "
                    f"needed, {len(given)} are given"
                )
            ratios = tuple(_number("damping_ratio", value) for value in given)
        for value in ratios:
            if not 0 <= value < math.inf:
                raise ValueError(f"damping_ratio must be finite and at least 0, is {value!r}")
        return ratios

    @cached_property
    def damping_ratios(self) -> np.ndarray:
        """zeta_i of every mode, shape (n,)."""
        return _frozen(np.array(self._ratios))

    @cached_property
    def stiffness_matrix(self) -> np.ndarray:
        """K of (3), shape (n, n)."""
        n = self.n_floors
        matrix = 2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
        matrix[-1, -1] = 1.0
        return _frozen(matrix)

    @property
    def stiffness_bound(self) -> float:
        """Bound of the norm of K: the chain's eigenvalues are 4 sin^2(.), below 4 for every n."""
        return 4.0

    @property
    def bandwidth(self) -> int:
        """Largest |i - j| with K_ij != 0: a storey joins neighbouring floors."""
        return min(1, self.n_floors - 1)

    @property
    def layer_half_width(self) -> float:
        """Half-width of the contact layer in gaps; see `contact.layer_half_width`."""
        return layer_half_width(self.stiffness_ratio, self.sharpness)

    @cached_property
    def frequencies(self) -> np.ndarray:
        """Undamped natural frequencies of the free structure, ascending, shape (n,).

        Closed form of the fixed-free chain: omega_i = 2 sin((2i - 1) pi / (4n + 2)).
        """
        i = np.arange(1, self.n_floors + 1)
        return _frozen(2 * np.sin((2 * i - 1) * math.pi / (4 * self.n_floors + 2)))

    @cached_property
    def mode_shapes(self) -> np.ndarray:
        """Orthonormal mode shapes Phi of (11), one a column, shape (n, n).

        Closed form phi_ij ~ sin(i (2j - 1) pi / (2n + 1)); the sign makes the top floor of the
        first mode, and every mode's first floor, positive.
        """
        n = self.n_floors
        floors, modes = np.ogrid[1 : n + 1, 1 : n + 1]
        shapes = np.sin(floors * (2 * modes - 1) * math.pi / (2 * n + 1))
        return _frozen(shapes / np.linalg.norm(shapes, axis=0))

    @property
    def modal_transform(self) -> np.ndarray:
        """Phi^-1, shape (n, n): takes displacements to modal coordinates.

        Phi^T, because the floors' masses are 1 and the shapes orthonormal.
        """
        return self.mode_shapes.T

    @cached_property
    def damping_matrix(self) -> np.ndarray:
        """2 gamma C = Phi diag(2 zeta_i omega_i) Phi^T of (8), shape (n, n)."""
        phi = self.mode_shapes
        return _frozen(phi @ np.diag(2 * self.damping_ratios * self.frequencies) @ phi.T)

    def linear_steady_state(self, omega: float) -> np.ndarray:
        """Return the complex response U of the free structure at unit amplitude, shape (n,).

        The period-1 solution without contact is u(tau) = A Im(U exp(i Omega tau)), the
        particular solution g of (14).

        Raises
        ------
        ZeroDivisionError
            At an undamped resonance, where there is no steady state.
        """
        omega = _number("omega", omega, f"at most {MAX_OMEGA:g}", -MAX_OMEGA, MAX_OMEGA)
        denominator = (
            self.frequencies**2 - omega**2 + 2j * self.damping_ratios * self.frequencies * omega
        )
        if np.any(denominator == 0):
            raise ZeroDivisionError(f"undamped resonance at omega = {omega!r}: no steady state")
        phi = self.mode_shapes
        return phi @ (-phi.sum(axis=0) / denominator)

    def grazing_amplitude(self, omega: float) -> float:
        """Return the amplitude at which the linear steady state first touches the stop.

        Closed form for a stop without layer: A = 1 / max_i |U_i|, U of `linear_steady_state`.
        """
        return 1.0 / float(np.abs(self.linear_steady_state(omega)).max())


def _frozen(array: np.ndarray) -> np.ndarray:
    array.setflags(write=False)
    return array
