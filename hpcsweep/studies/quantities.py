"""What is measured of storeys, floors, contacts and sliders: one list for all kinds of studies.

Allocation, checksums, the keys of ``output``, labels of figures, what summaries tell and the tables
of the documentation are made of it. The values come by the same names from
`hpcsweep.solvers.measures` and `hpcsweep.solvers.record_response`.
"""

from dataclasses import replace

from hpcsweep.model.kernel_model import ACCELERATION, CONTACT, DRIFT, FLOOR
from hpcsweep.solvers.measures import IMPACT_FLAG
from hpcsweep.studies.variable import FINITE, SHARE, SIZE, Variable

TABLE = (
    ("storey_drift", "storey", "length", "peak drift of each storey", "peak storey drift"),
    ("displacement", "floor", "length", "peak displacement of each floor", "peak displacement"),
    (
        "floor_acceleration",
        "floor",
        "acceleration",
        "peak absolute acceleration of each floor",
        "peak floor acceleration",
    ),
    ("contact_force", "stop", "force", "peak force of each contact", "peak contact force"),
    ("impacts", "stop", "1", "closings of each contact", "impacts"),
    ("impact_velocity", "stop", "velocity", "largest closing speed", "largest closing speed"),
    ("impulse", "stop", "impulse", "impulse of each contact", "impulse"),
    (
        "contact_share",
        "stop",
        "1",
        "share of time each contact is closed",
        "share of time in contact",
    ),
    ("contact_time", "stop", "time", "time each contact is closed", ""),
    ("dissipated", "stop", "energy", "energy that each contact has taken", ""),
    (
        "ductility",
        "slider",
        "1",
        "peak elongation of each slider over that of yielding",
        "ductility",
    ),
    ("slider_force", "slider", "force", "peak force of each slider", ""),
    ("plastic", "slider", "length", "lasting elongation that each slider gains", ""),
    ("plastic_path", "slider", "length", "sum of its changes", ""),
    ("excursions", "slider", "1", "how often each slider has slipped", "excursions"),
    ("slider_energy", "slider", "energy", "energy that each slider dissipates", ""),
    (
        "base_shear",
        "building",
        "force",
        "peak reaction of the base of each building",
        "peak base shear",
    ),
)
"""Name, dimension of one run, quantity of the unit, meaning, and label of figures: those that have
one are told by summaries, where they are largest. In the order of files."""
FLAGS = {
    "storey_drift": DRIFT,
    "displacement": FLOOR,
    "floor_acceleration": ACCELERATION,
    "contact_force": CONTACT,
    "impacts": IMPACT_FLAG,
    "impact_velocity": IMPACT_FLAG,
    "impulse": IMPACT_FLAG,
    "contact_share": IMPACT_FLAG,
}
"""Those of motions that jobs request, and their flags, see `Observation.measures`."""
SUMS = ("impacts", "impulse", "plastic", "slider_energy")
"""Those that grow with time: of motions they are those of a forcing period, and mean values."""
LIMITS = {"impulse": FINITE, "contact_share": SHARE, "dissipated": FINITE, "plastic": FINITE}
"""What is valid, if not sizes: a contact with a layer also pulls as it closes."""
WHOLE = ("impacts", "excursions")
"""Whole numbers of a response."""
SOURCES = {"storey_drift": "drift", "contact_force": "force"}
"""Fields of a `Response` with other names."""
A_PERIOD = " a forcing period"
POWERS = {"1": 0, "time": 0, "energy": 2}
"""Powers of a record's scale with which quantities grow where gaps grow with the scale; else 1."""


def _variable(name: str, dim: str, units: str, meaning: str, label: str) -> Variable:
    return Variable(
        name,
        (dim,),
        "<i4" if name in WHOLE else "<f8",
        units,
        meaning,
        limits=LIMITS.get(name, SIZE),
        label=label,
        tallied=bool(label),
        source=SOURCES.get(name, name),
    )


QUANTITIES = {row[0]: _variable(*row) for row in TABLE}
"""Variables of responses, their dimensions those of the values of one run."""
MEASURES = tuple(FLAGS)
CONTACT_MEASURES = tuple(name for name in FLAGS if QUANTITIES[name].dims == ("stop",))
FLOOR_MEASURES = tuple(name for name in FLAGS if QUANTITIES[name].dims == ("floor",))


def of_motions(name: str, dims: tuple[str, ...] = ()) -> Variable:
    """Return a quantity as a variable of motions, whose dimensions come first."""
    variable, end = QUANTITIES[name].along(dims), A_PERIOD * (name in SUMS)
    long_name, label = variable.long_name + end, variable.label + end
    return replace(variable, dtype="<f8", long_name=long_name, label=label)
