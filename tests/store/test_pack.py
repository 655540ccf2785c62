"""A packed file reads the same everywhere, and nothing is lost on the way."""

import resource
from pathlib import Path

import h5py
import numpy as np
import pytest
from tools import SMALL, assert_same_datasets, forked, hpcsweep

from hpcsweep import open_results
from hpcsweep.campaign import run as campaign
from hpcsweep.campaign.status import status
from hpcsweep.checks.validate import validate
from hpcsweep.job import parse_job
from hpcsweep.parallel.mpi import Serial
from hpcsweep.store import Lock, StoreError, contents, copying, is_packed, pack
from hpcsweep.studies.run_names import amount


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("whole") / "whole.h5"
    assert campaign.run(parse_job(SMALL, "test", "test"), path, Serial()) == 0
    return path


@pytest.mark.slow
def test_a_packed_file_reads_the_same_and_is_smaller(copy, tmp_path):
    packed = tmp_path / "packed.h5"
    done = hpcsweep(0, "pack", copy, "-o", packed)
    assert done.returncode == 0, done.stderr
    before, after = copy.stat().st_size, packed.stat().st_size
    assert after < before
    assert f": {amount(after)}, {amount(before)} before" in done.stdout
    assert open_results(packed).identical(open_results(copy))
    assert_same_datasets(copy, packed)
    left, right = status(copy), status(packed)
    assert left.pop("file") != right.pop("file")
    assert left.pop("last_heard") <= right.pop("last_heard")
    assert left == right
    left, right = validate(copy, samples=1), validate(packed, samples=1)
    assert left.problems == right.problems == []
    assert right.packed
    assert left.sample == right.sample
    pictures = [tmp_path / "left.png", tmp_path / "right.png"]
    for path, picture in zip((copy, packed), pictures, strict=True):
        assert hpcsweep(0, "plot", path, "-o", picture).returncode == 0
    assert pictures[0].read_bytes() == pictures[1].read_bytes()
    with h5py.File(packed, "r") as file:
        scales = {"direction", "omega", "amplitude", "point", "state", "mode", "block"}
        assert all((data.chunks is None) == (name in scales) for name, data in file.items())


def test_a_packed_file_takes_the_place_of_the_plain_one_and_run_refuses_it(copy, whole, tmp_path):
    assert hpcsweep(0, "pack", copy).returncode == 0
    assert is_packed(copy)
    assert_same_datasets(copy, whole)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["copy.h5", "copy.h5.journal"]
    before = copy.read_bytes()
    job = tmp_path / "job.toml"
    job.write_text(SMALL)
    for arguments in (("run", job, "-o", copy), ("pack", copy)):
        done = hpcsweep(0, *arguments)
        assert done.returncode == 2
        assert done.stderr.startswith(f"hpcsweep: error: {copy}: is packed")
        assert len(done.stderr.splitlines()) == 1
    assert copy.read_bytes() == before


def test_through_a_link_the_file_is_packed_and_the_link_stays(copy, whole, tmp_path):
    (tmp_path / "elsewhere").mkdir()
    link = tmp_path / "elsewhere" / "link.h5"
    link.symlink_to(copy)
    pack(link)
    assert link.is_symlink()
    assert is_packed(copy)
    assert_same_datasets(link, whole)
    assert [path.name for path in link.parent.iterdir()] == ["link.h5"]


def test_a_file_that_is_not_complete_is_packed_only_into_a_copy(copy, tmp_path):
    with h5py.File(copy, "r+") as file:
        file["commit"][1, 3] = 0
    before = copy.read_bytes()
    with pytest.raises(StoreError, match=r"not complete \(3 of 24 blocks are missing\).* -o"):
        pack(copy)
    assert copy.read_bytes() == before
    packed = tmp_path / "packed.h5"
    pack(copy, packed)
    assert open_results(packed).identical(open_results(copy))
    assert status(packed)["runs_done"] == 88 - 11


def test_what_cannot_be_packed_is_left_as_it_is(copy, tmp_path, monkeypatch):
    before = copy.read_bytes()
    with pytest.raises(StoreError, match=r"exists already"):
        pack(copy, copy)
    with pytest.raises(StoreError, match="does not exist"):
        pack(copy, tmp_path / "no" / "a.h5")
    lock = Lock(copy)
    lock.acquire(2)
    # record locks are held by a process, so another one has to try
    done = forked("pack", copy)
    assert done.returncode == 2
    assert "another campaign is running on it" in done.stderr
    lock.release(remove=True)
    honest = copying._copy

    def careless(path, temporary, layout):
        honest(path, temporary, layout)
        with h5py.File(temporary, "r+") as file:
            file["cycles"][1, 2, 3] += 1
            file.attrs["name"] = "x"

    with monkeypatch.context() as patch:
        patch.setattr(copying, "_copy", careless)
        with pytest.raises(StoreError, match="differs in the attributes, cycles; not packed"):
            pack(copy)
    assert copy.read_bytes() == before
    with h5py.File(copy, "r+") as file:
        file["drift"][0, 0, 0] = 17.0
    before = copy.read_bytes()
    with pytest.raises(StoreError, match=r"damaged .* run its job again"):
        pack(copy)
    assert copy.read_bytes() == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["copy.h5", "copy.h5.journal"]


def test_chunks_and_parts_cover_a_variable_once(tmp_path):
    with h5py.File(tmp_path / "x.h5", "w") as file:
        for shape in ((2, 3, 1001, 40, 6), (1, 200, 30000), (2, 7, 5), (1, 1, 3, 100, 128), (9,)):
            chunks = contents.chunk_shape(shape, 8)
            assert np.prod(chunks) * 8 <= contents.CHUNK_BYTES
            data = file.create_dataset(f"x{shape[-1]}", shape, "f8", chunks=chunks)
            seen = np.zeros(shape, int)
            for part in contents.parts_of(data):
                seen[part] += 1
                assert seen[part].nbytes <= contents.COPY_BYTES
            assert seen.min() == seen.max() == 1


@pytest.mark.parametrize("more", [-1, 0, 5_000])
def test_where_the_copy_does_not_fit_the_sound_source_is_not_blamed(copy, tmp_path, more):
    """Nor does HDF5 end the process, as it may where it cannot write what it still has."""
    before, target = copy.read_bytes(), tmp_path / "packed.h5"
    room = 2 * contents.COPY_BYTES + more
    limit = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (room, limit[1]))
    try:
        with pytest.raises(StoreError) as caught:
            pack(copy, target)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limit)
    assert str(caught.value) == f"{target}: cannot be written: File too large"
    assert copy.read_bytes() == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["copy.h5", "copy.h5.journal"]
