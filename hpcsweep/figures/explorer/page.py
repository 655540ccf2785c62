"""Build one self-contained page of a study."""

import functools
import html
import json
import math
import re
from collections.abc import Sequence
from importlib.resources import files

import numpy as np

from hpcsweep.dynamics.classify import CLASS_NAMES, MotionClass
from hpcsweep.figures import labels, palette
from hpcsweep.figures.explorer import encode
from hpcsweep.figures.explorer.branches import pack_branches, with_members
from hpcsweep.figures.explorer.page_data import PageData
from hpcsweep.model.coordinates import Coordinate
from hpcsweep.model.description import in_words
from hpcsweep.model.modes import per_mass
from hpcsweep.model.unit_names import unit_of
from hpcsweep.solvers.outcome import Outcome

BITS, VALUE_BITS = 12, {"drift": 16, "lyapunov": 16}
"""Of quantised numbers, displacements and velocities, but for those of some values."""
QUANTITIES = ("length", "velocity", "acceleration", "frequency", "rate")
"""Whose units the page names."""
INFERRED_WORDS = "inferred from its cell"
NAME_ROOM = 40
"""Letters of a contact set's name."""
SCRIPTS = {
    "motions": "codec frame integrate colours map diagrams portraits branches words main",
    "records": "codec frame colours stripes panel views telling records",
}
"""Parts of the program of each kind of page, in their order."""
GREEK = {"beta": "β", "rho": "ρ", "zeta": "ζ"}


def build_page(study: PageData) -> str:
    """Return the page of a study."""
    return fill_page("motions", study.name, *_pack(study))


def fill_page(kind: str, name: str, meta: dict, texts: dict[str, str]) -> str:
    """Fill the frame of a page of a kind.

    Parameters
    ----------
    kind : str
        One of `SCRIPTS`.
    name : str
        Of the study.
    meta : dict
        Description of the study and its arrays, for JSON.
    texts : dict of str to str
        The arrays, from `hpcsweep.figures.explorer.encode`.
    """
    assets = files(__package__) / "assets"
    parts = {
        "KIND": kind,
        "TITLE": html.escape(f"{name}: explorer"),
        "BODY": (assets / f"{kind}.html").read_text(),
        "SCRIPTS": "".join((assets / f"{each}.js").read_text() for each in SCRIPTS[kind].split()),
        "META": json.dumps(meta, allow_nan=False).replace("<", "\\u003c"),
        "DATA": "\n".join(
            f'<script type="text/plain" id="data-{name}">{text}</script>'
            for name, text in texts.items()
        ),
    }

    def filled(place: re.Match) -> str:
        """Return one of the parts, or else the text of a file."""
        name = place[1]
        return parts[name] if name in parts else (files(__package__) / name).read_text()

    return re.sub(r"\{\{([\w/.]+)\}\}", filled, (assets / "page.html").read_text())


def _pack(study: PageData) -> tuple[dict, dict[str, str]]:
    """Return the page's description of the study and the text of its arrays."""
    texts: dict[str, str] = {}
    arrays: dict[str, dict] = {}

    def add(name: str, codes: np.ndarray, row: int = 0, **notes) -> None:
        arrays[name], texts[name] = encode.pack(codes, row, **notes)

    n_amplitudes = study.amplitude.size
    sets, contact = _contact_index(study.runs.get("contact"))
    for name, values in study.runs.items():
        if values.dtype.kind in "iu":
            add(name, contact if name == "contact" and contact is not None else _narrow(values))
        if values.dtype.kind in "iu" or name == "speed":
            continue
        low, high = _range(values)
        value_bits = VALUE_BITS.get(name, BITS)
        colour = _range(values, 1.0)
        codes = encode.quantise(values, low, high, value_bits)
        step = float(encode.resolution(low, high, value_bits))
        notes = {"low": low, "high": high, "step": step, "colour": colour}
        if name in study.labels:
            label, place, unit_name = study.labels[name]
            notes["label"] = f"{label}, {place}{_plain(unit_name)}"
        add(name, codes, n_amplitudes, **notes)
    worst = _add_points(study, add)
    each = study.steps.get("structures", [])
    shown = functools.partial(_structure, change=study.change, names=study.names)
    grazing: list[float | None] = [None] * study.omega.size
    if not study.steps:
        grazing = [_grazing(study.structure, omega) for omega in study.omega.tolist()]
    low, high = study.amplitude[[0, -1]]
    grazes = any(grazed is not None and low <= grazed <= high for grazed in grazing)
    return {
        "branches": pack_branches(study.branches, study.structure, NAME_ROOM, add),
        "name": study.name,
        "structure": shown(study.structure, each),
        "axes": {"x": _axis(study.dims[1], study.quantity), "y": _axis(study.dims[0], "")},
        "steps": study.steps | {"structures": [shown(step) for step in each]}
        if study.steps
        else None,
        "unitNames": _unit_names(study.structure),
        "grazing": grazing,
        "omega": study.omega.tolist(),
        "amplitude": study.amplitude.tolist(),
        "directions": list(study.directions),
        "words": list(study.words),
        "each": study.each,
        "missing": "not computed" if study.each == "direction" else "no such attractor",
        "arrays": arrays,
        "bits": BITS,
        "resolution": worst,
        "thinned": study.thinned,
        "motions": [
            {
                "name": CLASS_NAMES[m],
                "place": palette.motion_place(m, 1),
                "periodic": m is MotionClass.PERIODIC,
                "done": m not in (MotionClass.NOT_COMPUTED, MotionClass.FAILED),
            }
            for m in MotionClass
        ],
        "motionLegend": [{"name": name, "colour": colour} for name, colour in palette.MOTIONS],
        "longest": palette.LONGEST,
        "outcomes": [*(o.name.lower().replace("_", " ") for o in Outcome), INFERRED_WORDS],
        "contacts": with_members(sets, study.structure, NAME_ROOM),
        "colours": _colours(study, sets, grazes),
    }, texts


def _add_points(study: PageData, add) -> dict[str, float]:
    """Add the points, each frame and component on its own range; return the worst steps."""
    sweeps = study.runs["counts"].reshape(-1, study.amplitude.size)
    per_frame = sweeps.reshape(study.omega.size, -1).sum(axis=1)
    if not per_frame.any():
        return {}
    steps = {}

    def add_ranged(name: str, codes: np.ndarray, low, high, row: int = 0) -> None:
        add(name, codes, row, ranges=np.stack([low, high], axis=-1).tolist())
        steps[name] = float(encode.resolution(low, high, BITS).max())

    low, high, codes = _quantise_frames(study.points, per_frame)
    add_ranged("points", encode.predict_points(codes, sweeps), low, high)
    speed = np.moveaxis(study.runs["speed"], -1, 0)
    with np.errstate(invalid="ignore"):
        low = np.nan_to_num(np.fmin.reduce(speed, axis=(2, 3)).T).astype(float)
        high = np.nan_to_num(np.fmax.reduce(speed, axis=(2, 3)).T).astype(float)
    codes = encode.quantise(speed, low.T[:, :, None, None], high.T[:, :, None, None], BITS)
    add_ranged("speed", codes, low, high, study.amplitude.size)
    return steps


def _quantise_frames(points: np.ndarray, per_frame: np.ndarray):
    """Quantise each frame's points on their own range.

    Returns
    -------
    low, high : ndarray, shape (n_frames, n)
        0 in frames without points.
    codes : ndarray of uint16, shape (n, n_points)
    """
    n = points.shape[1]
    low, high = np.zeros((2, per_frame.size, n))
    codes = np.empty((n, len(points)), np.uint16)
    for frame, (end, count) in enumerate(zip(np.cumsum(per_frame), per_frame, strict=True)):
        if count:
            shown = points[end - count : end].T
            low[frame], high[frame] = shown.min(axis=1), shown.max(axis=1)
            codes[:, end - count : end] = encode.quantise(
                shown, low[frame, :, None], high[frame, :, None], BITS
            )
    return low, high, codes


def _contact_index(contact: np.ndarray | None) -> tuple[list[int], np.ndarray | None]:
    """Rank the contact sets by frequency."""
    if contact is None:
        return [], None
    sets, index, count = np.unique(contact, return_inverse=True, return_counts=True)
    order = np.argsort(-count, kind="stable")
    rank = np.empty_like(order)
    rank[order] = np.arange(order.size)
    return [int(s) for s in sets[order]], _narrow(rank[index].reshape(contact.shape))


def _narrow(codes: np.ndarray) -> np.ndarray:
    """Convert to the smallest unsigned integer type that holds all values."""
    return codes.astype(np.min_scalar_type(int(codes.max(initial=0))))


def _range(values: np.ndarray, percent: float = 0.0) -> list[float]:
    """Return the range of the finite values, without `percent` of them at either end."""
    finite = values[np.isfinite(values)]
    if not finite.size:
        return [0.0, 0.0]
    return [float(q) for q in np.percentile(finite, [percent, 100.0 - percent])]


def _unit_names(structure) -> dict[str, str]:
    """Return the names of units as in labels of figures; '' where they have none."""
    names = {name: _plain(labels.unit(structure, name)).strip().strip("[]") for name in QUANTITIES}
    return names | {"cycles": unit_of(structure, "cycles") if structure.unit_names.time else ""}


def _plain(words: str) -> str:
    """Return a label of figures as text without formulas."""
    for formula, letters in (("$", ""), (r"\omega_0", "ω₀"), (r"\Omega", "Ω"), ("^2", "²")):
        words = words.replace(formula, letters)
    return words


def _grazing(structure, omega: float) -> float | None:
    """Return the grazing amplitude; None where there is none."""
    amplitude = structure.grazing_amplitude(float(omega))
    return amplitude if math.isfinite(amplitude) else None


def _axis(name: str, quantity: str) -> dict[str, str]:
    """Return label, unit, noun and, of a key of the structure, the name of an axis."""
    key = "" if name in labels.SYMBOLS else name.replace("_", " ")
    label, unit = (key, quantity) if key else labels.PARAMETERS[name]
    return {"label": _plain(label), "quantity": unit, "noun": key or name, "key": key}


def _structure(structure, each: Sequence = (), change=None, names: Sequence[str] = ()) -> dict:
    """Return the structure as the page integrates and describes it: divided by the masses.

    Of several, one a step of a sweep, the words are those that hold along it, without stops. In
    coordinates S u, S the `change`: M^-1 K is S M^-1 K S^-1 there, a direction d is S^-T d.
    """
    mass, change = structure.mass_matrix, np.eye(structure.n_floors) if change is None else change
    back = np.linalg.inv(change)

    def entries(vector) -> list[list]:
        return [[i, float(value)] for i, value in enumerate(vector) if value]

    places = [Coordinate(tuple(row), "").stops(structure) for row in change.tolist()]
    if each:
        places = [([], [])] * structure.n_floors
    words_of = [in_words(step) for step in (*each[:1], *each[-1:])]
    common = (word for word in in_words(structure) if all(word in words for words in words_of))
    words = (f"{GREEK.get(s, s)} = {value}" if s else value for s, value in common)
    return {
        "words": ", ".join(words).replace("inf", "∞"),
        "floors": structure.n_floors,
        "names": [*(names or structure.names.floors)],
        "rho": structure.sharpness if math.isfinite(structure.sharpness) else None,
        "stiffness": (change @ per_mass(mass, structure.stiffness_matrix) @ back).tolist(),
        "damping": (change @ per_mass(mass, structure.damping_matrix) @ back).tolist(),
        "forcing": (change @ per_mass(mass, structure.forcing_vector)).tolist(),
        "harmonics": [list(harmonic) for harmonic in structure.harmonics],
        "contacts": [
            {
                "name": structure.contact_names[number],
                "direction": entries(contact.direction @ back),
                "gap": contact.gap,
                "push": entries(change @ (kappa * per_mass(mass, np.array(contact.direction)))),
            }
            for number, contact, kappa in zip(
                structure.contact_numbers,
                structure.contacts,
                structure.contact_stiffness,
                strict=True,
            )
        ],
        "stops": [[*right, *left] for right, left in places],
        "units": structure.state_units[[0, -1]].tolist(),
    }


def _colours(study: PageData, sets: list[int], grazes: bool) -> dict[str, str | list[str]]:
    """Return the colours of all figures for the page; of grazing if there is a line."""
    from matplotlib import colormaps
    from matplotlib.colors import to_hex

    return {
        "contacts": [palette.contact_colour(s, study.structure.contact_labels) for s in sets],
        "directions": [
            palette.DIRECTIONS.get(name, palette.series_colour(place))
            for place, name in enumerate(study.directions)
        ],
        "numbers": [to_hex(c) for c in colormaps[palette.NUMBERS](np.linspace(0, 1, 256))],
        "nothing": palette.NOTHING,
        "grazing": palette.GRAZING if grazes else "",
        "stop": palette.STOP,
    }
