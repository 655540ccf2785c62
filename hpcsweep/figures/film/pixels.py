"""Colours packed into 32 bits, stamps and text for pictures painted pixel by pixel.

A packed colour is red + 256 green + 65,536 blue + 255 * 2^24, so that a little-endian array of
them is an array of (red, green, blue, 255).
"""

from functools import lru_cache

import numpy as np

from hpcsweep.figures.cielab import rgb

WHITE = 0xFFFFFFFF


def packed_colour(colour: str) -> int:
    """Pack '#rrggbb'."""
    red, green, blue = rgb(colour)
    return red | green << 8 | blue << 16 | 255 << 24


def look_up(values: np.ndarray, colours: dict[int, int]) -> np.ndarray:
    """Return each value's packed colour; white for values that have none."""
    if not colours:
        return np.full(values.shape, WHITE, np.uint32)
    keys = np.array(sorted(colours), values.dtype)
    values_of = np.array([colours[int(key)] for key in keys], np.uint32)
    place = np.minimum(np.searchsorted(keys, values), keys.size - 1)
    return np.where(keys[place] == values, values_of[place], np.uint32(WHITE))


@lru_cache(maxsize=32)
def disc(radius: float) -> tuple[tuple[int, int], ...]:
    """Return offsets (rows, columns) of the pixels of a disc; from radius 1 on at least 3 x 3."""
    reach = int(radius)
    near = max(radius * radius, 2.0) + 0.3
    steps = range(-reach, reach + 1)
    return tuple((dy, dx) for dy in steps for dx in steps if dy * dy + dx * dx <= near)


@lru_cache(maxsize=32)
def fine_point(radius: float) -> tuple[tuple[int, int], ...]:
    """Return offsets of the pixels of a point of chaos, smaller than `disc` of the same radius.

    Two pixels wide, as colours have half the resolution in a film.
    """
    if radius < 1.5:
        return ((0, 0), (0, 1))
    steps = range(0, 2) if radius < 2 else range(-1, 2)
    return tuple((dy, dx) for dy in steps for dx in steps)


def polyline(columns: np.ndarray, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the columns and rows of all pixels of a line through some."""
    count = np.maximum(np.abs(np.diff(columns)), np.abs(np.diff(rows))).clip(1)
    place = np.append(0, np.cumsum(count))
    every = np.arange(place[-1] + 1)
    return tuple(np.rint(np.interp(every, place, x)).astype(np.int64) for x in (columns, rows))


@lru_cache(maxsize=1024)
def text_mask(text: str, size: int) -> np.ndarray:
    """Draw text; return its coverage from 0 to 1, shape (rows, columns)."""
    from matplotlib import font_manager
    from PIL import Image, ImageDraw, ImageFont

    font = ImageFont.truetype(font_manager.findfont("DejaVu Sans"), size)
    left, top, right, bottom = font.getbbox(text)
    picture = Image.new("L", (int(right - left), int(bottom - top)))
    ImageDraw.Draw(picture).text((-left, -top), text, fill=255, font=font)
    return np.asarray(picture, np.float32) / 255


def blend(canvas: np.ndarray, mask: np.ndarray, row: int, column: int, ink: str) -> None:
    """Blend text in a colour onto packed colours."""
    height, width = mask.shape
    there = canvas[row : row + height, column : column + width]
    mask = mask[: there.shape[0], : there.shape[1]]
    result = np.full(there.shape, 0xFF000000, np.uint32)
    for shift, part in zip((0, 8, 16), rgb(ink), strict=True):
        old = ((there >> np.uint32(shift)) & np.uint32(255)).astype(np.float32)
        new = old + (part - old) * mask
        result |= new.round().astype(np.uint32) << np.uint32(shift)
    canvas[row : row + height, column : column + width] = result
