"""Strategies by which a contact passes its layer; kernels are compiled with those that are `USED`.

Each is tried in turn and may decline; what none of them takes is collocated (`layer.scheme`).
`benchmarks/speed/passages.py` replaces `USED` before anything is compiled, to measure what each
earns.
"""

from typing import NamedTuple


class Strategies(NamedTuple):
    """Which strategies there are."""

    fast: bool = True
    """A closed form (`layer.passage.crossing`)."""
    volterra: bool = True
    """Integral equations for a few contacts, in modes (`layer.volterra`)."""


USED = Strategies()
