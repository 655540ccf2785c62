"""Figures, texts and the explorer of structures that are not the paper's building."""

import json
import math
import shutil
import subprocess
from importlib.resources import files

import numpy as np
import pytest
from reference import reference_points
from scipy.linalg import block_diag

from hpcsweep.dynamics.classify import contact_name
from hpcsweep.figures import labels, palette, style, view
from hpcsweep.figures.coordinates import coordinates
from hpcsweep.figures.diagrams import maps, mesh, metrics, orbit_diagram, phase, sweep
from hpcsweep.figures.explorer.page import _structure
from hpcsweep.figures.labels import MAX_MODES
from hpcsweep.model.adjacent import adjacent
from hpcsweep.model.buildings import Building
from hpcsweep.model.description import in_words
from hpcsweep.model.matrices import Contact
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.linear import LinearOrbit

SWEEP = """
[sweep]
omega = {from = 0.5, to = 0.8, count = 2}
amplitude = {from = 0.02, to = 0.3, count = 6}
directions = ["up", "down"]
transient_cycles = 30
sampling_cycles = 20
max_orbit_period = 4

[output]
poincare = true
contact = true
drift = true
modal_norm = true
lyapunov = true
"""
JOBS = {
    "two sides": """
[structure]
n_floors = 3
stiffness_ratio = [100.0, 200.0, 300.0]
sharpness = inf
mass = [1.0, 1.0, 2.0]
gap = [inf, 0.3, 0.2]
gap_left = [inf, inf, 0.2]
""",
    "pounding": """
[structure]
sharpness = inf
damping_ratio = 0.03
[structure.matrices]
mass = [1.0, 2.0]
stiffness = [[1.0, 0.0], [0.0, 3.0]]
[[structure.contact]]
direction = [1.0, -1.0]
gap = 0.1
stiffness = 200.0
[[structure.contact]]
direction = [0.0, -2.0]
gap = 0.4
stiffness = 200.0
""",
    "bilinear": """
[structure]
n_floors = 1
stiffness_ratio = 3.0
sharpness = inf
gap = 0.0
""",
    "two harmonics": """
[structure]
n_floors = 2
sharpness = inf
stiffness_ratio = 100.0
[forcing]
harmonics = [{order = 1}, {order = 3, amplitude = 0.4, phase = 0.5}]
""",
    "no stop": "[structure]\nn_floors = 2\nsharpness = inf\ngap = inf\n",
}
CAPTIONS = {
    "two sides": "n = 3, beta = (100, 200, 300), m = (1, 1, 2), g = (inf, 0.3, 0.2), "
    "g_L = (inf, inf, 0.2), rho = inf, zeta = 0.05",
    "pounding": "n = 2, 2 contacts, matrices, rho = inf, zeta = 0.03",
    "bilinear": "n = 1, beta = 3, g = 0, rho = inf, zeta = 0.05",
    "two harmonics": "n = 2, beta = 100, rho = inf, zeta = 0.05, harmonics 1, 3",
    "no stop": "n = 2, beta = 1000, g = inf, rho = inf, zeta = 0.05",
}
KEYS = {
    "two sides": "structure.mass = (1, 1, 2)",
    "pounding": "structure.n_floors = 2",
    "bilinear": "structure.n_floors = 1",
}


QUICK = ("pounding",)


@pytest.fixture(
    scope="module",
    params=[name if name in QUICK else pytest.param(name, marks=pytest.mark.slow) for name in JOBS],
)
def general(request, tmp_path_factory):
    """Name and results file of a small study of each structure."""
    from hpcsweep.campaign import run as campaign
    from hpcsweep.job import parse_job
    from hpcsweep.parallel.mpi import Serial

    path = tmp_path_factory.mktemp("general") / "general.h5"
    job = parse_job(JOBS[request.param] + SWEEP, "general", "general")
    assert campaign.run(job, path, Serial()) == 0
    return request.param, path


@pytest.mark.slow
def test_every_figure_and_text_of_any_structure(general, tmp_path, monkeypatch):
    from claims.reading import open_frames

    from hpcsweep import open_results
    from hpcsweep.campaign.summary import summarize
    from hpcsweep.store import StoreError

    name, path = general
    results = open_results(path)
    monkeypatch.setattr(phase, "MAX_CYCLES", 4)  # each is integrated
    picture = tmp_path / "picture.png"
    for module, options in (
        (orbit_diagram.orbit, {"color": "contact"}),
        (phase.phase, {"amplitudes": (0.3,)}),
        (sweep.frames, {}),
        (metrics.metrics, {}),
        (metrics.benefit, {}),
        *((maps.motion_map, {"value": value}) for value in ("contact", "drift")),
    ):
        view.save(module.draw(results, **options), picture)
        assert picture.stat().st_size > 10_000
    with pytest.raises(style.PlotError, match="no ductility: nothing of the structure yields"):
        maps.motion_map.draw(results, value="ductility")
    found = summarize(path)
    assert found["structure"] == CAPTIONS[name]
    json.dumps(found, allow_nan=False)
    with pytest.raises(StoreError, match="claims are about") as refused:
        open_frames(path)
    assert "\n" not in str(refused.value)
    assert KEYS.get(name, "structure.n_floors = 2") in str(refused.value)


def test_the_key_of_grazing_is_there_where_the_curve_is(general):
    from hpcsweep import open_results

    name, path = general
    assert bool(mesh.map_keys(open_results(path))) == (name not in ("bilinear", "no stop"))


@pytest.mark.slow
def test_a_page_tells_the_modal_norms_of_the_lowest_modes(tmp_path):
    from hpcsweep.campaign import run as campaign
    from hpcsweep.figures.explorer.page_data import gather
    from hpcsweep.job import parse_job
    from hpcsweep.parallel.mpi import Serial
    from hpcsweep.store import Frames

    found = {}
    for n in (2, 8):
        path = tmp_path / f"{n}.h5"
        job = parse_job(f"[structure]\nn_floors = {n}\n{SWEEP}", "modes", "modes")
        assert campaign.run(job, path, Serial()) == 0
        found[n] = [name for name in gather(Frames(path)).runs if name.startswith("modal_norm")]
    assert found[2] == ["modal_norm_1", "modal_norm_2"]
    assert found[8] == [f"modal_norm_{mode}" for mode in range(1, MAX_MODES + 1)]


def test_drift_without_stop_is_that_of_a_free_run(general):
    from hpcsweep.job import parse_job

    structure = parse_job(JOBS[general[0]] + SWEEP, "general", "general").structure
    free, omega = structure.without_contacts(), 0.7
    assert free.contacts == ()
    seen = LinearOrbit(free, omega).window(0.3)
    assert metrics.free_drift(structure, omega) == pytest.approx(seen.peak_drift * omega**2 / 0.3)
    assert np.array_equal(metrics.free_modal_norms(structure, omega), seen.modal_norm)


def test_names_of_contact_sets():
    both = Structure(3, gap=(math.inf, 1.0, 1.0), gap_left=(math.inf, 0.5, 0.5)).contact_labels
    assert both == ("", "2", "3", "", "2L", "3L")
    names = {0b110: "C23", 0b010000: "C2L", 0b110010: "C2,23L", 0: "none"}
    assert {key: contact_name(key, both) for key in names} == names
    many = Structure(20, gap_left=1.0).contact_labels
    tall = sum(1 << k for k in [*range(6, 12), 14, 16, 18, *range(25, 30)])
    assert contact_name(tall, 20) == "C7-12,15,17,19"
    assert contact_name(tall, many) == "C7-12,15,17,19,6-10L"
    assert contact_name(tall, many, 12) == "C7-12,15,..."
    assert contact_name((1 << 64) - 1, 64) == "C1-64"
    matrices = Structure.from_matrices(
        (1.0, 1.0), np.eye(2), [Contact((1, -1), 0.1, 1.0), Contact((0, 1), 0.1, 1.0)]
    )
    assert contact_name(0b11, matrices.contact_labels) == "C12"


def test_colours_of_contact_sets_know_all_contacts():
    assert palette.contact_colour(5, ("1", "2", "3")) == palette.contact_colour(5, 3)
    labels = Structure(2, gap_left=1.0).contact_labels
    colours = [palette.contact_colour(key, labels) for key in range(16)]
    assert len(set(colours)) == 16
    assert colours == [palette.contact_colour(key, 4) for key in range(16)]


def test_floors_are_chosen_and_fit_a_page():
    twenty, pair = [str(i) for i in range(1, 21)], ["A1", "A2", "B1"]
    assert style.choose_floors(twenty[:5]) == [0, 1, 2, 3, 4]
    assert style.choose_floors(twenty) == [0, 9, 19]
    assert style.choose_floors(twenty, [7, "2", 7]) == [1, 6]
    assert style.choose_floors(pair, ["B1", "1"]) == [0, 2]
    with pytest.raises(style.PlotError, match=r"^--floor 21: must be from 1 to 20$"):
        style.choose_floors(twenty, [21])
    with pytest.raises(
        style.PlotError, match=r"^--floor B2: .* from 1 to 3, or one of A1, A2, B1$"
    ):
        style.choose_floors(pair, ["B2"])


@pytest.mark.slow
def test_twenty_floors_fit_a_page(tmp_path, drawn_figure):
    from hpcsweep import open_results
    from hpcsweep.campaign import run as campaign
    from hpcsweep.commands.cli import main
    from hpcsweep.job import parse_job
    from hpcsweep.parallel.mpi import Serial

    text = SWEEP.replace("0.3, count = 6", "0.04, count = 4").replace("= 30", "= 3")
    job = parse_job(
        f"[structure]\nn_floors = 20\nsharpness = inf\n{text.replace('cycles = 20', 'cycles = 8')}",
        "tall",
        "tall",
    )
    path = tmp_path / "tall.h5"
    assert campaign.run(job, path, Serial()) == 0
    results = open_results(path)
    sizes = {
        (orbit_diagram.orbit, ()): 3,
        (orbit_diagram.orbit, tuple(range(1, 21))): 20,
        (phase.phase, ()): 3,
        (phase.phase, (20,)): 1,
        (metrics.metrics, None): 2,
    }
    for (module, floors), panels in sizes.items():
        options = {} if floors is None else {"floors": floors}
        more = {"amplitudes": (0.03,)} if module is phase.phase else {}
        figure = drawn_figure(module, results, **options, **more)
        assert len(figure.axes) == panels
        assert max(figure.get_size_inches()) <= 12
    assert main(["plot", str(path), "--kind", "orbit", "--floor", "1", "--floor", "21"]) == 2
    assert main(["animate", str(path), "--floor", "0"]) == 2


def test_stops_of_a_coordinate():
    structure = Structure(2, gap=(1.0, math.inf), gap_left=(0.5, -0.2))
    floors = [each.stops(structure) for each in coordinates(structure)]
    assert floors == [([1.0], [-0.5]), ([], [0.2])]
    contacts = [Contact((0, -2), 0.4, 1.0), Contact((3, -3), 0.3, 1.0), Contact((-1, 1), 0.2, 1.0)]
    pounding = Structure.from_matrices((1.0, 1.0), np.eye(2), contacts)
    rows = coordinates(pounding, ["2-1", "1", "2", "contact:2", "drift:2"])
    expected = [], [], [], [-0.2], [0.2], [-0.1], [0.3], [-0.6], [], [-0.2]
    found = [side for each in rows for side in each.stops(pounding)]
    for values, places in zip(found, expected, strict=True):
        assert values == pytest.approx(places)


def test_coordinates_are_rows_of_the_state():
    pair = [Building([1.0, 2.0], 9.0, name=name) for name in "AB"]
    structure = adjacent(pair, gap=0.1, stiffness=1e3)
    states = np.random.default_rng(0).standard_normal((3, 5, 8))
    u, v = states[..., :4], states[..., 4:]
    chosen = ["A2", 3, "A2-B2", "contact:A1-B1", "drift:A2", "A2-B2"]
    shown = coordinates(structure, chosen)
    directions = dict(zip(structure.contact_names.values(), structure.directions, strict=True))
    drifts = dict(zip(structure.storey_names, structure.drift_rows, strict=True))
    rows = [np.eye(4)[1], np.eye(4)[2], np.eye(4)[1] - np.eye(4)[3]]
    rows += [directions["A1-B1"], drifts["A2"]]
    assert len(shown) == len(rows)
    for each, row in zip(shown, rows, strict=True):
        np.testing.assert_allclose(each.of(states), u @ row, atol=1e-15)
        np.testing.assert_allclose(each.of(states, is_velocity=True), v @ row, atol=1e-15)
    assert labels.displacement(structure, shown[2].symbol).startswith(
        r"$u_{\mathrm{A2}} - u_{\mathrm{B2}}$"
    )
    for word, said in (
        ("contact:C", r"^--row contact:C: must be one of A1-B1, A2-B2$"),
        ("drift:7", r"^--row drift:7: must be one of A1, A2, B1, B2$"),
        ("A2-C2", r"^--row A2-C2: must be a floor, A1, A2, B1, B2, a difference of two, contact:"),
        ("1-1", r"^--row 1-1: must be a floor, A1"),
        ("7", r"^--floor 7: must be from 1 to 4, or one of A1, A2, B1, B2$"),
    ):
        with pytest.raises(style.PlotError, match=said):
            coordinates(structure, [word])


def test_words():
    tall = Structure(6, mass=(1, 1, 1, 1, 1, 3), gap=(math.inf,) * 5 + (0.5,), rayleigh=(0.1, 0.2))
    reported = dict(in_words(tall))
    assert (reported["m"], reported["g"]) == ("1 to 3", "0.5 or inf")
    assert reported[""] == "Rayleigh damping (0.1, 0.2)"
    assert style.parameters(Structure(), 0.5) == (
        r"$n$ = 3,  $\beta$ = 1000,  $\rho$ = 10000,  $\zeta$ = 0.05,  $\Omega$ = 0.5"
    )
    long = Structure(4, (1, 2, 3, 4), mass=(1, 2, 3, 4), storey_stiffness=(1, 2, 3, 4), gap=2.0)
    figure = style.head(style.new_figure(1, 2.0, 4.5)[0], style.parameters(long, 0.5))
    assert figure.get_suptitle().count("\n") == 1


def find_node() -> str:
    """Node: the system's, or playwright's own."""
    found = shutil.which("node")
    if found is None:
        from playwright._impl._driver import compute_driver_executable

        found = compute_driver_executable()[0]
    return found


def page_structures():
    stiffness = block_diag(Structure(1).stiffness_matrix, 2 * Structure(2).stiffness_matrix)
    contacts = [Contact((1, -1, 0), 0.1, 50.0), Contact((0, 0, -2), 0.3, 30.0)]
    yield Structure(2, 100.0, 50.0)
    yield Structure(2, 100.0, 50.0, mass=(1.0, 3.0), gap=0.2, gap_left=(0.1, math.inf))
    yield Structure.from_matrices(
        [[1, 0.1, 0], [0.1, 2, 0], [0, 0, 2]],
        stiffness,
        contacts,
        damping_ratio=0.03,
        sharpness=80.0,
        harmonics=((1, 1.0, 0.0), (3, 0.5, 0.7)),
    )


@pytest.mark.parametrize("structure", list(page_structures()))
def test_the_page_integrates_any_structure(structure, tmp_path):
    """Its equations against the reference solution, over one period."""
    node = find_node()
    script = (files("hpcsweep.figures.explorer") / "assets" / "integrate.js").read_text()
    state = 0.05 * np.ones(2 * structure.n_floors)
    call = (
        f"const z = Float64Array.from({state.tolist()});"
        f"new Integrator({json.dumps(_structure(structure))}, 0.4, 0.8).advance(z);"
        "console.log(JSON.stringify([...z]));"
    )
    (tmp_path / "run.js").write_text(f"{script}\n{call}")
    reported = subprocess.run(
        [node, str(tmp_path / "run.js")], capture_output=True, text=True, check=True, timeout=60
    )
    exact = reference_points(structure, 0.4, 0.8, state, 1)[0]
    assert np.abs(np.array(json.loads(reported.stdout)) - exact).max() < 1e-6
