"""The claims: each with made-up sweeps that say yes and no, and the real ones of Figure 3."""

import json
import re
from dataclasses import replace

import answer_claims
import numpy as np
import pytest
from claims import Map, Sweep, Verdict, coexistence, judgement, report, variant_of
from claims.coexistence import BranchEnd
from claims.evidence import Study
from claims.judge import judge_files
from claims.judgement import Hits
from claims.reading import open_frames, read_map
from claims.words import C3, C13, C23, C123
from tools import PAPER, ROOT, SMALL, hpcsweep

from hpcsweep.campaign import run as campaign
from hpcsweep.job import load_job, parse_job
from hpcsweep.model.structure import Structure
from hpcsweep.parallel.mpi import Serial
from hpcsweep.studies.settings import SweepSettings

YES, NO, CANNOT_TELL = Verdict.YES, Verdict.NO, Verdict.CANNOT_TELL


def sweep(period, contact, growth=-50.0, drift=1.0, modal=None, both=True) -> Sweep:
    """Return a sweep with given rows: lists for one direction, or pairs of lists."""
    period = np.atleast_2d(period)
    d = 2 if both else 1
    period = np.broadcast_to(period, (d, period.shape[1]))
    shape = period.shape
    points = np.full((*shape, 2, 6), np.nan)
    points[..., 0, :] = 0.1
    return Sweep(
        omega=0.445,
        amplitude=0.01 * np.arange(1, shape[1] + 1),
        directions=("up", "down")[:d],
        period=period,
        contact=np.broadcast_to(np.atleast_2d(contact), shape),
        growth=np.broadcast_to(np.asarray(growth, float), shape),
        drift=np.broadcast_to(np.asarray(drift, float), shape),
        modal_norm=np.broadcast_to(np.full(3, np.nan) if modal is None else modal, (*shape, 3)),
        state=np.full((*shape, 6), 0.1),
        points=points,
        valid=np.ones(shape, bool),
    )


def test_first_grazing():
    coarse = sweep([1, 0, 1, 1, 9], [0, C3, C3, C3, C23])
    fine = sweep([1, 0, 0, 1], [0, C3, C3, C3], growth=[-50, 8, 6, -20], both=False)
    claim = judgement.first_grazing(coarse, fine)
    assert claim.verdict is YES
    assert "chaos in 2 of 3" in claim.finding
    assert "0.03 to 0.04" in claim.finding
    calm = replace(fine, growth=np.full((1, 4), -3.0))
    assert judgement.first_grazing(coarse, calm).verdict is NO
    assert judgement.first_grazing(sweep([1, 2], [0, C3]), fine).verdict is NO
    unknown = replace(fine, growth=np.full((1, 4), np.nan))
    claim = judgement.first_grazing(coarse, unknown)
    assert claim.verdict is CANNOT_TELL
    assert "output.lyapunov" in claim.finding


def test_windows_and_their_order():
    periods = [1, 9, 9, 0, 8, 8, 0, 7, 0, 6, 6, 6, 0, 4, 4, 4]
    own = sweep(periods, C23)
    assert judgement.windows(own) == [(9, 1, 2), (8, 4, 5), (7, 7, 7), (6, 9, 11), (4, 13, 15)]
    gap = sweep([9, 0, 8], C23, growth=[-50, 9, -50], both=False)
    assert judgement.window_order(own, [gap] * 4).verdict is YES
    calm = replace(gap, growth=np.full((1, 3), 0.0))
    claim = judgement.window_order(own, [gap, gap, calm, gap])
    assert claim.verdict is NO
    assert "chaos in 3 of the 4" in claim.finding
    assert judgement.window_order(sweep(periods[::-1], C23), [gap] * 4).verdict is NO
    assert judgement.window_order(sweep(periods, C123), []).verdict is NO
    unknown = replace(gap, growth=np.full((1, 3), np.nan))
    assert judgement.window_order(own, [unknown] * 4).verdict is CANNOT_TELL


def test_hits_in_the_windows():
    good = [Hits(p, 0.1, (0, 2, p), (0, 2, p)) for p in judgement.WINDOWS]
    assert judgement.window_hits(good).verdict is YES
    for bad in (Hits(9, 0.1, (0, 3, 9), (0, 3, 9)), Hits(9, 0.1, (0, 2, 9), (0, 2, 8))):
        assert judgement.window_hits([bad, *good[1:]]).verdict is NO
    assert judgement.window_hits(good[1:]).verdict is NO
    assert judgement.window_hits([]).verdict is NO


def test_late_period():
    up, down = [6, 0, 4], [6, 5, 4]
    assert judgement.late_period(sweep([up, down], C23), None).verdict is YES
    assert judgement.late_period(sweep([down, down], C23), None).verdict is NO
    assert judgement.late_period(sweep([up, up], C23), None).verdict is NO
    assert judgement.late_period(sweep([up, up], C23), sweep([up, down], C23)).verdict is YES
    assert judgement.late_period(sweep([up, down], C123), None).verdict is NO
    assert judgement.late_period(sweep(up, C23, both=False), None).verdict is CANNOT_TELL


def test_probe():
    assert judgement.chaotic_probe(sweep([0], C23, growth=60.0)).verdict is YES
    assert judgement.chaotic_probe(sweep([2], C23)).verdict is NO
    assert judgement.chaotic_probe(sweep([0], C23, growth=1.0)).verdict is NO
    assert judgement.chaotic_probe(sweep([0], C23, growth=np.nan)).verdict is CANNOT_TELL


def test_two_impacting_orbits():
    period, contact = [[4, 4], [4, 2]], [[C23, C23], [C23, C13]]
    larger = sweep(period, contact, drift=[[1.0, 1.0], [1.0, 1.2]])
    claim = coexistence.two_impacting_orbits(larger)
    assert claim.verdict is YES
    assert "1.200 (P2 C13, down) and 1.000 (P4 C23, up)" in claim.finding
    smaller = sweep(period, contact, drift=[[1.0, 1.0], [1.0, 0.9]])
    assert coexistence.two_impacting_orbits(smaller).verdict is NO
    assert coexistence.two_impacting_orbits(sweep(period, C23)).verdict is NO
    assert coexistence.two_impacting_orbits(sweep([4], C23, both=False)).verdict is CANNOT_TELL


def test_coexisting_regions():
    contact = [[C23, C23, C123, C23, C123], [C23, C123, C123, C123, C123]]
    period = [[1, 1, 2, 1, 1], [1, 1, 1, 1, 1]]
    found = sweep(period, contact)
    found.points[1, 2] += 0.5
    end = BranchEnd(0.045, np.array([0.99, 0.2, 0.1, 0.1, 0.1, 0.1]))
    claims = coexistence.coexisting_regions(found, end)
    assert [claim.number for claim in claims] == ["5a", "5b", "5c", "5d"]
    assert [claim.verdict for claim in claims] == [YES] * 4
    assert "0.05 to 0.05" in claims[3].finding
    found.points[1, 2] -= 0.5
    torus = BranchEnd(0.045, np.array([0.6 + 0.799j, 0.6 - 0.799j, 0.1, 0.1, 0.1, 0.1]))
    claims = coexistence.coexisting_regions(found, torus)
    assert [claim.verdict for claim in claims] == [YES, NO, NO, YES]
    assert "Neimark-Sacker" in claims[2].finding
    alone = coexistence.coexisting_regions(sweep([1, 1], C23), None)
    assert [claim.verdict for claim in alone] == [NO, NO, CANNOT_TELL, NO]
    one_way = coexistence.coexisting_regions(sweep([1, 1], C23, both=False), None)
    assert {claim.verdict for claim in one_way} == {CANNOT_TELL}


def test_kinds_of_ends():
    assert coexistence.kind_of_end(np.array([0.99, 0.1]))[0] == "fold"
    assert coexistence.kind_of_end(np.array([-0.99, 0.1]))[0] == "period doubling"
    assert coexistence.kind_of_end(np.array([0.5, 0.1]))[0] == "no multiplier at the unit circle"


def make_map(beta, chaos, drift=0.9, period=1, exponents=True) -> Map:
    chaotic = np.zeros((2, 10), bool)
    chaotic[:, :chaos] = True
    period = np.where(chaotic, 0, np.broadcast_to(period, (2, 10)))
    return Map(
        stiffness_ratio=beta,
        omega=np.array([0.4, 0.5]),
        period=period,
        contact=np.full((2, 10), C23),
        chaotic=chaotic,
        valid=np.ones((2, 10), bool),
        drift=np.broadcast_to(np.asarray(drift, float), (2, 10)),
        free_drift=np.ones(2),
        exponents=exponents,
    )


def test_softer_is_simpler():
    stiff, soft = make_map(1000, 6, period=np.arange(1, 11)), make_map(100, 1)
    claim = judgement.softer_is_simpler(stiff, soft)
    assert claim.verdict is YES
    assert "10.00% of touching runs against 60.00%" in claim.finding
    assert "2 against 5" in claim.finding
    assert judgement.softer_is_simpler(stiff, make_map(100, 5)).verdict is NO
    assert judgement.softer_is_simpler(make_map(1000, 6), soft).verdict is NO
    blind = make_map(100, 1, exponents=False)
    assert judgement.softer_is_simpler(stiff, blind).verdict is CANNOT_TELL


def test_drift_of_orbits_and_chaos():
    assert judgement.drift_of_orbits(make_map(1000, 4)).verdict is YES
    assert judgement.drift_of_orbits(make_map(1000, 4, drift=1.1)).verdict is NO
    assert judgement.drift_of_orbits(make_map(1000, 10)).verdict is CANNOT_TELL
    mixed = np.where(np.arange(10) % 2, 0.9, 1.1)
    claim = judgement.drift_of_chaos(make_map(1000, 4, drift=mixed))
    assert claim.verdict is YES
    assert "50.0% of 8" in claim.finding
    assert judgement.drift_of_chaos(make_map(1000, 4)).verdict is NO
    assert judgement.drift_of_chaos(make_map(1000, 0)).verdict is CANNOT_TELL
    blind = make_map(1000, 4, exponents=False)
    assert judgement.drift_of_chaos(blind).verdict is CANNOT_TELL


def test_raised_modes():
    free = np.array([0.99, 0.02, 0.01])
    assert judgement.raised_modes(sweep([1], C3, modal=[0.9, 0.3, 0.2]), free).verdict is YES
    assert judgement.raised_modes(sweep([1], C3, modal=[0.9, 0.3, 0.001]), free).verdict is NO
    assert judgement.raised_modes(sweep([1], 0, modal=[0.9, 0.3, 0.2]), free).verdict is CANNOT_TELL


def test_linear_is_exact():
    a = np.array([0.01, 0.02])
    assert judgement.linear_is_exact(a, np.array([1e-14, 1e-12]), 0.03).verdict is YES
    assert judgement.linear_is_exact(a, np.array([1e-14, 1e-3]), 0.03).verdict is NO
    assert judgement.linear_is_exact(a[:0], a[:0], 0.03).verdict is CANNOT_TELL


def test_variants():
    assert variant_of(load_job(PAPER / "figure3.toml").structure) == "printed"
    assert variant_of(load_job(PAPER / "figure3-described.toml").structure) == "described"
    assert variant_of(Structure(damping_ratio=0.04)) == "zeta = 0.04, 0.04, 0.04"


def test_hits_are_counted_by_integration():
    """P1 C3 at A = 0.05, printed damping: floor 3 once an orbit; P2 C23 at 0.1: floor 2 too."""
    structure = Structure()
    blank = sweep([1], C3)
    study = Study(structure, blank, SweepSettings())
    up = study.follow(np.array([0.05, 0.08, 0.1]), [np.zeros(6)], transient_cycles=200)
    assert up.period[0].tolist() == [1, 1, 2]
    one = study.count_hits(up.state[0, 0], 0.05, 1)
    assert (one.hits, one.cycles) == ((0, 0, 1), (0, 0, 1))
    two = study.count_hits(up.state[0, 2], 0.1, 2)
    assert two.cycles[0] == two.hits[0] == 0
    assert two.cycles[2] == 2
    assert two.hits[1] >= two.cycles[1] >= 1


def test_linear_motion_is_integrated_anew():
    structure = Structure()
    grazing = structure.grazing_amplitude(0.445)
    study = Study(structure, sweep([1], 0), SweepSettings())
    free = study.follow(np.array([0.3, 0.9]) * grazing, [np.zeros(6)])
    study.sweep = free
    amplitudes, distance = study.linear_distance()
    assert amplitudes.tolist() == free.amplitude.tolist()
    assert distance.max() < 1e-9
    # a wrong closed form is noticed
    study.structure = Structure(damping_ratio=0.051)
    assert study.linear_distance()[1].max() > 1e-3


def test_tables():
    claims = [judgement.linear_is_exact(np.ones(1), np.zeros(1), 2.0), judgement.window_hits([])]
    answers = {"printed": claims, "described": claims[:1]}
    assert report.as_text(answers).index("2b") < report.as_text(answers).index(" 9 ")
    rows = json.loads(report.as_json(answers))
    assert [row["number"] for row in rows["printed"]] == ["2b", "9"]
    assert rows["described"][0]["verdict"] == "yes"
    lines = report.as_markdown(answers).splitlines()
    assert len(lines) == 4
    assert {line.count(" | ") for line in lines if "---" not in line} == {3}
    assert "**no**" in lines[2]


MAP = """
[structure]
stiffness_ratio = {beta}
[sweep]
omega = {{from = 0.3, to = 0.6, count = 10}}
amplitude = {{from = 0.05, to = 0.2, count = 4}}
directions = ["up"]
transient_cycles = 20
sampling_cycles = 10
[output]
poincare = false
modal_norm = false
lyapunov = true
"""


@pytest.mark.slow
def test_maps_of_both_stiffnesses_are_compared(tmp_path, capsys):
    paths = []
    for beta in (1000.0, 100.0):
        path = tmp_path / f"{beta:g}.h5"
        assert campaign.run(parse_job(MAP.format(beta=beta), "m", "m"), path, Serial()) == 0
        paths.append(str(path))
    frames = open_frames(paths[0])
    read = read_map(frames)
    frames.close()
    assert read.period.shape == (10, 4)
    untouched = read.contact == 0
    np.testing.assert_allclose(
        read.drift[untouched], np.broadcast_to(read.free_drift[:, None], (10, 4))[untouched], 0.02
    )
    assert untouched.any()
    capsys.readouterr()
    assert answer_claims.main(["--json", *paths]) == 0
    rows = json.loads(capsys.readouterr().out)["printed"]
    verdicts = {row["number"]: row["verdict"] for row in rows}
    assert set(verdicts) == {"1", "2", "3", "4", "5", "6", "7a", "7b", "8", "9"}
    assert verdicts["6"] in ("yes", "no")
    assert verdicts["1"] == "cannot tell"
    assert "jobs/paper/figure3.toml" in next(r["finding"] for r in rows if r["number"] == "1")
    assert answer_claims.main(["--json", paths[0]]) == 0
    rows = json.loads(capsys.readouterr().out)["printed"]
    assert "jobs/paper/figure6-beta100.toml" in next(
        r["finding"] for r in rows if r["number"] == "6"
    )


def test_of_two_maps_the_one_of_more_runs_counts_and_a_map_needs_no_points(tmp_path):
    # the finer one has a frame at Omega = 0.445, but no points: a map, and no sweep
    fine = MAP.replace("0.3, to = 0.6, count = 10", "0.4, to = 0.58, count = 13")
    paths = []
    for name, text in (("coarse", MAP), ("fine", fine)):
        job = parse_job(text.format(beta=1000.0), name, name)
        paths.append(tmp_path / f"{name}.h5")
        assert campaign.run(job, paths[-1], Serial()) == 0
    answers = [judge_files(files)["printed"] for files in (paths[1:], paths, paths[::-1])]
    assert answers[0] == answers[1] == answers[2]
    assert answers[0] != judge_files(paths[:1])["printed"]
    assert {claim.number for claim in answers[0]} >= {"7a", "7b"}


def test_other_structures_are_refused_on_one_line(tmp_path, capsys):
    path = tmp_path / "two.h5"
    assert campaign.run(parse_job(SMALL, "small", "small"), path, Serial()) == 0
    capsys.readouterr()
    assert answer_claims.main([str(path)]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "structure.n_floors = 2" in error


EXPECTED = {
    "figure3": {"2a": NO, "2b": NO, "3": NO, "4": NO, "5a": YES, "5b": NO, "5c": YES, "5d": YES},
    "figure3-described": {"2a": YES, "2b": YES, "3": YES, "5a": YES, "5b": YES, "5c": NO},
}


@pytest.mark.slow
@pytest.mark.parametrize("name", list(EXPECTED))
def test_claims_of_figure_3(tmp_path, name):
    text = load_job(PAPER / f"{name}.toml").text
    if "lyapunov" not in text:
        text += "\n[output]\nlyapunov = true\n"
    path = tmp_path / "f.h5"
    assert campaign.run(parse_job(text, name, name), path, Serial()) == 0
    ((variant, claims),) = judge_files([path]).items()
    assert variant == ("described" if "described" in name else "printed")
    verdicts = {claim.number: claim.verdict for claim in claims}
    assert {number: verdicts[number] for number in EXPECTED[name]} == EXPECTED[name]
    assert verdicts["8"] is YES
    assert verdicts["9"] is YES
    assert verdicts["6"] is verdicts["7"] is CANNOT_TELL
    (summary,) = json.loads(hpcsweep(0, "summary", path, "--json").stdout)
    wrong, missed = (summary["window_test"][key] for key in ("wrong", "missed"))
    kinds = [summary["classes"][key]["runs"] for key in ("chaotic", "long period", "undecided")]
    column = 1 + list(EXPECTED).index(name)
    for row, told in (
        ("periods claimed that are wrong", str(wrong)),
        ("orbits missed", str(missed)),
        ("chaotic, long period, undecided", ", ".join(map(str, kinds))),
    ):
        (line,) = re.findall(rf"^\| {row} \|.*$", (ROOT / "docs/study.md").read_text(), re.M)
        assert line.strip("| ").split(" | ")[column] == told, row
    if variant == "described":
        assert f"{wrong} wrong, {missed} missed" in (ROOT / "docs/reliability.md").read_text()
        said = f"{wrong} of 862 runs a wrong period and miss {missed} orbits"
        assert said in (ROOT / "README.md").read_text()
