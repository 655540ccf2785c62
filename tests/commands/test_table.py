"""Tables of results: what is read back from them, and what is refused."""

import csv
import importlib
import re

import pytest
from together import together
from tools import RECORDS, SMALL

from hpcsweep import meanings, open_results
from hpcsweep.campaign import run as campaign
from hpcsweep.commands.cli import main
from hpcsweep.earthquakes.demands import as_cell
from hpcsweep.job import parse_job
from hpcsweep.job.tree import write_value
from hpcsweep.parallel.mpi import Serial

ROWS = """
[vary]
rows = [
    {name = "near", "pounding.gap" = 0.01, "pounding.tension" = true},
    {name = "far", "pounding.gap" = 0.04, "pounding.tension" = false},
]
"""
FEW = RECORDS.replace("stiffness = 2e9", "stiffness = 2e9\nrestitution = 0.6").replace(
    "count = 5}", "count = 2}"
)


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    path = tmp_path_factory.mktemp("table") / "pair.h5"
    assert campaign.run(parse_job(FEW + ROWS, "job", "pair"), path, Serial()) == 0
    return path


def read(path) -> list[dict]:
    """Return rows by the names of their columns, without units."""
    with path.open(newline="") as stream:
        table = csv.reader(stream)
        names = [name.partition(" [")[0] for name in next(table)]
        return [dict(zip(names, row, strict=True)) for row in table]


def test_a_row_for_each_structure_record_scale_and_place(file, tmp_path, capsys):
    """Every number as `open_results` has it, to the last bit; drifts in percent of 3.2 m."""
    path = tmp_path / "all.csv"
    what = "drift,acceleration,force,impacts,pga"
    assert main(["table", str(file), "-o", str(path), "--what", what]) == 0
    assert ": 112 rows, drift in %, acceleration in length/time^2, " in capsys.readouterr().out
    found, rows = open_results(file), read(path)
    places = [*found.storey.values, *found.stop.values]
    assert places == ["A1", "A2", "B1", "B2", "B3", "A1-B1", "A2-B2"]
    assert len(rows) == 2 * 4 * 2 * len(places)
    for row in rows:
        at = {"structure": row["structure"], "record": row["record"], "scale": float(row["scale"])}
        one = found.sel(at)
        assert float(row["gap"]) == one.gap.item()
        assert row["tension"] == ("true" if row["structure"] == "near" else "false")
        assert float(row["pga"]) == one.pga.item()
        if row["place"] in found.stop.values:
            assert row["drift"] == row["acceleration"] == ""
            assert float(row["force"]) == one.contact_force.sel(stop=row["place"]).item()
            assert float(row["impacts"]) == one.impacts.sel(stop=row["place"]).item()
        else:
            drift = one.storey_drift.sel(storey=row["place"]).item()
            assert float(row["drift"]) == pytest.approx(100 * drift / 3.2, rel=1e-15)
            acceleration = one.floor_acceleration.sel(floor=row["place"]).item()
            assert float(row["acceleration"]) == acceleration
            assert row["force"] == row["impacts"] == ""
    asked = [*rows[0]][-5:]
    assert asked == what.split(",")


def test_only_what_is_asked_of_a_building_and_a_structure(file, tmp_path):
    path = tmp_path / "some.csv"
    given = ["--what", "storey_drift", "--place", "B", "--at", "structure=far", "-o", str(path)]
    assert main(["table", str(file), *given]) == 0
    rows = read(path)
    assert {row["structure"] for row in rows} == {"far"}
    assert [row["place"] for row in rows] == ["B1", "B2", "B3"] * 8
    assert [*rows[0]] == ["structure", "gap", "tension", "record", "scale", "place", "storey_drift"]
    header = (
        "structure,gap [length],tension,record,scale [length/time^2],place,storey_drift [length]"
    )
    assert path.read_text().splitlines()[0] == header
    # a table is written over a table, and over nothing else
    assert main(["table", str(file), *given]) == 0
    path.write_text("name,pounding.gap\nmine,1\n")
    assert main(["table", str(file), *given]) == 2


def test_motions_have_a_row_a_run_and_what_is_not_computed_has_none(tmp_path):
    file, path = tmp_path / "a.h5", tmp_path / "a.csv"
    text = SMALL.replace("[output]", "[output]\nstorey_drift = true")
    assert campaign.run(parse_job(text, "job", "a"), file, Serial()) == 0
    assert main(["table", str(file)]) == 0
    rows, found = read(path), open_results(file)
    assert len(rows) == found.storey_drift.size  # which was asked for
    assert [*rows[0]][:3] == ["direction", "omega", "amplitude"]
    header = path.read_text().partition("n_points")[0]
    assert header == "direction,omega [omega_0],amplitude [gaps omega_0^2],place,"
    assert main(["table", str(file)]) == 0  # over a table
    for row in rows[::7]:
        at = {"omega": float(row["omega"]), "amplitude": float(row["amplitude"])}
        one = found.sel(direction=row["direction"], **at)
        assert int(row["orbit_period"]) == one.orbit_period.item()
        assert float(row["drift"]) == one.drift.item()
        assert float(row["storey_drift"]) == one.storey_drift.sel(storey=row["place"]).item()
        assert row["motion"] == meanings(one.motion).item()


def test_lasting_drifts_are_in_the_unit_and_sense_of_drifts(tmp_path):
    file, path = tmp_path / "a.h5", tmp_path / "a.csv"
    text = FEW.replace('"A"\n', '"A"\nyield_drift = 2e-3\n').replace("to = 5.0", "to = 20.0")
    text += '[units]\nlength = "m"\nmass = "kg"\ntime = "s"\n'
    assert campaign.run(parse_job(text, "job", "a"), file, Serial()) == 0
    assert main(["table", str(file), "--what", "drift,residual_drift,ductility"]) == 0
    header = path.read_text().splitlines()[0]
    assert header == "record,scale [m/s^2],place,drift [%],residual_drift [%],ductility"
    found = open_results(file).residual_drift
    assert (found < -1e-6).any()
    for row in read(path):
        one = found.sel(record=row["record"], scale=float(row["scale"]))
        if row["place"] in found.storey.values:
            wanted = 100 * abs(one.sel(storey=row["place"]).item()) / 3.2
            assert float(row["residual_drift"]) == pytest.approx(wanted, rel=1e-15)
            assert float(row["residual_drift"]) <= float(row["drift"]) * (1 + 1e-12)


def test_scales_in_g_are_told_in_g(tmp_path, capsys):
    text = FEW.replace("from = 0.5, to = 5.0, count = 2", 'unit = "g", values = [0.1, 0.3]')
    file, path = tmp_path / "a.h5", tmp_path / "a.csv"
    (tmp_path / "a.toml").write_text(text)
    assert campaign.run(parse_job(text, "job", "a"), file, Serial()) == 0
    assert main(["table", str(file), "--what", "drift"]) == 0
    assert path.read_text().startswith("record,scale [g],place,drift [%]\n")
    drift = open_results(file).storey_drift
    for row in read(path):
        one = drift.sel(record=row["record"], storey=row["place"])
        at = ["0.1", "0.3"].index(row["scale"])
        assert drift.scale[at].item() == pytest.approx(9.80665 * float(row["scale"]), rel=1e-15)
        assert float(row["drift"]) == pytest.approx(100 * abs(one[at].item()) / 3.2, rel=1e-15)
    for command in (["describe", str(tmp_path / "a.toml")], ["summary", str(file)]):
        assert main(command) == 0
    told = capsys.readouterr().out
    assert "2 of PGA, 0.1 to 0.3 g; records" in told
    assert len(re.findall("^ +largest .*, scale 0.3 g\\)$", told, re.M)) > 2


def test_no_cell_is_a_formula_to_a_spreadsheet(tmp_path):
    names = ["=cmd|' /C calc'!A0", "@SUM(1)", "+1+1", "-1", "plain = 1"]
    rows = [{"name": name, "pounding.gap": 0.01 * (k + 1)} for k, name in enumerate(names)]
    job = parse_job(FEW + "[vary]\nrows = " + write_value(rows), "job", "pair")
    file, path = tmp_path / "a.h5", tmp_path / "a.csv"
    assert campaign.run(job, file, Serial()) == 0
    assert main(["table", str(file), "-o", str(path)]) == 0
    told = {row["structure"] for row in read(path)}
    assert told == {f"'{name}" for name in names[:4]} | {names[4]}
    cells = as_cell("=1"), as_cell("a"), as_cell(-1.0), as_cell(False)
    assert cells == ("'=1", "a", -1.0, False)


@pytest.mark.slow
@pytest.mark.parametrize("end", [".xlsx", ".parquet"])
def test_workbooks_and_parquet_hold_the_same(file, tmp_path, end):
    import pandas

    read = {".xlsx": pandas.read_excel, ".parquet": pandas.read_parquet}[end]
    for path in (tmp_path / "a.csv", tmp_path / f"a{end}"):
        assert main(["table", str(file), "--what", "drift,force", "-o", str(path)]) == 0
    wanted, found = pandas.read_csv(tmp_path / "a.csv"), read(tmp_path / f"a{end}")
    if end == ".parquet":
        wanted["tension"] = wanted["tension"].astype(str).str.lower()
    pandas.testing.assert_frame_equal(wanted, found, check_dtype=False, rtol=1e-15)


@together(
    "given, said",
    [
        (["--what", "drift,mass"], "--what mass: must be of drift, displacement, acceleration, "),
        (["--what", "history_force"], "--what history_force: must be of"),
        (["--place", "C"], "C: must be one of A1, A2, B1, B2, B3, or a building"),
        (["-o", "a.txt"], "a.txt: the name of a table must end in .csv, .xlsx, .parquet"),
        (["-o", "a.xlsx"], "a.xlsx: needs openpyxl, which is not installed: pip install openpyxl"),
        (["--at", "structure=no"], "structure = no: must be one of near, far"),
    ],
)
def test_mistakes_are_told_in_one_line_and_nothing_is_written(
    file, tmp_path, capsys, monkeypatch, given, said
):
    def absent(name):
        raise ImportError(name)

    monkeypatch.chdir(tmp_path)
    given = given if "-o" in given else [*given, "-o", "a.csv"]
    with monkeypatch.context() as patched:
        if "a.xlsx" in given:
            patched.setattr(importlib, "import_module", absent)
        assert main(["table", str(file), *given]) == 2
    told = capsys.readouterr().err
    assert said in told
    assert told.count("\n") == 1
    assert [*tmp_path.iterdir()] == []


def test_frequencies_and_amplitudes_of_formulas_are_columns(tmp_path):
    job = (
        SMALL
        + """
[vary]
"structure.gap" = [0.5, 1.0]
"""
    )
    job = re.sub("(?m)^amplitude = .*$", 'amplitude = "0.01 / gap"\nalong = "structure.gap"', job)
    job = re.sub("(?m)^omega = .*$", 'omega = "0.4 + 0.1 * gap"', job)
    path = tmp_path / "path.h5"
    assert campaign.run(parse_job(job, "job", "path"), path, Serial()) == 0
    assert main(["table", str(path), "--what", "cycles"]) == 0
    rows = read(path.with_suffix(".csv"))
    assert [*rows[0]] == ["direction", "frame", "gap", "omega", "amplitude", "cycles"]
    found = {(row["gap"], row["omega"], row["amplitude"]) for row in rows}
    assert found == {("0.5", "0.45", "0.02"), ("1.0", "0.5", "0.01")}
