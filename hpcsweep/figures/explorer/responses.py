"""Responses to records in the explorer: curves, fragility and profiles of every structure.

The page has the responses of every record at every scale and place as the file does, rounded to
float32, and counts fractiles, capacities and fragility by itself (``assets/stripes.js``).
"""

import math

import numpy as np

from hpcsweep.figures import labels, palette
from hpcsweep.figures.diagrams.responses import heights
from hpcsweep.figures.explorer import encode
from hpcsweep.model.reduction import physical
from hpcsweep.parallel.counted import counted
from hpcsweep.solvers.offers import LINEAR
from hpcsweep.studies.ground_motion import stripes
from hpcsweep.studies.ground_motion.describe import alone_words, elastic_drift, elastic_words
from hpcsweep.studies.ground_motion.records import Records
from hpcsweep.studies.ground_motion.variables import BESIDE, FACTS
from hpcsweep.studies.run_names import written
from hpcsweep.studies.study import as_kind

HISTORY, BITS = "history_displacement", 12
"""Motion that is shown where the file holds it, and its resolution: 1/2^11 of its largest value."""
MAX_INSTANTS = 20_000_000
"""Displacements of histories in a page; of more none is."""
SHOWN = ("pga", "pgv", "duration")
"""Facts about a record in its table."""
OF_BUILDINGS = ("storey", "floor", "slider")
"""Dimensions whose places are named by a building and a number."""


def gather_responses(frames):
    """Read the responses of all chosen parts, and describe them.

    Parameters
    ----------
    frames : hpcsweep.store.Frames
        Of a study of records; parts are those of its `at`.

    Returns
    -------
    meta : dict
    arrays : dict of str to ndarray of float32
        ``NAME`` of each response, shape (parts, records, scales, places), NaN where it is not
        known, infinite where the motion collapses; ``NAME_alone`` of the motion beside, likewise;
        ``factor``, shape (parts, records), at the last scale.
        Where the file holds motions, codes ``history`` of displacements over ``history_size``, the
        largest of each, shape (parts, records, scales, floors, instants).
    """
    names = [variable.name for variable in stripes.RESPONSES.values()]
    names += [f"{name}_{kind}" for name in names for kind in BESIDE]
    names += ["outcome", "collapsed", "collapse_time_alone"]
    axes = [axis for axis in frames.whole.study.axes if axis.name not in frames.given]
    total = math.prod(len(axis.values) for axis in axes)
    moves = HISTORY in frames
    if moves:
        dims = *frames.study.run_dims, "time", "floor"
        moves = total * math.prod(frames.study.dimensions[dim] for dim in dims) <= MAX_INSTANTS
    parts: list[dict] = []
    described: dict[str, dict] = {}
    arrays: dict[str, list[np.ndarray]] = {}
    for keys in counted(frames.parts(), total, "reading structure"):
        study = as_kind(frames.study, Records)
        results, structure = frames.gather([*names, *[HISTORY] * moves]), study.structure
        parts.append(
            {
                "at": [axis.values.index(keys[axis.name]) for axis in axes],
                "note": elastic_words(elastic_drift(results, structure)),
                "exact": not structure.contacts and LINEAR.of(structure),
                "proportional": not structure.contacts or LINEAR.of(structure),
                "measure": stripes.intensity_label(study),
                "alone": alone_words(structure),
            }
        )
        for name, values in _arrays(results, study, described).items():
            arrays.setdefault(name, []).append(values)
    for name, entry in described.items():
        if entry["unit"] != "%":
            held = np.array(arrays[name])
            unit, size = labels.sized(
                structure, stripes.RESPONSES[name].units, held[np.isfinite(held)]
            )
            entry |= {"unit": unit.strip(" []").removeprefix("1"), "size": size}
    meta = {
        "name": frames.whole.name,
        "file": frames.path.name,
        "responses": described,
        "parts": parts,
        "menus": [_menu(axis, structure) for axis in axes],
        "records": [record.name for record in study.suite],
        "scales": study.intensities(study.scale)[0].tolist(),
        "collapses": "collapsed" in frames,
        "facts": [
            {
                "label": entry.name.upper() if entry.name.startswith("pg") else entry.name,
                "unit": labels.named(structure, entry.units).strip(),
                "values": [getattr(facts, entry.name) for facts in study.suite],
            }
            for entry in FACTS
            if entry.name in SHOWN
        ],
        "colours": {
            each: palette.series_colour(place)
            for each, place in (("light", 0), ("dark", 4), ("pointed", 1), ("kept", 2))
        },
        "stop": palette.STOP,
        "history": study.instants["time"].values.tolist() if moves else [],
        "leftOut": HISTORY in frames and not moves,
        "bits": BITS,
        "time": labels.unit(structure, "time"),
    }
    kinds = {"history": np.uint16}
    return meta, {
        name: np.array(entry, kinds.get(name, np.float32)) for name, entry in arrays.items()
    }


def _arrays(results, study: Records, described: dict[str, dict]) -> dict[str, np.ndarray]:
    """Return the arrays of one part, as of `gather_responses`; add what is `told` of responses."""
    arrays = {"factor": study.factor[:, -1]}
    for name in stripes.RESPONSES:
        try:
            responses = stripes.responses_of(results, study, name)
        except stripes.StripesError:
            continue
        free = responses.values * np.nan if responses.alone is None else responses.alone
        arrays |= {name: responses.values, f"{name}_alone": free}
        described.setdefault(name, _describe(responses, study.structure.reduction is None))
    if HISTORY in results:
        motion = np.moveaxis(results[HISTORY].values, -2, -1)
        size = np.nanmax(np.abs(motion), axis=-1, initial=0.0)
        with np.errstate(invalid="ignore"):
            shape = motion / size[..., None]
        arrays |= {"history_size": size, "history": encode.quantise(shape, -1.0, 1.0, BITS)}
    return arrays


def pack_responses(meta: dict, arrays: dict[str, np.ndarray]) -> tuple[dict, dict[str, str]]:
    """Return the page's description of a study of records and the text of its arrays."""
    specs, texts = {}, {}
    for name, values in arrays.items():
        real = values.dtype.kind == "f"
        codes, row = (values.view("<u4"), 0) if real else (values, values.shape[-1])
        specs[name], texts[name] = encode.pack(codes, row, float32=real)
    return {**meta, "arrays": specs}, texts


def _describe(response, has_buildings: bool) -> dict:
    """Describe a response: its label, places, groups of places, and panels of its profile."""
    every = physical(response.names)
    panels = [("", every, every)]
    if has_buildings and response.dim in OF_BUILDINGS:
        panels = heights(response.names)
    each = [(name, [i]) for i, name in enumerate(response.names)]
    groups = [(f"building {name}", places) for name, places, _ in panels if name]
    return {
        "label": response.label,
        "unit": response.unit,
        "size": 1.0,
        "places": response.names,
        "of": {"stop": "contact"}.get(response.dim, response.dim),
        "groups": [(f"all {len(every)}, the largest", every), *groups, *each],
        "panels": panels,
    }


def _menu(axis, structure) -> dict:
    """Describe the menu of a key that the job varies, or of rows of keys."""
    if not axis.columns:
        unit = labels.unit(structure, axis.units) if axis.units != "1" else ""
        return {"name": axis.name + unit, "values": [*map(written, axis.values)]}
    rows = (
        ", ".join(f"{column.name} = {column.values[i]}" for column in axis.columns)
        for i in range(len(axis.values))
    )
    pairs = zip(axis.values, rows, strict=True)
    return {"name": axis.name, "values": [f"{name}: {row}" for name, row in pairs]}
