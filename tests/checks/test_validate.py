"""What `validate` finds: every damaged byte, every broken promise, results of something else."""

import json
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from together import together
from tools import SMALL, assert_same_datasets, hpcsweep, of_study

from hpcsweep import Structure
from hpcsweep.campaign import run as campaign
from hpcsweep.checks.validate import validate
from hpcsweep.job import parse_job
from hpcsweep.parallel.mpi import Serial
from hpcsweep.store import Layout, layout_problems, pack
from hpcsweep.studies.recompute import _allowed
from hpcsweep.studies.settings import SweepSettings
from hpcsweep.studies.sweep.runs import AmplitudeSweep, frame_runs

JOB = (
    SMALL.replace("count = 4", "count = 2")
    .replace("to = 0.3", "to = 0.15")
    .replace("transient_cycles = 30", "transient_cycles = 10")
    .replace("sampling_cycles = 20", "sampling_cycles = 12")
)

UNDECIDED = JOB.replace("= 10\n", "= 30\n").replace("[output]", "classify_cycles = 0\n[output]")
"""Long enough for a run to be linear by its rule."""


def journal_blocks(path: Path) -> int:
    return Path(f"{path}.journal").read_text().count('"kind": "block"')


def make(path: Path, text: str = JOB, study=AmplitudeSweep):
    job = of_study(parse_job(text, "test", "test"), study)
    assert campaign.run(job, path, Serial()) == 0
    return job


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("whole") / "whole.h5"
    make(path)
    return path


def flip(path: Path, offset: int, bit: int = 1) -> None:
    with path.open("r+b") as file:
        file.seek(offset)
        byte = file.read(1)[0]
        file.seek(offset)
        file.write(bytes([byte ^ bit]))


@pytest.mark.slow
def test_a_whole_file_is_sound_and_the_other_solver_agrees(whole):
    before = whole.read_bytes()
    done = hpcsweep(0, "validate", whole, "--samples", 3, "--seed", 3, "--json")
    assert done.returncode == 0, done.stdout + done.stderr
    report = json.loads(done.stdout)
    assert report["sound"]
    assert report["committed"] == report["blocks"] == 12
    assert len(report["sample"]) == 3
    assert {run["solver"] for run in report["sample"]} == {"bdf"}
    assert all(run["difference"] <= run["allowed"] < 1e-3 for run in report["sample"])
    assert {run["whole_run"] for run in report["sample"]} == {"equal"}
    assert whole.read_bytes() == before
    again = validate(whole, samples=3, seed=3)
    assert [run.amplitude for run in again.sample] == [r["amplitude"] for r in report["sample"]]
    other = validate(whole, samples=3, seed=4)
    assert [run.amplitude for run in other.sample] != [r["amplitude"] for r in report["sample"]]


@together(
    "rtol, other, beta, growth, expected",
    [
        (1e-9, "bdf", 1e3, 1.0, 1e3 * 1e-9 + 3e3 * 1e-10),
        (1e-9, "bdf", 1e5, 1.0, (1e3 * 1e-9 + 3e3 * 1e-10) * 100.0**0.7),
        (1e-9, "bdf", 10.0, 50.0, (1e3 * 1e-9 + 3e3 * 1e-10) * 50.0),
        (1e-10, "flow", 10.0, 0.5, 1e3 * 1e-10 + 1e3 * 1e-11),
        (1e-12, "flow", 10.0, 2.0, 2.0 * 1e-7),
    ],
)
def test_the_allowance_is_that_of_both_tolerances_and_of_growth(
    rtol, other, beta, growth, expected
):
    allowed = _allowed(SweepSettings(rtol=rtol), Structure(1, beta), other, growth)
    assert allowed == pytest.approx(expected, rel=1e-12)


def test_one_flipped_byte_is_found_in_every_variable_and_named(copy):
    rng = np.random.default_rng(5)
    with h5py.File(copy, "r") as file:
        names = [name for name, data in file.items() if data.shape[:2] == (2, 2) and data.ndim > 2]
        places = {name: (file[name].id.get_offset(), file[name].nbytes) for name in names}
    assert len(names) == 16
    for name, (first, size) in places.items():
        offset = first + int(rng.integers(size))
        bit = 1 << int(rng.integers(8))
        flip(copy, offset, bit)
        report = validate(copy, samples=0)
        assert not report.sound
        named = [problem for problem in report.problems if "checksum does not hold" in problem]
        assert len(named) == 1, report.problems
        if name == "commit":
            assert "commit is damaged" in named[0]
        else:
            assert f"1 damaged byte(s) in {name}" in named[0]
            assert f"byte {offset} of the file" in named[0]
        flip(copy, offset, bit)
    assert validate(copy, samples=0).sound


def test_a_flipped_byte_of_a_state_that_is_followed_costs_one_block(copy, whole, tmp_path):
    with h5py.File(copy, "r") as file:
        # amplitude 3 is the last of the first block: the second block starts from it
        offset = file["final_state"].id.get_offset() + 3 * 4 * 8
    flip(copy, offset)
    shown = hpcsweep(0, "validate", copy, "--samples", 0)
    assert shown.returncode == 1
    assert "frame 0 (Omega = 0.5), up, block 0" in shown.stdout
    assert "final_state" in shown.stdout
    before = journal_blocks(copy)
    job = tmp_path / "job.toml"
    job.write_text(JOB)
    assert hpcsweep(0, "run", job, "-o", copy).returncode == 0
    assert journal_blocks(copy) == before + 1
    assert_same_datasets(copy, whole)
    assert hpcsweep(0, "validate", copy, "--samples", 0).returncode == 0


@pytest.mark.slow
def test_blocks_that_are_not_committed_are_not_there_yet(copy):
    with h5py.File(copy, "r+") as file:
        file["commit"][0, 1, 2] = 0
        file["commit"][1, 1] = 0
        file["poincare"][1, 1] = 17.0
    report = validate(copy, samples=2)
    assert report.problems == []
    assert (report.committed, report.blocks) == (8, 12)


def test_a_file_cut_short_is_named_so_and_left_alone(copy, tmp_path):
    job = tmp_path / "job.toml"
    job.write_text(JOB)
    whole_size = copy.stat().st_size
    for size in (whole_size - 1, whole_size // 2):
        copy.write_bytes(copy.read_bytes()[:size])
        before = copy.read_bytes()
        for command in (("run", job, "-o"), ("status",), ("plot",)):
            done = hpcsweep(0, *command, copy)
            assert done.returncode == 2, done.stderr
            assert len(done.stderr.splitlines()) == 1
            assert f"cut short, {size} of {whole_size} bytes are left" in done.stderr
        shown = hpcsweep(0, "validate", copy)
        assert shown.returncode == 1
        assert "cut short" in shown.stdout
        assert copy.read_bytes() == before


def test_mistakes_of_the_user_are_no_verdict(tmp_path):
    text, foreign = tmp_path / "text.h5", tmp_path / "foreign.h5"
    text.write_text("not HDF5")
    with h5py.File(foreign, "w") as file:
        file["x"] = 1
    for path in (text, foreign, tmp_path / "none.h5", tmp_path):
        done = hpcsweep(0, "validate", path)
        assert done.returncode == 2
        assert done.stderr.startswith("hpcsweep: error: ")
        assert len(done.stderr.splitlines()) == 1
        assert str(path) in done.stderr
    shown = hpcsweep(0, "validate", "--help").stdout
    assert "exit codes" in shown
    assert "not sound" in shown


OTHER = "attributes, coordinates or names: the checksum over them does not hold"


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        (lambda file: file["drift"].attrs.__setitem__("units", "m"), OTHER),
        (lambda file: file["amplitude"].__setitem__(2, 0.5), OTHER),
        (lambda file: file["omega"].__setitem__(1, 0.5), OTHER),
        (lambda file: file["state"].__setitem__(0, b"w_1"), OTHER),
        (lambda file: file.__delitem__("cycles"), "cycles: missing"),
        (lambda file: file.__setitem__("mine", 1), "mine: not part of the layout"),
        (lambda file: file.attrs.__delitem__("libraries"), OTHER),
        (lambda file: file.attrs.__setitem__("rtol", 1e-6), OTHER),
        (lambda file: file.attrs.__setitem__("job", JOB + "\n[solver]\nrtol = 1e-8"), "job"),
        (lambda file: file["contact"].dims[2].detach_scale(file["amplitude"]), OTHER),
    ],
)
def test_every_part_of_the_layout_is_compared(copy, change, problem):
    with h5py.File(copy, "r+") as file:
        change(file)
    report = validate(copy, samples=0)
    assert not report.sound
    assert any(problem in found for found in report.problems), report.problems


def test_variables_of_another_form_or_place_are_found(whole, copy):
    job = parse_job(JOB, "test", "test")
    assert layout_problems(whole, Layout(job)) == []
    with h5py.File(copy, "r+") as file:
        values = file["cycles"][...]
        del file["cycles"]
        data = file.create_dataset("cycles", data=values.astype("f4"), chunks=True)
        data.attrs["units"], data.attrs["long_name"] = "forcing periods", ""
    problems = "\n".join(layout_problems(copy, Layout(job)))
    assert "cycles: its type is float32, not int32" in problems


def altered(**changes):
    """Return a study whose results are changed before they are committed."""

    class Altered(AmplitudeSweep):
        def runs_at(self, *arguments):
            result = super().runs_at(*arguments)
            for name, change in changes.items():
                result[name] = change(result[name])
            return result

    return Altered


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "change", "promise"),
    [
        ("outcome", lambda v: v * 0, "outcome is one of 1 to 5"),
        ("skip_rule", lambda v: v + 4, "skip_rule is a rule the job allows"),
        ("orbit_period", lambda v: v + 7, "orbit_period is at most max_orbit_period"),
        ("orbit_period", lambda v: v * 0, "a run that was cut short has an orbit_period"),
        ("n_points", lambda v: v + 1, "n_points is the orbit_period"),
        ("cycles", lambda v: v * 0 - 1, "cycles is at least"),
        ("contact", lambda v: v | np.uint64(4), "contact has bits of existing contacts only"),
        ("contact", lambda v: v | np.uint64(1), "contact of a linear run is empty"),
        ("drift", lambda v: -v, "drift is finite and not negative"),
        ("modal_norm", lambda v: v * 1.5, "modal_norm lies between 0 and 1"),
        ("poincare", lambda v: v * np.nan, "poincare is finite in n_points points"),
        ("poincare", lambda v: np.nan_to_num(v), "NaN after"),
        ("final_state", lambda v: v + 1e-12, "final_state is the last point"),
    ],
)
def test_a_broken_promise_is_found_under_a_checksum_that_holds(tmp_path, name, change, promise):
    path = tmp_path / "altered.h5"
    make(path, UNDECIDED, altered(**{name: change}))
    report = validate(path, samples=0)
    assert not report.sound
    assert any(promise in problem for problem in report.problems), report.problems
    assert not any("checksum" in problem for problem in report.problems)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "change", "promise"),
    [
        ("motion", lambda v: v * 0, "motion is one of 1 to 7"),
        ("motion", lambda v: v * 0 + 7, "motion of a failed run is failed, of no other"),
        ("motion", lambda v: v * 0 + 5, "an orbit_period is periodic or free of contact"),
        ("orbit_period", lambda v: v * 0, "motion is periodic only with an orbit_period"),
        ("contact", lambda v: v | np.uint64(1), "motion is free of contact where contact is empty"),
        ("classification_cycles", lambda v: v - 1, "classification_cycles is at least 0"),
    ],
)
def test_a_broken_promise_of_a_decided_motion_is_found(tmp_path, name, change, promise):
    path = tmp_path / "altered.h5"
    make(path, study=altered(**{name: change}))
    report = validate(path, samples=0)
    assert any(promise in problem for problem in report.problems), report.problems


def test_a_window_that_repeats_has_a_period(tmp_path):
    path = tmp_path / "altered.h5"
    plain = UNDECIDED.replace("[output]", '[solver]\nskip = "none"\n[output]')

    class Forgetful(AmplitudeSweep):
        def runs_at(self, *arguments):
            settings = replace(self.settings, period_tolerance=1e-300)
            return AmplitudeSweep.runs_at(replace(self, settings=settings), *arguments)

    make(path, plain, Forgetful)
    report = validate(path, samples=0)
    assert any("0 only where the points do not repeat" in found for found in report.problems)


class OfAnotherStructure(AmplitudeSweep):
    """Results that are not those of the job."""

    def runs_at(self, *arguments):
        own = self.structure
        other = Structure(own.n_floors, own.stiffness_ratio * 1.001, 4e3, 0.0501)
        return AmplitudeSweep.runs_at(replace(self, structure=other), *arguments)


HYSTERESIS = """
[structure]
n_floors = 2
stiffness_ratio = 300.0
sharpness = 4e3
damping_ratio = [0.05, 0.02]
[sweep]
omega = 0.55
amplitude = {from = 0.0, to = 0.3, count = 7}
transient_cycles = 40
sampling_cycles = 8
max_orbit_period = 4
[output]
lyapunov = true
block = 3
"""


class NotFollowing(AmplitudeSweep):
    """Every run from rest: each ends on an orbit, but not always on the one the path leads to."""

    def runs_at(self, frame, places, state, poll=None):
        runs = frame_runs(self.structure, float(self.omega[frame]), self.settings)
        return runs.each(self.amplitude[places], np.zeros_like(state), poll)


@pytest.mark.slow
def test_orbits_off_the_path_are_found_out(tmp_path):
    path = tmp_path / "off.h5"
    make(path, HYSTERESIS, NotFollowing)
    report = validate(path, samples=3)
    assert any("from the state stored before it" in problem for problem in report.problems)
    assert not any("bdf finds" in problem for problem in report.problems)


@pytest.mark.slow
def test_results_of_another_structure_are_found_out_by_the_other_solver(tmp_path):
    path = tmp_path / "other.h5"
    make(path, study=OfAnotherStructure)
    report = validate(path, samples=4)
    assert not report.sound
    assert report.n_problems >= 3
    assert all("bdf finds points that differ" in problem for problem in report.problems)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "change", "finding"),
    [
        ("drift", lambda v: v * 1.001, "finds drift"),
        *(
            pytest.param(*one, marks=pytest.mark.slow)
            for one in (
                ("storey_drift", lambda v: v * 0.999, "finds storey_drift"),
                ("contact", lambda v: v ^ np.uint64(2), "finds contact"),
                ("modal_norm", lambda v: v * 0.9, "finds modal_norm"),
                ("displacement", lambda v: v * 0.999, "finds displacement"),
            )
        ),
    ],
)
def test_wrong_metrics_are_found_out_by_the_other_solver(tmp_path, name, change, finding):
    path = tmp_path / "altered.h5"
    measured = f"{JOB}storey_drift = true\ndisplacement = true\n"
    make(path, measured, altered(**{name: change}))
    sample = validate(path, samples=5).sample
    assert any(finding in again.problem for again in sample), sample


@pytest.mark.slow
def test_a_bdf_file_is_compared_with_flow(tmp_path):
    text = JOB.replace("count = 11", "count = 3").replace("count = 2", "count = 2")
    text = text.replace("transient_cycles = 10", "transient_cycles = 4")
    text = text.replace("sampling_cycles = 12", "sampling_cycles = 2").replace(
        "max_orbit_period = 6", "max_orbit_period = 1"
    )
    path = tmp_path / "bdf.h5"
    make(path, text.replace("[output]", '[solver]\nmethod = "bdf"\nrtol = 1e-7\n[output]'))
    report = validate(path, samples=8)
    assert report.problems == []
    assert {run.solver for run in report.sample} == {"flow"}
    assert all(run.difference <= run.allowed for run in report.sample)


def test_a_damaged_packed_file_is_found(copy, tmp_path):
    packed = tmp_path / "packed.h5"
    pack(copy, packed)
    assert validate(packed, samples=1).problems == []
    with h5py.File(packed, "r") as file:
        chunk = file["poincare"].id.get_chunk_info(0)
    flip(packed, chunk.byte_offset + chunk.size // 2)
    report = validate(packed, samples=1)
    assert not report.sound
    assert any("poincare" in problem for problem in report.problems), report.problems
