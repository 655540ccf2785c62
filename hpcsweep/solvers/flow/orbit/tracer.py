"""Find points of branches of periodic orbits along the amplitude by compiled kernels."""

from hpcsweep.solvers.flow.orbit import walk
from hpcsweep.solvers.flow.orbit.corrector import TRACE, new_trace

BLOCK, BLOCK_SIZE = 64, 2**17
"""Most points of one call, and most numbers that they hold."""


class Tracer:
    """Points of the branches of one period, as `dynamics.continuation.cycle.Solution` has them.

    Parameters
    ----------
    own : tuple
        Kernels, packed data, polling, units and structure of the solver.
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

    def __init__(self, own, period, scale, length_unit, made, poll, spent):
        kernels, self._shared, self._polling, units, structure = own
        self._kernels, self._made, self._poll, self._spent = kernels, made, poll, spent
        kernels.load_measures()
        size = 2 * structure.n_floors
        shape = period, size, len(structure.contacts)
        self._shape = period, size, size
        self._most = min(BLOCK, max(BLOCK_SIZE // (period * size * size), 1))
        in_y = scale, length_unit / structure.length_unit, units.amplitude_unit
        trace = new_trace(shape, units.size, self._most, in_y)
        self._trace, self._packed = TRACE.place(trace)

    def solve(self, guess, border, near, reached, keeps):
        """Find the point on the hyperplane through `guess` across `border`, None if there is none.

        The arguments are those of `dynamics.continuation.cycle.Curve.solve`.
        """
        trace, how = self._trace, walk.ALONE
        trace.guess[:], trace.border[:] = guess, border
        if near is not None and near.inverse is not None:
            how = walk.KEEPING if keeps else walk.KNOWN
            trace.now.inverse[:] = near.inverse
        self._polling.begin(self._poll)
        found, n_periods = self._kernels.solve_point(self._shared, self._packed, how, reached)
        self._end(n_periods)
        if found == walk.KEPT:
            return near._replace(y=trace.now.y.copy(), signature=self._closings())
        return self._point(found == walk.WITH_MULTIPLIERS, how == walk.KEEPING) if found else None

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
        trace, points, why = self._trace, [], walk.MORE  # type: ignore[var-annotated]
        self._begin(start, last)
        trace.bend[:] = bend
        begins, known = 1, int(last.inverse is not None)
        while why == walk.MORE and len(points) < room:
            most = min(self._most, room - len(points))
            n_periods = self._polling.begin(self._poll)
            own = self._shared, self._packed, span, step, begins, known, most, n_periods
            why, count, step, n_periods = self._kernels.walk_branch(*own)
            self._end(n_periods)
            points += self._walked(count)
            begins, known = 0, max(known, int(count > 0))
        if points:
            points[-1] = points[-1]._replace(inverse=trace.last.inverse.copy())
        found = self._point(True, True) if why == walk.AT_EVENT else None
        return points, trace.bend.copy(), step, found

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
            self._closings() if closings else None,
        )

    def _closings(self) -> tuple[int, ...]:
        return tuple(self._trace.now.closings.tolist())

    def _walked(self, count: int) -> list:
        walked = self._trace.walked
        arrays = (
            walked.y[:count].copy(),
            walked.tangent[:count].copy(),
            walked.matrices[:count].reshape(count, *self._shape).copy(),
            walked.multipliers[:count].copy(),
            walked.residual[:count].tolist(),
            map(tuple, walked.closings[:count].tolist()),
        )
        return [self._made(*each, None, closings) for *each, closings in zip(*arrays, strict=True)]
