"""Read the structure of a job: a building, several, or matrices with contacts.

Every error is one line that names the file, the key, the value and the limit;
`hpcsweep.model.structure` defines the limits.
"""

import functools
import hashlib
import math
import pickle
import re
from collections.abc import Iterator, Mapping
from dataclasses import fields, replace
from typing import Any

import numpy as np

from hpcsweep.job.forcing import read_forcing
from hpcsweep.job.job import JobError
from hpcsweep.job.keys import STRUCTURE, UNITS, bare
from hpcsweep.job.values import PAIRS, Values
from hpcsweep.model.adjacent import adjacent
from hpcsweep.model.arguments import InputError
from hpcsweep.model.buildings import Building, Column
from hpcsweep.model.isolation import Isolation
from hpcsweep.model.matrices import Contact
from hpcsweep.model.reduced import Reduced, elements_of
from hpcsweep.model.slider import MAX_LABEL, Slider
from hpcsweep.model.soil import Soil
from hpcsweep.model.springs import Spring
from hpcsweep.model.structure import Structure
from hpcsweep.model.unit_names import NEWTONS, UnitNames
from hpcsweep.studies.ground_motion.scales import known_gravity
from hpcsweep.studies.keys import names

UNIT_NAME = re.compile(r"[A-Za-z%°µμ]{1,12}")
MATRICES = ("mass", "stiffness", "damping", "forcing", "drift")
BUILDING = tuple(field.name for field in fields(Building))
ISOLATION = tuple(field.name for field in fields(Isolation) if field.name != "gravity")
MATRICES_BESIDE = {
    "matrices.mass": "building.mass",
    "matrices.stiffness": "building.storey_stiffness or period",
}
"""Keys of buildings side by side that give the matrices."""
WITH_MATRICES = (
    *("matrices", "contact", "slider", "spring", "sharpness", "damping_ratio", "rayleigh"),
    "collapse_drift",
)
"""Keys of the structure that go with its matrices; all others are those of a building."""
MODEL = ("file", "names", "influence", "fixed", "outputs", "reduce", "damping_ratio")
"""Of the table of a model; `hpcsweep.job.models` writes `found` besides."""
MAX_STIFFNESS = 1e12
MAX_DAMPING = 1e6
MAX_SHARPNESS = 1e300
"""Where it is finite."""
MIN_SIZE, MAX_SIZE = 1e-30, 1e30
SIZED = ("samples", "direction", "amplitude", "friction")
"""Keys whose values, where they are not 0, are of such a size, besides those with a unit."""
OF_ANY_SIZE = re.compile(r"structure\.matrices\.damping|building\[\d+\]\.period")
"""Keys with limits of their own."""


def read_structure(values: Values) -> Structure:
    """Read the tables ``structure`` and ``forcing``.

    Raises
    ------
    JobError
        If they do not define a structure.
    """
    table = dict(values.table("structure"))
    harmonics = read_forcing(values)
    by_matrices = next((key for key in ("model", "matrices") if key in table), None)
    for key in ("contact", "slider", "spring"):
        if key in table and by_matrices is None:
            raise values.error(f"structure.{key}", table[key], "goes with structure.matrices")
    side_by_side = values.top("building", None) is not None
    _check_sizes(values)
    try:
        if side_by_side or values.top(PAIRS, None):
            structure = _of_buildings(values, table, harmonics)
        elif by_matrices is None:
            table = _weighed(values, "structure", table)
            table = {key: _tuples(value) for key, value in table.items()}
            structure = Structure(**table, harmonics=harmonics)
        else:
            structure = _of_matrices(values, table, by_matrices, harmonics)
        if structure.sliders:
            _ = structure.rest
    except InputError as error:
        if isinstance(error, JobError):
            raise
        _place(error, side_by_side)
        raise JobError(error.limit, error.key, values.source) from None
    if structure.rayleigh is not None and "damping_ratio" in table:
        shown = values.get("structure.rayleigh")
        raise values.error("structure.rayleigh", shown, "is given beside damping_ratio")
    _check_limits(values, structure)
    return structure.labelled(unit_names=_unit_names(values, structure))


def _place(error: InputError, side_by_side: bool) -> None:
    """Replace the parameter in an error by the job's key for it."""
    if error.key in MATRICES_BESIDE and side_by_side:
        error.key = MATRICES_BESIDE[error.key]
    elif error.table == "harmonics":
        error.within("forcing")
    elif not side_by_side:
        error.within("structure")
    elif error.table not in ("building", "pounding"):
        error.key = f"pounding.{error.key.removeprefix('contact.')}"


def _unit_names(values: Values, structure: Structure) -> UnitNames:
    """Read the table ``units``: names that label quantities in the user's own units."""
    table = dict(values.table("units"))
    if "force" in table:
        force, wanted = table.pop("force"), (table.get("length", "m"), table.get("time", "s"))
        known = {name: mass for (length, mass, s), name in NEWTONS.items() if (length, s) == wanted}
        if "mass" in table or not isinstance(force, str) or force not in known:
            limit = (
                f"must be one of {', '.join(known) or 'none'} in {'/'.join(wanted)}, without mass"
            )
            raise values.error("units.force", force, limit)
        table |= {"mass": known[force], "length": wanted[0], "time": wanted[1]}
    for key, name in table.items():
        if not isinstance(name, str) or not UNIT_NAME.fullmatch(name):
            limit = 'must be the name of a unit, such as "m": letters, up to 12'
            raise values.error(f"units.{key}", name, limit)
    if table and structure.is_uniform:
        first = next(iter(table))
        limit = "goes with masses and stiffnesses of one's own (structure.mass, matrices)"
        raise values.error(f"units.{first}", table[first], limit)
    return UnitNames(**table)


def _of_matrices(values: Values, table: dict, by: str, harmonics) -> Structure:
    """Read matrices, or a model, with contacts and sliders."""
    for key in table:
        if key not in (by, *WITH_MATRICES[1:]):
            raise values.error(f"structure.{key}", table[key], f"does not go with {by}")
    contacts, sliders, springs = element_tables(values, table)
    others = {key: _tuples(table[key]) for key in WITH_MATRICES[4:] if key in table}
    if by == "model":
        if springs:
            raise values.error("structure.spring", springs, "goes with structure.matrices")
        return _of_model(values, table, contacts, sliders, {**others, "harmonics": harmonics})
    values.check_table("structure.matrices", table[by], MATRICES, ("mass", "stiffness"))
    return Structure.from_matrices(
        contacts=elements_of("contact", contacts),
        sliders=elements_of("slider", sliders),
        springs=elements_of("spring", springs),
        harmonics=harmonics,
        **table[by],
        **others,
    )


def element_tables(values: Values, structure: Mapping) -> list[list[dict]]:
    """Return the tables of contacts, sliders and springs beside matrices."""
    tables, kinds = [], {"contact": Contact, "slider": Slider, "spring": Spring}
    for name, kind in kinds.items():
        listed, keys = structure.get(name, []), [field.name for field in fields(kind)]
        if not isinstance(listed, list):
            raise values.error(f"structure.{name}", listed, f"must be tables, [[structure.{name}]]")
        for k, table in enumerate(listed):
            values.check_table(f"structure.{name}[{k}]", table, keys, keys[:3])
        tables.append(listed)
    return tables


def model_settings(structure: Mapping) -> str:
    """Hash the keys that a reduced model depends on."""
    model = {key: structure["model"].get(key) for key in MODEL[1:-1]}
    rows = [contact.get("direction") for contact in structure.get("contact", [])]
    rows += [
        (slider.get("direction"), slider.get("stiffness")) for slider in structure.get("slider", [])
    ]
    return hashlib.sha256(repr((model, rows)).encode()).hexdigest()


def _of_model(values: Values, structure: dict, contacts, sliders, others: dict) -> Structure:
    """Read a finite element model that `hpcsweep.job.models` has reduced."""
    table = dict(structure["model"])
    reduction = dict(table.pop("found", {}))
    values.check_table("structure.model", table, MODEL, ("file",))
    origin, settings = reduction.pop("origin", ""), reduction.pop("settings", "")
    if settings != model_settings(structure):
        limit = ": contacts and sliders must be those that it was reduced with"
        raise JobError(limit, "structure.model", values.source)
    if "damping_ratio" in table:
        if both := {"damping_ratio", "rayleigh"} & set(others):
            limit = f"must not be given beside structure.{both.pop()}"
            raise values.error("structure.model.damping_ratio", table["damping_ratio"], limit)
        others["damping_ratio"] = _tuples(table["damping_ratio"])
    try:
        reduced = Reduced(**reduction)
    except TypeError:
        limit = "is not as hpcsweep wrote it"
        raise JobError(limit, "structure.model.found", values.source) from None
    return reduced.structure(contacts, sliders, origin=origin, **others)


def _weighed(values: Values, place: str, table: dict) -> dict:
    """Return a table with the weights for p_delta: masses times g unless given."""
    if "weight" in table and "p_delta" not in table:
        raise values.error(f"{place}.weight", table["weight"], "goes with p_delta")
    mass: Any = table.get("mass")
    each = mass if isinstance(mass, list) else [mass]
    is_known = all(isinstance(m, int | float) for m in each)
    if table.get("p_delta") is not True or "weight" in table or not is_known:
        return table
    gravity = known_gravity(values, f"{place}.p_delta", True)
    return {**table, "weight": [gravity * m for m in each] if mass is each else gravity * mass}


def _building(name: str, table: Mapping) -> Building:
    """Make one of several buildings; an error names its table."""
    try:
        return _made(pickle.dumps({key: _tuples(value) for key, value in table.items()}))
    except InputError as error:
        raise error if error.table == "matrices" else error.within(name) from None


@functools.lru_cache(maxsize=1024)
def _made(table: bytes) -> Building:
    """Make a building of a pickled table, or return the one that parts of a varied job share."""
    made = Building(**pickle.loads(table))
    _ = made.structure  # which checks what the building itself does not
    return made


def _of_buildings(values: Values, structure: dict, harmonics) -> Structure:
    """Read buildings side by side: the tables ``building`` and ``pounding``."""
    tables = values.top("building", None)
    if tables is None:
        raise values.error(PAIRS, values.top(PAIRS, None), "goes with [[building]]")
    if not isinstance(tables, list):
        raise values.error("building", tables, "must be tables, [[building]]")
    for key in structure:
        raise values.error(f"structure.{key}", structure[key], "does not go with [[building]]")
    buildings = []
    for k, table in enumerate(tables):
        place = f"building[{k}]"
        by_period = isinstance(table, Mapping) and "period" in table
        needed = ("mass", "storey_stiffness")[: 1 if by_period else 2]
        values.check_table(place, table, BUILDING, needed)
        if {"rayleigh", "damping_ratio"} <= set(table):
            limit = "is given beside damping_ratio"
            raise values.error(f"{place}.rayleigh", table["rayleigh"], limit)
        name = table.get("name", "")
        if not isinstance(name, str) or not name.isprintable() or len(name) > MAX_LABEL:
            limit = f"must be a name of up to {MAX_LABEL} characters that can be printed"
            raise values.error(f"{place}.name", name, limit)
        if "column" in table:
            values.check_table(f"{place}.column", table["column"], *(Column._fields,) * 2)
        if "soil" in table:
            soil = [field.name for field in fields(Soil)]
            values.check_table(f"{place}.soil", table["soil"], soil, soil[:4])
        table = _weighed(values, place, table)
        buildings.append(_building(place, _with_isolation(values, place, table)))
    pounding: Any = values.top(PAIRS, {})
    if len(buildings) == 1:
        if pounding:
            raise values.error(PAIRS, pounding, "goes with two [[building]] or more")
        return replace(buildings[0].structure, harmonics=harmonics)
    each = pounding if isinstance(pounding, list) else [pounding]
    for k, table in enumerate(each):
        place, keys = f"{PAIRS}[{k}]" if each is pounding else PAIRS, names(STRUCTURE[PAIRS])
        values.check_table(place, table, keys, ("gap", "stiffness"))
    if each is pounding:
        return adjacent(buildings, between=each, harmonics=harmonics)
    sharpness = values.number("pounding.sharpness", pounding.get("sharpness", math.inf))
    return adjacent(buildings, **{**pounding, "sharpness": sharpness}, harmonics=harmonics)


def _with_isolation(values: Values, place: str, table: Mapping) -> Mapping:
    """Return the table of a building, with gravity where its isolation needs it."""
    bearings = table.get("isolation")
    if bearings is None:
        return table
    values.check_table(f"{place}.isolation", bearings, ISOLATION, ("slab_mass",))
    if "wall_stiffness" in bearings and "gap" not in bearings:
        key = f"{place}.isolation.wall_stiffness"
        raise values.error(key, bearings["wall_stiffness"], "goes with gap")
    by_weight = {}
    for key in sorted({"radius", "friction"} & set(bearings)):
        by_weight["gravity"] = known_gravity(values, f"{place}.isolation.{key}", bearings[key])
    return {**table, "isolation": {**bearings, **by_weight}}


def _tuples(value):
    return tuple(_tuples(item) for item in value) if isinstance(value, list) else value


def _check_sizes(values: Values) -> None:
    """Refuse values that no structure can be made of."""
    for name in ("structure", "forcing", "building", "pounding"):
        for key, value in _numbers(name, values.top(name, {})):
            last = bare(key)
            is_size = last in SIZED or UNITS.get(last, "1") != "1"
            if not is_size or OF_ANY_SIZE.fullmatch(key) or not 0 < abs(value) < math.inf:
                continue
            if not MIN_SIZE <= abs(value) <= MAX_SIZE:
                limit = f"must be 0 or of a size from {MIN_SIZE:g} to {MAX_SIZE:g}"
                raise values.error(key, value, limit)


def _check_limits(values: Values, structure: Structure) -> None:
    """Refuse values that no solver can start from."""
    ratio: Any = structure.stiffness_ratio
    sharpness = "structure.sharpness"
    if values.top("building", None) is not None:
        damping, sharpness = "building.damping_ratio or rayleigh", "pounding.sharpness"
    else:
        of_matrix = structure.matrices is not None and structure.matrices.damping is not None
        by = "damping_ratio" if structure.rayleigh is None else "rayleigh"
        damping = "structure.matrices.damping" if of_matrix else f"structure.{by}"
    for key, value, largest in (
        ("structure.stiffness_ratio", float(np.max(ratio)), MAX_STIFFNESS),
        (sharpness, structure.sharpness, MAX_SHARPNESS),
        (damping, float(structure.damping_ratios.max()), MAX_DAMPING),
    ):
        if largest < value < math.inf:
            raise values.error(key, value, f"must be at most {largest:g}")


def _numbers(key: str, table: Any) -> Iterator[tuple[str, Any]]:
    """Iterate over the numbers in a table, or in several, with the keys of each."""
    if isinstance(table, Mapping):
        for name, value in table.items():
            if name != "found":
                yield from _numbers(f"{key}.{name}", value)
    elif isinstance(table, list):
        for k, value in enumerate(table):
            yield from _numbers(f"{key}[{k}]" if isinstance(value, Mapping) else key, value)
    elif isinstance(table, int | float):
        yield key, table
