"""Results taken over from earlier files equal those computed anew, to the last bit."""

from pathlib import Path

import h5py
import pytest
from together import together
from tools import ALONG, ATTRACTORS, BASINS, GRID, SMALL, assert_same_datasets, hpcsweep

from hpcsweep.campaign.run import COMPLETE, run_all
from hpcsweep.job import parse_job
from hpcsweep.parallel.mpi import Serial
from hpcsweep.store import StoreError
from hpcsweep.store.reuse import OTHER_STATE, Reuse

FINER = SMALL.replace("count = 4", "count = 7")


def made(text, path, reuse=(), said=None):
    said = [] if said is None else said
    ended = run_all([(parse_job(text, "job", "job"), path)], Serial(), reuse=reuse)
    assert ended[0].code == COMPLETE
    return path


def reused(path) -> dict:
    lines = (path.parent / f"{path.name}.journal").read_text().splitlines()
    import json

    record = next(r for r in map(json.loads, lines) if r["kind"] == "reuse")
    return {key: value for key, value in record.items() if key not in ("kind", "time")}


@pytest.mark.parametrize(
    ("old", "new", "runs"),
    [
        pytest.param(SMALL, FINER, 4 * 22, id="finer frequencies"),
        pytest.param(
            SMALL,
            FINER.replace("block = 4", "block = 3"),
            4 * 22,
            id="other blocks",
            marks=pytest.mark.slow,
        ),
        pytest.param(
            ALONG,
            ALONG.replace("[0.05, 0.1, ", "[0.1, 0.15, "),
            66,
            id="along omega",
            marks=pytest.mark.slow,
        ),
        pytest.param(GRID, GRID.replace("count = 11", "count = 21"), 44, id="points"),
        pytest.param(
            SMALL + "[vary]\nstructure.gap = [1.0, 0.8]\n",
            SMALL,
            88,
            id="a part",
            marks=pytest.mark.slow,
        ),
        pytest.param(
            SMALL,
            SMALL + "[vary]\nstructure.gap = [0.8, 1.0]\n",
            88,
            id="into a part",
            marks=pytest.mark.slow,
        ),
    ],
)
def test_what_is_taken_equals_what_is_computed(tmp_path, old, new, runs):
    earlier = made(old, tmp_path / "old.h5")
    whole = made(new, tmp_path / "anew.h5")
    taken = made(new, tmp_path / "new.h5", [earlier])
    assert_same_datasets(whole, taken)
    assert reused(taken)[f"from {earlier}"] == runs


@pytest.mark.slow
def test_attractors_are_taken_along_their_path(tmp_path):
    new = ATTRACTORS.replace("omega = [0.9, 1.0, 1.1]", "omega = [0.9, 1.1]")
    earlier = made(ATTRACTORS, tmp_path / "old.h5")
    taken = made(new, tmp_path / "new.h5", [earlier])
    assert_same_datasets(made(new, tmp_path / "anew.h5"), taken)
    assert reused(taken) == {f"from {earlier}": 12}


def test_of_a_sweep_further_up_what_comes_before_on_the_path_is_taken(tmp_path):
    """Of the way up the two whole blocks below the old end."""
    old = SMALL.replace("to = 0.3, count = 11", "to = 0.3, step = 0.028")
    new = SMALL.replace("to = 0.3, count = 11", "to = 0.384, step = 0.028")
    earlier = made(old, tmp_path / "old.h5")
    taken = made(new, tmp_path / "new.h5", [earlier])
    assert_same_datasets(made(new, tmp_path / "anew.h5"), taken)
    assert reused(taken)[f"from {earlier}"] >= 4 * 8


def test_a_path_from_another_state_is_not_taken(tmp_path):
    """The amplitudes of a block are there, but those before them are others."""
    old = SMALL.replace("{from = 0.02, to = 0.3, count = 11}", "[0.05, 0.1, 0.15, 0.2, 0.25, 0.3]")
    new = SMALL.replace("{from = 0.02, to = 0.3, count = 11}", "[0.04, 0.1, 0.15, 0.2, 0.25, 0.3]")
    old, new = (text.replace("block = 4", "block = 2") for text in (old, new))
    earlier = made(old, tmp_path / "old.h5")
    whole = made(new, tmp_path / "anew.h5")
    taken = made(new, tmp_path / "new.h5", [earlier])
    assert_same_datasets(whole, taken)
    assert reused(taken)[OTHER_STATE] > 0


def test_of_two_files_each_gives_what_it_has_and_a_damaged_block_is_not_taken(tmp_path):
    low = made(SMALL.replace("to = 0.8, count = 4", "to = 0.6, count = 2"), tmp_path / "low.h5")
    high = made(
        SMALL.replace("from = 0.5, to = 0.8, count = 4", "from = 0.7, to = 0.8, count = 2"),
        tmp_path / "high.h5",
    )
    text = SMALL.replace("{from = 0.5, to = 0.8, count = 4}", "[0.5, 0.6, 0.7, 0.8]")
    with h5py.File(low, "r") as file:
        place = file["drift"].id.get_offset()
    with low.open("r+b") as file:
        file.seek(place)
        byte = file.read(1)[0]
        file.seek(place)
        file.write(bytes([byte ^ 1]))
    whole = made(text, tmp_path / "anew.h5")
    taken = made(text, tmp_path / "new.h5", [low, high])
    assert_same_datasets(whole, taken)
    reported = reused(taken)
    assert reported[f"from {high}"] == 44
    assert reported[f"from {low}"] == 40


@together(
    "change, said",
    [
        (("sharpness = 4e3", "sharpness = 5e3"), r"is of another structure \(sharpness\)"),
        (("max_orbit_period = 6", ""), r"another setting \(max_orbit_period\)"),
        (("[structure]", '[study]\nkind = "points"\n[structure]'), r"another study \(kind\)"),
        (("[output]", "[output]\nlyapunov = true"), r"another setting \(metrics\)"),
    ],
)
def test_an_earlier_file_of_something_else_is_refused_and_nothing_written(tmp_path, change, said):
    earlier = made(SMALL, tmp_path / "old.h5")
    job = parse_job(SMALL.replace(*change), "job", "job")
    with pytest.raises(StoreError, match=said):
        run_all([(job, tmp_path / "new.h5")], Serial(), reuse=[earlier])
    with pytest.raises(StoreError, match="is the file of the results"):
        run_all([(parse_job(SMALL, "job", "job"), earlier)], Serial(), reuse=[earlier])
    assert not [*tmp_path.glob("new.h5*")]


@together(
    "old, said",
    [
        ("old.h5", "is of another structure (sharpness)"),
        ("none.h5", "none.h5: cannot be read"),
        ("text.h5", "text.h5: not an HDF5 file"),
        (".", "cannot be read: it is a folder"),
    ],
)
def test_the_command_refuses_such_a_file_in_one_line(tmp_path, old, said):
    made(SMALL, tmp_path / "old.h5")
    (tmp_path / "text.h5").write_text("text")
    (tmp_path / "new.toml").write_text(SMALL.replace("sharpness = 4e3", "sharpness = 5e3"))
    before = sorted(tmp_path.iterdir())
    done = hpcsweep(0, "run", "new.toml", "--reuse", old, cwd=tmp_path)
    assert done.returncode == 2
    assert said in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert sorted(tmp_path.iterdir()) == before


def test_rows_of_basins_are_not_taken_even_of_the_same_job(tmp_path):
    """All rows have one frequency and one amplitude: their place in the grid tells nothing."""
    earlier = made(BASINS, tmp_path / "old.h5")
    with pytest.raises(StoreError, match="runs of basins depend on the whole job"):
        run_all([(parse_job(BASINS, "job", "job"), tmp_path / "n.h5")], Serial(), reuse=[earlier])
    assert not [*tmp_path.glob("n.h5*")]


def test_reuse_closes_its_files(tmp_path):
    from hpcsweep.store import Layout

    def n_open() -> int:
        descriptors = Path("/proc/self/fd").iterdir()
        return sum(descriptor.resolve() == earlier.resolve() for descriptor in descriptors)

    earlier = made(SMALL, tmp_path / "old.h5")
    assert n_open() == 0
    reuse = Reuse(Layout(parse_job(FINER, "job", "job")), [earlier])
    assert n_open() >= 1
    reuse.close()
    assert n_open() == 0
