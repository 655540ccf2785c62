"""Sliders that degrade by OpenSees: their laws along paths, and Newmark's method against its step.

`bash benchmarks/run.sh newmark_degrading [--paths N] [--steps N]` takes IMKBilin, IMKPeakOriented
and IMKPinching of OpenSees (openseespy, with the libraries of its wheel on LD_LIBRARY_PATH) along
random cyclic paths in small steps, beside the reference's law. They are compared up to where their
rules are others: IMKBilin where the residual is reached, and without deterioration (its slope after
capping changes at each excursion); the two others where a slider has no energy left (they go on
undamaged), or comes from beyond its largest elongation (they take a slope below 0). Then a storey
with IMKPinching, a zeroLength element, moves under a record by average acceleration (1/2 and 1/4)
in steps of a part of the record's, and exactly, against the reference: largest drift, drift at the
end, largest force, and work.
"""

import hpcsweep.commands.one_thread  # isort: skip  (before numpy is loaded)
import argparse
import math

import numpy as np
from degrading import FLAT, LINE, RULES, advance, fresh, integrate, jit, law, work
from random_degrading import random_backbone, random_path, slider_of

import hpcsweep

NAMES = dict(zip(RULES, ("IMKBilin", "IMKPeakOriented", "IMKPinching"), strict=True))
NEVER = 1e12
"""Ultimate elongation, and Lambda, of what has none."""
STOREY = {"stiffness": 110.0, "strength": 1.6, "theta_p": 0.03, "theta_pc": 0.2,
          "hardening": 0.03, "rule": "pinching", "Lambda": 1.0, "kappa_f": 0.3,
          "kappa_d": 0.4}  # fmt: skip
"""Of the mass 1: a period of 0.6 s."""
DAMPING, PGA = 0.05, 5.0
PARTS, STEPS = (1, 2, 4, 8, 16, 32, 64), (10, 100, 1000, 10000, 50000)


def material(program, tag: int, given: dict) -> None:
    """Add a material of OpenSees with the numbers of a backbone."""
    k, f = given["stiffness"], given["strength"]
    capping = 1.0 + given.get("hardening", 0.0) * k * given["theta_p"] / f
    half = (given["theta_p"], given["theta_pc"], given.get("theta_u", NEVER), f, capping,
            given.get("residual", 0.0))  # fmt: skip
    energy = given.get("Lambda", NEVER)
    energies = [energy] * 3 if given["rule"] == "bilinear" else [energy, energy, NEVER, energy]
    kappas = [given["kappa_f"], given["kappa_d"]] if given["rule"] == "pinching" else []
    ones = [1.0] * (len(energies) + 2)
    name = NAMES[given["rule"]]
    program.uniaxialMaterial(name, tag, k, *half, *half, *energies, *ones, *kappas)


@jit
def alike(p, path, last):
    """Return the forces of the law until it comes to a piece from `last` on, and how many."""
    m, y, out = fresh(p), 0.0, np.empty(len(path))
    log = [(0.0, 0.0)]
    for j, new in enumerate(path):
        log.clear()
        out[j] = advance(p, m, y, new, log)
        for piece, _ in log:
            if piece >= LINE and not (piece == LINE and last == FLAT):
                return out, j
            if last == FLAT and piece == FLAT:
                return out, j
        y = new
    return out, len(path)


def along_paths(program, rule: str, seed: int, steps: int) -> tuple[float, bool]:
    """Return the largest difference of forces along a path, and whether it was cut."""
    rng = np.random.default_rng([RULES.index(rule), seed])
    given = random_backbone(rng, rule, float(rng.uniform(1.0, 20.0)))
    given.pop("theta_u", None)
    if rule == "bilinear":
        given.pop("Lambda", None)
    turns = np.append(0.0, random_path(rng, given))
    path = np.linspace(turns[:-1], turns[1:], steps + 1)[1:].T.ravel()
    forces, count = alike(law(**given), path, FLAT if rule == "bilinear" else LINE)
    program.wipe()
    material(program, 1, given)
    program.testUniaxialMaterial(1)
    worst = 0.0
    for y, f in zip(path[:count].tolist(), forces.tolist(), strict=False):
        program.setStrain(y)
        worst = max(worst, abs(program.getStress() - f))
    return worst / given["strength"], count < len(path)


def stepped(program, samples: np.ndarray, dt: float, part: int) -> tuple[float, ...]:
    """Return the largest drift, that at the end, the largest force and the work by OpenSees."""
    program.wipe()
    program.model("basic", "-ndm", 1, "-ndf", 1)
    for node in (0, 1):
        program.node(node, 0.0)
    program.fix(0, 1)
    program.mass(1, 1.0)
    material(program, 1, STOREY)
    program.uniaxialMaterial("Viscous", 2, 2.0 * DAMPING * math.sqrt(STOREY["stiffness"]), 1.0)
    program.element("zeroLength", 1, 0, 1, "-mat", 1, 2, "-dir", 1, 1)
    program.timeSeries("Path", 1, "-dt", dt, "-values", *samples.tolist())
    program.pattern("UniformExcitation", 1, 1, "-accel", 1)
    for command, words in (("constraints", "Plain"), ("numberer", "Plain"), ("system", "BandGen")):
        getattr(program, command)(words)
    program.test("NormUnbalance", 1e-10, 100)
    program.algorithm("Newton")
    program.integrator("Newmark", 0.5, 0.25)
    program.analysis("Transient")
    y = f = done = peak = most = 0.0
    for _ in range((len(samples) - 1) * part):
        if program.analyze(1, dt / part) != 0:
            raise ArithmeticError(f"OpenSees does not converge with {part} steps")
        new = program.nodeDisp(1, 1)
        push = program.eleResponse(1, "material", 1, "stress")[0]
        done += 0.5 * (f + push) * (new - y)
        y, f, peak, most = new, push, max(peak, abs(new)), max(most, abs(push))
    return peak, y, most, done


def known(samples: np.ndarray, dt: float) -> tuple[tuple[float, ...], int]:
    """Return the same by the reference, and the number of its events."""
    one = np.eye(1)
    laws = np.array([law(**STOREY)])
    damping = 2.0 * DAMPING * math.sqrt(STOREY["stiffness"]) * one
    z, (m,), log, (drift, most), _ = integrate(
        *(one, 0.0 * one, damping, one, laws, np.zeros((0, 3)), samples, dt), 2000, np.inf
    )
    return (drift[0], z[0], most[0], work(m, z[0])), len(log)


def ours(record: hpcsweep.Record) -> tuple[float, ...]:
    """Return the same by the program."""
    structure = hpcsweep.Structure.from_matrices(
        *([1.0], [[0.0]], ()),
        damping_ratio=DAMPING,
        sliders=[slider_of((1.0,), STOREY)],
        collapse_drift=1e3,
    )
    seen = hpcsweep.response(structure, record, PGA / record.peak)
    (force,), (plastic,) = seen.final_slider_force, seen.plastic
    y = seen.final_state[0]
    work = seen.slider_energy[0] + 0.5 * force * (y - plastic)
    return seen.storey_drift[0], y, seen.slider_force[0], work


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--paths", type=int, default=60)
    parser.add_argument("--steps", type=int, nargs="+", default=STEPS, help="between turns")
    parser.add_argument("--parts", type=int, nargs="+", default=PARTS)
    options = parser.parse_args()
    try:
        import openseespylinux.opensees as program
    except (ImportError, RuntimeError) as error:
        print(f"OpenSees is not there: {error}")
        return
    print("| steps | law | largest difference of forces | of half | cut |")
    print("|---:|---|---:|---:|---:|")
    for steps in options.steps:
        for rule, name in NAMES.items():
            rows = [along_paths(program, rule, j, steps) for j in range(options.paths)]
            found, cut = np.array(rows).T
            told = f"{max(found):.1e} | {np.median(found):.1e} | {int(cut.sum())}"
            print(f"| {steps:,} | {name} | {told} |", flush=True)
    record = hpcsweep.synthetic_records(1, seed=1, duration=20.0)[0]
    samples = PGA / record.peak * record.acceleration
    truth, events = known(samples, record.dt)
    print(f"{record.n_samples} samples of {record.dt:g} s, {events} events; largest and last "
          f"drift, largest force, work: {np.round(truth, 6)}")  # fmt: skip
    print("| step | largest drift | drift at the end | largest force | work |")
    print("|---|---:|---:|---:|---:|")
    scale = np.abs([truth[0], truth[0], truth[2], truth[3]])
    for part in (*options.parts, None):
        told = ours(record) if part is None else stepped(program, samples, record.dt, part)
        cells = " | ".join(f"{one:.1e}" for one in np.abs(np.array(told) - truth) / scale)
        name = "hpcsweep" if part is None else f"$\\Delta t / {part}$"
        print(f"| {name} | {cells} |", flush=True)


if __name__ == "__main__":
    main()
