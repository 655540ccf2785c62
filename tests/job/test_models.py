"""Finite element models: files of every format, and jobs that reduce them."""

import re
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
from beams import beam
from scipy import io, sparse
from together import together
from tools import hpcsweep

from hpcsweep import open_results, read_model
from hpcsweep.job import JobError, load_job, matrix_reader, parse_job

MASS, STIFFNESS = beam(30)
NAMES = [f"{i}.{what}" for i in range(1, 31) for what in ("UY", "RZ")]
JOB = """\
[structure]
sharpness = inf
damping_ratio = 0.02

[structure.model]
file = "beam.npz"
influence = "UY"
outputs = ["15.UY"]
reduce = {modes = 6}

[[structure.contact]]
direction = "30.UY"
gap = 0.02
stiffness = 300.0

[sweep]
omega = 4.0
amplitude = [0.1, 0.5]
transient_cycles = 4
sampling_cycles = 4

[output]
floor_acceleration = true
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with a model and a job."""
    np.savez(tmp_path / "beam.npz", M=MASS, K=STIFFNESS, names=NAMES)
    (tmp_path / "beam.toml").write_text(JOB)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def abaqus() -> str:
    """Return a substructure as Abaqus writes it: lower triangles, row by row, four on a line."""
    lines = ["**", "*USER ELEMENT, NODES=30, LINEAR", "** ELEMENT NODES", "1, 2, 3", "1, 2"]
    for kind, matrix in (("STIFFNESS", STIFFNESS), ("MASS", MASS)):
        lines.append(f"*MATRIX,TYPE={kind}")
        for i, row in enumerate(matrix):
            words = [f"{x:.16e}" for x in row[: i + 1]]
            lines += [", ".join(words[k : k + 4]) + "," for k in range(0, len(words), 4)]
    return "\n".join(lines)


def markets() -> None:
    io.mmwrite("beam_K.mtx", sparse.coo_array(np.tril(STIFFNESS)), precision=17)
    io.mmwrite("beam_M.mtx", sparse.coo_array(MASS), precision=17)


WRITERS = {
    "beam.mat": lambda: io.savemat("beam.mat", {"mass": MASS, "stiffness": STIFFNESS, "x": 1.0}),
    "sub.mtx": lambda: Path("sub.mtx").write_text(abaqus()),
    "beam_K.mtx beam_M.mtx": markets,
    "K.out M.out": lambda: [
        np.savetxt(name, one) for name, one in (("K.out", STIFFNESS), ("M.out", MASS))
    ],
    "K.npz M.npz": lambda: [
        sparse.save_npz(name, sparse.csc_array(one))
        for name, one in (("K.npz", STIFFNESS), ("M.npz", MASS))
    ],
    "beam.npz": lambda: None,
}


@together("names", WRITERS)
def test_every_format_gives_the_same_model(folder, names):
    WRITERS[names]()
    paths = names.split()
    found = read_model(paths if len(paths) > 1 else paths[0])
    assert np.allclose(found.mass.toarray(), MASS, rtol=1e-15)
    assert np.allclose(found.stiffness.toarray(), STIFFNESS, rtol=1e-15)
    assert found.damping is None
    assert found.names[:2] == (("1.UY", "1.RZ") if names == "beam.npz" else ("1", "2"))


def test_a_folder_holds_one_file_a_matrix(folder):
    (folder / "beam.npz").unlink()
    markets()
    assert np.allclose(read_model(folder).mass.toarray(), MASS)


@pytest.mark.slow
def test_a_nastran_matrix_file_is_read(folder):
    from pyyeti.nastran import op4

    op4.write("beam.op4", {"kaa": STIFFNESS, "maa": MASS, "k4xx": np.ones((1, 1))})
    assert np.allclose(read_model("beam.op4").mass.toarray(), MASS)


@together(
    "name, library, package",
    [
        ("a.op4", "pyyeti.nastran", "pyyeti"),
        ("a.full", "ansys.mapdl.reader.full", "ansys-mapdl-reader"),
    ],
)
def test_a_library_that_is_missing_is_named_with_the_way_to_install_it(
    monkeypatch, name, library, package
):
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(NotImplementedError, match=f"{package} is needed to read it: pip install"):
        matrix_reader.READERS[name[1:]](name)


def test_what_is_no_model_is_told_in_one_line(folder):
    np.savez("a.npz", M=MASS, stuff=STIFFNESS)
    np.savez("b.npz", M=MASS, mass=MASS, K=STIFFNESS)
    np.savez("c.npz", M=MASS[:4, :4], K=STIFFNESS)
    np.savez("d.npz", M=1e-15 * MASS, K=STIFFNESS)
    (folder / "e.mtx").write_text("hello")
    (folder / "empty").mkdir()
    for path, said in (
        ("a.npz", "a.npz: stiffness is missing: the name of one must be stiffness, or K, here is"),
        ("b.npz", "b.npz: mass is there twice, as 'mass' as well"),
        ("c.npz", "c.npz: mass has 4 rows, stiffness has 60"),
        ("e.mtx", "e.mtx: every entry must be a finite number, line 1 has 'hello'"),
        ([], "path: mass is missing"),
        (
            "empty",
            "^empty: holds no file that ends in .npz, .npy, .mat, .op4, .full, .mtx, .mm, .txt",
        ),
    ):
        with pytest.raises(ValueError, match=said) as caught:
            read_model(path)
        assert "\n" not in str(caught.value)
    np.savetxt("K.csv", STIFFNESS, delimiter=";")
    (folder / "M.txt").write_text("1 2\n3 x\n")
    with pytest.raises(
        ValueError, match=r"^M.txt: every entry must be a finite number, line 2 has 'x'"
    ):
        read_model(["K.csv", "M.txt"])
    (folder / "M.txt").write_text("1 2 3\n4 5 6\n")
    with pytest.raises(ValueError, match=r"^M.txt: looks like a list of entries"):
        read_model(["K.csv", "M.txt"])
    for shape in ((-1, 1), (1, -1)):
        np.savetxt("M.txt", np.diag(MASS).reshape(shape))
        assert np.array_equal(read_model(["K.csv", "M.txt"]).mass.toarray(), np.diag(np.diag(MASS)))
    with pytest.raises(FileNotFoundError):
        read_model("nowhere.mtx")
    with pytest.warns(UserWarning, match=r"d.npz: the first period is 5.651e-08 units of time"):
        read_model("d.npz")


def test_a_job_holds_its_model_from_then_on(folder):
    job = load_job("beam.toml")
    assert job.structure.reduction.modes == 6
    assert f'file = "{folder}/beam.npz"' in job.text
    assert job.structure.names.floors[:2] == ("15.UY", "30.UY")
    shutil.move("beam.npz", "moved.npz")
    again = parse_job(job.text, "results", "beam")
    assert again.structure == job.structure
    assert again.structure.reduction == job.structure.reduction
    assert again.fingerprint == job.fingerprint
    # the fingerprint is that of the content, wherever it lies
    (folder / "beam.toml").write_text(JOB.replace("beam.npz", "moved.npz"))
    assert load_job("beam.toml").fingerprint == job.fingerprint


def test_the_content_of_the_file_and_every_key_of_it_is_part_of_the_fingerprint(folder):
    found = {load_job("beam.toml").fingerprint}
    for old, new in (
        ("modes = 6", "modes = 7"),
        ('["15.UY"]', '["16.UY"]'),
        ("gap = 0.02", "gap = 0.03"),
        ("stiffness = 300.0", "stiffness = 301.0"),
        ('"30.UY"', '"29.UY"'),
        ("damping_ratio = 0.02", "damping_ratio = 0.03"),
    ):
        (folder / "beam.toml").write_text(JOB.replace(old, new))
        found.add(load_job("beam.toml").fingerprint)
    np.savez("beam.npz", M=MASS, K=1.001 * STIFFNESS, names=NAMES)
    (folder / "beam.toml").write_text(JOB)
    found.add(load_job("beam.toml").fingerprint)
    assert len(found) == 8


@pytest.mark.slow
def test_records_are_scaled_at_the_period_of_a_model(folder):
    structure = JOB[: JOB.index("[sweep]")]
    made = []
    for period in ('"T1"', f"{2 * np.pi / 3.515894:.6f}"):  # of the beam
        scale = f'scale = {{by = "sa", period = {period}, values = [5.0]}}'
        text = f"[records]\nsynthetic = {{count = 1, duration = 4.0}}\n{scale}\n"
        (folder / "beam.toml").write_text(f'{structure}{text}[study]\nkind = "records"\n')
        made.append(load_job("beam.toml").study)
    own, given = made
    assert own.structure.frequencies[0] == pytest.approx(3.515894, rel=1e-4)
    assert own.factor == pytest.approx(given.factor, rel=1e-3)
    assert parse_job(load_job("beam.toml").text, "results", "beam").study.factor == given.factor


def test_a_model_that_has_changed_is_not_taken_for_the_one_of_a_job(folder):
    (folder / "stored.toml").write_text(load_job("beam.toml").text)
    load_job("stored.toml")
    np.savez("beam.npz", M=MASS, K=1.001 * STIFFNESS, names=NAMES)
    with pytest.raises(JobError, match=r"model.found: the model's files have changed since"):
        load_job("stored.toml")


def test_gaps_vary_and_directions_do_not(folder):
    (folder / "beam.toml").write_text(f'{JOB}\n[vary]\n"structure.contact[0].gap" = [0.01, 0.02]\n')
    study = load_job("beam.toml").study
    assert [study.part((k,)).structure.contacts[0].gap for k in range(2)] == [0.01, 0.02]
    slider = '[[structure.slider]]\ndirection = "15.UY"\nstiffness = 30.0\nstrength = 1.0\n'
    for job, varied, said in (
        (JOB, '"structure.contact[0].direction" = ["30.UY", "29.UY"]', "reduced once, for its con"),
        (JOB, '"structure.model.reduce.modes" = [4, 5]', "a model is read and reduced once, for"),
        (f"{JOB}{slider}", '"structure.slider[0].stiffness" = [40.0, 50.0]', "reduced once, for"),
    ):
        (folder / "beam.toml").write_text(f"{job}\n[vary]\n{varied}\n")
        key, value = varied.split(" = ")
        told = re.escape(f"beam.toml: vary.{key[1:-1]} = {value}: is not offered: ")
        with pytest.raises(JobError, match=told.replace('"', "'") + f".*{said}"):
            load_job("beam.toml")


def test_a_wrong_value_of_a_contact_names_which(folder):
    second = '[[structure.contact]]\ndirection = "15.UY"\ngap = 0.1\nstiffness = -1.0\n'
    (folder / "beam.toml").write_text(f"{JOB}{second}")
    with pytest.raises(JobError, match=r"^beam.toml: structure.contact\[1\].stiffness must be"):
        load_job("beam.toml")
    (folder / "beam.toml").write_text(JOB.replace("file = ", "fiel = "))
    with pytest.raises(JobError) as caught:
        load_job("beam.toml")
    assert "'structure.model.fiel'; did you mean 'file'" in str(caught.value)


def test_a_model_is_reduced_for_its_stiffest_contact(folder):
    """There the error of the modes is largest; the job's own number may be that of no part."""
    asked, kappa = JOB.replace("{modes = 6}", "{error = 1e-3}"), '"structure.contact[0].stiffness"'
    made = []
    for own, varied in (
        (300.0, ""),
        (3e6, ""),
        (300.0, f"[vary]\n{kappa} = [3.0, 3e6]"),
        (3.0, f"[vary]\n{kappa} = {{from = 3.0, to = 3e6, count = 3}}"),
    ):
        text = asked.replace("stiffness = 300.0", f"stiffness = {own}")
        (folder / "beam.toml").write_text(f"{text}\n{varied}\n")
        found = load_job("beam.toml").structure.reduction
        made.append((found.modes, found.error))
    soft, stiff, *varied = made
    assert soft[0] < stiff[0]
    assert varied == [stiff, stiff]


WRONG = [
    ('"beam.npz"', '"none.npz"', "structure.model.file: none.npz: there is no such file"),
    ('"beam.npz"', "3", "structure.model.file = 3: must be names of files"),
    ('file = "beam.npz"\n', "", "structure.model.file is missing"),
    ('influence = "UY"', 'influense = "UY"', "did you mean 'influence'?"),
    ('influence = "UY"', 'influence = "UX"', "structure.model.influence must be the direction"),
    ('["15.UY"]', '["99.UY"]', "structure.model.outputs must be one of the 60 coordinates"),
    ('["15.UY"]', '"15.UY"', "structure.model.outputs = '15.UY': must be a list"),
    ("modes = 6", "modes = 99", "structure.model.reduce.modes must be a whole number from 1 to 60"),
    ("{modes = 6}", "6", "structure.model.reduce must be one of modes, error, up_to, is 6"),
    ('"30.UY"', '"30.UZ"', "structure.contact[0].direction must be one of the 60 coordinates"),
    ("gap = 0.02\n", "", "structure.contact[0].gap is missing"),
    ("sharpness = inf", "mass = 2.0", "structure.mass = 2.0: does not go with model"),
    (
        "influence =",
        "damping_ratio = 0.1\ninfluence =",
        "= 0.1: must not be given beside structure.damp",
    ),
]


@together("old, new, said", WRONG)
def test_a_wrong_model_in_a_job_is_one_line_with_file_and_key(folder, old, new, said):
    assert old in JOB
    (folder / "beam.toml").write_text(JOB.replace(old, new, 1))
    with pytest.raises(JobError) as caught:
        load_job("beam.toml")
    assert str(caught.value).startswith("beam.toml: ")
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_job_is_described_run_and_read_without_its_model(folder):
    told = hpcsweep(0, "describe", "beam.toml").stdout
    for words in (
        "60 coordinates, 0 of them fixed or empty, 0 without mass condensed",
        "6 modes, up to omega = 298.578; estimated error 0.00017 of displacements in a",
        "effective shares of the modes 0.626, 0.192,",
    ):
        assert words in told
    assert "of the mass that the base moves" not in told
    Path("few.toml").write_text(JOB.replace("{modes = 6}", "{modes = 2}"))
    (warning,) = re.findall(".*that the base moves.*", hpcsweep(0, "describe", "few.toml").stdout)
    assert "that are kept have 0.818 of the mass" in warning
    assert hpcsweep(0, "run", "beam.toml", "-o", "beam.h5").returncode == 0
    (folder / "beam.npz").unlink()
    results = open_results("beam.h5").squeeze()
    assert results.floor.values[:2].tolist() == ["15.UY", "30.UY"]
    refused = hpcsweep(0, "run", "beam.toml", "-o", "none.h5")
    assert refused.returncode == 2
    assert "beam.toml: structure.model.file: beam.npz: there is no such file" in refused.stderr
    assert not (folder / "none.h5").exists()


@pytest.mark.slow
def test_amounts_of_modes_are_not_taken_for_accelerations_of_floors(folder):
    records = "[records]\nsynthetic = {count = 1, duration = 4.0}\nscale = {values = [2.0, 50.0]}\n"
    floors = "[output]\nfloor_spectra = {periods = [0.1, 0.5], places = ['15.UY']}\n"
    structure = JOB[: JOB.index("[sweep]")]
    Path("beam.toml").write_text(f'{structure}{records}{floors}[study]\nkind = "records"\n')
    hpcsweep(0, "run", "beam.toml")
    peak = open_results("beam.h5")["floor_acceleration"]
    own = float(peak.sel(floor=["15.UY", "30.UY"]).max())
    assert float(peak.max()) > own
    assert f"largest floor_acceleration  {own:.4g} " in hpcsweep(0, "summary", "beam.h5").stdout
    hpcsweep(0, "table", "beam.h5")
    assert "mode" not in Path("beam.csv").read_text()
    drawn = hpcsweep(0, "plot", "beam.h5", "--kind", "floor-spectra", "-o", "beam.png")
    assert drawn.returncode == 0
    assert "is for buildings" in hpcsweep(0, "plot", "beam.h5", "--kind", "profile").stderr
