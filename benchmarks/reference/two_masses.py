"""NLvib's third example by exact multipliers: where its periodic orbits change their stability.

    bash benchmarks/run.sh two_masses

Two masses between walls, a one-sided spring of stiffness 100 at the first, the force 0.1 cos(Omega
tau) on the second (jobs/structures/two-masses.toml). The orbit of period 1 is followed along arc
length by Newton's method on the exact stroboscopic map, from Omega = 0.5 to 0.8, and each crossing
of the unit circle by its multipliers is bisected. Published are values by harmonic balance with 21
harmonics, and bifurcations that were read off a figure to 0.005."""

import math
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from hpcsweep.job import load_job
from hpcsweep.solvers.flow import FlowMap
from hpcsweep.solvers.trajectory import trajectory

JOB = Path(__file__).resolve().parents[2] / "jobs" / "structures" / "two-masses.toml"
STRUCTURE = load_job(JOB).structure
AMPLITUDE = 0.1
FROM, TO = 0.5, 0.8
PUBLISHED = {
    "torus": (0.585, 0.619, 0.729),
    "period doubling": (0.733, 0.755),
    "fold": (0.6554,),
}
GREATEST_RMS, AT_OMEGA = 0.98093, 0.7541
DIFFERENCE = 1e-6
"""Of the difference quotient by Omega."""
MAX_STEP, MIN_STEP = 5e-3, 1e-7


@dataclass
class Orbit:
    """An orbit of period 1, a point of the curve."""

    point: np.ndarray
    """State and Omega."""
    multipliers: np.ndarray
    tangent: np.ndarray

    @property
    def omega(self) -> float:
        return float(self.point[-1])

    @property
    def state(self) -> np.ndarray:
        return self.point[:-1]

    @property
    def is_stable(self) -> bool:
        return bool(np.abs(self.multipliers).max() < 1)

    def test(self, kind: str) -> float:
        """Return a function that changes its sign where such a bifurcation is."""
        mu = self.multipliers
        if kind == "torus":
            pairs = [mu[i] * mu[j] - 1 for i in range(len(mu)) for j in range(i)]
            return float(np.prod(pairs).real)
        return float(np.prod(mu + 1 if kind == "period doubling" else mu - 1).real)

    def is_torus(self) -> bool:
        """Distinguish a pair on the unit circle from two real multipliers with product 1."""
        return bool(np.any((np.abs(self.multipliers.imag) > 1e-6) & self._near_circle()))

    def _near_circle(self) -> np.ndarray:
        return np.abs(np.abs(self.multipliers) - 1) < 1e-3

    def rms(self, samples: int = 4001, share: float = 1.0) -> float:
        """Return the rms of x1; `share` of its mean's square is counted."""
        motion = trajectory(STRUCTURE, AMPLITUDE, self.omega, self.state, samples)
        x = motion[:-1, 0]
        return math.sqrt(float(np.var(x) + share * np.mean(x) ** 2))


def residual(point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return P(z) - z and its derivative by state and Omega."""
    state, omega = point[:-1], point[-1]
    end, matrix = FlowMap(STRUCTURE, omega).monodromy(state, AMPLITUDE, 1)
    later, _ = FlowMap(STRUCTURE, omega + DIFFERENCE).monodromy(state, AMPLITUDE, 1)
    by_omega = (later - end) / DIFFERENCE
    return end - state, np.column_stack((matrix - np.eye(len(state)), by_omega))


def corrected(guess: np.ndarray, along: np.ndarray, most: int = 12) -> Orbit | None:
    """Solve for the orbit in the plane through `guess` across `along`."""
    point = guess.copy()
    for _ in range(most):
        rest, matrix = residual(point)
        system = np.vstack((matrix, along))
        change = np.linalg.solve(system, np.append(-rest, along @ (guess - point)))
        point = point + change
        if np.abs(change).max() < 1e-11:
            break
        if np.abs(change).max() > 1:
            return None
    else:
        return None
    _, matrix = residual(point)
    tangent = np.linalg.svd(matrix)[2][-1]
    tangent *= np.sign(tangent @ along) or 1.0
    n = len(point) - 1
    return Orbit(point, np.linalg.eigvals(matrix[:, :n] + np.eye(n)), tangent)


def first_orbit() -> Orbit:
    """Return the linear orbit at Omega = 0.5."""
    response = AMPLITUDE * STRUCTURE.steady_harmonics(FROM)[1][0]
    guess = np.concatenate((response.imag, FROM * response.real, [FROM]))
    return corrected(guess, np.eye(len(guess))[-1])


def curve() -> list[Orbit]:
    """Follow the orbit from Omega = 0.5 until it leaves the range."""
    found, step = [first_orbit()], 1e-3
    while FROM - 0.01 < found[-1].omega < TO and len(found) < 4000:
        last = found[-1]
        new = corrected(last.point + step * last.tangent, last.tangent)
        if new is None or new.tangent @ last.tangent < 0.98:
            step /= 2
            if step < MIN_STEP:
                break
            continue
        found.append(new)
        step = min(1.3 * step, MAX_STEP)
    return found


def between(one: Orbit, share: float, step: float) -> Orbit:
    """Return the orbit of the curve at a share of the way to the next."""
    if share == 0:
        return one
    return corrected(one.point + share * step * one.tangent, one.tangent)


def bifurcations(orbits: list[Orbit]) -> list[tuple[str, float, np.ndarray]]:
    """Find all crossings of the unit circle on the curve: kind, Omega, multipliers."""
    found = []
    for one, other in pairwise(orbits):
        for kind in PUBLISHED:
            if kind == "fold":
                crosses = one.tangent[-1] * other.tangent[-1] < 0
            else:
                crosses = one.test(kind) * other.test(kind) < 0
            if not crosses:
                continue
            step = float(one.tangent @ (other.point - one.point))

            def value(share, one=one, step=step, kind=kind):
                orbit = between(one, share, step)
                return float(orbit.tangent[-1]) if kind == "fold" else orbit.test(kind)

            at = between(one, brentq(value, 0.0, 1.0, xtol=1e-9), step)
            if kind != "torus" or at.is_torus():
                found.append((kind, at.omega, at.multipliers))
    return found


def greatest_rms(orbits: list[Orbit]) -> tuple[float, float]:
    """Find the greatest rms of x1 on the curve and its Omega."""
    sizes = [orbit.rms(801) for orbit in orbits]
    best = int(np.argmax(sizes))
    before, after = orbits[max(best - 1, 0)], orbits[min(best + 1, len(orbits) - 1)]
    step = float(before.tangent @ (after.point - before.point))
    done = minimize_scalar(
        lambda share: -between(before, share, step).rms(),
        bounds=(0.0, 1.0),
        method="bounded",
        options={"xatol": 1e-7},
    )
    top = between(before, done.x, step)
    return top.rms(16001), top.omega


def main() -> None:
    """Print the bifurcations beside what was published."""
    orbits = curve()
    print(f"{len(orbits)} orbits, Omega up to {max(orbit.omega for orbit in orbits):.6f}")
    for kind, omega, multipliers in bifurcations(orbits):
        near = min(PUBLISHED[kind], key=lambda value: abs(value - omega))
        sizes = " ".join(f"{value:.4f}" for value in multipliers)
        print(f"{kind:16} {omega:.6f}  published {near}  multipliers {sizes}")
    size, omega = greatest_rms(orbits)
    print(f"greatest rms     {size:.6f} at {omega:.6f}  published {GREATEST_RMS} at {AT_OMEGA}")
    best = max(orbits, key=lambda orbit: orbit.rms(801, 0.5))
    print(f"  half the mean's square counted: {best.rms(4001, 0.5):.6f} at {best.omega:.6f}")
    at = [orbit for orbit in orbits if abs(orbit.omega - 0.635) < 0.005]
    for orbit in at:
        print(
            f"P1 at {orbit.omega:.4f}: largest |multiplier| {np.abs(orbit.multipliers).max():.4f}"
        )


if __name__ == "__main__":
    main()
