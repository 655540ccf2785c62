"""The explorer's page without a browser: packing, gathering, user mistakes."""

import base64
import json
import re
import zlib

import numpy as np
import pytest
from together import together
from tools import hpcsweep

from hpcsweep import open_results
from hpcsweep.figures.explorer import encode
from hpcsweep.figures.explorer.page import _grazing, _unit_names, build_page
from hpcsweep.figures.explorer.page_data import gather
from hpcsweep.figures.style import classes_of
from hpcsweep.job import parse_job
from hpcsweep.model.structure import Structure
from hpcsweep.model.unit_names import UnitNames
from hpcsweep.store import Frames


def dequantise(codes: np.ndarray, low, high, bits: int) -> np.ndarray:
    """Invert `quantise` to within half a `resolution`."""
    values = low + (codes.astype(float) - 1) * encode.resolution(low, high, bits)
    return np.where(codes > 0, values, np.nan)


def from_text(text: str, dtype, shape: tuple[int, ...]) -> np.ndarray:
    """Invert `to_text`, as the page does."""
    kind = np.dtype(dtype).newbyteorder("<")
    planes = np.frombuffer(zlib.decompress(base64.b64decode(text)), np.uint8)
    flat = np.ascontiguousarray(planes.reshape(kind.itemsize, -1).T).view(kind)
    return flat.reshape(shape).astype(dtype)


@pytest.fixture(scope="module")
def results_file(tmp_path_factory):
    from tools import SMALL

    from hpcsweep.campaign import run as campaign
    from hpcsweep.parallel.mpi import Serial

    path = tmp_path_factory.mktemp("explore") / "small.h5"
    text = SMALL.replace("[output]", "[output]\nlyapunov = true")
    assert campaign.run(parse_job(text, "small", "small"), path, Serial()) == 0
    return path


@together("bits", [6, 12, 16])
def test_values_come_back_within_half_the_stated_resolution(bits):
    rng = np.random.default_rng(1)
    values = rng.normal(size=(5, 40))
    values[2, 7] = np.nan
    low, high = np.nanmin(values), np.nanmax(values)
    codes = encode.quantise(values, low, high, bits)
    back = dequantise(codes, low, high, bits)
    assert codes.max() == 2**bits - 1
    assert np.array_equal(np.isnan(back), np.isnan(values))
    assert np.nanmax(np.abs(back - values)) <= 0.5001 * encode.resolution(low, high, bits)
    assert np.nanmin(back) == pytest.approx(low)
    assert np.nanmax(back) == pytest.approx(high)


def test_one_value_alone_is_exact():
    assert dequantise(encode.quantise(np.array([2.5]), 2.5, 2.5, 8), 2.5, 2.5, 8) == [2.5]


@together("dtype", [np.uint8, np.uint16, np.uint32])
def test_text_holds_every_integer(dtype):
    rng = np.random.default_rng(2)
    codes = rng.integers(0, np.iinfo(dtype).max, (3, 5, 7), dtype, endpoint=True)
    assert np.array_equal(from_text(encode.to_text(codes), dtype, codes.shape), codes)
    rows = encode.predict_rows(codes)
    assert np.array_equal(np.add.accumulate(rows, axis=-1, dtype=dtype), codes)


def test_predicted_points_can_be_undone_from_the_counts():
    rng = np.random.default_rng(3)
    counts = rng.integers(0, 4, (6, 11))
    codes = rng.integers(0, 4096, (2, counts.sum())).astype(np.uint16)
    undone = encode.predict_points(codes, counts)
    assert not np.array_equal(undone, codes)
    at = 0
    for sweep in counts:
        for run, count in enumerate(sweep):
            if run and sweep[run - 1] == count:
                undone[:, at : at + count] += undone[:, at - count : at]
            at += count
    assert np.array_equal(undone, codes)


def test_a_study_holds_what_the_file_holds(results_file):
    results = open_results(results_file)
    study = gather(Frames(results_file))
    assert np.array_equal(study.omega, results["omega"])
    assert np.array_equal(study.runs["motion"], classes_of(results).swapaxes(0, 1))
    for name in ("period", "cycles", "contact"):
        stored = results["orbit_period" if name == "period" else name].values
        assert np.array_equal(study.runs[name], stored.swapaxes(0, 1))
    drift = results["drift"].values.swapaxes(0, 1).astype(np.float32)
    assert np.array_equal(study.runs["drift"], drift)
    ends = np.cumsum(study.runs["counts"].ravel()).reshape(study.runs["counts"].shape)
    for frame, direction, amplitude in np.ndindex(study.runs["counts"].shape):
        run = results.isel(omega=frame, direction=direction, amplitude=amplitude)
        n_points = int(run["n_points"])
        stored = run["poincare"].values[:n_points]
        end = ends[frame, direction, amplitude]
        kept = study.points[end - n_points : end]
        first = int(np.argmin(np.abs(stored[:, :2] - kept[0]).sum(axis=1)))
        assert np.abs(np.roll(stored, -first, axis=0)[:, :2] - kept).max() < 1e-6
        assert (
            np.abs(stored[first, 2:] - study.runs["speed"][frame, direction, amplitude]).max()
            < 1e-6
        )


def test_thinning(results_file):
    whole, thin = gather(Frames(results_file)), gather(Frames(results_file), 2, 2, 3)
    assert thin.runs["counts"].shape == (2, 2, 4)
    assert np.array_equal(thin.runs["counts"], np.minimum(whole.runs["counts"], 2)[::2, :, ::3])
    assert np.array_equal(thin.runs["drift"], whole.runs["drift"][::2, :, ::3])
    assert len(thin.points) == thin.runs["counts"].sum()


def test_a_study_too_large_keeps_fewer_points_of_each_run(results_file, monkeypatch):
    from hpcsweep.figures.explorer import page_data as module

    whole = gather(Frames(results_file))
    monkeypatch.setattr(module, "POINT_BUDGET", 3 * whole.points.size // 4)
    less = gather(Frames(results_file))
    assert less.points.size <= 3 * whole.points.size // 4
    limit = less.thinned["points"]
    assert np.array_equal(less.runs["counts"], np.minimum(whole.runs["counts"], limit))
    same = np.repeat(
        np.cumsum(whole.runs["counts"]) - whole.runs["counts"].ravel(), less.runs["counts"].ravel()
    )
    same += np.concatenate([np.arange(count) for count in less.runs["counts"].ravel()])
    assert np.array_equal(less.points, whole.points[same])


def test_the_page_needs_nothing_else(results_file):
    page = build_page(gather(Frames(results_file)))
    assert not re.search(r"<(script|link|img)[^>]*(src|href)=[\"'](?!data:)", page)
    assert "{{" not in re.sub(r"<script.*?</script>", "", page, flags=re.DOTALL)
    assert "Permission is hereby granted" in page
    meta = json.loads(re.search(r'id="meta">(.*?)</script>', page)[1])
    assert meta["resolution"]["points"] > 0
    for name, spec in meta["arrays"].items():
        text = re.search(rf'id="data-{name}">(.*?)</script>', page)[1]
        assert from_text(text, f"u{spec['bytes']}", (-1,)).size == spec["length"]


def test_a_file_with_few_results_makes_a_page(tmp_path):
    from tools import SMALL

    from hpcsweep.campaign import run as campaign
    from hpcsweep.parallel.mpi import Serial

    none = "[output]\n" + "".join(
        f"{name} = false\n" for name in ("poincare", "contact", "drift", "modal_norm")
    )
    path = tmp_path / "few.h5"
    text = SMALL.replace("[output]", none)
    assert campaign.run(parse_job(text, "few", "few"), path, Serial()) == 0
    arrays = re.findall(r'id="data-(\w+)"', build_page(gather(Frames(path))))
    assert {*arrays} == {"motion", "period", "outcome", "cycles", "counts"}


def test_mistakes_take_one_line_and_leave_nothing(results_file, tmp_path):
    empty = tmp_path / "empty"
    empty.mkdir()
    foreign = tmp_path / "foreign.h5"
    foreign.write_text("not HDF5")
    page = empty / "page.html"
    cases = [
        ((tmp_path / "missing.h5", "-o", page), "missing.h5: cannot be read"),
        ((foreign, "-o", page), "foreign.h5: not an HDF5 file"),
        ((results_file, "-o", empty / "no" / "page.html"), "is not a folder"),
        ((results_file, "-o", results_file), "is a results file"),
        ((results_file, "-o", empty), "cannot be written"),
        ((results_file, "-o", page, "--points", "0"), "is 0"),
        ((results_file, "-o", page, "--max-mb", "0.01"), "--frame-step"),
    ]
    before = results_file.read_bytes()
    for arguments, words in cases:
        done = hpcsweep(0, "explore", *arguments)
        assert done.returncode == 2, done.stderr
        assert words in done.stderr
        assert done.stderr.startswith("hpcsweep: error: ")
        assert done.stderr.count("\n") == 1
        assert done.stdout == ""
        assert list(empty.iterdir()) == []
    assert results_file.read_bytes() == before
    assert sorted(p.name for p in tmp_path.iterdir()) == ["empty", "foreign.h5"]


def test_units_are_named_as_in_the_figures():
    own = {"mass": (2e5, 1e5), "storey_stiffness": (3e7, 2e7), "gap": 0.02}
    named = Structure(2, 20.0, 2e3, 0.03, **own, unit_names=UnitNames("m", "kg", "s"))
    assert [*_unit_names(named).values()] == ["m", "m/s", "m/s²", "rad/s", "1/s", "Hz"]
    paper = [*_unit_names(Structure(2, 20.0)).values()]
    assert paper == ["gaps", "gaps ω₀", "gaps ω₀²", "ω₀", "ω₀", ""]
    assert _grazing(named, 7.0) == named.grazing_amplitude(7.0)
