"""Meaning of every key of a job, from which the table of the documentation is made.

Links are those of a page in `docs`. The default is that of the template unless it is given here.
"""

KEY_MEANINGS: dict[str, tuple[str, ...]] = {
    "extends": (
        "another job file, of which this one gives what differs "
        "([how](studies.md#jobs-made-of-other-jobs))",
        "",
    ),
    "name": ("name of the results", "that of the file, without `.toml`"),
    "study.kind": ("what is computed ([which](studies.md))",),
    "study.points": (
        "list of pairs [A, Omega], in place of `sweep.omega` and `sweep.amplitude`",
        "",
    ),
    "study.refine": (
        "table: the map is computed "
        "[only where something happens](growing.md#maps-computed-only-where-something-happens)",
        "all points are computed",
    ),
    "study.refine.levels": (
        "the coarsest cells have 2^levels steps of the grid a side, 1 to 12",
        "4",
    ),
    "study.refine.on": (
        'what the points of a cell must agree in: a list of `"class"` (of motion, and the orbit '
        'period) or `"period"` (which does not tell chaos, tori and long periods apart), and '
        '`"contact"`; of attractors their `"number"`, of basins the `"attractor"`',
        "class and contact, or what there is",
    ),
    "study.refine.wrong": (
        "share of the inferred points below which the upper end of the interval of the wrong ones "
        "must lie, between 0 and 1",
        "0.003",
    ),
    "study.refine.seed": ("of the points that the audit draws", "0"),
    "study.refine.curves": (
        "results of a [study of branches](branches.md#curves-of-a-study), a file or a list of "
        "files, where the job is run: cells that their curves cross are cut down to the grid",
        "none",
    ),
    "study.starts": (
        "starting states at each point; of basins, starts on the slice that find the attractors",
        "459",
    ),
    "study.seed": ("of the sequence of starts", "0"),
    "study.displacement, study.velocity": (
        "box of the starts: `[low, high]`, or a list of n such pairs",
        "minus to plus the widest gap, and that times $\\omega_0$ (with units of your own: times "
        "the lowest natural frequency)",
    ),
    "study.max_attractors": (
        "attractors stored at a point, or listed for basins, those with the largest shares; at "
        "most 64",
        "8",
    ),
    "study.confidence": ("confidence level of the intervals of shares, 0.5 to below 1", "0.95"),
    "study.max_cycles": (
        "forcing periods for which a motion is followed to classify it, after a transient as long, "
        "or of `sweep.transient_cycles` if that is shorter; the motions without period that are "
        "tested together must outlive 24 times as many at a confidence of 95 %",
        "5000",
    ),
    "study.match_distance": (
        "largest distance, in units of the state, at which an attractor keeps the identity of one "
        "at the amplitude before",
        "0.2",
    ),
    "study.components": (
        "the two components of the state that span the slice, `u_1` .. `u_n`, `v_1` .. `v_n`, "
        "of buildings `u_A1` ..",
        '["u_1", "v_1"]',
    ),
    "study.horizontal, study.vertical": (
        "values of the two components, ascending, two or more each (`horizontal`: at most 100,000)",
        "200 over the range of `study.displacement` or `study.velocity`",
    ),
    "structure.n_floors": ("storeys n, 1 to 64",),
    "structure.mass, structure.storey_stiffness": (
        "mass of each floor and stiffness of each storey, from the lowest on, above 0: a number, "
        "or a list of n",
        "1",
    ),
    "structure.gap, structure.gap_left": (
        "distance of each floor at rest from the stop on its right, and on its left; any sign; "
        "`inf` for no stop; a number, or a list of n",
    ),
    "structure.stiffness_ratio": (
        "beta, stiffness of a stop over that of a storey, at least 0; 0: no stop; a number, or a "
        "list of n",
    ),
    "structure.sharpness": (
        "rho of the sigmoid contact spring, at least 0; `inf` is the piecewise linear stop, 0 a "
        "pre-tensioned spring of stiffness beta/2",
    ),
    "structure.restitution": (
        "coefficient of restitution of the stops of a building, above 0 and at most 1: a dashpot "
        "beside each spring ([dashpots](structures.md#contacts-that-dissipate)); needs `sharpness "
        "= inf`; a number, or a list of n",
        "no dashpot",
    ),
    "structure.tension": ("whether these dashpots may pull on the way out", "false"),
    "structure.damping_ratio": (
        "zeta of all modes, or a list with one per mode, lowest frequency first",
    ),
    "structure.rayleigh": (
        "[alpha, beta] of the damping matrix alpha M + beta K, in place of "
        "`structure.damping_ratio`",
        "",
    ),
    "structure.matrices": (
        "table of matrices in place of a building ([how](structures.md#matrices))",
        "",
    ),
    "structure.contact": (
        "tables `[[structure.contact]]`, at most 64, that go with matrices: `direction`, `gap`, "
        "`stiffness`, and if wanted `damping`, c of a dashpot, and `tension`",
        "damping 0, tension false",
    ),
    "building": (
        "tables `[[building]]`, two or more from left to right: `mass` of each floor, "
        "`storey_stiffness` (or `period`, the longest natural period of the building alone, with "
        "stiffnesses in proportion), `storey_height`, `damping_ratio` of its own modes or "
        "`rayleigh`, `name` ([how](structures.md#buildings-that-pound-each-other))",
        "",
    ),
    "pounding.gap, pounding.stiffness, pounding.sharpness": (
        "of the contacts between buildings: a number, or a list with one per level",
        "sharpness inf",
    ),
    "pounding.restitution, pounding.damping, pounding.tension": (
        "coefficient of restitution of two floors that collide, above 0 and at most 1, or c of the "
        "dashpot itself: a number, or a list with one per level; whether the dashpots may pull",
        "no dashpot, false",
    ),
    "units.length, units.mass, units.time": (
        'names of the units of the job, such as "m", "kg", "s": they label files, figures and '
        "messages, and convert nothing",
        "",
    ),
    "forcing.harmonics": (
        "orders, amplitudes and phases of the forcing A sum a_h sin(h Omega tau + phi_h), at most "
        "16",
        "order 1",
    ),
    "sweep.omega": ("forcing frequencies, one frame each, above 0; of basins a single one", ""),
    "sweep.frequency": (
        "the same in cycles per unit of time (hertz where that is a second), in place of "
        "`sweep.omega`",
        "",
    ),
    "sweep.amplitude": (
        "forcing amplitudes, at least 0, ascending; of basins a single one",
        "",
    ),
    "sweep.directions": ('`["up"]` or `["up", "down"]`',),
    "sweep.transient_cycles": ("forcing periods discarded",),
    "sweep.sampling_cycles": ("forcing periods of the steady window",),
    "sweep.max_orbit_period": (
        "longest orbit period that is looked for, at most half the window and 10,000",
    ),
    "sweep.period_tolerance": ("distance below which two stroboscopic points are the same",),
    "sweep.classify_cycles": (
        "forcing periods spent at most, beside the path, to classify a motion that the window "
        "leaves open, a 160th of them to see chaos outlive (of an independent run a fifth, below "
        "grazing all); 0: none",
        "50000 (bdf: 0)",
    ),
    "sweep.initial_state": (
        '`"rest"`, u = v = 0, or 2n numbers (u, v): the start of each frame, of points of each '
        "run; of basins the components that the slice does not span",
    ),
    "solver.method": ('`"flow"`, or `"bdf"` (scipy\'s BDF, the method of the published study)',),
    "solver.rtol": ("relative tolerance, 1e-13 to 1e-2", "1e-9 (bdf: 1e-6)"),
    "solver.skip": (
        'rules that spare periods whose result is known: `"all"`, `"none"`, or a list of `linear`, '
        "`converged`, `newton` ([what they do](theory/skipping.md)); of records `linear`, `ratio` "
        "([what they spare](earthquakes.md#work-that-is-spared))",
    ),
    "output.poincare, output.contact, output.drift, output.modal_norm": (
        "stroboscopic points, contact set, drift, modal norms",
        "true",
    ),
    "output.lyapunov": (
        "largest Lyapunov exponent; without it, and with `sweep.classify_cycles = 0`, nothing is "
        "called chaotic or quasi-periodic",
    ),
    "output.storey_drift, output.displacement, output.acceleration, output.contact_force": (
        "peaks over continuous time in the window: drift of each storey, displacement and absolute "
        "acceleration of each floor, force of each contact",
        "false",
    ),
    "output.impacts, output.impact_velocity, output.impulse, output.contact_time": (
        "of each contact: closings a forcing period, largest closing speed, impulse a period, "
        "share of the time in contact",
        "false",
    ),
    "output.max_points": (
        "points, the last ones, stored of a run without an orbit; at least 2 `max_orbit_period`",
        "all",
    ),
    "output.block": (
        "amplitudes committed to the file together, the most that a stop or a kill loses",
        "50 (points, attractors, rows of basins, and with `bdf`: 1; records: 25 scales)",
    ),
    "output.times, output.alone": (
        "the times of the peaks; the peaks without contacts, and the gaps that would not have "
        "closed",
        "true",
    ),
    "output.history": (
        "step in time at which the motion itself is stored, of every run: a whole multiple or a "
        "whole part of the time between samples ([size and price](earthquakes.md#a-study))",
        "none",
    ),
    "records.files": (
        'files, folders or patterns, relative to the job file, such as `["*.AT2"]` '
        "([formats](earthquakes.md#a-record)); the stored job has the whole paths",
        "",
    ),
    "records.synthetic": (
        "in their place a suite to be made: `count`, `seed`, `dt`, `duration`, `rms`, `soil` "
        "([what it is](earthquakes.md#a-record))",
        "1, 0, 0.01, 30, 1, firm",
    ),
    "records.unit, records.gravity": (
        "unit of the numbers in the files (`g`, `%g`, `mg`, `m/s2`, `cm/s2`, `mm/s2`, `in/s2`, "
        "`ft/s2`, `structure`), and one g in the units of the structure, which must fit `units`",
        "g; by `units`, or 9.80665",
    ),
    "records.dt": ("time in seconds between samples, for files that do not say it", ""),
    "records.scale": (
        'table: `by` an intensity measure, `"factor"`, `"pga"`, `"pgv"`, `"sa"` with `period`, or '
        '`"avgsa"` with `periods`, both with `damping_ratio`; and the intensities, above 0, a '
        "range or `values`",
        '`{by = "factor", values = [1.0]}`, 0.05',
    ),
    "records.tail": ("time of free motion after each record", "0"),
    "records.found": (
        "names, checksums and measures of the records, which hpcsweep adds when it loads the job",
        "",
    ),
    "branches.seeds": (
        "results files of sweeps, points or attractors, one or a list, relative to where the job "
        "is run: branches go through their periodic motions ([how](branches.md#a-study))",
        "",
    ),
    "branches.parameter": (
        'what changes along a branch: `"amplitude"`, `"omega"`, `"stiffness_ratio"`, `"gap"`, '
        '`"sharpness"`, `"damping_ratio"`',
        "amplitude",
    ),
    "branches.span": (
        "lowest and highest value of the parameter",
        "those of `sweep.amplitude`, or `sweep.omega`",
    ),
    "branches.steps, branches.largest_step": (
        "most points of a branch to either side of a motion; longest step, in units of the state "
        "and of the span",
        "2000, 0.05",
    ),
    "branches.max_branches, branches.max_points, branches.max_seeds": (
        "room for each line",
        "64, 20000, 4000",
    ),
    "branches.starts, branches.seed": (
        "starts of a search for orbits that no motion shows; seed of their sequence",
        "0, 0",
    ),
    "branches.curves": (
        'kinds of special points, a list of `"fold"`, `"doubling"`, `"torus"`, `"grazing"`, that '
        "are followed over A and Omega, of orbits up to `sweep.max_orbit_period`, each line's half "
        "way to the next line "
        "([how](branches.md#curves-of-a-study)); with `branches.parameter` amplitude",
        "[]",
    ),
    "branches.curve_span": ("lowest and highest frequency of curves", "those of `sweep.omega`"),
    "branches.max_curves, branches.max_curve_points": ("room for each line", "256, 5000"),
    "vary": (
        "table of keys with several values each ([how](studies.md#several-values-of-a-key))",
        "",
    ),
}
"""Keys, with commas between those that share a row, to their meaning and, where the template does
not show it, their default."""
