"""The keys of every study, and those of each: names, meanings, defaults and limits."""

import math
import re

from hpcsweep.job.forcing import N_HARMONICS
from hpcsweep.model.forcing import MAX_HARMONICS
from hpcsweep.model.matrices import MAX_FLOORS
from hpcsweep.model.unit_names import UnitNames
from hpcsweep.solvers.arguments import MAX_PERIOD
from hpcsweep.solvers.solver import SOLVERS
from hpcsweep.studies import settings
from hpcsweep.studies.keys import BLOCK, Key, Tables, names
from hpcsweep.studies.kinds import DEFAULT_KIND, KINDS, STUDIES
from hpcsweep.studies.quantities import METRIC_KEYS, ROW_KEYS
from hpcsweep.studies.variables import STOREY_HEIGHT

OF_STOREYS = ", above 0: a number, or a list of n, from the lowest on"
SIDES = (
    "distance of each floor at rest from the stop on its {}, of any sign, `inf` for no stop: a "
    "number, or a list of n"
)
OF_LEVELS = (
    "of the contacts between buildings: a number, or a list with one per level, the same between "
    "all neighbours of that level"
)
STRUCTURE: Tables = {
    "structure": (
        Key("n_floors", "storeys n on a fixed base", 3, (1, MAX_FLOORS)),
        Key("mass", "mass of each floor" + OF_STOREYS, told="1", units="mass"),
        Key(
            "storey_stiffness", "stiffness of each storey" + OF_STOREYS, told="1", units="stiffness"
        ),
        Key("gap", SIDES.format("right"), 1.0, units="length"),
        Key("gap_left", SIDES.format("left"), math.inf, units="length"),
        Key(
            "stiffness_ratio",
            "beta, stiffness of a stop over that of a storey, at least 0; 0: no stop, `inf`: a "
            "rigid one ([how](rigid.md)); a number, or a list of n",
            1000.0,
        ),
        Key(
            "sharpness",
            "rho of the sigmoid contact spring S(u) = 1/(1 + exp(-rho (u - 1))), per gap, at least "
            "0: a smooth stop by default; `inf` is the piecewise linear one, the default of "
            "`structure.matrices`, 0 a pre-tensioned spring of stiffness beta/2",
            10000.0,
        ),
        Key(
            "damping_ratio",
            "zeta of all modes of the free structure, at least 0, or a list with one per mode, "
            "lowest frequency first",
            0.05,
        ),
        Key(
            "rayleigh",
            "Rayleigh damping alpha M + beta K in place of `structure.damping_ratio`: "
            "`{ratio = 0.05, modes = [1, 3]}`, a damping ratio and the two modes that have it, or "
            "`periods = [0.8, 0.2]` for the modes; or `[alpha, beta]`",
        ),
        Key(
            "storey_damping",
            "c of a dashpot in each storey, besides, at least 0: a number, or a list of n",
            0.0,
            units="damping",
        ),
        Key(
            "restitution",
            "coefficient of restitution of the stops of a building, above 0 and at most 1: a "
            "dashpot beside each spring ([dashpots](structures.md#contacts-that-dissipate)); of "
            "[rigid](rigid.md) ones from 0 on; needs `sharpness = inf`; a number, or a list of n",
            told="no dashpot",
        ),
        Key("tension", "whether these dashpots may pull on the way out", told="false"),
        Key(
            "yield_drift",
            "drift at which each storey yields, above 0, `inf` for one that does not "
            "([how](yielding.md)); a number, or a list of n",
            told="none yields",
            units="length",
        ),
        Key("yield_force", "force at which it yields, in place of `yield_drift`", units="force"),
        Key(
            "hardening",
            "stiffness of a storey that yields over that before, from -0.1 to below 1",
            0.0,
        ),
        Key("flag_height", "of [flags](yielding.md#storeys-that-spring-back), from 0 to 1", 0.0),
        Key(
            "backbone",
            "table of storeys that [degrade](yielding.md#storeys-that-degrade): `theta_p`, "
            "`theta_pc`, and if wanted `theta_u`, `residual`, `Lambda`, `rule`, `kappa_f`, "
            "`kappa_d`; each a value, or a list of n",
            told="none degrades",
        ),
        Key(
            "p_delta",
            "whether the weight above each storey over its height is taken from its stiffness "
            "([how](yielding.md#p-delta-and-collapse))",
            False,
        ),
        Key(
            "weight",
            "weight of each floor, of p_delta" + OF_STOREYS,
            told="mass times g",
            units="force",
        ),
        Key(
            STOREY_HEIGHT.name,
            STOREY_HEIGHT.long_name + OF_STOREYS,
            told="not known",
            units=STOREY_HEIGHT.units,
        ),
        Key(
            "collapse_drift",
            "drift, of all storeys or of each, beyond which a motion has collapsed and ends, `inf` "
            "for none; goes with storeys that yield, or sliders",
            told="none",
            units="length",
        ),
        Key(
            "matrices",
            "table of matrices in place of a building ([how](structures.md#matrices)): `mass`, "
            "`stiffness`, and if wanted `damping`, `forcing`, `drift`",
        ),
        Key(
            "model",
            "table of a finite element model in place of a building ([how](models.md)): `file`, "
            "and if wanted `names`, `influence`, `fixed`, `outputs`, `reduce` and `damping_ratio`",
        ),
        Key(
            "contact",
            "tables `[[structure.contact]]`, at most 64, that go with matrices or a model: "
            "`direction`, `gap`, `stiffness`, and if wanted `damping`, c of a dashpot, and "
            "`tension`; with `stiffness = inf` `restitution` ([rigid stops](rigid.md))",
            told="damping 0, tension false",
        ),
        Key(
            "slider",
            "tables `[[structure.slider]]` that go with matrices or a model, of springs that yield "
            "([how](yielding.md)): `direction`, `stiffness`, `strength`, and if wanted `name`, and "
            "`kinetic`, the strength while it slips, `returns`, that at which it slips back, or "
            "`backbone`, a table of how it [degrades](yielding.md#storeys-that-degrade)",
        ),
        Key(
            "spring",
            "tables `[[structure.spring]]` that go with matrices, of multilinear springs: "
            "`direction` and `table`, points [d, F] of elongation and force",
        ),
    ),
    "forcing": (
        Key(
            "harmonics",
            "orders, 1 to 1000, amplitudes and phases of the forcing A sum a_h sin(h Omega tau + "
            "phi_h), at most 16; order 0, without a phase, is its mean A a_0",
            told="order 1",
            example="[{order = 1, amplitude = 1.0, phase = 0.0}]",
        ),
        Key(
            "samples",
            "in their place samples of any periodic forcing over A, at even times from 0 on, of "
            "one period 2 pi / Omega: it is the series of its mean and first harmonics",
            told="none",
        ),
        Key(
            "n_harmonics",
            f"of samples: harmonics besides the mean, from 1 to {MAX_HARMONICS - 1}",
            told=f"{N_HARMONICS}",
        ),
    ),
    "units": (
        *(
            Key(
                name,
                f'name of the unit of {name} of the job, such as "{unit}": it labels files, '
                "figures and messages, and converts nothing",
            )
            for name, unit in zip(UnitNames._fields, ("m", "kg", "s"), strict=True)
        ),
        Key("force", "in place of the mass, N, kN or MN: masses are then in kg, t or kt"),
    ),
    "pounding": (
        Key("gap", f"distance at rest {OF_LEVELS}", units="length"),
        Key("stiffness", f"stiffness {OF_LEVELS}", units="stiffness"),
        Key("sharpness", "rho of these contacts", told="inf"),
        Key(
            "restitution",
            "coefficient of restitution of two floors that collide, above 0 and at most 1: a "
            "number, or a list with one per level",
            told="no dashpot",
        ),
        Key(
            "damping",
            "in its place c of the dashpots themselves",
            told="no dashpot",
            units="damping",
        ),
        Key("tension", "whether the dashpots may pull", told="false"),
        Key(
            "bumper",
            "further straight lines of its force, `[[0.01, 5e8]]`: from which closing on it has "
            "which stiffness, above that before",
            told="none",
        ),
    ),
}
KEYS: Tables = {
    "": (
        Key(
            "name", "name of the results without folder", told="that of the file", example='"other"'
        ),
        Key(
            "part",
            "`[k, n]`: part k of n of a job, every n-th frequency, listed point, line or record "
            "([how](clusters.md#one-job-in-several-files)); `hpcsweep split` writes it",
            told="the whole",
        ),
        Key("title", "what the results are, for their file", told="name, study and structure"),
        Key("institution", "where they are made, for their file"),
        Key("license", "under which terms they may be used, for their file"),
        *(Key(table, "") for table in ("study", "structure", "forcing", "sweep", "solver")),
        *(Key(table, "") for table in ("output", "units")),
        Key(
            "building",
            "tables `[[building]]`, one, or several from left to right: `mass` of each floor, "
            "`storey_stiffness` (or `period`, the longest natural period of the building alone, "
            "with stiffnesses in proportion), `storey_height`, `damping_ratio` of its own modes or "
            "`rayleigh`, `storey_damping`, `name` "
            "([how](structures.md#buildings-that-pound-each-other)), `yield_drift` or "
            "`yield_force`, `hardening`, `flag_height`, `backbone`, `p_delta`, `weight` and "
            "`collapse_drift` ([storeys that yield](yielding.md)), and tables "
            "`[building.isolation]` ([base isolation](yielding.md#base-isolation)), "
            "`[building.column]` ([columns that are hit](structures.md#floors-that-hit-columns)) "
            "and `[building.soil]` ([soil](structures.md#foundations-and-bumpers))",
        ),
        *(Key(table, "") for table in ("pounding", "records")),
        Key(
            "vary",
            "table of keys of study, structure, pounding, sweep or solver with several values each "
            "([how](studies.md#several-values-of-a-key)): all is computed at every value of one "
            "with every value of another; `rows`, a CSV file or tables, has keys that vary "
            "together ([portfolios](studies.md#portfolios))",
        ),
        Key("branches", ""),
    ),
    "study": (Key("kind", "what is computed ([which](studies.md))", DEFAULT_KIND, tuple(STUDIES)),),
    **STRUCTURE,
    "sweep": (
        settings.TRANSIENT,
        settings.SAMPLING,
        Key(
            "max_orbit_period",
            "longest orbit period that is looked for, at most half of `sampling_cycles` and "
            f"{MAX_PERIOD}",
            16,
        ),
        Key(
            "period_tolerance",
            "two stroboscopic points are the same if no coordinate (u in gaps, v in gaps omega_0) "
            "differs by more: between 0 and 1",
            1e-6,
        ),
        Key(
            "classify_cycles",
            "forcing periods spent at most, beside the path, to classify a motion that the window "
            "leaves open, of which a part must see chaos outlive "
            f"([how](attractors.md)); 0: none; at most {settings.MAX_CYCLES}",
            told="50000, with bdf 0",
            example="50000",
        ),
        settings.SPECTRUM_ERROR,
        settings.SPECTRUM_CYCLES,
        Key(
            "initial_state",
            '`"rest"`, u = v = 0, or 2n numbers u_1 .. u_n, v_1 .. v_n: the start of each frame, '
            "of points of each run; of basins the components that the slice does not span; of L "
            "sliders p_1 .. p_L behind",
            "rest",
        ),
    ),
    "solver": (
        Key(
            "method",
            "`flow` is exact between contacts; `bdf` is scipy's BDF, the method of the published "
            "study, thousands of times slower",
            "flow",
            tuple(SOLVERS),
        ),
        Key(
            "rtol",
            "relative tolerance: from 1e-13 to 1e-2",
            told="1e-9, with bdf 1e-6",
            example="1e-9",
        ),
        Key(
            "skip",
            'rules that spare periods whose result is known: `"all"`, `"none"`, or a list of '
            '`"linear"`, `"converged"`, `"newton"` ([what they do](theory/skipping.md)); of '
            'records `"linear"`, `"ratio"` ([what they spare](earthquakes.md#work-that-is-spared))',
            "all",
        ),
    ),
    "output": (
        *METRIC_KEYS,
        *ROW_KEYS,
        Key(
            "max_points",
            "stroboscopic points, the last ones, stored of a run without an orbit: at least 2 "
            "`max_orbit_period`",
            told="all",
            example="100",
        ),
        BLOCK,
    ),
    "records": (),
    "branches": (),
}
"""Keys of every study; each adds its own (`keys` of its class)."""


UNITS = {
    **{key.name: key.units for table in ("pounding", "structure") for key in STRUCTURE[table]},
    **{"period": "time", "slab_mass": "mass", "stiffness": "stiffness", "radius": "length"},
    **{"strength": "force", "initial_stiffness": "stiffness", "wall_stiffness": "stiffness"},
    **{"sway_stiffness": "stiffness", "rocking_stiffness": "energy", "sway_damping": "damping"},
    **{"sway_strength": "force", "rocking_strength": "energy", "theta_p": "length"},
    **{"theta_pc": "length", "theta_u": "length", "Lambda": "length"},
}
"""Quantity of a key of a structure, a building, a contact, a slider or bearings, by its name."""


def bare(key: str) -> str:
    """Return the name of a key without its tables and its place in a list."""
    return re.sub(r"\[\d+\]", "", key).rpartition(".")[2]


def declared(study) -> Tables:
    """Return the keys of each table of a job of one kind of study."""
    return {
        table: (*study.keys.get(table, ()), *(() if table in study.without else keys))
        for table, keys in KEYS.items()
    }


def keys_of(study) -> dict[str, tuple[str, ...]]:
    """Return the names of the keys of each table of a job of one kind of study."""
    return {table: names(keys) for table, keys in declared(study).items()}


def every_key() -> dict[str, tuple[str, ...]]:
    """Return the keys of each table of a job of any kind of study, each once."""
    tables = [keys_of(study) for study in KINDS.values()]
    return {
        name: tuple(dict.fromkeys(key for table in tables for key in table[name])) for name in KEYS
    }
