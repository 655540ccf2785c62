"""Claims about solutions that coexist in one frame, Omega = 0.445 (numbers 4 and 5)."""

from dataclasses import dataclass

import numpy as np

from claims.data import Claim, Sweep, Verdict, stretches
from claims.words import C13, C23, C123, at, ranges, yes

SAME = 1e-2
"""Distance (gaps, gaps omega_0) above which attractors are different."""
AT_CIRCLE = 0.95
"""Least modulus of a Floquet multiplier that explains the end of a branch."""


@dataclass(frozen=True)
class BranchEnd:
    """Last orbit of a branch and its Floquet multipliers, largest modulus first."""

    amplitude: float
    multipliers: np.ndarray


def two_impacting_orbits(sweep: Sweep) -> Claim:
    """4. P2 C13 coexists with P4 C23 and has the larger drift."""
    text = "(iv): P2 C13 beside P4 C23, the first with the larger drift"
    if not sweep.both():
        return Claim("4", text, Verdict.CANNOT_TELL, "needs sweeps up and down")
    p, c = sweep.period, sweep.contact
    ok = sweep.valid.all(axis=0)
    for two, four in ((1, 0), (0, 1)):
        here = ok & (p[two] == 2) & (c[two] == C13) & (p[four] == 4) & (c[four] == C23)
        if here.any():
            larger = sweep.drift[two][here] > sweep.drift[four][here]
            i, k = np.flatnonzero(here)[[0, -1]]
            finding = (
                f"A = {at(sweep, i)} to {at(sweep, k)}: drift {sweep.drift[two][here].mean():.3f} "
                f"(P2 C13, {sweep.directions[two]}) and {sweep.drift[four][here].mean():.3f} "
                f"(P4 C23, {sweep.directions[four]}); larger in {larger.sum()} of {here.sum()}"
            )
            return Claim("4", text, yes(bool(larger.all())), finding)
    has = [f"C13 in {int((c[d] == C13).sum())} runs {sweep.directions[d]}" for d in range(2)]
    return Claim("4", text, Verdict.NO, f"no such pair; {', '.join(has)}")


def coexisting_regions(sweep: Sweep, end: BranchEnd | None) -> list[Claim]:
    """5. Regions (v) to (viii): C123 beside C23, two C123, the fold of P1 C23, C123 alone.

    Parameters
    ----------
    sweep : Sweep
    end : BranchEnd or None
        Upper end of P1 C23 on the way up.
    """
    texts = {
        "5a": "(v): C123 beside C23",
        "5b": "(vi): two C123",
        "5c": "(vii) ends in a fold of P1 C23",
        "5d": "(viii): C123 alone",
    }
    if not sweep.both():
        return [
            Claim(number, text, Verdict.CANNOT_TELL, "needs sweeps up and down")
            for number, text in texts.items()
        ]
    c, ok, a = sweep.contact, sweep.valid.all(axis=0), sweep.amplitude
    mixed = ok & (((c[0] == C123) & (c[1] == C23)) | ((c[0] == C23) & (c[1] == C123)))
    full = ok & (c == C123).all(axis=0)
    two = full & different_attractors(sweep)
    claims = [
        Claim("5a", texts["5a"], yes(bool(mixed.any())), ranges(sweep, mixed)),
        Claim("5b", texts["5b"], yes(bool(two.any())), ranges(sweep, two)),
    ]
    if end is None and sweep.period[0, -1] == 1 and c[0, -1] == C23:
        finding = "P1 C23 goes on at the largest amplitude"
        claims.append(Claim("5c", texts["5c"], Verdict.CANNOT_TELL, finding))
    elif end is None:
        claims.append(Claim("5c", texts["5c"], Verdict.NO, "no P1 C23 on the way up"))
    else:
        bifurcation, shown = kind_of_end(end.multipliers)
        finding = f"P1 C23 ends at A = {end.amplitude:.7g}: {bifurcation}, largest {shown}"
        claims.append(Claim("5c", texts["5c"], yes(bifurcation == "fold"), finding))
    alone = full & ~two
    tail = len(a) - int(np.argmin(alone[::-1])) if not alone.all() else 0
    if tail < len(a):
        finding = f"one C123 attractor from A = {at(sweep, tail)} to {at(sweep, len(a) - 1)}"
    else:
        finding = "not up to the largest amplitude"
    c123 = stretches(full)
    if c123 and c123[-1][1] == len(a) - 1:
        finding += f"; no other contact set from {at(sweep, c123[-1][0])}"
    claims.append(Claim("5d", texts["5d"], yes(tail < len(a)), finding))
    return claims


def kind_of_end(multipliers: np.ndarray) -> tuple[str, str]:
    """Return, from its multipliers, how a branch ends, and the largest one.

    Returns
    -------
    bifurcation : str
        'fold' (+1), 'period doubling' (-1), 'Neimark-Sacker' (a pair on the unit circle), or
        'no multiplier at the unit circle' (a border: the contact set changes).
    multiplier : str
    """
    first = complex(multipliers[0])
    pair = abs(first.imag) > 1e-9
    shown = f"multiplier {first.real:.4f}"
    if pair:
        shown += f" +- {abs(first.imag):.4f}i, modulus {abs(first):.4f}"
    if abs(first) < AT_CIRCLE:
        return "no multiplier at the unit circle", shown
    if pair:
        return "Neimark-Sacker", shown
    return ("fold" if first.real > 0 else "period doubling"), shown


def different_attractors(sweep: Sweep) -> np.ndarray:
    """Return where the sweeps up and down end on different attractors, shape (k,).

    They do if one has a period and the other is chaotic, or if both have a period and no point
    of one is within `SAME` of the other's final state.
    """
    periodic = (sweep.period > 0).all(axis=0)
    found = (sweep.chaotic[0] & (sweep.period[1] > 0)) | (sweep.chaotic[1] & (sweep.period[0] > 0))
    for k in np.flatnonzero(periodic):
        distance = np.abs(sweep.points[1, k] - sweep.state[0, k]).max(axis=1)
        found[k] = np.nanmin(distance) > SAME
    return found & sweep.valid.all(axis=0)
