"""The claims, each a pure function of sweeps or maps.

Contact sets are written C with the numbers of the floors; C123 is 0b111. The claims are about
three floors, and about one frame, Omega = 0.445 (numbers 1 to 5, 8, 9) or a map (6, 7).
"""

from dataclasses import dataclass

import numpy as np

from claims.data import Claim, Map, Sweep, Verdict, stretches
from claims.words import C3, C23, at, no_exponent, yes

WINDOWS = (9, 8, 7, 6, 4)
"""Orbit periods of the windows of region (iii), in ascending amplitude."""
LATE_PERIOD = 5
SIMPLER = 0.5
"""Share of chaos at beta = 100 against beta = 1000 up to which it is called much simpler."""
HIGH_PROBABILITY = 0.75
"""Share of runs that is called a high probability."""
MIXED = 0.1
"""Least share of either side in what is called mixed."""
RAISED = 0.9
"""Share of the touching runs in which a norm must be raised."""
EXACT = 1e-6
"""Largest distance (gaps, gaps omega_0) from a closed form that is called exact."""


@dataclass(frozen=True)
class Hits:
    """Impacts of a window's orbit: its period, amplitude, and hits of each floor in one orbit.

    `cycles` counts the forcing periods of the orbit in which each floor touches.
    """

    period: int
    amplitude: float
    hits: tuple[int, ...]
    cycles: tuple[int, ...]


def first_grazing(sweep: Sweep, fine: Sweep | None) -> Claim:
    """1. Chaos at first grazing, then P1 C3.

    Parameters
    ----------
    sweep : Sweep
    fine : Sweep or None
        Sweep up in small steps from the last run without contact to the first P1 C3.
    """
    text = "Region (ii): chaos at first grazing, then P1 C3"
    settled = (sweep.period[0] == 1) & (sweep.contact[0] == C3) & sweep.valid[0]
    found = stretches(settled)
    if not found:
        return Claim("1", text, Verdict.NO, "no P1 C3 on the way up")
    if fine is None:
        return Claim("1", text, Verdict.CANNOT_TELL, "the sweep has no run without contact")
    if not np.isfinite(fine.growth[0]).any():
        return no_exponent("1", text)
    first, last = max(found, key=lambda pair: pair[1] - pair[0])
    chaos = fine.amplitude[fine.chaotic[0]]
    then = f"P1 C3 from A = {at(sweep, first)} to {at(sweep, last)}"
    touching = fine.contact[0] != 0
    if not chaos.size:
        others = int((touching & (fine.period[0] == 0)).sum())
        periods = sorted(set(fine.period[0][touching].tolist()) - {0})
        finding = (
            f"none of {touching.sum()} runs after grazing is chaotic: "
            f"{', '.join(f'P{p}' for p in periods)}, {others} without; {then}"
        )
        return Claim("1", text, Verdict.NO, finding)
    where = f"A = {chaos[0]:.5g}" + (f" to {chaos[-1]:.5g}" if chaos.size > 1 else "")
    finding = f"chaos in {chaos.size} of {touching.sum()} runs after grazing, {where}; {then}"
    return Claim("1", text, Verdict.YES, finding)


def windows(sweep: Sweep, direction: int = 0) -> list[tuple[int, int, int]]:
    """Return the windows (period, first, last) of C23 in a sweep, in ascending amplitude.

    A period's window is its longest stretch; only periods above 3 are windows.
    """
    longest: dict[int, tuple[int, int]] = {}
    own = (sweep.contact[direction] == C23) & sweep.valid[direction]
    for period in np.unique(sweep.period[direction][own]):
        if period > 3:
            chosen = own & (sweep.period[direction] == period)
            longest[int(period)] = max(stretches(chosen), key=lambda pair: pair[1] - pair[0])
    return sorted(((p, *pair) for p, pair in longest.items()), key=lambda window: window[1])


def window_order(sweep: Sweep, gaps: list[Sweep]) -> Claim:
    """2a. Windows P9 P8 P7 P6 P4, chaos between them.

    Parameters
    ----------
    sweep : Sweep
    gaps : list of Sweep
        Sweeps up in small steps from each of these windows to the next.
    """
    text = "Region (iii): windows P9, P8, P7, P6, P4 in chaos"
    found = [window for window in windows(sweep) if window[0] in WINDOWS]
    listed = ", ".join(f"P{p} {at(sweep, i)}-{at(sweep, k)}" for p, i, k in found) or "no window"
    if tuple(window[0] for window in found) != WINDOWS:
        return Claim("2a", text, Verdict.NO, f"{listed} in C23 on the way up")
    if not any(np.isfinite(gap.growth).any() for gap in gaps):
        return no_exponent("2a", text)
    chaos = sum(bool(gap.chaotic.any()) for gap in gaps)
    verdict = Verdict.YES if chaos == len(WINDOWS) - 1 else Verdict.NO
    return Claim("2a", text, verdict, f"{listed}; chaos in {chaos} of the 4 gaps between them")


def window_hits(hits: list[Hits]) -> Claim:
    """2b. In each window floor 3 hits in every cycle, floor 2 twice per orbit."""
    text = "In these windows floor 3 hits every cycle, floor 2 twice per orbit"
    if not hits:
        return Claim("2b", text, Verdict.NO, "there are no such windows")
    listed = ", ".join(
        f"P{h.period}: floor 3 in {h.cycles[2]} of {h.period} cycles, floor 2 {h.hits[1]} times"
        for h in hits
    )
    good = [h.cycles[2] == h.period and h.hits[1] == 2 for h in hits]
    if {h.period for h in hits} != set(WINDOWS):
        missing = ", ".join(f"P{p}" for p in WINDOWS if p not in {h.period for h in hits})
        return Claim("2b", text, Verdict.NO, f"{listed}; no window {missing}")
    return Claim("2b", text, Verdict.YES if all(good) else Verdict.NO, listed)


def late_period(sweep: Sweep, fine: Sweep | None) -> Claim:
    """2c. P5 C23 only on the way down.

    Parameters
    ----------
    sweep : Sweep
    fine : Sweep or None
        Both directions in small steps over the range between the windows of P6 and P4.
    """
    text = "P5 only on the way down"
    if not sweep.both():
        return Claim("2c", text, Verdict.CANNOT_TELL, "needs sweeps up and down")
    places = []
    for d in range(2):
        amplitudes = [
            s.amplitude[(s.period[d] == LATE_PERIOD) & (s.contact[d] == C23) & s.valid[d]]
            for s in (sweep, fine)
            if s is not None
        ]
        places.append(np.unique(np.concatenate(amplitudes)))
    found = [
        f"{name}: {f'A = {a[0]:.5g} to {a[-1]:.5g} ({a.size} runs)' if a.size else 'none'}"
        for name, a in zip(("up", "down"), places, strict=True)
    ]
    good = not places[0].size and places[1].size
    return Claim("2c", text, Verdict.YES if good else Verdict.NO, "P5 C23 " + ", ".join(found))


def chaotic_probe(probe: Sweep) -> Claim:
    """3. A = 0.09877 is chaotic.

    Parameters
    ----------
    probe : Sweep
        That one amplitude, reached from below and, if there is a sweep down, from above.
    """
    text = f"A = {probe.amplitude[0]:g} is chaotic"
    if not np.isfinite(probe.growth[:, 0]).any():
        return no_exponent("3", text)
    findings = []
    for d, name in enumerate(probe.directions):
        period = int(probe.period[d, 0])
        kind = f"P{period}" if period else ("chaotic" if probe.chaotic[d, 0] else "no period")
        findings.append(f"{name}: {kind}, growth of differences e^{probe.growth[d, 0]:.3g}")
    return Claim("3", text, yes(bool(probe.chaotic[0, 0])), "; ".join(findings))


def softer_is_simpler(stiff: Map, soft: Map) -> Claim:
    """6. beta = 100 is much simpler than beta = 1000, both by chaos and by classes."""
    text = "beta = 100 is much simpler than beta = 1000"
    if not (stiff.exponents and soft.exponents):
        return no_exponent("6", text)
    shares, classes = [], []
    for data in (stiff, soft):
        touching = data.valid & (data.contact != 0)
        shares.append(data.chaotic[touching].mean() if touching.any() else 0.0)
        pairs = np.stack((data.period[touching].astype(int), data.contact[touching].astype(int)))
        classes.append(np.unique(pairs, axis=1).shape[1])
    good = shares[1] <= SIMPLER * shares[0] and classes[1] < classes[0]
    finding = (
        f"chaotic: {shares[1]:.2%} of touching runs against {shares[0]:.2%}; classes of period "
        f"and contact set: {classes[1]} against {classes[0]}"
    )
    return Claim("6", text, yes(bool(good)), finding)


def drift_of_orbits(data: Map) -> Claim:
    """7a. P1 with impacts has a lower drift than without the stop, with high probability."""
    text = "P1 with impacts lowers the drift with high probability"
    chosen = data.valid & (data.contact != 0) & (data.period == 1)
    if not chosen.any():
        return Claim("7a", text, Verdict.CANNOT_TELL, "no P1 run touches the stop")
    share = (data.drift < data.free_drift[:, None])[chosen].mean()
    finding = f"lower in {share:.1%} of {chosen.sum()} runs"
    return Claim("7a", text, yes(bool(share >= HIGH_PROBABILITY)), finding)


def drift_of_chaos(data: Map) -> Claim:
    """7b. Chaos lowers the drift in some places and raises it in others."""
    text = "Chaos: drift lowered here, raised there"
    if not data.exponents:
        return no_exponent("7b", text)
    chosen = data.valid & data.chaotic
    if not chosen.any():
        return Claim("7b", text, Verdict.CANNOT_TELL, "no run is chaotic")
    share = (data.drift < data.free_drift[:, None])[chosen].mean()
    finding = f"lower in {share:.1%} of {chosen.sum()} chaotic runs"
    return Claim("7b", text, yes(bool(MIXED <= share <= 1 - MIXED)), finding)


def raised_modes(sweep: Sweep, free_norm: np.ndarray) -> Claim:
    """8. Impact raises the mean norms of modes 2 and 3 at linear resonance.

    Parameters
    ----------
    sweep : Sweep
    free_norm : ndarray, shape (n,)
        Mean modal norms without contact, closed form.
    """
    text = "Impact raises the norms of modes 2 and 3 at linear resonance"
    touching = (sweep.contact != 0) & sweep.valid
    norms = sweep.modal_norm[touching]
    norms = norms[np.isfinite(norms).all(axis=1)]
    if not norms.size:
        return Claim(
            "8", text, Verdict.CANNOT_TELL, "needs modal norms (output.modal_norm) with contact"
        )
    shares = (norms[:, 1:] > free_norm[1:]).mean(axis=0)
    findings = [
        f"mode {j + 2}: {free_norm[j + 1]:.4f} without, median {np.median(norms[:, j + 1]):.4f} "
        f"with contact (higher in {shares[j]:.1%} of {len(norms)} runs)"
        for j in range(shares.size)
    ]
    return Claim("8", text, yes(bool((shares >= RAISED).all())), "; ".join(findings))


def linear_is_exact(amplitudes: np.ndarray, distance: np.ndarray, grazing: float) -> Claim:
    """9. At low amplitude the period-1 linear solution is exact.

    Parameters
    ----------
    amplitudes, distance : ndarray, shape (k,)
        Amplitudes without contact, and how far the integrated motion is from the closed form.
    grazing : float
        First amplitude of contact, closed form.
    """
    text = "At low amplitude the period-1 linear solution is exact"
    if not len(amplitudes):
        return Claim("9", text, Verdict.CANNOT_TELL, "the sweep has no run without contact")
    finding = (
        f"largest distance {np.max(distance):.1e} over {len(amplitudes)} amplitudes from "
        f"{amplitudes[0]:.4g} to {amplitudes[-1]:.4g}; grazing at {grazing:.6g}"
    )
    return Claim("9", text, yes(bool(np.max(distance) < EXACT)), finding)
