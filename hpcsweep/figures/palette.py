"""The colours of all figures, the film and the explorer: one colour, one meaning.

Five languages, each with a legend of its own; no colour depends on what else is in the picture:

- motions (`MOTIONS`): no contact, the orbit periods, the classes without one;
- contact sets (`contact_colour`): a rule on the set's bits;
- directions, where a run starts from (`DIRECTIONS`);
- numbers (`NUMBERS`, `RATIOS`): ordered, dark to light or side against side;
- series (`series_colour`, `mode_colour`): lines that a legend beside them names.

White means unknown. The colours serve points on white and areas alike, so that none is lighter than
L* = 83. They were chosen by search for the largest least distance (CIEDE2000) between any two
motions, for normal vision and for protanopes, deuteranopes and tritanopes (Machado,
Oliveira and Fernandes 2009); the tests hold the distances. Lightness falls from motion to motion by
5 of 100 or more (failed apart), so that they stay apart in grey.

Colours as perceived are those of CIE L*a*b*, white point D65. L* is lightness, 0 black, 100 white:
what remains of a colour in grey print. Chroma is the distance of a colour from grey, hue the angle
in the plane of a* (red) and b* (yellow).
"""

import math
from functools import lru_cache

import numpy as np

from hpcsweep.dynamics.classify import CLASS_NAMES, MotionClass, class_names
from hpcsweep.studies.grid import DOWN, UP
from hpcsweep.studies.points import START

NOTHING = "#ffffff"
"""Unknown: not computed, or not a number. Hatched where there is room."""
NO_CONTACT = "#cdcdcd"
LONGEST = 8
"""Longest orbit period with a colour of its own; longer ones share one."""
MOTIONS = (
    (CLASS_NAMES[MotionClass.NO_CONTACT], NO_CONTACT),
    ("P1", "#6ac6f2"),
    ("P2", "#bbae00"),
    ("P3", "#d97db5"),
    ("P4", "#719564"),
    ("P5", "#5e6cfb"),
    ("P6", "#db0a07"),
    ("P7", "#b80e5d"),
    ("P8", "#8107b7"),
    (f"P{LONGEST + 1} and longer", "#064e43"),
    (CLASS_NAMES[MotionClass.UNDECIDED], "#61230f"),
    (CLASS_NAMES[MotionClass.QUASI_PERIODIC], "#00225e"),
    (CLASS_NAMES[MotionClass.CHAOTIC], "#0e0e0e"),
    (CLASS_NAMES[MotionClass.FAILED], "#79727e"),
)
"""(name, colour) of every motion; all but failed from light to dark; see `motions_of`."""
MOTION_NAMES = tuple(name for name, _ in MOTIONS)
MOTION_COLOURS = tuple(colour for _, colour in MOTIONS)
LONGER = MOTION_NAMES.index(f"P{LONGEST + 1} and longer")
DIRECTIONS = {UP: "#0072b2", DOWN: "#d55e00", START: "#b88664"}
"""By where a run starts: the run at the next smaller or larger amplitude, or a state of its own."""
GRAZING = "#b00000"
"""The grazing curve, drawn with a white rim."""
STOP = "#7a7a7a"
NUMBERS = "cividis"
"""Colour map of numbers, even in lightness and the same to the colour-blind; where they have a
sign, 0 is its middle."""
RATIOS = ("#7fb9e2", "#3f8cc4", "#a3510f", "#4a1206")
"""Far below 1, below, above, far above: light to dark, blue against brown."""
OTHER_MOTION = "#f1f1f1"
"""Runs that a figure of some motions leaves out."""
SERIES = (
    "#0072b2",
    "#d55e00",
    "#009e73",
    "#cc79a7",
    "#56b4e9",
    "#e69f00",
    "#332288",
    "#882255",
    "#117733",
    "#999933",
)
"""Okabe and Ito's colours, then Tol's."""
SHADES = ((0.0, -0.5, 0.75, -0.75), (0.0, 0.4, 0.75, 0.6))
"""Shares of white, or less than 0 of black, in the colours of several attractors of one motion,
whose own colour is light or dark; three of them are distinct to every eye."""
LIGHT = 45.0
"""Lightness from which on a motion's colour is light."""
DARK_INK, LIGHT_INK, INK_CHANGE = "#222222", "#ffffff", 53.3
"""Inks of text, and the lightness of the ground at which their contrast is the same, 4 to 1."""

_CONTACT_LIGHTNESS, _CONTACT_CHROMA = (82.0, 12.0), 70.0
_CONTACT_HUE, _HUE_OF_NUMBER = 260.0, 70.0
"""Hue of one floor, the lowest, and the turn for each floor more, in degrees: of all multiples of
five those by which the sets of two, three and four floors are farthest apart to all eyes."""
_MODE_RANGE = 0.0, 0.8
"""Part of viridis that is dark enough for lines on white."""
_TO_XYZ = np.array(
    [
        [0.4124564, 0.3575761, 0.1804375],
        [0.2126729, 0.7151522, 0.0721750],
        [0.0193339, 0.1191920, 0.9503041],
    ]
)
"""Linear sRGB to XYZ (IEC 61966-2-1); the rows' sums are the white point."""
_KNEE = 6 / 29
"""Below it the cube root of L*a*b* is continued by a straight line."""
_HALVINGS = 16


def rgb(colour: str) -> tuple[int, ...]:
    """Split '#rrggbb'."""
    return tuple(bytes.fromhex(colour[1:]))


def lightness(colour: str) -> float:
    """Return the lightness L* of '#rrggbb', 0 to 100."""
    part = np.array(rgb(colour)) / 255
    linear = np.where(part <= 0.04045, part / 12.92, ((part + 0.055) / 1.055) ** 2.4)
    y = float(_TO_XYZ[1] @ linear)
    return 116 * (math.cbrt(y) if y > _KNEE**3 else y / (3 * _KNEE**2) + 4 / 29) - 16


def to_hex(lightness: float, chroma: float, hue: float) -> str:
    """Return the sRGB colour of a lightness, chroma and hue, with less chroma where necessary.

    Parameters
    ----------
    lightness : float
        L*, 0 to 100.
    chroma : float
        Reduced until a screen can show the colour.
    hue : float
        In degrees.
    """
    kept = 0.0
    for step in chroma * 0.5 ** np.arange(_HALVINGS + 1):
        away = np.abs(_linear(lightness, kept + step, hue) - 0.5).max()
        if kept + step <= chroma and away <= 0.5 + 1e-4:
            kept += step
    part = np.clip(_linear(lightness, kept, hue), 0.0, 1.0)
    encoded = np.where(part <= 0.0031308, 12.92 * part, 1.055 * part ** (1 / 2.4) - 0.055)
    return f"#{bytes(np.rint(255 * encoded).astype(np.uint8)).hex()}"


def _linear(lightness: float, chroma: float, hue: float) -> np.ndarray:
    """Return linear red, green, blue; outside [0, 1] if no screen shows it."""
    angle, y = math.radians(hue), (lightness + 16) / 116
    roots = y + chroma * np.array([math.cos(angle) / 500, 0.0, -math.sin(angle) / 200])
    xyz = np.where(roots > _KNEE, roots**3, 3 * _KNEE**2 * (roots - 4 / 29))
    return np.linalg.solve(_TO_XYZ, _TO_XYZ.sum(axis=1) * xyz)


def motion_index(classes: np.ndarray, period: np.ndarray) -> np.ndarray:
    """Return the index in `MOTIONS` of every run, -1 where nothing is computed.

    Parameters
    ----------
    classes, period : ndarray of int, same shape
        From `hpcsweep.dynamics.classify` and the variable ``orbit_period``.

    Returns
    -------
    ndarray of int, same shape
    """
    place = {name: index for index, name in enumerate(MOTION_NAMES)}
    table = np.array([place.get(CLASS_NAMES[kind], -1) for kind in MotionClass])
    table[MotionClass.LONG_PERIOD] = LONGER
    index = table[classes]
    periodic = classes == MotionClass.PERIODIC
    index[periodic] = MOTION_NAMES.index("P1") - 1 + np.minimum(period[periodic], LONGEST + 1)
    return index


def motion_place(kind: MotionClass, period: int) -> int:
    """Return the index in `MOTIONS` of one run, -1 if it is not computed."""
    return int(motion_index(np.array([kind]), np.array([period]))[0])


def period_colour(period: int) -> str:
    """Return the colour of orbits of a period."""
    return MOTION_COLOURS[min(period, LONGEST + 1)]


@lru_cache(maxsize=4096)
def contact_colour(contact: int, labels: int | tuple[str, ...]) -> str:
    """Return the colour of a contact set, which depends on the set alone.

    The more contacts, the darker; among sets of equally many contacts the hue goes round once, from
    the first to the last, and the lightness falls a little. All sets of up to three contacts are
    distinct to all eyes, those of four to normal ones; among larger sets neighbours in this order
    look alike.

    Parameters
    ----------
    contact : int
        Bit k - 1 is contact k.
    labels : int or tuple of str
        `Structure.contact_labels`, or their number where all numbers up to it are contacts.
    """
    there = range(labels) if isinstance(labels, int) else [k for k, x in enumerate(labels) if x]
    total = len(there)
    members = [place for place, k in enumerate(there) if contact >> k & 1]
    if not members:
        return NO_CONTACT
    # rank among the sets of equally many contacts: the combinatorial number system
    place = sum(math.comb(member, count) for count, member in enumerate(members, 1))
    share = place / math.comb(total, len(members)), (place + 0.5) / math.comb(total, len(members))
    top, bottom = _CONTACT_LIGHTNESS
    return to_hex(
        top - (top - bottom) * (len(members) - 1 + share[1]) / total,
        _CONTACT_CHROMA,
        _CONTACT_HUE + _HUE_OF_NUMBER * (len(members) - 1) + 360 * share[0],
    )


def motions_of(structure) -> tuple[tuple[str, str], ...]:
    """Return `MOTIONS` as those of a structure are called."""
    return (class_names(structure)[MotionClass.NO_CONTACT], NO_CONTACT), *MOTIONS[1:]


def shade(colour: str, place: int) -> str:
    """Return the colour of one of several attractors of a motion (from 0: the motion's own)."""
    shades = SHADES[lightness(colour) < LIGHT]
    share = shades[place % len(shades)]
    towards = 255 if share > 0 else 0
    parts = (round(part + abs(share) * (towards - part)) for part in rgb(colour))
    return f"#{bytes(parts).hex()}"


def series_colour(place: int) -> str:
    """Return the colour of a line of a diagram whose legend names it."""
    return SERIES[place % len(SERIES)]


def mode_colour(mode: int, n_modes: int) -> str:
    """Return the colour of a mode (from 0), dark to light."""
    first, last = _MODE_RANGE
    return _of_map("viridis", first + (last - first) * mode / max(n_modes - 1, 1))


def count_colour(place: int, n_places: int) -> str:
    """Return the colour of a small count (from 0): of the colour map of numbers, light to dark."""
    return _of_map(NUMBERS, 0.85 * (1.0 - place / max(n_places - 1, 1)))


def _of_map(name: str, share: float) -> str:
    from matplotlib import colormaps, colors

    return colors.to_hex(colormaps[name](share))


def ink(colour: str) -> str:
    """Return the colour of text on a colour: the one of two with more contrast."""
    return DARK_INK if lightness(colour) > INK_CHANGE else LIGHT_INK
