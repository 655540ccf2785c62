"""Random storeys that degrade under random records, against a reference.

`bash benchmarks/run.sh random_degrading [--cases N] [--first N] [--parts N] [RULE ...]` draws
structures of 1 to 5 storeys, each with a backbone of the rule, from mild loading to the loss of
storeys, with elastic springs beside them, none, or weights that take a part of them, under noise
or pulses. Printed are the largest differences of drifts, forces, energies and times of lost
strength, over their scale, and in how many cases there are other slips, losses or ends. `--paths`
compares forces along random cyclic paths, `--self` the reference with itself at half its step and,
by their u at the end, with central differences (the median of these); `--short` draws records of 8
to 30 samples.
"""

import hpcsweep.commands.one_thread  # isort: skip  (before numpy is loaded)
import argparse
import sys
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from degrading import FLAT, HARD, KU, LOST, RULES, follow, force, integrate, law, plain, work

import hpcsweep

LIMIT = 60.0
"""Drift that ends a motion, over the largest one of yielding."""


class Case(NamedTuple):
    """A structure of storeys, the numbers of its backbones and a record."""

    mass: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray
    backbones: list[dict]
    stops: np.ndarray
    samples: np.ndarray
    dt: float
    limit: float

    @property
    def rows(self) -> np.ndarray:
        return np.eye(len(self.mass)) - np.eye(len(self.mass), k=-1)


def random_backbone(rng, rule: str, stiffness: float) -> dict:
    """Return the numbers of a backbone."""
    drift = float(rng.uniform(0.02, 0.3))
    given = {
        "stiffness": stiffness,
        "strength": stiffness * drift,
        "theta_p": drift * float(rng.uniform(0.3, 5.0)),
        "theta_pc": drift * float(rng.uniform(1.0, 15.0)),
        "residual": float(rng.uniform(0.02, 0.5)) if rng.random() < 0.5 else 0.0,
        "hardening": float(rng.uniform(0.0, 0.1)) if rng.random() < 0.8 else 0.0,
        "rule": rule,
    }
    if rng.random() < 0.4:
        given["theta_u"] = drift * float(rng.uniform(2.0, 25.0))
    if rng.random() < 0.75:
        given["Lambda"] = drift * float(10.0 ** rng.uniform(0.3, 2.5))
    if rule == "pinching":
        given["kappa_f"] = float(rng.uniform(0.05, 0.95))
        given["kappa_d"] = float(rng.uniform(0.0, 0.95))
    return given


def random_case(rule: str, seed: int, short: bool = False, beside_stops: bool = False) -> Case:
    """Draw a case."""
    rng = np.random.default_rng([RULES.index(rule), seed])
    n = int(rng.integers(1, 6))
    mass = rng.uniform(0.5, 2.0, n)
    rows = np.eye(n) - np.eye(n, k=-1)
    springs = rng.uniform(1.0, 8.0, n) * (1.0 + np.arange(n)[::-1])
    backbones = [random_backbone(rng, rule, float(k)) for k in springs]
    beside = rng.choice(3)
    share = (np.zeros(n), rng.uniform(0.0, 0.1, n), -rng.uniform(0.0, 0.05, n))[beside]
    elastic = (rows.T * (share * springs)) @ rows
    initial = (rows.T * springs) @ rows
    damping = rng.uniform(0.0, 0.05) * initial + rng.uniform(0.0, 0.1) * np.diag(mass)
    own = np.sqrt(np.linalg.eigvalsh(initial / np.sqrt(np.outer(mass, mass)))[[0, -1]])
    dt = float(rng.uniform(0.3, 1.5) / own[1])
    count = int(rng.integers(8, 30)) if short else int(rng.integers(30, 120))
    t = dt * np.arange(count)
    if rng.random() < 0.5:
        samples = rng.standard_normal(count)
    else:
        samples = np.zeros(count)
        for _ in range(int(rng.integers(1, 4))):
            period, begin = 2 * np.pi / own[0] * rng.uniform(0.3, 2.0), rng.uniform(0, 0.6) * t[-1]
            turns = np.clip((t - begin) / period, 0.0, 2.0)
            samples += rng.standard_normal() * np.sin(2 * np.pi * turns)
    least = min(one["strength"] / mass[j:].sum() for j, one in enumerate(backbones))
    samples *= least * 10.0 ** rng.uniform(-0.3, 1.0) / max(np.abs(samples).max(), 1e-3)
    limit = LIMIT * max(one["strength"] / one["stiffness"] for one in backbones)
    stops = np.zeros((0, n + 2))
    if beside_stops:
        gap, kappa = limit / LIMIT * rng.uniform(0.5, 4.0), springs[0] * rng.uniform(0.5, 5.0)
        stops = np.array([[*(np.eye(n)[rng.integers(n)] * rng.choice((-1, 1))), gap, kappa]])
    return Case(np.diag(mass), elastic, damping, backbones, stops, samples, dt, limit)


class Seen(NamedTuple):
    """What a motion leaves in its storeys, the end that it has (NaN: none), how often they slip."""

    drift: np.ndarray
    peak_force: np.ndarray
    final_force: np.ndarray
    plastic: np.ndarray
    energy: np.ndarray
    lost: np.ndarray
    end: float
    slips: tuple
    state: np.ndarray


def slips_of(log, count: int) -> tuple[int, ...]:
    """Return how often each slider comes to the backbone."""
    found, last = [0] * count, [0] * count
    for _, j, piece, _ in log:
        found[j] += HARD <= piece <= FLAT and not HARD <= last[j] <= FLAT
        last[j] = piece
    return tuple(found)


def reference_of(case: Case, parts: int) -> Seen:
    """Return what the reference leaves."""
    laws = np.array([law(**one) for one in case.backbones])
    given = np.linalg.inv(case.mass), case.stiffness, case.damping, case.rows, laws, case.stops
    z, memories, log, largest, end = integrate(*given, case.samples, case.dt, parts, case.limit)
    y = case.rows @ z[: len(case.mass)]
    forces = np.array([force(m, one) for m, one in zip(memories, y, strict=True)])
    lost = np.full(len(y), np.nan)
    for t, j, piece, _ in log:
        if piece == LOST:
            lost[j] = t
    back = forces / memories[:, KU]
    spent = [work(m, one) for m, one in zip(memories, y, strict=True)] - 0.5 * forces * back
    return Seen(*largest, forces, y - back, spent, lost, end, slips_of(log, len(y)), z)


def slider_of(direction, given: dict) -> hpcsweep.Slider:
    """Return a slider by the numbers of its backbone."""
    shape = {name: value for name, value in given.items() if name not in ("stiffness", "strength")}
    backbone = hpcsweep.Backbone(**shape)
    return hpcsweep.Slider(direction, given["stiffness"], given["strength"], backbone=backbone)


def exact(case: Case) -> tuple[Seen, float]:
    """Return what the program leaves, and its balance of energies."""
    structure = hpcsweep.Structure.from_matrices(
        *(case.mass, case.stiffness, [hpcsweep.Contact(d, g, k) for *d, g, k in case.stops]),
        damping=case.damping,
        drift=case.rows,
        sliders=[slider_of(*one) for one in zip(case.rows, case.backbones, strict=True)],
        collapse_drift=case.limit,
    )
    seen = hpcsweep.response(structure, hpcsweep.Record(case.samples, case.dt), energy=True)
    return Seen(
        *(seen.storey_drift, seen.slider_force, seen.final_slider_force, seen.plastic),
        *(seen.slider_energy, seen.strength_lost, seen.collapse_time),
        *(tuple(seen.excursions.tolist()), seen.final_state),
    ), seen.energy.balance


def differences(one: Seen, other: Seen) -> tuple[float, ...]:
    """Return those of drifts, forces, energies and times, and whether what happens differs."""
    drift = max(one.drift.max(), np.abs(one.plastic).max(), 1e-300)
    force = max(one.peak_force.max(), 1e-300)

    def most(*names):
        return max(np.abs(getattr(one, name) - getattr(other, name)).max() for name in names)

    times = [np.append(seen.lost, seen.end) for seen in (one, other)]
    return (
        most("drift", "plastic") / drift,
        most("peak_force", "final_force") / force,
        most("energy") / drift / force,
        np.nanmax(np.abs(times[0] - times[1]), initial=0.0),
        one.slips != other.slips or (np.isnan(times[0]) != np.isnan(times[1])).any(),
    )


def by_itself(case: Case, parts: int) -> tuple[float, ...]:
    """Return the differences of the reference at half its step, and of central differences."""
    found = reference_of(case, parts)
    laws = np.array([law(**one) for one in case.backbones])
    given = np.linalg.inv(case.mass), case.stiffness, case.damping, case.rows, laws, case.samples
    u = plain(*given, case.dt, parts)
    free = reference_of(case._replace(limit=np.inf), parts)
    away = np.abs(u - free.state[: len(u)]).max() / free.drift.max()
    return (*differences(found, reference_of(case, parts // 2)), away)


def random_path(rng, backbone: dict) -> np.ndarray:
    """Return elongations at which a path turns: at random, or of cycles that grow."""
    count, unit = int(rng.integers(6, 40)), backbone["strength"] / backbone["stiffness"]
    if rng.random() < 0.5:
        return unit * 10.0 ** rng.uniform(0.0, 1.0) * np.cumsum(rng.standard_normal(count))
    growing = np.linspace(1.0, rng.uniform(2.0, 15.0), count) * rng.uniform(0.7, 1.0, count)
    return unit * growing * (-1.0) ** np.arange(count)


def random_paths(rule: str, seed: int) -> float:
    """Return the largest difference of forces along a path between random elongations."""
    rng = np.random.default_rng([RULES.index(rule), seed])
    backbone = random_backbone(rng, rule, float(rng.uniform(1.0, 20.0)))
    turns = random_path(rng, backbone)
    path = np.concatenate([np.linspace(a, b, 6)[1:] for a, b in pairwise(turns)])
    found = follow(law(**backbone), path)[0]
    return np.abs(slider_of((1.0,), backbone).path(path) - found).max() / backbone["strength"]


def main() -> int:
    """Compare random cases, print the table; return 1 if what happens differs in one."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("rules", nargs="*", default=RULES, metavar="RULE")
    for name, value in ("--cases", 200), ("--first", 0), ("--parts", 2000):
        parser.add_argument(name, type=int, default=value)
    for name in "--paths", "--self", "--short":
        parser.add_argument(name, action="store_true")
    asked = parser.parse_args()
    seeds, others = range(asked.first, asked.first + asked.cases), 0
    last = "central" if asked.self else "balance"
    print(f"rule           drift    force   energy    time  {last}  other  lost  ended")
    for rule in asked.rules:
        if asked.paths:
            found = [random_paths(rule, seed) for seed in seeds]
            print(f"{rule:13s} forces of {len(seeds)} paths to {max(found):.1e}")
            continue
        rows, lost, ended = [], 0, 0
        for seed in seeds:
            case = random_case(rule, seed, asked.short)
            if asked.self:
                rows.append(by_itself(case, asked.parts))
            else:
                seen, balance = exact(case)
                known = reference_of(case, asked.parts)
                rows.append((*differences(seen, known), abs(balance)))
                lost += not np.isnan(known.lost).all()
                ended += not np.isnan(known.end)
            if rows[-1][4] or max(rows[-1][:3]) > 1e-6:
                told = " ".join(f"{one:.1e}" for one in rows[-1])
                print(f"  {rule} {seed}: {told}", flush=True)
        worst = np.max(np.array(rows, float), axis=0)
        if asked.self:
            worst[5] = np.median([row[5] for row in rows])
        count = sum(bool(row[4]) for row in rows)
        others += count
        told = " ".join(f"{worst[j]:8.1e}" for j in (0, 1, 2, 3, 5))
        print(f"{rule:13s} {told} {count:5d} {lost:5d} {ended:6d}", flush=True)
    return int(others > 0)


if __name__ == "__main__":
    sys.exit(main())
