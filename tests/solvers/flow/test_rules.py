"""Rules of integration and series, each exact for what it should be."""

import math

import numpy as np
import pytest
from numpy.polynomial import chebyshev

from hpcsweep.solvers.flow.layer.passage import crossing
from hpcsweep.solvers.flow.rules import tableau
from hpcsweep.solvers.flow.state.tables import economisation


def test_gauss_rule_integrates_polynomials_against_the_fermi_weight():
    # int_0^inf y^(k+1) / (1 + e^y) dy = (1 - 2^-(k+1)) Gamma(k + 2) zeta(k + 2)
    zeta = {2: math.pi**2 / 6, 4: math.pi**4 / 90, 6: math.pi**6 / 945}
    for k in (0, 2, 4):
        exact = (1 - 2.0 ** -(k + 1)) * math.gamma(k + 2) * zeta[k + 2]
        assert crossing.WEIGHTS @ crossing.NODES**k == pytest.approx(exact, rel=1e-13)
    assert pytest.approx(crossing.WEIGHTS.sum(), rel=1e-13) == crossing.FULL_POTENTIAL


def test_collocation_is_exact_for_the_polynomials_it_should_be():
    for degree in range(tableau.N_STAGES):
        powers = tableau.NODES**degree
        assert tableau.STAGES @ powers == pytest.approx(
            tableau.NODES ** (degree + 1) / (degree + 1)
        )
    for degree in range(2 * tableau.N_STAGES):
        assert tableau.WEIGHTS @ tableau.NODES**degree == pytest.approx(1 / (degree + 1), rel=1e-13)


def test_the_rule_that_checks_a_layer_step_sees_what_the_gauss_rule_misses():
    def difference(degree):
        values = tableau.CHECK_GAUSS @ tableau.NODES**degree + tableau.CHECK_START * 0.0**degree
        return values + tableau.CHECK_ADDED @ tableau.CHECK_NODES**degree

    for degree in range(2 * tableau.N_STAGES):
        assert abs(difference(degree)) < 1e-14
    degree = 2 * tableau.N_STAGES
    missed = 1 / (degree + 1) - tableau.WEIGHTS @ tableau.NODES**degree
    assert difference(degree) == pytest.approx(missed, rel=1e-4)  # 2e-10, of terms of 1
    # displacements at its nodes from accelerations c^k: c^(k + 2) / ((k + 1) (k + 2))
    for degree in range(tableau.N_STAGES):
        exact = tableau.CHECK_NODES ** (degree + 2) / ((degree + 1) * (degree + 2))
        assert tableau.NODES**degree @ tableau.CHECK_ROWS == pytest.approx(exact, abs=1e-15)


def test_economisation_is_that_of_chebyshev_series_to_the_last_bit():
    found = economisation(30, 15)
    for k in range(31):
        series = chebyshev.poly2cheb(np.eye(31)[k])[:16]
        kept = chebyshev.cheb2poly(np.pad(series, (0, 16 - len(series))))
        assert found[k].tolist() == np.pad(kept, (0, 16 - len(kept))).tolist()
