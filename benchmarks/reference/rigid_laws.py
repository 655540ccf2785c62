r"""Laws of rigid stops by their closed forms: energy, momentum, a ball on a table, bifurcations.

`bash benchmarks/run.sh rigid_laws [--impacts N]` prints a table. Energies and momenta are those of
masses without forcing whose stops have e = 1, over up to a million impacts: free ones, two balls in
a box of which one strikes the other; the same with springs between them; and a chain with walls.

A ball that a table throws, u'' = 1 + Gamma sin, strikes it once in n periods with the same speed if
its flight takes n T, which makes the speed of departure that of `thrown`, and what it rebounds with
is no more and no less than that. The gain is lowest where the phase of the impact is pi, where it
is 0 at Gamma = pi n (1 - e) / (1 + e). It is found by the program's motions, and its sign at all
phases below and above.

An oscillator's orbit with one impact in n periods, or at each of two stops in a period, follows
from linear equations for its speed w and the phase of the impact, and its multipliers from
`hpcsweep.model.rigid`, with those of half the period where both are struck (Shaw and Holmes,
*J. Sound Vib.* 90, 129; Shaw, *J. Sound Vib.* 99, 199). Where one is -1 the period doubles,
or the symmetry breaks: by the flow's tangent maps, and by `hpcsweep.branch`.
"""

import hpcsweep.commands.one_thread  # isort: skip  (before numpy is loaded)
import argparse
import math
from itertools import product

import numpy as np
from scipy.linalg import expm
from scipy.optimize import brentq

import hpcsweep
from hpcsweep.model.matrices import Contact
from hpcsweep.model.observed import IMPACT
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.flow import FlowMap

BOX = (((-1, 1, 0), 0.5), ((1, -1, 0), 0.5), ((-1, 0, 1), 0.4), ((1, 0, -1), 0.6))
WALLS = (((1, 0, 0), 0.2), ((-1, 0, 0), 0.3), ((1, -1, 0), 0.1), ((0, 0, 1), 0.3))
SPRINGS = np.array([[1.5, -1.5, 0.0], [-1.5, 3.0, -1.5], [0.0, -1.5, 1.5]])
MASS = np.array([1.0, 0.3, 2.0])
KEPT = {
    "free masses in a box": (BOX, 0.0 * SPRINGS),
    "springs between them": (BOX, SPRINGS),
    "a chain with walls": (WALLS, SPRINGS + np.diag([1.0, 0.0, 0.0])),
}


def kept(stops, stiffness, most: float) -> list[tuple[float, float, float]]:
    """Return at powers of ten of impacts their number, and errors of energy and momentum."""
    contacts = [Contact(tuple(map(float, d)), g, math.inf, restitution=1.0) for d, g in stops]
    structure = Structure.from_matrices(MASS, stiffness, contacts, damping=0.0 * stiffness)
    solver, z = FlowMap(structure, 2 * math.pi / 100), np.array([0, 0, 0, 0.3, 1.0, -0.4])

    def told(z):
        u, v = np.split(z, 2)
        return 0.5 * (MASS @ v**2 + u @ stiffness @ u), MASS @ v

    # with springs M^-1 K moves them by the rounding of where they are: not away
    z[3:] -= MASS @ z[3:] / MASS.sum() * (1.0 if stiffness.any() else 0.999)
    (energy, momentum), impacts, listed = told(z), 0.0, []
    while impacts < most:
        seen = solver.observe(z, 0.0, 10, measures=IMPACT)
        z, before = seen.points[-1], impacts
        impacts += round(10 * seen.measures.impacts.sum())
        if math.log10(impacts) // 1 > math.log10(max(before, 1.0)) // 1 or impacts >= most:
            now = told(z)
            size = (MASS * np.abs(z[3:])).sum()
            listed.append((impacts, now[0] / energy - 1.0, (now[1] - momentum) / size))
    return listed


def gain(e: float, n: int, gamma: float, phase: float) -> float | None:
    """Return what the speed of departure has lost after an impact; None if it strikes again.

    The motion begins half a period after an impact, and ends there n periods later.
    """
    omega = 2 * math.pi

    def thrown(t):
        """Return u and u' a time t after an impact at a phase, of a flight of n periods."""
        turned, speed = omega * t + phase, -0.5 * n - gamma / omega * math.cos(phase)
        turning = gamma / omega**2 * (np.sin(turned) - math.sin(phase))
        u = (speed + gamma / omega * math.cos(phase) + 0.5 * t) * t - turning
        return u, speed + gamma / omega * (math.cos(phase) - np.cos(turned)) + t

    if not (thrown(np.linspace(1e-3, n - 1e-3, 400))[0] < 0.0).all():
        return None
    stop = [Contact((1.0,), 0.0, math.inf, restitution=e)]
    forcing = ((0, 1.0, math.pi / 2), (1, gamma, math.pi + phase))
    structure = Structure.from_matrices([1.0], [[0.0]], stop, damping=[[0.0]], harmonics=forcing)
    start = np.array(thrown(0.5))
    seen = FlowMap(structure, omega).observe(start, -1.0, n, measures=IMPACT)
    return start[1] - seen.points[-1, 1] if round(n * seen.measures.impacts[0]) == 1 else None


def table(e: float, n: int) -> tuple[float, bool]:
    """Return the error of the least Gamma, and whether orbits exist above it and not below."""
    least = math.pi * n * (1 - e) / (1 + e)
    found = brentq(lambda gamma: gain(e, n, gamma, math.pi), 0.9 * least, 1.1 * least, xtol=1e-15)
    phases = np.linspace(0.0, 2 * math.pi, 61)

    def gains(factor):
        those = (gain(e, n, factor * least, phase) for phase in phases)
        return [one for one in those if one is not None]

    below, above = max(gains(1.0 - 1e-6)), max(gains(1.0 + 1e-6))
    return abs(found / least - 1.0), below < 0.0 < above


def orbit(omega, zeta, gap, e, amplitude, both, root):
    """Return w, sine and cosine of the phase of an impact, and the map of its tangent vectors."""
    way = -1.0 if both else 1.0
    span = 2 * math.pi / omega * (0.5 if both else 1.0)
    b = field_of(omega, zeta, amplitude)
    flow = expm(b * span)[:2]  # of (gap, -e w, s, c) to way (gap, w)
    left = np.column_stack((-e * flow[:, 1] - [0.0, way], flow[:, 2:]))
    one = np.linalg.lstsq(left, [way * gap, 0.0] - flow[:, 0] * gap)[0]
    null = np.linalg.svd(left)[2][-1]
    null *= math.copysign(1.0, null[0])
    half = null[1:] @ one[1:] / (null[1:] @ null[1:])
    rest = (one[1:] @ one[1:] - 1.0) / (null[1:] @ null[1:])
    w, s, c = one + (root * math.sqrt(half * half - rest) - half) * null
    before = -gap - 2 * zeta * w - amplitude * s
    after = -gap + 2 * zeta * e * w - amplitude * s
    jump = np.array([[-e, 0.0], [(after + e * before) / w, -e]])
    return w, s, c, way * jump @ expm(b[:2, :2] * span)


def field_of(omega, zeta, amplitude):
    """Return the matrix of (x, x', sin, cos)."""
    b = np.zeros((4, 4))
    b[0, 1], b[1, :3] = 1.0, (-1.0, -2 * zeta, -amplitude)
    b[2, 3], b[3, 2] = omega, -omega
    return b


BIFURCATIONS = {  # omega, zeta, gap, e, whether both stops, between these amplitudes
    "one stop, period doubled": [
        (0.9, 0.05, 0.5, 0.3, False, 0.18, 0.2),
        (2.3, 0.05, 0.5, 0.3, False, 2.7, 2.85),
        (2.5, 0.0, 0.1, 0.3, False, 1.3, 1.4),
    ],
    "two stops, symmetry broken": [
        (0.85, 0.0, 1.0, 0.2, True, 0.5, 0.56),
        (1.9, 0.0, 1.0, 0.2, True, 5.0, 5.2),
        (2.8, 0.0, 1.0, 0.2, True, 8.6, 9.0),
    ],
}


def begun(omega, zeta, gap, e, both, amplitude) -> np.ndarray:
    """Return the state of the orbit where a forcing period begins."""
    w, s, c, _ = orbit(omega, zeta, gap, e, amplitude, both, 1.0)
    left, span = (-math.atan2(s, c) / omega) % (2 * math.pi / omega), math.pi / omega
    z, later = np.array([gap, -e * w, s, c]), both and left > span
    z = expm(field_of(omega, zeta, amplitude) * (left - span * later)) @ z
    return (-1.0 if later else 1.0) * z[:2]


def bifurcation(omega, zeta, gap, e, both, low, high) -> tuple[float, float, set]:
    """Return how far off it is by tangent maps of the flow, by a branch, and what that tells."""
    case = omega, zeta, gap, e, both

    def beyond(amplitude):
        matrix = orbit(omega, zeta, gap, e, amplitude, both, 1.0)[3]
        return 1.0 + np.trace(matrix) + np.linalg.det(matrix)

    def beyond_by_flow(amplitude):
        matrix = solver.monodromy(begun(*case, amplitude), amplitude, 1)[1]
        return np.linalg.det(matrix - (1.0 if both else -1.0) * np.eye(2))

    rows = ((1.0,), (-1.0,)) if both else ((1.0,),)
    stops = [Contact(row, gap, math.inf, restitution=e) for row in rows]
    structure = Structure.from_matrices([1.0], [[1.0]], stops, damping_ratio=zeta)
    solver, exact = FlowMap(structure, omega), brentq(beyond, low, high, xtol=1e-15)
    by_flow = brentq(beyond_by_flow, low, high, xtol=1e-15)
    state = begun(*case, low)
    found = hpcsweep.branch(structure, low, omega, state, 1, span=(0.9 * low, high))
    errors = np.abs(found.special_value.values / exact - 1.0)
    kinds = hpcsweep.meanings(found.special_kind).values[errors < 1e-6]
    return abs(by_flow / exact - 1.0), float(errors.min(initial=math.inf)), set(kinds.tolist())


def main() -> None:
    """Measure, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--impacts", type=float, default=1e6)
    given = parser.parse_args()
    print("| e = 1 | impacts | energy | momentum |\n|---|---|---|---|")
    for name, (stops, stiffness) in KEPT.items():
        for impacts, energy, momentum in kept(stops, stiffness, given.impacts):
            told = f"{momentum:.1e}" if stops is BOX else "walls take it"
            print(f"| {name} | {impacts:.0f} | {energy:.1e} | {told} |", flush=True)
    print("\n| closed form | cases | error | holds |\n|---|---|---|---|")
    those = [table(e, n) for e, n in product((0.2, 0.5, 0.8, 0.95), range(1, 5))]
    holds = f"{sum(holds for _, holds in those)} exist above, not below"
    print(f"| ball on a table, least Gamma | {len(those)} | {max(those)[0]:.1e} | {holds} |")
    for name, cases in BIFURCATIONS.items():
        found = [bifurcation(*case) for case in cases]
        kinds = ", ".join(sorted(set().union(*(one[2] for one in found))))
        holds = f"`branch` tells {kinds}, within {max(one[1] for one in found):.1e}"
        print(f"| {name} | {len(found)} | {max(one[0] for one in found):.1e} | {holds} |")


if __name__ == "__main__":
    main()
