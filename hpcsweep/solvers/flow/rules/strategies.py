"""Strategies by which a contact passes its layer; kernels are compiled with those that are `USED`.

Each is tried in turn and may decline; what none of them takes is collocated (`layer.scheme`).
`benchmarks/speed/passages.py` replaces `USED` before anything is compiled, to measure what each
earns.
"""

from typing import NamedTuple


class Strategies(NamedTuple):
    """Which strategies there are."""

    fast: bool = True
    """A closed form (`passage.crossing`)."""
    solitary: bool = True
    """An integral equation for one contact, by tables (`layer.solitary`)."""
    coupled: bool = True
    """Integral equations for a few contacts of many rows, in modes (`layer.coupled`)."""


USED = Strategies()
