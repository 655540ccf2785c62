"""Passages of a layer: derivatives of their moments."""

import numpy as np
import pytest

from hpcsweep.kernels.compile import kernel
from hpcsweep.solvers.flow.passage import crossing, tangent


@pytest.mark.parametrize("v", [0.7, -0.7])
def test_derivatives_of_a_passage_are_those_of_its_moments(v):
    @kernel
    def differentiate(v, a, j, beta, rho, out):
        stop = crossing.at_stop(v, a, j, beta, rho)
        free = tangent._differentiated(-1.0, stop)
        contact = tangent._differentiated(1.0, stop)
        found = crossing.sums(free[0], contact[0])
        moments = crossing.since_linear(found, stop)
        for k in range(7):
            out[0, k] = moments[k]
        for row in range(1, 3):
            by_v, by_a = 2.0 - row, row - 1.0
            rates = crossing.sums(
                tangent._rates(free, by_v, by_a), tangent._rates(contact, by_v, by_a)
            )
            rates = crossing.rates_since_linear(found, rates, by_v, stop)
            for k in range(7):
                out[row, k] = rates[k]

    a, j, beta, rho = 3.0, 40.0, 1000.0, 3000.0
    out = np.zeros((3, 7))
    differentiate(v, a, j, beta, rho, out)
    exact = np.array(crossing.moments(v, a, j, beta, rho))
    assert out[0] == pytest.approx(exact, rel=1e-12)
    step = 1e-4
    for row, (dv, da) in enumerate(((step, 0.0), (0.0, step)), start=1):
        ends = [crossing.moments(v + k * dv, a + k * da, j, beta, rho) for k in (1, -1)]
        assert out[row] == pytest.approx(np.subtract(*ends) / (2 * step), rel=2e-5)
