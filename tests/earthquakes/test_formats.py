"""Files of strong-motion networks, written as their published formats say."""

import numpy as np
import pytest
from together import together

from hpcsweep import read_record

SAMPLES = np.array([0.1, -0.2, 12.5, -123.45678, 99.0, -7.0, 0.03, 4.5, -5.5, 1234.56789, 6.25])
"""cm/s^2, of which some fill their fields."""


def fields(values, form: str, per_line: int) -> str:
    cells = [form.format(value) for value in values]
    rows = [cells[i : i + per_line] for i in range(0, len(cells), per_line)]
    return "\n".join(map("".join, rows)) + "\n"


COUNTS = np.round(SAMPLES * 100).astype(int) - 4321
KNET = """\
Origin Time       2011/03/11 14:46:00
Lat.              38.103
Long.             142.860
Depth. (km)       24
Mag.              9.0
Station Code      MYG012
Station Lat.      38.3172
Station Long.     141.0220
Station Height(m) 9
Record Time       2011/03/11 14:46:42
Sampling Freq(Hz) 100Hz
Duration Time(s)  300
Dir.              E-W
Scale Factor      3920(gal)/6182761
Max. Acc. (gal)   757.934
Last Correction   2011/03/11 14:46:27
Memo.
""" + fields(COUNTS, "{:9d}", 8)
WHOLE = [0] * 48
WHOLE[15:17] = 2, len(SAMPLES)
REAL = [1.7e38] * 50
REAL[1] = 200.0
SMC = (
    "2 CORRECTED ACCELEROGRAM\n"
    + "*\n" * 10
    + fields(WHOLE, "{:10d}", 8)
    + fields(REAL, "{:15.7E}", 5)
    + "|  Filtered from 0.10 to 25 Hz\n|\n"
    + fields(SAMPLES, "{:10.5f}", 8)
)


def series(kind: str, values, unit: str) -> str:
    head = f"{len(values):8d} {kind} pts, approx   0 secs, units={unit},Format=(8F10.5)\n"
    return head + fields(values, "{:10.5f}", 8) + f"End-of-data for Chan  1 {kind}\n"


NUMBERS = [-999.0] * 100
NUMBERS[33:37] = 0.005, 63.625, -999.0, 426212.0
NUMBERS[61] = 10.0
COSMOS = (
    "Corrected acceleration        (Format v01.20 with 13 text lines) Src: 02\n"
    + "Rcrd start time:08/24/2014, 10:20:47.695 UTC (Q=0) RcrdId:NP.1743.HNE.\n" * 12
    + " 100  Integer-header values follow on 10 lines, Format= (10I8)\n"
    + fields([-999] * 100, "{:8d}", 10)
    + " 100 Real-header values follow on 17 lines , Format = (6F13.6)\n"
    + fields(NUMBERS, "{:13.6f}", 6)
    + '   1 Comment line(s) follow, each starting with a "|":\n| Sensor: some\n'
    + series("acceleration", SAMPLES, "cm/s^2 (4)")
    + series("velocity", SAMPLES[:5], "cm/s (5)")
)


def points(kind: str, values, unit: str) -> str:
    head = f"{len(values):8d} points of {kind} data equally spaced at  .020 sec, in {unit}."
    return f"{head} (8f10.5)\n" + fields(values, "{:10.5f}", 8)


def csmip(samples) -> str:
    return (
        "Corrected accelerogram data, instrument- and baseline-corrected\n"
        + "Peak acceleration = 123.457 cm/sec/sec at 0.200 sec\n" * 3
        + fields([0] * 16, "{:5d}", 16)
        + points("accel", samples, "cm/sec2")
        + points("veloc", samples[:3], "cm/sec")
        + points("displ", samples[:3], "cm")
        + "/&  ---------- End of data for channel  1 ----------\n"
    )


ESM = """\
EVENT_NAME: CENTRAL_ITALY
EVENT_ID: EMSC-20160824_0000006
MAGNITUDE_W: 6.0
VS30_M/S:
SAMPLING_INTERVAL_S: 0.005000
NDATA: 11
DURATION_S: 0.055
STREAM: HNE
UNITS: cm/s^2
FULL_SCALE_G:
PGA_CM/S^2: -123.456780
TIME_PGA_S: 0.020000
LOW_CUT_FREQUENCY_HZ: 0.100
DATABASE_VERSION: 1.0
HEADER_FORMAT: DYNA 1.2
DATA_TYPE: ACCELERATION
DATA_CITATION: <NOT PRESENT>
USER5:
""" + fields(SAMPLES, "{:.6f}", 1)
PEER = [
    f"PEER NGA\nHector Mine\nACCELERATION TIME HISTORY IN UNITS OF {unit}\n{step}\n"
    for unit, step in (
        ("CM/S/S", "NPTS=     11, DT=   .0050 SEC,"),
        ("GAL", "11   .005   NPTS, DT"),
        ("CM/SEC^2", "NPTS= 11, DT= 0.00500 SEC, VS30= 726 M/S"),
    )
]
OF_KNET = 3920 / 6182761 * (COUNTS - COUNTS.mean())


@pytest.fixture
def read(tmp_path):
    def write_and_read(name, text, **given):
        (tmp_path / name).write_text(text)
        return read_record(tmp_path / name, **{"unit": "cm/s2", "gravity": 980.665, **given})

    return write_and_read


@together(
    "name, text, samples, dt",
    [
        ("MYG0121103111446.EW", KNET, OF_KNET, 0.01),
        ("a.smc", SMC, SAMPLES, 0.005),
        ("a.V2c", COSMOS, SAMPLES, 0.01),
        ("a.V2c", COSMOS.replace("    10.000000", "  -999.000000"), SAMPLES, 0.005),
        ("a.v2", csmip(SAMPLES), SAMPLES, 0.02),
        ("a.ASC", ESM, SAMPLES, 0.005),
        *(("a.AT2", head + fields(SAMPLES, "{:15.7E}", 5), SAMPLES, 0.005) for head in PEER),
    ],
)
def test_each_format_gives_its_samples_step_and_unit(read, name, text, samples, dt):
    record = read(name, text)
    np.testing.assert_allclose(record.acceleration, samples, rtol=1e-7, atol=1e-12)
    assert record.dt == dt
    assert record.name == (name if name.endswith(".EW") else "a")
    assert read(name, text, gravity=9.80665).peak == pytest.approx(abs(samples).max() / 100)


def test_a_channel_of_several(read):
    text = csmip(SAMPLES) + csmip(2 * SAMPLES[:7])
    record = read("a.v2", text, channel=2)
    np.testing.assert_array_equal(record.acceleration, (2 * SAMPLES[:7]).round(5))
    assert record.name == "a-2"


@together(
    "text, given, message",
    [
        (csmip(SAMPLES) * 3, {}, "CSMIP file: channel must be given, from 1 to 3"),
        (csmip(SAMPLES), {"channel": 2}, "channel must be a whole number from 1 to 1, is 2"),
        ("0 .1\n.01 .2\n", {"channel": 1}, "channel goes with files of several channels, is 1"),
        (
            COSMOS.replace("cm/s^2 (4)", "counts (50)"),
            {},
            "COSMOS file: must be in a unit of accel",
        ),
        (COSMOS.replace("acceleration pts", "velocity pts"), {}, "must have channels of acceler"),
        (COSMOS.replace("   0.10000", ""), {}, "must have 11 samples, as it says, has 10"),
        (KNET, {"unit": "g"}, "unit must be that of the file, cm/s2, is g"),
        (KNET, {"dt": 0.02}, r"dt must be that of the file, 0.01, is 0.02 \(K-NET\)|dt must be"),
        (KNET.replace("Sampling", "Sample"), {}, "K-NET file: must tell Scale Factor and Samp"),
        (SMC[:1200], {}, "SMC file: must have 48 integers and 50 numbers in lines 12 to 27"),
        (SMC.replace("2.0000000E+02", "0.0000000E+02"), {}, "SMC file: is cut off or damaged"),
        (SMC.replace("2 COR", "1 UNCOR"), {}, "of the format SMC uncorrected, which is not read"),
        ("WID2 2000/01/01\n1 2\n", {}, "of the format GSE, which is not read: obspy reads others"),
    ],
)
def test_what_is_wrong_is_named_in_one_line(read, text, given, message):
    with pytest.raises(ValueError, match=message) as error:
        read("a.txt", text, **given)
    assert "\n" not in str(error.value)
