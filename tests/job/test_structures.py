"""Structures in job files: what is read, what is refused, and what files store of them."""

import dataclasses
import json
import math
import re
import tomllib

import h5py
import numpy as np
import pytest
from claims.reading import foreign
from together import together
from tools import JOBS

import hpcsweep
from hpcsweep.campaign.describe import describe as told_of
from hpcsweep.commands.cli import main
from hpcsweep.job import JobError, load_job, parse_job
from hpcsweep.job.keys import every_key
from hpcsweep.job.tree import write
from hpcsweep.model.description import describe
from hpcsweep.model.matrices import Contact
from hpcsweep.model.structure import Structure
from hpcsweep.store import open_results

SWEEP = "\n[sweep]\nomega = 0.5\namplitude = [0.1, 0.2]\n"
BUILDING = """
[structure]
n_floors = 2
mass = [1.0, 2]
storey_stiffness = [3.0, 2.0]
gap = [0.5, inf]
gap_left = 0.7
stiffness_ratio = [100.0, 200.0]
rayleigh = [0.01, 0.02]
sharpness = inf
"""
MATRICES = """
[structure]
sharpness = 1e4

[structure.matrices]
mass = [1.0, 2.0]
stiffness = [[2.0, -1.0], [-1.0, 1.0]]
damping = [[0.2, -0.1], [-0.1, 0.1]]
forcing = [0.0, 1.0]
drift = [[1.0, 0.0], [-1.0, 1.0]]

[[structure.contact]]
direction = [1, -1]
gap = 0.1
stiffness = 50

[[structure.contact]]
direction = [-1.0, 0.0]
gap = 0.0
stiffness = 80.0

[forcing]
harmonics = [{order = 1}, {order = 3, amplitude = 0.5, phase = -1.0}]
"""
MADE = Structure.from_matrices(
    [1.0, 2.0],
    [[2.0, -1.0], [-1.0, 1.0]],
    [Contact((1.0, -1.0), 0.1, 50.0), Contact((-1.0, 0.0), 0.0, 80.0)],
    damping=[[0.2, -0.1], [-0.1, 0.1]],
    forcing=[0.0, 1.0],
    drift=[[1.0, 0.0], [-1.0, 1.0]],
    sharpness=1e4,
    harmonics=((1, 1.0, 0.0), (3, 0.5, -1.0)),
)


def structure(text: str) -> Structure:
    return parse_job(text + SWEEP, "x.toml", "x").structure


def changed(text: str, old: str, new: str) -> str:
    assert old in text
    return text.replace(old, new, 1)


def test_a_building_of_unequal_storeys_is_read():
    assert structure(BUILDING) == Structure(
        2,
        (100.0, 200.0),
        math.inf,
        mass=(1.0, 2.0),
        storey_stiffness=(3.0, 2.0),
        gap=(0.5, math.inf),
        gap_left=0.7,
        rayleigh=(0.01, 0.02),
    )


def test_matrices_contacts_and_harmonics_are_read():
    assert structure(MATRICES) == MADE


def test_a_diagonal_of_masses_stands_for_the_matrix():
    full = changed(MATRICES, "mass = [1.0, 2.0]", "mass = [[1, 0], [0, 2]]")
    assert structure(full) == MADE


def test_damping_by_ratios_goes_with_matrices_too():
    text = changed(MATRICES, "damping = [[0.2, -0.1], [-0.1, 0.1]]\n", "")
    found = structure(changed(text, "sharpness", "damping_ratio = [0.1, 0.2]\nsharpness"))
    assert found.damping_ratios.tolist() == [0.1, 0.2]
    found = structure(changed(text, "sharpness", "rayleigh = [0.1, 0.2]\nsharpness"))
    assert np.allclose(found.damping_matrix, 0.1 * np.diag([1, 2]) + 0.2 * found.stiffness_matrix)


def test_the_public_names_are_those_of_the_job_file():
    contacts = [hpcsweep.Contact((1.0, -1.0), 0.1, 50.0), hpcsweep.Contact([-1, 0], 0, 80)]
    stiffness = [[2.0, -1.0], [-1.0, 1.0]]
    found = hpcsweep.Structure.from_matrices([1.0, 2.0], stiffness, contacts)
    assert found.contacts == MADE.contacts
    assert found.sharpness == math.inf
    points = hpcsweep.stroboscopic_points(found, 0.1, 0.5, [0.0] * 4, 3)
    assert points.shape == (3, 4)


# of rules of the structure itself, which tests/model tries, one of each kind of key
WRONG = [
    (BUILDING, "mass = [1.0, 2]", "mass = [1.0]", "structure.mass must have 2 numbers, one per"),
    (BUILDING, "mass = [1.0, 2]", "mass = {m = 1}", "structure.mass must be"),
    (BUILDING, "mass = [1.0, 2]", "mass = [1e40, 1e40]", "structure.mass = 1e+40: must be 0 or"),
    (BUILDING, "mass = [1.0, 2]", "masses = 1.0", "unknown key 'structure.masses'"),
    (BUILDING, "[3.0, 2.0]", "[[3.0], [2.0]]", "structure.storey_stiffness must be a"),
    (BUILDING, "gap_left = 0.7", "gap_left = 1e-40", "structure.gap_left = 1e-40: must be 0 or"),
    (BUILDING, "[100.0, 200.0]", "[1.0, 1e13]", "structure.stiffness_ratio = 10000000000000.0"),
    (BUILDING, "sharpness", "damping_ratio = 0.1\nsharpness", "structure.rayleigh = [0.01, 0.02]:"),
    (BUILDING, "n_floors = 2", "n_floors = 40\n", "structure.stiffness_ratio must have 40 numbers"),
    (BUILDING, "sharpness = inf", "contact = []", "structure.contact = []: goes with"),
    (BUILDING, "sharpness = inf", "matrices = 3", "does not go with matrices"),
    (MATRICES, "mass = [1.0, 2.0]", "mass = [[1, 0.1], [0, 1]]", "matrices.mass must be symmetric"),
    (MATRICES, "mass = [1.0, 2.0]", "mass = []", "structure.matrices.mass must"),
    (MATRICES, "mass = [1.0, 2.0]\n", "", "structure.matrices.mass is missing"),
    (MATRICES, "[2.0, -1.0], [-1.0, 1.0]", "2", "structure.matrices.stiffness must"),
    (MATRICES, "[0.2, -0.1], [-0.1, 0.1]", "[1, 0]", "structure.matrices.damping must"),
    (MATRICES, "forcing = [0.0, 1.0]", "force = [1, 1]", "unknown key 'structure.matrices.force'"),
    (MATRICES, "direction = [1, -1]", "direction = [0, 0]", "contact[0].direction must not be 0"),
    (MATRICES, "direction = [1, -1]", "direction = [1]", "structure.contact.direction of contact"),
    (
        MATRICES,
        "[[structure.contact]]",
        "[[structure.slider]]\ndirection = [1, 0]\nstiffness = 1.0\nstrength = 1.0\n"
        "[[structure.slider]]\ndirection = [1, 0]\nstiffness = 1.0\nstrength = -1.0\n"
        "[[structure.contact]]",
        "structure.slider[1].strength must be finite and positive, is -1.0",
    ),
    (MATRICES, "direction = [1, -1]", "direction = 1", "structure.contact[0].direction must be"),
    (MATRICES, "direction = [1, -1]\n", "", "structure.contact[0].direction is missing"),
    (MATRICES, "gap = 0.1", "gap = inf", "structure.contact[0].gap must be finite, is inf"),
    (MATRICES, "gap = 0.1", "gap = 'none'", "structure.contact[0].gap must be a number"),
    (MATRICES, "gap = 0.1", "gpa = 0.1", "unknown key 'structure.contact[0].gpa'"),
    (MATRICES, "stiffness = 50", "stiffness = 1e40", "structure.contact[0].stiffness = 1e+40"),
    (MATRICES, "sharpness", "n_floors = 2\nsharpness", "structure.n_floors = 2: does not go with"),
    (MATRICES, "sharpness", "gap = 1.0\nsharpness", "structure.gap = 1.0: does not go with"),
    (
        MATRICES,
        "{order = 1}, ",
        "{order = 0, phase = 1.0}, ",
        "phase = 1.0: does not go with order",
    ),
    (MATRICES, "{order = 1}, ", "{phase = 1.0}, ", "forcing.harmonics.order is missing"),
    (MATRICES, "{order = 1}, ", "1, ", "forcing.harmonics = 1: must be a table"),
    (MATRICES, "phase = -1.0", "fase = 1.0", "unknown key 'forcing.harmonics.fase'"),
    (MATRICES, "amplitude = 0.5", "amplitude = 1e40", "forcing.harmonics[1].amplitude = 1e+40"),
    (MATRICES, "harmonics = [", "harmonics = []\nx = [", "unknown key 'forcing.x'"),
    (BUILDING, "[structure]", "[forcing]\nharmonics = []\n[structure]", "forcing.harmonics = []"),
    (BUILDING, "[structure]", "[forcing]\nharmonics = 3\n[structure]", "forcing.harmonics = 3"),
]


@together("text, old, new, said", WRONG)
def test_a_wrong_structure_is_one_line_that_names_file_key_and_rule(text, old, new, said):
    with pytest.raises(JobError) as caught:
        structure(changed(text, old, new))
    message = str(caught.value)
    assert message.startswith("x.toml: ")
    assert said in message
    assert len(message.splitlines()) == 1
    assert len(message) < 400


@together("place", range(0, len(WRONG), 12))
def test_it_ends_with_code_2_and_nothing_written(place, tmp_path, monkeypatch, capsys):
    text, old, new, said = WRONG[place]
    monkeypatch.chdir(tmp_path)
    (tmp_path / "wrong.toml").write_text(changed(text, old, new) + SWEEP)
    with pytest.raises(SystemExit) as end:
        raise SystemExit(main(["run", "wrong.toml"]))
    assert end.value.code == 2
    shown = capsys.readouterr().err
    assert len(shown.splitlines()) == 1
    assert said in shown
    assert [path.name for path in tmp_path.iterdir()] == ["wrong.toml"]


# --- put together


def test_tables_within_tables_are_written_so_that_they_are_read_back_equal():
    for text in (BUILDING, MATRICES):
        tree = tomllib.loads(text + SWEEP)
        written = write(tree, every_key())
        assert tomllib.loads(written) == tree
        assert structure(text) == parse_job(written, "", "x").structure


def test_what_is_extended_and_set_keeps_matrices_contacts_and_harmonics(tmp_path):
    (tmp_path / "base.toml").write_text(MATRICES + SWEEP)
    own = tmp_path / "own.toml"
    own.write_text('extends = "base.toml"\n[structure]\nsharpness = 1e4\n')
    assert load_job(own).structure == MADE
    assert load_job(own).fingerprint == load_job(tmp_path / "base.toml").fingerprint
    # contacts are one value, replaced whole
    own.write_text(
        'extends = "base.toml"\n[[structure.contact]]\ndirection = [0, 1]\ngap = 1\nstiffness = 9\n'
    )
    assert load_job(own).structure.contacts == (Contact((0.0, 1.0), 1.0, 9.0),)
    assert load_job(own).structure.matrices.stiffness == MADE.matrices.stiffness
    given = ("structure.contact=[{direction = [0, -1], gap = inf, stiffness = 9}]",)
    with pytest.raises(JobError, match=r"structure\.contact\[0\]\.gap must be finite"):
        load_job(own, given)
    given = (
        "structure.contact=[{direction = [0, -1], gap = 2, stiffness = 9}]",
        "forcing.harmonics=[{order = 2, phase = 0.5}]",
    )
    found = load_job(own, given).structure
    assert found.contacts == (Contact((0.0, -1.0), 2.0, 9.0),)
    assert found.harmonics == ((2, 1.0, 0.5),)
    assert parse_job(load_job(own, given).text, "", "x").structure == found


# --- fingerprints


def test_every_new_field_is_part_of_the_fingerprint():
    job = parse_job(SWEEP, "", "x")
    other = [
        {"mass": 2.0},
        {"mass": 1.0},
        {"storey_stiffness": 2.0},
        {"gap": 2.0},
        {"gap": (1.0, 1.0, 2.0)},
        {"gap_left": 1.0},
        {"rayleigh": (0.1, 0.1)},
        {"harmonics": ((1, 1.0, 0.1),)},
        {"harmonics": ((1, 1.0, 0.0), (2, 1.0, 0.0))},
    ]
    found = {job.fingerprint}
    for fields in other:
        changed = dataclasses.replace(job.structure, **fields)
        study = dataclasses.replace(job.study, structure=changed)
        found.add(dataclasses.replace(job, study=study).fingerprint)
    assert len(found) == len(other) + 1


@together("key, whole", [("yield_drift", "2"), ("yield_force", "[2, 3, 4]"), ("gap", "2")])
def test_a_whole_number_means_what_it_does_with_a_point(key, whole):
    texts = (whole, re.sub(r"(\d)", r"\1.0", whole))
    first, second = (f"[structure]\n{key} = {text}\nsharpness = inf\n{SWEEP}" for text in texts)
    assert parse_job(first, "", "x").fingerprint == parse_job(second, "", "x").fingerprint


@together(
    "old, new",
    [
        ("mass = [1.0, 2.0]", "mass = [1.0, 2.5]"),
        ("[2.0, -1.0], [-1.0, 1.0]", "[2.5, -1.0], [-1.0, 1.0]"),
        ("damping = [[0.2,", "damping = [[0.3,"),
        ("damping = [[0.2, -0.1], [-0.1, 0.1]]\n", ""),
        ("forcing = [0.0, 1.0]", "forcing = [0.0, 1.5]"),
        ("forcing = [0.0, 1.0]\n", ""),
        ("drift = [[1.0, 0.0],", "drift = [[1.5, 0.0],"),
        ("direction = [1, -1]", "direction = [1, -1.5]"),
        ("gap = 0.1", "gap = 0.2"),
        ("stiffness = 50", "stiffness = 51"),
        ("phase = -1.0", "phase = -2.0"),
        ("amplitude = 0.5", "amplitude = 0.6"),
        ("order = 3", "order = 4"),
        ("sharpness = 1e4", "sharpness = 1e5"),
    ],
)
def test_every_entry_of_matrices_is_part_of_the_fingerprint(old, new):
    first = parse_job(MATRICES + SWEEP, "", "x").fingerprint
    other = parse_job(changed(MATRICES, old, new) + SWEEP, "", "x").fingerprint
    assert other != first


# --- the file


@pytest.mark.parametrize("text", [BUILDING, MATRICES], ids=["building", "matrices"])
def test_the_file_tells_its_structure(text, tmp_path):
    path = tmp_path / "job.toml"
    path.write_text(text + SWEEP + "transient_cycles = 3\nsampling_cycles = 4\n")
    assert main(["run", str(path), "-o", str(tmp_path / "x.h5")]) == 0
    with h5py.File(tmp_path / "x.h5") as file:
        reported = json.loads(file.attrs["structure"])
    made = load_job(path).structure
    assert reported == describe(made)
    assert np.array_equal(reported["stiffness"], made.stiffness_matrix)
    assert [contact["number"] for contact in reported["contacts"]] == list(made.contact_numbers)
    results = open_results(tmp_path / "x.h5")
    met = np.bitwise_or.reduce(results["contact"].values.ravel())
    assert int(met) & ~sum(1 << (k - 1) for k in made.contact_numbers) == 0
    # described again by the file alone
    again = Structure.from_matrices(
        reported["mass"],
        reported["stiffness"],
        [
            Contact(**{key: c[key] for key in ("direction", "gap", "stiffness")})
            for c in reported["contacts"]
        ],
        damping=reported["damping"],
        forcing=reported["forcing"],
        sharpness=reported["sharpness"],
        harmonics=reported["harmonics"],
        drift=reported["drift"],
    )
    assert again.contacts == made.contacts
    assert np.array_equal(again.damping_matrix, made.damping_matrix)


# --- the shipped ones


@together(
    "name, n, contacts",
    [
        ("pounding", 8, 3),
        ("clearance", 1, 2),
        ("two-masses", 2, 1),
        ("bilinear", 1, 1),
        ("soft-impact", 1, 1),
    ],
)
def test_the_shipped_jobs_are_what_they_say(name, n, contacts):
    job = load_job(JOBS / "structures" / f"{name}.toml")
    assert job.structure.n_floors == n
    assert len(job.structure.contacts) == contacts
    assert foreign(job.structure)


def test_levels_have_one_gap_between_all_neighbours():
    three = [hpcsweep.Building([1.0, 1.0], 10.0, name=name) for name in "ABC"]
    row = hpcsweep.adjacent(three, gap=[0.1, 0.3], stiffness=50.0)
    gaps = dict(zip(row.names.contacts, (one.gap for one in row.contacts), strict=True))
    assert gaps == {"A1-B1": 0.1, "A2-B2": 0.3, "B1-C1": 0.1, "B2-C2": 0.3}


def test_pounding_buildings_are_those_of_three_and_five_equal_storeys():
    found = load_job(JOBS / "structures/pounding.toml").structure
    stiffness = found.stiffness_matrix
    assert np.array_equal(stiffness[:3, :3], Structure(3).stiffness_matrix)
    assert np.array_equal(stiffness[3:, 3:], Structure(5).stiffness_matrix)
    assert not stiffness[:3, 3:].any()
    assert np.array_equal(found.drift_rows[3:, 3:], Structure(5).drift_rows)
    lowest = Structure(5).frequencies[0], Structure(3).frequencies[0]
    assert np.allclose(found.frequencies[:2], lowest)


LOOSE = """
[structure]
damping_ratio = [0.05]
[structure.matrices]
mass = [2.0, 1.0]
stiffness = [[4.0, 0.0], [0.0, 0.0]]
[[structure.contact]]
direction = [-1.0, 1.0]
gap = 0.05
stiffness = 400.0
"""
RECORDS = """
[study]
kind = "records"
[records]
synthetic = {count = 1, seed = 1, duration = 5.0, rms = 1.0}
scale = {values = [1.0]}
"""


def test_gears_that_rattle_are_described_without_a_warning():
    job = load_job(JOBS / "structures/free-play.toml")
    told = told_of(job)
    lines = dict(told)
    assert lines["mode 1"] == "no spring, no damping, shape (0, 1)"
    assert lines["mode 2"].startswith("omega = 1.41421, period 4.44288, damping ratio 0.05")
    assert lines["grazing"].startswith("not known")
    assert "warning" not in lines
    far = load_job(JOBS / "structures/free-play.toml", ["sweep.omega=0.1"])
    assert "warning" not in dict(told_of(far))
    assert "1 motion without spring, rho = inf, c = 2, zeta = 0.05" in lines["structure"]


def test_what_drifts_away_is_refused_in_sweeps_and_told_under_records(tmp_path, capsys):
    said = "structure lets coordinate 2 drift away: neither springs nor sliders nor contacts"
    with pytest.raises(JobError, match=said):
        parse_job(LOOSE + SWEEP, "job", "job")
    path = tmp_path / "loose.toml"
    path.write_text(LOOSE + RECORDS)
    assert dict(told_of(load_job(path)))["free"].startswith("the structure lets coordinate 2")
    assert main(["run", str(path), "-o", str(path.with_suffix(".h5"))]) == 0
    capsys.readouterr()
    assert main(["summary", str(path.with_suffix(".h5"))]) == 0
    assert "free" in (told := capsys.readouterr().out)
    assert "the structure lets coordinate 2 drift away" in told
    assert main(["validate", str(path.with_suffix(".h5"))]) == 0


def test_storeys_without_a_spring_are_free_bodies():
    body = hpcsweep.Building(mass=[1.0], storey_stiffness=0.0)
    side = hpcsweep.Building(mass=[1.0], storey_stiffness=4.0)
    made = hpcsweep.adjacent([side, body, side], gap=0.1, stiffness=10.0)
    assert made.frequencies.tolist() == [0.0, 2.0, 2.0]
    for wrong, said in (
        ({"storey_stiffness": 0.0, "period": 1.0}, "building.period needs a storey_stiffness"),
        ({"storey_stiffness": 0.0, "yield_drift": 1.0}, "must be above 0 of a storey that yields"),
    ):
        with pytest.raises(ValueError, match=said):
            _ = hpcsweep.Building(mass=[1.0], **wrong).structure
    with pytest.raises(ValueError, match="storey_stiffness must be above 0 at a floor with a stop"):
        Structure(2, storey_stiffness=(1.0, 0.0))
