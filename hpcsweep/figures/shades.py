"""Discrete colours of the motion classes in maps.

Every shade has a lightness of its own, 6 to 17 of 100 apart (CIE L*), so that the classes
stay apart in grey print and for every kind of colour blindness; hues tell neighbours apart besides.
"""

import numpy as np

from hpcsweep.dynamics.classify import CLASS_NAMES, MotionClass

SHADES = (
    ("no contact", "#ffffff"),
    ("P1", "#f9ea89"),
    ("P2", "#ffc642"),
    ("P3", "#75beeb"),
    ("P4", "#4fb080"),
    ("P5–P8", "#c4531f"),
    ("P9 and longer", "#1a5fb4"),
    ("undecided", "#6e2363"),
    ("quasi-periodic", "#04362a"),
    ("chaotic", "#08080f"),
)
"""(name, colour), light to dark."""
NAMES = tuple(name for name, _ in SHADES)
ALWAYS = ("no contact", "P1", "undecided", "quasi-periodic", "chaotic")
"""Classes whose share a legend states even if it is 0."""
BLANK = "failed or not computed"
LARGEST_PERIODS = (1, 2, 3, 4, 8)
"""Last orbit period of the shades P1 to P5–P8."""


def shade_index(classes: np.ndarray, period: np.ndarray) -> np.ndarray:
    """Give the place in `SHADES` of every run, -1 where there is nothing to show.

    Parameters
    ----------
    classes, period : ndarray of int, same shape
        Of `classify` and the variable ``orbit_period``.
    """
    index = np.full(classes.shape, -1)
    periodic = classes == MotionClass.PERIODIC
    group = np.searchsorted(LARGEST_PERIODS, period, side="left")
    index[periodic] = 1 + group[periodic]
    index[classes == MotionClass.LONG_PERIOD] = NAMES.index("P9 and longer")
    for kind in (
        MotionClass.NO_CONTACT,
        MotionClass.UNDECIDED,
        MotionClass.QUASI_PERIODIC,
        MotionClass.CHAOTIC,
    ):
        index[classes == kind] = NAMES.index(CLASS_NAMES[kind])
    return index


def shade_shares(index: np.ndarray, classes: np.ndarray) -> list[tuple[str, str, float]]:
    """Give (name, colour, share of the runs computed) of the shades a legend needs."""
    computed = max(int((classes != MotionClass.NOT_COMPUTED).sum()), 1)
    counts = [int((index == place).sum()) for place in range(len(SHADES))]
    return [
        (name, colour, count / computed)
        for (name, colour), count in zip(SHADES, counts, strict=True)
        if count or name in ALWAYS
    ]
