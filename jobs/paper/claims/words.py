"""Contact sets and phrases that the claims share."""

import numpy as np

from claims.data import Claim, Sweep, Verdict, stretches

C3, C23, C13, C123 = 0b100, 0b110, 0b101, 0b111
"""Contact sets, written C with the numbers of the floors."""


def yes(good: bool) -> Verdict:
    """Judge what can be told."""
    return Verdict.YES if good else Verdict.NO


def no_exponent(number: str, text: str) -> Claim:
    """Judge what cannot be told without exponents."""
    return Claim(
        number, text, Verdict.CANNOT_TELL, "no Lyapunov exponents: set output.lyapunov = true"
    )


def at(sweep: Sweep, index: int) -> str:
    """Write an amplitude of a sweep."""
    return f"{sweep.amplitude[index]:.4g}"


def ranges(sweep: Sweep, chosen: np.ndarray) -> str:
    """Write where something holds: the three longest stretches."""
    found = sorted(stretches(chosen), key=lambda pair: pair[0] - pair[1])[:3]
    if not found:
        return "nowhere"
    told = ", ".join(f"{at(sweep, i)}-{at(sweep, k)}" for i, k in sorted(found))
    return f"A = {told} ({int(chosen.sum())} of {chosen.size} amplitudes)"
