"""Random states, structures and forcing that are hard for the map of one period, and its error.

`bash benchmarks/run.sh accuracy [--cases N] [--seed S] [--worst K] [--general]
[--certify] [--json FILE]` prints the error of `flow` on N cases, by kind, and the worst ones with
their parameters; `--certify` repeats these in extended precision (the uniform building only).
`--general` takes random structures of any kind (`general`); then the worst ones are those of the
largest error over the conditioning, and are repeated by the reference with steps half as long.
Lengths and speeds are in units of the structure.

Two errors are reported: the plain one (largest coordinate, over max(1, |z|)), and the same over the
conditioning of the case,

    kappa = max over t of ||M(T, t)|| max(1, |z(t)|) / max(1, |z(T)|),

M(T, t) being the tangent map from t to the end of the period. One rounding somewhere along the
path, in any method, becomes an error of kappa 1e-16.
"""

import hpcsweep.commands.one_thread  # noqa: F401  # isort: skip  (before numpy is loaded)
import argparse
import json
import math
from collections import Counter
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path

import numba
import numpy as np
from claims.reading import foreign
from general import (
    GENERAL_KINDS,
    backwards,
    highest_frequency,
    log_uniform,
    random_general_cases,
)
from reference import (
    NO_RECORD,
    ORDER,
    PART_OF_RADIUS,
    horner,
    period,
    reference_points,
    system,
)

from hpcsweep.model.contact import contact_stiffness
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.solver import make_solver

KINDS = (
    "anywhere",
    "slow at the stop",
    "peak in the layer",
    "two floors",
    "three floors",
    "bounce",
)
EPSILON = 2.0**-52
PROBES = 32
"""Columns of the tangent map that are followed: all of 16 rows; beyond, its norm to 12 %."""


@dataclass(frozen=True)
class Case:
    """One period to be integrated; `sharpness` may be inf."""

    kind: str
    beta: float
    rho: float
    zeta: float
    omega: float
    amplitude: float
    state: tuple[float, ...]

    @property
    def structure(self) -> Structure:
        return Structure(len(self.state) // 2, self.beta, self.rho, self.zeta)


def random_case(rng, kind):
    """Draw a case: n 1-6, beta 1-1e5, rho 1e2-1e6 or inf, zeta 0.002-0.3, Omega 0.05-3."""
    least = {"two floors": 2, "three floors": 3}.get(kind, 1)
    n = int(rng.integers(least, 7))
    rho = math.inf if rng.random() < 0.15 else log_uniform(rng, 1e2, 1e6)
    case = Case(
        kind,
        log_uniform(rng, 1.0, 1e5),
        rho,
        log_uniform(rng, 0.002, 0.3),
        log_uniform(rng, 0.05, 3.0),
        log_uniform(rng, 1e-2, 1.0),
        (0.0,) * (2 * n),
    )
    u, v = rng.uniform(-0.5, 0.9, n), rng.uniform(-0.5, 0.5, n)
    if kind == "anywhere":
        return replace(case, state=(*u.tolist(), *v.tolist()))
    width = 1.0 / min(rho, 1e7)
    floors = rng.choice(n, size=least, replace=False)
    tau = float(rng.uniform(0.0, min(2 * math.pi / case.omega, 6.0)))
    if kind == "bounce":
        # leaves the stop, pushed back by the forcing: touches again after 2 |v| / a
        u = rng.uniform(0.9, 0.99, n)
        u[floors] = 1.0
        v[floors] = -log_uniform(rng, 1e-4, 1e-1)
        case = replace(
            case, omega=log_uniform(rng, 0.3, 3.0), amplitude=-log_uniform(rng, 3.0, 20.0)
        )
        tau = float(rng.uniform(0.1, 0.5)) / case.omega
    else:
        for floor in floors:
            if kind == "peak in the layer":
                u[floor] = 1.0 + float(rng.uniform(-1, 1)) * width * log_uniform(rng, 1e-2, 10.0)
                v[floor] = 0.0
            else:
                u[floor] = 1.0 + float(rng.normal()) * 2 * width
                v[floor] = log_uniform(rng, 1e-8, 1e-1) * rng.choice([-1, 1])
    z = np.concatenate((u, v))
    if rng.random() < 0.3 and kind != "bounce":
        return replace(case, state=tuple(z.tolist()))
    start = backwards(case.structure, case.amplitude, case.omega, z, tau)
    return replace(case, state=tuple(start.tolist()))


def random_cases(number, seed=0):
    """Return as many cases of each kind."""
    rng = np.random.default_rng(seed)
    return [random_case(rng, KINDS[k % len(KINDS)]) for k in range(number)]


@numba.njit(cache=True, error_model="numpy")
def adjoint(x, t, h, system, y, d, k, out):
    """Fill A^T (y + d k) at time t of a step with the series x, A of the tangents' equation.

    A = (0, 1; -K, -C) takes y = (p, q) to (-K^T q, p - C^T q); q is left in the second half of k.
    """
    n, m = system.stiffness.shape[0], y.shape[1]
    if system.rho == math.inf:
        t = 0.5 * h  # such a step begins and ends where a distance may be 0
    for i in range(n):
        for c in range(m):
            k[n + i, c] = y[n + i, c] + d * k[n + i, c]
            out[i, c], out[n + i, c] = 0.0, y[i, c] + d * k[i, c]
    for j in range(n):
        for i in range(n):
            stiff, damping = system.stiffness[j, i], system.damping[j, i]
            if stiff != 0.0 or damping != 0.0:
                for c in range(m):
                    out[i, c] -= stiff * k[n + j, c]
                    out[n + i, c] -= damping * k[n + j, c]
    for contact in range(system.gap.shape[0]):
        distance = -system.gap[contact]
        for i in range(n):
            if system.reach[contact, i] != 0.0:
                distance += system.reach[contact, i] * horner(x[i], t)
        stiff = contact_stiffness(distance, 1.0, system.rho)
        if stiff == 0.0:
            continue
        for c in range(m):
            force = 0.0
            for i in range(n):
                force += system.push[contact, i] * k[n + i, c]
            for i in range(n):
                out[i, c] -= system.reach[contact, i] * stiff * force


@numba.njit(cache=True, error_model="numpy")
def before_step(y, series, h, system, fastest):
    """Multiply y by the transposed tangent map of a step of the reference, in place.

    By Runge-Kutta steps from its end to its start: three digits.
    """
    n = system.stiffness.shape[0]
    k1, k2, k3, k4 = np.empty_like(y), np.empty_like(y), np.empty_like(y), np.empty_like(y)
    x = series[:n]
    parts = 4 + int(4 * h * fastest)
    d = h / parts
    for part in range(parts, 0, -1):
        k4[:] = 0.0
        adjoint(x, part * d, h, system, y, 0.0, k4, k1)
        for last, k, back in ((k1, k2, 0.5), (k2, k3, 0.5), (k3, k4, 1.0)):
            adjoint(x, (part - back) * d, h, system, y, back * d, last.copy(), k)
        for i in range(2 * n):
            for c in range(y.shape[1]):
                y[i, c] += d / 6 * (k1[i, c] + 2 * k2[i, c] + 2 * k3[i, c] + k4[i, c])


@numba.njit(cache=True, error_model="numpy")
def largest_tangent(sizes, series, system, fastest, units, probes):
    """max over the starts t of the steps of ||M(T, t)||_F max(1, |z(t)|), in units of the state.

    ||M||_F is that of M^T times the columns g of `probes`: those of the unit matrix; or random ones
    with E g g^T = 1 over their number, of which ||M^T g||^2 is the square of the norm in the mean.
    `fastest` is the highest frequency there is.
    """
    n = system.stiffness.shape[0]
    y = probes.copy()
    for i in range(2 * n):
        y[i] /= units[i]
    worst = 1.0
    for k in range(sizes.shape[0] - 1, -1, -1):
        before_step(y, series[k], sizes[k], system, fastest)
        size = 1.0
        square = 0.0
        for i in range(n):
            size = max(size, abs(series[k, i, 0] + system.offset[i]) / units[i])
            size = max(size, abs(series[k, n + i, 0]) / units[n + i])
        for i in range(2 * n):
            for c in range(y.shape[1]):
                square += (y[i, c] * units[i]) ** 2
        worst = max(worst, size * math.sqrt(square))
    return worst


def probes_of(rows):
    """Return the columns that tell the norm of a map: all of up to `PROBES`, else random ones."""
    if rows <= PROBES:
        return np.eye(rows)
    return np.random.default_rng(0).standard_normal((rows, PROBES)) / math.sqrt(PROBES)


@dataclass(frozen=True)
class Reference:
    """What the Taylor reference says of a case.

    `kappa` is the conditioning, `passages` counts events that make a case hard.
    """

    end: np.ndarray
    kappa: float
    passages: Counter


def refer(case):
    """Integrate a case with the Taylor reference, and look at its steps."""
    arguments = system(case.structure, case.amplitude, case.omega)
    z = np.array(case.state)
    n = z.size // 2
    count = period(z.copy(), *arguments, PART_OF_RADIUS, *NO_RECORD)
    starts, sizes, series = np.empty(count), np.empty(count), np.empty((count, 2 * n, ORDER + 1))
    period(z, *arguments, PART_OF_RADIUS, starts, sizes, series)
    structure, parts = case.structure, arguments[2]
    units = np.array(structure.state_units)
    fastest = _fastest(structure)
    kappa = largest_tangent(sizes, series, parts, fastest, units, probes_of(2 * n))
    passages = Counter(_passages(parts, fastest, units, starts, series))
    return Reference(z, kappa / max(1.0, float(np.abs(z / units).max())), passages)


def _fastest(structure):
    """Highest frequency, with all contacts closed."""
    if not foreign(structure):
        return math.sqrt(4.0 + structure.stiffness_ratio)
    return highest_frequency(structure)


def _passages(parts, fastest, units, starts, series):
    """Name what happens at the starts of the steps."""
    n = series.shape[1] // 2
    x, v = series[:, :n, 0] @ parts.reach.T - parts.gap, series[:, n:, 0] @ parts.reach.T
    inside = np.abs(x) * min(parts.rho, 1e9 / units[0]) < 20.0
    for number in inside.sum(axis=1):
        if number > 1:
            yield "two contacts in the layer" if number == 2 else "three contacts in the layer"
    turns = (v[:-1] * v[1:] < 0) & inside[:-1] & inside[1:]
    yield from ["turn in the layer"] * int(turns.sum())
    yield from ["below 1e-3 in the layer"] * int((inside & (np.abs(v) < 1e-3 * units[-1])).sum())
    for distance in x.T:
        changes = np.flatnonzero(np.diff((distance >= 0).astype(int)))
        gaps = np.diff(starts[changes + 1])
        # the shortest time a linear step takes in contact is about this
        short = gaps < 3.0 / fastest
        yield from ["two changes within a step"] * int(short.sum())


@dataclass(frozen=True)
class Error:
    """Errors of the map of one period; `plain` over max(1, |z|), `scaled` over kappa as well."""

    plain: float
    scaled: float
    kappa: float
    outcome: str


def measure(case, reference=None, rtol=1e-9, name="flow"):
    """Measure the error of a solver on a case."""
    reference = refer(case) if reference is None else reference
    solver = make_solver(name, case.structure, case.omega, rtol)
    points, outcome = solver.points(np.array(case.state), case.amplitude, 1)
    if outcome is not Outcome.COMPLETE:
        return Error(math.inf, math.inf, reference.kappa, outcome.name)
    units = case.structure.state_units
    size = max(1.0, float(np.abs(reference.end / units).max()))
    plain = float(np.abs((points[0] - reference.end) / units).max()) / size
    return Error(plain, plain / reference.kappa, reference.kappa, outcome.name)


def quantiles(values):
    """Median, 90 %, 99 % and the largest, as text."""
    return " ".join(f"{q:8.1e}" for q in np.quantile(values, [0.5, 0.9, 0.99, 1.0]))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--worst", type=int, default=10)
    parser.add_argument("--certify", action="store_true")
    parser.add_argument("--general", action="store_true", help="random structures of any kind")
    parser.add_argument("--rows", type=int, nargs=2, help="fewest and most of general structures")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    make = partial(random_general_cases, rows=options.rows) if options.general else random_cases
    found = []
    for case in make(options.cases, options.seed):
        reference = refer(case)
        found.append((case, reference, measure(case, reference)))
    kinds = GENERAL_KINDS if options.general else KINDS
    print(f"{'':20s} cases | plain error: 50 %, 90 %, 99 %, max    | over kappa")
    for kind in (*kinds, None):
        errors = [error for case, _, error in found if kind in (None, case.kind)]
        plain = quantiles([error.plain for error in errors])
        scaled = quantiles([error.scaled for error in errors])
        print(f"{kind or 'all':20s} {len(errors):5d} | {plain} | {scaled}")
    for limit in (1e-12, 1e-11, 1e-10):
        above = sum(error.plain > limit for _, _, error in found)
        rounding = sum(error.plain > limit + 100 * EPSILON * error.kappa for _, _, error in found)
        scaled = sum(error.scaled > limit for _, _, error in found)
        print(
            f"above {limit:g}: {above}; beyond 100 roundings amplified by kappa: {rounding}; "
            f"over kappa: {scaled}"
        )
    events = sum((Counter(dict.fromkeys(r.passages, 1)) for _, r, _ in found), Counter())
    print("cases with:", dict(events))
    found.sort(key=lambda item: -(item[2].scaled if options.general else item[2].plain))
    rows = []
    for case, reference, error in found[: options.worst]:
        row = {**vars(case), **asdict(error), "end": reference.end.tolist()}
        if options.general:
            row["structure"] = outline(case.structure)
            row["part_error"] = part_error(case, reference)
        if options.certify:
            row.update(certify(case, reference))
        rows.append(row)
        print({key: value for key, value in row.items() if key != "end"}, flush=True)
        if options.json:
            options.json.write_text(json.dumps(rows, indent=1))


def outline(structure):
    """Write what sort of structure it is."""
    kind = "chain" if structure.matrices is None else "matrices"
    return (
        f"{kind}, n = {structure.n_floors}, {len(structure.contacts)} contacts, rho = "
        f"{structure.sharpness * structure.length_unit:.3g} / gap"
    )


def part_error(case, reference):
    """Return by how much the reference changes if its steps are half as long."""
    arguments = case.structure, case.amplitude, case.omega, case.state, 1
    units = case.structure.state_units
    again = reference_points(*arguments, part=0.5 * PART_OF_RADIUS)[0]
    size = max(1.0, float(np.abs(reference.end / units).max()))
    return float(np.abs((again - reference.end) / units).max()) / size


def certify(case, reference):
    """Repeat a case in extended precision: errors of the reference and of `flow`."""
    from extended import points_mp

    exact = points_mp(case.structure, case.amplitude, case.omega, case.state, 1)[0]
    exact = np.array(exact, dtype=float)
    certified = replace(reference, end=exact)
    return {
        "reference_error": float(np.abs(reference.end - exact).max()),
        "flow_error": measure(case, certified).plain,
    }


if __name__ == "__main__":
    main()
