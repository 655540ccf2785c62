"""Figures and words of sweeps of structures whose springs yield."""

import numpy as np
import pytest
import xarray

from hpcsweep.figures import style
from hpcsweep.figures.diagrams import maps, mesh, metrics
from hpcsweep.job import parse_job

JOB = """
[structure]
n_floors = 1
sharpness = inf
yield_drift = 0.1
hardening = 0.1
[sweep]
omega = [0.25, 1.26]
amplitude = [0.01, 0.02, 0.03]
directions = ["up"]
[output]
contact = true
drift = true
"""


@pytest.fixture(scope="module")
def results():
    """Runs of which one is elastic, one slips, and four touch."""
    runs = {"contact": [[0, 0, 1], [1, 1, 1]], "slider_energy": [[0, 2, 3], [4, 5, 6]]}
    runs |= {"outcome": np.ones((2, 3), int), "orbit_period": np.ones((2, 3), int)}
    runs["drift"] = np.ones((2, 3))
    dims = "direction", "omega", "amplitude"
    held = {name: (dims, np.array([values])) for name, values in runs.items()}
    held["slider_energy"] = (*dims, "slider"), held["slider_energy"][1][..., None]
    study = parse_job(JOB, "job", "job").study
    coords = {"direction": ["up"], "omega": study.omega, "amplitude": study.amplitude}
    return xarray.Dataset(held, coords, attrs={"job": JOB, "name": "job"})


def test_the_class_without_contact_is_one_without_slip_and_no_cell_reaches_below_zero(results):
    figure = maps.motion_map.draw(results)
    names = [text.get_text() for text in figure.legends[0].get_texts()]
    assert names == ["nothing closes or slips  16.7 %", "P1  83.3 %", "undecided  0 %"]
    assert [axis.get_ylim()[0] for axis in figure.axes] == [0.0]
    assert "nothing closes or slips 16.7 %" in style.shares_text(results, style.classes_of(results))
    assert mesh.edges_of(np.array([1.0, 9.0])).tolist() == [0.0, 5.0, 13.0]
    assert mesh.edges_of(np.array([-1.0, 9.0])).tolist() == [-6.0, 4.0, 14.0]


def test_nothing_is_compared_with_a_closed_form_that_does_not_hold(results):
    structure = style.structure_of(results)
    assert 0 < structure.grazing_amplitude(0.25) < np.inf
    assert style.grazing_amplitude(structure, 0.25) == np.inf
    assert mesh.map_keys(results) == []
    with pytest.raises(style.PlotError, match="benefit: knows no free drift of springs that yield"):
        metrics.benefit.draw(results)
