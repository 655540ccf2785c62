"""Suites as codes have them, against calculations of their own."""

import numpy as np
import pytest
import support.tools as tools
from scipy.signal import cont2discrete, lfilter, ss2tf

import hpcsweep
from hpcsweep.earthquakes.sources import joined
from hpcsweep.job.job import JobError

JOB = """
[study]
kind = "records"
[structure]
n_floors = 1
mass = 1.0
storey_stiffness = 40.0
stiffness_ratio = 0.0
gap = inf
sharpness = inf
[units]
length = "m"
mass = "kg"
time = "s"
[records]
"""
SUITE = "synthetic = {count = 4, seed = 3, duration = 4.0}\n"
PERIODS = np.linspace(0.3, 1.2, 7)
"""Of the targets."""


def sampled(record, period, parts=20, size=None):
    """Return an oscillator's displacement by a discrete linear filter, `parts` a sample."""
    w, n = 2.0 * np.pi / period, size or record.n_samples
    a = np.pad(record.acceleration, (0, n - record.n_samples))
    fine = np.interp(np.arange((n - 1) * parts + 1) / parts, np.arange(n), a)
    system = map(np.array, ([[0.0, 1.0], [-w * w, -0.1 * w]], [[0.0], [-1.0]], [[1.0, 0]], [[0.0]]))
    *discrete, _ = cont2discrete(tuple(system), record.dt / parts, "foh")
    top, bottom = ss2tf(*discrete)
    return lfilter(top[0], bottom, fine)


def job(tmp_path, lines, name="job.toml"):
    """Load a job of records with further lines."""
    (tmp_path / name).write_text(JOB + lines)
    return hpcsweep.load_job(tmp_path / name).study


def refusal(tmp_path, lines):
    """Return the one line with which a job is refused."""
    with pytest.raises(JobError) as error:
        job(tmp_path, lines)
    return str(error.value)


def test_rotated_spectra_are_those_of_directions():
    one, two = hpcsweep.synthetic_records(2, seed=5, duration=3.0)
    two = hpcsweep.Record(two.acceleration[:-40], two.dt)
    for period in (0.3, 0.9):
        u = [sampled(each, period, size=one.n_samples) for each in (one, two)]
        angles = np.pi * np.arange(180) / 180.0
        peaks = [np.abs(np.cos(t) * u[0] + np.sin(t) * u[1]).max() for t in angles]
        for percentile in (0.0, 50.0, 100.0):
            made = hpcsweep.pair_spectrum(one, two, [period], percentile=percentile)
            expected = np.percentile(peaks, percentile)
            assert made.displacement[0] == pytest.approx(expected, rel=2e-5)


def test_factors_fit_a_target_by_least_squares(tmp_path):
    scale = (
        'scale = {by = "target", unit = "g", target = {pga = 0.3, corners = [0.15, 0.5, 1.0]}, '
        "periods = {from = 0.3, to = 1.2, count = 7}"
    )
    study = job(tmp_path, SUITE + scale + "}\n")
    suite = hpcsweep.synthetic_records(4, seed=3, duration=4.0)
    sa = np.array([hpcsweep.spectrum(one, PERIODS).acceleration for one in suite])
    plateau = 2.5 * 0.3 * 9.80665
    code = [plateau * (1.0 if t <= 0.5 else 0.5 / t if t <= 1.0 else 0.5 / t**2) for t in PERIODS]
    for factor, own in zip(study.factor[:, 0], sa, strict=True):
        around = factor * np.exp(np.linspace(-1e-3, 1e-3, 3))
        left = [np.sum(np.log(f * own / code) ** 2) for f in around]
        assert left[1] < min(left[0], left[2])
        assert np.log(factor * own / code).sum() == pytest.approx(0.0, abs=1e-10)
    higher = job(tmp_path, SUITE + scale + ", least = 0.98}\n")
    ratio = (higher.factor[:, :1] * sa).mean(axis=0) / code
    assert ratio.min() == pytest.approx(0.98, rel=1e-10)
    assert np.ptp(higher.factor[:, 0] / study.factor[:, 0]) < 1e-10
    points = "\n".join(
        [
            "period;Sa",
            *(
                f"{t!r};{s / 9.80665!r}"
                for t, s in zip(PERIODS.tolist(), np.array(code).tolist(), strict=True)
            ),
        ]
    )
    (tmp_path / "target.csv").write_text(points)
    by_file = job(
        tmp_path,
        SUITE + scale.replace("{pga = 0.3, corners = [0.15, 0.5, 1.0]}", '"target.csv"') + "}\n",
    )
    np.testing.assert_allclose(by_file.factor, study.factor, rtol=1e-11)


def test_components_have_one_factor(tmp_path):
    pairs = 'pairs = [["synthetic-3-1", "synthetic-3-3"], ["synthetic-3-4", "synthetic-3-2"]]\n'
    suite = hpcsweep.synthetic_records(4, seed=3, duration=4.0)
    sa = [hpcsweep.spectrum(one, [0.5]).acceleration[0] for one in suite]
    scale = 'scale = {by = "sa", period = 0.5, unit = "g", values = [0.2, 0.4]'
    mean = job(tmp_path, SUITE + pairs + scale + "}\n").factor
    for i, k in ((0, 2), (3, 1)):
        assert mean[i] == pytest.approx(np.array([0.2, 0.4]) * 9.80665 / np.sqrt(sa[i] * sa[k]))
        assert mean[i].tolist() == mean[k].tolist()
    rotated = job(tmp_path, SUITE + pairs + scale + ', components = "rotd50"}\n').factor
    expected = hpcsweep.pair_spectrum(suite[0], suite[2], [0.5]).acceleration[0]
    assert rotated[2, 1] == pytest.approx(0.4 * 9.80665 / expected)
    own = scale.replace("0.5", '"T1"')
    period = 2.0 * np.pi / np.sqrt(40.0)
    of_own = job(tmp_path, SUITE + pairs + own + ', components = "rotd50"}\n').factor
    expected = hpcsweep.pair_spectrum(suite[0], suite[2], [period]).acceleration[0]
    assert of_own[0, 0] == pytest.approx(0.2 * 9.80665 / expected)
    for name, steps in (("a", "0.00 0.0\n0.01 0.5"), ("b", "0.00 0.0\n0.02 0.5")):
        (tmp_path / f"{name}.txt").write_text(f"acceleration in g\n{steps}\n")
    files = 'files = ["a.txt", "b.txt"]\npairs = [["a", "b"]]\n'
    said = refusal(tmp_path, files + scale + ', components = "rotd50"}\n')
    assert said.endswith("b beside a: must be at steps of 0.01, as the first, is 0.02")
    assert "must have each record once" in refusal(tmp_path, SUITE + pairs.replace("-4", "-1"))


def test_a_sequence_keeps_the_state(tmp_path):
    study = job(
        tmp_path, SUITE + 'sequence = [["synthetic-3-2", 1.5, "synthetic-3-1"]]\ntail = 2.0\n'
    )
    first, second = (hpcsweep.synthetic_records(4, seed=3, duration=4.0)[i] for i in (1, 0))
    record = study.record(0)
    assert (record.name, record.duration) == ("synthetic-3-2+synthetic-3-1", 4.0 + 1.5 + 4.0)
    whole = hpcsweep.history(study.structure, record, tail=2.0)
    alone = hpcsweep.history(study.structure, first)
    n = first.n_samples
    assert np.abs(whole.displacement[:n] - alone.displacement[:n]).max() < 1e-12
    u = sampled(record, 2.0 * np.pi / np.sqrt(40.0), 1)
    assert np.abs(whole.displacement[: u.size, 0] - u).max() < 1e-9
    fine = hpcsweep.Record(np.repeat(second.acceleration, 2), second.dt / 2.0)
    made = joined(first, 1.0, fine)
    assert (made.dt, made.acceleration[2]) == (fine.dt, first.acceleration[1])
    assert "must be names of records" in refusal(tmp_path, SUITE + 'sequence = [["a", 1.0, "b"]]\n')


def test_parts_of_the_arias_intensity_are_kept(tmp_path):
    study = job(tmp_path, SUITE + "arias = [0.05, 0.95]\n")
    whole = hpcsweep.synthetic_records(4, seed=3, duration=4.0)[0]
    kept = study.record(0)
    assert abs(kept.duration - hpcsweep.intensity(whole).duration) <= 2 * whole.dt
    share = hpcsweep.intensity(kept).arias / hpcsweep.intensity(whole).arias
    assert 0.9 <= share < 0.93
    assert kept.acceleration.tobytes() in whole.acceleration.tobytes()


def test_the_tail_lasts_until_rest(tmp_path):
    study = job(tmp_path, SUITE + 'tail = "until rest"\n')
    w = np.sqrt(40.0)
    assert study.tail == pytest.approx(np.log(1e3) / (0.05 * w))
    seen = hpcsweep.history(study.structure, study.record(0), tail=study.tail)
    size = np.hypot(seen.displacement[:, 0], seen.velocity[:, 0] / w)
    at = study.record(0).n_samples - 1
    assert 0.8e-3 < size[-1] / size[at] < 1.25e-3
    wrong = JOB.replace("mass = 1.0", "mass = 2e5").replace("40.0", "80.0")  # kg with kN/mm
    (tmp_path / "wrong.toml").write_text(wrong + SUITE + 'tail = "until rest"\n')
    with pytest.raises(
        JobError, match=r"or tail be a time; .* 0.314 s if stiffnesses are in kN/mm"
    ):
        hpcsweep.load_job(tmp_path / "wrong.toml")


def test_columns_are_carried_along(tmp_path):
    rows = "".join(f"synthetic-3-{k},{6.0 + k},{0.5 * k}\n" for k in (4, 3, 2, 1))
    (tmp_path / "flat.csv").write_text("record,magnitude,f\n" + rows)
    lines = SUITE + 'columns = "flat.csv"\nscale = {factors = "f", values = [1.0, 3.0]}\n'
    assert job(tmp_path, lines).factor[:, 1].tolist() == pytest.approx([1.5, 3.0, 4.5, 6.0])
    assert tools.hpcsweep(0, "run", "job.toml", cwd=tmp_path).returncode == 0
    results = hpcsweep.open_results(tmp_path / "job.h5")
    assert results.magnitude.values.tolist() == [7.0, 8.0, 9.0, 10.0]
    tools.hpcsweep(0, "table", "job.h5", "--what", "drift,magnitude", cwd=tmp_path)
    head, row = (tmp_path / "job.csv").read_text().splitlines()[:2]
    assert head.endswith("magnitude")
    assert row.endswith(",7.0")
    assert tools.hpcsweep(0, "validate", "job.h5", cwd=tmp_path).returncode == 0
    (tmp_path / "flat.csv").write_text("record,pga,f\n" + rows)
    assert "is a name of something else" in refusal(tmp_path, lines)
    (tmp_path / "flat.csv").write_text("record,magnitude,f\n" + rows.split("\n", 1)[1])
    assert "must be the record of a row" in refusal(tmp_path, lines)


def test_files_that_name_their_units_are_mixed(tmp_path):
    (tmp_path / "suite").mkdir()
    for name, unit in (("a", "g"), ("b", "cm/s2"), ("c", "")):
        head = f"acceleration in {unit}\n" if unit else "acceleration\n"
        (tmp_path / f"suite/{name}.txt").write_text(head + "0.00 0.0\n0.01 0.5\n0.02 0.0\n")
    lines = 'unit = "file"\nfiles = ["suite/[ab].txt"]\n'
    assert [facts.pga for facts in job(tmp_path, lines).suite] == pytest.approx([4.903325, 0.005])
    said = refusal(tmp_path, lines.replace("[ab]", "*"))
    assert said.endswith("c.txt: must name its unit, where unit = 'file', does not")


def test_components_that_are_none_are_refused_by_name():
    one = hpcsweep.Record([0.0, 1.0, 0.0], dt=0.01)
    for first, second, name in ((3, one, "record"), (one, 3, "second"), (one, None, "second")):
        with pytest.raises(ValueError, match=f"^{name} must"):
            hpcsweep.pair_spectrum(first, second, [0.5])
    other = hpcsweep.Record([0.0, 1.0], dt=0.02)
    with pytest.raises(ValueError, match=r"^second must be at steps of 0\.01"):
        hpcsweep.pair_spectrum(one, other, [0.5])
