"""Variables of the results of a study of attractors."""

from hpcsweep.dynamics.classify import MotionClass
from hpcsweep.studies.settings import MEASURES, SweepSettings
from hpcsweep.studies.variable import CONTACT_SET, Variable
from hpcsweep.studies.variables import CYCLES, OUTCOME, RUN, STATES, measures_of_each

EACH = (*RUN, "attractor")
LIFETIME = ("transient_lifetime", "transient_lifetime_low", "transient_lifetime_high")
TRANSIENT = (
    Variable("n_transient", RUN, "<i4", "1", "starts that were transient chaos, wherever they end"),
    *(
        Variable(name, RUN, "<f8", "forcing periods", f"{which} of transient chaos")
        for name, which in zip(
            LIFETIME,
            ("mean lifetime", "lower end of the mean lifetime", "upper end of the mean lifetime"),
            strict=True,
        )
    ),
)
"""Outcome of the tests of lifetimes (`hpcsweep.dynamics.lifetime`)."""
VARIABLES = (
    Variable("n_attractors", RUN, "<i4", "1", "attractors found, more than stored if too many"),
    Variable("attractor_id", EACH, "<i4", "1", "identity along the amplitudes, 0 for none"),
    Variable(
        "motion_class",
        EACH,
        "<i1",
        "1",
        "motion: 2 periodic, 4 quasi-periodic, 5 chaotic",
        MotionClass,
    ),
    Variable("hits", EACH, "<i4", "1", "starts that reached the attractor"),
    Variable("share", EACH, "<f8", "1", "share of the box of starts"),
    Variable("share_low", EACH, "<f8", "1", "lower end of the share's confidence interval"),
    Variable("share_high", EACH, "<f8", "1", "upper end of the share's confidence interval"),
    Variable("orbit_period", EACH, "<i4", "forcing periods", "orbit period, 0 if it is no orbit"),
    Variable("multiplier", EACH, "<f8", "1", "modulus of the largest Floquet multiplier"),
    Variable("lyapunov", EACH, "<f8", "rate", "largest Lyapunov exponent"),
    Variable("lyapunov_low", EACH, "<f8", "rate", "lower end of the exponent's interval"),
    Variable("lyapunov_high", EACH, "<f8", "rate", "upper end of the exponent's interval"),
    Variable("contact", EACH, "<u8", "1", "contact set, bit k - 1 for contact k", CONTACT_SET),
    Variable("drift", EACH, "<f8", "A / Omega^2", "normalised peak interstorey drift"),
    Variable("modal_norm", (*EACH, "mode"), "<f8", "1", "mean modal norm free of contact"),
    *measures_of_each(EACH),
    Variable("point", (*EACH, "state"), "<f8", STATES, "a stroboscopic point"),
    Variable("n_points", EACH, "<i4", "1", "number of stroboscopic points stored"),
    Variable("poincare", (*EACH, "cycle", "state"), "<f8", STATES, "stroboscopic points"),
    Variable("n_undecided", RUN, "<i4", "1", "starts that were not classified"),
    *TRANSIENT,
    Variable("n_failed", RUN, "<i4", "1", "starts whose integration failed"),
    Variable("n_elsewhere", RUN, "<i4", "1", "starts that reached attractors not stored"),
    Variable("last_id", RUN, "<i4", "1", "largest identity given on the path so far"),
    CYCLES,
    OUTCOME,
)
OPTIONAL = ("contact", "drift", "modal_norm", *MEASURES)
"""Variables that a job may leave out."""


def attractor_variables(settings: SweepSettings) -> list[Variable]:
    """Return the variables of each point, in the order of the file."""
    out = set(OPTIONAL) - set(settings.metrics)
    return [variable for variable in VARIABLES if variable.name not in out]
