"""Response to a record by Newmark's method, and by OpenSees where it is there.

`bash benchmarks/run.sh newmark_record` compares peak displacements of the two buildings of
jobs/earthquakes/two-buildings.toml, with Rayleigh's damping, under the first record of the suite,
with those of `hpcsweep.response`: steps of a part of the record's, average acceleration (1/2 and
1/4), the contact a spring that is there or not, found by iteration within each step. It prints the
error and the time of each step, of a program of its own and of OpenSees (openseespy, with its
libraries on LD_LIBRARY_PATH). Nothing is shared with hpcsweep but the numbers of the structure.
"""

import hpcsweep.commands.one_thread  # isort: skip  (before numpy is loaded)
import time
from pathlib import Path

import newmark
import numpy as np

import hpcsweep
from hpcsweep.job import load_job
from hpcsweep.solvers.flow.record_map import RecordMap

JOB = Path(__file__).resolve().parent.parent.parent / "jobs" / "earthquakes" / "two-buildings.toml"
INTENSITY = 8.0
"""Sa(0.78 s), m/s^2."""
PARTS = (1, 2, 4, 8, 16, 32, 64)
"""Steps of a sample interval."""
RAYLEIGH = (0.67, 0.00208)
"""alpha, beta: 5 % at 8 and at 40 rad/s."""
MAX_ITERATIONS = 20


def newmark_peaks(structure, record, scale: float, part: int) -> np.ndarray:
    """Return the largest |u_i| at the steps, from rest, shape (n,).

    u'' and u' at the end of a step h follow from u by average acceleration; the equation of motion
    at its end is linear in u for a given set of closed contacts, which must be those that u closes.
    """
    mass, damping = structure.mass_matrix, structure.damping_matrix
    stiffness, rows = structure.stiffness_matrix, structure.directions
    gaps = np.array([contact.gap for contact in structure.contacts])
    kappa = np.array([contact.stiffness for contact in structure.contacts])
    h = record.dt / part
    inverses: dict[bytes, np.ndarray] = {}
    at = np.arange((record.n_samples - 1) * part + 1) * h
    ground = scale * np.interp(at, record.times, record.acceleration)
    n = len(mass)
    u, v, peaks = np.zeros(n), np.zeros(n), np.zeros(n)
    a = -np.ones(n) * ground[0]
    inertia = -mass @ np.ones(n)
    closed = np.zeros(len(gaps), bool)
    for acceleration in ground[1:]:
        known_a = 4.0 * (u + h * v) / h**2 + a
        for _ in range(MAX_ITERATIONS):
            key = closed.tobytes()
            if key not in inverses:
                contact = rows.T @ np.diag(kappa * closed) @ rows
                whole = stiffness + contact + 2.0 / h * damping + 4.0 / h**2 * mass
                inverses[key] = np.linalg.inv(whole)
            load = inertia * acceleration + mass @ known_a
            load += damping @ (2.0 * u / h + v)
            load += rows.T @ (kappa * closed * gaps)
            new = inverses[key] @ load
            now = rows @ new > gaps
            if (now == closed).all():
                break
            closed = now
        new_a = 4.0 * (new - u - h * v) / h**2 - a
        v = v + 0.5 * h * (a + new_a)
        u, a = new, new_a
        np.maximum(peaks, np.abs(u), out=peaks)
    return peaks


def opensees_peaks(program, structure, record, scale: float, part: int, folder: Path) -> tuple:
    """Return the same by OpenSees, and the time that its steps took."""
    newmark.build(program, structure)
    values = (scale * record.acceleration).tolist()
    program.timeSeries("Path", 1, "-dt", record.dt, "-values", *values)
    program.pattern("UniformExcitation", 1, 1, "-accel", 1)
    file, nodes = folder / f"peaks-{part}.txt", range(structure.n_floors)
    program.recorder("EnvelopeNode", "-file", str(file), "-node", *nodes, "-dof", 1, "disp")
    program.constraints("Plain")
    program.numberer("Plain")
    program.system("FullGeneral")
    program.test("NormUnbalance", 1e-4, 30)
    program.algorithm("Newton")
    program.integrator("Newmark", 0.5, 0.25)
    program.analysis("Transient")
    begun = time.perf_counter()
    done = program.analyze((record.n_samples - 1) * part, record.dt / part)
    seconds = time.perf_counter() - begun
    program.wipe()
    if done != 0:
        raise ArithmeticError(f"no convergence with {part} steps")
    return np.loadtxt(file)[-1], seconds


def main() -> None:
    import tempfile

    study = load_job(JOB).study
    newmark.RAYLEIGH = RAYLEIGH
    structure, record = newmark.with_rayleigh(study.structure), study.record(0)
    factor = float(INTENSITY / study.suite[0].measure)
    solver = RecordMap(structure, record.dt)
    exact = hpcsweep.response(structure, record, factor)
    seconds = []
    for _ in range(20):
        begun = time.perf_counter()
        solver.respond(record.acceleration, factor)
        seconds.append(time.perf_counter() - begun)
    print(
        f"{record.n_samples} samples, {exact.impacts.sum()} impacts; hpcsweep: {min(seconds):.4f} s"
    )
    try:
        import openseespylinux.opensees as program
    except (ImportError, RuntimeError) as error:
        print(f"OpenSees is not there: {error}")
        program = None
    with tempfile.TemporaryDirectory() as folder:
        for part in PARTS:
            own = newmark_peaks(structure, record, factor, part)
            line = f"dt / {part:<3} error {np.abs(own / exact.displacement - 1).max():.2e}"
            if program is not None:
                found, took = opensees_peaks(program, structure, record, factor, part, Path(folder))
                error = np.abs(found / exact.displacement - 1).max()
                line += f"   OpenSees {error:.2e}, {took:.3f} s, {took / min(seconds):.0f} times"
            print(line, flush=True)


if __name__ == "__main__":
    main()
