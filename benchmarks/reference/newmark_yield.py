"""Five storeys that yield by Newmark's method with return mapping, and by OpenSees if it is there.

`bash benchmarks/run.sh newmark_yield` compares building B of yielding-buildings.toml, alone and
with Rayleigh's damping, under the first record of its suite: average acceleration (1/2 and 1/4) in
steps of a part of the record's, the forces of the bilinear storeys by return mapping, their tangent
by Newton's method within each step. It prints the difference of peak drifts and of lasting drifts
from those of `hpcsweep.response`, the processor time of all steps, and from these the time to an
error of 1 % and of 1e-4. OpenSees (openseespy, with the libraries of its wheel on LD_LIBRARY_PATH)
takes the same steps with Steel01 between nodes. Nothing is shared with hpcsweep but the numbers of
the structure.
"""

import hpcsweep.commands.one_thread  # isort: skip  (before numpy is loaded)
import argparse
import time
from itertools import pairwise

import numpy as np

import hpcsweep
from hpcsweep.solvers.flow.record_map import RecordMap

N, MASS, STIFFNESS, YIELD, HARDENING = 5, 2.5e5, 2e8, 0.016, 0.03
RAYLEIGH = (0.67, 0.00208)
"""alpha, beta: 5 % at 8 and at 40 rad/s."""
PGA = 8.0
PARTS = (1, 2, 4, 8, 16, 32)
"""Steps of a sample interval."""
REPEATS = 50
"""Of the exact response, of which the shortest counts."""
MAX_ITERATIONS, BALANCED = 50, 1e-7
"""Of Newton's method; residual over the weight of a floor under 1 m/s^2."""


def building() -> hpcsweep.Structure:
    """Return the building."""
    storeys = {"mass": MASS, "storey_stiffness": STIFFNESS, "yield_drift": YIELD}
    given = {"hardening": HARDENING, "rayleigh": RAYLEIGH, "gap": np.inf, "sharpness": np.inf}
    return hpcsweep.Structure(N, **storeys, **given)


def drifts_of(u: np.ndarray) -> np.ndarray:
    """Return the storey drifts of displacements of the floors."""
    return np.diff(u, prepend=0.0)


def mapped(drift: np.ndarray, plastic: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return storey forces, tangents and new plastic drifts of bilinear storeys.

    The elastic part alpha k d beside a slider (1 - alpha) k (d - p) of strength (1 - alpha) k d_y:
    a trial force beyond the strength is returned to it, and p follows.
    """
    trial = drift - plastic
    new = np.where(np.abs(trial) > YIELD, drift - np.sign(trial) * YIELD, plastic)
    force = STIFFNESS * (HARDENING * drift + (1.0 - HARDENING) * (drift - new))
    tangent = STIFFNESS * np.where(np.abs(trial) > YIELD, HARDENING, 1.0)
    return force, tangent, new


def assembled(of_storeys: np.ndarray) -> np.ndarray:
    """Return the matrix of storeys of these stiffnesses."""
    steps = np.eye(N) - np.eye(N, k=-1)
    return steps.T @ (of_storeys[:, None] * steps)


def newmark_drifts(samples: np.ndarray, dt: float, part: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the largest drifts at the steps and the plastic drifts at the end, from rest."""
    h, beta_k = dt / part, RAYLEIGH[1] * assembled(np.full(N, STIFFNESS))
    mass, damping = MASS * np.eye(N), RAYLEIGH[0] * MASS * np.eye(N) + beta_k
    at = np.arange((len(samples) - 1) * part + 1) * h
    ground = np.interp(at, np.arange(len(samples)) * dt, samples)
    u, v, a = np.zeros(N), np.zeros(N), np.full(N, -ground[0])
    plastic, peaks = np.zeros(N), np.zeros(N)
    effective: dict[bytes, np.ndarray] = {}
    for acceleration in ground[1:]:
        new = u + h * v + 0.25 * h * h * a
        for _ in range(MAX_ITERATIONS):
            force, tangent, lasting = mapped(drifts_of(new), plastic)
            new_a = 4.0 * (new - u - h * v) / h**2 - a
            new_v = v + 0.5 * h * (a + new_a)
            restoring = force - np.append(force[1:], 0.0)
            out = mass @ (new_a + acceleration) + damping @ new_v + restoring
            if np.abs(out).max() < BALANCED * MASS:
                break
            key = tangent.tobytes()
            if key not in effective:
                whole = assembled(tangent) + 2.0 / h * damping + 4.0 / h**2 * mass
                effective[key] = np.linalg.inv(whole)
            new = new - effective[key] @ out
        else:
            raise ArithmeticError(f"Newton's method does not converge with {part} steps")
        u, v, a, plastic = new, new_v, new_a, lasting
        np.maximum(peaks, np.abs(drifts_of(u)), out=peaks)
    return peaks, plastic


def opensees_drifts(program, samples, dt: float, part: int) -> tuple[np.ndarray, np.ndarray, float]:
    """Return the same by OpenSees, and the time that its steps took; plastic drifts by forces."""
    program.wipe()
    program.model("basic", "-ndm", 1, "-ndf", 1)
    program.node(0, 0.0)
    program.fix(0, 1)
    for i in range(1, N + 1):
        program.node(i, 0.0)
        program.mass(i, MASS)
        program.uniaxialMaterial("Steel01", i, STIFFNESS * YIELD, STIFFNESS, HARDENING)
        program.element("zeroLength", i, i - 1, i, "-mat", i, "-dir", 1, "-doRayleigh", 1)
    program.rayleigh(RAYLEIGH[0], 0.0, RAYLEIGH[1], 0.0)
    program.timeSeries("Path", 1, "-dt", dt, "-values", *samples.tolist())
    program.pattern("UniformExcitation", 1, 1, "-accel", 1)
    for command, words in (("constraints", "Plain"), ("numberer", "Plain"), ("system", "BandGen")):
        getattr(program, command)(words)
    program.test("NormUnbalance", BALANCED * MASS, MAX_ITERATIONS)
    program.algorithm("Newton")
    program.integrator("Newmark", 0.5, 0.25)
    program.analysis("Transient")
    peaks, seconds = np.zeros(N), 0.0
    for _ in range((len(samples) - 1) * part):
        begun = time.process_time()
        done = program.analyze(1, dt / part)
        seconds += time.process_time() - begun
        if done != 0:
            raise ArithmeticError(f"OpenSees does not converge with {part} steps")
        u = np.array([program.nodeDisp(i, 1) for i in range(1, N + 1)])
        np.maximum(peaks, np.abs(drifts_of(u)), out=peaks)
    drift = drifts_of(u)
    force = np.array([program.eleResponse(i, "material", 1, "stress")[0] for i in range(1, N + 1)])
    slider = force - HARDENING * STIFFNESS * drift
    return peaks, drift - slider / ((1.0 - HARDENING) * STIFFNESS), seconds


def time_to(error: float, errors: list[float], seconds: list[float]) -> str:
    """Return the time at which a straight line through log(error) and log(time) passes an error."""
    slope, level = np.polyfit(np.log(errors), np.log(seconds), 1)
    return f"{np.exp(slope * np.log(error) + level):.3g} s"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--parts", type=int, nargs="+", default=PARTS)
    options = parser.parse_args()
    structure = building()
    record = hpcsweep.synthetic_records(1, seed=1, duration=30.0)[0]
    factor = PGA / record.peak
    exact = hpcsweep.response(structure, record, factor)
    solver, spent = RecordMap(structure, record.dt), []
    for _ in range(REPEATS):
        begun = time.process_time()
        solver.respond(record.acceleration, factor)
        spent.append(time.process_time() - begun)
    print(
        f"{record.n_samples} samples of {record.dt:g} s, PGA {PGA:g} m/s^2; hpcsweep: "
        f"{min(spent):.4f} s, ductility {exact.ductility.round(2)}, {exact.excursions.sum()} slips"
    )
    try:
        import openseespylinux.opensees as program
    except (ImportError, RuntimeError) as error:
        print(f"OpenSees is not there: {error}")
        program = None
    samples = factor * record.acceleration
    names = ["Newmark", "OpenSees"][: 1 if program is None else 2]
    tables: dict[str, list[tuple[float, float, float]]] = {name: [] for name in names}
    for part in options.parts:
        line = f"h = dt/{part:<3}"
        for name in names:
            if name == "Newmark":
                begun = time.process_time()
                peaks, lasting = newmark_drifts(samples, record.dt, part)
                took = time.process_time() - begun
            else:
                peaks, lasting, took = opensees_drifts(program, samples, record.dt, part)
            peak = float(np.abs(peaks / exact.drift - 1.0).max())
            size = np.abs(exact.plastic).max()
            last = float(np.abs(lasting - exact.plastic).max() / size)
            tables[name].append((peak, last, took))
            line += f"   {name}: peaks {peak:.2e}, lasting {last:.2e}, {took:.3f} s"
        print(line, flush=True)
    for name, rows in tables.items():
        peak, last, took = (list(column) for column in zip(*rows, strict=True))
        fall = [np.log2(a / b) for a, b in pairwise(last)]
        order = -np.polyfit(np.log(options.parts), np.log(last), 1)[0]
        print(
            f"{name}: lasting drifts fall with h^{order:.2f} (steps of "
            f"{', '.join(f'{one:.1f}' for one in fall)}); peaks to 1 % in "
            f"{time_to(1e-2, peak, took)}, to 1e-4 in {time_to(1e-4, peak, took)}, lasting drifts "
            f"to 1e-4 in {time_to(1e-4, last, took)}; hpcsweep {min(spent):.4f} s"
        )


if __name__ == "__main__":
    main()
