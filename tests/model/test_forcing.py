"""The forcing as a sum of harmonics, and what of the flow map rests on elastic contacts."""

import math

import numpy as np
import pytest
from reference import reference_points

from hpcsweep.model.forcing import Harmonics
from hpcsweep.model.kernel_model import kernel_model
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.flow import FlowMap
from hpcsweep.solvers.flow.state import shared

TERMS = (
    ((1, 1.0, 0.0),),
    ((1, 0.7, 0.3), (3, -0.2, 1.1)),
    ((2, 1.0, 0.5), (5, 0.3, -2.0), (7, 0.1, 0.0)),
)


@pytest.mark.parametrize("terms", TERMS)
def test_a_forcing_repeats_and_stays_within_its_size(terms):
    forcing, omega = Harmonics(terms), 0.61
    tau = np.linspace(0.0, forcing.period(omega), 1001)
    value = sum(a * np.sin(h * omega * tau + phi) for h, a, phi in terms)
    assert value[-1] == pytest.approx(value[0], abs=1e-13)
    assert 0.5 * forcing.size < np.abs(value).max() <= forcing.size
    assert forcing.period(omega, 7) == pytest.approx(7 * 2 * math.pi / omega, rel=1e-15)


def test_the_solvers_have_the_forcing_of_the_structure():
    structure = Structure(2, harmonics=TERMS[1])
    assert structure.forcing == Harmonics(TERMS[1])
    model = kernel_model(structure, 0.61)
    assert model.period == structure.forcing.period(0.61)
    assert model.harmonics.tolist() == [list(term) for term in TERMS[1]]


@pytest.mark.parametrize("sharpness", [3e3, 1e4])
def test_without_elastic_contacts_every_layer_is_collocated(monkeypatch, sharpness):
    """Closed forms decline by themselves, and the motion is the same."""
    structure, amplitude, omega = Structure(3, 300.0, sharpness), 0.2, 0.445
    z = np.array([0.5, 0.8, 0.9, 0.4, 0.3, 0.6])
    usual = FlowMap(structure, omega)
    points, _ = usual.points(z, amplitude, 6)

    def inelastic(*arguments):
        model = kernel_model(*arguments)
        return model._replace(contacts=model.contacts._replace(is_elastic=False))

    monkeypatch.setattr(shared, "kernel_model", inelastic)
    monkeypatch.setattr(shared, "_pattern_of", shared._pattern_of.__wrapped__)
    other = FlowMap(structure, omega)
    slow, _ = other.points(z, amplitude, 6)
    assert usual.counts[1] > 0
    assert other.counts[1] == 0
    assert other.counts[2] > usual.counts[2]
    reference = reference_points(structure, amplitude, omega, z, 6)
    scale = 1.0 + np.abs(reference).max()
    assert np.abs(slow - reference).max() < 1e-9 * scale
    assert np.abs(points - reference).max() < 1e-9 * scale
