"""Keys that take several values: what may be varied, and what is refused with one line."""

import math
import re
import tomllib

import numpy as np
import pytest
from together import together
from tools import ATTRACTORS, BASINS, GRID, SMALL

from hpcsweep.job import JobError, load_job, parse_job, part_of
from hpcsweep.job.keys import every_key
from hpcsweep.job.tree import write
from hpcsweep.job.vary import NEVER, TABLES
from hpcsweep.model.structure import Structure
from hpcsweep.store.layout import Layout

TWO = """
[vary]
structure.stiffness_ratio = [100, 300.0]
"structure.gap" = {from = 0.5, to = 1.5, count = 3}
"""


def parse(table: str, job: str = SMALL):
    return parse_job(f"{job}\n[vary]\n{table}", "job.toml", "job").study


def test_every_value_of_one_key_goes_with_every_value_of_another():
    study = parse_job(SMALL + TWO, "job.toml", "job").study
    assert study.names == ("stiffness_ratio", "gap")
    assert study.shape == (2, 3)
    assert study.n_runs == 6 * study.base.n_runs == 6 * 88
    assert study.n_frames == 6 * 4
    assert study.run_dims == ("stiffness_ratio", "gap", "direction", "omega", "amplitude")
    seen = {}
    for place in study.places():
        structure = study.part(place).structure
        seen[place] = structure.stiffness_ratio, structure.gap
        assert seen[place] == tuple(study.values_at(place).values())
    assert len(set(seen.values())) == 6


def test_a_key_beside_vary_is_told_to_be_unused():
    assert parse_job(SMALL + TWO, "job.toml", "job").notes == (
        "not used: structure.stiffness_ratio ([vary] gives its values)",
    )


CONTACTS = """
[structure]
[structure.matrices]
mass = [1.0, 1.0]
stiffness = [[2.0, -1.0], [-1.0, 1.0]]
[[structure.contact]]
direction = [0.0, 1.0]
gap = 1.0
stiffness = 100.0
[[structure.contact]]
direction = [0.0, -1.0]
gap = 1.0
stiffness = 100.0
[sweep]
omega = 0.6
amplitude = [0.1, 0.2]
"""


def test_a_key_of_one_of_several_contacts():
    study = parse('"structure.contact[1].gap" = [0.5, 1.5]', CONTACTS)
    assert study.names == ("contact_1_gap",)
    assert study.axes[0].units == "length"
    gaps = [[contact.gap for contact in study.part(p).structure.contacts] for p in study.places()]
    assert gaps == [[1.0, 0.5], [1.0, 1.5]]
    with pytest.raises(JobError, match=r"job\.toml: there are 2 tables structure\.contact, count"):
        parse('"structure.contact[2].gap" = [0.5, 1.5]', CONTACTS)


def test_the_blocks_of_all_parts_are_told_apart_and_found_again():
    study = parse_job(SMALL + TWO, "job.toml", "job").study
    places = [block.place for task in range(study.n_tasks) for block in study.path(task)]
    assert sorted(places) == list(np.ndindex(*(study.dimensions[d] for d in study.commit.dims)))
    for task in range(study.n_tasks):
        for block in study.path(task):
            assert block.task == task == study.task_of(*block.place)
            assert study.block(block.place) == block


def test_a_part_is_a_job_of_its_own():
    job = parse_job(SMALL + TWO, "job.toml", "job")
    part = part_of(job, (1, 2))
    alone = SMALL.replace("300.0\nsharp", "300.0\ngap = 1.5\nsharp")
    assert part.fingerprint == parse_job(alone, "job.toml", "job").fingerprint
    assert parse_job(part.text, "job.toml", "job").fingerprint == part.fingerprint
    assert job.fingerprint != part.fingerprint
    other = parse_job(SMALL + TWO.replace("1.5", "1.6"), "job.toml", "job")
    assert other.fingerprint != job.fingerprint


@together(
    "table, job, names",
    [
        ("sweep.transient_cycles = [10, 20]", SMALL, ("transient_cycles",)),
        ('solver.skip = ["all", "none"]', SMALL, ("skip",)),
        ("solver.rtol = [1e-6, 1e-9]", SMALL, ("rtol",)),
        ("study.seed = [1, 2, 3]", ATTRACTORS, ("seed",)),
        ("structure.gap = [0.4, 0.5]", BASINS, ("gap",)),
    ],
)
def test_numbers_and_words_of_any_kind_of_study(table, job, names):
    study = parse(table, job)
    assert study.names == names
    assert study.n_runs == len(study.axes[0].values) * study.base.n_runs


def test_it_is_set_and_extended_as_any_key_is(tmp_path):
    base, job = tmp_path / "base.toml", tmp_path / "job.toml"
    base.write_text(SMALL + TWO)
    job.write_text('extends = "base.toml"\n[vary]\n"structure.gap" = [2.0]\n')
    assert load_job(job).study.shape == (2, 1)
    found = load_job(job, ['vary."structure.gap"=[1.0, 2.0, 3.0, 4.0]'])
    assert found.study.shape == (2, 4)


@together(
    "table, words",
    [
        ("", "vary"),
        ("gap = [1.0, 2.0]", "'gap': must be a key of study, structure, pounding, sweep, solver"),
        ("output.block = [1, 2]", "'output.block': must be a key of"),
        ("structure.gapp = [1.0, 2.0]", "unknown key 'structure.gapp'; did you mean 'gap'?"),
        ("study.kind = ['points', 'attractors']", "vary.study.kind"),
        ("sweep.omega = [1.0, 2.0]", "vary.sweep.omega = [1.0, 2.0]"),
        ("structure.gap = []", "vary.structure.gap"),
        ("structure.gap = [1.0, 1.0]", "must not hold a value twice"),
        ("structure.gap = [1.0, 'a']", "structure.gap must be a number, is 'a'"),
        ("structure.gap = [1.0, inf]", "gap"),
        (
            "structure.stiffness_ratio = [1.0, -1.0]",
            "structure.stiffness_ratio must be at least 0, or inf, is -1.0",
        ),
        ("structure.n_floors = [2, 3]", "n_floors = 3: all parts must be of one shape"),
        (
            "structure.gap = {from = 0.5, to = 1, count = 200000}",
            "200000: must be a whole number from 2 to 100000",
        ),
        ('structure.mass = ["a", "b"]', "structure.mass"),
        ("structure.sharpness = [nan]", "vary.structure.sharpness = nan"),
        ("study.refine = [{levels = 3}]", "vary.study.refine = {'levels': 3}: must be numbers"),
        ("structure.gap = [1979-05-27]", "vary.structure.gap"),
        ("structure.tension = [true, 'true']", "must not hold a value twice"),
        ("structure.tension = [true, 1]", "structure.tension must be true or false, is 1"),
        ("sweep.directions = ['up', 'down']", "sweep.directions"),
    ],
)
def test_what_cannot_be_varied_is_refused_with_one_line(table, words):
    with pytest.raises(JobError) as refused:
        parse(table)
    said = str(refused.value)
    assert said.startswith("job.toml: ")
    assert words in said
    assert "\n" not in said


SHARP = SMALL.replace("sharpness = 4e3", "sharpness = inf\nrestitution = 0.7")


@together(
    "key, given, values, job",
    [
        ("structure.sharpness", "[inf, 1e4]", (math.inf, 1e4), SMALL),
        ("structure.gap_left", "[1, 0.5]", (1.0, 0.5), SMALL),
        ("structure.gap_left", "inf", (math.inf,), SMALL),
        ("structure.tension", "[true, false]", ("true", "false"), SHARP),
        ("structure.damping_ratio", "[0.05, [0.02, 0.03]]", ("0.05", "[0.02, 0.03]"), SMALL),
        ("structure.rayleigh", "[[0.1, 0.0]]", ("[0.1, 0.0]",), SMALL.replace("damp", "#")),
        ("structure.gap", "[[1.0, 0.5], [0.5, 1.0]]", ("[1.0, 0.5]", "[0.5, 1.0]"), SMALL),
        ("solver.skip", '["all", ["linear"]]', ("all", '["linear"]'), SMALL),
        ("sweep.transient_cycles", "[10, 20]", (10, 20), SMALL),
        ("study.displacement", "[[-1, 1], [-2, 2]]", ("[-1, 1]", "[-2, 2]"), ATTRACTORS),
        ("study.components", '[["u_1", "v_1"]]', ('["u_1", "v_1"]',), BASINS),
    ],
)
def test_a_value_is_what_the_key_itself_takes(key, given, values, job):
    """Each part is the job with that value, whatever its kind; the file holds numbers or words."""
    whole = parse_job(f"{job}\n[vary]\n{key} = {given}", "job.toml", "job")
    (axis,) = whole.study.axes
    assert axis.values == values
    assert list(map(type, axis.values)) == list(map(type, values))
    assert axis.coordinate.values.tolist() == list(values)
    wanted = tomllib.loads(f"x = {given}")["x"]
    for place, value in enumerate(wanted if isinstance(wanted, list) else [wanted]):
        table, _, name = key.partition(".")
        alone = tomllib.loads(job)
        alone[table] = {**alone.get(table, {}), name: value}
        own = parse_job(write(alone, every_key()), "job.toml", "job")
        assert part_of(whole, (place,)).fingerprint == own.fingerprint


@together(
    "key, wrong, said",
    [
        ("structure.mass", "1e31", "must be 0 or of a size"),
        ("structure.storey_stiffness", "-1.0", "must be finite and at least 0"),
        ("structure.stiffness_ratio", "1e13", r"must be at most 1e\+12"),
        ("structure.gap", "nan", "must be numbers"),
    ],
)
def test_extremes_of_a_key_with_limits_of_its_own_stand_for_all(monkeypatch, key, wrong, said):
    made, plain = [], Structure.__post_init__
    monkeypatch.setattr(Structure, "__post_init__", lambda own: [made.append(1), plain(own)][1])
    values = [str(0.5 + k / 64) for k in range(60)]
    assert len(parse(f"{key} = [{', '.join(values)}]").axes[0].values) == 60
    assert (len(made) < 30) == (key != "structure.gap")
    monkeypatch.undo()
    with pytest.raises(JobError, match=said):
        parse(f"{key} = [{', '.join([*values[:30], wrong, *values[30:]])}]")


def test_points_of_a_list_are_varied_with_a_key():
    text = '[study]\nkind = "points"\npoints = [[0.1, 0.5], [0.2, 0.7]]\n'
    study = parse("structure.gap = [0.5, 1.0]", text)
    assert study.n_runs == 4
    with pytest.raises(JobError, match=r"vary\.study\.points = .*has another omega than the first"):
        parse("study.points = [[[0.1, 0.5]], [[0.1, 0.6]]]", text)


@together("job", [SMALL, GRID, ATTRACTORS, BASINS])
def test_no_key_has_the_name_of_another_or_of_something_in_the_file(job):
    """Why an axis can be called as its key is, without the table."""
    study = parse_job(job, "job.toml", "job").study
    # those of pounding do not go with a structure
    keys = [key for table in TABLES if table != "pounding" for key in every_key()[table]]
    assert len(keys) > 30
    assert len(set(keys)) == len(keys)
    held = {variable.name for variable in (*study.variables, study.commit)} | {*study.dimensions}
    tables_alone = {"contact"}
    assert held & {*keys} <= {key.split(".")[1] for key in NEVER} | tables_alone


def test_what_is_given_beside_vary_has_to_be_right():
    text = SMALL + "[vary]\nstructure.gap = [0.5, 1.0]\n"
    for given, message in (('"5 cm"', "gap must be a number, is '5 cm'"), ("[1, 2, 3]", "gap")):
        wrong = text.replace("[sweep]", f"gap = {given}\n\n[sweep]", 1)
        with pytest.raises(JobError, match=message):
            parse_job(wrong, "job", "job")
    right = text.replace("[sweep]", "gap = 0.7\n\n[sweep]", 1)
    assert parse_job(right, "job", "job").study.axes[0].values == (0.5, 1.0)


PAIR = """
[study]
kind = "records"
[[building]]
name = "A"
mass = [1e5, 1e5]
period = 0.5
rayleigh = [1.0, 0.002]
[[building]]
mass = [1e5]
period = 0.3
[pounding]
gap = 0.05
stiffness = 1e8
[records]
synthetic = {count = 1, seed = 1, duration = 5.0}
scale = {values = [1.0]}
"""


RAYLEIGH = re.sub("damping_ratio = .*", "rayleigh = [0.1, 0.1]", SMALL)


@together(
    "table, job, owner",
    [
        ('"building[0].period" = [0.5, 0.8]', PAIR, "building[0]"),
        ("structure.mass = [1.0, 2.0]", RAYLEIGH, "structure"),
    ],
)
def test_what_changes_the_ratios_of_rayleigh_is_refused(table, job, owner):
    with pytest.raises(JobError, match="gives: its alpha and beta belong to one set") as error:
        parse(table, job)
    assert f"{owner}.rayleigh" in str(error.value)
    assert "\n" not in str(error.value)


@together(
    "table, job, label",
    [
        ("structure.rayleigh.ratio = [0.02, 0.07]", SMALL, "rayleigh_ratio"),
        ("structure.mass = [1.0, 2.0]", SMALL, "mass"),
        ('"building[0].rayleigh.ratio" = [0.02, 0.07]', PAIR, "building_0_rayleigh_ratio"),
        ('"building[0].period" = [0.5, 0.8]', PAIR, "building_0_period"),
    ],
)
def test_rayleigh_by_a_ratio_belongs_to_each_part(table, job, label):
    given = "rayleigh = {ratio = 0.05, modes = [1, 2]}"
    study = parse(table, re.sub("(damping_ratio|rayleigh) = .*", given, job))
    (axis,) = study.axes
    assert axis.name == label
    for place, value in zip(study.places(), axis.values, strict=True):
        ratio = value if "ratio" in table else 0.05
        found = study.part(place).structure.damping_ratios
        assert (abs(found - ratio) < 1e-9).sum() >= 2


def test_where_the_damping_is_a_ratio_it_stays_one():
    study = parse('"building[1].period" = [0.3, 0.6]', PAIR)
    for place in study.places():
        structure = study.part(place).structure
        # uncoupled: the building of one storey keeps its 5 %, the other its alpha and beta
        assert (abs(structure.damping_ratios - 0.05) < 1e-12).sum() == 1
        assert "damping matrix, ratios" in repr(structure)
        assert "damping_ratio=" not in repr(structure)


@together(
    "table, unit",
    [
        ("structure.gap = [1.0, 2.0]", "length"),
        ("structure.gap = [2.0, 1.0]", "length"),
        ("structure.stiffness_ratio = [10.0, 20.0]", "gaps"),
    ],
)
def test_lengths_are_in_gaps_only_where_all_gaps_are_one(table, unit):
    layout = Layout(parse_job(f"{SMALL}\n[vary]\n{table}", "job.toml", "job"))
    amplitude = layout.coordinates["amplitude"].units
    assert amplitude == f"{unit} omega_0^2"
    assert unit in {v.name: v for v in layout.variables}["poincare"].units


def test_a_value_beside_vary_is_told_and_has_to_be_right_in_one_of_several_tables_too():
    table = '[vary]\n"building[0].damping_ratio" = [0.02, 0.05]\n'
    bare = PAIR.replace("rayleigh = [1.0, 0.002]\n", "")
    assert parse_job(bare + table, "job", "job").notes == ()
    own, wrong = (bare.replace("period", f"damping_ratio = {x}\nperiod", 1) for x in (0.1, -0.1))
    job = parse_job(own + table, "job", "job")
    assert job.notes == ("not used: building[0].damping_ratio ([vary] gives its values)",)
    with pytest.raises(JobError, match=r"building\[0\]\.damping_ratio must be finite"):
        parse_job(wrong + table, "job", "job")
