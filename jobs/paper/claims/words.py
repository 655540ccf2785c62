"""Contact sets and phrases shared by the claims."""

import numpy as np

from claims.data import Claim, Sweep, Verdict, stretches

C3, C23, C13, C123 = 0b100, 0b110, 0b101, 0b111
"""Contact sets, written C with the numbers of the floors."""


def yes(good: bool) -> Verdict:
    """Return the verdict of a decidable claim."""
    return Verdict.YES if good else Verdict.NO


def no_exponent(number: str, text: str) -> Claim:
    """Return the claim that cannot be judged without exponents."""
    return Claim(
        number, text, Verdict.CANNOT_TELL, "no Lyapunov exponents: set output.lyapunov = true"
    )


def at(sweep: Sweep, index: int) -> str:
    """Format an amplitude of a sweep."""
    return f"{sweep.amplitude[index]:.4g}"


def ranges(sweep: Sweep, chosen: np.ndarray) -> str:
    """Format where something holds: the three longest stretches."""
    found = sorted(stretches(chosen), key=lambda pair: pair[0] - pair[1])[:3]
    if not found:
        return "nowhere"
    words = ", ".join(f"{at(sweep, i)}-{at(sweep, k)}" for i, k in sorted(found))
    return f"A = {words} ({int(chosen.sum())} of {chosen.size} amplitudes)"
