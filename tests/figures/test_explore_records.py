"""The explorer of responses to records: the data in its page, and the page in a real browser."""

import json
import re

import numpy as np
import pytest
from test_explore import open_page, pixels
from test_explore_encode import from_text
from tools import RECORDS, hpcsweep

from hpcsweep import open_results
from hpcsweep.store import Frames
from hpcsweep.studies.ground_motion.stripes import RESPONSES, capacities, fit, stripes_of

GAPS = (0.02, 0.005)
SCALES = (
    ("count = 5}", "count = 12}"),
    ("to = 5.0", "to = 8.0"),
    ("synthetic = {count = 4", "synthetic = {count = 12"),
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Responses of structures that pound, that yield and collapse, and a page of each."""
    made = tmp_path_factory.mktemp("records")
    pair = RECORDS
    for old, new in SCALES:
        pair = pair.replace(old, new)
    pair += '[units]\nlength = "m"\nmass = "kg"\ntime = "s"\n'
    (made / "pair.toml").write_text(f'{pair}[vary]\n"pounding.gap" = {[*GAPS]}\n')
    yields = RECORDS.replace('"A"\n', '"A"\nyield_drift = 2e-3\ncollapse_drift = 0.06\n')
    (made / "yields.toml").write_text(yields.replace("to = 5.0", "to = 30.0") + "history = 0.1\n")
    for name in ("pair", "yields"):
        for command in (("run", f"{name}.toml"), ("explore", f"{name}.h5")):
            done = hpcsweep(0, *command, cwd=made)
            assert done.returncode == 0, done.stderr
    return made


def parts_of(path):
    """Return the description of a page, and its arrays."""
    text = path.read_text()
    meta = json.loads(re.search(r'id="meta">(.*?)</script>', text)[1])
    arrays = {}
    for name, spec in meta["arrays"].items():
        packed = re.search(rf'id="data-{name}">(.*?)</script>', text)[1]
        codes = from_text(packed, np.dtype(f"u{spec['bytes']}"), (spec["length"],))
        if spec["row"]:
            codes = np.add.accumulate(codes.reshape(-1, spec["row"]), axis=1, dtype=codes.dtype)
        arrays[name] = codes.view(np.float32) if spec["float32"] else codes
    return meta, arrays


@pytest.mark.slow
@pytest.mark.parametrize("name", ["pair", "yields"])
def test_the_page_has_the_responses_of_the_file(folder, name):
    results = open_results(folder / f"{name}.h5")
    meta, arrays = parts_of(folder / f"{name}.html")
    assert meta["records"] == results["record"].values.tolist()
    assert meta["scales"] == results["scale"].values.tolist()
    held = {response for response, variable in RESPONSES.items() if variable.name in results}
    assert set(meta["responses"]) == held
    fallen = results["collapsed"].values > 0 if "collapsed" in results else np.array(False)
    assert bool(meta["collapses"]) == bool(fallen.any()) == (name == "yields")
    for response, about in meta["responses"].items():
        stored = results[RESPONSES[response].name]
        factor = 100.0 / 3.2 if stored.dims[-1] == "storey" else 1.0
        expected = np.abs(stored.values * factor)
        if fallen.any():
            expected[fallen] = np.inf
        got = arrays[response].reshape(expected.shape)
        np.testing.assert_allclose(got, expected, rtol=1e-7)
        assert about["places"] == stored[stored.dims[-1]].values.tolist()
        assert (about["unit"] == "%") == (factor != 1.0)
    alone = results["storey_drift_alone"].values * 100.0 / 3.2
    if fallen.any():
        alone[np.isfinite(results["collapse_time_alone"].values)] = np.inf
    np.testing.assert_allclose(arrays["drift_alone"].reshape(alone.shape), alone, rtol=1e-7)
    factor = arrays["factor"].reshape(len(meta["parts"]), -1)
    expected = np.broadcast_to(results["factor"].values[..., -1], factor.shape)
    np.testing.assert_allclose(factor, expected, rtol=1e-7)


def test_the_page_has_the_motions_that_the_file_has(folder):
    assert parts_of(folder / "pair.html")[0]["history"] == []
    results = open_results(folder / "yields.h5")
    meta, arrays = parts_of(folder / "yields.html")
    assert meta["history"] == results["time"].values.tolist()
    motion = results["history_displacement"].transpose("record", "scale", "floor", "time").values
    size = arrays["history_size"].reshape(motion.shape[:-1])
    np.testing.assert_allclose(size, np.nanmax(np.abs(motion), axis=-1), rtol=1e-6)
    codes = arrays["history"].reshape(motion.shape).astype(float)
    shown = np.where(codes > 0, (codes - 1.0) / (2.0**11 - 1.0) - 1.0, np.nan) * size[..., None]
    assert np.array_equal(np.isnan(shown), np.isnan(motion))
    assert np.isnan(motion).any()  # beyond a collapse
    assert np.nanmax(np.abs(shown - motion) / size[..., None]) < 0.51 / 2**11


def test_places_have_groups_and_levels(folder):
    meta, _ = parts_of(folder / "pair.html")
    drift, force = meta["responses"]["drift"], meta["responses"]["force"]
    assert drift["panels"] == [["A", [0, 1], [1, 2]], ["B", [2, 3, 4], [1, 2, 3]]]
    assert [name for name, _ in drift["groups"][:4]] == [
        *("all 5, the largest", "building A", "building B", "A1")
    ]
    assert drift["groups"][2][1] == [2, 3, 4]
    assert force["panels"] == [["", [0, 1], [0, 1]]]
    assert meta["menus"] == [{"name": "gap  [m]", "values": ["0.02", "0.005"]}]
    assert [one["at"] for one in meta["parts"]] == [[0], [1]]


def test_at_chooses_one_structure_and_options_of_maps_are_refused(folder):
    done = hpcsweep(0, "explore", "pair.h5", "--at", "gap=0.005", "-o", "one.html", cwd=folder)
    assert done.returncode == 0, done.stderr
    assert "12 records x 12 scales x 1 structure, drift" in done.stdout
    whole, one = (parts_of(folder / name)[1]["drift"] for name in ("pair.html", "one.html"))
    assert np.array_equal(whole.reshape(2, -1)[1], one)
    for option in ("--points", "--frame-step"):
        done = hpcsweep(0, "explore", "pair.h5", option, "7", "-o", "none.html", cwd=folder)
        assert done.returncode == 2
        assert f"{option}: is for maps; pair.h5 holds responses" in done.stderr
        assert len(done.stderr.splitlines()) == 1
    done = hpcsweep(0, "explore", "pair.h5", "--max-mb", "0.01", "-o", "none.html", cwd=folder)
    assert done.returncode == 2
    assert "use --at KEY=VALUE for one of the structures, or raise --max-mb" in done.stderr
    assert not (folder / "none.html").exists()


def settle(page) -> None:
    page.evaluate("() => new Promise((r) => requestAnimationFrame(() => setTimeout(r, 30)))")


def number(page, name: str) -> float:
    return page.evaluate(f"() => window.explorer.{name}")


@pytest.mark.browser
def test_capacities_and_fragility_are_those_of_the_command(browser, folder):
    page = open_page(browser, folder / "pair.html")
    for part, gap in enumerate(GAPS):
        page.select_option("#menu-0", str(part))
        frames = Frames(folder / "pair.h5", "responses", {"gap": gap})
        results, study = frames.gather([*frames]), frames.study
        frames.close()
        for response, place in (("drift", "B"), ("acceleration", None), ("force", "A2-B2")):
            page.select_option("#response", response)
            shown = place if place != "B" else "building B"
            page.select_option("#place", label=shown) if shown else None
            stripes = stripes_of(results, study, response, place)
            size = page.evaluate("() => window.explorer.about.size")
            for share in (0.3, 0.6):
                threshold = float(share * np.nanmax(stripes.values))
                page.fill("#threshold", repr(threshold / size))
                own, found = capacities(stripes, threshold), fit(stripes, threshold)
                told = page.evaluate(
                    "() => window.explorer.capacity.map(({ scale }) => [scale, String(scale)])"
                )
                given = [float(words.replace("Infinity", "inf")) for _, words in told]
                np.testing.assert_allclose(given, own.scale, rtol=1e-5)
                later = page.evaluate("() => window.explorer.capacity.map(({ later }) => later)")
                assert later == own.later_crossings.tolist()
                assert number(page, "fit.median") == pytest.approx(found.median, rel=1e-5)
                assert number(page, "fit.dispersion") == pytest.approx(found.dispersion, rel=1e-4)
                low, high = found.band(3.0)
                band = page.evaluate("() => window.explorer.fit.at(3.0)")
                assert band == pytest.approx([found.probability(3.0), low, high], abs=1e-4)
    page.close()


@pytest.mark.browser
def test_a_record_that_is_pointed_at_shows_everywhere(browser, folder):
    page = open_page(browser, folder / "pair.html")
    results = open_results(folder / "pair.h5").isel(gap=0)
    settle(page)
    panels = ("#curves", "#fragility", "#profiles")
    before = [pixels(page, panel) for panel in panels]
    drift = results["storey_drift"].max("storey").values * 100.0 / 3.2
    record, at = int(drift[:, 11].argmax()), 11
    x, y = page.evaluate(
        """([value, scale]) => {
            const { plot } = window.explorer.panels[0];
            const box = plot.over.getBoundingClientRect();
            return [box.left + plot.valToPos(value, "x"), box.top + plot.valToPos(scale, "y")];
        }""",
        [float(drift[record, at]), float(results["scale"][at])],
    )
    page.mouse.move(x, y)
    settle(page)
    name = str(results["record"].values[record])
    assert page.inner_text("#numbers caption") == name
    assert page.inner_text("#readout").startswith(f"{name} at PGA = 8 m/s²: peak storey drift rati")
    assert f"{float(f'{drift[record, at]:.4g}'):g} %" in page.inner_text("#readout")
    assert f"{float(results['factor'][record, at]):.4g}" in page.inner_text("#numbers")
    assert all(a != b for a, b in zip(before, (pixels(page, p) for p in panels), strict=True))
    page.mouse.click(x, y)
    page.mouse.move(5, 5)
    settle(page)
    assert page.inner_text("#numbers caption") == name  # it is kept
    page.focus("#curves")
    page.keyboard.press("ArrowLeft")
    order = [str(one) for one in results["record"].values[np.argsort(drift[:, at])]]
    assert page.inner_text("#numbers caption") == order[order.index(name) - 1]
    page.keyboard.press("ArrowDown")
    assert "at PGA = 7.318 m/s²" in page.inner_text("#readout")
    page.keyboard.press("Escape")
    assert page.inner_text("#numbers caption") == name
    assert page.complaints == []
    page.close()


@pytest.mark.browser
def test_collapse_is_a_failure_and_every_response_draws(browser, folder):
    page = open_page(browser, folder / "yields.html")
    fallen = open_results(folder / "yields.h5")["collapsed"].values > 0
    page.check("#collapse")
    assert f"{int(fallen.any(axis=1).sum())} of 4 records collapse" in page.inner_text("#fit")
    seen = set()
    for response in page.eval_on_selector_all("#response option", "o => o.map((x) => x.value)"):
        page.select_option("#response", response)
        settle(page)
        seen.add(tuple(pixels(page, "#curves")))
    assert len(seen) > 5
    before = pixels(page, "#history")
    page.focus("#curves")
    page.keyboard.press("ArrowRight")
    assert pixels(page, "#history") != before
    assert page.complaints == []
    page.close()
