"""What is read of a job: ranges, hints, and what no key takes."""

import itertools
import time
from fractions import Fraction

import odd_values
import pytest
from together import together
from tools import BASINS, SMALL

from hpcsweep.job import JobError, load_job, parse_job
from hpcsweep.job.values import Values

SOME = ({}, float("nan"), "a\nb")
"""Odd values of which no key takes more than one; `odd_values` tries all."""
SHARED = ("name", "structure", "forcing", "sweep", "solver")
"""Tables that are read alike for all studies: their keys are tried with the first job."""


def said(text: str) -> str:
    with pytest.raises(JobError) as refused:
        parse_job(text, "job.toml", "job")
    message = str(refused.value)
    assert message.startswith("job.toml: ")
    assert "\n" not in message
    return message


@pytest.mark.slow
@pytest.mark.parametrize("job", odd_values.JOBS)
def test_every_key_is_named_by_what_refuses_odd_values(job, tmp_path):
    odd_values.with_record(tmp_path)
    (tmp_path / "sound.toml").write_text(odd_values.JOBS[job])
    assert load_job(tmp_path / "sound.toml").study.n_runs > 0
    before = itertools.takewhile(lambda other: other != job, odd_values.JOBS)
    tried = {case.key for other in before for case in odd_values.cases(other)}
    tried = {key for key in tried if key.split(".")[0] in SHARED}
    found = {
        (case.key, str(case.value)[:40]): odd_values.judge(case, tmp_path)
        for case in odd_values.cases(job)
        if case.key not in tried
        if "vary" not in case.key and str(case.value) in map(str, SOME)
    }
    wrong = {case: end for case, end in found.items() if end not in odd_values.FINE}
    assert wrong == {}
    assert sum(end == "refused" for end in found.values()) > 0.9 * len(found) > 75


@together(
    "table, key, hint",
    [
        ("sweep", "beta", "did you mean 'structure.stiffness_ratio'?"),
        ("structure", "beta", "did you mean 'stiffness_ratio'?"),
        ("sweep", "zeta", "did you mean 'structure.damping_ratio'?"),
        ("solver", "rho", "did you mean 'structure.sharpness'?"),
        ("structure", "Omega", "did you mean 'sweep.omega'?"),
        ("structure", "A", "did you mean 'sweep.amplitude'?"),
        ("structure", "e", "did you mean 'restitution'?"),
        ("structure", "damping", "did you mean 'damping_ratio'?"),
        ("sweep", "gap", "it belongs in [structure]"),
        ("solver", "name", "did you mean 'method'?"),
        ("structure", "name", "it belongs at the top of the file"),
        ("sweep", "amplitud", "did you mean 'amplitude'?"),
        ("structure", "colour", "known are n_floors, mass, "),
        ("sweep", "starts", 'it goes with study.kind = "attractors" or'),
    ],
)
def test_a_hint_is_by_meaning_then_by_place_then_by_spelling(table, key, hint):
    if key == "starts":
        table = "study"
        text = f"{SMALL}\n[study]\nstarts = 3\n"
    else:
        text = SMALL.replace(f"[{table}]", f"[{table}]\n{key} = 1", 1)
        text = text if f"[{table}]" in SMALL else f"{SMALL}\n[{table}]\n{key} = 1\n"
    assert f"unknown key '{table}.{key}'; {hint}" in said(text)


MILLIONS = "{from = 0.0, to = 1.0, count = 1_000_000_000}"
RECORDS = odd_values.JOBS["records"]


@together(
    "text, key",
    [
        (SMALL + f"[vary]\nstructure.gap = {MILLIONS}\n", "vary.structure.gap.count"),
        (
            SMALL + "[vary]\nstructure.gap = {from = 0.0, to = 1.0, step = 1e-9}\n",
            "vary.structure.gap.step",
        ),
        (
            SMALL + f"[vary]\nstructure.gap = {MILLIONS.replace('1_000_000_000', '10_000_000')}\n",
            "vary.structure.gap.count",
        ),
        (SMALL.replace("{from = 0.5, to = 0.8, count = 4}", MILLIONS), "sweep.omega.count"),
        (SMALL.replace("{from = 0.02, to = 0.3, count = 11}", MILLIONS), "sweep.amplitude.count"),
        (
            RECORDS.replace('"sa"\nperiod = 0.5', f'"avgsa"\nperiods = {MILLIONS}'),
            "records.scale.periods.count",
        ),
        (RECORDS.replace("count = 3\n", "count = 1_000_000_000\n"), "records.scale.count"),
        (BASINS.replace("horizontal = ", f"horizontal = {MILLIONS}  # "), "study.horizontal.count"),
    ],
)
def test_a_range_is_counted_before_its_values_are_made(text, key):
    begun = time.process_time()
    message = said(text)
    assert time.process_time() - begun < 1.0
    assert f"{key} = " in message
    assert "must be a whole number from 2 to" in message or "give at most 100000 values" in message


@together("low, high, count", [(0.06, 0.36, 31), (0.1, 0.3, 7), (-1e-300, 1e300, 5), (1e-9, 3, 4)])
def test_values_of_a_range_are_the_nearest_to_the_exact_ones(low, high, count):
    table = {"from": low, "to": high, "count": count}
    found = Values("", {}).numbers("grid", table, True).tolist()
    first, last = Fraction(repr(low)), Fraction(repr(high))
    exact = [first + (last - first) * k / (count - 1) for k in range(count)]
    assert found == [float(value) for value in exact]


@together(
    "old, new, words",
    [
        ("stiffness = 1e4", "stiffness = -1", "pounding.stiffness must be at least 0, is -1"),
        ("gap = 0.01", "gap = 1e40", "pounding.gap = 1e+40: must be 0 or of a size"),
        ("restitution = 0.7", "sharpness = -1", "pounding.sharpness must be at least 0"),
        ("restitution = 0.7", "damping = 1e40", "pounding.damping = 1e+40: must be 0 or"),
        ("tension = false", "tension = 3", "pounding.tension must be true or false, is 3"),
        ("period = 0.5\nsto", "period = 1e300\nsto", "building[1].period must be finite and pos"),
        ("[900.0, 800.0]", "[900.0]", "building[0].storey_stiffness must have 2 numbers, one per"),
        ("damping_ratio = 0.05", "damping_ratio = 1e9", "building.damping_ratio or rayleigh = "),
        ('name = "A"', 'name = "a\\nb"', "building[0].name = 'a\\nb': must be a name of up to 100"),
        ("duration = 2.0", "soil = []", "records.synthetic.soil = []: must be one of firm"),
        ("duration = 2.0", "soil = {x = 1}", "records.synthetic.soil = {'x': 1}: must be one of"),
        ("duration = 2.0", "rms = 1e300", "records.synthetic.rms = 1e+300: must be above 0, from"),
        ("[records.scale]", "[output]\nhistory = 5e-324\n[records.scale]", "output.history = 5e-3"),
        ("[records.scale]", "[output]\nhistory = 1e-300\n[records.scale]", "output.history = 1e-3"),
        ("[records.scale]", "[output]\nhistory = 1e300\n[records.scale]", "output.history = 1e+30"),
        ("period = 0.5\nfrom", "period = 1e300\nfrom", "records.scale.period must be from"),
    ],
)
def test_what_is_wrong_with_buildings_and_records_names_its_own_key(old, new, words):
    assert old in RECORDS
    assert words in said(RECORDS.replace(old, new, 1))


def test_contacts_without_a_force_are_none():
    study = parse_job(RECORDS.replace("stiffness = 1e4", "stiffness = 0"), "", "job").study
    assert study.structure.contacts == ()
    assert study.structure.contact_names == {}


@together(
    "number, words",
    [
        ("9223372036854775808", "structure.contact[0].gap: a whole number of 64 bits does not"),
        ("1" + "0" * 400, "structure.contact[0].gap: a whole number of 1329 bits does not fit"),
        ("0x" + "f" * 17, "structure.contact[0].gap: a whole number of 68 bits does not fit"),
        ("9" * 5000, "not valid TOML: gap: Exceeds the limit"),
    ],
)
def test_a_whole_number_beyond_64_bits_is_told_with_its_key(number, words):
    assert words in said(odd_values.JOBS["points"].replace("gap = 1.0", f"gap = {number}"))
