"""Portfolios: keys that vary together, a row a structure, from a CSV file or the job itself."""

import json
import os
from collections.abc import Mapping

import numpy as np
import pytest
from together import together
from tools import RECORDS, hpcsweep

from hpcsweep import open_results, spectrum, synthetic_records
from hpcsweep.campaign import run as campaign
from hpcsweep.campaign.describe import describe
from hpcsweep.earthquakes.spectrum import Oscillators
from hpcsweep.job import JobError, load_job, parse_job, part_of, vary
from hpcsweep.job.vary import Parts
from hpcsweep.model.structure import Structure
from hpcsweep.parallel.mpi import Serial
from hpcsweep.store import Layout, with_inputs
from hpcsweep.store.contents import create
from hpcsweep.store.inputs import Inputs

PAIR = """
[study]
kind = "records"
[[building]]
name = "A"
mass = [1e5, 1e5]
storey_stiffness = [5e7, 5e7]
storey_height = 3.0
[[building]]
name = "B"
mass = 1e5
period = 0.3
storey_height = 3.0
[pounding]
gap = 0.02
stiffness = 1e8
[records]
synthetic = {count = 2, seed = 1, dt = 0.02, duration = 4.0}
scale = {by = "sa", period = "T1", values = [2.0, 4.0]}
[vary]
rows = "portfolio.csv"
"""
CSV = """\ufeffname;building[0].mass;building[0].storey_stiffness[1];pounding.gap;pounding.tension
School;[1e5, 2e5];5E+07;.05;TRUE
Town hall;[2e5, 2e5];6e7;1;false
;;;;
"""
KEYS = ("building[0].mass", "building[0].storey_stiffness[1]", "pounding.gap", "pounding.tension")
ROWS = [("School", [1e5, 2e5], 5e7, 0.05, True), ("Town hall", [2e5, 2e5], 6e7, 1.0, False)]


@pytest.fixture
def job(tmp_path):
    (tmp_path / "portfolio.csv").write_text(CSV)
    path = tmp_path / "job.toml"
    path.write_text(PAIR.replace("stiffness = 1e8", "stiffness = 1e8\nrestitution = 0.6"))
    return path


def test_a_row_is_the_job_with_its_values(job):
    """Each part equals, in meaning, the job in which its values are set one by one."""
    whole = load_job(job)
    assert whole.study.names == ("structure",)
    alone = job.with_name("alone.toml")
    alone.write_text(job.read_text().partition("[vary]")[0])
    for at, (name, mass, stiffness, gap, tension) in enumerate(ROWS):
        given = (mass, stiffness, gap, str(tension).lower())
        own = load_job(alone, [f"{key}={value}" for key, value in zip(KEYS, given, strict=True)])
        assert part_of(whole, (at,)).fingerprint == own.fingerprint
        assert whole.study.describe_part((at,)) == f"structure = {name}"
    # the job holds the rows, and can be read where the file is not
    assert parse_job(whole.text, "job.toml", "job").fingerprint == whole.fingerprint


def test_a_description_lists_the_first_names_of_many(job):
    rows = "".join(f"house {i};[1e5, 2e5];5e7;0.05;true\n" for i in range(1, 9))
    assert dict(describe(load_job(job)))["varied"] == "rows: School, Town hall"
    job.with_name("portfolio.csv").write_text(CSV.partition("\n")[0] + "\n" + rows)
    names = ", ".join(f"house {i}" for i in range(1, 7))
    assert dict(describe(load_job(job)))["varied"] == f"rows: {names} and 2 more"


def test_the_job_changes_with_the_file(job):
    before = load_job(job).fingerprint
    job.with_name("portfolio.csv").write_text(CSV.replace("6e7", "6.1e7"))
    assert load_job(job).fingerprint != before
    job.with_name("portfolio.csv").write_text(CSV.replace("\ufeff", "").replace(";", "\t"))
    assert load_job(job).fingerprint == before


def test_rows_times_a_key_in_one_file_with_what_differs(job, tmp_path):
    text = job.read_text() + '"building[1].storey_height" = [3.0]\n'
    job.write_text(text)
    assert campaign.run(whole := load_job(job), tmp_path / "a.h5", Serial()) == 0
    found = open_results(tmp_path / "a.h5")
    assert found.displacement.dims[:4] == (
        "structure",
        "building_1_storey_height",
        "record",
        "scale",
    )
    assert found.structure.values.tolist() == ["School", "Town hall"]
    assert found.gap.values.tolist() == [0.05, 1.0]
    assert found.building_0_storey_stiffness_1.values.tolist() == [5e7, 6e7]
    suite = synthetic_records(2, seed=1, dt=0.02, duration=4.0)
    for at, (_, mass, stiffness, _, _) in enumerate(ROWS):
        # the first storey has 5e7: natural frequencies of two floors in closed form
        trace = (5e7 + stiffness) / mass[0] + stiffness / mass[1]
        least = trace / 2 - np.sqrt(trace**2 / 4 - 5e7 * stiffness / mass[0] / mass[1])
        sa = [spectrum(one, [2 * np.pi / np.sqrt(least)]).acceleration[0] for one in suite]
        factor = found.factor.isel(structure=at, building_1_storey_height=0)
        np.testing.assert_allclose(factor, np.array([2.0, 4.0]) / np.array(sa)[:, None], 1e-9)
    job.with_name("portfolio.csv").write_text(CSV.replace("6e7", "7e7"))
    refused = hpcsweep(0, "run", job, "-o", tmp_path / "a.h5")
    assert refused.returncode == 2
    assert "another job" in refused.stderr
    assert whole.study.n_runs == 8


def test_rows_may_be_tables_of_the_job():
    text = RECORDS.partition("[vary]")[0] + '[vary]\nrows = [{"pounding.gap" = 0.1}, {X}]\n'
    study = parse_job(text.replace("X", '"pounding.gap" = 0.1'), "job", "job").study
    assert study.axes[0].values == (1, 2)
    with pytest.raises(JobError, match=r"job: vary\.rows\[1\] = .*: must have the keys pounding"):
        parse_job(text.replace("X", '"pounding.tension" = true'), "job", "job")
    with pytest.raises(JobError, match=r"^job: vary\.rows\[1\], column pounding\.gap = nan: must"):
        parse_job(text.replace("X", '"pounding.gap" = nan'), "job", "job")
    with pytest.raises(JobError, match=r"job: vary\.pounding\.gap: is in vary\.rows, too"):
        parse_job(text.replace("X", '"pounding.gap" = 1') + "pounding.gap = [1]", "job", "job")


@together(
    "was, now, said",
    [
        ("6e7", "-6", "line 3, column building[0].storey_stiffness[1]: building[0].storey_stiff"),
        (";1;", ";wide;", "line 3, column pounding.gap: pounding.gap must be a list of numbers"),
        (";.05;", ";a;", "column pounding.gap: pounding.gap must be a list of numbers, is 'a'"),
        (";1;", ";;", "line 3, column pounding.gap: must have a value, is empty"),
        (";1;", ";nan;", "line 3, column pounding.gap: must have a value, is nan"),
        ("pounding.gap", "output.block", "portfolio.csv: vary: 'output.block': must be a key of"),
        ("2e5, 2e5", "2e5", "line 3, column building[0].storey_stiffness[1]: building[0].storey"),
        ("School;", "", "line 2: must have 5 cells as line 1, has 4"),
        ("pounding.gap", "pounding.gapp", "unknown key 'pounding.gapp'; did you mean 'gap'?"),
        ("mass;", "mass[3];", "building[0].mass[3]: building[0].mass must be a list with that"),
        ("tension", "gap", "line 1: 'pounding.gap' must be the key of one column"),
        ("Town hall", "School", "vary.rows.name"),
        ("\ufeff", "\ufeff\n", "must have a line of keys and a line for each row below it"),
        (CSV.partition("\n")[2], "", "must have a line of keys and a line for each row below it"),
    ],
)
def test_a_wrong_row_is_one_line_with_file_line_column_value_and_limit(job, was, now, said):
    job.with_name("portfolio.csv").write_text(CSV.replace(was, now, 1))
    with pytest.raises(JobError) as refused:
        load_job(job)
    told = str(refused.value)
    assert "\n" not in told
    assert said in told
    assert "portfolio.csv: " in told or "rows" in told


@together(
    "text, gaps",
    [
        ("name;pounding.gap;pounding.stiffness\na;0,5;200.000\nb;1,25;1.200.000\n", [0.5, 1.25]),
        ("sep=;\nname;pounding.gap\na;2,5\nb;3,0\n", [2.5, 3.0]),
        ("name,pounding.gap,\na,2.5,\nb,3.0,\n", [2.5, 3.0]),
        ("name;pounding.gap;pounding.stiffness\na;2.500;1.5e8\nb;3.000;1.0e8\n", [2.5, 3.0]),
    ],
)
def test_a_table_is_read_as_spreadsheets_write_it(job, text, gaps):
    job.with_name("portfolio.csv").write_text(text)
    columns = {one.key: one.given for one in load_job(job).study.axes[0].columns}
    assert columns["pounding.gap"] == tuple(gaps)
    if "1.200.000" in text:
        assert columns["pounding.stiffness"] == (2e5, 1.2e6)


@together(
    "text, said",
    [
        (
            "name;pounding.gap\na;200.000\n",
            "200.000 may be 200000 or a decimal: write 200000, or 200.0",
        ),
        (
            "name;pounding.gap;pounding.stiffness\na;0.5;1,5\n",
            "must have decimal points or decimal c",
        ),
        ("sep=;\nname;pounding.gap\na;-\n", "below its line sep=;: line 2, column pounding.gap"),
        ("name\na\nb\n", "must have a column of a key beside name, has none"),
        (
            f"name,pounding.gap\na,{'3' * 140_000}\n",
            "every cell must have 131072 characters at most",
        ),
    ],
)
def test_what_a_table_cannot_mean_is_refused(job, text, said):
    job.with_name("portfolio.csv").write_text(text)
    with pytest.raises(JobError, match=f"portfolio.csv.*{said}"):
        load_job(job)


@together("word", ["a\nb", "x\x07y", "\x00"])
def test_words_of_rows_can_be_printed(job, word):
    rows = [{"name": word, "pounding.gap": 0.5}, {"name": "c", "pounding.gap": 0.6}]
    text = ", ".join(f'{{name = {json.dumps(row["name"])}, "pounding.gap" = 0.5}}' for row in rows)
    with pytest.raises(JobError, match=r"rows\[0\], column name = .*: must be of characters that"):
        load_job(job, [f"vary.rows=[{text}]"])
    with pytest.raises(JobError, match=r"building\[0\]\.name = .*: must be of characters that"):
        load_job(job, [f'vary={{"building[0].name" = [{json.dumps(word)}, "c"]}}'])


def test_a_pipe_is_no_table(job):
    job.with_name("portfolio.csv").unlink()
    os.mkfifo(job.with_name("portfolio.csv"))
    with pytest.raises(JobError, match=r"job.toml: vary.rows = 'portfolio.csv': must be a regular"):
        load_job(job)


def test_a_key_that_all_rows_share_is_not_blamed_on_one(job):
    with pytest.raises(JobError, match=r"^\S+job.toml with .*: records.tail = -1: must be from"):
        load_job(job, ["records.tail=-1"])


def test_all_wrong_lines_are_told(job):
    job.with_name("portfolio.csv").write_text(CSV.replace(";;;;", "Mill;[1e5];1;1;true\nX;1;1;1;0"))
    with pytest.raises(JobError, match=r"csv: line 4, column .* \(and line 5\)$"):
        load_job(job)
    with pytest.raises(JobError, match=r"vary\.rows = 'none.csv': cannot be read: No such"):
        load_job(job, ['vary.rows="none.csv"'])


MANY = """
[[building]]
mass = [1e5, 1e5]
storey_stiffness = [5e7, 5e7]
storey_height = 3.0
yield_drift = 0.02
isolation = {slab_mass = 1e5, radius = 2.0, friction = 0.05}
[[building]]
mass = [1e5, 2e5]
storey_stiffness = [5e7, 5e7]
storey_height = 3.0
[units]
length = "m"
[pounding]
"""
COLUMNS = (
    *("building[0].mass", "building[0].period", "building[0].isolation.radius"),
    *("building[1].storey_stiffness[0]", "building[1].damping_ratio", "pounding.gap"),
)


@pytest.fixture
def many(job):
    """A job of rows that `table_of` makes."""
    head, _, tail = job.read_text().partition("[[building]]")
    job.write_text(head + MANY + tail.partition("[pounding]\n")[2])
    return job


def table_of(job, n: int, wrong: Mapping[tuple[int, int], str]) -> None:
    """Write n rows for a job, with other cells at some lines and columns."""
    sizes = [1e5, 1e5, 0.2, 1.5, 5e7, 0.03, 0.02]
    rows = np.random.default_rng(1).uniform(1.0, 2.0, (n, 7)) * sizes
    cells = [[str(row[:2]), *map(str, row[2:])] for row in rows.tolist()]
    for (line, column), cell in wrong.items():
        cells[line - 2][column] = cell
    text = "\n".join(map(";".join, [COLUMNS, *cells]))
    job.with_name("portfolio.csv").write_text(text)


def test_a_long_table_needs_few_structures_and_a_stored_one_but_the_first(many, monkeypatch):
    table_of(many, 200, {})
    made, filtered = [], []
    plain, filters = Structure.__post_init__, Oscillators._filtered
    monkeypatch.setattr(Structure, "__post_init__", lambda own: [made.append(1), plain(own)][1])
    monkeypatch.setattr(Oscillators, "_filtered", lambda own: [filtered.append(1), filters(own)][1])
    loaded = load_job(many)
    assert len(made) < 200
    assert len(filtered) == 2  # of a record, all periods together
    made.clear()
    stored = parse_job(loaded.text, "job.h5", "job", is_stored=True)
    assert len(made) < 12
    assert len(filtered) == 2
    for (_, values), (_, again) in zip(loaded.study.given, stored.study.given, strict=True):
        np.testing.assert_array_equal(values, again)
    factor = {one.name: values for one, values in loaded.study.given}["factor"]
    for at in (0, 77, 199):
        part = loaded.study.part((at,))
        np.testing.assert_allclose(factor[at], part.factor, rtol=1e-12)
        sa = spectrum(part.record(1), [2 * np.pi / part.structure.frequencies[0]]).acceleration
        np.testing.assert_allclose(part.factor[1] * sa, [2.0, 4.0], rtol=1e-9)


@together(
    "column, cell, said",
    [
        (0, "[1e5, -1e5]", ", column C: C must be finite and above 0, is -100000.0"),
        (0, "[1e5]", ": building[0].storey_stiffness must have 1 numbers, one per mass, has 2"),
        (1, "1e-40", ", column C: C must be finite and positive, from 1e-12 to 1e+12, is 1e-40"),
        (2, "0.0", ", column C: C must be finite and positive, from 1e-12 to 1e+12, is 0.0"),
        (3, "5e29", ", column C: building[1].storey_stiffness has eigenvalues from 5e+07 to 5e+29"),
        (4, "2e6", ": building.damping_ratio or rayleigh = 2000000.0"),
        (5, "1e31", ", column C: C = 1e+31: must be 0 or of a size from 1e-30 to 1e+30"),
    ],
)
def test_a_wrong_cell_of_a_long_table_is_told_with_its_line(many, column, cell, said):
    table_of(many, 19, {(10, column): cell, (15, column): cell})
    with pytest.raises(JobError) as refused:
        load_job(many)
    told = str(refused.value)
    assert f"portfolio.csv: line 10{said.replace('C', COLUMNS[column])}" in told
    assert told.endswith(" (and line 15)")


def test_each_structure_is_made_once_until_the_runs_begin(job, tmp_path, monkeypatch):
    made, told, plain = [], [], Parts.__call__
    monkeypatch.setattr(Parts, "__call__", lambda self, at: [made.append(at), plain(self, at)][1])
    monkeypatch.setattr(vary, "counted", lambda items, *said: [told.append(said), items][1])
    loaded = with_inputs(load_job(job, ['records.scale={by = "pga", values = [1.0]}']))
    create(tmp_path / "a.h5", Layout(loaded), {})
    Inputs(Layout(loaded)).need()
    assert made == [(0,), (0,), (1,)]  # the first to compare others with
    assert told[0] == (2, "reading structure")
