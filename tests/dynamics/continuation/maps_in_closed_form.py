"""Maps whose orbits are known in closed form."""

import numpy as np


class Smooth:
    """What smooth maps have in common."""

    def signature(self, points, value):
        return ()


class Logistic(Smooth):
    """x -> r x (1 - x)"""

    size = 1

    def image(self, x, value):
        return value * x * (1 - x)

    def tangent(self, x, value):
        return self.image(x, value), np.array([[value * (1 - 2 * x[0])]])

    def slope(self, x, value):
        return x * (1 - x)


class Henon(Smooth):
    """(x, y) -> (1 - a x^2 + y, b x), b = 0.3"""

    size, b = 2, 0.3

    def image(self, x, value):
        return np.array([1 - value * x[0] ** 2 + x[1], self.b * x[0]])

    def tangent(self, x, value):
        return self.image(x, value), np.array([[-2 * value * x[0], 1.0], [self.b, 0.0]])

    def slope(self, x, value):
        return np.array([-(x[0] ** 2), 0.0])


class Delayed(Smooth):
    """(x, y) -> (y, r y (1 - x)): a torus is born at r = 2"""

    size = 2

    def image(self, x, value):
        return np.array([x[1], value * x[1] * (1 - x[0])])

    def tangent(self, x, value):
        return self.image(x, value), np.array([[0.0, 1.0], [-value * x[1], value * (1 - x[0])]])

    def slope(self, x, value):
        return np.array([0.0, x[1] * (1 - x[0])])
