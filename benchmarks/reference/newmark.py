"""Two buildings that pound, by a finite-element program of earthquake engineering.

`bash benchmarks/run.sh newmark` integrates the structure of jobs/structures/pounding.toml, with
Rayleigh's damping, by OpenSees (openseespy, to be installed beside; it needs the system's BLAS and
LAPACK): average acceleration (Newmark, 1/2 and 1/4) with steps of equal length, springs and stops
as elements between nodes, the ground as a uniform excitation. Nothing is shared with hpcsweep but
the numbers of the structure. Newmark's method is of second order and the contact force continuous,
so that its distance from the exact flow map falls with the square of the step; where in its steps
the contacts begin and end makes single ratios scatter."""

import hpcsweep.commands.one_thread  # noqa: F401  # isort: skip  (before numpy is loaded)
import argparse
import math
from pathlib import Path

import numpy as np

from hpcsweep.job import load_job
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.flow import FlowMap

JOB = Path(__file__).resolve().parent.parent.parent / "jobs" / "structures" / "pounding.toml"
RAYLEIGH = (0.02, 0.05)
"""alpha, beta of alpha M + beta K."""
STEPS = (1000, 2000, 4000, 8000, 16000, 32000, 64000)
"""Of a period."""
FAR = 100.0
"""Reach of the piecewise linear law of a stop, past the stop and before it."""


def with_rayleigh(structure: Structure) -> Structure:
    """Return the structure with Rayleigh's damping in place of its own."""
    kept = structure.matrices
    return Structure.from_matrices(
        kept.mass, kept.stiffness, kept.contacts, rayleigh=RAYLEIGH, drift=kept.drift
    )


def build(program, structure: Structure) -> None:
    """Write the structure as nodes, springs and stops; K must be that of springs."""
    n = structure.n_floors
    program.wipe()
    program.model("basic", "-ndm", 1, "-ndf", 1)
    program.node(n, 0.0)
    program.fix(n, 1)
    for i in range(n):
        program.node(i, 0.0)
        program.mass(i, float(structure.mass_matrix[i, i]))
    number = 0

    def between(i: int, j: int, *more) -> None:
        nonlocal number
        program.element("zeroLength", number, i, j, "-mat", number, "-dir", 1, *more)
        number += 1

    stiffness = structure.stiffness_matrix
    for i in range(n):
        # what the springs to other floors leave of the diagonal leads to the ground
        for j, spring in [(j, -stiffness[i, j]) for j in range(i)] + [(n, stiffness[i].sum())]:
            if abs(spring) > 1e-12:
                program.uniaxialMaterial("Elastic", number, float(spring))
                between(i, j, "-doRayleigh", 1)
    for contact in structure.contacts:
        i, j = contact.direction.index(1.0), contact.direction.index(-1.0)
        # the strain u_j - u_i is -gap at the stop
        strains = (-contact.gap - FAR, -contact.gap, FAR)
        stresses = (-contact.stiffness * FAR, 0.0, 0.0)
        law = ("-strain", *strains, "-stress", *stresses)
        program.uniaxialMaterial("ElasticMultiLinear", number, *law)
        between(i, j)
    program.rayleigh(RAYLEIGH[0], 0.0, RAYLEIGH[1], 0.0)


def points(program, structure, amplitude, omega, n_periods, n_steps) -> np.ndarray:
    """Displacements after each period, from rest, shape (n_periods, n)."""
    build(program, structure)
    period = 2.0 * math.pi / omega
    program.timeSeries("Trig", 1, 0.0, 2.0 * n_periods * period, period, "-factor", amplitude)
    program.pattern("UniformExcitation", 1, 1, "-accel", 1)
    program.constraints("Plain")
    program.numberer("Plain")
    program.system("FullGeneral")
    program.test("NormUnbalance", 1e-11, 30)
    program.algorithm("Newton")
    program.integrator("Newmark", 0.5, 0.25)
    program.analysis("Transient")
    found = []
    for _ in range(n_periods):
        if program.analyze(n_steps, period / n_steps) != 0:
            raise ArithmeticError(f"no convergence with {n_steps} steps")
        found.append([program.nodeDisp(i, 1) for i in range(structure.n_floors)])
    return np.array(found)


def main() -> None:
    import openseespy.opensees as program

    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--amplitude", type=float, default=0.15)
    parser.add_argument("--periods", type=int, default=3)
    options = parser.parse_args()
    job = load_job(JOB)
    structure, omega = with_rayleigh(job.structure), float(job.study.omega[0])
    rest = np.zeros(2 * structure.n_floors)
    seen = FlowMap(structure, omega).observe(rest, options.amplitude, options.periods)
    exact = seen.points[:, : structure.n_floors]
    touch = seen.contact.bit_count()
    print(f"A = {options.amplitude:g}, {options.periods} periods from rest, {touch} contacts touch")
    distances = []
    for n_steps in STEPS:
        found = points(program, structure, options.amplitude, omega, options.periods, n_steps)
        distances.append(float(np.abs(found - exact).max()))
        print(f"{n_steps:6d} steps a period: distance {distances[-1]:.2e}", flush=True)
    order = -np.polyfit(np.log(STEPS), np.log(distances), 1)[0]
    print(f"the distance falls with the step to the power of {order:.2f}")


if __name__ == "__main__":
    main()
