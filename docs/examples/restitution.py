"""Which spring and dashpot give a coefficient of restitution, and what a pressed contact does.

python docs/examples/restitution.py PICTURE.png prints dashpots and what came of a collision, and
draws damping ratios, a ball that falls on two grounds, and its energy, exact and by steps.
"""

import sys

import matplotlib.pyplot as plt
import numpy as np

import hpcsweep

MASS, WEIGHT, HEIGHT = 2.0, 9.81, 0.1  # kg, m/s², m
HARD, SOFT = 5e5, 2e3  # N/m
STEP = 1e-4


def ball(stiffness: float, restitution: float, tension: bool = False) -> hpcsweep.Structure:
    """Return a ball at `HEIGHT` above the ground; x points down from there."""
    given = ([1.0], HEIGHT, stiffness, restitution, [MASS], tension)
    return hpcsweep.Structure.from_matrices(
        [MASS], [[0.0]], [hpcsweep.Contact.from_restitution(*given)]
    )


def rebound(structure: hpcsweep.Structure) -> float:
    """Return the speed after a collision without weight over that before."""
    still = hpcsweep.Record(np.zeros(200), 0.01)
    return -hpcsweep.response(structure, still, state=[0.0, 1.0]).final_state[1]


def fall(structure: hpcsweep.Structure, seconds: float = 1.6):
    """Return the response of a ball that falls, times, heights and energies."""
    steady = hpcsweep.Record(np.full(round(seconds / 0.005) + 1, -WEIGHT), 0.005)
    motion = hpcsweep.history(structure, steady, step=STEP)
    x, v = motion.displacement[:, 0], motion.velocity[:, 0]
    return hpcsweep.response(structure, steady), motion.time, HEIGHT - x, energy(structure, x, v)


def energy(structure: hpcsweep.Structure, x: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return the energy of motion, weight and contact spring."""
    spring = 0.5 * structure.contact_stiffness[0] * np.maximum(x - HEIGHT, 0.0) ** 2
    return 0.5 * MASS * v**2 + MASS * WEIGHT * (HEIGHT - x) + spring


def stepped(structure: hpcsweep.Structure, step: float, seconds: float):
    """Return times, heights and energies by Verlet's method: exact but for where contact begins."""
    stiffness, path = structure.contact_stiffness[0], []
    x, v, pull = 0.0, 0.0, WEIGHT
    for _ in range(round(seconds / step)):
        path.append((x, v))
        x += step * (v + 0.5 * step * pull)
        before, pull = pull, WEIGHT - stiffness * max(x - HEIGHT, 0.0) / MASS
        v += 0.5 * step * (before + pull)
    x, v = np.array(path).T
    return step * np.arange(len(path)), HEIGHT - x, energy(structure, x, v)


def main() -> None:
    """Print and draw."""
    figure, axes = plt.subplots(1, 3, figsize=(12, 3.6), layout="constrained")
    print("     e  dashpot [N s/m]    xi  rebound - e")
    e = np.linspace(0.05, 0.999, 40)
    for tension, label in ((False, "never pulls"), (True, "pulls on the way out")):
        each = [ball(HARD, one, tension) for one in e]
        xi = [b.contact_damping[0] / (2 * np.sqrt(HARD * MASS)) for b in each]
        axes[0].plot(e, xi, label=f"the contact {label}")
        for one in (0.9, 0.7, 0.5, 0.2):
            b = ball(HARD, one, tension)
            c = b.contact_damping[0]
            print(
                f"{one:6g}  {c:15.1f}  {c / (2 * np.sqrt(HARD * MASS)):.3f}  {rebound(b) - one:.0e}"
            )
    axes[0].set(xlabel="coefficient of restitution e", ylabel="c / (2 sqrt(k m))", ylim=(0, None))
    axes[0].legend()
    for name, stiffness, restitution in (("hard", HARD, 0.7), ("soft", SOFT, 0.1)):
        found, time, height, held = fall(ball(stiffness, restitution))
        label = f"{name}, e = {restitution}: impacts {found.impacts[0]}"
        axes[1].plot(time, 100 * height, label=label)
        print(f"{name}: {found.impacts[0]} impacts, energy rises by {np.diff(held).max():.0e} J")
    axes[1].set(xlabel="time [s]", ylabel="height [cm]")
    axes[1].legend()
    elastic = ball(HARD, 1.0)
    _, time, height, held = fall(elastic, 6.0)
    axes[2].plot(time, np.where(height > 0, held, np.nan), "k", label="hpcsweep")
    contact = np.pi * np.sqrt(MASS / HARD)
    for steps in (5, 20):
        time, height, held = stepped(elastic, contact / steps, 6.0)
        free = held[height > 0]
        axes[2].plot(time[height > 0], free, lw=0.8, label=f"{steps} steps a contact")
        print(f"{steps} steps a contact, e = 1: energy up to {free.max() / free[0]:.3f} times")
    axes[2].set(xlabel="time [s]", ylabel="energy between contacts, e = 1 [J]")
    axes[2].legend()
    figure.savefig(sys.argv[1], dpi=90)


if __name__ == "__main__":
    main()
