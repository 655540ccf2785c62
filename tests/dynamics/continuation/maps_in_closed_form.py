"""Maps whose orbits are known in closed form."""

import numpy as np


class ByPoint:
    """Images, tangent maps and slopes of points, each by those of one point."""

    def take_round(self, scale, rows, inverse, matrices, rules):
        return None

    def images(self, points, value):
        return np.array([self.image(x, value) for x in points])

    def tangents(self, points, value, by=0):
        matrices = np.array([self.tangent(x, value) for x in points])
        slopes = [[self.slope(x, value, k) for x in points] for k in range(by)]
        slopes = np.moveaxis(np.reshape(slopes, (by, *points.shape)), 0, -1)
        return self.images(points, value), matrices, slopes


class Smooth(ByPoint):
    """What smooth maps have in common."""

    def signature(self, points, value):
        return ()


class Logistic(Smooth):
    """x -> r x (1 - x)"""

    size = 1

    def image(self, x, value):
        return value * x * (1 - x)

    def tangent(self, x, value):
        return np.array([[value * (1 - 2 * x[0])]])

    def slope(self, x, value, k):
        return x * (1 - x)


class Henon(Smooth):
    """(x, y) -> (1 - a x^2 + y, b x), b = 0.3"""

    size, b = 2, 0.3

    def image(self, x, value):
        return np.array([1 - value * x[0] ** 2 + x[1], self.b * x[0]])

    def tangent(self, x, value):
        return np.array([[-2 * value * x[0], 1.0], [self.b, 0.0]])

    def slope(self, x, value, k):
        return np.array([-(x[0] ** 2), 0.0])


class Delayed(Smooth):
    """(x, y) -> (y, r y (1 - x)): a torus is born at r = 2"""

    size = 2

    def image(self, x, value):
        return np.array([x[1], value * x[1] * (1 - x[0])])

    def tangent(self, x, value):
        return np.array([[0.0, 1.0], [-value * x[1], value * (1 - x[0])]])

    def slope(self, x, value, k):
        return np.array([0.0, x[1] * (1 - x[0])])


class HenonPlane(Smooth):
    """(x, y) -> (1 - a x^2 + y, b x) over (a, b)"""

    size = 2

    def image(self, x, value):
        return np.array([1 - value[0] * x[0] ** 2 + x[1], value[1] * x[0]])

    def tangent(self, x, value):
        a, b = value
        return np.array([[-2 * a * x[0], 1.0], [b, 0.0]])

    def slope(self, x, value, k):
        return np.array([[-(x[0] ** 2), 0.0], [0.0, x[0]]])[k]


class Cubic(Smooth):
    """x -> a + b x - x^3 over (a, b): folds at a^2 = 4 ((b - 1) / 3)^3, a cusp at (0, 1)"""

    size = 1

    def image(self, x, value):
        return value[0] + value[1] * x - x**3

    def tangent(self, x, value):
        return np.array([[value[1] - 3 * x[0] ** 2]])

    def slope(self, x, value, k):
        return np.array([[1.0], x])[k]


class SoftImpacts(ByPoint):
    """(x, y) -> (m + a x + c max(x, 0)^(3/2), a y / 2 - x / 3 + (a - 0.3) / 3) over (m, a)

    The first contact is a spring and grazes where x is 0, the second one only watches y.
    """

    size, c = 2, 0.7

    def image(self, x, value):
        m, a = value
        pushed = self.c * max(x[0], 0.0) ** 1.5
        return np.array([m + a * x[0] + pushed, a * x[1] / 2 - x[0] / 3 + (a - 0.3) / 3])

    def tangent(self, x, value):
        a, pushed = value[1], 1.5 * self.c * np.sqrt(max(x[0], 0.0))
        return np.array([[a + pushed, 0.0], [-1 / 3, a / 2]])

    def slope(self, x, value, k):
        return np.array([[1.0, 0.0], [x[0], x[1] / 2 + 1 / 3]])[k]

    def signature(self, points, value):
        return tuple((points > 0.0).sum(axis=0).tolist())
