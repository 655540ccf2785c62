"""The explorer of other studies and structures in a browser: many floors, units, attractors."""

import pytest
from test_explore import LAPTOP, numbers, open_page, pixels, settle
from tools import hpcsweep

from hpcsweep import open_results
from hpcsweep.figures.palette import series_colour

pytestmark = pytest.mark.browser

RUNS = """
[sweep]
{omega}
amplitude = {amplitude}
transient_cycles = 30
sampling_cycles = 20
max_orbit_period = 6
"""
FIVE = "[structure]\nn_floors = 5\ngap_left = 1.0\nstiffness_ratio = 300.0\nsharpness = inf\n"
METRES = """
[units]
length = "m"
mass = "kg"
time = "s"
[[building]]
name = "A"
mass = [2e5, 2e5, 2e5]
storey_stiffness = [3e8, 3e8, 3e8]
[[building]]
name = "B"
mass = [2e5, 2e5, 2e5]
storey_stiffness = [4e8, 4e8, 4e8]
[pounding]
gap = [0.02, 0.01, 0.0002]
stiffness = 2e9
"""
JOBS = {
    "five": FIVE
    + RUNS.format(omega="omega = [0.28, 0.3]", amplitude="{from = 0.002, to = 0.03, count = 8}"),
    "metres": METRES
    + RUNS.format(omega="frequency = [2.0, 3.0]", amplitude="{from = 0.1, to = 4.0, count = 8}"),
    "attractors": "[study]\nkind = 'attractors'\nstarts = 16\n[structure]\nn_floors = 2\n"
    "stiffness_ratio = 300.0\nsharpness = inf\n"
    + RUNS.format(omega="omega = 0.55", amplitude="{from = 0.1, to = 0.2, count = 8}"),
}


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Results files and pages by name."""
    folder = tmp_path_factory.mktemp("kinds")
    for name, text in JOBS.items():
        (folder / f"{name}.toml").write_text(text)
        for command in (("run", f"{name}.toml"), ("explore", f"{name}.h5")):
            done = hpcsweep(0, *command, cwd=folder)
            assert done.returncode == 0, done.stderr
    return folder


@pytest.fixture
def opened(browser, made, request):
    page = open_page(browser, made / f"{request.param}.html")
    settle(page)
    yield page
    assert page.complaints == []
    page.close()


def labels(page) -> list[str]:
    """Labels of the vertical axes of the orbit diagrams, from the top."""
    return page.evaluate(
        "() => window.explorer.diagrams.panels.map(({ plot }) => plot.axes[1].label)"
    )


def bottom(page, *elements: str) -> float:
    return page.evaluate(
        "(ids) => Math.max(...ids.map((id) => "
        "document.getElementById(id).getBoundingClientRect().bottom))",
        list(elements),
    )


@pytest.mark.parametrize("opened", ["five"], indirect=True)
def test_all_floors_can_be_shown_the_top_one_at_first(opened):
    page = opened
    choices = page.eval_on_selector_all("#floors option", "o => o.map((x) => x.textContent)")
    assert choices == ["1, 3, 5", "1–3", "4–5", "all"]
    assert [one.split(" ")[0] for one in labels(page)] == ["u₅(jT)", "u₃(jT)", "u₁(jT)"]
    assert bottom(page, "portraits", "map", "legend") <= LAPTOP["height"]
    page.select_option("#floors", "3")
    settle(page)
    assert labels(page) == ["u₅", "u₄", "u₃", "u₂", "u₁"]
    assert "u(jT) [gaps]" in page.inner_text("#diagram-legend")
    assert len(pixels(page, "#portraits")) == 5
    rows = page.evaluate(
        "() => new Set(window.explorer.portraits.panels.map(({ plot }) => "
        "plot.root.getBoundingClientRect().top)).size"
    )
    assert rows == 2
    assert page.evaluate("() => document.documentElement.scrollWidth") <= LAPTOP["width"]


@pytest.mark.parametrize("opened", ["five"], indirect=True)
def test_legends_wrap_and_name_the_grazing_line(opened):
    page = opened
    for selector in ("#legend", "#diagram-legend"):
        assert "grazing" in page.inner_text(selector)
    page.select_option("#quantity", "contact")
    settle(page)
    right = page.evaluate(
        "() => Math.max(...[...document.getElementById('legend').children]"
        ".map((one) => one.getBoundingClientRect().right))"
    )
    assert right <= page.evaluate(
        "() => document.getElementById('left').getBoundingClientRect().right"
    )
    assert "Click" in page.inner_text("#hint")


@pytest.mark.parametrize("opened", ["metres"], indirect=True)
def test_units_hertz_and_names_of_contacts_are_told(opened, made):
    page = opened
    title = page.inner_text("#diagram-title")
    omega = float(title.split("Ω = ")[1].split(" ")[0])
    assert f"rad/s = {omega / 6.283185307:.6g} Hz" in title
    assert " m/s², Ω = " in page.inner_text("#readout")
    results = open_results(made / "metres.h5")
    at = results.contact.isel(direction=0).argmax(("omega", "amplitude"))
    frame, amplitude = int(at["omega"]), int(at["amplitude"])
    page.evaluate("([f, a]) => window.explorer.choose(f, a)", [frame, amplitude])
    settle(page)
    contact = int(results.contact.isel(direction=0, omega=frame, amplitude=amplitude))
    members = [k + 1 for k in range(3) if contact >> k & 1]
    assert members
    named = f"C{''.join(map(str, members))}: {', '.join(f'A{k}-B{k}' for k in members)}"
    assert numbers(page)["contact set C"] == named
    # the numbers beside a diagram have room: its axis is wider than they are
    widths = page.evaluate(
        "() => window.explorer.diagrams.panels.map(({ plot }) => "
        "[plot.axes[1]._size, plot.axes[1]._values.map((v) => v.length)])"
    )
    assert len({size for size, _ in widths}) == 1
    assert all(size >= 7 * max(letters) for size, letters in widths)


@pytest.mark.parametrize("opened", ["attractors"], indirect=True)
def test_an_attractor_keeps_its_place_and_colour_along_the_amplitudes(opened, made):
    page = opened
    ids = open_results(made / "attractors.h5").attractor_id.values[0, 0]
    shares = open_results(made / "attractors.h5").share.values[0, 0]
    assert (ids > 0).sum() > len(ids)
    page.select_option("#points", "direction")
    settle(page)
    colours = page.evaluate("() => window.explorer.study.colours.directions")
    assert colours == [series_colour(k) for k in range(len(colours))]
    place: dict[int, int] = {}
    followed = 0
    for a, own in enumerate(ids):
        told = page.evaluate(
            "(a) => { const { study } = window.explorer; return study.directions.map((_, d) => "
            "study.value('share', study.run(0, d, a))); }",
            a,
        )
        here: dict[int, int] = {}
        for number, share in zip(own[own > 0].tolist(), shares[a][own > 0], strict=True):
            near = [d for d, one in enumerate(told) if one is not None and abs(one - share) < 1e-3]
            assert near
            if number in place:
                assert place[number] in near
                followed += 1
            if len(near) == 1 or number not in place:
                here[number] = near[0]
            else:
                here[number] = place[number]
        place = here
    assert followed >= len(ids) - 1
