"""Variables of the results of a study of basins: a run is a row of starts, or one of them."""

from dataclasses import replace
from enum import IntEnum

from hpcsweep.model.structure import Structure
from hpcsweep.studies.attractors.search import MAX_ATTRACTORS, UNSTORED
from hpcsweep.studies.attractors.variables import ATTRACTOR, OF_SPECTRUM, attractor_variables
from hpcsweep.studies.quantities import STATES
from hpcsweep.studies.settings import SweepSettings
from hpcsweep.studies.variable import ANY, VALID, Variable, code, count, real
from hpcsweep.studies.variables import AMPLITUDE, CYCLES, OMEGA, OUTCOME

RUN = ("direction", "row", "amplitude")
"""Dimensions of a row."""
START_RUN = ("direction", "row", "column")
"""Dimensions of a start."""
OF_LABEL = (
    "attractor that a start goes to: its attractor_id; -1 undecided, -2 failed, -3 one that is "
    "not listed"
)
ROW_AMPLITUDE = Variable("forcing_amplitude", ("row",), "<f8", *AMPLITUDE)
ROW_OMEGA = Variable("omega", ("row",), "<f8", *OMEGA)
ORDINATE = real("ordinate", ("row",), STATES, "second component of a row's starts")
OWN = {
    "attractor_id": "number of the attractor, 0 for none",
    "hits": "starts of the row that go to the attractor",
}
"""Long names of what is otherwise in studies of attractors."""
NOT_HERE = (
    *("share", "share_low", "share_high", "lyapunov_low", "lyapunov_high"),
    *OF_SPECTRUM,
)
NUMBERS = range(1, int(MAX_ATTRACTORS.limits[1]) + 1)
Label = IntEnum(  # type: ignore[misc]
    "Label", {**UNSTORED, **{f"attractor_{number}": number for number in NUMBERS}}
)
LABEL = code("label", ("column",), Label, OF_LABEL, failed=ANY)
VARIABLES = (
    LABEL,
    *(
        replace(v, long_name=OWN.get(v.name, v.long_name))
        for v in ATTRACTOR
        if v.name not in NOT_HERE
    ),
    count("n_undecided", (), "starts of the row that were not classified", failed=VALID),
    count("n_failed", (), "starts of the row whose integration failed", failed=VALID),
    count("n_elsewhere", (), "starts of the row that went to none of the list", failed=VALID),
    CYCLES,
    OUTCOME,
)
START_VARIABLES = [replace(LABEL, dims=()), CYCLES, OUTCOME]


def basin_variables(settings: SweepSettings, structure: Structure) -> list[Variable]:
    """Return the variables of each row, in the order of the file."""
    return attractor_variables(settings, structure, VARIABLES)


def of_attractors(settings: SweepSettings, structure: Structure) -> list[Variable]:
    """Return those variables of a row that have a value for each attractor."""
    listed = basin_variables(settings, structure)
    return [each for each in listed if "attractor" in each.dims]


def listed_variables(settings: SweepSettings, structure: Structure) -> list[Variable]:
    """Return the variables of the attractors that a refined map lists for each row.

    They are those of a row, but for its own `hits`.
    """
    return [
        variable.along(START_RUN[:2])
        for variable in of_attractors(settings, structure)
        if variable.name != "hits"
    ]
