"""Branches of orbits with rigid impacts: grazings, folds, the end of chatter; closed forms."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose
from rigid import Rigid
from scipy.linalg import expm
from scipy.optimize import brentq

import hpcsweep
from hpcsweep import Contact, Structure

ZETA, GAP = 0.05, 0.2


def one(e: float) -> Structure:
    stop = Contact((1.0,), GAP, math.inf, restitution=e)
    return Structure.from_matrices([1.0], [[1.0]], [stop], damping_ratio=ZETA)


def followed(e: float, amplitude: float, omega: float, parameter: str, span: tuple):
    structure = one(e)
    point = hpcsweep.stroboscopic_points(structure, amplitude, omega, [0.0, 0.0], 400)[-1]
    return hpcsweep.branch(structure, amplitude, omega, point, 1, parameter, span)


def grazing(omega: float) -> float:
    return GAP * abs(1.0 - omega**2 + 2j * ZETA * omega)


def fold(e: float, omega: float) -> float:
    """Least A of orbits with one impact: with it (w, A sin, A cos) of the impact is on a line."""
    b = np.zeros((4, 4))
    b[:2, :2], b[1, 2] = [[0.0, 1.0], [-1.0, -2 * ZETA]], -1.0
    b[2, 3], b[3, 2] = omega, -omega
    flow = expm(b * 2 * math.pi / omega)
    left = np.column_stack((-e * flow[:2, 1] - [0.0, 1.0], flow[:2, 2:]))
    particular = np.linalg.lstsq(left, [GAP, 0.0] - flow[:2, 0] * GAP, rcond=None)[0][1:]
    null = np.linalg.svd(left)[2][-1][1:]
    return float(np.linalg.norm(particular - particular @ null / (null @ null) * null))


def kinds(branch) -> list:
    return hpcsweep.meanings(branch.special_kind).values.tolist()


def test_a_branch_passes_a_grazing_and_goes_on_with_impacts():
    branch = followed(0.8, 0.01, 2.3, "amplitude", (0.005, 1.0))
    assert kinds(branch) == ["grazing"]
    assert branch.attrs["begins"] == branch.attrs["ends"] == "end of the span"
    assert_allclose(branch.special_value, grazing(2.3), rtol=1e-12)
    impacts = branch.value.values > grazing(2.3)
    assert (branch.contact.values == impacts).all()
    # the product of multipliers is that of the flow times e^2, the largest like 1 / w there
    product = math.exp(-2 * ZETA * 2 * math.pi / 2.3) * np.where(impacts, 0.64, 1.0)
    assert_allclose(branch.multiplier.prod("number").real, product, rtol=1e-7)
    assert np.abs(branch.multiplier.values).max() > 100.0


def test_where_a_branch_turns_back_at_a_grazing_it_folds_as_the_closed_form_says():
    """On the way an impact passes phase 0."""
    branch = followed(0.6, 0.1, 1.7, "amplitude", (0.05, 1.0))
    assert kinds(branch) == ["grazing", "fold", "fold"]
    assert_allclose(branch.special_value[:2], grazing(1.7), rtol=1e-12)
    assert_allclose(branch.special_value[2], fold(0.6, 1.7), rtol=1e-9)
    assert branch.attrs["begins"] == branch.attrs["ends"] == "end of the span"


def rests(e: float, amplitude: float, omega: float, point: np.ndarray) -> float:
    """Time of rest in a period from a point, of the independent reference."""
    laws = np.ones((1, 1)), np.array([[2 * ZETA]]), np.ones((1, 1)), np.ones((1, 1))
    stop = np.array([GAP]), np.array([e]), -np.ones(1), omega, amplitude, ((1, 1.0, 0.0),)
    reference = Rigid(*laws, *stop)
    reference.advance(*point[:, None], 2 * math.pi / omega)
    return float(reference.closed[0])


@pytest.mark.slow
def test_a_branch_ends_where_chatter_does():
    branch = followed(0.3, 1.0, 0.2, "amplitude", (0.1, 4.0))
    assert kinds(branch) == ["chatter"]
    assert branch.attrs["begins"] == "chatter"
    at, point = float(branch.special_value[0]), branch.special_point.values[0]
    for away in (1e-4, 1e-6):
        longer, none = (rests(0.3, at + side * away, 0.2, point) for side in (1, -1))
        assert longer > 0.0 == none


@pytest.mark.slow
def test_grazings_accumulate_at_the_end_of_chatter():
    """Between floors pressed by an acceleration that falls like t, x = w s - t s^2 / 2 + s^3 / 6.

    From s / t = r the next hop has (r / 2 - r^2 / 6)' = e (r / 2 - r^2 / 3) / (1 - r)^2; one that
    comes back for ever is its fixed point, from which others depart by the slope there.
    """
    e = 0.6
    branch = followed(e, 1.0, 0.5, "omega", (0.4, 0.6))
    special = branch.special_value.values[np.array(kinds(branch)) == "grazing"]
    steps = np.diff(np.sort(special))
    r = brentq(lambda r: (3 - r) * (1 - r) ** 2 - e * (3 - 2 * r), 0.01, 0.9)
    slope = (0.5 - 2 * r / 3) / (1 - r) ** 2 + (r - 2 * r * r / 3) / (1 - r) ** 3
    assert special.size >= 7
    assert_allclose(steps[0] / steps[1], (0.5 - r / 3) / (e * slope), rtol=0.01)
