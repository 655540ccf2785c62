"""A search for impacts of rigid stops that the flow does not see, or that are none.

`bash benchmarks/run.sh rigid_grazing [--cases N] [--seed S]` takes random structures of 1 to 6
masses that begin anywhere, and puts a stop 1e-4 to 1e-13 of the size of the motion before or behind
the largest distance that it reaches in a forcing period, by its closed form: sums of exponentials,
in 64 bits of mantissa. The stop is struck if and only if it is before, and first with the speed of
the closed form there.
"""

import hpcsweep.commands.one_thread  # noqa: F401  # isort: skip  (before numpy is loaded)
import argparse
import math

import numpy as np
from rigid import random_case
from scipy.linalg import eigh

from hpcsweep.model.matrices import Contact
from hpcsweep.model.observed import IMPACT
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.flow import FlowMap

LOOKS = 400
"""In a period, to bracket where the distance is largest."""
PLACES = 10.0 ** -np.arange(4, 14)


class Free:
    """d . u of a motion that touches nothing: sum of Re(c exp(s t)), with damping in modes."""

    def __init__(self, case, row, z):
        mass, damping, stiffness, *_, push, omega, amplitude, harmonics = case
        squares, modes = eigh(stiffness, mass)
        n, half = len(mass), 0.5 * np.einsum("ij,ik,kj->j", modes, damping, modes)
        own = -half + 1j * np.sqrt((squares - half**2).astype(complex))
        forced = np.zeros((2, n))
        rates, terms = [], []
        for order, share, phase in harmonics:
            w = order * omega
            field = amplitude * share * (modes.T @ push) / (squares - w * w + 2j * half * w)
            field = field * np.exp(1j * phase) / 1j  # sin(a) = Re(exp(i a) / i)
            forced += field.real, (1j * w * field).real
            rates.append(1j * w)
            terms.append(row @ modes @ field)
        q, p = (modes.T @ mass @ part for part in np.split(z, 2))
        q, p = q - forced[0], p - forced[1]
        weights = row @ modes
        for k in range(n):
            rates += [own[k], own[k].conj()]
            free = (p[k] - own[k].conj() * q[k]) / (own[k] - own[k].conj())
            terms += [weights[k] * free, weights[k] * free.conj()]
        self.rates = np.array(rates, np.clongdouble)
        self.terms = np.array(terms, np.clongdouble)

    def __call__(self, t, order=0):
        """Return the derivative of an order at times t."""
        grown = np.exp(np.multiply.outer(np.asarray(t, np.longdouble), self.rates))
        return (grown @ (self.terms * self.rates**order)).real

    def highest(self, period):
        """Return where it is largest within a period, None if at an end."""
        t = np.linspace(0.0, period, LOOKS)
        best = int(np.argmax(self(t)))
        if best in (0, LOOKS - 1):
            return None
        at = np.longdouble(t[best])
        for _ in range(8):
            at -= self(at, 1) / self(at, 2)
        return at if abs(at - t[best]) < 2 * t[1] else None


def misses(case, rng) -> list[tuple[float, bool, float]] | None:
    """Return of stops before and behind: their places, whether one is missed, error of speeds."""
    mass, damping, stiffness, rows, *_, omega, amplitude, harmonics = case
    z = rng.normal(size=2 * len(mass))
    free = Free(case, rows[0], z)
    top, listed = free.highest(2 * math.pi / omega), []
    if top is None or free(top) < 0.1:
        return None
    size, bend = max(1.0, float(np.abs(z).max())), -free(top, 2)
    for place in PLACES:
        for behind in (1.0, -1.0):
            gap = float(free(top) + behind * place * size)
            stop = [Contact(tuple(rows[0]), gap, math.inf, restitution=float(rng.random()))]
            structure = Structure.from_matrices(
                mass, stiffness, stop, damping=damping, harmonics=harmonics
            )
            seen = FlowMap(structure, omega).observe(z, amplitude, 1, measures=IMPACT)
            struck, above = seen.measures.impacts[0] > 0, float(free(top) - gap)
            error = math.nan
            if above > 0.0 and round(seen.measures.impacts[0]) == 1:
                at = top - np.sqrt(2 * above / bend)
                for _ in range(8):
                    at -= (free(at) - gap) / free(at, 1)
                if at <= 0:
                    continue
                speed = float(free(at, 1))
                error = abs(seen.measures.impact_velocity[0] - speed) * speed  # w dw = a dx
            listed.append((place, bool(struck != (above > 0.0)), error))
    return listed


def main() -> None:
    """Search, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    rng, found = np.random.default_rng(given.seed), []
    while len(found) < given.cases:
        found += misses(random_case(int(rng.integers(2**31))), rng) or []
    print("| from the largest distance | stops | missed, or none | error of w^2 / 2 |")
    print("|---|---|---|---|")
    for place in PLACES:
        those = [one for one in found if one[0] == place]
        error = np.nanmax([one[2] for one in those])
        print(f"| {place:.0e} | {len(those)} | {sum(one[1] for one in those)} | {error:.1e} |")
    raise SystemExit(any(one[1] for one in found))


if __name__ == "__main__":
    main()
