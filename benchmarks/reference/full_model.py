"""A settled orbit of a reduced model, from its file on, against one of all modes.

    bash benchmarks/run.sh full_model [--error E] [--periods N]     needs the extra `fem`

The block of 963 coordinates that ansys-mapdl-reader ships hits a stop at its last node, ten
times as stiff as the block there, at 1.5 times the grazing amplitude. The program reads it, reduces
it to an error E that it states itself and follows it from rest for N periods, timed with warm
kernels.

Independently all modes of the matrices (scipy's dense eigensolver) are followed from rest by the
recurrence that is exact for a force that is linear over a step (Nigam and Jennings, Bulletin of the
Seismological Society of America 59 (1969) 909), the contact's force found with the displacement at
the end of the step. Its error falls as h^2; the steps are halved once to show it. Compared are the
displacements at the stop over the last period, over the largest."""

import argparse
import math
import time
from importlib.util import find_spec
from pathlib import Path

import numba
import numpy as np
from scipy.linalg import eigh

import hpcsweep
from hpcsweep.solvers.trajectory import trajectory

PLACE, BASE, GAP, RATIO = "321.UY", "UY", 1e-3, 0.02
SAMPLES = 400
"""Over the last period."""


def read():
    """Return the model of the file that the library ships."""
    library = find_spec("ansys.mapdl.reader")
    return hpcsweep.read_model(Path(library.origin).parent / "examples" / "file.full")


def all_modes():
    """Return the frequencies, participations and displacements at the stop of all modes."""
    model = read()
    kept = model.mass.diagonal() > 0
    names = np.array(model.names)[kept]
    mass, stiffness = (a.toarray()[np.ix_(kept, kept)] for a in (model.mass, model.stiffness))
    squared, shapes = eigh(stiffness, mass)
    base = np.array([name.endswith(f".{BASE}") for name in names], float)
    return np.sqrt(squared), shapes.T @ mass @ base, shapes[list(names).index(PLACE)]


def recurrence(frequency, h):
    """Return the coefficients of a step of all modes, from state, first and last force to state.

    The state e^{st} decays and turns with s = -zeta omega + i omega_d; the response to a force
    1 - t/h or t/h is the integral of Im e^{s(h - t)} / omega_d times it.
    """
    turning = frequency * math.sqrt(1 - RATIO**2)
    s = -RATIO * frequency + 1j * turning
    step = np.exp(s * h)
    whole, late = (step - 1) / s, (step - 1 - s * h) / (s * s * h)
    return step, (whole - late) / turning, late / turning


@numba.njit
def follow(state, step, first, last, at_stop, base, spring, omega, h, steps):
    """Follow z, Im z = u, for a period; return the displacements at the stop."""
    x, place = np.sum(at_stop * state.imag), np.empty(steps)
    give = np.sum(at_stop * at_stop * last.imag)
    for i in range(steps):
        place[i] = x
        begin, end = math.sin(omega * i * h), math.sin(omega * (i + 1) * h)
        hit, x = spring * max(x - GAP, 0.0), 0.0
        for j in range(len(state)):
            force = (base[j] * begin - at_stop[j] * hit) * first[j] + base[j] * end * last[j]
            state[j] = step[j] * state[j] + force
            x += at_stop[j] * state[j].imag
        if x > GAP:
            hit = spring * (x - GAP) / (1.0 + spring * give)
            x -= give * hit
            for j in range(len(state)):
                state[j] -= at_stop[j] * hit * last[j]
    return place


def last_period(modes, spring, amplitude, omega, periods, steps):
    """Return the displacements at the stop over the last period, from rest."""
    frequency, participation, at_stop = modes
    h = 2 * math.pi / omega / steps
    coefficients = recurrence(frequency, h)
    state, base = np.zeros(len(frequency), complex), -amplitude * participation
    for _ in range(periods):
        motion = follow(state, *coefficients, at_stop, base, spring, omega, h, steps)
    return motion[:: steps // SAMPLES]


def main(words: list[str] | None = None) -> tuple[float, float]:
    """Print the comparison; return the stated and the true error."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--error", type=float, default=1e-3)
    parser.add_argument("--periods", type=int, default=200)
    parser.add_argument("--omega", type=float, default=0.6, help="of the first frequency")
    parser.add_argument("--stop", type=float, default=10.0, help="stiffness, of the block's")
    parser.add_argument("--steps", type=int, default=16_000, help="a period; twice as many at last")
    options = parser.parse_args(words)
    modes = frequency, participation, at_stop = all_modes()
    omega = options.omega * frequency[0]
    spring = options.stop / np.sum((at_stop / frequency) ** 2)
    waved = at_stop * participation / (frequency**2 - omega**2 + 2j * RATIO * frequency * omega)
    amplitude = 1.5 * GAP / abs(np.sum(waved))

    def of_the_program():
        stop = hpcsweep.Contact(PLACE, gap=GAP, stiffness=spring)
        structure = read().structure(
            [stop],
            damping_ratio=RATIO,
            influence=BASE,
            outputs=[PLACE],
            reduce={"error": options.error},
        )
        rest = np.zeros(2 * structure.n_floors)
        points = hpcsweep.stroboscopic_points(
            structure, amplitude, omega, rest, options.periods - 1
        )
        return structure, points[-1]

    of_the_program()
    begin = time.perf_counter()
    structure, state = of_the_program()
    seconds = time.perf_counter() - begin
    motion = trajectory(structure, amplitude, omega, state, SAMPLES + 1)[:-1, 0]
    print(f"{structure.n_floors} rows, stated error {structure.reduction.error:.1e}")
    print(f"from the file to a settled orbit {seconds:.2f} s, {(motion > GAP).mean():.1%} closed")
    for steps in (options.steps, 2 * options.steps):
        whole = last_period(modes, spring, amplitude, omega, options.periods, steps)
        error = np.abs(motion - whole).max() / np.abs(whole).max()
        print(f"error against all {len(frequency)} modes, {steps} steps a period: {error:.2e}")
    return structure.reduction.error, error


if __name__ == "__main__":
    main()
