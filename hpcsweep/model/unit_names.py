"""Names of the units of a structure for labels, and for g and the time of records.

Quantities are identified by their dimension (`length`, `velocity`, ...). The building of the paper
has units of its own: lengths in gaps, time in 1/omega_0. Any other structure is in consistent units
of the user, who may name them.
"""

import math
from typing import NamedTuple

QUANTITIES = {
    "length": ("gaps", "{length}"),
    "velocity": ("gaps omega_0", "{length}/{time}"),
    "acceleration": ("gaps omega_0^2", "{length}/{time}^2"),
    "frequency": ("omega_0", "rad/{time}"),
    "rate": ("omega_0", "1/{time}"),
    "time": ("1/omega_0", "{time}"),
    "force": ("k gaps", "{force}"),
    "impulse": ("k gaps/omega_0", "{force} {time}"),
    "energy": ("k gaps^2", "{force} {length}"),
    "mass": ("masses", "{mass}"),
    "stiffness": ("k", "{stiffness}"),
    "damping": ("k/omega_0", "{damping}"),
}
"""Units of the paper's building, and of any other one by the names of its own."""
GAPS = {quantity: unit for quantity, (unit, _) in QUANTITIES.items()}
NEWTONS = {
    **{("m", "kg", "s"): "N", ("m", "t", "s"): "kN", ("m", "kt", "s"): "MN"},
    **{("mm", "t", "s"): "N", ("mm", "kt", "s"): "kN", ("mm", "kg", "ms"): "kN"},
}
"""Names of forces, by length, mass and time."""


COLUMN = "column at"
"""In the name of a point of a column, before its height."""
OF_SOIL = "foundation", "rocking"
"""Names of the coordinates of a foundation, and of what yields beneath it."""


def is_level(name: str) -> bool:
    """Return whether a coordinate is a floor, or the slab on bearings, by its name."""
    return COLUMN not in name and not name.endswith(OF_SOIL)


class Names(NamedTuple):
    """Names of floors and of contacts, in order; empty where they only have numbers."""

    floors: tuple[str, ...] = ()
    contacts: tuple[str, ...] = ()
    storey_heights: tuple[float, ...] = ()
    """Height of each storey, of each drift; empty where unknown."""
    storeys: tuple[str, ...] = ()
    """Names of the drifts; empty where they are those of the floors, or numbers."""
    taken: tuple[float, ...] = ()
    """What P-Delta has taken from the stiffness of each storey, P / h; empty without."""


class UnitNames(NamedTuple):
    """Names of the units of length, mass and time; empty where not given."""

    length: str = ""
    mass: str = ""
    time: str = ""

    def of(self, quantity: str) -> str:
        """Return the unit of a quantity, in the user's units."""
        length, mass, time = self.length or "length", self.mass or "mass", self.time or "time"
        if quantity == "cycles":
            return "Hz" if time == "s" else f"1/{time}"
        newton = NEWTONS.get((length, mass, time))
        names = {
            "force": newton or f"{mass} {length}/{time}^2",
            "stiffness": f"{newton}/{length}" if newton else f"{mass}/{time}^2",
            "damping": f"{newton} {time}/{length}" if newton else f"{mass}/{time}",
        }
        return QUANTITIES[quantity][1].format(length=length, mass=mass, time=time, **names)


def unit_of(structure, quantity: str) -> str:
    """Return the unit of a quantity of a structure, or of several, as in "length; velocity".

    A quantity may be over another, "acceleration/time". Anything but a quantity (``1``, ``forcing
    periods``) is returned unchanged.
    """
    each = (
        "/".join(_unit_of(structure, name) for name in part.split("/"))
        for part in quantity.split("; ")
    )
    return "; ".join(each).replace("/1/omega_0", " omega_0")


def _unit_of(structure, quantity: str) -> str:
    if quantity not in (*GAPS, "cycles"):
        return quantity
    if is_in_own_units(structure):
        return structure.unit_names.of(quantity)
    if quantity in GAPS and ("gaps" not in GAPS[quantity] or is_in_gaps(structure)):
        return GAPS[quantity]
    return UnitNames(time="1/omega_0").of(quantity)


def is_in_gaps(structure) -> bool:
    """Return whether lengths are in gaps and times in 1/omega_0: equal storeys, all stops at 1."""
    model = _model(structure)
    return not is_in_own_units(model) and all(contact.gap == 1.0 for contact in model.contacts)


def is_in_own_units(structure) -> bool:
    """Return whether all units are the user's: of masses and times, too."""
    return any(structure.unit_names) or not _model(structure).is_uniform


def _model(structure):
    """Return the structure whose units another is described in, see `Structure.labelled`."""
    return getattr(structure, "in_units_of", structure)


def known_unit(structure, quantity: str) -> str:
    """Format the unit that follows a number; empty where it has no name."""
    has_name = any(structure.unit_names) or is_in_gaps(structure)
    return f" {unit_of(structure, quantity)}" if has_name else ""


def in_cycles(structure, omega: float) -> str:
    """Format, behind a frequency, what it is in cycles; empty where time has no unit."""
    if not structure.unit_names.time:
        return ""
    return f" = {omega / (2 * math.pi):.6g} {unit_of(structure, 'cycles')}"
