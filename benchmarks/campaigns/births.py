"""Births and ends of attractors against a fine sweep: births.py FILE [STEP].

FILE holds attractors along amplitudes (`jobs/attractors/attractors-figure3.toml`). Each identity is
followed from its first amplitude down, and from its last one up, by steps of 1e-5, each from where
the one before ended, until the motion is another one; then with ever smaller steps, to 1e-10. What
it is a little beyond is followed the other way, to see where that sweep comes onto another motion.
So are the two sides of each place where an identity changes its period. At the end

fold
    the largest multiplier goes to 1, with the square root of the amplitude left
doubling, torus
    it goes to -1, or to another place of the unit circle, in proportion to the amplitude left
"""

import sys
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from hpcsweep import open_results
from hpcsweep.dynamics.attractor import Motion
from hpcsweep.dynamics.classify import CLASS_NAMES, contact_name
from hpcsweep.dynamics.classify_motion import classify_motion
from hpcsweep.dynamics.known import distance
from hpcsweep.solvers.solver import make_solver
from hpcsweep.store import job_of

STEP = 1e-5
CYCLES = 20_000
NEAR = 0.02
"""Distance of attractors of one step to the next, in units of the state, above which it jumped."""
FINEST, A_LEVEL = 1e-10, 40
"""Last of the smaller steps, and how many of each are done at most."""
CIRCLE = 0.02
"""Distance from the unit circle within which a multiplier has come to it."""
BEYOND = 10
"""Steps beyond the end at which the next motion is reported."""
ROUND = 300
"""Steps beyond the interval of the file in which a fine sweep looks for the change."""


@dataclass
class Seen:
    """A motion at an amplitude."""

    amplitude: float
    motion: Motion
    contact: int
    multiplier: complex

    def name(self, labels) -> str:
        """Write kind, period and contact set."""
        period = f"P{self.motion.period}" if self.motion.period else CLASS_NAMES[self.motion.kind]
        return f"{period} {contact_name(self.contact, labels)}"


class Fine:
    """A fine sweep of one structure and frequency."""

    def __init__(self, study, frame: int):
        self._settings, self.structure = study.settings, study.structure
        self.omega = float(study.omega[frame])
        self._solver = make_solver("flow", study.structure, self.omega, study.settings.rtol)

    def at(self, amplitude: float, state: np.ndarray) -> Seen:
        """Decide a motion."""
        motion = classify_motion(self._solver, state, amplitude, self._settings, CYCLES)
        seen = self._solver.observe(motion.points[-1], amplitude, motion.period or 200)
        multiplier = complex("nan")
        if motion.period:
            _, matrix = self._solver.monodromy(motion.points[-1], amplitude, motion.period)
            values = np.linalg.eigvals(matrix)
            multiplier = complex(values[np.abs(values).argmax()])
        return Seen(amplitude, motion, int(seen.contact), multiplier)

    def same(self, one: Seen, other: Seen) -> bool:
        """Return whether two motions, a step apart, are one attractor of one period."""
        units = self.structure.state_units
        far = distance(one.motion.points / units, other.motion.points / units)
        return far <= NEAR and one.motion.period == other.motion.period

    def follow(self, first: Seen, step: float, most: int) -> tuple[list[Seen], Seen | None]:
        """Follow a motion until it is another one: all of it, and what it then is."""
        own = [first]
        for k in range(1, most + 1):
            amplitude = first.amplitude + k * step
            if amplitude < 0:
                break
            now = self.at(amplitude, own[-1].motion.points[-1])
            if not self.same(own[-1], now):
                return own, now
            own.append(now)
        return own, None


def refined(fine: Fine, last: Seen, step: float) -> list[Seen]:
    """Come nearer to the end of a motion: the last of each smaller step."""
    lasts = [last]
    while abs(step) > FINEST * 1.5:
        step *= 0.1
        own, _ = fine.follow(lasts[-1], step, A_LEVEL)
        lasts.append(own[-1])
    return lasts


def verdict(mu: complex) -> str:
    """Name the bifurcation by the multiplier at the end."""
    if not abs(mu) >= 1 - CIRCLE:
        return "multiplier inside"
    if abs(mu.imag) > CIRCLE:
        return "torus"
    return "fold" if mu.real > 0 else "doubling"


def law(lasts: list[Seen]) -> float:
    """Power with which 1 - |mu| falls with the amplitude left: 1/2 at a fold, 1 at a doubling."""
    end = lasts[-1].amplitude
    left = np.array([abs(end - one.amplitude) for one in lasts[:-1]])
    gone = np.array([1 - abs(one.multiplier) for one in lasts[:-1]])
    good = (left > 10 * FINEST) & (gone > 1e-9)
    if good.sum() < 3:
        return float("nan")
    return float(np.polyfit(np.log(left[good]), np.log(gone[good]), 1)[0])


def events(results) -> list[tuple[int, str, int, int, int]]:
    """Return what the file shows: identity, event, slot, amplitude before, and step of place."""
    ids, period = results["attractor_id"].values, results["orbit_period"].values
    found = []
    for number in np.unique(ids[ids > 0]).tolist():
        places = np.argwhere(ids == number)
        first, last = places[0], places[-1]
        if first[0] > 0:
            found.append((number, "born", int(first[1]), int(first[0]), -1))
        for one, two in pairwise(places):
            if period[tuple(one)] != period[tuple(two)]:
                found.append((number, "changes", int(one[1]), int(one[0]), 1))
                found.append((number, "changes", int(two[1]), int(two[0]), -1))
        if last[0] < len(ids) - 1:
            found.append((number, "ends", int(last[1]), int(last[0]), 1))
    return found


def main(path: str, step: float) -> None:
    """Print the table."""
    study = job_of(path).study
    labels = study.structure.contact_labels
    print(
        "| identity | in the file | motion | fine sweep: to | multiplier there | power | "
        "event | beyond | the other way: to |\n|---|---|---|---:|---:|---:|---|---|---|"
    )
    for frame in range(study.omega.size):
        results, fine = open_results(path).isel(direction=0, omega=frame), Fine(study, frame)
        amplitudes = results["amplitude"].values
        for number, event, slot, place, way in events(results):
            coarse = abs(float(amplitudes[place + way] - amplitudes[place]))
            begin = float(amplitudes[place])
            first = fine.at(begin, results["point"].values[place, slot])
            own, after = fine.follow(first, way * step, round(coarse / step) + ROUND)
            ends = sorted((begin, float(amplitudes[place + way])))
            reported = (
                f"| {number} | {event} {ends[0]:.4f} .. {ends[1]:.4f} | {first.name(labels)} | "
            )
            if after is None:
                print(f"{reported}not found | | | | | |")
                continue
            lasts = refined(fine, own[-1], way * step)
            end = lasts[-1]
            beyond = fine.at(end.amplitude + BEYOND * way * step, after.motion.points[-1])
            other, onto = fine.follow(beyond, -way * step, len(own) + ROUND)
            returned = "stays" if onto is None else f"{other[-1].amplitude:.5f}, then "
            returned += "" if onto is None else onto.name(labels)
            mu = end.multiplier
            shown = f"{mu.real:.4f}" if abs(mu.imag) < 1e-9 else f"{mu:.3f}"
            inside = ends[0] - step <= end.amplitude <= ends[1] + step
            print(
                f"{reported}{end.amplitude:.9f}{'' if inside else ' (outside)'} | {shown} | "
                f"{law(lasts):.2f} | {verdict(mu)} | {beyond.name(labels)} | {returned} |",
                flush=True,
            )


if __name__ == "__main__":
    main(sys.argv[1], float(sys.argv[2]) if len(sys.argv) > 2 else STEP)
