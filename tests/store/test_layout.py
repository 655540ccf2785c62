"""Files of another layout are refused; the job in a file gives the file again."""

import math

import h5py
import numpy as np
import pytest
import xarray
from together import together
from tools import ATTRACTORS, BASINS, GRID, RECORDS, REFINED, SMALL, assert_same_datasets, hpcsweep

from hpcsweep import Structure, meanings, open_results
from hpcsweep.dynamics.classify import CLASS_NAMES, MotionClass
from hpcsweep.job import parse_job
from hpcsweep.store.layout import LAYOUT_VERSION, Layout, flags_of
from hpcsweep.studies.branches.variables import CURVE_VARIABLES, VARIABLES


@pytest.mark.parametrize("version", [1, LAYOUT_VERSION + 1])
def test_another_layout_is_refused_with_both_numbers_and_who_reads_it(tmp_path, small_job, version):
    path = tmp_path / "other.h5"
    assert hpcsweep(0, "run", small_job, "-o", path).returncode == 0
    with h5py.File(path, "r+") as file:
        file.attrs["layout_version"] = version
        file.attrs["hpcsweep_version"] = "9.8.7"
    for command in (("status",), ("plot",), ("run", small_job, "-o")):
        done = hpcsweep(0, *command, path, cwd=tmp_path)
        assert (done.returncode, len(done.stderr.splitlines())) == (2, 1), done.stderr
        expected = f"layout version {version}, which hpcsweep 9.8.7 reads; this one reads version"
        assert f"{expected} {LAYOUT_VERSION}" in done.stderr


def test_the_job_written_back_out_of_the_file_gives_equal_data(tmp_path, small_job):
    first, second = tmp_path / "first.h5", tmp_path / "second.h5"
    assert hpcsweep(0, "run", small_job, "-o", first).returncode == 0
    shown = hpcsweep(0, "status", first, "--job")
    assert shown.returncode == 0
    assert shown.stdout == small_job.read_text()
    back = tmp_path / "back.toml"
    back.write_text(shown.stdout)
    assert hpcsweep(0, "run", back, "-o", second).returncode == 0
    assert_same_datasets(first, second)
    both = hpcsweep(0, "status", first, "--job", "--json")
    assert both.returncode == 2
    assert "not allowed with" in both.stderr


def test_what_numbers_mean_is_told_as_cf_has_it(small_job, tmp_path):
    from hpcsweep.solvers.outcome import Outcome
    from hpcsweep.store import pack

    path = tmp_path / "a.h5"
    assert hpcsweep(0, "run", small_job, "-o", path).returncode == 0
    for form in ("as written", "packed"):
        if form == "packed":
            pack(path)
        reported = open_results(path)["outcome"].attrs
        meanings = dict(
            zip(reported["flag_values"].tolist(), reported["flag_meanings"].split(), strict=True)
        )
        assert meanings == {int(one): one.name.lower() for one in Outcome}
        with h5py.File(path, locking=False) as file:
            assert file["motion"].attrs["flag_meanings"].split()[2] == MotionClass(2).name.lower()
            assert "flag_values" not in file["cycles"].attrs


BUILDINGS = """
[[building]]
name = "A"
mass = [1.0, 1.0]
storey_stiffness = 1.0

[[building]]
name = "B 1"
mass = [1.0, 1.0, 1.0]
storey_stiffness = 2.0

[pounding]
gap = 0.2
stiffness = 100.0

[sweep]
omega = 0.5
amplitude = {from = 0.02, to = 0.6, count = 10}
"""


def test_numbers_are_put_into_words(tmp_path):
    job = tmp_path / "buildings.toml"
    job.write_text(BUILDINGS)
    assert hpcsweep(0, "run", job, "-o", tmp_path / "a.h5").returncode == 0
    results = open_results(tmp_path / "a.h5")
    contact = meanings(results.contact)
    assert contact.dims == results.contact.dims
    names = ("A1-B_11", "A2-B_12")
    for number, word in zip(results.contact.values.flat, contact.values.flat, strict=True):
        members = [name for k, name in enumerate(names) if int(number) >> k & 1]
        assert word == (",".join(members) or "none")
    assert len(set(contact.values.flat)) > 1
    motion = meanings(results.motion.sel(direction="up"))
    assert motion.dims == ("omega", "amplitude")
    assert motion.values.flat[0] == "no contact"
    with pytest.raises(ValueError, match="drift: has no flag_meanings"):
        meanings(results.drift)


@together("contact_set", [0, 1, 2**63 + 5])
def test_every_set_of_contacts_has_a_name(contact_set):
    masks = np.array([1, 4, 2**63], "u8")
    notes = {"flag_masks": masks, "flag_meanings": "1 3 64"}
    said = meanings(xarray.DataArray(np.array([[contact_set]], "u8"), attrs=notes))
    assert said.item() == {0: "none", 1: "1", 2**63 + 5: "1,3,64"}[contact_set]


def test_a_contact_out_of_reach_keeps_its_name():
    structure = Structure(n_floors=2, gap_left=(1.0, math.inf), stiffness_ratio=10.0)
    assert structure.contact_names == {1: "1", 2: "2", 3: "1L"}


NUMBERS = {"stable", "curve_unstable", "label", "cell", "crossed"}
"""Variables of one byte that count, or number, what they tell."""


@together("text", [SMALL, GRID, REFINED, ATTRACTORS, BASINS, RECORDS, None])
def test_every_code_has_a_word_also_what_fills_unused_room(text):
    if text is None:
        structure, variables = Structure(2), (*VARIABLES, *CURVE_VARIABLES)
    else:
        layout = Layout(parse_job(text, "job", "job"))
        structure, variables = layout.study.structure, (*layout.variables, *layout.derived)
    coded = [v for v in variables if v.dtype == "<i1" and v.name not in NUMBERS]
    assert coded
    for one in coded:
        notes = flags_of(one, structure)
        words = notes["flag_meanings"].split()
        assert len(words) == notes["flag_values"].size, one.name
        assert one.missing in notes["flag_values"], one.name
        said = meanings(xarray.DataArray(notes["flag_values"], dims="code", attrs=notes))
        assert said.values.tolist() == [word.replace("_", " ") for word in words]
        if one.flags is MotionClass:  # as summaries and figures have them
            assert said.values.tolist()[1:] == [*CLASS_NAMES.values()][1:]
