"""What is measured of motions, and of storeys, floors and contacts: one list for all studies.

Allocation, checksums, the keys of ``output``, labels of figures, what summaries tell and the tables
of the documentation are made of it. Dimensions, here and in the lists of each study, are those of
the values of one run: a study puts the dimensions of its runs before them. The values come by the
same names from `hpcsweep.solvers.measures` and `hpcsweep.solvers.record_response`.
"""

from dataclasses import replace

from hpcsweep.model.observed import MAX_ORDER, MOTIONS, TABLE, Quantity
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

HARMONIC = "coordinate", "harmonic"
ROWS = tuple(
    real(f"row_{name}", dims, units, long_name, limits, optional=True, label=label)
    for name, dims, units, long_name, limits, label in (
        ("low", ("coordinate",), "length", "smallest value of a row", FINITE, "smallest value"),
        ("high", ("coordinate",), "length", "largest value of a row", FINITE, "largest value"),
        ("range", ("coordinate",), "length", "its half peak-to-peak", SIZE, "half peak-to-peak"),
        ("mean", ("coordinate",), "length", "its mean", FINITE, "mean"),
        ("rms", ("coordinate",), "length", "its root mean square", SIZE, "root mean square"),
        ("amplitude", HARMONIC, "length", "amplitude of a harmonic of a row", SIZE, "amplitude"),
        ("phase", HARMONIC, "1", "its phase in radians, as of `forcing.harmonics`", FINITE, ""),
    )
)
"""What rows of displacements do over the orbit or the window: those of `output.rows`."""
ROW_KEYS = (
    Key(
        "rows",
        "rows of the displacements of which smallest and largest value, half peak-to-peak, mean, "
        'rms and harmonics are stored: `"1"` a floor, `"2-1"` a difference, `"contact:1"`, '
        '`"drift:1"`, `"slider:1"`',
        [],
    ),
    Key("harmonics", "of these rows, amplitudes and phases of so many", 1, (1, MAX_ORDER)),
)

FLAGS = {quantity.name: quantity.flag for quantity in MOTIONS}
"""Those of motions that jobs request, and their flags, see `Observation.measures`."""
SUMS = ("impacts", "simultaneous", "impulse", "plastic", "slider_energy")
"""Those that grow with time: of motions they are those of a forcing period, and mean values."""
LIMITS = {
    **dict.fromkeys(("impulse", "dissipated", "plastic", "residual_drift"), FINITE),
    "contact_share": SHARE,
}
"""What is valid, if not sizes: a contact with a layer also pulls as it closes."""
OPTIONAL = "residual_drift", "strength_lost"
"""What may be missing in a complete run; summaries do not tell it."""
WHOLE = ("impacts", "simultaneous", "excursions")
"""Whole numbers of a response."""
A_PERIOD = " a forcing period"
POWERS = {"1": 0, "time": 0, "energy": 2}
"""Powers of a record's scale with which quantities grow where gaps grow with the scale; else 1."""


def _variable(quantity: Quantity) -> Variable:
    name, dim, units, meaning, label, *_ = quantity
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
    )


QUANTITIES = {quantity.name: _variable(quantity) for quantity in TABLE}
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
