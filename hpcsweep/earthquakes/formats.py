"""Formats of strong-motion networks: where their samples, steps and units stand.

- K-NET and KiK-net: counts times ``Scale Factor``, in gal, less their mean: counts have no zero;
- SMC of the USGS: 11 lines of text, 48 integers, 50 numbers, comments, samples in cm/s^2;
- COSMOS (V2, V2c; format version 1.20), and Volume 2 of CSMIP: several channels in a file, each
  with a line that tells number, kind and unit of the samples that follow it.

Fields have fixed widths, and may touch.
"""

import re
from collections.abc import Callable, Iterator
from typing import NamedTuple

from hpcsweep.earthquakes.header import NUMBER, NUMBERS, Header, number
from hpcsweep.earthquakes.units import unit_of
from hpcsweep.model.arguments import count, shown

MILLISECONDS = 1e3
UNKNOWN = -999.0
WORDS = re.compile(r"[a-z]{2}|/&", re.IGNORECASE)


class Channel(NamedTuple):
    """Samples of a file, and what is said of them."""

    lines: list[str]
    step: float
    """Seconds."""
    unit: str
    n_samples: int = 0
    """0 where the file does not tell it."""
    width: int = 0
    """Characters of a sample; 0: blanks separate them."""
    factor: float = 0.0
    """Of counts, else 0."""

    def values(self) -> list[float]:
        """Return the samples in the unit."""
        cells = _cells(self.lines, self.width) if self.width else []
        if not (cells and all(map(NUMBERS.fullmatch, cells))):  # or blanks have been lost
            cells = " ".join(self.lines).split()
        if len(cells) != (self.n_samples or len(cells)):
            raise ValueError(f"must have {self.n_samples} samples, as it says, has {len(cells)}")
        if wrong := [cell for cell in cells if not NUMBERS.fullmatch(cell)]:
            raise ValueError(f"every sample must be a number, has {shown(wrong[0])}")
        read = [number(cell) for cell in cells]
        mean = sum(read) / max(len(read), 1)
        return [self.factor * (sample - mean) for sample in read] if self.factor else read


def _cells(lines: list[str], width: int) -> list[str]:
    """Return the numbers in fields of a width."""
    fields = (line[i : i + width] for line in lines for i in range(0, len(line.rstrip()), width))
    return [field.strip() for field in fields if field.strip()]


def _below(lines: list[str], i: int) -> list[str]:
    """Return the lines below line i up to the next words."""
    end = next((j for j in range(i + 1, len(lines)) if WORDS.search(lines[j])), len(lines))
    return lines[i + 1 : end]


def _knet(lines: list[str]) -> Iterator[Channel]:
    head = {line[:18].strip().lower(): line[18:] for line in lines[:17]}
    scale = re.match(rf"\s*({NUMBER})\(gal\)/({NUMBER})", head.get("scale factor", ""))
    rate = NUMBERS.search(head.get("sampling freq(hz)", ""))
    if scale is None or rate is None:
        raise ValueError("must tell Scale Factor and Sampling Freq(Hz) in its 17 lines, does not")
    factor = float(scale[1]) / float(scale[2])
    yield Channel(lines[17:], 1.0 / float(rate[0]), "gal", factor=factor)


def _smc(lines: list[str]) -> Iterator[Channel]:
    whole, real = _cells(lines[11:17], 10), _cells(lines[17:27], 15)
    if len(whole) != 48 or len(real) != 50:
        raise ValueError("must have 48 integers and 50 numbers in lines 12 to 27, has not")
    samples = lines[27 + int(whole[15]) :]
    yield Channel(samples, 1.0 / float(real[1]), "cm/s2", int(whole[16]), 10)


def _cosmos(lines: list[str]) -> Iterator[Channel]:
    step = UNKNOWN
    for i, line in enumerate(lines):
        if head := re.match(r"\s*\d+\s+Real-header\D+(\d+) lines\D+\d+F(\d+)", line):
            real = _cells(lines[i + 1 : i + 1 + int(head[1])], int(head[2]))
            milliseconds = float(real[61])
            step = float(real[33]) if milliseconds == UNKNOWN else milliseconds / MILLISECONDS
        what = re.match(
            r"\s*(\d+)\s+accel\w*\.?\s+pts.*units\s*=\s*([^,(]+).*\(\s*\d+[A-Z]+(\d+)", line, re.I
        )
        if what:
            yield Channel(_below(lines, i), step, what[2], int(what[1]), int(what[3]))


def _csmip(lines: list[str]) -> Iterator[Channel]:
    for i, line in enumerate(lines):
        what = re.match(
            rf"\s*(\d+)\s+points of accel\D+?({NUMBER})\s*sec\S*\s*in\s+([^\s(]+).*\(\d+F(\d+)",
            *(line, re.IGNORECASE),
        )
        if what:
            yield Channel(_below(lines, i), float(what[2]), what[3], int(what[1]), int(what[4]))


FORMATS: dict[str, tuple[str, Callable[[list[str]], Iterator[Channel]] | None]] = {
    "K-NET": (r"^\s*scale factor\s+\S*\(gal\)\s*/", _knet),
    "SMC": (r"\A\s*2 corrected accelerogram", _smc),
    "COSMOS": (r"\bformat v?\d\d?\.\d\d\b", _cosmos),
    "CSMIP": (r"^\s*\d+\s+points of (?:veloc|displ)", _csmip),
    "SMC uncorrected": (r"\A\s*1 uncorrected accelerogram", None),
    "GSE": (r"^(?:wid[12]|begin gse)", None),
}
"""By name the signature of each, and what reads it; None: nothing does."""


def format_of(text: str) -> str:
    """Return the name of the format of a text, empty if it is none of these."""
    flags = re.IGNORECASE | re.MULTILINE
    return next((name for name, (sign, _) in FORMATS.items() if re.search(sign, text, flags)), "")


def read_format(name: str, text: str, channel: int | None) -> tuple[list[float], Header]:
    """Read the samples of a channel, from 1, of a file of a format.

    Raises
    ------
    ValueError
        If it is damaged, has no acceleration, or several where `channel` is None.
    """
    read = FORMATS[name][1]
    if read is None:
        raise ValueError(f"is a file of the format {name}, which is not read: obspy reads others")
    try:
        channels = list(read(text.splitlines()))
        n = len(channels)
        if not n:
            raise ValueError("must have channels of acceleration, has none")
        if channel is None and n > 1:
            raise ValueError(f"channel must be given, from 1 to {n}, the channels of acceleration")
        chosen = channels[count("channel", 1 if channel is None else channel, 1, n) - 1]
        unit = unit_of(chosen.unit)
        if unit is None or unit.kind != "acceleration":
            raise ValueError(f"must be in a unit of acceleration, is in {chosen.unit.strip()}")
        if not chosen.step > 0:
            raise ValueError("must tell the time between samples, does not")
        return chosen.values(), Header({}, {name: chosen.step}, {unit: chosen.unit}, None, None)
    except (ValueError, IndexError, ZeroDivisionError) as error:
        said = str(error) if isinstance(error, ValueError) else "is cut off or damaged"
        raise ValueError(f"{name} file: {said}") from None
