import json
import re
import tomllib

import pytest
from together import together
from tools import hpcsweep

from hpcsweep.job import JobError, load_job, parse_job
from hpcsweep.job.job import ABOUT
from hpcsweep.job.keys import DEFAULT_KIND, KINDS, declared, keys_of
from hpcsweep.job.template import template
from hpcsweep.job.values import MAX_VALUES
from hpcsweep.model.matrices import MAX_FLOORS
from hpcsweep.solvers.solver import SOLVERS
from hpcsweep.studies.settings import MAX_CYCLES, SKIP_RULES

TEMPLATE = template()
KEYS = keys_of(KINDS[DEFAULT_KIND])
VALUELESS = {
    table: tuple(key.name for key in keys if not (key.shown or key.example))
    for table, keys in declared(KINDS[DEFAULT_KIND]).items()
}
"""Keys without a value to show, which the template only mentions."""
EVERY_KEY = re.sub(r"^#(?=\w+ = )", "", TEMPLATE, flags=re.MULTILINE)
"""The template with every key given."""


def test_it_has_every_key_in_its_table_in_order_and_no_other():
    tree = tomllib.loads(EVERY_KEY)
    for key in ("extends", "name"):
        assert tree.pop(key)
    assert all(f"# {key}: " in TEMPLATE for key in ("part", *ABOUT))
    found = {name: tuple(table) for name, table in tree.items()}
    right = {
        table: tuple(key for key in keys if key not in VALUELESS[table])
        for table, keys in KEYS.items()
        if table
    }
    assert found == {table: keys for table, keys in right.items() if keys}


def test_it_is_valid_as_it_is_and_every_value_shown_is_the_default():
    least = parse_job(
        "[sweep]\nomega = 0.445\namplitude = {from = 0.005, to = 0.25, step = 0.0025}", "x", "x"
    )
    assert parse_job(TEMPLATE, "x", "x").fingerprint == least.fingerprint


def test_with_every_key_given_it_means_the_same(tmp_path):
    (tmp_path / "other.toml").write_text("[structure]\nn_floors = 5\n")
    (tmp_path / "x.toml").write_text(EVERY_KEY)
    found = load_job(tmp_path / "x.toml")
    assert found.fingerprint == parse_job(TEMPLATE, "x", "x").fingerprint
    assert found.name == "other"


def test_a_key_without_its_mark_takes_effect():
    first = parse_job(TEMPLATE, "x", "x").fingerprint
    for old, new in [
        ("#n_floors = 3", "n_floors = 4"),
        ("#rtol = 1e-9", "rtol = 1e-8"),
        ("#lyapunov = false", "lyapunov = true"),
        ("#block = 50", "block = 51"),
        ("#max_points = 100", "max_points = 99"),
    ]:
        assert TEMPLATE.count(old) == 1
        assert parse_job(TEMPLATE.replace(old, new), "x", "x").fingerprint != first


def shown(key: str) -> str:
    """Return the comment of the template before a key."""
    before = re.split(rf"^#?{key} = .*$", TEMPLATE, flags=re.MULTILINE)[0]
    return " ".join(line.removeprefix("# ") for line in before.split("\n\n")[-1].splitlines())


def test_every_kind_of_study_is_told():
    for kind, study in KINDS.items():
        assert study.kind == kind
        assert f'# "{kind}": ' in TEMPLATE


def test_every_key_has_a_meaning_and_every_value_is_of_its_type_and_within_its_limits():
    parse_job(TEMPLATE + "[vary]\nstructure.gap = [1.0, 2.0]", "x", "x")
    for study in KINDS.values():
        for key in (key for keys in declared(study).values() for key in keys):
            assert key.meaning or key.name in KEYS
            if key.shown:
                value = tomllib.loads(f"x = {key.shown}")["x"]
                assert (type(value), value) == (type(key.default), key.default)
            if key.limits and key.default is not None and isinstance(key.default, int | float):
                assert key.limits[0] <= key.default <= key.limits[1]


@together(
    "key, least, most",
    [
        ("n_floors", "1", str(MAX_FLOORS)),
        ("transient_cycles", "0", str(MAX_CYCLES)),
        ("sampling_cycles", "1", str(MAX_CYCLES)),
        ("block", "1", str(MAX_VALUES)),
        ("rtol", "1e-13", "1e-2"),
    ],
)
def test_the_ranges_it_tells_are_those_that_hold(key, least, most):
    assert f"from {least} to {most}" in shown(key)
    line = re.search(rf"^#{key} = .*$", TEMPLATE, flags=re.MULTILINE)[0]
    for value in (least, most):
        assert parse_job(TEMPLATE.replace(line, f"{key} = {value}"), "x", "x").study.n_runs == 198
    inside = tomllib.loads(f"least = {least}\nmost = {most}")
    step = 1 if isinstance(inside["least"], int) else inside["least"] / 2
    for value in (inside["least"] - step, inside["most"] + step):
        with pytest.raises(JobError, match=key):
            parse_job(TEMPLATE.replace(line, f"{key} = {value!r}"), "x", "x")


def test_it_tells_every_solver_and_every_rule():
    assert all(f'"{name}"' in shown("method") for name in SOLVERS)
    assert all(f'"{name}"' in shown("skip") for name in SKIP_RULES)


def test_it_is_written_runs_and_completes(tmp_path):
    done = hpcsweep(0, "new", "study.toml", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "hpcsweep run study.toml" in done.stdout
    assert (tmp_path / "study.toml").read_text() == TEMPLATE
    done = hpcsweep(0, "run", "study.toml", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    state = json.loads(hpcsweep(0, "status", "study.h5", "--json", cwd=tmp_path).stdout)
    assert state["complete"]
    assert state["runs_total"] == 198


@together("kind", KINDS)
def test_one_of_every_kind_is_valid_small_and_tells_all_its_keys(kind, tmp_path):
    done = hpcsweep(0, "new", f"{kind}.toml", "--kind", kind, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    text = (tmp_path / f"{kind}.toml").read_text()
    study = parse_job(text, "x", "x").study
    assert (study.kind, study.n_runs < 2000) == (kind, True)
    for table, keys in declared(KINDS[kind]).items():
        if not table or (kind == "records" and table == "structure"):
            continue
        assert [key.name for key in keys if not re.search(rf"\b{key.name}\b", text)] == []
    assert "](" not in text


def test_a_kind_that_is_not_known_is_one_line(tmp_path):
    done = hpcsweep(0, "new", "study.toml", "--kind", "record", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert "argument --kind: invalid choice: 'record'" in done.stderr
    assert (done.stderr.count("\n"), list(tmp_path.iterdir())) == (1, [])


@pytest.mark.slow
@pytest.mark.mpi
def test_on_many_ranks_one_writes(tmp_path):
    done = hpcsweep(2, "new", "study.toml", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("written") == 1
    assert (tmp_path / "study.toml").read_text() == TEMPLATE


def test_nothing_is_overwritten_and_each_mistake_is_one_line(tmp_path):
    mine = tmp_path / "mine.toml"
    mine.write_text("mine")
    (tmp_path / "folder.toml").mkdir()
    (tmp_path / "loose.toml").symlink_to(tmp_path / "absent")
    for name, words in [
        ("mine.toml", "mine.toml: exists already"),
        ("folder.toml", "folder.toml: exists already"),
        ("loose.toml", "loose.toml: exists already"),
        ("no/study.toml", "no/study.toml: cannot be written: No such file"),
        ("study.h5", "study.h5: the name of a job file must end in .toml"),
        ("study", "must end in .toml"),
    ]:
        done = hpcsweep(0, "new", name, cwd=tmp_path)
        assert done.returncode == 2
        assert words in done.stderr
        assert done.stderr.count("\n") == 1
        assert done.stdout == ""
    assert mine.read_text() == "mine"
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "folder.toml",
        "loose.toml",
        "mine.toml",
    ]
