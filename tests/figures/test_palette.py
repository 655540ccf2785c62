"""One colour, one meaning: distinct to every eye, and the same in all figures."""

import re
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from matplotlib.colors import to_hex
from together import together
from tools import spot

from hpcsweep import figures
from hpcsweep.dynamics.classify import CLASS_NAMES, MOTION, MotionClass
from hpcsweep.figures import palette, style
from hpcsweep.figures.diagrams import maps, metrics, orbit_diagram, phase, sweep
from hpcsweep.figures.explorer.page import _pack
from hpcsweep.figures.explorer.page_data import gather
from hpcsweep.store import Frames

EYES = {
    "normal": np.eye(3),
    "protanope": [
        [0.152286, 1.052583, -0.204868],
        [0.114503, 0.786281, 0.099216],
        [-0.003882, -0.048116, 1.051998],
    ],
    "deuteranope": [
        [0.367322, 0.860646, -0.227968],
        [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ],
    "tritanope": [
        [1.255528, -0.076749, -0.178779],
        [-0.078411, 0.930809, 0.147602],
        [0.004733, 0.691367, 0.303900],
    ],
}
"""Machado, Oliveira and Fernandes (2009), severity 1, on linear sRGB."""
TO_XYZ = np.array(
    [
        [0.4124564, 0.3575761, 0.1804375],
        [0.2126729, 0.7151522, 0.0721750],
        [0.0193339, 0.1191920, 0.9503041],
    ]
)


def linear(colours) -> np.ndarray:
    rgb = np.array([[int(c[k : k + 2], 16) for k in (1, 3, 5)] for c in colours]) / 255
    return np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)


def to_lab(rgb: np.ndarray) -> np.ndarray:
    ratio = np.clip(rgb, 0, 1) @ TO_XYZ.T / TO_XYZ.sum(axis=1)
    root = np.where(ratio > (6 / 29) ** 3, np.cbrt(ratio), ratio * (29 / 6) ** 2 / 3 + 4 / 29)
    x, y, z = root.T
    return np.stack([116 * y - 16, 500 * (x - y), 200 * (y - z)], axis=1)


def difference(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """CIEDE2000 (CIE 142-2001) of L*a*b* colours, shape (k, 3) each."""
    (l1, a1, b1), (l2, a2, b2) = one.T, other.T
    mean = (np.hypot(a1, b1) + np.hypot(a2, b2)) / 2
    g = 1.5 - 0.5 * np.sqrt(mean**7 / (mean**7 + 25.0**7))
    c1, c2 = np.hypot(g * a1, b1), np.hypot(g * a2, b2)
    h1, h2 = (np.degrees(np.arctan2(b, g * a)) % 360 for a, b in ((a1, b1), (a2, b2)))
    grey = c1 * c2 == 0
    turn = np.where(grey, 0, (h2 - h1 + 180) % 360 - 180)
    hue = np.where(grey, h1 + h2, (h1 + turn / 2) % 360)
    dl, dc = l2 - l1, c2 - c1
    dh = 2 * np.sqrt(c1 * c2) * np.sin(np.radians(turn / 2))
    light, chroma = (l1 + l2) / 2, (c1 + c2) / 2

    def wave(factor, shift):
        return np.cos(np.radians(factor * hue + shift))

    t = 1 - 0.17 * wave(1, -30) + 0.24 * wave(2, 0) + 0.32 * wave(3, 6) - 0.2 * wave(4, -63)
    sl = 1 + 0.015 * (light - 50) ** 2 / np.sqrt(20 + (light - 50) ** 2)
    sc, sh = 1 + 0.045 * chroma, 1 + 0.015 * chroma * t
    twist = np.radians(60 * np.exp(-(((hue - 275) / 25) ** 2)))
    r = -2 * np.sqrt(chroma**7 / (chroma**7 + 25.0**7)) * np.sin(twist)
    dl, dc, dh = dl / sl, dc / sc, dh / sh
    return np.sqrt(dl**2 + dc**2 + dh**2 + r * dc * dh)


def least(colours, eye: str) -> float:
    """Least difference between any two colours as an eye sees them."""
    seen = to_lab(linear(colours) @ np.transpose(EYES[eye]))
    i, j = np.triu_indices(len(colours), 1)
    return float(difference(seen[i], seen[j]).min())


def test_the_ruler_is_that_of_the_standard():
    """Pairs of Sharma, Wu and Dalal (2005), whose table tests the formula's every branch."""
    pairs = [
        ((50, 2.6772, -79.7751), (50, 0, -82.7485), 2.0425),
        ((50, 2.49, -0.001), (50, -2.49, 0.0011), 7.2195),
        ((50, 2.5, 0), (50, 0, -2.5), 4.3065),
        ((50, 2.5, 0), (73, 25, -18), 27.1492),
        ((60.2574, -34.0099, 36.2677), (60.4626, -34.1751, 39.4387), 1.2644),
        ((22.7233, 20.0904, -46.6940), (23.0331, 14.9730, -42.5619), 2.0373),
        ((2.0776, 0.0795, -1.1350), (0.9033, -0.0636, -0.5514), 0.9082),
    ]
    one, other, expected = (np.array(part, float) for part in zip(*pairs, strict=True))
    assert difference(one, other) == pytest.approx(expected, abs=5e-5)


@together("eye", list(EYES))
def test_three_attractors_of_one_motion_are_apart_to_every_eye(eye):
    for name, colour in palette.MOTIONS:
        shades = [palette.shade(colour, place) for place in range(3)]
        assert shades[0] == colour
        # there is one motion free of contact
        assert name == palette.MOTION_NAMES[0] or least(shades, eye) >= 15


@together("eye, bound", [("normal", 20), ("protanope", 12), ("deuteranope", 12), ("tritanope", 12)])
def test_any_two_motions_are_apart_to_every_eye(eye, bound):
    assert least(palette.MOTION_COLOURS, eye) > bound
    assert least([colour for _, colour in metrics.SHADES], eye) > 8


@together("n_floors", [2, 3])
@together("eye, bound", [("normal", 18), ("protanope", 12), ("deuteranope", 12), ("tritanope", 12)])
def test_any_two_contact_sets_are_apart_to_every_eye(n_floors, eye, bound):
    colours = [palette.contact_colour(c, n_floors) for c in range(2**n_floors)]
    assert least(colours, eye) > bound


def test_contact_sets_of_four_floors_are_apart_and_of_64_are_colours():
    assert least([palette.contact_colour(c, 4) for c in range(16)], "normal") > 12
    every = [1, 1 << 63, (1 << 64) - 1, 0b1011 << 60]
    colours = {palette.contact_colour(c, 64) for c in every}
    assert len(colours) == 4
    assert all(re.fullmatch("#[0-9a-f]{6}", colour) for colour in colours)


def test_more_floors_in_contact_are_darker():
    for n in (1, 3, 5):
        sets = sorted(range(1 << n), key=lambda c: (c.bit_count(), c))
        light = [palette.lightness(palette.contact_colour(c, n)) for c in sets]
        assert np.all(np.diff(light) < 0.5)  # within the rounding to 8 bits
        by_number = [
            [x for c, x in zip(sets, light, strict=True) if c.bit_count() == k]
            for k in range(n + 1)
        ]
        assert all(min(a) > max(b) for a, b in pairwise(by_number))


def test_directions_are_apart_from_what_stands_beside_them():
    both = [palette.DIRECTIONS[name] for name in ("up", "down")]  # of one study
    assert min(least(both, eye) for eye in EYES) > 20
    beside = [palette.contact_colour(c, 3) for c in range(8)]
    for colour in palette.DIRECTIONS.values():
        for others, bound in ((palette.MOTION_COLOURS, 15), (beside, 10)):
            assert min(least([colour, other], "normal") for other in others) > bound


def test_areas_are_apart_in_grey_and_points_are_seen_on_white():
    motions = [colour for name, colour in palette.MOTIONS if name != "failed"]
    ratios = [colour for _, colour in metrics.SHADES]
    for colours, step in ((motions, 5), (ratios, 9)):
        assert np.all(np.diff(to_lab(linear(colours))[:, 0]) < -step)
    for colour in (*motions, *(palette.contact_colour(c, 3) for c in range(8))):
        assert least([colour, palette.NOTHING], "normal") > 10


def test_lightness_and_its_inverse_are_the_standard_ones():
    colours = ["#000000", "#0a0b0c", "#cdcdcd", "#6ac6f2", "#ffffff"]
    assert [palette.lightness(c) for c in colours] == pytest.approx(to_lab(linear(colours))[:, 0])
    for light, hue in ((20, 10), (50, 130), (80, 250)):
        made = to_lab(linear([palette.to_hex(light, 25, hue)]))[0]
        assert made[0] == pytest.approx(light, abs=0.4)
        assert np.degrees(np.arctan2(made[2], made[1])) % 360 == pytest.approx(hue, abs=3)


def test_text_on_a_colour_is_legible():
    colours = [*palette.MOTION_COLOURS, *(palette.contact_colour(c, 3) for c in range(8))]
    light = {c: linear([c])[0] @ TO_XYZ[1] + 0.05 for c in [*colours, "#222222", "#ffffff"]}
    for colour in colours:
        pair = sorted((light[colour], light[palette.ink(colour)]))
        assert pair[1] / pair[0] > 3.9


def test_every_run_has_its_motion():
    kinds = [MotionClass.NO_CONTACT, *[MotionClass.PERIODIC] * 6, MotionClass.CHAOTIC]
    kinds += [MotionClass.LONG_PERIOD, MotionClass.FAILED, MotionClass.NOT_COMPUTED]
    period = np.array([1, 1, 4, 5, 8, 9, 16, 0, 0, 0, 0])
    index = palette.motion_index(np.array(kinds), period)
    names = [palette.MOTION_NAMES[k] if k >= 0 else None for k in index]
    long = "P9 and longer"
    expected = ["no contact", "P1", "P4", "P5", "P8", long, long, "chaotic", long, "failed", None]
    assert names == expected
    for kind in MotionClass:
        alone = palette.motion_place(kind, 3)
        assert (alone == -1) == (kind is MotionClass.NOT_COMPUTED)
        assert alone < 0 or palette.MOTION_NAMES[alone] in (CLASS_NAMES[kind], "P3", long)


def test_there_is_no_second_list_of_colours():
    """Outside the palette all colours that are written down are greys, of lines and text."""
    folder = Path(figures.__file__).parent
    files = [p for p in folder.rglob("*") if p.suffix in (".py", ".js", ".css")]
    files = [p for p in files if p.name != "palette.py" and "vendor" not in p.parts]
    assert len(files) > 20
    for path in files:
        for colour in re.findall(r"#(?:[0-9a-fA-F]{6}|[0-9a-fA-F]{3})\b", path.read_text()):
            digits = colour[1:]
            assert len(set(re.findall("..?" if len(digits) == 6 else ".", digits))) == 1, path


KINDS = (
    (MotionClass.NO_CONTACT, 1),
    *((MotionClass.PERIODIC, p) for p in (1, 2, 3, 4, 5, 6, 7, 8, 12)),
    (MotionClass.UNDECIDED, 0),
    (MotionClass.QUASI_PERIODIC, 0),
    (MotionClass.CHAOTIC, 0),
)


@pytest.fixture(params=["all motions", pytest.param("few motions", marks=pytest.mark.slow)])
def mixed(request, results):
    """Results in which the runs have all motions, or three of them, in turn."""
    kinds = KINDS if request.param == "all motions" else (KINDS[5], KINDS[12], KINDS[1])
    shape = results["outcome"].shape
    turn = np.arange(np.prod(shape)).reshape(shape) % len(kinds)
    motion, period = np.array([(int(kind), p) for kind, p in kinds]).T[:, turn]
    axes = results["outcome"].dims
    counts = np.where(period > 0, np.minimum(period, 4), 4)
    points = results["poincare"].values.copy()
    points[:] = np.nan_to_num(points, nan=0.1)
    contact = np.where(motion == MotionClass.NO_CONTACT, 0, 1 + turn % 3)
    return results.assign(
        {
            MOTION: (axes, motion.astype(np.int8)),
            "orbit_period": (axes, period),
            "n_points": (axes, counts),
            "poincare": (results["poincare"].dims, points),
            "contact": (axes, contact.astype(results["contact"].dtype)),
        }
    )


def colour_of(value) -> str:
    from matplotlib.colors import to_hex

    return to_hex(value)


def legend_colours(figure) -> dict[str, str]:
    """Colour of every name in a figure's legends, without its share."""
    found = {}
    for legend in figure.legends:
        for handle, text in zip(legend.legend_handles, legend.get_texts(), strict=True):
            value = (
                handle.get_facecolor()
                if hasattr(handle, "get_facecolor")
                else handle.get_markeredgecolor()
                if handle.get_marker() not in ("None", None, "")
                else handle.get_color()
            )
            found[re.sub(r"  .*", "", text.get_text())] = colour_of(value)
    return found


@pytest.mark.slow
def test_a_motion_has_its_colour_in_every_figure(mixed, drawn_figure):
    expected = dict(palette.MOTIONS)
    seen = {}
    for module, options in (
        (orbit_diagram.orbit, {"color": "period"}),
        (sweep.frames, {}),
        (phase.phase, {"amplitudes": mixed["amplitude"].values[:4].tolist()}),
        (maps.motion_map, {}),
        (metrics.benefit, {}),
    ):
        shown = legend_colours(drawn_figure(module, mixed, **options))
        own = {name: colour for name, colour in shown.items() if name in expected}
        assert own, module
        assert own == {name: expected[name] for name in own}
        seen |= own
    occur = np.unique(palette.motion_index(style.classes_of(mixed), mixed["orbit_period"].values))
    assert {palette.MOTION_NAMES[k] for k in occur} <= set(seen)


@pytest.mark.slow
def test_what_is_drawn_has_the_colour_of_the_legend(mixed, drawn_figure):
    places = palette.motion_index(style.classes_of(mixed), mixed["orbit_period"].values)
    figure = drawn_figure(orbit_diagram.orbit, mixed, color="period")
    amplitude = mixed["amplitude"].values
    drawn = set()
    for points in figure.axes[0].collections:
        colour = (*points.get_facecolor(), *points.get_edgecolor())[0]
        for x in np.unique(points.get_offsets()[:, 0]):
            run = int(np.argmin(np.abs(amplitude - x)))
            assert colour_of(colour) in {palette.MOTION_COLOURS[k] for k in places[:, 0, run]}
            drawn.add((colour_of(colour), run))
    expected = {
        (palette.MOTION_COLOURS[k], run) for ends in places[:, 0] for run, k in enumerate(ends)
    }
    assert drawn == expected
    mesh = drawn_figure(maps.motion_map, mixed).axes[0].collections[0]
    shown = [colour_of(c) for c in mesh.cmap(mesh.norm(mesh.get_array().ravel()))]
    assert shown == [palette.MOTION_COLOURS[k] for k in places[0].ravel()]
    lines = drawn_figure(metrics.metrics, mixed).axes[0].lines
    chaotic = {colour_of(line.get_color()) for line in lines if "chaotic" in line.get_label()}
    expected = dict(palette.MOTIONS)["chaotic"]
    assert chaotic <= {expected}
    assert chaotic or not (style.classes_of(mixed)[:, 0] == MotionClass.CHAOTIC).any()


@pytest.mark.slow
def test_contact_sets_and_directions_have_their_colours_in_every_figure(mixed, drawn_figure):
    sets = {style.set_name(c, 2): palette.contact_colour(c, 2) for c in range(4)}
    directions = {f"sweep {name}": palette.DIRECTIONS[name] for name in ("up", "down")}
    for expected, figure in (
        (sets, drawn_figure(orbit_diagram.orbit, mixed, color="contact")),
        (sets, drawn_figure(maps.motion_map, mixed, value="contact")),
        (directions, drawn_figure(orbit_diagram.orbit, mixed)),
    ):
        shown = legend_colours(figure)
        own = {name: colour for name, colour in shown.items() if name in expected}
        assert len(own) >= 2
        assert own == {name: expected[name] for name in own}


@pytest.mark.slow
def test_the_film_has_the_same_colours(still_film):
    def legends(*given):
        picture, _ = still_film(*given)
        (legend,) = picture.figure.legends
        looks = [(key.get_label(), key.properties()) for key in legend.legend_handles]
        return {name: to_hex(own.get("facecolor", own.get("color"))) for name, own in looks}

    for places in (range(len(palette.MOTIONS)), (4, 12)):
        wanted = {palette.MOTION_NAMES[k]: palette.MOTION_COLOURS[k] for k in places}
        assert legends("period", places) == wanted
    wanted = {style.set_name(c, 2): palette.contact_colour(c, 2) for c in (3, 2)}
    assert legends("contact", (2, 3), (3, 2)) == wanted
    shown = legends("direction", (0, 1))
    assert [*shown.values()] == [palette.DIRECTIONS[d] for d in ("up", "down")]
    places = np.arange(len(palette.MOTIONS))
    picture, frame = still_film("period", places, (), 2, np.linspace(0.1, 0.2, 14))
    frame["key"] = np.stack([places, places])
    frame["poincare"][0] = 0.05
    pixels = picture.draw(0.5, frame)
    at = np.linspace(0.1, 0.2, 14)
    painted = [tuple(*spot(pixels, picture.panels[0], x, 0.05)) for x in at]
    assert painted == [palette.rgb(colour) for colour in palette.MOTION_COLOURS]


def test_the_explorer_has_the_same_colours(file):
    study = gather(Frames(file))
    meta = _pack(study)[0]
    legend = [(entry["name"], entry["colour"]) for entry in meta["motionLegend"]]
    assert legend == list(palette.MOTIONS)
    for kind, reported in zip(MotionClass, meta["motions"], strict=True):
        assert reported["place"] == palette.motion_place(kind, 1)
    # the page adds the period to the place of P1
    first = meta["motions"][MotionClass.PERIODIC]["place"]
    for period in (1, 2, 8, 9, 16):
        place = first + min(period, meta["longest"] + 1) - 1
        assert place == palette.motion_place(MotionClass.PERIODIC, period)
    colours = meta["colours"]
    assert colours["directions"] == [palette.DIRECTIONS[name] for name in study.directions]
    sets = {style.set_name(c, 2): palette.contact_colour(c, 2) for c in range(4)}
    assert colours["contacts"] == [sets[name] for name in meta["contacts"]]
    assert len(colours["numbers"]) == 256
