"""Colours as perceived: CIE L*a*b* and sRGB, white point D65.

L* is lightness, 0 black to 100 white: what remains of a colour in grey print. Chroma is the
distance of a colour from grey, hue the angle in the plane of a* (red) and b* (yellow).
"""

import math

TO_XYZ = (
    (0.4124564, 0.3575761, 0.1804375),
    (0.2126729, 0.7151522, 0.0721750),
    (0.0193339, 0.1191920, 0.9503041),
)
"""Linear sRGB to XYZ (IEC 61966-2-1); the rows' sums are the white point."""
FROM_XYZ = (
    (3.2404542, -1.5371385, -0.4985314),
    (-0.9692660, 1.8760108, 0.0415560),
    (0.0556434, -0.2040259, 1.0572252),
)
WHITE_POINT = tuple(math.fsum(row) for row in TO_XYZ)
KNEE = 6 / 29
"""Below it the cube root of L*a*b* is continued by a straight line."""
HALVINGS = 16


def rgb(colour: str) -> tuple[int, int, int]:
    """Split '#rrggbb'."""
    return int(colour[1:3], 16), int(colour[3:5], 16), int(colour[5:7], 16)


def lightness(colour: str) -> float:
    """Return the lightness L* of '#rrggbb', 0 to 100."""
    linear = (_linear(part / 255) for part in rgb(colour))
    y = sum(weight * part for weight, part in zip(TO_XYZ[1], linear, strict=True))
    return 116 * (math.cbrt(y) if y > KNEE**3 else y / (3 * KNEE**2) + 4 / 29) - 16


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
    shown = _to_linear(lightness, chroma, hue)
    if not _on_screen(shown):
        low, high = 0.0, chroma
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            if _on_screen(_to_linear(lightness, middle, hue)):
                low = middle
            else:
                high = middle
        shown = _to_linear(lightness, low, hue)
    return "#" + "".join(f"{round(255 * _encoded(part)):02x}" for part in shown)


def _to_linear(lightness: float, chroma: float, hue: float) -> list[float]:
    """Linear red, green, blue; outside [0, 1] if no screen shows it."""
    angle = math.radians(hue)
    y = (lightness + 16) / 116
    roots = y + chroma * math.cos(angle) / 500, y, y - chroma * math.sin(angle) / 200
    xyz = [
        white * (root**3 if root > KNEE else 3 * KNEE**2 * (root - 4 / 29))
        for white, root in zip(WHITE_POINT, roots, strict=True)
    ]
    return [sum(a * b for a, b in zip(row, xyz, strict=True)) for row in FROM_XYZ]


def _on_screen(linear: list[float]) -> bool:
    return all(-1e-4 <= part <= 1 + 1e-4 for part in linear)


def _linear(part: float) -> float:
    return part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4


def _encoded(part: float) -> float:
    part = min(max(part, 0.0), 1.0)
    return 12.92 * part if part <= 0.0031308 else 1.055 * part ** (1 / 2.4) - 0.055
