"""Cases of `stress`."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from hpcsweep.model.structure import Structure
from stability.hard_structures import hard_structures, made
from stability.random_structures import highest_frequency

LEAST = 100.0
"""Largest ratio of a natural frequency, all contacts closed, to that of the forcing."""
REACH = 3.0
"""Displacement that the forcing of a structure of any kind gives without stops, in its units."""
BATCH = 1000
BATCH_SECONDS = 900.0
"""For a batch: each step of each run of one structure may ask for a new table, up to 10 ms for 50
floors."""


@dataclass(frozen=True)
class Case:
    """One case for a solver.

    Attributes
    ----------
    kind : str
        ``"run"``, ``"reference"``, ``"energy"``, ``"linear"``, ``"random"`` or ``"random, any"``;
        see `answer`.
    group, asked : str
        Descriptions for the reader.
    structure : dict
        Arguments of `made`.
    state : tuple of 2n floats
        Empty: at rest.
    n_periods : int
        Forcing periods; for random runs their number.
    seconds : float
        Time limit.
    complete : bool
        Whether any outcome but COMPLETE is a failure.
    """

    kind: str
    group: str
    asked: str
    structure: dict = field(default_factory=dict)
    omega: float = 0.445
    amplitude: float = 0.1
    state: tuple[float, ...] = ()
    n_periods: int = 3
    solver: str = "flow"
    seed: int = 0
    seconds: float = 60.0
    complete: bool = False


def cases(quick: bool, seed: int) -> Iterator[Case]:
    """Return all cases; the quick ones take less than a minute together on one core."""
    yield from _extremes(quick)
    yield from _at_rest()
    long = 1000 if quick else 10_000
    yield from _grazing(long)
    yield from _energy(long)
    yield from _any_structure(long)
    for k in range(3 if quick else 1000):
        # every third batch has structures of any kind
        kind, group = ("random, any", "any structure") if k % 3 == 2 else ("random", "random runs")
        yield Case(
            kind, group, f"{BATCH} runs, seed {seed}.{k}", n_periods=BATCH,
            seed=seed * 1_000_000 + k, seconds=BATCH_SECONDS,
        )  # fmt: skip


def _extremes(quick):
    values = {
        "stiffness_ratio": (0.0, 1e-9, 1.0, 1e5, 1e7, 1e12),
        "sharpness": (0.0, 1e-6, 1.0, 100.0, 1e6, 1e8, 1e15, math.inf),
        "damping_ratio": (0.0, 1e-12, 1.0, 2.0, 50.0),
        "n_floors": (1, 10, 50, 64),
    }
    base = {"n_floors": 3, "stiffness_ratio": 1000.0, "sharpness": 1e4, "damping_ratio": 0.05}
    for name, list_of in values.items():
        for value in list_of:
            asked = f"{name} = {value:g}"
            yield Case("reference", "structure", asked, {**base, name: value}, 0.5, 1.0)
    for rho in (0.0, 1e4, math.inf):
        hard = {**base, "stiffness_ratio": 1e7, "sharpness": rho}
        yield Case("run", "structure", f"stiffness_ratio = 1e7, sharpness = {rho:g}", hard)
    for omega in (1e-3, 1e-2, 50.0, 1e4):
        periods = 1 if omega < 0.1 else 100
        yield Case("run", "forcing", f"omega = {omega:g}", base, omega, n_periods=periods)
    for amplitude in (0.0, 1e-300, 1e-12, 1e3, 1e12, 1e200):
        asked = f"amplitude = {amplitude:g}"
        yield Case("run", "forcing", asked, base, amplitude=amplitude, n_periods=20)
    for big in (1e6, 1e99, 1e308):
        yield Case("run", "state", f"|z| = {big:g}", base, state=(big,) * 6)
    yield Case("run", "state", "denormal", base, state=(5e-324,) * 6, amplitude=0.0)
    for name, value in (("sharpness", math.inf), ("stiffness_ratio", 1e7), ("n_floors", 10)):
        asked = f"bdf: {name} = {value:g}"
        hard = {**base, name: value}
        periods = 1
        yield Case("reference", "structure", asked, hard, 3.0, 1.0, n_periods=periods, solver="bdf")
    if not quick:
        for solver in ("flow", "bdf"):
            asked = f"{solver}: omega = 1e-3, amplitude = 1e3"
            seconds = 1800.0
            yield Case(
                "run", "forcing", asked, base, 1e-3, 1e3, n_periods=1, solver=solver,
                seconds=seconds,
            )  # fmt: skip


def _at_rest():
    places = (0.0, 1e-16, -1e-16, 5e-324, 1e-9, -1e-9)
    for rho in (0.0, 10.0, 1e4, 1e8, math.inf):
        for place in places:
            structure = {"n_floors": 3, "sharpness": rho, "damping_ratio": 0.0}
            state = (1.0 + place,) * 3 + (0.0, -0.0, place)
            asked = f"all floors at 1 {place:+g}, sharpness = {rho:g}"
            yield Case("reference", "at rest", asked, structure, 2.0, 0.0, state, complete=True)


def _grazing(n_periods):
    for rho in (1e4, math.inf):
        for part in (1 - 1e-2, 1 - 1e-6, 1 - 1e-12, 1 + 1e-12, 1 + 1e-6, 1 + 1e-2):
            structure = Structure(3, 1000.0, rho, 0.05)
            amplitude = part * structure.grazing_amplitude(0.445)
            response = amplitude * structure.linear_steady_state(0.445)
            state = (*response.imag.tolist(), *(0.445 * response.real).tolist())
            kind = "linear" if rho == math.inf and part < 1 else "run"
            asked = f"A/A_grazing - 1 = {part - 1:+.0e}, sharpness = {rho:g}"
            yield Case(
                kind, "grazing orbit", asked, {"sharpness": rho}, 0.445, amplitude, state, n_periods
            )  # fmt: skip


def _energy(n_periods):
    for n, beta, rho in (
        (1, 1000.0, math.inf), (1, 1000.0, 1e4), (2, 1000.0, math.inf), (3, 1000.0, 1e4),
        (3, 1e5, 1e6), (3, 10.0, 50.0), (6, 1e4, math.inf),
    ):  # fmt: skip
        structure = {
            "n_floors": n, "stiffness_ratio": beta, "sharpness": rho, "damping_ratio": 0.0,
        }  # fmt: skip
        state = (*np.linspace(0.5, 0.9, n).tolist(), *np.linspace(1.0, 0.3, n).tolist())
        asked = f"n = {n}, beta = {beta:g}, rho = {rho:g}, {n_periods} periods"
        yield Case("energy", "energy", asked, structure, 1.0, 0.0, state, n_periods)


def _any_structure(n_periods):
    for rho in (1e4, math.inf):
        for name, given in hard_structures(rho):
            structure = made(given)
            omega = max(0.7 * float(structure.frequencies[0]), highest_frequency(structure) / LEAST)
            length = structure.length_unit
            response = np.abs(sum(structure.steady_harmonics(omega)[1])).max()
            amplitude = REACH * length / float(response)
            n = structure.n_floors
            state = 0.8 * length * np.cos(np.arange(2.0 * n))
            state[n:] *= omega
            yield Case(
                "reference", "any structure", f"{name}, sharpness = {rho:g}", given, omega,
                amplitude, tuple(state.tolist()), 1, complete=True,
            )  # fmt: skip
    # two masses that pound, undamped
    for rho in (1e4, math.inf):
        contacts = [((1.0, -1.0), 0.1, 500.0), ((-1.0, 0.3), 0.3, 50.0), ((0.0, -1.0), 0.0, 3.0)]
        given = {
            "mass": [[2.0, 0.3], [0.3, 1.0]], "stiffness": [[2.0, -0.5], [-0.5, 1.0]],
            "contacts": contacts, "sharpness": rho,
        }  # fmt: skip
        asked = f"energy of two that pound, rho = {rho:g}, {n_periods} periods"
        state = (0.5, -0.2, 0.3, 0.4)
        yield Case("energy", "any structure", asked, given, 1.0, 0.0, state, n_periods)
