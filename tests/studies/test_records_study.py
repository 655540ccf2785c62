"""Studies of records: rules that spare work against plain computing, files, restart, mistakes."""

import csv
import json
import math
import re
from pathlib import Path

import numpy as np
import pytest
from together import together
from tools import RECORDS, hpcsweep

from hpcsweep import (
    Building,
    floor_spectra,
    history,
    intensity,
    open_results,
    response,
    spectrum,
    synthetic_records,
)
from hpcsweep.campaign import run as campaign
from hpcsweep.campaign.describe import describe, warnings
from hpcsweep.campaign.status import status
from hpcsweep.campaign.summary import summarize
from hpcsweep.checks.validate import validate
from hpcsweep.job import JobError, load_job, parse_job
from hpcsweep.parallel.mpi import Serial
from hpcsweep.solvers import response as solvers_response
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.skip_rule import SkipRule
from hpcsweep.studies.ground_motion import responses
from hpcsweep.studies.ground_motion.stripes import capacities, responses_of, stripes_of

SUITE = synthetic_records(4, seed=3, dt=0.02, duration=10.0)
GAPS = '[vary]\n"pounding.gap" = [0.01, 0.02, 0.04]\n'
FACTORS = RECORDS.replace(
    '{by = "pga", from = 0.5, to = 5.0, count = 5}', "{values = [0.25, 0.5, 1.0, 2.0]}"
)
FIELDS = {
    "storey_drift": "drift",
    "displacement": "displacement",
    "floor_acceleration": "floor_acceleration",
    "contact_force": "force",
    "impacts": "impacts",
    "impact_velocity": "impact_velocity",
    "impulse": "impulse",
    "contact_time": "contact_time",
    "dissipated": "dissipated",
    "residual": "residual",
    "final_state": "final_state",
}


def computed(text: str, folder: Path, name: str = "a"):
    """Run a job on one rank; its results."""
    path = folder / f"{name}.h5"
    job = parse_job(text, "job", name)
    assert campaign.run(job, path, Serial()) == 0
    return job, path, open_results(path)


@pytest.fixture
def calls(monkeypatch):
    """The scales at which responses are really computed."""
    found = []
    plain = responses.respond

    def counted(structure, record, scale, *arguments, **more):
        found.append(scale)
        return plain(structure, record, scale, *arguments, **more)

    monkeypatch.setattr(responses, "respond", counted)
    responses.KEPT.clear()
    return found


def test_every_run_is_the_plain_response(tmp_path):
    job, _, results = computed(FACTORS + GAPS, tmp_path)
    assert dict(results.sizes) | {"gap": 3, "record": 4, "scale": 4} == dict(results.sizes)
    rules = set(np.unique(results["skip_rule"]))
    assert rules == {SkipRule.NONE, SkipRule.LINEAR}
    for place in np.ndindex(3, 4, 4):
        structure = job.study.part(place[:1]).structure
        found = response(structure, SUITE[place[1]], float(results["scale"][place[2]]), tail=1.0)
        for name, field in FIELDS.items():
            own, plain = results[name].values[place], getattr(found, field)
            size = max(np.abs(plain).max(), 1e-300)
            np.testing.assert_allclose(own, plain, rtol=0, atol=1e-9 * size, err_msg=name)
    longest = 2 * np.pi / structure.frequencies[0]
    sa = spectrum(SUITE[0], [longest]).acceleration[0] / job.study.base.gravity
    assert f"Sa {sa:7.4f}" in "".join(text for _, text in describe(job))


def test_pressed_buildings_start_from_their_equilibrium(tmp_path, calls):
    text = FACTORS + '[vary]\n"pounding.gap" = [-0.02, -0.01]\n'
    job, path, results = computed(text, tmp_path)
    assert (results["skip_rule"] == SkipRule.NONE).all()
    assert len(calls) == 4 * 5  # of 2 x 4 runs of each record 3 have the ratio of another one
    for place in ((0, 0, 1), (1, 2, 0), (1, 3, 3)):
        structure = job.study.part(place[:1]).structure
        found = response(structure, SUITE[place[1]], float(results["scale"][place[2]]), tail=1.0)
        assert (found.displacement > np.abs(structure.rest[: structure.n_floors])).all()
        for name, field in FIELDS.items():
            own, plain = results[name].values[place], getattr(found, field)
            size = max(np.abs(plain).max(), 1e-300)
            np.testing.assert_allclose(own, plain, rtol=0, atol=1e-9 * size, err_msg=name)
    assert validate(path, 2).sound


def test_histories_are_those_of_the_plain_response(tmp_path):
    job, path, results = computed(FACTORS.replace("[output]", "[output]\nhistory = 0.1"), tmp_path)
    assert results["time"].values == pytest.approx(0.1 * np.arange(111))
    displacement, force = results["history_displacement"], results["history_force"]
    assert displacement.dims == ("record", "scale", "time", "floor")
    n = job.study.structure.n_floors
    for record, scale in ((0, 3), (2, 1)):
        run = {"record": record, "scale": scale}
        state = response(job.study.structure, SUITE[record], float(results["scale"][scale]))
        at_end = displacement.isel(run)[100].values  # of the record, before its tail
        np.testing.assert_allclose(at_end, state.final_state[:n], rtol=0, atol=1e-12)
        velocity = results["history_velocity"].isel(run)[100].values
        np.testing.assert_allclose(velocity, state.final_state[n:], rtol=0, atol=1e-11)
    peak = np.abs(displacement).max("time")
    assert (peak <= results["displacement"] * (1 + 1e-9)).all()
    contacts = job.study.structure.contacts
    past = displacement.values @ np.array([one.direction for one in contacts]).T
    past = np.maximum(past - [one.gap for one in contacts], 0.0)
    stiff = np.array([one.stiffness for one in contacts])
    np.testing.assert_allclose(force, stiff * past, rtol=1e-12, atol=1e-9)
    assert 0 < float((force > 0).mean()) < 0.5
    assert (force.max("time") <= results["contact_force"] * (1 + 1e-9)).all()
    assert validate(path).sound


SPECTRA = 'floor_spectra = {periods = [0.1, 0.4], places = ["B3", "A1"], damping_ratio = 0.02}'


@pytest.mark.slow
def test_floor_spectra_are_those_of_the_plain_motion(tmp_path):
    text = FACTORS.replace("[output]", f"[output]\n{SPECTRA}")
    job, path, results = computed(text, tmp_path)
    found, study = results["floor_spectrum"], job.study
    assert found.dims == ("record", "scale", "place", "period")
    assert (*found["place"].values, *found["period"].values) == ("B3", "A1", 0.1, 0.4)
    assert found.attrs["units"] == results["floor_acceleration"].attrs["units"]
    factor = float(results["scale"][3])
    for name, structure in (("", study.structure), ("_alone", study.structure.without_contacts())):
        own = floor_spectra(
            *(structure, SUITE[2], [0.1, 0.4], 0.02, factor, study.tail), places=["B3", "A1"]
        )
        np.testing.assert_array_equal(results[f"floor_spectrum{name}"][2, 3], own.acceleration)
    assert (results["impacts"][2, 3] > 0).any()
    assert validate(path).sound


def test_records_that_are_equal_or_drift_are_warned_of(tmp_path):
    """An offset of 3 mm/s^2 for 20 s moves the ground by 11.4 m in all with 180 s of zeros."""
    (good,) = synthetic_records(1, seed=3, dt=0.02, duration=20.0)
    long = np.append(good.acceleration + 0.003, np.zeros(9000))
    for name, values in {"a": good.acceleration, "b": good.acceleration, "c": long}.items():
        np.savetxt(tmp_path / f"{name}.txt", values)
    source = 'files = ["*.txt"]\nunit = "m/s2"\ndt = 0.02'
    text = re.sub(r"synthetic = .*", source, RECORDS) + '[units]\nlength = "m"\n'
    (tmp_path / "job.toml").write_text(text)
    job = load_job(tmp_path / "job.toml")
    moved = 0.003 * (20.0**2 / 2 + 20.0 * 180.0)
    told = warnings(job)
    assert re.match(r"c: the ground is displaced by 11\.\d m: its baseline drifts", told[0])
    assert told[1:] == ["2 records are equal: a, b"]
    assert job.study.suite[2].pgd == pytest.approx(moved, rel=0.1)


def test_records_that_are_multiplied_by_more_than_ten_are_warned_of():
    for most, count in ((9.0, 0), (11.0, 4)):
        job = parse_job(FACTORS.replace("[0.25, 0.5, 1.0, 2.0]", f"[1.0, {most}]"), "job", "job")
        told = [line for line in job.study.warnings() if "multiplied" in line]
        assert told == [
            "4 of 4 records are multiplied by more than 10, by up to 11: stronger records would be "
            "better"
        ] * (count > 0)


@pytest.mark.slow
def test_without_the_rules_the_same_is_computed(tmp_path, calls):
    job, _, results = computed(FACTORS + GAPS, tmp_path)
    spared = len(calls)
    linear = int((results["skip_rule"] == SkipRule.LINEAR).sum())
    # gaps 1, 2, 4 and scales 1/4 .. 2: 4 + 2 ratios of s / g
    assert 0 < spared <= 4 * 6
    assert linear > 0
    calls.clear()
    _, _, plain = computed(FACTORS + GAPS + '[solver]\nskip = "none"\n', tmp_path, "plain")
    assert len(calls) == job.study.n_runs == 48
    for name in (*FIELDS, "storey_drift_time", "gap_needed"):
        size = float(np.abs(plain[name]).max())
        np.testing.assert_allclose(results[name], plain[name], rtol=0, atol=1e-9 * size)
    told = summarize(tmp_path / "a.h5")
    assert told["below_contact"]["runs"] == linear
    assert told["equal_ratio"]["runs"] == 48 - linear - spared


def test_gaps_of_zero_need_one_response_for_all_scales(tmp_path, calls):
    text = FACTORS.replace("gap = 0.02", "gap = 0.0")
    _, _, results = computed(text, tmp_path)
    assert len(calls) == 4
    one, two = results.isel(scale=2), results.isel(scale=3)
    np.testing.assert_array_equal(2 * one["contact_force"], two["contact_force"])
    np.testing.assert_array_equal(one["impacts"], two["impacts"])


def test_records_of_a_structure_share_the_tables_of_both_motions(tmp_path, monkeypatch):
    made = []
    plain = solvers_response.record_map

    def counted(structure, *rest, **more):
        made.append(len(structure.contacts))
        return plain(structure, *rest, **more)

    monkeypatch.setattr(solvers_response, "record_map", counted)
    for kept in (responses._map, solvers_response.linear_map):
        kept.cache_clear()
    responses.KEPT.clear()
    computed(FACTORS, tmp_path)
    assert sorted(made) == [0, 2]  # of four records


def test_each_sample_is_timed_as_if_it_were_the_first(calls):
    study = parse_job(FACTORS, "job", "a").study
    for index in (0, 1, 0):
        (_, along), runs, seconds = study.time_runs(index / 4, 0.9, 2)
        assert (runs, along, seconds > 0.0) == (2, 0.75, True)
        assert len(calls) == 2
        calls.clear()


def test_the_cache_forgets_what_was_asked_for_longest_ago(monkeypatch):
    kept, values = responses._Kept(), np.zeros(10)
    monkeypatch.setattr(responses, "MAX_KEPT", 3 * values.nbytes)
    for key in "abcd":
        kept.put((key,), (values, Outcome.COMPLETE))
        kept.get(("a",))
    assert [key for key in "abcd" if kept.get((key,))] == ["a", "c", "d"]
    kept.put(("e",), (np.zeros(11), Outcome.COMPLETE))
    assert [key for key in "acde" if kept.get((key,))] == ["d", "e"]


def test_a_response_may_differ_by_its_rounding_times_its_conditioning():
    study = parse_job(FACTORS, "job", "a").study
    block = study.path(1)[-1]
    rows, at = study.compute(block, study.initial_state), block.n_runs - 1
    run = {name: values[at] for name, values in rows.items()}
    ends = [response(study.structure, SUITE[1], 2.0 * (1.0 + k * 1e-9), study.tail) for k in (0, 1)]
    fields = ("drift", "displacement", "floor_acceleration", "force", "impulse", "residual")
    pairs = [[getattr(end, name) for end in ends] for name in fields]
    steep = max(np.abs(b - a).max() / np.abs(b).max() for a, b in pairs) / 1e-9
    again = study.run_again(block, at, run, study.initial_state)
    assert again.allowed == pytest.approx(1e-12 * max(steep, 1.0), rel=1e-4)
    assert (again.problem, again.whole_run) == ("", "equal")
    run["contact_force"] = run["contact_force"] * (1.0 + 3.0 * again.allowed)
    again = study.run_again(block, at, run, study.initial_state)
    assert again.problem.startswith("computed plainly its peaks differ by ")


def test_without_contacts_all_is_linear(tmp_path, calls):
    text = RECORDS.partition("[[building]]")[0] + "[structure]\nn_floors = 2\nmass = 1.0\n"
    text += "storey_stiffness = 400.0\nstiffness_ratio = 0.0\n[records]"
    text += RECORDS.partition("[records]")[2]
    _, path, results = computed(text, tmp_path)
    assert calls == []
    assert "stop" not in results.sizes
    assert not [name for name in results if name.endswith(("_alone", "_elastic"))]
    assert validate(path, 5).sound


def test_gap_needed_is_that_which_does_not_close(tmp_path):
    job, _, results = computed(FACTORS, tmp_path)
    needed = results["gap_needed"].isel(record=1, scale=2)
    for part, closes in ((1.001, False), (0.999, True)):
        gaps = ", ".join(str(part * float(one)) for one in needed)
        wide = parse_job(FACTORS.replace("gap = 0.02", f"gap = [{gaps}]"), "job", "job")
        assert bool(response(wide.structure, SUITE[1], 1.0).impacts.any()) is closes
    assert job.study.structure.contact_names


@together(
    "scale, measure",
    [
        ('by = "pga"', lambda r: r.peak),
        ('by = "pgv"', lambda r: intensity(r).pgv),
        ('by = "sa", period = 0.8', lambda r: spectrum(r, [0.8]).acceleration[0]),
        (
            'by = "avgsa", periods = [0.4, 0.8], damping_ratio = 0.02',
            lambda r: spectrum(r, [0.4, 0.8], 0.02).acceleration.prod() ** 0.5,
        ),
    ],
)
def test_records_have_the_intensity_asked_for(scale, measure):
    study = parse_job(RECORDS.replace('by = "pga"', scale), "job", "job").study
    for i, record in enumerate(SUITE):
        np.testing.assert_allclose(
            [measure(record.scaled(factor)) for factor in study.factor[i]], study.scale, rtol=1e-11
        )


def write_columns(folder: Path) -> None:
    """The suite as text of two columns, in g."""
    folder.mkdir()
    for record in SUITE:
        table = np.column_stack((record.times, record.acceleration / 9.80665))
        np.savetxt(folder / f"{record.name}.txt", table, fmt="%.17g")


def from_files(files: str) -> str:
    synthetic = next(line for line in RECORDS.splitlines() if line.startswith("synthetic"))
    return RECORDS.replace(synthetic, f"files = {files}")


@pytest.mark.slow
def test_files_are_read_once_and_not_needed_to_read_results(tmp_path):
    write_columns(tmp_path / "suite")
    (tmp_path / "job.toml").write_text(from_files('["suite/*-3.txt", "suite"]'))
    job = load_job(tmp_path / "job.toml")
    assert [one.name[-1] for one in job.study.suite] == ["3", "1", "2", "4"]
    path = tmp_path / "a.h5"
    assert campaign.run(job, path, Serial()) == 0
    assert validate(path, 3).sound
    results = open_results(path)
    _, _, made = computed(RECORDS, tmp_path, "made")
    np.testing.assert_allclose(results["pga"][1], SUITE[0].peak, rtol=1e-11)
    same = made["storey_drift"].isel(record=[2, 0, 1, 3])
    np.testing.assert_allclose(results["storey_drift"], same, rtol=1e-7)

    (tmp_path / "stored.toml").write_text(job.text)
    assert load_job(tmp_path / "stored.toml").fingerprint == job.fingerprint
    changed = tmp_path / "suite" / "synthetic-3-2.txt"
    np.savetxt(changed, 1.01 * np.loadtxt(changed), fmt="%.17g")
    with pytest.raises(JobError, match="synthetic-3-2 is missing or has changed since"):
        load_job(tmp_path / "stored.toml")
    (tmp_path / "suite").rename(tmp_path / "elsewhere")
    assert open_results(path).equals(results)
    assert status(path)["complete"]
    report = validate(path, 3)
    assert report.sound
    assert all("records.files: /" in again.compared for again in report.sample)
    assert "Errno" not in report.sample[0].compared
    done = hpcsweep(0, "validate", path, "--samples", "3")
    assert "0 of 3 runs compared: the record is not at hand" in done.stdout
    assert "whole" not in done.stdout


WRONG = {
    "nothing": ("", "must have at least 2 samples, is empty"),
    "nan": ("0.0 0.1\n0.1 nan\n0.2 0.1\n", "finite"),
    "text": ("no numbers at all\n", "must"),
    "uneven": ("0.0 0.1\n0.1 0.2\n0.5 0.1\n0.6 0.0\n", "must"),
    "one_column": ("0.1\n0.2\n0.3\n", "dt"),
    "count": ("A\nB\nIN UNITS OF G\nNPTS= 5, DT= .01 SEC\n0.1 0.2 0.3\n", "5"),
    "no_unit": ("A\nB\nC\nNPTS= 3, DT= .01 SEC\n0.1 0.2 0.3\n", "unit"),
    "no_step": ("A\nB\nIN UNITS OF G\nNPTS= 3, DT= 0.0 SEC\n0.1 0.2 0.3\n", "DT"),
    "still": ("0.0 0.0\n0.1 0.0\n0.2 0.0\n", "must be above 0"),
    "million": ("0.1 0.2\n" * 1_000_000, "must"),
}


@together("name, wrong", WRONG.items())
def test_a_bad_record_is_one_line(tmp_path, name, wrong):
    text, word = wrong
    (tmp_path / f"{name}.txt").write_text(text)
    (tmp_path / "job.toml").write_text(from_files(f'["{name}.txt"]'))
    with pytest.raises(JobError) as refused:
        load_job(tmp_path / "job.toml")
    assert len(str(refused.value).splitlines()) == 1
    assert name in str(refused.value)
    assert word in str(refused.value)


@together(
    "old, new, words",
    [
        ("synthetic = ", 'files = "x"\nsynthetic = ', ("records.files = 'x'", "one of the two")),
        ("count = 4", "count = 0", ("records.synthetic.count", "from 1 to 1000")),
        ("count = 4", "number = 4", ("records.synthetic.number", "known are count")),
        ("duration = 10.0", "duration = 0.1", ("records.synthetic.duration", "100 to")),
        ("duration = 10.0", 'soil = "rock"', ("records.synthetic.soil", "firm, medium, soft")),
        ('by = "pga"', 'by = "sa"', ("records.scale.period is missing",)),
        ('by = "pga"', 'by = "sa", period = -1', ("records.scale.period", "above 0")),
        ('by = "pga"', 'by = "sa", period = 1e9', ("records.scale.period must be from",)),
        ('by = "pga"', 'by = "mmi"', ("records.scale.by", "factor, pga, pgv, sa, avgsa")),
        ("from = 0.5", "from = 0.0", ("records.scale", "above 0")),
        ("from = 0.5", "values = [1.0], from = 0.5", ("records.scale.values", "without from")),
        ("tail = 1.0", "tail = -1.0", ("records.tail", "from 0 to")),
        ("tail = 1.0", "gravity = 0", ("records.gravity", "above 0")),
        ("tail = 1.0", 'unit = "g"', ("records.unit", "goes with records.files")),
        ("[records]", "[records]\nfound = 3", ("records.found", "as hpcsweep wrote it")),
        ("[output]", "[sweep]\nomega = 1.0\n[output]", ("sweep.omega", "study.kind")),
        ("[output]", "[forcing]\nharmonics = []\n[output]", ("forcing.harmonics", "study.kind")),
        ("[output]", "[output]\npoincare = true", ("output.poincare", "study.kind")),
        ("[output]", "[output]\ntimes = 1", ("output.times", "true or false")),
        ("[output]", "[output]\nhistory = 0.03", ("output.history", "0.03", "0.02", "multiple")),
        ("[output]", "[output]\nfloor_spectra = true", ("output.floor_spectra", "a table")),
        ("[output]", "[output]\nfloor_spectra = {}", ("output.floor_spectra.periods is missing",)),
        ("[output]", f"[output]\n{SPECTRA.replace('B3', 'B9')}", ("places", "B9", "A1, A2, B1")),
        ("[output]", f"[output]\n{SPECTRA.replace('[0.1', '[1e-3')}", ("periods", "0.01")),
        ("[output]", f"[output]\n{SPECTRA.replace('0.02', '1')}", ("damping_ratio", "below 1")),
        ("[output]", f"[output]\n{SPECTRA.replace('places', 'floors')}", ("floors", "places")),
        ("[output]", "[output]\nhistory = -1", ("output.history", "above 0")),
        ("[output]", '[solver]\nskip = ["newton"]\n[output]', ("solver.skip", "linear, ratio")),
        ("[output]", '[vary]\n"records.tail" = [0.0, 1.0]\n[output]', ("vary", "records.tail")),
    ],
)
def test_mistakes_name_key_and_limit(old, new, words):
    assert old in RECORDS
    with pytest.raises(JobError) as caught:
        parse_job(RECORDS.replace(old, new, 1), "job.toml", "job")
    message = str(caught.value)
    assert message.startswith("job.toml: ")
    assert "\n" not in message
    for word in words:
        assert word in message


PAIR = """[study]
kind = "records"
[[building]]
name = "A"
mass = [{mass}]
storey_stiffness = {k1}
[[building]]
name = "B"
mass = [{mass}]
storey_stiffness = {k2}
[pounding]
gap = {gap}
stiffness = {k}
[units]
{units}
[records]
files = ["pulse.txt"]
unit = "{unit}"
"""
METRES = {"mass": 250e3, "k1": 3e7, "k2": 2e7, "k": 2e9, "gap": 0.02}
UNITS = {
    "m": (METRES, 'length = "m"\nmass = "kg"\ntime = "s"', 1.0, 1.0),
    "mm": (
        {"mass": 250.0, "k1": 3e4, "k2": 2e4, "k": 2e6, "gap": 20.0},
        'length = "mm"\nmass = "t"\ntime = "s"',
        *(1e3, 1.0),
    ),
    "ms": (
        {"mass": 250e3, "k1": 30.0, "k2": 20.0, "k": 2e3, "gap": 20.0},
        'length = "mm"\nmass = "kg"\ntime = "ms"',
        *(1e3, 1e-3),
    ),
}
"""The same structure in three systems: numbers, names, and what 1 m and 1 N are."""


def write_pulse(folder: Path, unit: str) -> float:
    """Write a record; its peak in g."""
    t = 0.02 * np.arange(201)
    a = 0.35 * np.sin(np.pi * t / 4) ** 2 * np.sin(9 * t)
    table = np.column_stack((t, a * 9.80665 if unit == "m/s2" else a))
    np.savetxt(folder / "pulse.txt", table, fmt="%.17g", header=f"t (s), a ({unit})")
    return np.abs(a).max()


@pytest.mark.parametrize("unit", [pytest.param("g", marks=pytest.mark.slow), "m/s2"])
def test_units_that_are_named_are_those_of_the_record(tmp_path, unit):
    peak = write_pulse(tmp_path, unit)
    found = {}
    for name, (numbers, units, metre, newton) in UNITS.items():
        path = tmp_path / f"{name}.toml"
        path.write_text(PAIR.format(**numbers, units=units, unit=unit))
        job = load_job(path)
        assert campaign.run(job, tmp_path / f"{name}.h5", Serial()) == 0
        results = open_results(tmp_path / f"{name}.h5")
        drift, force = (results[key].values.ravel() for key in ("storey_drift", "contact_force"))
        found[name] = drift / metre, force / newton, results["impacts"].values.ravel()
        assert job.study.suite[0].pga / job.study.gravity == pytest.approx(peak, rel=1e-11)
    assert found["m"][2] > 0
    for name in ("mm", "ms"):
        for own, other in zip(found["m"], found[name], strict=True):
            np.testing.assert_allclose(other, own, rtol=1e-9)


@together(
    "units, more, words",
    [
        ('length = "mm"', "gravity = 9.80665", ("records.gravity = 9.80665", "is 9806.65 mm/s^2")),
        ('length = "yard"', "", ("units.length = 'yard'", "known unit of length")),
        ('time = "T"', "", ("units.time = 'T'", "known unit of time")),
    ],
)
def test_units_that_do_not_fit_a_record_are_refused(tmp_path, units, more, words):
    write_pulse(tmp_path, "g")
    path = tmp_path / "job.toml"
    path.write_text(PAIR.format(**METRES, units=units, unit="g") + more)
    with pytest.raises(JobError) as caught:
        load_job(path)
    for word in (*words, "job.toml: "):
        assert word in str(caught.value)
    assert "\n" not in str(caught.value)


def test_synthetic_records_are_in_seconds():
    named = RECORDS + '[units]\ntime = "ms"\n'
    (one, *_), (other, *_) = (parse_job(t, "a", "a").study.suite for t in (RECORDS, named))
    assert (one.dt, other.dt) == (0.02, 20.0)


def test_a_record_whose_name_is_no_utf8_is_one_line(tmp_path):
    (tmp_path / "K\udcf6ln.txt").write_text("0 .1\n.01 .2\n")
    (tmp_path / "job.toml").write_text(from_files('["."]').replace('["."]', '["*ln.txt"]'))
    for command in ("describe", "run"):
        done = hpcsweep(0, command, "job.toml", cwd=tmp_path)
        assert (done.returncode, len(done.stderr.splitlines())) == (2, 1)
        assert "records.files" in done.stderr
    assert len(list(tmp_path.iterdir())) == 2


def test_bdf_leaves_records_to_flow():
    with pytest.raises(JobError, match=r"job: solver\.method = 'bdf': must be 'flow' for records"):
        parse_job(f'{RECORDS}[solver]\nmethod = "bdf"\n', "job", "job")


def test_scales_of_records_are_of_studies_of_records():
    with pytest.raises(JobError, match=r"goes with study\.kind = "):
        parse_job(f"{RECORDS.replace('kind =', '#')}", "job.toml", "job")


def test_buildings_are_varied_one_by_one():
    text = RECORDS + '[vary]\n"building[0].period" = [0.3, 0.6]\n"pounding.gap" = [0.01, 0.02]\n'
    study = parse_job(text, "job", "job").study
    assert study.dimensions["building_0_period"] == 2
    for place, period in (((0, 0), 0.3), ((1, 1), 0.6)):
        structure = study.part(place).structure
        alone = np.linalg.eigvalsh(
            np.linalg.solve(structure.mass_matrix[:2, :2], structure.stiffness_matrix[:2, :2])
        )
        assert 2 * np.pi / np.sqrt(alone.min()) == pytest.approx(period, rel=1e-12)
    for wrong in ('"building.period"', '"building[2].period"', '"tower[0].period"'):
        with pytest.raises(JobError, match=r"job: .*vary"):
            parse_job(f"{RECORDS}[vary]\n{wrong} = [0.3, 0.6]\n", "job", "job")
    with pytest.raises(JobError, match=r"building\[0\]\.period must be finite and positive"):
        parse_job(f'{RECORDS}[vary]\n"building[0].period" = [0.0, 0.6]\n', "job", "job")


def test_a_run_that_fails_is_data(tmp_path):
    text = RECORDS.replace('{by = "pga", from = 0.5, to = 5.0, count = 5}', "{values = [1, 1e250]}")
    _, path, results = computed(text, tmp_path)
    outcome = results["outcome"].values
    assert (outcome[:, 0] == Outcome.COMPLETE).all()
    assert (outcome[:, 1] == Outcome.NON_FINITE).all()
    assert np.isnan(results["storey_drift"].values[:, 1]).all()
    assert (results["impacts"].values[:, 1] == 0).all()
    assert validate(path, 4).sound
    assert status(path)["n_failed"] == 4


@pytest.mark.slow
def test_every_command_serves_a_study_of_records(tmp_path):
    (tmp_path / "job.toml").write_text(RECORDS + GAPS)
    told = hpcsweep(0, "run", "job.toml", "--dry-run", cwd=tmp_path)
    assert told.returncode == 0, told.stderr
    assert "3 gaps x 4 records x 5 scales = 60 runs (records)" in told.stdout
    for word in ("synthetic-3-1", "PGA", "PGD", "Sa", "core-hours", "records are multiplied by"):
        assert word in told.stdout
    assert hpcsweep(0, "run", "job.toml", cwd=tmp_path).returncode == 0
    said = {}
    for name in ("describe job.toml", "status job.h5", "summary job.h5", "validate job.h5"):
        done = hpcsweep(0, *name.split(), cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        said[name.split()[0]] = done.stdout
    assert "linear" in said["status"]
    assert "scaled by" in said["summary"]
    assert "20 of 20 runs compared with flow" in said["validate"]
    (whole,) = json.loads(hpcsweep(0, "summary", "job.h5", "--json", cwd=tmp_path).stdout)
    assert whole["records"] == 4
    assert set(whole["largest"]) >= {"storey_drift", "contact_force"}
    done = hpcsweep(0, "plot", "job.h5", "--at", "gap=0.04", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "job.png").stat().st_size > 10_000
    assert hpcsweep(0, "animate", "job.h5", "-o", "x.mp4", cwd=tmp_path).returncode == 2
    assert hpcsweep(0, "pack", "job.h5", "-o", "packed.h5", cwd=tmp_path).returncode == 0
    assert open_results(tmp_path / "packed.h5").equals(open_results(tmp_path / "job.h5"))


YIELD = 'name = "A"\nyield_drift = [0.004, 0.002]\nhardening = 0.05\n'
SLID = (
    *("ductility", "slider_force", "plastic", "plastic_path", "excursions", "slider_energy"),
    "residual_drift",
)


def test_yielding_buildings_are_computed_as_plainly(tmp_path, calls):
    text = FACTORS.replace('name = "A"\n', YIELD)
    assert text != FACTORS
    job, path, results = computed(text, tmp_path)
    structure = job.study.structure
    assert results["slider"].values.tolist() == ["A1", "A2"]
    rules = results["skip_rule"].values
    assert set(np.unique(rules)) == {SkipRule.NONE, SkipRule.LINEAR}
    for place in np.ndindex(4, 4):
        found = response(structure, SUITE[place[0]], float(results["scale"][place[1]]), tail=1.0)
        assert (
            (found.excursions > 0).any() or rules[place] == SkipRule.LINEAR or found.impacts.any()
        )
        for name, field in (FIELDS | dict(zip(SLID, SLID, strict=True))).items():
            own, plain = results[name].values[place], getattr(found, field)
            size = max(np.abs(plain).max(), 1e-300)
            np.testing.assert_allclose(own, plain, rtol=0, atol=1e-9 * size, err_msg=name)
    assert results["excursions"].values.sum() > 10
    assert validate(path, 3).sound


@pytest.mark.slow
def test_what_yields_yields_without_contacts(tmp_path, calls):
    """By runs of each building alone, which share nothing; gaps share the motion without them."""
    text = FACTORS.replace('name = "A"\n', YIELD + "collapse_drift = [0.03, inf]\n")
    text = text.replace("[0.25, 0.5, 1.0, 2.0]", "[0.05, 1.0, 2.0, 5.0]")
    gaps = GAPS.replace("0.01, 0.02, 0.04", "0.011, 0.021, 0.043")
    _, path, results = computed(text + gaps, tmp_path)
    of_alone = [np.isclose(calls, scale / 0.004).sum() for scale in (1.0, 2.0, 5.0)]
    assert of_alone == [len(SUITE)] * 3
    assert validate(path, 3).sound
    named = {"A": ([2.5e5] * 2, 3e8), "B": ([2.5e5] * 3, 1e8)}
    yields = {"yield_drift": [0.004, 0.002], "hardening": 0.05, "collapse_drift": [0.03, np.inf]}
    single = {
        name: Building(*of, storey_height=3.2, **(yields if name == "A" else {})).structure
        for name, of in named.items()
    }
    fallen = 0
    for k, at in np.ndindex(4, 4):
        run, scale = results.isel(record=k, scale=at), float(results["scale"][at])
        a, b = (response(single[name], SUITE[k], scale, tail=1.0) for name in "AB")
        assert run["skip_rule"].values.all() == (at == 0)
        np.testing.assert_equal(run["collapse_time_alone"].values, 3 * [a.collapse_time])
        fallen += a.collapsed
        if a.collapsed:
            continue
        for name in ("storey_drift", "displacement", "floor_acceleration"):
            own = np.concatenate([getattr(one, name) for one in (a, b)])
            found = run[f"{name}_alone"].values
            np.testing.assert_allclose(found, [own] * 3, rtol=1e-10, err_msg=name)
        np.testing.assert_allclose(run["ductility_alone"].values, [a.ductility] * 3, rtol=1e-10)
        left = np.concatenate((a.residual_drift, b.residual_drift))
        np.testing.assert_allclose(run["residual_drift_alone"], [left] * 3, rtol=0, atol=1e-12)
        moved = [history(single[name], SUITE[k], scale, 1.0, 1e-3).displacement for name in "AB"]
        approach = (moved[0] - moved[1][:, :2]).max(axis=0)
        np.testing.assert_allclose(run["gap_needed"].values, [approach] * 3, rtol=2e-4)
        needs = run["gap_needed"].values > results["gap"].values[:, None]
        assert ((run["impacts"].values > 0).any(axis=1) == needs.any(axis=1)).all()
    assert 0 < fallen < 8


def test_gaps_and_strengths_in_proportion_are_computed_once(tmp_path, calls):
    """Yielding at half the force under half the record, with half the gap, is the same motion."""
    force = "yield_force = {}\n"
    text = FACTORS.replace('name = "A"\n', 'name = "A"\n' + force.format(4e5))
    computed(text, tmp_path)
    first = len(calls)
    calls.clear()
    gap = float(text.split("gap = ")[1].split()[0])
    half = text.replace(force.format(4e5), force.format(2e5))
    computed(half.replace(f"gap = {gap:g}", f"gap = {gap / 2:g}"), tmp_path, "b")
    # of the scales 0.25, 0.5, 1, 2 the last alone has no twin, with and without contacts
    assert 0 < len(calls) <= 2 * len(SUITE) < first


def test_histories_of_sliders_are_their_law(tmp_path):
    text = FACTORS.replace("[output]", "[output]\nhistory = 0.1").replace('name = "A"\n', YIELD)
    job, path, results = computed(text, tmp_path)
    structure = job.study.structure
    run = {"record": 1, "scale": 3}
    force = results["history_slider_force"].isel(run).values
    strength = np.array([one.strength for one in structure.sliders])
    assert (np.abs(force) <= strength * (1 + 1e-12)).all()
    u = results["history_displacement"].isel(run).values
    stretch = u @ structure.slider_directions.T
    spring = np.array([one.stiffness for one in structure.sliders])
    lasting = stretch - force / spring
    assert lasting[0] == pytest.approx(0.0, abs=1e-15)
    np.testing.assert_allclose(lasting[-1], results["plastic"].isel(run).values, rtol=0, atol=1e-12)
    path = np.abs(np.diff(lasting, axis=0)).sum(axis=0)
    assert (path <= results["plastic_path"].isel(run).values * (1 + 1e-9) + 1e-15).all()
    assert validate(path_of(job, tmp_path), 2).sound


def path_of(job, folder: Path) -> Path:
    """Return where `computed` has written the results of a job."""
    return folder / f"{job.name}.h5"


WRONG_YIELD = [
    ('"A"\nyield_drift = 0.0', "building[0].yield_drift must be above 0"),
    ('"A"\nyield_drift = 0.1\nyield_force = 1.0', "must not be given both"),
    ('"A"\nhardening = 0.1', "building[0].hardening goes with yield_force or yield_drift"),
    (
        '"A"\nyield_drift = 0.1\nhardening = 1.0',
        "building[0].hardening must be from -0.1 to below 1",
    ),
    ('"A"\nyield_drift = [0.1]', "building[0].yield_drift must have 2 numbers, one per storey"),
    ('"A"\nyield_drift = "soft"', "building[0].yield_drift"),
]


@together("given, message", WRONG_YIELD)
def test_storeys_that_cannot_yield_so_are_refused(given, message):
    with pytest.raises(JobError) as caught:
        parse_job(RECORDS.replace('"A"', given), "job.toml", "job")
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_sliders_of_matrices_and_what_they_do_not_go_with():
    matrices = (
        "[structure.matrices]\nmass = [1.0]\nstiffness = [[1.0]]\n"
        "[[structure.slider]]\ndirection = [1.0]\nstiffness = 2.0\nstrength = 0.5\n"
    )
    base = RECORDS[: RECORDS.index("[[building]]")]
    rest = RECORDS[RECORDS.index("[records]") :]
    job = parse_job(base + matrices + rest, "job", "job")
    assert job.structure.slider_names == ("1",)
    assert job.structure.stiffness_matrix.tolist() == [[3.0]]
    for wrong, message in (
        (matrices.replace("strength = 0.5\n", ""), "structure.slider[0].strength is missing"),
        (matrices.replace("strength", "force"), "structure.slider[0].force"),
        (matrices.replace("0.5", "-1"), "structure.slider[0].strength must be"),
    ):
        with pytest.raises(JobError) as caught:
            parse_job(base + wrong + rest, "job", "job")
        assert message in str(caught.value)
    pressed = "[[structure.contact]]\ndirection = [1.0]\ngap = -5.0\nstiffness = 9.0\n"
    with pytest.raises(JobError, match="slider 1 would slip at rest"):
        parse_job(base + matrices + pressed + rest, "job", "job")


ISOLATION = "slab_mass = 2e5\nradius = 2.0\nfriction = 0.05\ngap = 0.1\nwall_stiffness = 1e9\n"
ALONE = """
[study]
kind = "records"
[[building]]
mass = [2.5e5, 2.5e5]
storey_stiffness = 3e8
storey_height = 3.2
[building.isolation]
{}[units]
length = "mm"
mass = "t"
time = "s"
[records]
synthetic = {{count = 2, seed = 3, dt = 0.02, duration = 10.0, rms = 2000.0}}
"""
ISOLATED = ALONE.format(ISOLATION)


FRAME = """
[study]
kind = "records"
[[building]]
name = "A"
mass = [2.5e5, 2.5e5, 2.5e5]
storey_stiffness = 3e8
storey_height = 3.2
[records]
synthetic = {count = 2, seed = 3, dt = 0.02, duration = 10.0}
scale = {by = "pga", values = [1.0]}
"""
OWN = 2 * np.pi / np.sqrt(1200.0) / 0.4450418679
"""Period of three equal storeys, k / m = 1,200."""
BEARINGS = """[building.isolation]
slab_mass = 2.5e5
friction = 0.05
radius = {}
[records]
gravity = 9.80665"""
BESIDE = """[[building]]
mass = [2.5e5]
storey_stiffness = 3e8
storey_height = 3.2
[pounding]
gap = {}
stiffness = 1e9
[records]"""
MATRICES = """[structure.matrices]
mass = [2.0]
stiffness = [[30.0]]
[records]
synthetic = {count = 1, duration = 10.0}
"""
BY_PERIOD = {'by = "pga"': 'by = "sa", period = "T1"'}


@together(
    "new, said",
    [
        ({}, []),
        (
            {"2.5e5": "250.0"},
            [f"0.0129 s on a fixed base, 3 storeys .*: {OWN:.3g} s if masses are in t"],
        ),
        ({"3e8": "3e5"}, [f"a period of 12.9 s .* 1.5 s: {OWN:.3g} s if stiffnesses are in kN/m$"]),
        ({"3e8": "300.0"}, [f"a period of 408 s .*: {OWN:.3g} s if stiffnesses are in kN/mm, or"]),
        (
            {"3e8": "3e5", "[records]": '[units]\nmass = "t"\n[records]'},
            [f"the building has a period of 12.9 s .*: {OWN:.3g} s if masses are in kg$"],
        ),
        (
            {"3.2": "3.2\nyield_drift = 0.5"},
            [
                r"storey 1 \(and 2 more\) yields at a drift of 0.5, 15.6 % of its height 3.2, out"
                "side 0.05 to 5 %: 0.156 % if yield drifts are in cm, 0.5 % if it is a percentage"
            ],
        ),
        ({"3.2": "3.2\nyield_drift = 16.0"}, ["500 % .*: 0.5 % if yield drifts are in mm, 5 % if"]),
        ({"3.2": "3.2\nyield_force = 4.8e3"}, ["0.0005 % .*: 0.5 % if yield forces are in kN"]),
        ({"3.2": "3.2\nyield_drift = 0.016"}, []),
        ({"3.2": "[3.2, 3.2, 3200.0]"}, ["storey heights of 3.2 and 3200 are .*: mm beside m?"]),
        ({"3.2": "[3.2, 320.0, 3.2]"}, ["storey heights of 3.2 and 320 are .*: cm beside m?"]),
        (
            BY_PERIOD | {"[records]": BEARINGS.format(2.24)},
            [r"by Sa at T1 = 0\.\d+, the period of stuck .* is 3.022: .*period = \"isolated\"?"],
        ),
        (
            BY_PERIOD | {"3.2": "3.2\nyield_drift = 0.016", "[records]": BEARINGS.format(2.24)},
            [r"by Sa at T1 = 0\.\d+, the period of stuck .* is 3.0\d+: .*period = \"isolated\"?"],
        ),
        (
            {"[records]": BEARINGS.format(2240.0)},
            ["bearings that slide have a period of 95 s, above 12 s: 3 s if the radius is in mm"],
        ),
        (
            {"[records]": BESIDE.format(20)},
            [
                "contact A1-B1 has a gap of 20, 625 % of the storey height 3.2, outside 0.003 to "
                "100 %: 0.625 % if gaps are in mm, 6.25 % if gaps are in cm$"
            ],
        ),
        ({"[records]": BESIDE.format(0.02)}, []),
        ({"[records]": BESIDE.format(0.0)}, []),
    ],
)
def test_units_that_are_mistaken_are_told_with_the_one_that_would_be_right(new, said):
    text = FRAME
    for old, own in new.items():
        text = text.replace(old, own)
    job = parse_job(text, "job", "job")
    found = warnings(job)
    assert len(found) == len(said), found
    assert all(re.search(one, line) for one, line in zip(said, found, strict=True)), found
    sliding = [line for _, line in describe(job) if line.startswith("while the bearings alone")]
    assert len(sliding) == text.count("isolation")


def test_a_building_is_told_by_weight_yield_force_theta_and_period():
    """Of equal storeys by hand, also with P-Delta, beside another and on bearings."""
    weight, g = 3 * 2.5e5 * 9.80665, 9.80665
    theta = weight / (3e8 * 3.2)

    def lines(text: str) -> list[str]:
        return [line for name, line in describe(parse_job(text, "job", "a")) if name == "building"]

    own = f"period {OWN:.4g} on a fixed base, {OWN / 3:.3g} a storey"
    elastic = f"weight {weight:.4g}, theta at most {theta:.3g}, {own}"
    assert lines(FRAME) == [elastic]
    yields = FRAME.replace("3.2", "3.2\nyield_drift = 0.016")
    told = elastic.replace("theta", f"V_y/W {3e8 * 0.016 / weight:.3g}, theta")
    assert lines(yields) == [told]
    assert lines(yields.replace("[records]", BEARINGS.format(2.24))) == [told]
    falls = yields.replace("3.2", "3.2\np_delta = true\ncollapse_drift = 0.1")
    (softer,) = lines(falls.replace("[records]", f"[records]\ngravity = {g}"))
    assert softer.partition("period")[0] == told.partition("period")[0]
    assert softer != told
    named = '[units]\nlength = "m"\nmass = "kg"\ntime = "s"\n[records]'
    beside = yields.replace("[records]", BESIDE.format(0.02).replace("[records]", named))
    first, second = lines(beside)
    assert first.startswith(f"A: weight {weight:.4g} N, V_y/W ")
    assert second.startswith(f"B: weight {weight / 3:.4g} N, theta at most {theta / 3:.3g}, ")
    assert not lines("".join(RECORDS.partition("[[building]]")[:1]) + MATRICES)


def test_scales_may_be_of_the_period_of_bearings_that_slide():
    """By the eigenvalues of storeys on springs of stiffness W / R; without bearings it is told."""
    text = FRAME.replace('by = "pga"', 'by = "sa", period = "isolated"')
    study = parse_job(text.replace("[records]", BEARINGS.format(2.24)), "job", "job").study
    k = [1e6 * 9.80665 / 2.24, 3e8, 3e8, 3e8, 0.0]
    stiffness = np.diag(np.add(k[:-1], k[1:])) - np.diag(k[1:-1], 1) - np.diag(k[1:-1], -1)
    period = 2 * np.pi / np.sqrt(np.linalg.eigvalsh(stiffness / 2.5e5)[0])
    for i in range(2):
        (sa,) = spectrum(study.record(i), [period]).acceleration * study.factor[i]
        assert sa == pytest.approx(1.0, rel=1e-9)
    with pytest.raises(JobError, match="period = 'isolated': needs a building on bearings"):
        parse_job(text, "job", "job")


def test_heights_in_two_units_are_told_in_place_of_a_column():
    with pytest.raises(
        JobError, match=r"faces a column of A: storey heights of 3.2 and 3200 .* mm"
    ):
        parse_job(RECORDS.replace("height = 3.2", "height = 3200.0", 1), "job", "job")


def test_demands_have_the_slab_and_no_run_that_collapses(tmp_path):
    """Not the peak of the ground as PFA-0, nor rows up to a collapse, which a file beside has.

    All records collapse somewhere: the fragility is that of the logarithms of their capacities.
    """
    text = FRAME.replace("3.2", "3.2\nyield_drift = 0.004\ncollapse_drift = 0.012")
    text = text.replace("[records]", BEARINGS.format(2.24)).replace("count = 2", "count = 6")
    (tmp_path / "a.toml").write_text(text.replace("[1.0]", "[2.0, 7.0, 20.0]"))
    assert hpcsweep(0, "run", "a.toml", cwd=tmp_path).returncode == 0
    results, study = open_results(tmp_path / "a.h5"), parse_job(text, "job", "job").study
    g, period = 9.80665, study.structure.longest_period
    records = [study.record(i) for i in range(6)]
    sa = np.array([spectrum(record, [period]).acceleration[0] for record in records])
    given, head = ("fragility", "a.h5", "--demands", "d.csv"), ["1-PFA-0-1"]
    head += [f"1-{kind}-{k}-1" for kind in ("PFA", "PID", "RID") for k in (1, 2, 3)]
    head += [f"1-SA_{period:.4g}-0-1"]
    for scales in ([2.0], [7.0], [2.0, 7.0], [2.0, 7.0, 20.0]):
        asked = [] if len(scales) == 3 else ["--scale", *map(str, scales)]
        done = hpcsweep(0, *given, *asked, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        runs = results.sel(scale=scales).transpose("scale", "record", ...)
        stands = runs.collapsed.values == 0
        names = runs.record.values[None].repeat(len(scales), axis=0).astype(object)
        if len(scales) > 1:
            names = names + [[f", PGA = {scale:g}"] for scale in scales]
        with (tmp_path / "d.csv").open(newline="") as stream:
            (note, *columns), units, *rows = csv.reader(stream)
        fallen = (~stands).sum()
        said = "PFA-0 is that of isolation; "
        said += f"{fallen} of {stands.size} runs collapse, see d.json"
        assert (note, columns, said in done.stdout) == (said, head, True)
        assert units == ["Units", *["g"] * 4, *["rad"] * 6, "g"]
        assert [row[0] for row in rows] == names[stands].tolist()
        table = np.array([row[1:] for row in rows], float)
        drifts = (
            runs.floor_acceleration.values / g,
            runs.storey_drift.values / 3.2,
            abs(runs.residual_drift.values) / 3.2,
            (runs.factor.values * sa / g)[..., None],
        )
        own = np.concatenate([each[stands] for each in drifts], axis=1)
        np.testing.assert_allclose(table, own, rtol=1e-12)
        beside = json.loads((tmp_path / "d.json").read_text())
        assert beside["collapsed"] == names[~stands].tolist()
        assert beside["unit"] == "mps2"
    assert 0 < results.collapsed.sel(scale=7).values.sum() < 6
    assert runs.residual_drift.values[stands].any()
    first = results.collapsed.values.argmax(axis=1)
    capacity = np.array([1.0, 4.5, 13.5])[first] * sa / [record.peak for record in records]
    capacity = np.log(capacity)
    fitted = beside["CollapseFragility"]
    assert fitted["DemandType"] == head[-1][2:-4]
    assert fitted["CapacityMedian"] == pytest.approx(math.exp(capacity.mean()), rel=1e-9)
    assert fitted["Theta_1"] == pytest.approx(capacity.std(), rel=1e-9)
    for wrong, said in (
        (["--scale", "20"], "all records collapse"),
        (["--place", "1"], "of one building"),
    ):
        done = hpcsweep(0, *given, *wrong, cwd=tmp_path)
        assert (done.returncode, said in done.stderr) == (2, True)


def test_a_slab_that_weighs_next_to_nothing_is_warned_of():
    def told(job: str) -> list[str]:
        return [text for text in warnings(parse_job(job, "job", "a")) if "as fast" in text]

    assert not told(ISOLATED)
    (text,) = told(ISOLATED.replace("= 2e5\n", "= 0.5\n"))
    assert re.match("mode 3 is .* a motion of isolation: runs take long", text)


def test_an_isolated_building_alone_is_a_job(tmp_path):
    """One g is 9806.65 mm/s^2, so that the mass cancels: mu W / (99 W / R) = mu R / 99."""
    text = ISOLATED + '[vary]\n"building[0].isolation.friction" = [0.03, 0.06]\n'
    text = text.replace("radius = 2.0", "radius = 2000.0").replace("gap = 0.1", "gap = 100.0")
    study = parse_job(text, "job", "job").study
    assert study.dimensions["building_0_isolation_friction"] == 2
    for place, friction in (((0,), 0.03), ((1,), 0.06)):
        structure = study.part(place).structure
        (slider,) = structure.sliders
        assert slider.limit == pytest.approx(friction * 2000.0 / 99.0, rel=1e-14)
        assert slider.strength == pytest.approx(friction * 7e5 * 9806.65, rel=1e-14)
        assert [one.gap for one in structure.contacts] == [100.0, 100.0]
    _, path, results = computed(text, tmp_path)
    assert results["floor"].values.tolist() == ["isolation", "1", "2"]
    assert results["storey"].values.tolist() == ["1", "2"]
    assert results["storey_height"].values.tolist() == [3.2, 3.2]
    assert results["slider"].values.tolist() == ["isolation"]
    assert results["stop"].values.tolist() == ["wall right", "wall left"]
    assert results["excursions"].values.min() > 0
    assert results["base_shear"].dims[1:] == ("record", "scale", "building")
    assert validate(path, 2).sound


def test_a_key_of_an_isolation_is_set_from_the_command_line(tmp_path):
    (tmp_path / "job.toml").write_text(ISOLATED)
    job = load_job(tmp_path / "job.toml", ["building[0].isolation.gap = 0.3"])
    assert {one.gap for one in job.structure.contacts} == {0.3}
    assert job.structure.sliders == parse_job(ISOLATED, "job", "job").structure.sliders
    varied = '[vary]\n"building[0].isolation.gap" = [0.2, 0.3]\n'
    told = "not used: building[0].isolation.gap ([vary] gives its values)"
    assert parse_job(ISOLATED + varied, "job", "job").notes == (told,)
    with pytest.raises(JobError, match=r"isolation\.gap must be at least 0"):
        parse_job(ISOLATED.replace("gap = 0.1", "gap = -0.1") + varied, "job", "job")


WRONG_ISOLATION = [
    ("slab_mass = 2e5\n", "", "building[0].isolation.slab_mass is missing"),
    ("radius = 2.0", "radius = -2.0", "building[0].isolation.radius must be finite and positive"),
    ("radius = 2.0", "radius = 1e30", "building[0].isolation.radius must be finite and pos"),
    ("radius = 2.0", "curvature = 2.0", "unknown key 'building[0].isolation.curvature'"),
    ("gap = 0.1\n", "", "building[0].isolation.wall_stiffness = 1000000000.0: goes with gap"),
    (
        'length = "mm"\n',
        "",
        "building[0].isolation.friction = 0.05: needs one g: give [units] or",
    ),
    ("radius = 2.0", "gravity = 9.8", "unknown key 'building[0].isolation.gravity'"),
    ("friction = 0.05", 'friction = "low"', "building[0].isolation.friction must be a number"),
    ("friction = 0.05", "friction = 1e-40", "building[0].isolation.friction = 1e-40: must be"),
    ("gap = 0.1", "gap = -0.1", "building[0].isolation.gap must be at least 0 (inf: no walls)"),
    (ISOLATION, "", "building[0].isolation.slab_mass is missing"),
    (
        f"[building.isolation]\n{ISOLATION}",
        "isolation = 3\n",
        "building[0].isolation = 3: must be",
    ),
    (
        "[units]",
        "[pounding]\ngap = 1.0\n[units]",
        "pounding = {'gap': 1.0}: goes with two [[building]]",
    ),
    ('length = "mm"', 'length = "pt"', "units.length = 'pt': must be a known unit of length"),
    ('"records"', '"points"', "study.kind = "),
]


@together("old, new, message", WRONG_ISOLATION)
def test_what_is_wrong_with_an_isolation_is_one_line(old, new, message):
    assert old in ISOLATED
    with pytest.raises(JobError) as caught:
        parse_job(ISOLATED.replace(old, new, 1), "job.toml", "job")
    assert str(caught.value).startswith("job.toml: ")
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


FALLS = """
[study]
kind = "records"
[structure]
n_floors = 2
mass = 2.5e5
storey_stiffness = [1e8, 8e7]
storey_height = [3.5, 3.0]
gap = inf
sharpness = inf
yield_drift = 0.006
hardening = -0.03
p_delta = true
collapse_drift = [0.15, 0.2]
[records]
gravity = 9.80665
synthetic = {count = 4, seed = 3, dt = 0.02, duration = 10.0}
tail = 2.0
scale = {values = [0.25, 1.0, 2.0, 4.0, 8.0]}
[output]
block = 2
base_shear = true
energy = true
"""
LOSES = """collapse_drift = 9.0
backbone = {theta_p = 0.01, theta_pc = 0.03, Lambda = 0.5, rule = "peak-oriented"}"""
"""In place of what softens."""
FALLEN = (
    *("collapsed", "collapse_time", "base_shear", "ductility", "storey_drift", "plastic"),
    "energies",
)


@pytest.mark.slow
def test_collapses_are_computed_as_plainly_and_told(tmp_path):
    job, path, results = computed(FALLS, tmp_path)
    structure = job.study.structure
    first = 1e8 - 2 * 2.5e5 * 9.80665 / 3.5
    assert structure.stiffness_matrix[0].sum() == pytest.approx(first)
    fallen = results["collapsed"].values
    assert fallen.dtype == np.int32
    assert 2 < fallen.sum() < 16
    assert (np.isfinite(results["collapse_time"].values) == (fallen == 1)).all()
    assert results["base_shear"].dims == ("record", "scale", "building")
    for place in np.ndindex(4, 5):
        scale = float(results["scale"][place[1]])
        asked = {"base_shear": True, "energy": True}
        plain = response(structure, SUITE[place[0]], scale, tail=2.0, **asked)
        names = dict(zip(FALLEN, FALLEN, strict=True)) | {
            "storey_drift": "drift",
            "energies": "energy",
        }
        for name, field in names.items():
            own, other = results[name].values[place], np.asarray(getattr(plain, field), float)
            small = 1e-9 * max(1.0, np.abs(other).max())
            np.testing.assert_allclose(own, other, rtol=1e-8, atol=small, err_msg=name)
    energies = results["energies"]
    assert energies["energy"].values[0] == "input"
    spent = energies.values[..., 1:].sum(axis=-1)
    np.testing.assert_allclose(spent, energies.values[..., 0], rtol=1e-11)
    assert validate(path, 4).sound
    told = summarize(path)
    assert told["collapsed"]["runs"] == fallen.sum()
    assert (np.isnan(results["residual_drift"].values).all(axis=-1) == (fallen == 1)).all()
    lines = dict(describe(job))
    assert "P-Delta" in lines["structure"]
    assert lines["collapse"] == "beyond a drift of (0.15, 0.2)"
    _, _, plain = computed(FALLS + '[solver]\nskip = "none"\n', tmp_path, "plain")
    assert (results["skip_rule"] == SkipRule.LINEAR).any()
    for name in FALLEN:
        size = 1e-10 * max(1.0, float(np.abs(plain[name]).max()))
        np.testing.assert_allclose(results[name], plain[name], rtol=1e-8, atol=size)


@pytest.mark.slow
def test_an_elastic_storey_that_collapses_is_not_linear(tmp_path):
    """Storey 2 does not yield: its limit alone bounds the rule."""
    text = FALLS.replace("yield_drift = 0.006", "yield_drift = [9.0, inf]")
    text = text.replace("[0.15, 0.2]", "[9.5, 0.01]").replace("hardening = -0.03\n", "")
    _, path, results = computed(text, tmp_path)
    drift, fallen = results["storey_drift"].values[..., 1], results["collapsed"].values
    linear = results["skip_rule"].values == SkipRule.LINEAR
    assert ((drift < 0.01 * (1 - 1e-12)) == (fallen == 0)).all()
    assert (linear == (fallen == 0)).all()
    assert 0 < fallen.sum() < fallen.size
    assert validate(path, 2).sound


@together(
    "old, new, message",
    [
        ("gravity = 9.80665\n", "", "structure.p_delta = True: needs one g: give [units] or"),
        ("p_delta = true", "weight = 1e6", "structure.weight = 1000000.0: goes with p_delta"),
        ("storey_height = [3.5, 3.0]\n", "", "structure.storey_height is missing: p_delta needs"),
    ],
)
def test_weights_that_are_not_known_or_not_used_are_refused(old, new, message):
    assert old in FALLS
    with pytest.raises(JobError) as caught:
        parse_job(FALLS.replace(old, new), "job.toml", "job")
    assert message in str(caught.value)


@pytest.mark.slow
def test_curves_end_flat_where_structures_collapse(tmp_path):
    job, _, results = computed(FALLS, tmp_path, "falls")
    fallen = results["collapsed"].values > 0
    scale = results["scale"].values
    stripes = stripes_of(results, job.study)
    assert (np.isinf(stripes.values) == fallen).all()
    reached = capacities(stripes_of(results, job.study, "collapse"), 1.0)
    for capacity, record in zip(reached.scale, fallen, strict=True):
        at = int(record.argmax())
        before = scale[at - 1] if at else 0.0
        assert capacity == (0.5 * (before + scale[at]) if record.any() else np.inf)
    done = hpcsweep(0, "fragility", "falls.h5", "--collapse", "--json", cwd=tmp_path)
    told = json.loads(done.stdout)
    assert told["response"] == "collapse"
    assert told["never"] == 4 - fallen.any(axis=1).sum()
    assert told["capacity"]["0.5"] == np.sort(reached.scale)[1]
    # beyond the drift at which it collapses it has collapsed, at any threshold
    drift = ("--threshold", "1000", "--json")
    beyond = hpcsweep(0, "fragility", "falls.h5", *drift, cwd=tmp_path)
    assert json.loads(beyond.stdout)["capacity"] == told["capacity"]
    for options in (("--kind", "ida"), ("--kind", "fragility", "--collapse")):
        done = hpcsweep(0, "plot", "falls.h5", *options, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
    assert "collapsed" in hpcsweep(0, "summary", "falls.h5", cwd=tmp_path).stdout
    computed(RECORDS, tmp_path, "stands")
    done = hpcsweep(0, "fragility", "stands.h5", "--collapse", cwd=tmp_path)
    assert done.returncode == 2
    assert "hold no collapsed: the structure has no collapse_drift" in done.stderr


def test_a_storey_that_has_lost_its_strength_counts_as_collapsed(tmp_path):
    """No limit is reached, and nothing stands at the end: told apart by when it was lost."""
    text = FALLS.replace("hardening = -0.03\np_delta = true\ncollapse_drift = [0.15, 0.2]", LOSES)
    job, path, results = computed(text, tmp_path)
    lost = np.isfinite(results["strength_lost"].values)
    assert 2 < lost.any(axis=-1).sum() < 16
    assert not results["collapsed"].values.any()
    assert (np.isnan(results["residual_drift"].values).all(axis=-1) == lost.any(axis=-1)).all()
    assert validate(path, 4).sound
    told = summarize(path)
    assert (told["collapsed"]["runs"], told["strength_lost"]["runs"]) == (0, lost.any(-1).sum())
    for quantity in ("collapse", "residual_drift"):
        reached = np.isinf(responses_of(results, job.study, quantity).values).all(axis=-1)
        assert (reached == lost.any(axis=-1)).all()
