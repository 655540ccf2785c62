"""The figure of a key that a job varies, and the other figures of one part."""

import numpy as np
import pytest
from tools import SMALL

from hpcsweep.campaign import run as campaign
from hpcsweep.commands.cli import main
from hpcsweep.figures.diagrams.vary_map import vary
from hpcsweep.figures.palette import motion_index
from hpcsweep.figures.style import PlotError, classes_of, job_of, structure_of
from hpcsweep.job import parse_job
from hpcsweep.parallel.mpi import Serial
from hpcsweep.store import Frames, open_results

TEXT = SMALL.replace("count = 11", "count = 6") + (
    "[vary]\nstructure.stiffness_ratio = [100, 3000]\n"
    "structure.gap = {from = 0.5, to = 1.5, count = 3}\nsolver.skip = ['all', 'none']\n"
)


@pytest.fixture(scope="module")
def varied(tmp_path_factory):
    path = tmp_path_factory.mktemp("vary") / "varied.h5"
    assert campaign.run(parse_job(TEXT, "varied", "varied"), path, Serial()) == 0
    return path


@pytest.mark.slow
def test_a_panel_for_each_value_of_the_other_keys(varied):
    frames = Frames(varied)
    results = vary.load(frames, omega=0.6, direction="down")
    assert results.titles == tuple(
        f"stiffness ratio = {beta}, skip = {skip}"
        for beta in (100, 3000)
        for skip in ("all", "none")
    )
    assert results.columns == 2
    axes = [axis for axis in vary.draw(results).axes if axis.get_title()]
    grid = [axis.get_subplotspec().rowspan.start for axis in axes]
    assert grid == [0, 0, 1, 1]  # a row for each stiffness ratio
    assert axes[3].get_title() == "stiffness ratio = 3000\nskip = none"
    assert results.values == (0.5, 1.0, 1.5)
    assert results.key == "gap"
    assert results.title.endswith(r"$\Omega$ = 0.6,  sweep down")
    part = open_results(varied).sel(
        direction=["down"], omega=[0.6], stiffness_ratio=3000, skip="all"
    )
    for row, gap in enumerate(results.values):
        own = part.sel(gap=gap)
        motion = motion_index(classes_of(own), own["orbit_period"].values)
        np.testing.assert_array_equal(results.motion[2, row], motion[0, 0])
    # the free motion is linear: it grazes in proportion to the gap
    ratio = results.grazing / results.grazing[:, :1]
    np.testing.assert_allclose(ratio, [[1.0, 2.0, 3.0]] * 4, rtol=1e-12)
    chosen = Frames(varied, at={"gap": 1.0, "skip": "all"})
    few = vary.load(chosen)
    assert few.values == (100, 3000)
    assert len(few.titles) == 1
    frames.close()
    chosen.close()


@pytest.mark.parametrize(
    "extra",
    [
        ("--over", "skip"),
        *(pytest.param(x, marks=pytest.mark.slow) for x in ((), ("--at", "skip=all"))),
    ],
)
def test_it_is_drawn_from_the_command_line(varied, tmp_path, extra):
    picture = tmp_path / "picture.png"
    assert main(["plot", str(varied), "--kind", "vary", "-o", str(picture), *extra]) == 0
    assert picture.stat().st_size > 10_000


@pytest.mark.slow
def test_every_other_figure_draws_the_part_that_is_chosen(varied, tmp_path, capsys):
    first, second, again = (tmp_path / f"{k}.png" for k in range(3))
    for picture, at in ((first, "0.5"), (second, "1.5"), (again, "1.5")):
        assert main(["plot", str(varied), "-o", str(picture), "--at", f"gap={at}"]) == 0
    assert first.read_bytes() != second.read_bytes()
    assert second.read_bytes() == again.read_bytes()
    page = tmp_path / "page.html"
    assert main(["explore", str(varied), "-o", str(page), "--at", "gap=1.5"]) == 0
    assert "varied, stiffness_ratio = 100, gap = 1.5, skip = all" in page.read_text()
    capsys.readouterr()
    assert main(["plot", str(varied), "-o", str(first), "--at", "gap=0.7"]) == 2
    assert capsys.readouterr().err.endswith("gap = 0.7: must be one of 0.5, 1, 1.5\n")
    with pytest.raises(SystemExit) as stop:
        main(["plot", str(varied), "--at", "gap"])
    assert stop.value.code == 2


def test_results_of_python_know_the_part_they_are(varied):
    whole = open_results(varied)
    with pytest.raises(PlotError, match="several stiffness_ratio: choose one by sel"):
        job_of(whole)
    part = whole.sel(stiffness_ratio=3000, gap=1.5, skip="all")
    assert structure_of(part).stiffness_ratio == 3000
    assert structure_of(part).gap == 1.5


def test_what_it_cannot_draw_is_one_line(varied, tmp_path, capsys):
    plain = tmp_path / "plain.h5"
    assert campaign.run(parse_job(SMALL, "plain", "plain"), plain, Serial()) == 0
    for path, extra, words in (
        (plain, (), "shows a key that a job varies"),
        (varied, ("--over", "mass"), "--over mass: must be one of stiffness_ratio, gap, skip"),
        (varied, ("--over", "gap", "--at", "gap=1"), "must be one of stiffness_ratio, skip"),
    ):
        picture = tmp_path / "none.png"
        capsys.readouterr()
        assert main(["plot", str(path), "--kind", "vary", "-o", str(picture), *extra]) == 2
        said = capsys.readouterr().err
        assert words in said
        assert said.count("\n") == 1
        assert not picture.exists()
