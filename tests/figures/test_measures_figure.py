"""Measures in the figure, the film and the explorer."""

import math
import re
from pathlib import Path

import numpy as np
import pytest
from tools import SMALL

from hpcsweep import open_results
from hpcsweep.campaign import run as campaign
from hpcsweep.commands.cli import main
from hpcsweep.figures.explorer.page import build_page
from hpcsweep.figures.explorer.page_data import gather, slots
from hpcsweep.figures.film import film
from hpcsweep.figures.film.film import check
from hpcsweep.figures.film.frames import Film, Request
from hpcsweep.figures.style import PlotError, parameters
from hpcsweep.job import parse_job
from hpcsweep.parallel.mpi import Serial
from hpcsweep.store import Frames, StoreError

BUILDINGS = """
[units]
length = "m"
mass = "kg"
time = "s"
[[building]]
mass = [2e5, 2e5]
storey_stiffness = 3e8
storey_height = [4.0, 3.0]
[[building]]
mass = [2e5]
storey_stiffness = 2e8
storey_height = 4.0
[pounding]
gap = 0.002
stiffness = 2e9
[sweep]
frequency = [3.0, 4.0]
amplitude = {from = 0.2, to = 2.0, count = 6}
transient_cycles = 10
sampling_cycles = 20
max_orbit_period = 6
[output]
storey_drift = true
floor_acceleration = true
contact_force = true
"""


@pytest.fixture(scope="module")
def buildings(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("measures") / "buildings.h5"
    assert campaign.run(parse_job(BUILDINGS, "job", "job"), path, Serial()) == 0
    return path


def test_measures_are_drawn_at_an_undamped_resonance(tmp_path):
    text = SMALL + "storey_drift = true\n"
    job = parse_job(text, "job", "job")
    resonance = float(job.structure.frequencies[0])
    (tmp_path / "job.toml").write_text(text)
    keys = {"structure.damping_ratio": "0.0", "sweep.omega": f"[{resonance!r}]"}
    given = [word for key, value in keys.items() for word in ("--set", f"{key}={value}")]
    out, picture = str(tmp_path / "job.h5"), tmp_path / "job.png"
    assert main(["run", str(tmp_path / "job.toml"), *given, "-o", out]) == 0
    assert main(["plot", out, "--kind", "measures", "-o", str(picture)]) == 0
    assert picture.stat().st_size > 1000


@pytest.mark.slow
def test_measures_are_drawn_where_they_are_held(tmp_path, capsys):
    for name, more in (
        ("held", "storey_drift = true\ncontact_force = true\nimpacts = true\n"),
        ("none", ""),
    ):
        path = tmp_path / f"{name}.h5"
        assert campaign.run(parse_job(SMALL + more, name, name), path, Serial()) == 0
    picture = tmp_path / "measures.png"
    arguments = ("--kind", "measures", "--omega", "0.6", "--direction", "down", "-o", str(picture))
    assert main(["plot", str(tmp_path / "held.h5"), *arguments]) == 0
    assert picture.stat().st_size > 10_000
    picture.unlink()
    assert main(["plot", str(tmp_path / "none.h5"), *arguments]) == 2
    assert "holds none of them: set one of output.storey_drift" in capsys.readouterr().err
    assert not picture.exists()


def test_captions_have_the_units_that_are_named():
    job = parse_job(BUILDINGS + "[vary]\npounding.gap = [0.002, 0.005]\n", "job", "job")
    assert job.study.describe_part((1,)) == "gap = 0.005 m"
    assert parameters(job.structure, 4 * math.pi).endswith("= 12.5664 rad/s = 2 Hz")


@pytest.mark.slow
def test_drifts_are_ratios_where_heights_are_known(buildings, drawn_figure):
    from hpcsweep.figures.diagrams.metrics import measures

    results = open_results(buildings)
    assert results.storey_height.values.tolist() == [4.0, 3.0, 4.0]
    assert results.storey_height.attrs["units"] == "m"
    figure = drawn_figure(measures, results)
    first = figure.axes[0]
    assert first.get_ylabel() == "peak storey drift ratio  [%]"
    assert figure.axes[1].get_ylabel() == "peak floor acceleration  [m/s²]"
    drift = results.storey_drift.isel(direction=0, omega=0).values
    for line, own, height in zip(first.lines, drift.T, (4.0, 3.0, 4.0), strict=False):
        np.testing.assert_allclose(line.get_ydata(), 100.0 * own / height)


@pytest.mark.slow
def test_the_film_shows_a_measure(buildings, tmp_path):
    results = open_results(buildings)
    request = Request(buildings, tmp_path / "a.gif", width=480, show="storey_drift")
    check(request)
    frames = Film(request)
    shown = frames.read(1)["poincare"]
    drift = 100.0 * results.storey_drift.isel(omega=1) / results.storey_height
    np.testing.assert_allclose(shown[:, :, 0], drift.values, rtol=1e-14)
    assert film.make(request, Serial()) == 2
    assert (tmp_path / "a.gif").stat().st_size > 5_000
    for name, words in (("impulse", "holds no impulse"), ("drift", "must be one of storey_drift")):
        with pytest.raises((PlotError, StoreError), match=words):
            check(Request(buildings, tmp_path / "b.gif", show=name))


def test_the_explorer_shows_measures(buildings):
    study = gather(Frames(buildings))
    results = open_results(buildings)
    assert list(study.labels) == [
        *(f"storey_drift_{k}" for k in (1, 2, 3)),
        *(f"floor_acceleration_{k}" for k in (1, 2, 3)),
        "contact_force_1",
    ]
    assert study.labels["storey_drift_2"] == ("peak storey drift ratio", "storey A2", "  [%]")
    force = results.contact_force.isel(stop=0).transpose("omega", "direction", "amplitude")
    np.testing.assert_array_equal(study.runs["contact_force_1"], force.values.astype("f4"))
    assert "peak contact force, contact A1-B1  [N]" in build_page(study)


def test_a_summary_names_the_contacts_of_its_sets(buildings, capsys):
    assert main(["summary", str(buildings)]) == 0
    assert [*re.findall("contacts +(.*)", capsys.readouterr().out)] == ["1 is A1-B1"]


def test_an_attractor_keeps_its_place_along_the_amplitudes():
    identity = np.array([[1, 2, 0], [2, 1, 0], [2, 3, 0], [3, 2, 1], [4, 3, 0], [0, 0, 0]])
    order = slots(identity)
    assert (np.sort(order, axis=1) == np.arange(3)).all()
    kept = np.take_along_axis(identity, order, axis=1)
    assert kept.tolist() == [[1, 2, 0], [1, 2, 0], [0, 2, 3], [1, 2, 3], [4, 0, 3], [0, 0, 0]]
