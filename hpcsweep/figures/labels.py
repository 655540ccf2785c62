"""Labels of axes in the structure's own units, and the floors a figure shows."""

from collections.abc import Sequence

from hpcsweep.figures.style import AMPLITUDE, OMEGA, PlotError

MOST_FLOORS = 5
"""Floors that are all shown where none are requested; of more the top, the middle and the first."""


MOST_MODES = 5
"""Modes that are shown: the lowest."""


def in_gaps(structure) -> bool:
    """Return whether lengths are in gaps and times in 1/omega_0: equal storeys, all stops at 1."""
    return structure.is_uniform and all(contact.gap == 1.0 for contact in structure.contacts)


def displacement(structure, floor: int, at: str = "") -> str:
    """Label a floor's displacement (floor from 0)."""
    return rf"$u_{{{floor + 1}}}{at}$" + ("  [gaps]" if in_gaps(structure) else "")


def velocity(structure, floor: int, at: str = "") -> str:
    """Label a floor's velocity (floor from 0)."""
    return rf"$v_{{{floor + 1}}}{at}$" + (r"  [gaps $\omega_0$]" if in_gaps(structure) else "")


def amplitude(structure) -> str:
    """Label the axis of the forcing amplitude."""
    return AMPLITUDE if in_gaps(structure) else "forcing amplitude $A$"


def frequency(structure) -> str:
    """Label the axis of the forcing frequency."""
    return OMEGA if structure.is_uniform else r"forcing frequency $\Omega$"


def exponent(structure) -> str:
    """Label the largest Lyapunov exponent."""
    label = r"largest Lyapunov exponent $\lambda$"
    return label + (r"  [$\omega_0$]" if structure.is_uniform else "")


def choose_floors(n: int, asked: Sequence[int] | None = None) -> list[int]:
    """Choose the floors to be shown, ascending, from 0.

    Parameters
    ----------
    n : int
        Floors of the structure.
    asked : sequence of int, optional
        Those requested, from 1. Default: all of a few, else the first, the middle and the top.

    Raises
    ------
    PlotError
        If one requested is not there.
    """
    if asked:
        for floor in asked:
            if not 1 <= floor <= n:
                raise PlotError(f"--floor {floor}: must be from 1 to {n}")
        return sorted({floor - 1 for floor in asked})
    if n <= MOST_FLOORS:
        return list(range(n))
    return [0, (n - 1) // 2, n - 1]
