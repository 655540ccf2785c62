"""Compare the bilinear oscillator of hysteresis.toml with what is published of it.

    python jobs/structures/hysteresis.py hysteresis.h5

Prints for each finding of Kalmar-Nagy and Shekhawat (Physica D 238 (2009) 1768) the numbers of the
job: resonance as of a soft spring, resonances at fractions of its frequency, no chaos, agreement
with the averaging of Caughey (Journal of Applied Mechanics 27 (1960) 640) away from these.
"""

import argparse
import math
from pathlib import Path

import numpy as np
from scipy.optimize import brentq

import hpcsweep

ALPHA, DAMPING = 0.1, 0.04
"""Stiffness after yielding over that before, and c."""


def needed(a: float, omega: float) -> float:
    """Return the amplitude of the forcing of x = a cos(theta), averaged.

    With cos(t) = 1 - 2 / a the force is C cos(theta) - S sin(theta) in the mean, C = a ((1 - alpha)
    (t - sin(2 t) / 2) / pi + alpha), S = a (1 - alpha) sin(t)^2 / pi.
    """
    t = math.acos(1.0 - 2.0 / a) if a > 1.0 else math.pi
    along = a * ((1.0 - ALPHA) * (t - 0.5 * math.sin(2.0 * t)) / math.pi + ALPHA)
    across = a * (1.0 - ALPHA) * math.sin(t) ** 2 / math.pi
    return math.hypot(along - omega**2 * a, across + DAMPING * omega * a)


def averaged(amplitude: float, omega: float) -> float:
    """Return the steady amplitude a by averaging."""
    return brentq(lambda a: needed(a, omega) - amplitude, 1e-9, 1e4)


def peaks(values: np.ndarray) -> list[int]:
    """Return where values are larger than both neighbours, the largest first."""
    inner = (values[1:-1] > values[:-2]) & (values[1:-1] > values[2:])
    return sorted(1 + np.flatnonzero(inner), key=lambda at: -values[at])


def told(results) -> list[str]:
    """Return what the job says, a line each."""
    ductility = results["ductility"].isel(slider=0).transpose("direction", "amplitude", "omega")
    up, down = (ductility.sel(direction=way).values for way in ("up", "down"))
    omega, amplitude = results["omega"].values, results["amplitude"].values
    tops = zip(amplitude[::10], up[::10], strict=True)
    bends = [f"{omega[peaks(row)[0]]:.3g} at A = {a:.3g}" for a, row in tops]
    *_, last = up
    smaller = [f"{omega[at]:.3g} (ductility {last[at]:.2f})" for at in peaks(last)[1:]]
    exponent, period = results["lyapunov"].values, results["orbit_period"].values
    theory = np.array([[averaged(a, w) for w in omega] for a in amplitude])
    wrong = np.abs(theory / up - 1.0)
    both = (results["shakedown"] == 2).all("direction").transpose("amplitude", "omega").values
    near, slips = (omega >= 0.7) & (omega <= 1.2), up > 1.1
    return [
        f"soft spring: the resonance is at {', '.join(bends)}",
        f"resonances at fractions: at A = {amplitude[-1]:.3g} the main one is at "
        f"{omega[peaks(last)[0]]:.3g}, smaller ones at {', '.join(smaller)}",
        f"no chaos: {period.size} runs, {100 * np.mean(period == 1):.4g} % of period 1, exponents "
        f"from {np.nanmin(exponent):.3g} to {np.nanmax(exponent):.3g} "
        f"({np.isnan(exponent).sum()} not known: they touch the strength), where they slip up and "
        f"down differ by {np.abs(up / down - 1.0)[both].max():.0e}",
        f"averaging (Caughey), where ductility is above 1.1: from Omega = 0.7 to 1.2 steady "
        f"amplitudes differ by {100 * np.median(wrong[slips & near]):.2g} % in the median and "
        f"{100 * wrong[slips & near].max():.2g} % at most, below 0.4 by up to "
        f"{100 * wrong[slips & (omega < 0.4)].max():.2g} %",
    ]


def main() -> None:
    """Print the comparison."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("file", type=Path)
    print("\n".join(told(hpcsweep.open_results(parser.parse_args().file))))


if __name__ == "__main__":
    main()
