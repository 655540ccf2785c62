"""Units, frequencies in hertz, buildings side by side, and keys that are taken away."""

import math

import numpy as np
import pytest
from together import together
from tools import SMALL

from hpcsweep import Building, adjacent, load_job, response, synthetic_records
from hpcsweep.campaign.describe import describe, warnings
from hpcsweep.commands.cli import main
from hpcsweep.job import JobError, parse_job
from hpcsweep.model.description import one_line
from hpcsweep.model.structure import Structure
from hpcsweep.model.unit_names import unit_of
from hpcsweep.store import Layout

UNITS = '[units]\nlength = "m"\nmass = "kg"\ntime = "s"\n'
OF_FORCE = '[units]\nlength = "{}"\nforce = "{}"\n'
OWN = SMALL.replace("stiffness_ratio = 300.0", "mass = 2e5\nstorey_stiffness = 3e8\ngap = 0.05")
TWO = """
[[building]]
name = "A"
mass = [2.5e5, 2.0e5]
storey_stiffness = [3e8, 2e8]
storey_height = 3.0
[[building]]
name = "B"
mass = [2.0e5, 2.0e5, 1.0e5]
storey_stiffness = 4e8
storey_height = [3.0, 3.0, 4.0]
damping_ratio = 0.02
[pounding]
gap = [0.02, 0.05]
stiffness = 2e9
[sweep]
frequency = [2.0, 3.0]
amplitude = [1.0, 2.0]
"""


def parse(text: str):
    return parse_job(text, "job.toml", "job")


def test_units_label_the_file_and_change_nothing_else():
    plain, named = parse(OWN), parse(UNITS + OWN)
    assert plain.fingerprint == named.fingerprint
    reported = {v.name: v.units for v in Layout(named).variables}
    assert reported["poincare"] == "m; m/s"
    assert Layout(named).coordinates["amplitude"].units == "m/s^2"
    assert Layout(named).coordinates["omega"].units == "rad/s"
    assert Layout(plain).coordinates["amplitude"].units == "length/time^2"
    assert Layout(parse(SMALL)).coordinates["amplitude"].units == "gaps omega_0^2"
    assert named.structure.unit_names.of("force") == "N"


def test_frequencies_are_given_in_hertz():
    job = parse(OWN.replace("omega = {", "frequency = {"))
    assert job.study.omega == pytest.approx(2 * math.pi * parse(OWN).study.omega)


STRUCK = "column = {share = 0.1, mass = 300.0}\n"
UNEVEN = (
    TWO.replace("[3.0, 3.0, 4.0]", "[3.0, 2.0, 4.0]")
    .replace("[0.02, 0.05]", "0.02")
    .replace("storey_height", f"{STRUCK}storey_height")
)


@together(
    "text, words",
    [
        (UNITS + SMALL, "units.length = 'm': goes with masses and stiffnesses of one's own"),
        (OWN + '[units]\nlength = "5 m"\n', "units.length = '5 m': must be the name of a unit"),
        (OWN + '[units]\nmetre = "m"\n', "unknown key 'units.metre'"),
        (OWN.replace("omega = {", "omega = 0.5\nfrequency = {"), "does not go with sweep.omega"),
        (SMALL.replace("damping_ratio", "zeta"), "'structure.zeta'; did you mean 'damping_ratio'?"),
        (SMALL.replace("stiffness_ratio", "beta"), "'structure.beta'; did you mean 'stiffness_ra"),
        ('[study]\nkind = "sweep"\n' + SMALL, "did you mean 'amplitude_sweep'?"),
        (TWO.replace("[3.0, 3.0, 4.0]", "[3.0, 2.0, 4.0]"), "floor 2 of A at height 6 faces a col"),
        (UNEVEN.replace(STRUCK, "", 1), "B at height 5 faces a column of A: give A column ="),
        (
            UNEVEN.replace("share = 0.1", "share = 0.0", 1),
            "building[0].column.share must be above 0, to 1, is 0.0",
        ),
        (
            UNEVEN.replace("mass = 300.0", "weight = 300.0"),
            "unknown key 'building[0].column.wei",
        ),
        (UNEVEN.replace(", mass = 300.0", ""), "building[0].column.mass is missing"),
        (TWO.replace("storey_height = 3.0\n", ""), "must be given of all buildings or of none"),
        (TWO.replace("[0.02, 0.05]", "[0.02]"), "pounding.gap must have 2 numbers, one per level"),
        (TWO.replace('"B"', '"A"'), "building.name must be of one building each"),
        (
            TWO.split('[[building]]\nname = "B"')[0] + "[pounding]\ngap=1\nstiffness=1\n",
            "goes with two",
        ),
        (TWO.replace("gap =", "gapp ="), "unknown key 'pounding.gapp'; did you mean 'gap'?"),
        (TWO + "[structure]\ngap = 1.0\n", "structure.gap = 1.0: does not go with [[building]]"),
        (
            TWO.replace("mass = [2.5e5", "masses = [2.5e5"),
            "'building[0].masses'; did you mean 'mass'",
        ),
    ],
)
def test_mistakes_are_one_line_with_what_is_meant(text, words):
    with pytest.raises(JobError) as refused:
        parse(text)
    assert words in str(refused.value)
    assert "\n" not in str(refused.value)


def test_buildings_are_their_matrices_side_by_side():
    job = parse(TWO)
    structure = job.structure
    left = Structure(2, 0.0, mass=(2.5e5, 2e5), storey_stiffness=(3e8, 2e8), gap=math.inf)
    right = Structure(3, 0.0, 1e4, 0.02, mass=(2e5, 2e5, 1e5), storey_stiffness=4e8, gap=math.inf)
    both = np.concatenate((left.frequencies, right.frequencies))
    np.testing.assert_allclose(structure.frequencies, np.sort(both), rtol=1e-12)
    order = np.argsort(both)
    ratios = np.concatenate((left.damping_ratios, right.damping_ratios))[order]
    np.testing.assert_allclose(structure.damping_ratios, ratios, rtol=1e-10)
    assert structure.names.floors == ("A1", "A2", "B1", "B2", "B3")
    assert structure.names.contacts == ("A1-B1", "A2-B2")
    assert [contact.gap for contact in structure.contacts] == [0.02, 0.05]
    assert structure.directions.tolist() == [[1, 0, -1, 0, 0], [0, 1, 0, -1, 0]]
    drifts = [[1, 0, 0, 0, 0], [-1, 1, 0, 0, 0]]
    assert structure.drift_rows[:2].tolist() == drifts
    made = adjacent(
        [
            Building([2.5e5, 2e5], [3e8, 2e8], 3.0, name="A"),
            Building([2e5, 2e5, 1e5], 4e8, [3.0, 3.0, 4.0], 0.02, name="B"),
        ],
        [0.02, 0.05],
        2e9,
    )
    assert made == structure


def beam(length: float, rigidity: float) -> np.ndarray:
    """Stiffness of (v, theta) at both ends, by Hermite's polynomials."""
    a = length
    shape = [[12, 6 * a, -12, 6 * a], [0, 4 * a * a, -6 * a, 2 * a * a], [0, 0, 12, -6 * a]]
    upper = np.array([*shape, [0, 0, 0, 4 * a * a]], float) * rigidity / a**3
    return upper + np.triu(upper, 1).T


def test_a_floor_that_faces_a_column_hits_a_point_of_a_beam():
    """Of two Hermite beams whose rotation at the point is condensed out; 3 E I h^3 / (a b)^3."""
    structure = parse(UNEVEN).structure
    assert structure.names.floors == (
        *("A1", "A2", "A column at 5"),
        *("B1", "B2", "B3", "B column at 6"),
    )
    assert structure.names.contacts == ("A1-B1", "A column at 5-B2", "A2-B column at 6")
    assert structure.storey_names == ("A1", "A2", "B1", "B2", "B3")
    assert structure.directions[1:].tolist() == [[0, 0, 1, 0, -1, 0, 0], [0, 1, 0, 0, 0, 0, -1]]
    share, h, a = 0.1 * 2e8, 3.0, 2.0
    rigidity = share * h**3 / 12
    two = np.zeros((6, 6))
    two[:4, :4] += beam(a, rigidity)
    two[2:, 2:] += beam(h - a, rigidity)
    kept, theta = two[np.ix_([0, 4, 2], [0, 4, 2])], two[[0, 4, 2], 3]
    column = kept - np.outer(theta, theta) / two[3, 3]
    assert column[2, 2] == pytest.approx(3 * rigidity * h**3 / (a * (h - a)) ** 3, rel=1e-13)
    sway = share * np.array([[1.0, -1.0, 0], [-1.0, 1.0, 0], [0, 0, 0]])
    alone = Structure(2, mass=(2.5e5, 2e5), storey_stiffness=(3e8, 2e8)).stiffness_matrix
    right = np.pad(alone, (0, 1)) - sway + column
    np.testing.assert_allclose(structure.stiffness_matrix[:3, :3], right, rtol=1e-12, atol=1e-4)
    # in the lowest storey the ground does not move
    low = adjacent(
        [
            Building([1.0, 1.0], 12.0, 2.0, column={"share": 1, "mass": 0.1}),
            Building([1.0] * 3, 5, 1),
        ],
        gap=0.1,
        stiffness=1e3,
    )
    assert low.names.contacts == ("A column at 1-B1", "A1-B2", "A column at 3-B3")
    # E I = 8: 192 E I / h^3 in the middle of a beam fixed at both ends
    assert low.stiffness_matrix[2, 2] == pytest.approx(192.0)
    assert low.stiffness_matrix[2, :2].tolist() == [-96.0, 0.0]


def test_a_job_is_described_in_its_units_and_warned_of(tmp_path, capsys):
    path = tmp_path / "two.toml"
    path.write_text(UNITS + TWO)
    assert main(["describe", str(path)]) == 0
    said = capsys.readouterr().out
    first = parse(TWO).structure.frequencies[0]
    for words in (
        "two: 2 directions x 2 omegas x 2 amplitudes = 8 runs",
        "acceleration m/s^2, force N, frequency rad/s",
        f"omega = {first:.6g} = {first / (2 * math.pi):.6g} Hz",
        "A2-B2: gap 0.05 m, stiffness 2e+09",
        " = 2 to 3 Hz",
        "grazing    the free motion first touches at A = ",
    ):
        assert words in said
    lowest = parse(TWO).structure.grazing_amplitude(4 * math.pi)
    assert f"{lowest:.6g}" in said
    assert main(["describe", str(tmp_path / "none.toml")]) == 2


PRESSED = SMALL.replace("n_floors = 2", "n_floors = 1\ngap = -0.3").replace("4e3", "inf")


def test_a_contact_that_is_pressed_at_rest_is_a_line():
    # 300 times as stiff as the storey: 0.3 x 300 / 301
    told = [text for name, text in describe(parse(PRESSED)) if name == "at rest"]
    words = "contact 1 pressed, static equilibrium at u = (-0.299003): "
    assert told == [f"{words}the initial state is not there"]
    there = PRESSED.replace("[sweep]", f"[sweep]\ninitial_state = [{-0.3 * 300 / 301!r}, 0.0]")
    assert ("at rest", f"{words}the initial state") in describe(parse(there))
    assert "at rest" not in dict(describe(parse(SMALL)))


@together(
    "old, new, words",
    [
        ("damping_ratio = 0.05", "damping_ratio = [0.05, 1.5]", "the damping ratio 1.5, above 1"),
        ("from = 0.5, to = 0.8", "from = 50.0, to = 80.0", "more than 3 times off every natural"),
        ("stiffness_ratio = 300.0", "stiffness_ratio = 0.5", "the contact is softer than a storey"),
        ("count = 11", "count = 3", "of the smallest grazing amplitude"),
    ],
)
def test_what_looks_like_a_mistake_is_a_line(old, new, words):
    fine = SMALL.replace("count = 11", "count = 400")
    assert warnings(parse(fine)) == []
    text = SMALL if "count" in old else fine
    found = warnings(parse(text.replace(old, new)))
    assert any(words in line for line in found), found
    assert [*describe(parse(text.replace(old, new)))][-1][0] == "warning"


def test_a_stiffness_of_pounding_with_too_few_digits_is_a_line():
    (found,) = warnings(parse(TWO.replace("stiffness = 2e9", "stiffness = 2e7")))
    assert found == "contact A1-B1, A2-B2: softer than the structure along it, stiffness 2e+07"


BRACED = """
[study]
kind = "records"
[structure]
damping_ratio = 0.05
matrices = {mass = [1e5], stiffness = [[4e6]]}
[[structure.slider]]
direction = [1.0]
stiffness = 4e8
strength = 9.81e4
[records]
synthetic = {count = 1, seed = 3, duration = 12.0, rms = 1.5}
scale = {values = [1.0]}
"""


def test_a_damping_ratio_of_what_sticks_is_a_line_with_the_frames_own():
    drifts = {}
    for own, said in (
        ("damping_ratio = 0.05", "are 0.502 of critical while all slip; structure.rayleigh = ["),
        (
            "rayleigh = [0.0, 0.0158]",
            "[alpha, 0.0], or structure.matrices.damping, gives the frame",
        ),
        ("rayleigh = [0.6325, 0.0]", ""),
    ):
        job = parse(BRACED.replace("damping_ratio = 0.05", own))
        found = [one for one in warnings(job) if "sliders stick" in one]
        assert len(found) == bool(said)
        assert not said or said in found[0]
        record = synthetic_records(1, seed=3, duration=12.0, rms=1.5)[0]
        drifts[own] = float(response(job.study.part(()).structure, record).drift[0])
    assert "[0.6325, 0.0]" in warnings(parse(BRACED))[0]
    # by an integration of its own with C = 63.2 kN s/m: 24.8 mm
    assert list(drifts.values()) == pytest.approx([0.01346, 0.0044, 0.0248], rel=5e-3)


def test_smooth_contacts_that_pull_at_rest_are_a_line():
    smooth = TWO.replace("stiffness = 2e9", "stiffness = 2e9\nsharpness = {}")
    assert warnings(parse(smooth.format(1e4))) == warnings(parse(TWO)) == []
    (found,) = warnings(parse(smooth.format(100.0)))
    gap = parse(TWO).structure.contacts[0].gap
    assert f"with {2e9 * gap / (1.0 + np.exp(100.0 * gap)):.4g}" in found
    assert "sharpness must be far above 100" in found


def test_inherited_keys_without_use_go_with_a_line(tmp_path):
    (tmp_path / "base.toml").write_text(SMALL + '[solver]\nskip = "none"\n')
    job = tmp_path / "job.toml"
    start = 'extends = "base.toml"\n'
    job.write_text(start + "[sweep]\nfrequency = 0.1\n")
    found = load_job(job)
    assert found.study.omega == pytest.approx([0.2 * math.pi])
    assert found.notes == ("not inherited: sweep.omega (sweep.frequency is given)",)
    assert "# not inherited: sweep.omega" in found.text
    job.write_text(start + '[study]\nkind = "points"\npoints = [[0.1, 0.6]]\n')
    assert load_job(job).study.n_runs == 1
    job.write_text(start + '[solver]\nskip = "unset"\n')
    assert load_job(job).settings.skip == parse(SMALL).settings.skip
    job.write_text(start + '[structure]\nsharpness = "unset"\ndamping_ratio = "unset"\n')
    assert load_job(job).structure == Structure(2, 300.0)
    for wrong, meant in (("beta", "stiffness_ratio"), ("damping_ration", "damping_ratio")):
        job.write_text(start + f'[structure]\n{wrong} = "unset"\n')
        with pytest.raises(JobError, match=f"'structure.{wrong}'; did you mean '{meant}'"):
            load_job(job)


BESIDE = """
[[building]]
mass = [2e5, 2e5]
storey_stiffness = 3e8
[[building]]
mass = [2e5, 2e5, 2e5]
storey_stiffness = 4e8
damping_ratio = 0.02
[pounding]
gap = 0.02
stiffness = 2e9
[sweep]
omega = 10.0
amplitude = [1.0, 2.0]
"""


def test_one_of_several_buildings_is_named_where_it_is_wrong():
    """By its table, also where only the structure made of it finds the mistake."""
    for old, new, told in (
        ("storey_stiffness = 4e8", "storey_stiffness = [4e8, 4e8]", "storey_stiffness must have"),
        ("damping_ratio = 0.02", "damping_ratio = -1.0", "damping_ratio must be finite"),
    ):
        wrong = BESIDE.replace(old, new)
        assert wrong != BESIDE
        with pytest.raises(JobError, match=rf"job\.toml: building\[1\]\.{told}"):
            parse(wrong)


def test_a_building_is_not_taken_for_one_that_python_calls_equal():
    """Buildings are made once for all parts of a job: true is 1 for Python, and is no mass."""
    parse(TWO.replace("1.0e5]", "1]"))
    with pytest.raises(JobError, match=r"building\[1\]\.mass"):
        parse(TWO.replace("1.0e5]", "true]"))


def test_one_of_several_contacts_is_set():
    from tools import JOBS

    path = JOBS / "structures" / "pounding.toml"
    usual = load_job(path).structure.contacts
    found = load_job(path, ["structure.contact[1].gap=0.7"]).structure.contacts
    assert [contact.gap for contact in found] == [usual[0].gap, 0.7, usual[2].gap]
    with pytest.raises(JobError, match="there are 3 tables"):
        load_job(path, ["structure.contact[3].gap=0.7"])


FREE = """
[structure.matrices]
mass = [1.0]
stiffness = [[1e-6]]
damping = [[0.1]]
[[structure.contact]]
direction = [1.0]
gap = 1.0
stiffness = 100.0
[sweep]
omega = 1.0
amplitude = [0.1, 0.2]
"""


def test_a_motion_that_hardly_has_a_spring_has_no_damping_ratio():
    """m / c = 10 and c / k = 1e5 in place of 50; with a spring of 1e-3 it is 1.58."""
    told = [text for name, text in describe(parse(FREE)) if name in ("mode 1", "warning")]
    words = "hardly a spring: speeds decay in 10, displacements in 1e+05"
    assert [words in text for text in told] == [True, True, False]
    assert "zeta" not in one_line(parse(FREE).structure)
    assert "zeta = 1.581" in one_line(parse(FREE.replace("-6", "-3")).structure)
    assert "mode 1 has the damping ratio 1.581, above 1" in warnings(
        parse(FREE.replace("-6", "-3"))
    )


ALONG = """
[structure]
n_floors = 1
sharpness = inf
gap = 1.0
[sweep]
along = "structure.gap"
omega = 0.6
amplitude = 0.33
[vary]
"structure.gap" = [0.25, 0.5, 1.0]
"""


def test_grazing_and_skip_rules_are_told_along_the_path():
    """First contact is at the gap times |1 - Omega^2 + 2 i zeta Omega|, below 0.33 twice."""
    one = abs(1 - 0.36 + 0.06j)
    told = dict(describe(parse(ALONG)))
    assert told["grazing"] == (
        f"the free motion first touches at A = {0.25 * one:.6g} (gap = 0.25) to {one:.6g} (gap = "
        "1); along the path it touches from gap = 0.25 to 0.5"
    )
    assert told["skip rules"] == "linear, converged, newton: all hold along any path"
    yields = describe(parse(ALONG.replace("gap = 1.0", "gap = 1.0\nyield_drift = 0.3")))
    assert dict(yields)["skip rules"] == "linear, converged: all hold along any path"
    never = dict(describe(parse(ALONG.replace("0.33", "0.01"))))
    assert never["grazing"].endswith("; along the path it touches nowhere")


def test_a_job_has_one_unit_of_length_whatever_its_parts(tmp_path):
    """The file, its parts, tables and describe, also where the first part alone is in gaps."""
    text = SMALL.replace("[output]", "[output]\ndisplacement = true")
    job = parse(text + '[vary]\n"structure.gap" = [1.0, 2.0]\n')
    told = [*describe(job)]
    assert ("units", "length as given, time in 1/omega_0, frequencies in omega_0") in told
    assert ("contact", "1: gap 1, stiffness 300") in told  # of the first part, as it says
    assert not any("gaps" in line for name, line in told if name != "varied")
    units = {unit_of(job.study.part((k,)).structure, "length") for k in (0, 1)}
    assert units == {unit_of(job.structure, "length")} == {"length"}
    alone = parse(text + '[vary]\n"structure.stiffness_ratio" = [10.0, 20.0]\n').study
    assert unit_of(alone.part((1,)).structure, "length") == "gaps"


def test_a_force_names_the_mass_that_goes_with_it():
    # F = m a: kN is t m/s^2, and kt mm/s^2
    for length, force, mass in (("m", "kN", "t"), ("m", "N", "kg"), ("mm", "kN", "kt")):
        structure = parse_job(OWN + OF_FORCE.format(length, force), "job", "job").structure
        assert structure.unit_names == (length, mass, "s")
        assert unit_of(structure, "force") == force
    for wrong in (OF_FORCE.format("cm", "kN"), OF_FORCE.format("m", "kN") + 'mass = "kg"\n'):
        with pytest.raises(JobError, match=r"must be one of N, kN|must be one of none"):
            parse_job(OWN + wrong, "job", "job")
