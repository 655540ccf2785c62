import inspect
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib import image
from together import together
from tools import hpcsweep

from hpcsweep import open_results
from hpcsweep.campaign import run as campaign
from hpcsweep.campaign.summary import summarize
from hpcsweep.dynamics.classify import MotionClass, contact_name
from hpcsweep.figures import style, view
from hpcsweep.figures.diagrams import maps, metrics, orbit_diagram, phase, sweep
from hpcsweep.figures.diagrams.regions import Region, coexistence, contact_regions
from hpcsweep.figures.palette import (
    DIRECTIONS,
    MOTION_COLOURS,
    MOTION_NAMES,
    contact_colour,
    motion_index,
)
from hpcsweep.figures.style import classes_of
from hpcsweep.job import parse_job
from hpcsweep.model.structure import Structure
from hpcsweep.parallel.mpi import Serial
from hpcsweep.solvers.outcome import Outcome

OWN_JOBS = ("vary", "measures")
"""Figures of results that not every job holds."""


def test_contact_regions_are_maximal_and_short_ones_are_absorbed():
    up = [0] * 5 + [4] * 6 + [6] + [4] * 5 + [6] * 8
    down = [0] * 5 + [4] * 12 + [6] * 4 + [7] * 4
    contact = np.array([up, down])
    valid, never = np.ones_like(contact, bool), np.zeros(25, bool)
    assert contact_regions(contact, valid, 3, never) == [
        Region(0, 4, (0,)),
        Region(5, 16, (4,)),
        Region(17, 20, (6,)),
        Region(21, 24, (6, 7)),
    ]
    valid[:, 21:] = False
    assert contact_regions(contact, valid, 3, never)[-1] == Region(17, 20, (6,))


def test_contacts_that_set_in_one_after_the_other_are_not_free_of_contact():
    sets = np.array([0] * 6 + [8] * 2 + [12] * 2 + [14] * 5)
    contact = np.array([sets, sets])
    valid, never = np.ones_like(contact, bool), np.zeros(15, bool)
    assert contact_regions(contact, valid, 3, never) == [
        Region(0, 5, (0,)),
        Region(6, 9, (8,)),
        Region(10, 14, (14,)),
    ]
    # lost again at once: a single run
    contact[:, 8:] = 0
    assert contact_regions(contact, valid, 3, never) == [Region(0, 14, (0,))]


def test_two_solutions_of_one_contact_set_are_a_region_if_they_last():
    contact = np.full((2, 100), 7)
    valid = np.ones_like(contact, bool)
    apart = np.zeros(100, bool)
    apart[20:21] = True
    assert contact_regions(contact, valid, 1, apart) == [Region(0, 99, (7,))]
    apart[60:90] = True
    assert contact_regions(contact, valid, 1, apart) == [
        Region(0, 59, (7,)),
        Region(60, 89, (7, 7)),
        Region(90, 99, (7,)),
    ]
    contact[1, 60:] = 6
    assert contact_regions(contact, valid, 1, apart) == [
        Region(0, 59, (7,)),
        Region(60, 99, (7, 6)),
    ]


def test_coexistence_compares_orbits_not_their_order():
    import xarray

    kinds = MotionClass.PERIODIC, MotionClass.CHAOTIC, MotionClass.UNDECIDED
    p, c, u = (int(kind) for kind in kinds)
    classes = np.array([[p, p, p, p, c, c, u], [p, p, p, c, p, c, p]])
    period = np.where(classes == p, 2, 0)
    points = np.zeros((2, 7, 4, 2))
    points[:, :, 1] = 1.0
    points[1, 0, :2] = points[0, 0, 1::-1]
    points[1, 1, 1] = 1.5
    period[1, 2] = 1
    frame = xarray.Dataset(
        {
            "poincare": (("direction", "amplitude", "point", "state"), points),
            "n_points": (("direction", "amplitude"), np.where(period > 0, period, 4)),
            "orbit_period": (("direction", "amplitude"), period),
        },
        {"omega": 1.0, "amplitude": np.arange(7.0)},
    )
    expected = [False, True, True, True, True, False, False]

    def units(omega, amplitude, place):
        return np.ones(2)

    assert coexistence(frame, classes, units).tolist() == expected
    assert not coexistence(frame.isel(direction=[0]), classes[:1], units).any()


def test_shares_are_never_rounded_to_nothing_or_all():
    values = (0, 1, 1e-6, 0.99999, 0.0012, 0.123)
    assert [style.percent(v) for v in values] == [
        "0 %",
        "100 %",
        "< 0.01 %",
        "> 99.9 %",
        "0.12 %",
        "12.3 %",
    ]


def test_names():
    assert contact_name(0b110, 3) == "C23"
    assert contact_name(0, 3) == "none"
    assert contact_name(0b100000000011, 12) == "C1,2,12"
    assert [orbit_diagram.roman(k) for k in (1, 4, 8, 9, 14, 42)] == [
        "i",
        "iv",
        "viii",
        "ix",
        "xiv",
        "xlii",
    ]


def legend_texts(figure) -> list[str]:
    texts = []
    for legend in [*figure.legends, *(a.get_legend() for a in figure.axes if a.get_legend())]:
        texts += [text.get_text() for text in (legend.get_title(), *legend.get_texts())]
    return texts


def assert_nothing_overlaps(figure):
    """Title, legends and panels with their labels each have a place of their own."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    renderer = FigureCanvasAgg(figure).get_renderer()
    figure.draw(renderer)
    panels = [axis.get_tightbbox(renderer) for axis in figure.axes if axis.get_visible()]
    others = [legend.get_window_extent(renderer) for legend in figure.legends]
    others.append(figure._suptitle.get_window_extent(renderer))
    for place, box in enumerate(others):
        assert box.x0 >= 0
        assert box.x1 <= figure.bbox.x1
        for other in [*panels, *others[place + 1 :]]:
            shared = [
                min(box.x1, other.x1) - max(box.x0, other.x0),
                min(box.y1, other.y1) - max(box.y0, other.y0),
            ]
            assert min(shared) < 3, (box, other)


@pytest.mark.parametrize(
    "color",
    ["period", *(pytest.param(c, marks=pytest.mark.slow) for c in ("direction", "contact"))],
)
def test_orbit_diagram_is_drawn(results, tmp_path, color):
    from PIL import Image

    path = tmp_path / "o.png"
    with view.viewing(view.DPI):
        view.save(orbit_diagram.orbit.draw(results.isel(omega=[2]), color=color), path)
    with Image.open(path) as picture:
        assert picture.width > 1000
        pixels = np.asarray(picture.convert("RGB")).reshape(-1, 3)
    contact = contact_colour(int(results["contact"].values[:, 2].max()), 2)
    expected = {"direction": DIRECTIONS["up"], "contact": contact, "period": MOTION_COLOURS[1]}
    assert (pixels == [int(expected[color][k : k + 2], 16) for k in (1, 3, 5)]).all(axis=1).any()


def test_what_is_not_in_the_file_cannot_be_drawn(results):
    with pytest.raises(style.PlotError, match=r"output\.poincare"):
        orbit_diagram.orbit.draw(results.drop_vars("poincare"))
    with pytest.raises(style.PlotError, match="no run"):
        orbit_diagram.orbit.draw(results.assign(outcome=results["outcome"] * 0))


KINDS = [
    (orbit_diagram.orbit, {}),
    (phase.phase, {"amplitudes": [0.05, 0.3]}),
    (sweep.frames, {}),
    (maps.motion_map, {}),
    (maps.motion_map, {"value": "lyapunov"}),
    *(
        pytest.param(maps.motion_map, {"value": value}, marks=pytest.mark.slow)
        for value in ("contact", "drift", "modal_norm")
    ),
    (metrics.metrics, {}),
    (metrics.benefit, {}),
]


@pytest.mark.slow
@pytest.mark.parametrize(("module", "options"), KINDS)
def test_every_figure_names_its_axes_its_parameters_and_what_is_undecided(
    results, drawn_figure, module, options
):
    figure = drawn_figure(module, results, **options)
    assert_nothing_overlaps(figure)
    title = figure._suptitle.get_text()
    assert r"$\beta$ = 300" in title
    assert r"$\zeta$ = 0.05" in title
    assert any("undecided" in text for text in legend_texts(figure))
    bottom = [axis.get_xlabel() for axis in figure.axes if axis.get_xlabel()]
    assert bottom
    assert all("[" in label or "[gaps" in title or "in gaps" in title for label in bottom)


def test_map_shows_the_class_of_every_run(results, drawn_figure):
    figure = drawn_figure(maps.motion_map, results.isel(direction=[1]))
    shown = figure.axes[0].collections[0].get_array().filled(-1).reshape(4, 11)
    classes = classes_of(results)[1]
    expected = motion_index(classes, results["orbit_period"].values[1])
    assert np.array_equal(shown, expected)
    free = 100 * (classes == MotionClass.NO_CONTACT).mean()
    assert f"no contact  {free:.1f} %" in legend_texts(figure)


def test_map_sorts_frames_and_hatches_what_is_not_computed(results, drawn_figure):
    outcome = results["outcome"].copy()
    outcome[0, 2, 3] = Outcome.NOT_COMPUTED
    outcome[0, 2, 4] = Outcome.STEP_LIMIT
    mixed = results.assign(outcome=outcome).isel(omega=[2, 0, 3, 1])
    figure = drawn_figure(maps.motion_map, mixed)
    shown = figure.axes[0].collections[0].get_array().reshape(4, 11)
    assert np.argwhere(np.ma.getmaskarray(shown)).tolist() == [[2, 3]]
    assert MOTION_NAMES[shown[2, 4]] == "failed"
    texts = legend_texts(figure)
    assert any(text.startswith("not computed") for text in texts)
    assert any(text.startswith("failed") for text in texts)
    sound = legend_texts(drawn_figure(maps.motion_map, results))
    assert not any(text.startswith("failed") for text in sound)


def test_without_contact_drift_and_modal_norms_are_the_closed_form(results):
    classes = classes_of(results)
    settled = results["orbit_period"].values == 1
    free = np.argwhere((classes == MotionClass.NO_CONTACT) & settled)
    assert len(free) > 5
    ratio = metrics.drift_ratio(results)
    structure = style.job_of(results).structure
    for at in map(tuple, free):
        assert ratio[at] == pytest.approx(1, rel=1e-4)
        closed = metrics.free_modal_norms(structure, float(results["omega"][at[1]]))
        assert np.allclose(results["modal_norm"].values[at], closed, rtol=0, atol=1e-4)
    undamped = Structure(damping_ratio=0.0)
    resonance = float(undamped.frequencies[0])
    assert np.isnan(metrics.free_drift(undamped, resonance))
    assert np.isnan(metrics.free_modal_norms(undamped, resonance)).all()


def test_benefit_counts_the_runs_it_shows(results, drawn_figure):
    figure = drawn_figure(metrics.benefit, results)
    chosen = classes_of(results)[0] == MotionClass.PERIODIC
    chosen &= results["orbit_period"].values[0] == 1
    ratio = metrics.drift_ratio(results)[0][chosen]
    assert ratio.size
    assert f"of {ratio.size} runs" in figure.axes[1].get_title()
    shown = figure.axes[1].collections[0].get_array().filled(-1).ravel()
    assert (shown >= 2).sum() == ratio.size
    assert np.isin(shown, (2, 3)).sum() == (ratio <= 1).sum()


def test_portraits_are_closed_and_pass_through_the_stored_points(results, drawn_figure):
    frame = results.isel(omega=2)
    structure = style.job_of(results).structure
    classes = classes_of(results)[:, 2]
    run = np.argwhere((classes == MotionClass.PERIODIC) & (frame["contact"].values > 0))[-1]
    points, curves = phase.orbit_curves(frame, phase.DrawnRun(*run), structure)
    assert np.abs(curves[:, -1] - np.roll(points, -1, axis=0)).max() < 1e-5
    touching = [i for i in range(2) if int(frame["contact"].values[tuple(run)]) >> i & 1]
    assert np.all(curves[:, :, touching].max(axis=(0, 1)) >= 1)
    amplitude = float(frame["amplitude"][run[1]])
    figure = drawn_figure(
        phase.phase, results.isel(omega=[2]), amplitudes=[amplitude], direction="down"
    )
    assert len(figure.axes) == 2
    for axis in figure.axes:
        assert axis.get_xlim()[1] > 1
        assert any(list(line.get_xdata()) == [1, 1] for line in axis.lines)


def test_the_asked_period_is_found_in_the_middle_of_its_longest_stretch(results):
    frame = results.isel(omega=0, amplitude=slice(0, 10))
    period = np.array([[1, 1, 1, 1, 2, 2, 0, 2, 2, 2], [1, 1, 1, 1, 1, 1, 1, 1, 4, 4]])
    kinds = np.where(period > 0, MotionClass.PERIODIC, MotionClass.CHAOTIC)
    kinds[:, :4] = MotionClass.NO_CONTACT
    frame = frame.assign(orbit_period=(("direction", "amplitude"), period))
    assert phase.find_period(frame, kinds, 2) == phase.DrawnRun(0, 8)
    assert phase.find_period(frame, kinds, 1) == phase.DrawnRun(1, 5)
    assert phase.find_period(frame, kinds, 1, "up") == phase.DrawnRun(0, 1)
    with pytest.raises(style.PlotError, match=r"--period 5: .* periods that occur: 1, 2, 4$"):
        phase.find_period(frame, kinds, 5)
    with pytest.raises(style.PlotError, match=r"sweep up .* occur: 1, 2$"):
        phase.find_period(frame, kinds, 4, "up")


@together(
    "arguments, words",
    [
        (["--kind", "map", "--period", "3"], ("--period", "--kind map", "only with: phase")),
        (
            ["--kind", "map", "--row", "2-1"],
            ("--floor or --row does not go with --kind map, only",),
        ),
        (["--amplitude", "0.1"], ("--amplitude", "--kind orbit", "phase")),
        (["--kind", "phase"], ("--amplitude or --period",)),
        (["--kind", "phase", "--amplitude", "7"], ("--amplitude 7", "0.02 to 0.3")),
        (["--kind", "phase", "--period", "63"], ("--period 63", "periods that occur: 1")),
        (["--kind", "frames", "--floor", "3"], ("--floor 3", "1 to 2")),
        (["--kind", "phase", "--period", "0"], ("--period", "at least 1")),
    ],
)
def test_mistakes_take_one_line_and_write_nothing(file, tmp_path, capsys, arguments, words):
    from hpcsweep.commands.cli import main

    output = tmp_path / "o.png"
    try:
        code = main(["plot", str(file), "-o", str(output), *arguments])
    except SystemExit as stop:
        code = stop.code
    assert code == 2
    said = capsys.readouterr().err
    assert said.startswith("hpcsweep: error: ")
    assert said.count("\n") == 1
    for word in words:
        assert word in said
    assert not output.exists()


ONE_RUN = "time", "loop", "section", "spectrum"


@pytest.mark.slow
def test_every_kind_is_drawn_from_the_command_line(file, tmp_path, capsys):
    from hpcsweep import open_results
    from hpcsweep.commands.cli import main
    from hpcsweep.figures.options import figures

    # those that need a job of their own are drawn in test_vary_map.py and test_measures_figure.py
    kinds = [
        n
        for n, figure in figures().items()
        if "motions" in figure.draws and n not in ("vary", "measures")
    ]
    assert len(kinds) == 11
    largest = ["--amplitude", str(float(open_results(file)["amplitude"].max()))]
    more = {"phase": ["--period", "1"], **dict.fromkeys(ONE_RUN, largest)}
    for kind in kinds:
        output = tmp_path / f"{kind}.png"
        extra = more.get(kind, [])
        assert main(["plot", str(file), "--kind", kind, "-o", str(output), *extra]) == 0
        assert capsys.readouterr().out.strip() == str(output)
        assert output.stat().st_size > 10_000


@pytest.mark.slow
def test_every_kind_is_drawn_of_single_points(tmp_path):
    """A study without sweeps has one direction, with a colour and words of its own."""
    from tools import SMALL

    from hpcsweep import open_results
    from hpcsweep.campaign import run as campaign
    from hpcsweep.commands.cli import main
    from hpcsweep.figures.explorer.page import build_page
    from hpcsweep.figures.explorer.page_data import gather
    from hpcsweep.figures.options import figures
    from hpcsweep.job import parse_job
    from hpcsweep.parallel.mpi import Serial
    from hpcsweep.store import Frames
    from hpcsweep.studies.points import START

    path = tmp_path / "points.h5"
    text = f'{SMALL}lyapunov = true\n[study]\nkind = "points"\n'
    assert campaign.run(parse_job(text, "points", "points"), path, Serial()) == 0
    results = open_results(path)
    assert [str(name) for name in results["direction"].values] == [START]
    # those that need a job of their own are drawn in test_vary_map.py and test_measures_figure.py
    kinds = [
        n
        for n, figure in figures().items()
        if "motions" in figure.draws and n not in ("vary", "measures")
    ]
    assert len(kinds) == 11
    largest = ["--amplitude", str(float(results["amplitude"].max()))]
    more = {"phase": ["--period", "1"], **dict.fromkeys(ONE_RUN, largest)}
    for kind in kinds:
        output = tmp_path / f"{kind}.png"
        extra = more.get(kind, [])
        assert main(["plot", str(path), "--kind", kind, "-o", str(output), *extra]) == 0
        assert output.stat().st_size > 10_000
    page = build_page(gather(Frames(path)))
    assert DIRECTIONS[START] in page
    assert "each from the initial state" in page
    film = tmp_path / "film.gif"
    assert main(["animate", str(path), "-o", str(film), "--width", "320", "--fps", "5"]) == 0
    assert film.stat().st_size > 1000


def test_every_figure_says_what_it_is_and_the_help_tells_it(capsys):
    from hpcsweep.commands.cli import main
    from hpcsweep.figures.options import figures

    with pytest.raises(SystemExit) as stop:
        main(["plot", "--help"])
    assert stop.value.code == 0
    said = capsys.readouterr().out
    known = figures()
    assert set(known) >= {"orbit", "phase", "frames", "map", "metrics", "benefit"}
    assert next(iter(known)) == "orbit"
    flags = {}
    for name, figure in known.items():
        first, words = figure.help[0].lower(), figure.help[1:40]
        assert f"\n  {name:10} {first}{words}" in said
        load, draw = inspect.signature(figure.load), inspect.signature(figure.draw)
        for option in figure.options:
            assert option.keyword in {**load.parameters, **draw.parameters}, (name, option.flag)
            assert option.flag in said
            # one flag is one option, so that its help and its meaning are the same everywhere
            assert flags.setdefault(option.flag, option) == option
            load.bind("file", **{option.keyword: None})
            draw.bind("results", **{option.keyword: None})


def test_the_figures_are_loaded_only_for_plot():
    """Every other command starts without numpy."""
    code = "import sys; from hpcsweep.commands.cli import build_parser; build_parser()"
    code += ".parse_args(['status', 'x.h5']); assert 'numpy' not in sys.modules"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0


def test_a_map_needs_two_amplitudes_and_the_variables_that_it_draws(results):
    with pytest.raises(style.PlotError, match="at least 2 amplitudes"):
        maps.motion_map.draw(results.isel(amplitude=[0]))
    with pytest.raises(style.PlotError, match="up only"):
        style.direction_index(["up"], "down")
    with pytest.raises(style.PlotError, match=r"output\.lyapunov"):
        metrics.benefit.draw(results.drop_vars(["lyapunov", "motion"]))


def test_a_map_of_one_frequency_is_a_strip(results, tmp_path):
    heights = []
    for name, shown in (("map", results), ("strip", results.isel(omega=[0]))):
        view.save(maps.motion_map.draw(shown), tmp_path / f"{name}.png")
        heights.append(image.imread(tmp_path / f"{name}.png").shape[0])
    assert heights[1] < 0.6 * heights[0]


def test_no_head_is_wider_than_its_figure():
    figure, _ = style.new_figure(1, 3.0)
    parts = [f"$\\Omega_{{{k}}}$ = {k / 7:.6f}" for k in range(20)]
    style.head(figure, ",  ".join(parts) + "\nthe end")
    text = figure.get_suptitle()
    assert text.endswith("\nthe end")
    assert text.replace(",\n", ",  ").replace("\n", ",  ") == ",  ".join([*parts, "the end"])
    width = figure.bbox.width
    for line in text.split("\n"):
        drawn = figure.text(0, 0, line, fontsize=10)
        assert drawn.get_window_extent(figure.canvas.get_renderer()).width <= width


def test_modal_norms_without_stop_are_the_mean_over_a_period():
    structure, omega = Structure(n_floors=4, damping_ratio=0.03), 0.7
    phase = 2 * np.pi * np.arange(100_000) / 100_000
    modal = structure.modes.T @ structure.linear_steady_state(omega)
    q = np.abs(np.imag(modal[:, None] * np.exp(1j * phase)))
    mean = (q / np.linalg.norm(q, axis=0)).mean(axis=1)
    assert np.allclose(metrics.free_modal_norms(structure, omega), mean, rtol=0, atol=1e-6)


def test_every_figure_of_the_paper_has_its_jobs_and_each_its_command():
    from tools import PAPER

    from hpcsweep.commands.cli import build_parser
    from hpcsweep.figures.options import figures

    names = {f"figure{k}" for k in range(2, 9)} | {"figure6-beta100"}
    names |= {f"{name}-described" for name in names}
    names.add("figure3-classified")
    assert names == {path.stem for path in PAPER.glob("figure*.toml")}
    for name in names:
        lines = (PAPER / f"{name}.toml").read_text().splitlines()
        draw = [line for line in lines if line.startswith("# Draw: hpcsweep plot ")]
        assert len(draw) == 1, name
        options = build_parser().parse_args(draw[0].removeprefix("# Draw: hpcsweep ").split())
        assert options.file.name == f"{name}.h5"
        known = figures()
        given = {o for f in known.values() for o in f.options if getattr(options, o.keyword)}
        assert given <= set(known[options.kind or "orbit"].options)


def test_jobs_as_described_differ_from_those_as_printed_by_the_damping_alone():
    from dataclasses import replace

    from tools import PAPER

    from hpcsweep.job import load_job

    for path in sorted(PAPER.glob("figure[678]*-described.toml")):
        described = load_job(path)
        printed = load_job(path.with_name(path.name.replace("-described", "")))
        w = described.structure.frequencies
        assert np.allclose(described.structure.damping_ratios, 0.05 / (2 * w**2), rtol=1e-12)
        assert np.all(printed.structure.damping_ratios == 0.05)
        assert replace(described.structure, damping_ratio=0.05) == printed.structure
        assert np.array_equal(described.study.omega, printed.study.omega)
        assert np.array_equal(described.study.amplitude, printed.study.amplitude)
        assert described.settings == printed.settings


@pytest.mark.slow
def test_resolution_of_a_picture(file, tmp_path, capsys):
    from PIL import Image

    from hpcsweep.commands.cli import main

    sizes = {}
    for dpi in ("100", "50"):
        output = tmp_path / f"{dpi}.png"
        assert main(["plot", str(file), "-o", str(output), "--dpi", dpi]) == 0
        with Image.open(output) as picture:
            sizes[dpi] = np.array(picture.size)
    assert np.abs(sizes["100"] - 2 * sizes["50"]).max() <= 2
    with pytest.raises(SystemExit) as ended:
        main(["plot", str(file), "--dpi", "20"])
    assert ended.value.code == 2
    assert "--dpi: must be from 50 to 1200, is 20" in capsys.readouterr().err


CHAOTIC = """
[structure]
damping_ratio = [0.12622293348805766, 0.016077603302694768, 0.007699463209247604]
[sweep]
omega = [0.445, 0.446]
amplitude = {from = 0.097, to = 0.1, count = 4}
directions = ["up"]
classify_cycles = %d
"""


@pytest.mark.slow
@pytest.mark.parametrize("cycles", [0, 5000])
def test_chaos_is_told_by_decided_motions_or_by_the_exponent(tmp_path, cycles):
    path = tmp_path / "a.h5"
    assert campaign.run(parse_job(CHAOTIC % cycles, "a", "a"), path, Serial()) == 0
    results = open_results(path)
    assert "lyapunov" not in results
    chaotic = summarize(path)["classes"]["chaotic"]["runs"]
    said = hpcsweep(0, "summary", path).stdout
    captions = style.shares_text(results, classes_of(results))
    hint = "neither motion nor lyapunov"
    if cycles:
        assert chaotic > 0
        assert hint not in said + captions
        metrics.benefit.draw(results)
    else:
        assert chaotic == 0
        assert hint in said
        assert hint in captions
        with pytest.raises(style.PlotError, match="hold no lyapunov"):
            metrics.benefit.draw(results)


def test_a_frequency_far_from_every_frame_is_refused(file, tmp_path, capsys):
    from hpcsweep.commands.cli import main

    picture = tmp_path / "o.png"
    assert main(["plot", str(file), "--omega", "7.5", "-o", str(picture)]) == 2
    assert "--omega 7.5: the results hold" in capsys.readouterr().err
    assert not picture.exists()


def test_a_frequency_between_frames_is_drawn():
    study = SimpleNamespace(frames=np.array([6.3, 12.6, 25.1]), run_dims=("omega", "amplitude"))
    assert [style.frame_at(study, omega) for omega in (None, 9.0, 11.0, 26.0)] == [0, 0, 1, 2]
    for omega in (30.0, np.nan, np.inf, -np.inf):
        with pytest.raises(style.PlotError, match=rf"--omega {omega:g}: .* hold 6.3 to 25.1"):
            style.frame_at(study, omega)


def test_a_head_breaks_between_its_parts_where_it_is_too_wide():
    from matplotlib import pyplot

    text = "n = 3,  beta = 1000\n0.51 % of the points computed, the others inferred; 0.04 % wrong"
    figure = pyplot.figure(figsize=(1, 1))
    style.head(figure, text)
    assert figure.get_suptitle().split("\n") == [
        "n = 3,",
        "beta = 1000",
        "0.51 % of the points computed,",
        "the others inferred;",
        "0.04 % wrong",
    ]
    figure.set_size_inches(9, 1)
    style.head(figure, "short,  and short; too")
    assert figure.get_suptitle() == "short,  and short; too"
    pyplot.close(figure)
