"""The explorer in a real browser: Chromium, headless, the page opened from disk."""

import re
from pathlib import Path

import numpy as np
import pytest
from tools import ROOT, hpcsweep

from hpcsweep import load_job, open_results, orbit
from hpcsweep.dynamics.classify import MotionClass
from hpcsweep.figures.explorer.page import build_page
from hpcsweep.figures.explorer.page_data import PageData
from hpcsweep.figures.palette import MOTION_COLOURS, NO_CONTACT, motion_place
from hpcsweep.model.structure import Structure

pytestmark = pytest.mark.browser

JOB = """
[structure]
n_floors = 2
stiffness_ratio = 300.0
sharpness = 4e3
damping_ratio = 0.03

[sweep]
omega = {from = 0.55, to = 0.8, count = 8}
amplitude = {from = 0.02, to = 0.3, count = 24}
transient_cycles = 60
sampling_cycles = 40
max_orbit_period = 8

[output]
lyapunov = true
storey_drift = true
"""
LAPTOP = {"width": 1366, "height": 768}
SLOWEST_MEDIAN, SLOWEST_TENTH, IDLE = 50.0, 150.0, 18.0
"""Bounds of the time between frames in ms: fluid, on a machine without a graphics card. On one
that is busy with other things, where even the frames of an idle page are later than `IDLE`, they
are so much longer.
"""
MOVE_AND_TIME = """async (moving) => {
    const { over } = window.explorer.map.plot;
    const box = over.getBoundingClientRect();
    const titles = new Set();
    const times = [];
    for (let i = 0; i < 120; i++) {
        const share = 0.05 + 0.0075 * i;
        if (moving) over.dispatchEvent(new PointerEvent("pointermove", {
            bubbles: true,
            clientX: box.left + share * box.width,
            clientY: box.bottom - share * box.height,
        }));
        times.push(await new Promise((resume) => requestAnimationFrame(resume)));
        titles.add(document.getElementById("diagram-title").textContent);
    }
    return [titles.size, times.slice(1).map((t, i) => t - times[i])];
}"""


@pytest.fixture(scope="module")
def results_file(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("explore")
    (folder / "study.toml").write_text(JOB)
    done = hpcsweep(0, "run", folder / "study.toml", "-o", folder / "study.h5")
    assert done.returncode == 0, done.stderr
    done = hpcsweep(0, "explore", folder / "study.h5", "-o", folder / "study page.html")
    assert done.returncode == 0, done.stderr
    assert "8 frames x 24 amplitudes x 2 directions" in done.stdout
    return folder / "study.h5"


def open_page(browser, path: Path):
    """Open a page from disk; any error, warning or request beyond the file fails the test."""
    page = browser.new_page(viewport=LAPTOP)
    page.complaints = []
    page.on("console", lambda message: page.complaints.append(message.text))
    page.on("pageerror", lambda error: page.complaints.append(str(error)))
    page.on(
        "request",
        lambda request: (
            request.url.startswith(("file:", "data:", "blob:"))
            or page.complaints.append(request.url)
        ),
    )
    page.goto(path.as_uri())
    page.wait_for_selector("body[data-ready=true]", timeout=120_000)
    assert page.complaints == []
    return page


@pytest.fixture
def page(browser, results_file):
    page = open_page(browser, results_file.with_name("study page.html"))
    yield page
    assert page.complaints == []
    page.close()


def settle(page) -> None:
    """Wait until a frame has been drawn and no orbit is being integrated."""
    page.evaluate("() => new Promise((r) => requestAnimationFrame(() => setTimeout(r, 60)))")
    page.wait_for_function(
        "() => !document.getElementById('portrait-note').textContent.startsWith('Integrating')"
    )


def place(page, frame: int, amplitude: int) -> tuple[float, float]:
    """Return the place of a run of the map on the page."""
    x, y = page.evaluate(
        """([frame, amplitude]) => {
            const { study, map } = window.explorer;
            const box = map.plot.over.getBoundingClientRect();
            const { a, w } = map.view;
            return [
                box.left + ((study.amplitude[amplitude] - a[0]) / (a[1] - a[0])) * box.width,
                box.top + ((w[1] - study.omega[frame]) / (w[1] - w[0])) * box.height,
            ];
        }""",
        [frame, amplitude],
    )
    return x, y


def pixels(page, selector: str) -> list[str]:
    """Return the pictures in all canvases of an element."""
    return page.eval_on_selector_all(
        f"{selector} canvas", "canvases => canvases.map((c) => c.toDataURL())"
    )


def map_pixel(page, frame: int, amplitude: int) -> str:
    """Colour of a run on the map."""
    x, y = place(page, frame, amplitude)
    return page.evaluate(
        """([x, y]) => {
            const box = window.explorer.map.plot.over.getBoundingClientRect();
            const canvas = window.explorer.map.canvas;
            const at = [(x - box.left) / box.width, (y - box.top) / box.height];
            const copy = new OffscreenCanvas(1, 1).getContext("2d", { willReadFrequently: true });
            copy.drawImage(canvas, -Math.floor(at[0] * canvas.width),
                -Math.floor(at[1] * canvas.height));
            const [r, g, b] = copy.getImageData(0, 0, 1, 1).data;
            return "#" + [r, g, b].map((v) => v.toString(16).padStart(2, "0")).join("");
        }""",
        [x, y],
    )


def numbers(page) -> dict[str, str]:
    rows = page.eval_on_selector_all(
        "#numbers tr", "rows => rows.map((r) => [r.cells[0].innerText, r.cells[1].innerText])"
    )
    return dict(rows)


def test_pointing_shows_that_frame_and_leaving_returns(page):
    settle(page)
    title, drawn = page.inner_text("#diagram-title"), pixels(page, "#diagrams")
    other = 6 if "frame 7 " not in title else 2
    page.mouse.move(*place(page, other, 12))
    settle(page)
    omega = np.linspace(0.55, 0.8, 8)[other]
    assert f"Ω = {omega:.6g} (frame {other + 1} of 8)" in page.inner_text("#diagram-title")
    assert re.match(rf"A = \S+, Ω = {omega:.6g}; up: .+; down: .+", page.inner_text("#readout"))
    shown = pixels(page, "#diagrams")
    assert len(shown) == 2
    assert all(a != b for a, b in zip(drawn, shown, strict=True))
    page.mouse.move(5, 5)
    settle(page)
    assert page.inner_text("#diagram-title") == title
    assert pixels(page, "#diagrams") == drawn


def test_points_are_coloured_by_motion_or_by_direction(page):
    settle(page)
    assert "colours as on the map" in page.inner_text("#diagram-legend")
    assert "grazing" in page.inner_text("#diagram-legend")
    by_motion = pixels(page, "#diagrams")
    page.select_option("#points", "direction")
    settle(page)
    assert "sweep up" in page.inner_text("#diagram-legend")
    assert pixels(page, "#diagrams") != by_motion
    page.select_option("#points", "motion")
    settle(page)
    assert pixels(page, "#diagrams") == by_motion


def test_clicking_shows_the_numbers_and_the_orbit_of_the_run(page, results_file):
    results = open_results(results_file)
    frame, amplitude = 4, 18
    settle(page)
    before = pixels(page, "#portraits")
    page.mouse.click(*place(page, frame, amplitude))
    settle(page)
    run = results.isel(direction=0, omega=frame, amplitude=amplitude)
    shown = numbers(page)
    assert float(shown["A [gaps ω₀²]"]) == pytest.approx(float(run["amplitude"]), rel=1e-6)
    assert float(shown["Ω [ω₀]"]) == pytest.approx(float(run["omega"]), rel=1e-6)
    assert int(run["contact"]) > 0
    assert shown["motion"] == f"P{int(run['orbit_period'])}"
    assert int(shown["periods integrated"]) == int(run["cycles"])
    assert float(shown["drift δ [A/Ω²]"]) == pytest.approx(float(run["drift"]), rel=1e-3)
    assert float(shown["modal norm η₂"]) == pytest.approx(float(run["modal_norm"][1]), abs=1e-3)
    assert float(shown["Lyapunov λ [ω₀]"]) == pytest.approx(float(run["lyapunov"]), abs=1e-4)
    assert "peak storey drift, storey 2 [gaps]" not in shown
    page.select_option("#quantity", "storey_drift_1")
    shown = {" ".join(name.split()): value for name, value in numbers(page).items()}
    for storey, drift in enumerate(run["storey_drift"].values, 1):
        told = float(shown[f"peak storey drift, storey {storey} [gaps]"])
        assert told == pytest.approx(drift, rel=2e-3)
    after = pixels(page, "#portraits")
    assert len(after) == 2
    assert all(a != b for a, b in zip(before, after, strict=True))


def test_the_orbit_integrated_in_the_page_is_the_stored_one(page, results_file):
    results = open_results(results_file)
    period = results["orbit_period"].values
    checked = set()
    for direction, frame, amplitude in np.argwhere(period > 0)[::29]:
        page.evaluate("([d]) => window.explorer.setDirection(d)", [int(direction)])
        page.mouse.click(*place(page, int(frame), int(amplitude)))
        settle(page)
        assert "Beware" not in page.inner_text("#portrait-note")
        found = page.evaluate("() => window.explorer.orbit.points.map((z) => Array.from(z))")
        n = int(period[direction, frame, amplitude])
        stored = results["poincare"].values[direction, frame, amplitude, :n]
        assert len(found) == n
        nearest = [np.abs(stored - z).max(axis=1).min() for z in np.array(found)]
        assert max(nearest) < 2e-4
        checked.add(int(results["contact"].values[direction, frame, amplitude]))
    assert len(checked) > 1


def test_the_map_shows_what_is_chosen(page, results_file):
    results = open_results(results_file)
    page.mouse.move(5, 5)
    seen = []
    for quantity in page.eval_on_selector_all("#quantity option", "o => o.map((x) => x.value)"):
        page.select_option("#quantity", quantity)
        settle(page)
        seen.append(page.evaluate("() => window.explorer.map.canvas.toDataURL()"))
        assert page.inner_text("#legend") != ""
    assert len(seen) == 8
    assert len(set(seen)) == 8
    page.select_option("#quantity", "motion")
    period = results["orbit_period"].values
    p1, p2 = (MOTION_COLOURS[motion_place(MotionClass.PERIODIC, p)] for p in (1, 2))
    colours = np.array(["", p1, p2, NO_CONTACT])
    kind = np.where((period == 1) | (period == 2), period, 0)
    kind[results["contact"].values == 0] = 3
    differ = np.argwhere((kind[0] != kind[1]) & (kind > 0).all(axis=0))
    assert len(differ) > 0
    for frame, amplitude in differ[:6]:
        for direction in (0, 1):
            page.select_option("#direction", str(direction))
            settle(page)
            expected = colours[kind[direction, frame, amplitude]]
            assert map_pixel(page, int(frame), int(amplitude)) == expected
    page.click("#legend button:has-text('no contact')")
    assert map_pixel(page, 0, 0) == NO_CONTACT
    page.click("#legend button:has-text('P2')")
    assert map_pixel(page, 0, 0) == "#ffffff"


def test_portraits_are_enlarged_and_put_back(page):
    settle(page)
    small = page.eval_on_selector("#portraits canvas", "canvas => canvas.clientWidth")
    page.click("#portraits")
    settle(page)
    large = page.eval_on_selector("#portraits canvas", "canvas => canvas.clientWidth")
    assert large > 2 * small
    page.keyboard.press("Escape")
    settle(page)
    assert page.eval_on_selector("#portraits canvas", "canvas => canvas.clientWidth") == small


def test_the_keyboard_alone(page):
    page.focus("#map")
    page.evaluate("() => window.explorer.choose(3, 10)")
    for key in ("ArrowUp", "ArrowUp", "ArrowLeft"):
        page.keyboard.press(key)
    settle(page)
    assert "(frame 6 of 8)" in page.inner_text("#diagram-title")
    amplitude = np.linspace(0.02, 0.3, 24)
    assert float(numbers(page)["A [gaps ω₀²]"]) == pytest.approx(amplitude[10], rel=1e-6)
    page.keyboard.press("Enter")
    settle(page)
    assert float(numbers(page)["A [gaps ω₀²]"]) == pytest.approx(amplitude[9], rel=1e-6)
    page.keyboard.press("d")
    settle(page)
    assert numbers(page)["direction"] == "down"
    whole = page.evaluate("() => window.explorer.map.view.a")
    page.keyboard.press("+")
    near = page.evaluate("() => window.explorer.map.view.a")
    assert near[1] - near[0] == pytest.approx(0.6 * (whole[1] - whole[0]))
    page.keyboard.press("0")
    assert page.evaluate("() => window.explorer.map.view.a") == whole


BRANCHES = """
extends = "study.toml"
[study]
kind = "branches"
[branches]
seeds = "{seeds}"
[sweep]
omega = 0.8
max_orbit_period = 2
"""


def test_a_point_of_a_branch_under_the_pointer_is_told(browser, results_file):
    """Its multipliers as in the file, its contacts as another integrator finds them."""
    folder = results_file.parent
    (folder / "branches.toml").write_text(BRANCHES.format(seeds=results_file))
    for command in (
        ("run", folder / "branches.toml", "-o", folder / "branches.h5"),
        ("explore", results_file, "--branches", folder / "branches.h5", "-o", folder / "b.html"),
    ):
        done = hpcsweep(0, *command)
        assert done.returncode == 0, done.stderr
    run = open_results(folder / "branches.h5").isel(direction=0, line=0, amplitude=0)
    structure = load_job(folder / "study.toml").structure
    page = open_page(browser, folder / "b.html")
    page.evaluate("() => window.explorer.choose(7, 12)")
    settle(page)
    drawn = pixels(page, "#diagrams")
    held = run["step_branch"].values > 0
    apart = np.abs(run["multiplier_real"].values - 1.0).min(axis=1) > 0.05
    seen = 0
    for stable in (0, 1):
        wanted = held & apart & (run["contact"].values > 0) & (run["stable"].values == stable)
        step = int(np.flatnonzero(wanted)[wanted.sum() // 2])
        page.mouse.move(*place_of_step(page, step))
        settle(page)
        assert page.inner_text("#numbers caption") == "Point of a branch"
        shown = numbers(page)
        at = np.flatnonzero(np.abs(run["value"].values - float(shown["A [gaps ω₀²]"])) < 1e-7)
        at = at[run["step_branch"].values[at] == int(shown["branch"])]
        told = complex(
            shown["multiplier μ₁"]
            .split(" (")[0]
            .replace(" ", "")
            .replace("−", "-")
            .replace("i", "j")
        )
        mu = (run["multiplier_real"] + 1j * run["multiplier_imag"]).values[at, 0]
        step = int(at[np.argmin(np.abs(mu - told))])
        assert mu.size
        assert np.abs(mu - told).min() < 2e-3 * abs(told)
        assert shown["motion"] == ("stable" if run["stable"].values[step] else "unstable")
        period = int(shown["period"][1:])
        found = orbit(structure, float(run["value"][step]), 0.8, run["point"].values[step], period)
        phases = sorted(one.phase for one in found.signature)
        signature = page.evaluate("() => window.explorer.orbit.signature")
        np.testing.assert_allclose([one["phase"] for one in signature], phases, atol=2e-3)
        assert [one["closes"] for one in signature] == [
            one.closes for one in sorted(found.signature, key=lambda one: one.phase)
        ]
        assert page.evaluate("() => window.explorer.orbit.closed") < 1e-3
        assert pixels(page, "#diagrams") != drawn
        seen += len(signature)
    assert seen >= 2
    page.mouse.move(5, 5)
    settle(page)
    assert page.inner_text("#numbers caption") == "Selected run"
    assert pixels(page, "#diagrams") == drawn
    assert page.complaints == []
    page.close()


def place_of_step(page, step: int) -> tuple[float, float]:
    """Return the place of a point of a branch in the highest diagram."""
    x, y = page.evaluate(
        """(step) => {
            const { diagrams } = window.explorer;
            const { plot, floor } = diagrams.panels[0];
            const own = diagrams.branches.of(diagrams.frame);
            const branch = own.find((b) => b.step <= step && step < b.step + b.count);
            const box = plot.over.getBoundingClientRect();
            const value = window.explorer.study.data.branch_value[step];
            const u = diagrams.branches.component(branch, step - branch.step, 0, floor);
            return [box.left + plot.valToPos(value, "x"), box.top + plot.valToPos(u, "y")];
        }""",
        step,
    )
    return x, y


def full_size_study(n_frames=2000, n_amplitudes=1250, n=3, most_points=4) -> PageData:
    """Make up a study of five million runs, a tenth of them without period."""
    rng = np.random.default_rng(5)
    omega, amplitude = np.linspace(0.3, 1.5, n_frames), np.linspace(0.002, 0.4, n_amplitudes)
    shape = (n_frames, 2, n_amplitudes)
    field = 2 * np.sin(9 * omega)[:, None, None] + 1.5 * np.cos(30 * amplitude)
    field = np.abs(field + np.array([0.0, 0.3])[:, None])
    chaotic = field > 2.9
    period = np.where(chaotic, 0, 1 + (3 * field).astype(int)).astype(np.uint32)
    counts = np.where(chaotic, most_points, np.minimum(period, most_points)).astype(int)
    noise = np.where(chaotic, rng.random(shape, np.float32), 0)
    spread = np.repeat(np.where(chaotic, 0.5, 0.0).ravel(), counts.ravel()).astype(np.float32)
    base = np.repeat((0.3 * field + amplitude).ravel(), counts.ravel()).astype(np.float32)
    points = base[:, None] * np.linspace(0.3, 1, n, dtype=np.float32)
    points += spread[:, None] * rng.random(points.shape, np.float32)
    values = {name: (field + noise).astype(np.float32) for name in ("drift", "lyapunov")}
    values |= {f"modal_norm_{i}": (field / 4 + noise / 4).astype(np.float32) for i in (1, 2, 3)}
    codes = {
        "motion": np.where(chaotic, MotionClass.CHAOTIC, MotionClass.PERIODIC).astype(np.uint8),
        "period": period,
        "outcome": np.ones(shape, np.uint8),
        "cycles": np.full(shape, 200, np.uint32),
        "contact": (2 * field).astype(np.uint64),
    }
    speed = np.repeat(noise[..., None], n, axis=-1).astype(np.float32)
    return PageData(
        name="full size",
        structure=Structure(n_floors=n),
        omega=omega,
        amplitude=amplitude,
        directions=("up", "down"),
        words=("sweep up", "sweep down"),
        runs={**codes, **values, "counts": counts, "speed": speed},
        points=points,
        thinned={"points": 4, "of_points": 100, "frame_step": 1, "amplitude_step": 1},
    )


def test_five_million_runs_are_fluid(browser, tmp_path):
    text = build_page(full_size_study())
    (tmp_path / "full.html").write_text(text, encoding="utf-8")
    page = open_page(browser, tmp_path / "full.html")
    page.mouse.move(*place(page, 20, 20))
    settle(page)
    first = page.inner_text("#diagram-title"), pixels(page, "#diagrams")
    page.mouse.move(*place(page, 900, 600))
    settle(page)
    assert "(frame 9" in page.inner_text("#diagram-title")
    assert pixels(page, "#diagrams") != first[1]
    # a move before each of the browser's frames: the time from one to the next holds everything,
    # JavaScript, canvases and compositing
    _, idle = page.evaluate(MOVE_AND_TIME, False)
    shown, intervals = page.evaluate(MOVE_AND_TIME, True)
    median, tenth = np.percentile(intervals, [50, 90])
    busy = max(1.0, np.median(idle) / IDLE)
    paint = page.evaluate(
        """() => {
            const start = performance.now();
            for (let i = 0; i < 5; i++) window.explorer.recolour();
            return (performance.now() - start) / 5;
        }"""
    )
    pictures = ROOT / "out"
    pictures.mkdir(exist_ok=True)
    page.screenshot(path=pictures / "explorer.png")
    print(
        f"\n{len(text) / 1e6:.1f} MB; from frame to frame {median:.1f} ms (median of "
        f"{len(intervals)}), {tenth:.1f} ms (9 of 10), idle {np.median(idle):.1f} ms; "
        f"the map recoloured in {paint:.1f} ms"
    )
    assert page.complaints == []
    assert shown > 0.9 * len(intervals)
    assert median < SLOWEST_MEDIAN * busy
    assert tenth < SLOWEST_TENTH * busy
    assert paint < SLOWEST_TENTH * busy
    page.close()


def test_the_page_fits_a_laptop_screen(browser, results_file):
    from PIL import Image

    page = open_page(browser, results_file.with_name("study page.html"))
    settle(page)
    picture = results_file.with_name("laptop.png")
    page.screenshot(path=picture)
    across = page.evaluate("() => document.documentElement.scrollWidth")
    below = page.evaluate(
        "() => Math.max(...['legend', 'numbers', 'portraits', 'map']"
        ".map((id) => document.getElementById(id).getBoundingClientRect().bottom))"
    )
    assert across <= LAPTOP["width"]
    assert below <= LAPTOP["height"]
    with Image.open(picture) as image:
        colours = image.convert("RGB").getcolors(maxcolors=1 << 24)
    drawn = sum(count for count, colour in colours if colour != (255, 255, 255))
    assert drawn > 0.15 * LAPTOP["width"] * LAPTOP["height"]
    page.close()
