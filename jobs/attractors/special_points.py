"""Special points of branches, each beside a stable part, against long integrations.

`python jobs/attractors/special_points.py FILE` takes a file of branches along A. At a distance D of
A to either side of a fold, doubling, torus or grazing, 1e-4 or as far as its neighbours on the
branch leave room for,

- a motion beside a stable orbit must stay, and one beside an unstable orbit, or beyond a fold,
  where there is none, must leave;
- at a grazing the contacts must close as much more often after it as the branch says, counted by
  scipy's DOP853.

It prints how many points of each kind agree, and each that does not.
"""

import sys
from collections import Counter
from typing import Any

import numpy as np

import hpcsweep
from hpcsweep.dynamics.continuation.events import Kind
from hpcsweep.dynamics.continuation.periodic import Orbit
from hpcsweep.job import parse_job

PERIODS, SAME, KICK, NEAR = 20_000, 1e-6, 1e-7, 1e-5
FARTHEST, ROOM, LEAST, MIRRORED = 1e-4, 0.4, 1e-8, 1e-12


class Line:
    """The branches of one line of a file."""

    def __init__(self, results: Any, line: int):
        self.structure = parse_job(results.attrs["job"], "job", "job").structure
        self.omega = float(results["omega"].values[line])
        run = results.isel(direction=0, line=line, amplitude=0)
        self.run = {name: run[name].values for name in run.data_vars if run[name].ndim}

    def room(self, special: int) -> float:
        """Return the distance in A at which a special point is tested."""
        own = self.run["special_branch"] == self.run["special_branch"][special]
        away = np.abs(self.run["special_value"][own] - self.run["special_value"][special])
        # the same point of the mirror image differs by rounding
        return min(FARTHEST, ROOM * away[away > MIRRORED].min(initial=np.inf))

    def beside(self, special: int, way: int) -> tuple[float, np.ndarray, bool]:
        """Return A, a state near the orbit, and whether it is stable, on one side of a point."""
        run, at = self.run, float(self.run["special_value"][special])
        step = int(run["special_step"][special])
        if way < 0 or run["special_kind"][special] == Kind.FOLD:
            step += way
        value, state, room = at, run["special_point"][special], self.room(special)
        steady = bool(run["stable"][step])
        while run["step_branch"][step] == run["special_branch"][special]:
            here = float(run["value"][step])
            if abs(here - at) >= room:
                share = (room - abs(value - at)) / (abs(here - at) - abs(value - at))
                return (
                    value + share * (here - value),
                    state + share * (run["point"][step] - state),
                    steady,
                )
            value, state, step = here, run["point"][step], step + way
        raise ArithmeticError("the branch ends beside it")

    def stays(self, amplitude: float, state: np.ndarray, period: int, near: float = NEAR) -> bool:
        """Return whether a motion that begins beside a state is an orbit there in the end."""
        points = hpcsweep.stroboscopic_points(
            self.structure, amplitude, self.omega, state + KICK, PERIODS
        )
        again = np.abs(points[-period:] - points[-2 * period : -period]).max() < SAME
        return bool(again and np.abs(points[-period:] - state).max(axis=1).min() < near)

    def closings(self, found: Orbit) -> int:
        """Count the closings of contacts along an orbit."""
        return sum(one.closes for one in found.signature)

    def crosses(self, special: int) -> bool:
        """Return whether another branch crosses on the same step: at a pitchfork a branch turns."""
        run = self.run
        step = run["special_step"] == run["special_step"][special]
        return bool((step & (run["special_kind"] == Kind.BRANCH_POINT)).any())

    def agrees(self, special: int) -> bool | None:
        """Return whether integrations agree with a special point, None if they cannot tell."""
        run, kind = self.run, Kind(self.run["special_kind"][special])
        period = int(run["branch_period"][run["special_branch"][special] - 1])
        try:
            sides = [self.beside(special, way) for way in (-1, 1)]
            known = kind is not Kind.BRANCH_POINT and self.room(special) >= LEAST
            known &= not (kind is Kind.FOLD and self.crosses(special))
            if not known or not any(steady for _, _, steady in sides):
                return None
            orbits = [
                hpcsweep.orbit(self.structure, amplitude, self.omega, state, period)
                for amplitude, state, _ in sides
            ]
        except ArithmeticError:
            return None
        if kind is Kind.GRAZING:
            before, after = (self.closings(one) for one in orbits)
            return after - before == run["change"][special]
        checks = [
            self.stays(amplitude, one.points[0], period) == one.stable
            for (amplitude, _, _), one in zip(sides, orbits, strict=True)
        ]
        if kind is Kind.FOLD:
            state = run["special_point"][special]
            beyond = 2.0 * float(run["special_value"][special]) - sides[0][0]
            near = min(np.abs(one.points - state).max(axis=1).min() for one in orbits)
            checks.append(not self.stays(beyond, state, period, near))
        return all(checks)


def compare(path: str) -> tuple[Counter, list[str]]:
    """Return how many points of each kind agree or do not, and those that do not."""
    results = hpcsweep.open_results(path)
    agreed: Counter[tuple[str, bool]] = Counter()
    others = []
    for number in range(results.sizes["line"]):
        line = Line(results, number)
        for special in np.flatnonzero(line.run["special_kind"]).tolist():
            kind = Kind(line.run["special_kind"][special]).name.lower()
            agrees = line.agrees(special)
            if agrees is not None:
                agreed[kind, agrees] += 1
            if agrees is False:
                at, branch = (line.run[f"special_{name}"][special] for name in ("value", "branch"))
                others.append(f"{kind} at A = {at:.10g} of branch {branch}")
    return agreed, others


def main(path: str) -> None:
    """Print the counts, and the points that disagree."""
    agreed, others = compare(path)
    for kind in sorted({name for name, _ in agreed}):
        print(f"{kind}: {agreed[kind, True]} of {agreed[kind, True] + agreed[kind, False]}")
    print("\n".join(others))


if __name__ == "__main__":
    main(sys.argv[1])
