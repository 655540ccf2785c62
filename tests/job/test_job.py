import dataclasses
import math

import numpy as np
import pytest
from together import together
from tools import SMALL

from hpcsweep.job import JobError, load_job, parse_job
from hpcsweep.model.backbone import Backbone
from hpcsweep.model.structure import Structure
from hpcsweep.studies.path_grid import Followed, Steps
from hpcsweep.studies.refinement import Refinement
from hpcsweep.studies.settings import SweepSettings


def job(text: str):
    return parse_job(text, "x.toml", "x")


@together(
    "old, new, words",
    [
        ("n_floors = 2", "n_floors = 0", ("structure.n_floors", "1 to 64", "0")),
        ("n_floors = 2", "n_floors = 2.5", ("structure.n_floors", "whole", "2.5")),
        ("n_floors = 2", "n_floors = true", ("structure.n_floors", "True")),
        ("300.0", "-300.0", ("structure.stiffness_ratio", "at least 0", "-300")),
        ("300.0", "nan", ("structure.stiffness_ratio", "number", "nan")),
        ("4e3", "-1", ("structure.sharpness", "at least 0")),
        ("= 0.05", "= [0.05]", ("structure.damping_ratio", "2 numbers, one per mode", "has 1")),
        ("= 0.05", "= -0.05", ("structure.damping_ratio", "-0.05")),
        ("= 0.05", '= "little"', ("structure.damping_ratio", "'little'")),
        ("from = 0.02, to = 0.3", "from = 0.3, to = 0.02", ("sweep.amplitude.from", "0.3", "0.02")),
        ("from = 0.02", "from = -0.02", ("sweep.amplitude", "-0.02", "must be 0, or from")),
        ("count = 11", "count = 1", ("sweep.amplitude.count", "2 to")),
        ("count = 11", "step = 0", ("sweep.amplitude.step", "0")),
        ("count = 11", "step = 0.1, count = 3", ("either count or step",)),
        ("count = 11", "cuont = 11", ("sweep.amplitude.cuont", "'count'")),
        ("from = 0.5, to", "from = 0.0, to", ("sweep.omega", "must be from 0.0001")),
        (
            "omega = {from = 0.5, to = 0.8, count = 4}",
            "omega = [0.7, 0.5, 0.7]",
            ("sweep.omega", "must not hold a value twice"),
        ),
        ("transient_cycles = 30", "transient_cycles = -1", ("sweep.transient_cycles", "-1")),
        ("max_orbit_period = 6", "max_orbit_period = 11", ("max_orbit_period", "11", "1 to 10")),
        (
            "sampling_cycles = 20\nmax_orbit_period = 6",
            "sampling_cycles = 30000\nmax_orbit_period = 10001",
            ("max_orbit_period", "10001", "1 to 10000"),
        ),
        ("max_orbit_period = 6", "max_period = 6", ("sweep.max_period", "'max_orbit_period'")),
        ("[output]", "[ouput]", ("'ouput'", "'output'")),
        ("block = 4", "block = 0", ("output.block", "0")),
        ("block = 4", "drift = 1", ("output.drift", "true or false")),
        ("block = 4", "rtol = 1e-6", ("output.rtol", "[solver]")),
        ("[output]", "[solver]\nmethod='rk4'\n[output]", ("solver.method", "rk4", "flow, bdf")),
        ("[output]", "[solver]\nrtol=0.5\n[output]", ("solver.rtol", "0.5", "from 1e-13 to 0.01")),
        ("[output]", "[solver]\nskip=['x']\n[output]", ("solver.skip", "linear")),
        ("[output]", "[output", ("not valid TOML", "line")),
        ("[sweep]", "[sweep]\ninitial_state=[1.0]", ("sweep.initial_state", "2 n = 4")),
        ("[sweep]", "[sweep]\ndirections=['down']", ("sweep.directions", '["up", "down"]')),
        ("[sweep]", "[sweep]\nperiod_tolerance=0", ("sweep.period_tolerance",)),
        ("[structure]", "name='a/b'\n[structure]", ("name", "a/b")),
    ],
)
def test_each_mistake_is_one_line_that_names_file_key_value_and_limit(old, new, words):
    assert old in SMALL
    with pytest.raises(JobError) as error:
        job(SMALL.replace(old, new, 1))
    message = str(error.value)
    assert message.startswith("x.toml: ")
    assert "\n" not in message
    for word in words:
        assert word in message


def test_missing_key_and_file_are_named(tmp_path):
    with pytest.raises(JobError, match=r"sweep\.omega is missing"):
        job("[sweep]\namplitude = 0.1")
    with pytest.raises(JobError, match=r"absent\.toml: cannot be read"):
        load_job(tmp_path / "absent.toml")
    with pytest.raises(JobError, match="cannot be read"):
        load_job(tmp_path)
    (tmp_path / "latin.toml").write_bytes(b"name = '\xe4'")
    with pytest.raises(JobError, match="UTF-8"):
        load_job(tmp_path / "latin.toml")


@together("given", ["from=0.01, to=0.3, step=0.01", "from=0.01, to=0.3, count=30"])
def test_values_of_a_range_are_those_that_one_would_write(given):
    found = job(f"[sweep]\nomega=1\namplitude={{{given}}}").study.amplitude
    assert found.tolist() == [float(f"{k / 100:.2f}") for k in range(1, 31)]


def test_step_includes_the_end_it_hits_and_no_value_beyond():
    found = job("[sweep]\nomega=1\namplitude={from=0.005, to=0.25, step=0.001}").study.amplitude
    assert found.size == 246
    assert found[-1] == pytest.approx(0.25, abs=1e-15)
    found = job("[sweep]\nomega=1\namplitude={from=0, to=1, step=0.3}").study.amplitude
    assert found == pytest.approx([0, 0.3, 0.6, 0.9])


def test_fingerprint_is_of_the_meaning_not_of_the_text():
    first = job(SMALL)
    same = job("# a comment\nname = 'other'\n" + SMALL.replace("4e3", "4000.0"))
    assert same.fingerprint == first.fingerprint
    for old, new in [("300.0", "301.0"), ("block = 4", "block = 5"), ("count = 11", "count = 12")]:
        assert job(SMALL.replace(old, new)).fingerprint != first.fingerprint


def test_infinite_sharpness_and_a_list_of_frames():
    text = SMALL.replace("4e3", "inf").replace("{from = 0.5, to = 0.8, count = 4}", "[0.7, 0.5]")
    found = job(text)
    assert found.structure.sharpness == math.inf
    assert np.array_equal(found.study.omega, [0.7, 0.5])


OTHER = {
    "n_floors": 4,
    "stiffness_ratio": 7.0,
    "sharpness": 77.0,
    "damping_ratio": 0.07,
    "mass": 2.0,
    "storey_stiffness": (1.0, 2.0, 3.0),
    "gap": 0.5,
    "gap_left": 0.7,
    "rayleigh": (0.1, 0.01),
    "storey_damping": 0.1,
    "restitution": 1.0,
    "tension": True,
    "yield_force": math.inf,
    "yield_drift": math.inf,
    "hardening": 0.1,
    "flag_height": 0.5,
    "backbone": Backbone(1.0, 2.0),
    "p_delta": True,
    "weight": 2.0,
    "storey_height": 3.0,
    "collapse_drift": 0.5,
    "harmonics": ((1, 1.0, 0.0), (3, 0.2, 0.0)),
    "matrices": Structure.from_matrices([1, 1, 1], np.eye(3), []).matrices,
    "transient_cycles": 7,
    "sampling_cycles": 70,
    "max_orbit_period": 7,
    "period_tolerance": 7e-7,
    "solver": "bdf",
    "rtol": 7e-7,
    "skip": frozenset({"linear"}),
    "metrics": frozenset({"poincare"}),
    "max_points": 40,
    "classify_cycles": 7,
    "spectrum_error": 0.07,
    "spectrum_cycles": 77,
    "rows": ("1",),
    "n_harmonics": 3,
    "motion_length": 2.0,
    "unreached": (1,),
    "omega": np.array([0.7]),
    "amplitude": np.array([0.07]),
    "directions": ("up",),
    "initial_state": np.full(6, 0.07),
    "block_size": 7,
    "listed": True,
    "refine": Refinement(),
    "steps": Steps(
        Followed("omega", "sweep.omega", "frequency", np.array([0.5])),
        *("amplitude", np.array([0.1]), np.array([[0.5]]), np.array([[0.1]])),
    ),
}
"""Another value than that of the job below, for every field that has a meaning."""
ALONG = {
    "hardening": {"yield_drift": math.inf},
    "flag_height": {"yield_drift": math.inf},
    "backbone": {"yield_drift": 0.1, "collapse_drift": 5.0},
    "p_delta": {"weight": 0.01, "storey_height": 1.0},
    "collapse_drift": {"yield_drift": 0.1},
}
"""Fields without which another one must not be given."""


@together("kind", ["amplitude_sweep", "points"])
@together("part", ["structure", "settings", "study"])
def test_every_field_is_part_of_the_fingerprint(part, kind):
    text = f'[study]\nkind = "{kind}"\n[sweep]\nomega = 0.5\namplitude = 0.1\n'
    job = parse_job(text, "", "name")
    owner = getattr(job, part)
    silent = {"structure", "settings", "unit_names", "names", "reduction"}
    names = [field.name for field in dataclasses.fields(owner) if field.name not in silent]
    assert names
    for name in names:
        assert name in OTHER, f"{name}: give it another value here, and it must change the hash"
        usual = dataclasses.replace(owner, **ALONG.get(name, {}))
        made = []
        for own in (usual, dataclasses.replace(usual, **{name: OTHER[name]})):
            study = own if part == "study" else dataclasses.replace(job.study, **{part: own})
            made.append(dataclasses.replace(job, study=study).fingerprint)
        assert made[0] != made[1], name


@dataclasses.dataclass(frozen=True)
class Later(SweepSettings):
    """Settings of a later version."""

    weights: tuple[float, ...] = ()
    offset: float = 0.0


def test_a_new_field_counts_only_where_it_is_not_its_default():
    job = parse_job("[sweep]\nomega = 0.5\namplitude = 0.1\n", "", "name")

    same = {f.name: getattr(job.settings, f.name) for f in dataclasses.fields(SweepSettings)}

    def of(**later):
        study = dataclasses.replace(job.study, settings=Later(**same, **later))
        return dataclasses.replace(job, study=study).fingerprint

    assert of() == job.fingerprint
    later = ({}, {"offset": 1e-300}, {"weights": (0.1,)}, {"weights": (0.2,)})
    assert len({of(**fields) for fields in later}) == 4


def test_a_field_that_cannot_be_hashed_is_refused():
    job = parse_job("[sweep]\nomega = 0.5\namplitude = 0.1\n", "", "name")
    study = dataclasses.replace(job.study, settings=Later(weights=object()))
    strange = dataclasses.replace(job, study=study)
    with pytest.raises(TypeError, match="no place in a job's fingerprint"):
        _ = strange.fingerprint


def test_motions_are_classified_unless_the_job_says_otherwise():
    def cycles(extra: str = "", end: str = ""):
        text = f"[sweep]\nomega = 0.5\namplitude = 0.1\n{extra}\n{end}"
        return parse_job(text, "", "name").settings.classify_cycles

    assert cycles() == 50_000
    assert cycles(end="[solver]\nmethod = 'bdf'") == 0
    for given in (0, 7, 10_000_000):
        assert cycles(f"classify_cycles = {given}") == given
    for wrong in ("-1", "10_000_001", "1.5", "true", '"all"'):
        with pytest.raises(JobError, match=r"sweep\.classify_cycles = .*whole number from 0 to"):
            cycles(f"classify_cycles = {wrong}")


def test_the_kind_of_study_is_part_of_the_fingerprint():
    text = "[sweep]\nomega = 0.5\namplitude = 0.1\ndirections = ['up']\n[output]\nblock = 1\n"
    sweep = parse_job(text, "", "name")
    named = parse_job('[study]\nkind = "amplitude_sweep"\n' + text, "", "name")
    points = parse_job(
        '[study]\nkind = "points"\n' + text.replace("directions = ['up']\n", ""), "", "name"
    )
    listed = parse_job('[study]\nkind = "points"\npoints = [[0.1, 0.5]]\n', "", "name")
    assert named.fingerprint == sweep.fingerprint
    assert len({sweep.fingerprint, points.fingerprint, listed.fingerprint}) == 3


@together(
    "text, parts",
    [
        ('[study]\nkind = "pionts"', ("study.kind", "amplitude_sweep, points")),
        ("[study]\nkind = 3", ("study.kind", "amplitude_sweep, points")),
        ("[study]\nkind = ['points']", ("study.kind", "amplitude_sweep, points")),
        ("study = 3", ("study", "must be a table")),
        (
            '[study]\nkind = "points"\n[sweep]\ndirections = ["up"]',
            ("sweep.directions", "goes with"),
        ),
        ("[study]\npoints = [[0.1, 0.5]]", ("study.points", 'study.kind = "points"')),
        ('[study]\nkind = "points"\npoints = []', ("study.points", "pairs [A, Omega]")),
        ('[study]\nkind = "points"\npoints = [[0.1]]', ("study.points", "pairs [A, Omega]")),
        ('[study]\nkind = "points"\npoints = [[0.1, "x"]]', ("study.points", "a number")),
        ('[study]\nkind = "points"\npoints = [[0.1, 0.0]]', ("study.points", "Omega above 0")),
        ('[study]\nkind = "points"\npoints = [[-0.1, 1.0]]', ("study.points", "at least 0")),
        ('[study]\nkind = "points"\npoints = [[0.1, inf]]', ("study.points", "Omega above 0")),
        ('[study]\nkind = "points"\npoints = [[0.1, 1], [0.1, 1.0]]', ("study.points", "twice")),
        (
            '[study]\nkind = "points"\npoints = [[0.1, 1]]\n[sweep]\nomega = 1.0',
            ("sweep.omega", "beside study.points"),
        ),
        ('[study]\nkind = "points"', ("sweep.omega", "missing")),
    ],
)
def test_mistakes_in_a_study_name_key_and_limit(text, parts):
    with pytest.raises(JobError) as caught:
        parse_job(text, "job.toml", "x")
    message = str(caught.value)
    assert message.startswith("job.toml: ")
    assert "\n" not in message
    for part in parts:
        assert part in message
