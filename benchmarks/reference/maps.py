"""Maps of the plane whose motion is known from theory, behind the interface of the solvers."""

import math

import numpy as np

from hpcsweep.model.structure import Structure
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.records import Approach, Growth

GOLDEN = (math.sqrt(5) - 1) / 2


class MapSolver:
    """One map; Omega = 2 pi makes T = 1."""

    omega = 2 * math.pi
    structure = Structure(1)

    def __init__(self, step, tangent):
        self.step, self.tangent = step, tangent

    def points(self, state, amplitude, n_periods, poll=None):
        points = np.empty((n_periods, 2))
        z = np.array(state, float)
        for k in range(n_periods):
            z = points[k] = self.step(z)
        return points, Outcome.COMPLETE

    def settle(self, state, amplitude, n_periods, *rules):
        points, outcome = self.points(state, amplitude, n_periods)
        return Approach(points[-1], n_periods, 0, 0, math.nan, outcome)

    def grow(self, state, amplitude, n_periods, poll=None, direction=None):
        points, outcome = self.points(state, amplitude, n_periods)
        vector = np.full(2, math.sqrt(0.5)) if direction is None else direction
        logarithms = np.empty(n_periods)
        for k, z in enumerate([np.asarray(state, float), *points[:-1]]):
            vector = self.tangent(z) @ vector
            length = np.linalg.norm(vector)
            logarithms[k] = math.log(length) if length > 0 else -math.inf
            vector = vector / (length or 1.0)
        return Growth(points, outcome, logarithms, vector)

    def monodromy(self, state, amplitude, n_periods):
        z, matrix = np.array(state, float), np.eye(2)
        for _ in range(n_periods):
            matrix = self.tangent(z) @ matrix
            z = self.step(z)
        return z, matrix

    def images(self, states, amplitude, tangents=False, poll=None):
        if poll is not None:
            poll()
        found = [self.monodromy(z, amplitude, 1) for z in states]
        return np.array([z for z, _ in found]), np.array([matrix for _, matrix in found])


def focus(modulus, turns):
    """A fixed point at (1, 2) with multipliers modulus exp(+-2 pi i turns)."""
    c, s = math.cos(2 * math.pi * turns), math.sin(2 * math.pi * turns)
    matrix = modulus * np.array([[c, -s], [s, c]])
    centre = np.array([1.0, 2.0])
    return MapSolver(lambda z: centre + matrix @ (z - centre), lambda z: matrix)


def logistic(r):
    """x -> r x (1 - x), beside it a coordinate that decays."""
    return MapSolver(
        lambda z: np.array([r * z[0] * (1 - z[0]), 0.3 * z[1]]),
        lambda z: np.array([[r * (1 - 2 * z[0]), 0.0], [0.0, 0.3]]),
    )


def henon(a):
    return MapSolver(
        lambda z: np.array([1 - a * z[0] ** 2 + z[1], 0.3 * z[0]]),
        lambda z: np.array([[-2 * a * z[0], 1.0], [0.3, 0.0]]),
    )


def delayed_logistic(a):
    """x' = a x (1 - y), y' = x: a torus is born at a = 2 (Maynard Smith 1968)."""
    return MapSolver(
        lambda z: np.array([a * z[0] * (1 - z[1]), z[0]]),
        lambda z: np.array([[a * (1 - z[1]), -a * z[0]], [1.0, 0.0]]),
    )


def circle(turns, order, pull):
    """The unit circle attracts; on it theta -> theta + 2 pi turns + pull sin(order theta)."""

    def step(z):
        radius, angle = np.hypot(*z), np.arctan2(z[1], z[0])
        radius, angle = (1 + radius) / 2, angle + 2 * np.pi * turns + pull * np.sin(order * angle)
        return radius * np.array([np.cos(angle), np.sin(angle)])

    def tangent(z):
        radius, angle = np.hypot(*z), np.arctan2(z[1], z[0])
        after = angle + 2 * np.pi * turns + pull * np.sin(order * angle)
        along = 1 + pull * order * np.cos(order * angle)
        c, s, size = np.cos(after), np.sin(after), (1 + radius) / 2
        inwards = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        inwards[1] /= radius
        return np.array([[0.5 * c, -size * s * along], [0.5 * s, size * c * along]]) @ inwards

    return MapSolver(step, tangent)
