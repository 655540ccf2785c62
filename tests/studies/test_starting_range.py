"""Where the starts of attractors and basins lie is told in the structure's own units."""

import pytest

from hpcsweep import open_results
from hpcsweep.campaign import run as campaign
from hpcsweep.campaign.describe import describe, study_text
from hpcsweep.campaign.status import status
from hpcsweep.commands.cli import main
from hpcsweep.figures.diagrams.attractors import starts_words
from hpcsweep.job import parse_job
from hpcsweep.parallel.mpi import Serial
from hpcsweep.studies.report import starting_range

METRES = """
[units]
length = "m"
mass = "kg"
time = "s"
[structure]
sharpness = inf
damping_ratio = 0.05
[structure.matrices]
mass = [1.0]
stiffness = [[400.0]]
[[structure.contact]]
direction = [1.0]
gap = 0.03
stiffness = 4e4
[sweep]
frequency = 3.0
transient_cycles = 20
sampling_cycles = 10
"""
ATTRACTORS = METRES + 'amplitude = [5.0]\n[study]\nkind = "attractors"\nstarts = 6\n'
BASINS = (
    METRES
    + """amplitude = 5.0
[study]
kind = "basins"
starts = 6
horizontal = {from = -0.02, to = 0.02, count = 3}
vertical = {from = -0.5, to = 0.25, count = 4}
"""
)
BOX = ["displacement from -0.03 to 0.03 m", "velocity from -0.6 to 0.6 m/s"]
SLICE = ["u_1, 3 values from -0.02 to 0.02 m", "v_1, 4 values from -0.5 to 0.25 m/s"]
"""The gap, and the gap times the natural frequency of 20 rad/s; what the job says."""


def study(text: str):
    return parse_job(text, "starts", "starts")


@pytest.mark.slow
@pytest.mark.parametrize(("text", "told"), [(ATTRACTORS, BOX), (BASINS, SLICE)])
def test_file_and_description_tell_the_starts(text, told, tmp_path):
    job = study(text)
    assert starting_range(job.study) == told
    assert [text for name, text in describe(job) if name == "starts"] == told
    path = tmp_path / "starts.h5"
    assert campaign.run(job, path, Serial()) == 0
    assert open_results(path).attrs["starts"] == "; ".join(told)
    assert main(["validate", str(path), "--samples", "1"]) == 0


def test_a_study_without_starts_tells_none(small_job, tmp_path):
    from hpcsweep.job import load_job

    job = load_job(small_job)
    assert starting_range(job.study) == []
    path = tmp_path / "none.h5"
    assert campaign.run(job, path, Serial()) == 0
    assert "starts" not in open_results(path).attrs


def test_parts_with_boxes_of_their_own_say_which_part_is_told(tmp_path):
    job = study(ATTRACTORS + '[vary]\n"structure.contact[0].gap" = [0.03, 0.06]\n')
    assert starting_range(job.study) == BOX
    assert ("below", "contact_0_gap = 0.03 m, the first part") in describe(job)
    assert starting_range(job.study.part((1,))) == [
        "displacement from -0.06 to 0.06 m",
        "velocity from -1.2 to 1.2 m/s",
    ]
    path = tmp_path / "parts.h5"
    assert campaign.run(job, path, Serial()) == 0
    assert open_results(path).attrs["starts"] == f"{'; '.join(BOX)} (contact_0_gap = 0.03 m)"


def test_figures_tell_the_box():
    words = starts_words(study(ATTRACTORS).study)
    assert words == f"6 starts a point: {' and '.join(BOX)}"
    gaps = "[structure]\nn_floors = 2\n[sweep]\nomega = 0.5\namplitude = 0.1\n"
    gaps += '[study]\nkind = "attractors"\ndisplacement = [[-1.0, 1.0], [-2.0, 2.0]]\n'
    own = study(gaps).study
    assert starting_range(own)[1] == "displacement 2 from -2 to 2 gaps"
    assert starts_words(own) == "459 starts a point: a box, each floor its own range"


def test_basins_speak_of_rows_and_attractors_of_points(tmp_path, capsys):
    assert study_text(study(BASINS).study).endswith("= 4 rows (basins)")
    assert study_text(study(ATTRACTORS).study).endswith("= 1 point (attractors)")
    path = tmp_path / "rows.h5"
    assert campaign.run(study(BASINS), path, Serial()) == 0
    state = status(path)
    assert (state["run_noun"], state["frame_noun"]) == ("row", "row")
    for command in ("status", "summary"):
        assert main([command, str(path)]) == 0
        told = capsys.readouterr().out
        assert "4 of 4" in told
        for word in ("histories", "runs", "frame"):
            assert word not in told
        assert "starts" in told
    path = tmp_path / "points.h5"
    assert campaign.run(study(ATTRACTORS), path, Serial()) == 0
    assert main(["summary", str(path)]) == 0
    assert "points with 1 attractor " in capsys.readouterr().out
