"""Find points of branches of periodic orbits along the amplitude by compiled kernels."""

from hpcsweep.solvers.flow.orbit.corrector import TRACE, new_trace
from hpcsweep.solvers.flow.orbit.walk import AT_EVENT, MORE, WITH_MULTIPLIERS

BLOCK, BLOCK_SIZE = 64, 2**17
"""Most points of one call, and most numbers that they hold."""


class Tracer:
    """Points of the branches of one period, as `dynamics.continuation.cycle.Solution` has them.

    Parameters
    ----------
    kernels, packed, polling, units, structure
        Of the solver.
    period : int
        p.
    scale, length_unit : float
        Of the amplitude and of the points in y.
    made : callable
        Makes a point of y, tangent, matrices, multipliers, residual, inverse and signature. The
        multipliers are None where the product of the matrices has not their digits, the inverse and
        the signature where they are not known.
    poll : callable or None
        Called before each piece of the work (`polling`).
    spent : callable
        Called with the forcing periods of each.
    """

    def __init__(
        self,
        kernels,
        packed,
        polling,
        units,
        structure,
        period,
        scale,
        length_unit,
        made,
        poll,
        spent,
    ):
        self._kernels, self._shared, self._polling = kernels, packed, polling
        self._made, self._poll, self._spent = made, poll, spent
        kernels.load_measures()
        size = 2 * structure.n_floors
        shape = period, size, len(structure.contacts)
        self._shape = period, size, size
        self._most = min(BLOCK, max(BLOCK_SIZE // (period * size * size), 1))
        own = scale, length_unit / structure.length_unit, units.amplitude_unit
        trace = new_trace(shape, units.size, self._most, own)
        self._trace, self._packed = TRACE.place(trace)

    def solve(self, guess, border, inverse, reached):
        """Find the point on the hyperplane through `guess` across `border`, None if there is none.

        Parameters
        ----------
        guess, border : ndarray, shape (S,)
        inverse : ndarray, shape (S, S), or None
            Of a neighbour.
        reached : float
            Largest last move.
        """
        trace = self._trace
        trace.guess[:], trace.border[:] = guess, border
        if inverse is not None:
            trace.now.inverse[:] = inverse
        found = self._call(self._kernels.solve_point, int(inverse is not None), reached)
        return self._point(found == WITH_MULTIPLIERS) if found else None

    def walk(self, start, last, bend, step, span, room):
        """Take steps as long as nothing happens; see `orbit.walk`.

        Parameters
        ----------
        start, last : Solution
            Beginning of the branch, and the point from which to go on.
        bend : ndarray, shape (S,)
            Turn of the tangent per length there.
        step : float
            Length of the first step.
        span : tuple
            See `walk.SPAN`.
        room : int
            Most points.

        Returns
        -------
        points : list of Solution
            Only the last one with its inverse.
        bend : ndarray, shape (S,)
        step : float
            Of the next step.
        found : Solution or None
            The point to which that leads, if anything happens on the way.
        """
        trace, points, why = self._trace, [], MORE
        self._begin(start, last)
        trace.bend[:] = bend
        begins, known = 1, int(last.inverse is not None)
        while why == MORE and len(points) < room:
            most = min(self._most, room - len(points))
            n_periods = self._polling.begin(self._poll)
            own = self._shared, self._packed, span, step, begins, known, most, n_periods
            why, count, step, n_periods = self._kernels.walk_branch(*own)
            self._end(n_periods)
            points += self._walked(count)
            begins, known = 0, max(known, int(count > 0))
        if points:
            points[-1] = points[-1]._replace(inverse=trace.last.inverse.copy())
        found = self._point(True, True) if why == AT_EVENT else None
        return points, trace.bend.copy(), step, found

    def begin_chord(self, first, last) -> None:
        """Move to the end of the chord between two points, the last one with its inverse."""
        self._begin(first, last)
        self.fraction = 1.0

    def along(self, fraction: float, counts: bool = False):
        """Move to a fraction of the chord.

        Returns
        -------
        tuple or None
            The signature if that is to be counted; else the component of the tangent along the
            parameter and the tests of the multipliers (`dynamics.continuation.events.Tests`). None
            if no point is found, or not its multipliers.
        """
        begins = int(self.fraction == 1.0)
        found = self._call(self._kernels.move_along, fraction, begins, int(counts))
        now, self.fraction, self._found = self._trace.now, fraction, found
        if counts:
            return tuple(now.closings.tolist()) if found else None
        return (float(now.tangent[-1]), *now.tests.tolist()) if found == WITH_MULTIPLIERS else None

    def point(self):
        """Return the point to which a move has led, None if it has failed."""
        return self._point(self._found == WITH_MULTIPLIERS) if self._found else None

    def _call(self, kernel, *rules):
        self._polling.begin(self._poll)
        found, n_periods = kernel(self._shared, self._packed, *rules)
        self._end(n_periods)
        return found

    def _end(self, n_periods: int) -> None:
        self._polling.end(n_periods)
        self._spent(n_periods)

    def _begin(self, start, last) -> None:
        """Write the first point, and the last one, whose inverse may be missing."""
        first, place = self._trace.first, self._trace.last
        first.y[:], first.tangent[:] = start.y, start.tangent
        place.y[:], place.tangent[:] = last.y, last.tangent
        place.matrices[:] = last.maps.matrices.reshape(place.matrices.shape)
        if last.inverse is not None:
            place.inverse[:] = last.inverse

    def _point(self, multipliers: bool, closings: bool = False):
        now = self._trace.now
        return self._made(
            now.y.copy(),
            now.tangent.copy(),
            now.matrices.reshape(self._shape).copy(),
            now.multipliers.copy() if multipliers else None,
            float(now.residual[0]),
            now.inverse.copy(),
            tuple(now.closings.tolist()) if closings else None,
        )

    def _walked(self, count: int) -> list:
        walked = self._trace.walked
        arrays = (each[:count].copy() for each in (walked.y, walked.tangent, walked.matrices))
        y, tangents, matrices = arrays
        return [
            self._made(*each[:5], None, tuple(each[5]))
            for each in zip(
                y,
                tangents,
                matrices.reshape(count, *self._shape),
                walked.multipliers[:count].copy(),
                walked.residual[:count].tolist(),
                walked.closings[:count].tolist(),
                strict=True,
            )
        ]
