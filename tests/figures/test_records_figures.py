"""Figures of responses to records, and what `hpcsweep fragility` prints and writes."""

import contextlib
import csv
import json
import math
import re
from dataclasses import replace

import numpy as np
import pytest
from together import together
from tools import RECORDS, hpcsweep

from hpcsweep import (
    Building,
    Slider,
    Structure,
    adjacent,
    floor_spectra,
    fractiles,
    open_results,
    response,
    separation,
    synthetic_records,
)
from hpcsweep.earthquakes.stripes import median_band
from hpcsweep.figures import labels
from hpcsweep.figures.diagrams import responses
from hpcsweep.figures.diagrams.histories import elastic_springs as springs
from hpcsweep.figures.diagrams.responses import buildings, edge_of, within
from hpcsweep.figures.options import figures
from hpcsweep.figures.style import PlotError, new_figure
from hpcsweep.job import parse_job
from hpcsweep.model.unit_names import UnitNames
from hpcsweep.solvers.history import history
from hpcsweep.store import Frames
from hpcsweep.studies.ground_motion.describe import alone_words
from hpcsweep.studies.ground_motion.stripes import RESPONSES, StripesError, fit, stripes_of

SCALES = '{by = "sa", period = 0.5, from = 0.5, to = 20.0, count = 20}'
TEXT = RECORDS.replace('{by = "pga", from = 0.5, to = 5.0, count = 5}', SCALES).replace(
    "count = 4, seed", "count = 8, seed"
)
KINDS = [name for name, figure in figures().items() if figure.draws == ("responses",)]
KINDS.remove("portfolio")  # of a job that varies keys
TWICE = [0.25 * 9.80665, 0.5 * 9.80665, 9.80665]
OPTIONS = {"fragility": ["--threshold", "0.5"], "profile": ["--scale", "10"]}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("figures")
    (made / "job.toml").write_text(TEXT)
    yields = TEXT.replace("count = 20}", "count = 2}").replace('"A"\n', '"A"\nyield_drift = 1e-3\n')
    (made / "hysteresis.toml").write_text(yields)
    for job in ("job.toml", "hysteresis.toml"):
        assert hpcsweep(0, "run", job, cwd=made).returncode == 0
    return made


@pytest.mark.parametrize(
    "kind", [pytest.param(kind, marks=[pytest.mark.slow] * ("spectra" in kind)) for kind in KINDS]
)
def test_every_figure_is_drawn(folder, kind):
    options = OPTIONS.get(kind, [])
    name = "hysteresis.h5" if kind == "hysteresis" else "job.h5"
    done = hpcsweep(0, "plot", name, "--kind", kind, "-o", f"{kind}.png", *options, cwd=folder)
    assert done.returncode == 0, done.stderr
    assert (folder / f"{kind}.png").stat().st_size > 10_000


@pytest.mark.slow
@together(
    "arguments, said",
    [
        (["plot", "job.h5", "--kind", "fragility"], "--threshold is missing"),
        (["plot", "job.h5", "--kind", "fragility", "--threshold", "1e9"], "of 8 records 0 reach"),
        (["plot", "job.h5", "--place", "C"], "C: must be one of A1, A2, B1, B2, B3"),
        (["plot", "job.h5", "--kind", "history", "--record", "x"], "must be one of synthetic-3-1"),
        (["plot", "job.h5", "--kind", "profile", "--response", "force"], "no profile"),
        (["plot", "job.h5", "--kind", "history", "--time", "3", "2"], "must ascend, from 0 to 11"),
        (["plot", "job.h5", "--kind", "floor-spectra", "--place", "A"], "of A1, A2, B1, B2, B3"),
        (["plot", "job.h5", "--kind", "orbit"], "holds responses"),
        (["plot", "job.h5", "--kind", "hysteresis"], "the structure has no sliders"),
        (["plot", "hysteresis.h5", "--kind", "hysteresis", "--place", "B1"], "of A1, A2"),
        (["plot", "job.h5", "--scale", "nan"], "argument --scale: must be greater than 0, is nan"),
        (["fragility", "job.h5", "--scale", "nan", "--demands", "new.csv"], "is nan"),
        (
            ["fragility", "job.h5", "--threshold", "1e9"],
            "--threshold 1e+09: two different capacities are needed: of 8 records 0 reach the "
            "threshold, whose largest response is",
        ),
        (["fragility", "job.h5", "--threshold", "nan"], "must be finite"),
        (["fragility", "job.h5", "--threshold", "0.5", "--place", "Z"], "or a building"),
        (["fragility", "job.h5", "--demands", "job.toml", "--scale", "1"], "job.toml"),
        (["fragility", "job.h5", "--demands", "new.csv", "--scale", "1"], "building, A, B"),
    ],
)
def test_what_cannot_be_drawn_is_one_line(folder, arguments, said):
    done = hpcsweep(0, *arguments, cwd=folder)
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1
    assert said in done.stderr
    assert not (folder / "new.csv").exists()


def test_loops_are_of_the_whole_force_of_storeys_and_bearings():
    """alpha k less P / h, that of bearings after yielding, 0 beside other sliders."""
    given = {"storey_stiffness": [100.0, 80.0], "yield_drift": 0.1, "hardening": [0.3, 0.5]}
    heavy = {"p_delta": True, "weight": [20.0, 10.0], "storey_height": [3.0, 2.5]}
    column = {"share": 0.2, "mass": 0.01}
    frame = Building([2.0, 1.0], **given, **heavy, column=column, name="A")
    assert springs(frame.structure) == pytest.approx([30.0 - 10.0, 40.0 - 4.0])
    other = Building([2.0, 1.0], 50.0, [3.0, 1.0], name="B")
    pair = adjacent([frame, other], gap=0.1, stiffness=1e3)
    assert "A column at 4" in pair.floor_names
    assert springs(pair) == pytest.approx([20.0, 36.0])
    bearings = {"slab_mass": 1.0, "stiffness": 3.0, "strength": 0.2}
    isolated = Building([2.0, 1.0], **given, isolation=bearings).structure
    assert springs(isolated) == pytest.approx([3.0, 30.0, 40.0])
    brace = Slider((-1.0, 1.0), 5.0, 1.0, "brace")
    free = Structure.from_matrices([1, 1], [[2, -1], [-1, 1]], [], sliders=[brace])
    assert springs(free).tolist() == [0.0]
    rows = np.array([[0.5, 0.0], [-2.0, 2.0]])  # elongations that are no difference of floors
    sliders = [Slider(row, 5.0, 1.0) for row in rows]
    stiffness = rows.T @ np.diag([6.0, 7.0]) @ rows
    levered = Structure.from_matrices([1, 1], stiffness, [], drift=rows, sliders=sliders)
    assert springs(levered) == pytest.approx([6.0, 7.0])


def test_stripes_are_the_largest_of_their_places(folder):
    results = open_results(folder / "job.h5")
    study = parse_job(TEXT, "job", "job").study
    one = stripes_of(results, study, "drift", "B2")
    drift = results.storey_drift.sel(storey="B2") / 3.2 * 100
    np.testing.assert_allclose(one.values, drift, rtol=1e-14)
    building = stripes_of(results, study, "acceleration", "A")
    floors = results.floor_acceleration.sel(floor=["A1", "A2"]).max("floor")
    np.testing.assert_array_equal(building.values, floors)
    lacking = {
        "contact_force": "contacts",
        "impacts": "contacts",
        "ductility": "storeys that yield, or sliders",
        "residual_drift": "storeys that yield",
        "base_shear": "output.base_shear",
    }
    for name, variable in ((name, one.name) for name, one in RESPONSES.items()):
        if variable in results:
            assert stripes_of(results, study, name).values.shape == (8, 20)
        else:
            lacks = f"no {variable}: the structure has no {lacking[variable]}"
            with pytest.raises(StripesError, match=lacks):
                stripes_of(results, study, name)
    with pytest.raises(StripesError, match="must be one of drift"):
        stripes_of(results, study, "stress")


def test_responses_of_storeys_that_yield_are_those_of_the_file(folder):
    with contextlib.closing(Frames(folder / "hysteresis.h5", "responses")) as frames:
        results, study = frames.gather([*frames]), frames.study
    for name, variable, largest in (
        ("ductility", "ductility", results.ductility.max("slider")),
        ("residual_drift", "residual_drift", abs(results.residual_drift).max("storey") / 0.032),
        ("base_shear", "base_shear", results.base_shear.max("building")),
    ):
        assert variable in results
        found = stripes_of(results, study, name)
        np.testing.assert_allclose(found.values, largest, rtol=1e-14)
    assert stripes_of(results, study, "residual_drift").label == "residual storey drift ratio  [%]"
    profile = figures()["profile"].draw(results, "ductility")
    assert [axis.get_xlabel() for axis in profile.axes] == ["ductility"]
    median = reported(folder, "hysteresis.h5", "--threshold", "1.0", "--response", "ductility")
    assert 0 < median["capacity"]["0.5"] < np.inf
    done = hpcsweep(0, "fragility", "--help").stdout
    assert all(name in done for name in RESPONSES)


def reported(folder, *arguments):
    return json.loads(hpcsweep(0, "fragility", *arguments, "--json", cwd=folder).stdout)


def test_fragility_is_that_of_the_capacities_between_the_stripes(folder):
    told = reported(folder, "job.h5", "--threshold", "0.5", "--place", "B")
    results = open_results(folder / "job.h5")
    drift = results.storey_drift.sel(storey=["B1", "B2", "B3"]).max("storey").values / 3.2
    scales = results["scale"].values
    reached = []
    for row in drift:
        first = np.argmax(row >= 0.005)
        ends = slice(first - 1, first + 1)
        reached.append(np.interp(0.005, row[ends], scales[ends]))
    assert told["never"] == told["unknown"] == 0
    assert told["capacity"]["0.5"] == pytest.approx(np.sort(reached)[3], rel=1e-12)
    assert told["median"] == pytest.approx(np.exp(np.mean(np.log(reached))), rel=1e-9)
    assert told["dispersion"] == pytest.approx(np.std(np.log(reached)), rel=1e-9)
    assert told["caution"] == ""
    # without contacts each record is proportional to the scale
    alone = results.storey_drift_alone.sel(storey=["B1", "B2", "B3"]).max("storey").values / 3.2
    exact = np.sort(0.005 * scales[0] / alone[:, 0])
    assert told["alone"]["capacity"]["0.5"] == pytest.approx(exact[3], rel=1e-12)
    study = parse_job(TEXT, "job", "job").study
    assert fit(stripes_of(results, study, "drift", "B"), 0.5).median == told["median"]


def test_the_gap_needed_is_that_of_the_motion_without_contacts_and_rules_are_of_its_peaks(folder):
    """Of record 3 at one scale, by hand: two buildings of 5 % whose periods differ."""
    results = open_results(folder / "job.h5")
    study = parse_job(TEXT, "job", "job").study
    (axis,) = figures()["separation"].draw(results, place="A2-B2").axes
    lines = {line.get_label(): line.get_ydata() for line in axis.get_lines()}
    need = results.gap_needed.sel(stop="A2-B2")
    np.testing.assert_array_equal(lines["50 % fractile"][1:], np.sort(need, axis=0)[3])
    alone = approach(study, 3, float(study.factor[3, 10]))
    assert need[3, 10].item() == pytest.approx(alone, rel=1e-3)
    u, v = (results.displacement_alone.sel(floor=floor).values for floor in ("A2", "B2"))
    of_a, of_b = (2 * np.pi / study.structure.frequencies[i] for i in (1, 0))
    asked = separation(u, v, of_a, of_b, 0.05)
    for rule, values in zip(("sum", "SRSS", "double"), asked, strict=True):
        (label,) = (one for one in lines if one.startswith(rule))
        np.testing.assert_allclose(lines[label][1:], np.sort(values, axis=0)[3], rtol=1e-12)
        short = 100 * (values < need.values * (1 - 1e-9)).mean()
        assert f"too small for {short:.0f} % of them" in label
    # of a motion that has collapsed, or is not computed, nothing is known
    falls = np.full(need.shape, np.nan)
    falls[0, -1] = 3.0
    lost = {name: results[name].where(results.record != results.record[1]) for name in LOST}
    part = results.assign(collapse_time_alone=(need.dims, falls), **lost)
    (axis,) = figures()["separation"].draw(part, place="A2-B2").axes
    drawn = {line.get_label(): line.get_ydata() for line in axis.get_lines()}
    rest = np.delete(need.values, 1, axis=0)
    rest[0, -1] = np.inf
    np.testing.assert_array_equal(drawn["84 % fractile"][1:], np.sort(rest, axis=0)[5])
    (label,) = (one for one in drawn if one.startswith("sum"))
    total = np.where(np.isinf(rest), np.inf, np.delete((u + v), 1, axis=0))
    np.testing.assert_allclose(drawn[label][1:], np.sort(total, axis=0)[3], rtol=1e-12)
    with pytest.raises(PlotError, match="--place B1: must be one of A1-B1, A2-B2"):
        figures()["separation"].draw(results, place="B1")


LOST = "gap_needed", "displacement_alone", "displacement"

LEVER = """
[study]
kind = "records"
[structure.matrices]
mass = [1.0, 2.0]
stiffness = [[300.0, 0.0], [0.0, 400.0]]
damping = [[1.0, 0.0], [0.0, 2.0]]
[[structure.contact]]
direction = [-0.5, 1.5]
gap = 0.1
stiffness = 1e4
[records]
synthetic = {count = 1, seed = 3, dt = 0.02, duration = 5.0}
scale = {by = "factor", values = [0.5, 1.0]}
"""


@pytest.mark.slow
def test_rules_ask_for_the_peaks_that_a_row_makes_of_coordinates(tmp_path):
    (tmp_path / "lever.toml").write_text(LEVER)
    assert hpcsweep(0, "run", "lever.toml", cwd=tmp_path).returncode == 0
    results = open_results(tmp_path / "lever.h5")
    (axis,) = figures()["separation"].draw(results).axes
    lines = {line.get_label(): line.get_ydata() for line in axis.get_lines()}
    (label,) = (one for one in lines if one.startswith("sum"))
    peaks = results.displacement_alone.values[0] @ [0.5, 1.5]
    np.testing.assert_allclose(lines[label][1:], peaks, rtol=1e-12)
    assert (peaks >= results.gap_needed.values[0, :, 0]).all()
    # entries of one sign: both must move towards it, + 2 r u v under the root
    (tmp_path / "alike.toml").write_text(LEVER.replace("[-0.5", "[0.5"))
    assert hpcsweep(0, "run", "alike.toml", cwd=tmp_path).returncode == 0
    results = open_results(tmp_path / "alike.h5")
    (axis,) = figures()["separation"].draw(results).axes
    (line,) = (one for one in axis.get_lines() if one.get_label().startswith("double"))
    u, v = (results.displacement_alone.values[0] * [0.5, 1.5]).T
    periods, ratios = 2.0 * np.pi / np.sqrt([300.0, 200.0]), [0.5 / 300**0.5, 1.0 / 800**0.5]
    r = 1.0 - 0.5 * separation(1.0, 1.0, *periods, *ratios).ddc ** 2
    np.testing.assert_allclose(
        line.get_ydata()[1:], np.sqrt(u**2 + v**2 + 2 * r * u * v), rtol=1e-9
    )


def approach(study, record: int, factor: float) -> float:
    """Return the largest approach of A2 to B2 without contacts, at steps of 2 ms."""
    free = history(study.structure.without_contacts(), study.record(record), factor, 1.0, 0.002)
    return float((free.displacement[:, 1] - free.displacement[:, 3]).max())


def test_a_median_beyond_the_stripes_is_told_as_that(folder):
    results = open_results(folder / "job.h5")
    high = 100 / 3.2 * np.sort(results.storey_drift.max("storey").values[:, -1])
    threshold = ["--threshold", str(0.5 * (high[-3] + high[-4]))]  # three of eight reach it
    told = reported(folder, "job.h5", *threshold)
    assert told["never"] == 5
    assert told["median"] > told["highest"]
    assert told["median_interval"][1] is None or told["median_interval"][1] > told["median"]
    text = hpcsweep(0, "fragility", "job.h5", *threshold, cwd=folder).stdout
    assert "5 records never reach it up to 20" in text
    assert (
        "the median is an extrapolation, not bounded by the highest stripe, 20: at most 37.5 %"
        in text
    )
    # the figure goes on to the median, dashed beyond the stripes, and says what it does not know
    drawn = figures()["fragility"].draw(results, threshold=float(threshold[1]), units="g")
    (axis,) = drawn.axes
    highest = 20.0 / 9.80665
    (dashed,) = (line for line in axis.get_lines() if line.get_linestyle() == "--")
    assert dashed.get_xdata()[0] > highest
    assert axis.get_xlim()[1] > max(told["median"], told["alone"]["capacity"]["0.5"]) / 9.80665
    assert axis.get_xlabel() == "Sa(0.5; 5 %)  [g]"
    assert axis.get_legend().get_title().get_text().endswith("8 records, 5 above the last stripe")
    # counted without contacts to the last record, far beyond the stripes
    assert np.isfinite(told["alone"]["capacity"]["0.84"])


def test_without_contacts_capacities_are_exact_at_any_intensity_and_drawn_there(folder):
    """No stripe reaches ten times the largest drift; each record is proportional to its scale."""
    text = re.sub(r"stiffness = 2e9\n", "stiffness = 0.0\n", TEXT)
    (folder / "free.toml").write_text(text)
    assert hpcsweep(0, "run", "free.toml", cwd=folder).returncode == 0
    results = open_results(folder / "free.h5")
    drift = 100 * results.storey_drift.max("storey").values[:, -1] / 3.2
    exact = np.sort(10 * drift.max() * 20.0 / drift)
    threshold = float(10 * drift.max())
    told = reported(folder, "free.h5", "--threshold", str(threshold))
    assert told["never"] == 0
    assert told["caution"] == ""
    assert told["capacity"]["0.5"] == pytest.approx(exact[3], rel=1e-12)
    assert told["median"] == pytest.approx(np.exp(np.log(exact).mean()), rel=1e-9)
    (axis,) = figures()["fragility"].draw(results, threshold=threshold).axes
    assert axis.get_xlim()[1] > exact[-1]
    assert not [
        one for one in axis.get_lines() if one.get_linestyle() == "--" and one.get_xdata().size
    ]


def test_intensities_in_g_are_those_of_the_structure_over_one_g(folder):
    own, in_g = (
        reported(folder, "job.h5", "--threshold", "0.5", *units) for units in ([], ["--units", "g"])
    )
    assert in_g["measure"] == "Sa(0.5; 5 %)  [g]"
    for key in ("median", "highest"):
        assert in_g[key] == pytest.approx(own[key] / 9.80665, rel=1e-9)
    assert in_g["dispersion"] == pytest.approx(own["dispersion"], rel=1e-9)
    study = parse_job(TEXT.replace(SCALES, "{values = [1.0]}"), "job", "job").study
    with pytest.raises(StripesError, match="intensities are of scale factor, no acceleration"):
        stripes_of(open_results(folder / "job.h5"), study, units="g")
    # a job that gives its scales in g is told, asked and drawn in g, and is the same job
    ours, theirs = (
        parse_job(TEXT.replace(SCALES, f'{{by = "sa", period = 0.5, {text}}}'), "job", "job")
        for text in ('unit = "g", values = [0.25, 0.5, 1.0]', f"values = {TWICE}")
    )
    assert ours.fingerprint == theirs.fingerprint
    in_g, own = (one.study.intensities(one.study.scale) for one in (ours, theirs))
    assert (in_g[0].tolist(), in_g[1]) == (pytest.approx([0.25, 0.5, 1.0]), "g")
    assert (own[0].tolist(), own[1]) == (pytest.approx(TWICE), "length/time^2")
    assert responses.at_scale(ours.study, 1) == "Sa(0.5; 5 %) = 0.5 g"
    assert responses.at_scale(theirs.study, 1) == "Sa(0.5; 5 %) = 4.903"


def test_a_hazard_curve_makes_a_fragility_a_frequency(folder):
    """Of a power law of exponent 2, lambda(theta) exp(2 beta^2), with all dispersion in squares."""
    x = np.array([0.2, 1.0, 20.0])
    lines = [f"{a},{b}" for a, b in zip(x, 1e-3 * x**-2, strict=True)]
    (folder / "site.csv").write_text("\n".join(lines))
    given = "job.h5", "--threshold", "0.5", "--hazard", "site.csv"
    told = reported(folder, *given, "--dispersion", "0.3")
    beta = math.hypot(told["dispersion"], 0.3)
    rate = 1e-3 / told["median"] ** 2 * math.exp(2 * beta**2)
    assert told["total_dispersion"] == pytest.approx(beta, rel=1e-14)
    assert told["annual_frequency"] == pytest.approx(rate, rel=1e-9)
    assert told["in_50_years"] == pytest.approx(100 * (1 - math.exp(-50 * rate)), rel=1e-9)
    rare = math.sqrt(1e-3 * 50 / -math.log(0.98))
    assert told["margin"] == pytest.approx(told["median"] / rare, rel=1e-9)
    text = hpcsweep(0, "fragility", *given, "--units", "g", cwd=folder).stdout
    assert "a year, " in text
    done = hpcsweep(0, "fragility", *given[:-1], "none.csv", cwd=folder)
    assert (done.returncode, "--hazard none.csv: No such file" in done.stderr) == (2, True)


def test_demands_are_those_of_one_building_at_one_intensity(folder):
    done = hpcsweep(
        *(0, "fragility", "job.h5", "--demands", "d.csv", "--place", "A", "--scale", "5"),
        cwd=folder,
    )
    assert done.returncode == 0, done.stderr
    with (folder / "d.csv").open() as file:
        rows = list(csv.reader(file))
    names = ["", "1-PFA-0-1", "1-PFA-1-1", "1-PFA-2-1", "1-PID-1-1", "1-PID-2-1", "1-SA_0.5-0-1"]
    assert rows[0] == names
    results = open_results(folder / "job.h5").sel(scale=5, method="nearest")
    assert [row[0] for row in rows[2:]] == results.record.values.tolist()
    table = np.array([row[1:] for row in rows[2:]], float)
    np.testing.assert_allclose(table[:, 0], results.pga * results.factor / 9.80665)
    np.testing.assert_allclose(table[:, 4], results.storey_drift.sel(storey="A2") / 3.2)
    np.testing.assert_allclose(table[:, 5], results.scale / 9.80665)


def test_history_passes_through_the_peaks_of_the_response():
    structure = parse_job(TEXT, "job", "job").structure
    (record,) = synthetic_records(1, seed=3, dt=0.02, duration=10.0)
    seen, found = (f(structure, record, 3.0, 1.0) for f in (history, response))
    assert seen.time[-1] == pytest.approx(found.duration)
    np.testing.assert_allclose(seen.displacement[-1], found.final_state[:5], atol=1e-12)
    np.testing.assert_allclose(seen.peak_force.max(axis=0), found.force, rtol=1e-9)
    largest = np.abs(seen.displacement).max(axis=0)
    assert (largest <= found.displacement * (1 + 1e-12)).all()
    np.testing.assert_allclose(largest, found.displacement, rtol=0.05)


@pytest.mark.slow
def test_floor_spectra_are_drawn_from_the_file_or_from_the_records(tmp_path):
    stored = "floor_spectra = {periods = [0.1, 0.5], places = ['B2']}"
    text = TEXT.replace("count = 8", "count = 2").replace("count = 20}", "count = 2}")
    (tmp_path / "job.toml").write_text(text.replace("[output]", f"[output]\n{stored}"))
    assert hpcsweep(0, "run", "job.toml", cwd=tmp_path).returncode == 0
    results, kind = open_results(tmp_path / "job.h5"), figures()["floor-spectra"]
    in_file = kind.draw(results, scale=20.0, place="B2").axes[0].lines
    for line, values in zip(in_file, results["floor_spectrum"][:, 1, 0], strict=False):
        np.testing.assert_array_equal(line.get_xdata(), [0.1, 0.5])
        np.testing.assert_allclose(line.get_ydata(), values / 9.80665, rtol=1e-12)
    (free,) = (line.get_ydata() for line in in_file if line.get_label() == "50 %, no contact")
    least = np.sort(results["floor_spectrum_alone"][:, 1, 0], axis=0)[0]  # of two
    np.testing.assert_allclose(free, least / 9.80665, rtol=1e-12)
    study = parse_job(text, "job", "job").study
    line = kind.draw(results, scale=20.0, place="A2").axes[0].lines[1]
    periods = line.get_xdata()[[5, 40]]
    motion = study.structure, study.record(1), periods, 0.05, float(study.factor[1, 1]), study.tail
    expected = floor_spectra(*motion, places=["A2"]).acceleration[0] / 9.80665
    np.testing.assert_allclose(line.get_ydata()[[5, 40]], expected, rtol=1e-8)


@pytest.mark.slow
def test_a_portfolio_shows_fractiles_of_every_structure_over_its_keys(tmp_path):
    keys = '[vary]\n"pounding.gap" = [0.01, 0.03]\n"pounding.stiffness" = [1e9, 4e9]\n'
    keys += '"pounding.tension" = [false]\n'
    (tmp_path / "a.toml").write_text(TEXT.replace("count = 20}", "count = 2}") + keys)
    assert hpcsweep(0, "run", "a.toml", cwd=tmp_path).returncode == 0
    figure = figures()["portfolio"]
    with contextlib.closing(Frames(tmp_path / "a.h5", "responses")) as frames:
        read = figure.load(frames, "force", scale=20.0, colour="pounding.stiffness")
        with pytest.raises(
            PlotError, match=r"--against width: must be of numbers, period, gap, stiffness$"
        ):
            figure.load(frames, against="width")
    assert (read.over[0].tolist(), read.hue[0].tolist()) == (
        [0.01, 0.01, 0.03, 0.03],
        [1e9, 4e9] * 2,
    )
    results = open_results(tmp_path / "a.h5")
    force = results["contact_force"].isel(scale=-1).max("stop").values.reshape(4, 8)
    low, high = np.sort(force, axis=1).T[[1, 6]]
    np.testing.assert_array_equal(read.bands, [low, np.median(force, axis=1), high])
    drawn = figure.draw(read._replace(bands=np.where(read.over[0] == 0.01, np.inf, read.bands)))
    offsets = [points.get_offsets().data.tolist() for points in drawn.axes[0].collections[1:]]
    assert [x for x, _ in offsets[1]] == [0.01, 0.01]  # those that collapse, on top
    assert min(y for _, y in offsets[1]) > max(y for _, y in offsets[0])


def test_structures_of_several_jobs_stand_in_one_table(folder):
    files = ("job.h5", "--structures", "--beside", "hysteresis.h5", "--scale", "0.5", "-o", "s.csv")
    assert hpcsweep(0, "table", *files, cwd=folder).returncode == 0
    rows = list(csv.DictReader((folder / "s.csv").read_text().splitlines()))
    for row, job in zip(rows, ("job", "hysteresis"), strict=True):
        results = open_results(folder / f"{job}.h5")
        drift = 100.0 * results.storey_drift.isel(scale=0) / results.storey_height
        largest = np.sort(drift.max("storey").values)
        values = [float(value) for name, value in row.items() if "drift" in name]
        assert values == pytest.approx([largest[1], np.median(largest), largest[6]])
        share = float((results.impacts.isel(scale=0) > 0).any("stop").mean())
        assert (row["job"], float(row["touching"])) == (job, share)
        assert row["storeys in all"] == str(results.sizes["storey"])
        middle = np.median(drift.values, axis=list(drift.dims).index("record"))
        assert row["worst place"] == str(results.storey.values[middle.argmax()])
    done = hpcsweep(
        0, "plot", "job.h5", "--kind", "portfolio", *files[2:4], "-o", "s.png", cwd=folder
    )
    assert done.returncode == 0


def test_outliers_run_past_the_edge_and_are_told():
    curves = np.outer([1.0, 1.1, 1.2, 1.3, 9.0], [0.5, 1.0])
    edge, words = within(curves)
    assert edge == pytest.approx(1.1 * 1.3)
    assert words == "1 outlier beyond the edge, up to 9"
    assert within(curves, fractiles(curves)) == (None, "")  # 84 % of five are all
    nine = np.vstack([curves[:4], curves])
    assert within(nine, fractiles(nine))[0] == pytest.approx(1.1 * 1.3)
    assert within(nine, np.array([1.5, np.inf]))[0] == pytest.approx(1.1 * 1.5)
    assert within(curves[:4]) == (None, "")
    assert within(np.full((5, 2), np.inf)) == (None, "")


def test_what_collapses_lies_at_the_edge_and_words_fit_the_structure(folder):
    assert edge_of(np.array([1.0, np.nan])) is None
    assert edge_of(np.array([1.0, np.inf]), np.array([5.0])) == pytest.approx(6.0)
    assert edge_of(np.array([np.inf])) == 1.0
    pair = open_results(folder / "job.h5")
    drift = pair.storey_drift.copy()
    drift[:2, 10] = np.inf  # 84 % of eight records are seven
    figure = figures()["profile"].draw(pair.assign(storey_drift=drift), scale=float(pair.scale[10]))
    band = figure.axes[0].collections[0].get_paths()[0].vertices[:, 0]
    assert band.max() == pytest.approx(figure.axes[0].get_xlim()[1])
    assert "8 records, 2 of which collapse, beyond the edge" in figure._suptitle.get_text()
    names = [text.get_text() for text in figure.axes[0].get_legend().get_texts()]
    assert names == ["16 to 84 %", "median", "no contact"]
    frame = Building([1.0, 1.0], 50.0, yield_drift=0.1).structure
    beside = replace(frame, gap=0.1)
    words = ["elastic motion", "no contact", "no contact"]
    assert [alone_words(one) for one in (frame, beside, replace(beside, yield_drift=None))] == words
    hard = open_results(folder / "hysteresis.h5")
    for kind, label in (("profile", words[1]), ("ida", f"50 %, {words[1]}")):
        legend = figures()[kind].draw(hard).axes[0].get_legend()
        assert label in [text.get_text() for text in legend.get_texts()]


def test_a_median_of_an_even_number_is_the_mean_of_the_middle_two(folder):
    """Of eight records; fractiles, lines at 50 % and capacities are counted, and not called so."""
    results = open_results(folder / "job.h5").isel(scale=[-1])
    drawn = results.storey_drift / 0.032, results.storey_drift_alone / 0.032
    profile = figures()["profile"].draw(results).axes[0].get_lines()
    for line, values in zip(profile, drawn, strict=False):
        np.testing.assert_allclose(line.get_xdata(), np.median(values[:, 0, :2], axis=0))
    ratio = np.divide(*(values[:, 0, :2].max("storey") for values in drawn))
    line = figures()["pounding"].draw(results).axes[0].get_lines()[1]
    np.testing.assert_allclose(line.get_ydata(), np.median(ratio), rtol=1e-14)
    ida = {line.get_label(): line for line in figures()["ida"].draw(results).axes[0].get_lines()}
    largest = np.sort(drawn[0][:, 0].max("storey"))
    assert ida["50 % fractile"].get_xdata()[-1] == largest[4]
    low, middle, high = median_band([3.0, np.inf, 1.0, np.nan, 2.0])
    assert (low, middle, high) == (1.0, 2.5, np.inf)
    assert median_band([1.0, 2.0, np.inf, np.inf])[1] == np.inf


def test_numbers_are_in_units_that_suit_them():
    structure = parse_job(TEXT, "job", "job").structure
    names = UnitNames("m", "kg", "s")
    known = replace(structure, unit_names=names)
    assert labels.sized(known, "force", np.array([-3e6, 1.0])) == ("  [MN]", 1e6)
    assert labels.sized(known, "force", np.array([3e3]), np.array([12.0])) == ("  [kN]", 1e3)
    assert labels.sized(known, "length", np.array([0.02])) == ("  [mm]", 1e-3)
    assert labels.sized(known, "velocity", np.array([0.02]))[1] == 1.0


@pytest.mark.slow
def test_axes_name_what_they_count_and_are_in_units_that_suit_them(folder):
    kinds = figures()
    with contextlib.closing(Frames(folder / "job.h5", "responses")) as frames:
        results = frames.gather([*frames])
        shares = kinds["fragility"].draw(results, threshold=0.5)
    chart, (axis,) = new_figure(1, 3.0)
    axis.set(xlabel="peak contact force  [N]", xlim=(0.0, 6.4e7))
    labels.suit(chart)
    assert axis.get_xlabel() == "peak contact force  [MN]"
    chart.canvas.draw()
    ticks = {tick.get_text(): tick.get_position()[0] for tick in axis.get_xticklabels()}
    assert all(float(text.replace("−", "-")) * 1e6 == at for text, at in ticks.items())
    words = [text.get_text() for text in shares.axes[0].get_legend().get_texts()]
    assert words[:2] == ["counted at each stripe", "95 % confidence"]


def test_drifts_at_which_frames_yield_are_told_of_storeys_that_stay_elastic(folder):
    """0.5 % of 3.2 m are 16 mm: told of all storeys in one file, of B's in the other."""
    for name, places in (("job.h5", "AB"), ("hysteresis.h5", "B")):
        results = open_results(folder / name)
        chosen = [storey for storey in results.storey.values if storey[0] in places]
        most = 100 * float(results.storey_drift.sel(storey=chosen).max()) / 3.2
        assert most > 0.5
        words = f"elastic: drifts of up to {most:.2g} %; frames yield from some 0.5 % on"
        assert words in hpcsweep(0, "summary", name, cwd=folder).stdout
        title = figures()["ida"].draw(results)._suptitle.get_text()
        assert words in title.replace("\n", " ")
    whole = open_results(folder / "job.h5")
    own = 100 * float(whole.storey_drift[0, 10].max()) / 3.2
    drawn = figures()["history"].draw(whole, scale=float(whole.scale[10]))
    assert f"elastic: drifts of up to {own:.2g} %" in drawn._suptitle.get_text()
    low = results.assign(storey_drift=1e-3 * results.storey_drift)
    assert "elastic" not in figures()["ida"].draw(low)._suptitle.get_text()


def test_the_slab_on_bearings_belongs_to_its_building():
    names = ["A isolation", "A1", "A2", "B1"]
    assert buildings(names) == {"A": [0, 1, 2], "B": [3]}
    assert buildings(["isolation", "1", "2"]) == {"": [0, 1, 2]}
