"""Declaration of a key of a job, from which everything that is said of it is made.

Reading and its messages (`hpcsweep.job.values.Values.read`), the commented job of ``hpcsweep new``
(`hpcsweep.job.template`), the hints for keys that are unknown, and the page of the documentation
that lists all keys. A study declares the keys that only it has beside the code that uses them.
"""

import json
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

Tables = dict[str, "tuple[Key, ...]"]
"""Keys by the table of the job in which they stand; under '' those outside tables."""


@dataclass(frozen=True)
class Key:
    """One key of a job.

    Attributes
    ----------
    name : str
    meaning : str
        What it is, in which unit: Markdown, its links those of a page in ``docs``.
    default : bool, int, float, str or list, optional
        None: it has none, or one that depends on others, which `told` says.
    limits : tuple
        Least and largest of a number; of a text the words that it may be.
    told : str
        The default in words.
    example : str
        Value in the commented job where there is no default, in TOML.
    units : str
        Quantity of a number, as `hpcsweep.model.unit_names` has it.
    """

    name: str
    meaning: str
    default: Any = None
    limits: tuple = ()
    told: str = ""
    example: str = ""
    units: str = "1"

    @property
    def shown(self) -> str:
        """The default in TOML, empty if there is none."""
        if self.default is None:
            return ""
        # JSON writes what keys have by default as TOML does, but for infinity
        text = json.dumps(self.default).replace("Infinity", "inf")
        return text.replace("e-0", "e-") if isinstance(self.default, float) else text

    @property
    def description(self) -> str:
        """Meaning and limits."""
        if not self.limits:
            return self.meaning
        if isinstance(self.limits[0], str):
            words = ", ".join(f'`"{word}"`' for word in self.limits)
            return f"{self.meaning}: {words}"
        whole = "a whole number " * isinstance(self.limits[0], int)
        least, most = (f"{end}" if whole else f"{end:g}" for end in self.limits)
        return f"{self.meaning}: {whole}from {least} to {most}"


def names(keys: Iterable[Key]) -> tuple[str, ...]:
    """Return the names of keys."""
    return tuple(key.name for key in keys)


OMEGA = (
    Key(
        "omega",
        "Omega, forcing frequencies, one frame each, above 0: a number, a list, or a range "
        "`{from = 0.3, to = 0.6, count = 31}`, or with `step`; of basins a single one",
        example="0.445",
    ),
    Key(
        "frequency",
        "the same in cycles per unit of time (hertz where that is a second), in place of "
        "`sweep.omega`",
    ),
    Key(
        "amplitude",
        "A, amplitudes of the forcing acceleration, at least 0, ascending, in the same ways; of "
        "basins a single one; of sweeps also a formula of what they are along, "
        '`"0.7 * omega**2"`, as `sweep.omega` may be',
        example="{from = 0.005, to = 0.25, step = 0.0025}",
    ),
)
"""Keys of the table ``sweep`` of all studies with harmonic forcing."""
BLOCK = Key(
    "block",
    "runs committed to the file together, the most of a path that a stop or a kill loses",
    told="50 (points, attractors, rows of basins, and with `bdf`: 1; records: 25 scales)",
    limits=(1, 10_000_000),
    example="50",
)
