"""Variables of the results of a study of attractors."""

from dataclasses import replace

from hpcsweep.dynamics.classify import MotionClass
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.offers import ISOLATED
from hpcsweep.studies import quantities, variables
from hpcsweep.studies.settings import SweepSettings
from hpcsweep.studies.variable import ANY, FINITE, VALID, Variable, code, count, real

EACH = ("attractor",)
SLOTS = {"attractor": "attractor_id"}
LIFETIME = {
    "transient_lifetime": "mean lifetime",
    "transient_lifetime_low": "lower end of the mean lifetime",
    "transient_lifetime_high": "upper end of the mean lifetime",
}
TRANSIENT = (
    count("n_transient", (), "starts that were transient chaos, wherever they end", failed=VALID),
    *(
        real(name, (), "forcing periods", f"{which} of transient chaos", None, failed=ANY)
        for name, which in LIFETIME.items()
    ),
)
"""Outcome of the tests of lifetimes (`hpcsweep.dynamics.lifetime`)."""
ATTRACTOR = (
    count("attractor_id", EACH, "identity along the amplitudes, 0 for none"),
    code("motion", EACH, MotionClass, "motion: 2 periodic, 4 quasi-periodic, 5 chaotic"),
    count("hits", EACH, "starts that reached the attractor"),
    real("share", EACH, "1", "share of the box of starts", None),
    real("share_low", EACH, "1", "lower end of the share's confidence interval", None),
    real("share_high", EACH, "1", "upper end of the share's confidence interval", None),
    count("orbit_period", EACH, "orbit period, 0 if it is no orbit", "forcing periods"),
    real("multiplier", EACH, "1", "modulus of the largest Floquet multiplier", None),
    quantities.LYAPUNOV.along(EACH),
    real("lyapunov_low", EACH, "rate", "lower end of the exponent's interval", None),
    real("lyapunov_high", EACH, "rate", "upper end of the exponent's interval", None),
    *(variable.along(EACH) for variable in variables.SPECTRUM),
    quantities.CONTACT.along(EACH),
    quantities.DRIFT.along(EACH),
    quantities.MODAL_NORM.along(EACH),
    *(
        replace(quantities.of_motions(name), optional=True).along(EACH)
        for name in quantities.MEASURES
    ),
    *(
        variable.along(EACH)
        for variable in variables.RUN_VARIABLES
        if variable.name in variables.OF_SLIDERS
    ),
    count("families", EACH, "dimensions of the family of orbits that is the attractor"),
    real("point", (*EACH, "state"), quantities.STATES, "a stroboscopic point", FINITE),
)
"""Variables of an attractor."""
VARIABLES = (
    count("n_attractors", (), "attractors found, more than stored if too many", failed=VALID),
    *ATTRACTOR,
    count("n_points", EACH, "number of stroboscopic points stored"),
    real("poincare", (*EACH, "cycle", "state"), quantities.STATES, "stroboscopic points", None),
    count("n_undecided", (), "starts that were not classified", failed=VALID),
    *TRANSIENT,
    count("n_failed", (), "starts whose integration failed", failed=VALID),
    count("n_elsewhere", (), "starts that reached attractors not stored", failed=VALID),
    count("last_id", (), "largest identity given on the path so far", failed=VALID),
    variables.CYCLES,
    variables.OUTCOME,
)
OF_SPECTRUM = tuple(each.name for each in variables.SPECTRUM)
OPTIONAL = ("contact", "drift", "modal_norm", *quantities.MEASURES, *OF_SPECTRUM)
"""Variables that a job may leave out."""


def attractor_variables(
    settings: SweepSettings, structure: Structure, every: tuple[Variable, ...] = VARIABLES
) -> list[Variable]:
    """Return those of the variables of each point that a job has, in the order of the file."""
    out = set(OPTIONAL) - set(settings.metrics) | variables.without_contacts(structure)
    if "lyapunov_spectrum" in settings.metrics:
        out -= set(OF_SPECTRUM)
    if ISOLATED.of(structure):
        out |= {*variables.OF_SLIDERS, "families"}
    return [variable for variable in every if variable.name not in out]
