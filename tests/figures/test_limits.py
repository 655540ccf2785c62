"""Requested limits of axes: of all panels, of cells, of what is written above panels."""

import numpy as np
import pytest
from together import together

from hpcsweep.commands.cli import main
from hpcsweep.figures import style, view
from hpcsweep.figures.diagrams import metrics, orbit_diagram, sweep
from hpcsweep.model.structure import Structure


@pytest.mark.slow
def test_all_panels_have_the_limits_and_regions_beyond_have_no_words(results, drawn_figure):
    with view.viewing(x=(0.2, 0.28), y=(-1.5, 0.25)):
        figure = drawn_figure(orbit_diagram.orbit, results)
    assert [axis.get_xlim() for axis in figure.axes] == [(0.2, 0.28)] * 2
    assert [axis.get_ylim() for axis in figure.axes] == [(-1.5, 0.25)] * 2
    whole = drawn_figure(orbit_diagram.orbit, results).axes[0]
    assert whole.get_xlim() == pytest.approx((0.0144, 0.3056))
    regions = {text.get_text().split("\n")[0]: text.xy[0] for text in whole.texts}
    left = {text.get_text().split("\n")[0]: text.xy[0] for text in figure.axes[0].texts}
    assert set(left) < set(regions)
    assert all(0.2 <= place <= 0.28 for place in left.values())


@pytest.mark.slow
@together(
    "extra, words",
    [
        (("--ylim", "2", "1"), "--ylim 2 1: must be two finite numbers, the lower one first"),
        (("--xlim", "0", "inf"), "--xlim 0 inf: must be two finite numbers"),
        (("--xlim", "-1e-3", "-2E0"), "--xlim -0.001 -2: must be two finite numbers"),
        (("--ylim", "-inf", "1"), "--ylim -inf 1: must be two finite numbers"),
        (("--xlim", "300", "400"), "--xlim 300 400: must hold a part of 0."),
        (("--kind", "map", "--ylim", "8", "9"), "--ylim 8 9: must hold a part of 0."),
        (("--kind", "metrics", "--ylim", "0", "1"), "--ylim: the panels show different"),
    ],
)
def test_limits_that_mean_nothing_are_one_line(file, tmp_path, capsys, extra, words):
    picture = tmp_path / "none.png"
    assert main(["plot", str(file), "-o", str(picture), *extra]) == 2
    said = capsys.readouterr().err
    assert words in said
    assert said.count("\n") == 1
    assert not picture.exists()


def test_panels_of_two_quantities_share_their_horizontal_axis(results, drawn_figure):
    with view.viewing(x=(0.05, 0.1)):
        figure = drawn_figure(metrics.metrics, results)
    assert [axis.get_xlim() for axis in figure.axes] == [(0.05, 0.1)] * 2


def test_rounding_is_not_drawn_as_structure(tmp_path):
    figure, (axis, _) = style.new_figure(2, 2.0)
    axis.plot([0.0, 1.0], -0.2103487497 + np.array([-8e-13, -1e-13]))
    view.save(figure, tmp_path / "a.png")
    low, high = axis.get_ylim()
    assert (low, high) == pytest.approx((-0.221, -0.2), abs=2e-3)
    assert view.apart(1.0, 1.001) == (1.0, 1.001)
    assert view.apart(0.0, 1e-13) == (0.0, 1e-13)
    assert view.apart(0.0, 0.0) == (0.0, 0.0)


def test_one_floor_has_a_panel_of_its_own_shape():
    alone, _ = sweep.coordinate_panels(Structure(1), ())
    three, _ = sweep.coordinate_panels(Structure(3), ())
    assert alone.get_size_inches().tolist() == pytest.approx([7.2, 1.2 + sweep.SINGLE])
    assert three.get_size_inches().tolist() == pytest.approx([7.2, 1.2 + 3 * sweep.PANEL])
