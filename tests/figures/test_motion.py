"""Figures of one run, and frequency responses: `plot --kind time`, `loop`, `section` ..."""

import contextlib
import math

import numpy as np
import pytest
import tools
from matplotlib.figure import Figure

import hpcsweep
from hpcsweep.figures.diagrams import motion, orbit_diagram, phase, response
from hpcsweep.figures.diagrams.sweep import mark_stops
from hpcsweep.figures.explorer.page import _structure
from hpcsweep.figures.explorer.page_data import PageData
from hpcsweep.figures.labels import displacement, typeset
from hpcsweep.figures.style import PlotError
from hpcsweep.model.coordinates import coordinate_of
from hpcsweep.store import Frames

JENKINS = """
[structure]
damping_ratio = 0.02
[structure.matrices]
mass = [1.0]
stiffness = [[1.0]]
forcing = [1.0]
[[structure.slider]]
direction = [1.0]
stiffness = 1.0
strength = 0.5
[sweep]
along = "omega"
omega = [0.8, 1.2]
amplitude = [0.1, 1.0]
directions = ["up", "down"]
[output]
rows = ["1"]
"""
RUN = {"amplitudes": [1.0], "along": [1.2]}


@pytest.fixture(scope="module")
def swept(tmp_path_factory):
    folder = tmp_path_factory.mktemp("jenkins")
    (folder / "job.toml").write_text(JENKINS)
    tools.hpcsweep(0, "run", folder / "job.toml", "-o", folder / "job.h5")
    return folder / "job.h5"


def drawn(figure, path, **options):
    with contextlib.closing(Frames(path, figure.draws)) as frames:
        return figure.draw(figure.load(frames, **options), **options)


@pytest.mark.slow
def test_a_loop_encloses_what_the_slider_dissipates_in_a_period(swept):
    (axis,) = drawn(motion.loop, swept, **RUN).axes
    u, force = axis.lines[0].get_data()
    turn = u.max() - u.min()
    enclosed = abs(np.sum(0.5 * (force[1:] + force[:-1]) * np.diff(u)))
    # a parallelogram: 4 F (amplitude - F / k)
    assert math.isclose(enclosed, 4 * 0.5 * (0.5 * turn - 0.5), rel_tol=1e-3)


@pytest.mark.slow
def test_time_section_and_spectrum_are_of_the_run_that_is_asked_for(swept):
    over = drawn(motion.time, swept, **RUN, count=2)
    assert over.axes[0].lines[0].get_xdata()[-1] == 2.0
    points = drawn(motion.section, swept, **RUN, count=7).axes[0].collections[0].get_offsets()
    assert len(points) == 7
    assert np.ptp(points, axis=0).max() < 1e-9  # an orbit of period 1
    section = drawn(motion.section, swept, **RUN).axes[0]
    assert len(section.collections[0].get_offsets()) == 1  # not a picture of rounding
    lines = drawn(motion.spectrum, swept, **RUN).axes[0].collections[0].get_segments()
    tops = np.array([line[1, 1] for line in lines])
    with contextlib.closing(Frames(swept, "motions")) as frames:
        held = frames.dataset(1).row_amplitude.values[0, 0, 1, 0, 0]
    assert math.isclose(tops[1], held, rel_tol=1e-5)
    with pytest.raises(PlotError, match="--along, one value, is needed"):
        drawn(motion.time, swept)


@pytest.mark.slow
def test_what_sliders_do_is_told_and_not_that_nothing_touches(swept):
    loop, portrait = (drawn(figure, swept, **RUN) for figure in (motion.loop, phase.phase))
    assert loop.get_suptitle().endswith("= 1.2, up: P1, plastic")
    assert portrait.get_suptitle().endswith("$A$ = 1")
    assert portrait.axes[0].texts[0].get_text().endswith("up: P1, plastic")
    still = drawn(phase.phase, swept, amplitudes=[0.1], along=[1.2])
    assert still.axes[0].texts[0].get_text().endswith("up: P1, elastic")
    assert still.legends[0].texts[0].get_text() == "nothing closes or slips"
    assert not drawn(orbit_diagram.orbit, swept).axes[0].texts  # no regions of contact sets


def test_the_time_of_a_difference_is_that_of_both():
    structure = hpcsweep.Structure(2)
    assert displacement(structure, "@_{2} - @_{1}", "(jT)").startswith("$(u_{2} - u_{1})(jT)$")
    assert displacement(structure, "@_{1}", "(jT)").startswith("$u_{1}(jT)$")


@pytest.mark.slow
def test_a_response_has_what_the_file_holds_or_its_points_give(swept):
    axis = drawn(response.response, swept).axes[0]
    held = axis.lines[0].get_ydata()
    given = drawn(response.response, swept, floors=["slider:1"]).axes[0].lines[0].get_ydata()
    assert np.allclose(held, given, rtol=1e-9)
    assert drawn(response.response, swept, log="xy").axes[0].get_yscale() == "log"


def test_formulas_are_typeset():
    assert (
        typeset("amplitude = 0.7 * omega**2") == r"$A=0.7\,\Omega^{2}$"
    )  # a title is broken at spaces
    assert typeset("sqrt(gap)") == r"$\sqrt{\mathrm{gap}}$"


@pytest.mark.slow
def test_a_branch_along_a_formula_grazes_where_its_closed_form_does():
    stop = hpcsweep.Structure(1, sharpness=math.inf, damping_ratio=0.05, stiffness_ratio=20.0)
    start = hpcsweep.stroboscopic_points(stop, 0.3 * 0.25, 0.5, [0.0, 0.0], 300)[-1]
    given = start, 1, "omega", (0.4, 1.0)
    branch = hpcsweep.branch(stop, "0.3 * omega**2", 0.5, *given)
    omega = float(branch.special_value[0])
    assert hpcsweep.meanings(branch.special_kind)[0] == "grazing"
    assert math.isclose(0.3 * omega**2 / abs(1 - omega**2 + 0.1j * omega), 1.0, rel_tol=1e-10)
    with pytest.raises(ValueError, match="special must be of a branch without formulas"):
        hpcsweep.curve(stop, branch.isel(special=0))
    with pytest.raises(ValueError, match="omega must be a number: the branch is along it"):
        hpcsweep.branch(stop, 0.1, "omega", *given)


def test_a_page_in_rows_moves_as_the_structure_does():
    contacts = [hpcsweep.Contact([1.0, -1.0, 0.0], 0.1, 5.0), hpcsweep.Contact([0, 0, 1], 0.2, 3.0)]
    stiffness = [[3.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 2.0]]
    made = hpcsweep.Structure.from_matrices([2.0, 1.0, 1.5], stiffness, contacts)
    u = np.array([0.3, -0.2, 0.5])
    points, speed = u[None].astype(np.float32), np.zeros((1, 1, 1, 3), np.float32)
    axes = np.ones(1), np.ones(1), ("up",), ("sweep up",)
    data = PageData("", made, *axes, {"speed": speed}, points).in_rows(["1-2", "contact:2"])
    assert data.names == ("1", "1-2", "contact:2")
    assert np.allclose(data.points[0], [0.3, 0.5, 0.5])
    plain, other = _structure(made), _structure(made, (), data.change, data.names)
    moved = data.change @ u
    pairs = zip(plain["contacts"], other["contacts"], strict=True)
    for old, new in pairs:
        reached = sum(value * moved[i] for i, value in new["direction"])
        assert math.isclose(reached, sum(value * u[i] for i, value in old["direction"]))
    was, now = np.array(plain["stiffness"]) @ u, np.array(other["stiffness"]) @ moved
    assert np.allclose(data.change @ was, now)
    assert other["stops"][1] == [0.1]


def test_of_a_play_both_walls_are_drawn():
    rows = ((-1.0, 1.0), (1.0, -1.0))
    walls = [hpcsweep.Contact(row, gap, 50.0) for row, gap in zip(rows, (0.05, 0.05), strict=True)]
    pair = hpcsweep.Structure.from_matrices([1.0, 1.0], [[2.0, 0.0], [0.0, 1.0]], walls)
    for limits, drawn in (((-0.06, 0.03), 2), ((-0.01, 0.01), 0)):
        axis = Figure().subplots()
        axis.set_ylim(limits)
        mark_stops(axis, [pair], coordinate_of(pair, "2-1"))
        assert len(axis.lines) == drawn
        assert (axis.get_ylim() == limits) == (drawn == 0)
