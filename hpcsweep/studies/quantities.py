"""What is measured of motions, and of storeys, floors and contacts: one list for all studies.

Allocation, checksums, the keys of ``output``, labels of figures, what summaries tell and the tables
of the documentation are made of it. Dimensions, here and in the lists of each study, are those of
the values of one run: a study puts the dimensions of its runs before them. The values come by the
same names from `hpcsweep.solvers.measures` and `hpcsweep.solvers.record_response`.
"""

from dataclasses import replace

from hpcsweep.model import kernel_model
from hpcsweep.solvers.measures import IMPACT_FLAG
from hpcsweep.studies.keys import Key, names
from hpcsweep.studies.variable import BELOW_INFINITY, FINITE, SHARE, SIZE, Variable, contacts, real

STATES = "length; velocity"
POINTS = real("poincare", ("point", "state"), STATES, "stroboscopic points", None)
CONTACT = contacts("contact", ())
DRIFT = real("drift", (), "A / Omega^2", "normalised peak interstorey drift", optional=True)
MODAL_NORM = real(
    "modal_norm", ("mode",), "1", "mean modal norm free of contact", SHARE, optional=True
)
LYAPUNOV = real("lyapunov", (), "rate", "largest Lyapunov exponent", BELOW_INFINITY, optional=True)
LYAPUNOV_SPECTRUM = real(
    "lyapunov_spectrum",
    ("exponent",),
    "rate",
    "Lyapunov exponents, largest first",
    BELOW_INFINITY,
    optional=True,
)

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
        "residual_drift",
        "storey",
        "length",
        "lasting drift of each storey; NaN: collapsed",
        "residual storey drift",
    ),
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
    "storey_drift": kernel_model.DRIFT,
    "displacement": kernel_model.FLOOR,
    "floor_acceleration": kernel_model.ACCELERATION,
    "contact_force": kernel_model.CONTACT,
    "impacts": IMPACT_FLAG,
    "impact_velocity": IMPACT_FLAG,
    "impulse": IMPACT_FLAG,
    "contact_share": IMPACT_FLAG,
}
"""Those of motions that jobs request, and their flags, see `Observation.measures`."""
SUMS = ("impacts", "impulse", "plastic", "slider_energy")
"""Those that grow with time: of motions they are those of a forcing period, and mean values."""
LIMITS = {
    **dict.fromkeys(("impulse", "dissipated", "plastic", "residual_drift"), FINITE),
    "contact_share": SHARE,
}
"""What is valid, if not sizes: a contact with a layer also pulls as it closes."""
OPTIONAL = ("residual_drift",)
"""What may be missing in a complete run; summaries do not tell it."""
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
        optional=name in OPTIONAL,
        label=label,
        tallied=bool(label) and name not in OPTIONAL,
        source=SOURCES.get(name, name),
    )


QUANTITIES = {row[0]: _variable(*row) for row in TABLE}
"""Variables of responses, their dimensions those of the values of one run."""
MEASURES = tuple(FLAGS)
CONTACT_MEASURES = tuple(name for name in FLAGS if QUANTITIES[name].dims == ("stop",))
FLOOR_MEASURES = tuple(name for name in FLAGS if QUANTITIES[name].dims == ("floor",))


def of_motions(name: str) -> Variable:
    """Return a quantity as a variable of motions."""
    variable, end = QUANTITIES[name], A_PERIOD * (name in SUMS)
    long_name, label = variable.long_name + end, variable.label + end
    return replace(variable, dtype="<f8", long_name=long_name, label=label)


IN_WORDS = {"A / Omega^2": ", in A/Omega^2", "rate": ", per unit of time"}


def _metric(variable: Variable, default: bool = False, more: str = "") -> Key:
    """Return the key that asks for a variable: its meaning, its unit in words, and more."""
    return Key(variable.name, variable.long_name + IN_WORDS.get(variable.units, "") + more, default)


METRIC_KEYS = (
    _metric(POINTS, True, " (u, v)"),
    _metric(CONTACT, True),
    _metric(DRIFT, True),
    _metric(MODAL_NORM, True),
    _metric(
        LYAPUNOV,
        more="; without it, and with `sweep.classify_cycles = 0`, nothing is called chaotic or "
        "quasi-periodic",
    ),
    _metric(
        LYAPUNOV_SPECTRUM,
        more=", with their errors, and the Kaplan-Yorke dimension of the stroboscopic points",
    ),
    *(_metric(of_motions(name)) for name in FLAGS),
)
METRICS = names(METRIC_KEYS)
"""Optional results of a job; the final state, period, cycles and outcome are always kept."""
