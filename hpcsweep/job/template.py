"""A job to start from: every key with its meaning, unit, range and default."""

TEMPLATE = """\
# A job of hpcsweep: TOML. It is complete, and takes seconds:
#     mpirun -n 2 hpcsweep run FILE.toml       computes FILE.h5; hpcsweep run FILE.toml works too
#     hpcsweep plot FILE.h5 -o FILE.png        draws it
#     hpcsweep run FILE.toml --dry-run         predicts the cost of a larger one
#
# A key behind a # has its default, which is shown; take the # away to give it another value.
#
# Lengths are in gaps, from a floor at rest to the stop, so that the stop is at 1. Time is in
# 1/omega_0, where omega_0 = sqrt(k/m) of one storey. With u the floors' displacements
#
#     u'' + 2 gamma C u' + K u + beta S(u) (u - 1) = -A sin(Omega tau)

# Another job, whose path is relative to this file: what is given here replaces what is there.
#extends = "other.toml"

# Name of the results, without folder; default: the name of this file.
#name = "other"

[study]
# "amplitude_sweep": at each frequency the amplitudes in their order, each from where the one before
# it ended. "points": every amplitude at every frequency from the initial state, each on its own;
# or, with points = [[A, Omega], [A, Omega], ...] here and neither omega nor amplitude below, the
# points of that list. With refine = {levels = 4, on = ["class", "contact"], wrong = 0.003,
# seed = 0} a grid of points is computed only where something happens: cells of 2**levels steps a
# side (levels from 1 to 12) are cut until their points agree in the class of motion ("period": in
# the orbit period alone) and the contacts, points inside are inferred, and of these some are
# computed until the share of wrong ones is less than wrong (between 0 and 1); seed draws them. It
# has no directions. "attractors": at each amplitude all attractors that
# starts = 459 states of a box reach (displacement = [-1.0, 1.0] and velocity = [-1.0, 1.0], or n
# pairs each; seed = 0 gives them), after those of the amplitude before. It has no directions, but
# max_attractors = 8 that are stored, confidence = 0.95 of the intervals of their shares,
# max_cycles = 5000 after which a motion is undecided, and match_distance = 0.2 over which an
# attractor is the one of the amplitude before; refine = {levels = 4, wrong = 0.003} maps their
# number likewise, each point then on its own. "basins": at one frequency and one amplitude, to
# which attractor the starts of a slice go; components = ["u_1", "v_1"] of the state are those of
# the slice, horizontal = {from = -1.0, to = 1.0, count = 200} their values along a row and
# vertical = the same from row to row, the others those of initial_state; starts = 459 of the slice
# find the attractors; refine = {levels = 4, wrong = 0.003} maps the slice likewise, each
# start then on its own. "records": the response to ground-motion records, each at several scales,
# from rest; it has the table [records], at the end, in place of forcing and sweep. "branches": the
# curves of periodic orbits, stable or not, through all motions of results files; it has the table
# [branches], at the end.
#kind = "amplitude_sweep"

[structure]
# Storeys n on a fixed base: a whole number from 1 to 64.
#n_floors = 3

# Distance of the floors at rest from the stops on their right and on their left, of any sign, inf
# where there is none: one number, or a list of n. Likewise the masses and the stiffnesses of the
# storeys, above 0: a job with these (mass = [2e4, 1e4, 1e4], storey_stiffness = 3e7) has units of
# its own.
#gap = 1.0
#gap_left = inf

# beta, stiffness of the stop over that of a storey: at least 0, which is no stop; or a list of n.
#stiffness_ratio = 1000.0

# rho, sharpness of the contact spring in S(u) = 1/(1 + exp(-rho (u - 1))), per gap: at least 0;
# inf is the piecewise linear stop. With it stops may have a dashpot beside their spring, given by
# the restitution of a collision, above 0 and at most 1, one number or a list of n; with
# tension = true it may pull on the way out.
#sharpness = 1e4

# zeta, damping ratio of the free structure's modes: at least 0, one number for all of them, or a
# list of n, lowest frequency first. Or rayleigh = [alpha, beta], for alpha M + beta K.
#damping_ratio = 0.05

# In place of a building: [structure.matrices] with mass and stiffness, if wanted damping, forcing
# and drift, and [[structure.contact]] with direction, gap, stiffness, and if wanted damping of a
# dashpot and tension; see docs/structures.md.
# Or buildings that pound each other, from left to right, two [[building]] or more with mass,
# storey_stiffness or period, storey_height, damping_ratio or rayleigh, and name, and [pounding]
# with gap, stiffness, and if wanted restitution or damping, tension, sharpness. [units] with
# length = "m", mass = "kg", time = "s" names the units in which all this is given, for labels
# alone: nothing is converted.

[forcing]
# A sum of a_h sin(h Omega tau + phi_h): up to 16 orders h from 1 to 1000.
#harmonics = [{order = 1, amplitude = 1.0, phase = 0.0}]

[sweep]
# Omega, forcing frequency in omega_0: greater than 0. One number, a list of them, or a range:
#     {from = 0.3, to = 0.6, count = 31}    or    {from = 0.3, to = 0.6, step = 0.01}
# Each is a frame, the work of one rank at a time. Or frequency in its place: cycles per unit of
# time.
omega = 0.445

# A, amplitude of the forcing acceleration in gaps omega_0^2: at least 0, ascending. Likewise.
amplitude = {from = 0.005, to = 0.25, step = 0.0025}

# Ways through the amplitudes: ["up"], or ["up", "down"], the way back too.
#directions = ["up", "down"]

# Forcing periods that are discarded at each amplitude: a whole number from 0 to 10000000.
#transient_cycles = 100

# Forcing periods after them, of which the results are: a whole number from 1 to 10000000.
#sampling_cycles = 100

# Longest orbit period that is looked for, in forcing periods: from 1 to half of sampling_cycles;
# default: 16, or that half where it is less.
#max_orbit_period = 16

# Two stroboscopic points are the same if no coordinate (u in gaps, v in gaps omega_0) differs by
# more than this: between 0 and 1.
#period_tolerance = 1e-6

# Forcing periods for which a run whose motion these leave open is integrated on, until it is known
# to be periodic, chaotic or on a torus; the next run starts from where they ended in either case. A
# whole number from 0, which takes the window alone, to 10000000; default: 50000, with bdf 0.
#classify_cycles = 50000

# State at which each frame begins: "rest", or a list of 2 n numbers, u_1 .. u_n, v_1 .. v_n.
#initial_state = "rest"

[solver]
# "flow" is exact between contacts; "bdf" is scipy's BDF, thousands of times slower.
#method = "flow"

# Relative tolerance: from 1e-13 to 1e-2; default: 1e-9, with bdf 1e-6.
#rtol = 1e-9

# Rules by which periods are not integrated because their result is known: "all", "none" (each
# amplitude gets all its periods), or a list of "linear" (no floor reaches the stop), "converged"
# (the motion repeats) and "newton" (the orbit is solved for).
#skip = "all"

[output]
# Results to compute: true or false.
#poincare = true      # stroboscopic points (u in gaps, v in gaps omega_0)
#contact = true       # which floors touch the stop
#drift = true         # peak interstorey drift, in A/Omega^2
#modal_norm = true    # mean modal norms, free of contact
#lyapunov = false     # largest Lyapunov exponent, per unit of time
#storey_drift = false    # peak drift of each storey, in gaps
#displacement = false    # peak displacement of each floor, in gaps
#acceleration = false    # peak absolute acceleration of each floor, in gaps omega_0^2
#contact_force = false   # peak force of each contact, in k gaps
#impacts = false         # closings of each contact a forcing period
#impact_velocity = false # largest closing speed of each contact, in gaps omega_0
#impulse = false         # impulse of each contact a forcing period, in k gaps/omega_0
#contact_time = false    # share of time each contact is closed

# Stroboscopic points that are stored of each run, the last ones: at least 2 max_orbit_period, or
# sampling_cycles where that is less; default: all.
#max_points = 100

# Amplitudes that are committed to the file together: a whole number from 1 to 10000000. After a
# kill at most this many of a frame are computed again. Default: 50, of points 1.
#block = 50

# Ground motion of study.kind = "records":
#[records]
# files = ["*.AT2", "folder"] names the records, relative to this file, unit = "g" their unit (m/s2,
# cm/s2, mm/s2, in/s2, ft/s2, or structure), gravity = 9.80665 one g in the units of the
# structure (default: by the names in [units]),
# dt = 0.01 the time between samples where a file does not say it. In place of files a suite that
# anybody can make: synthetic = {count = 20, seed = 1, dt = 0.01, duration = 30.0, rms = 1.0,
# soil = "firm"}.
# scale = {by = "sa", period = 1.0, damping_ratio = 0.05, from = 0.5, to = 10.0, count = 20} are the
# intensities to which each is scaled, or values = [...]; by = "factor", "pga", "pgv", "sa", or
# "avgsa" with periods = [...]; default: the records as they are. tail = 0.0 is the time of free
# motion after each. In the table output of such a study stand times = true, the times of peaks,
# alone = true, peaks without contacts, history = 0.02, the motion itself at this step (default:
# none), and block. What hpcsweep has found out of the records, found = [...], it adds by itself.

# Branches of study.kind = "branches":
#[branches]
# seeds = "FILE.h5", or a list of files, are results of sweeps, points or attractors of the same
# structure, relative to where the job is run; branches go through all their periodic motions at the
# frequencies and amplitudes of [sweep], along parameter = "amplitude", or "omega",
# "stiffness_ratio", "gap", "sharpness", "damping_ratio", over span = [low, high] (default: that of
# sweep.amplitude or sweep.omega). steps = 2000 is the most points to either side of a motion,
# largest_step = 0.05 the longest step, in units of the state and of the span; max_branches = 64,
# max_points = 20000 and max_seeds = 4000 are stored of a line; starts = 0 is the number of starts,
# seed = 0 gives them, of a search for orbits that no motion tells. curves = ["fold", "doubling",
# "torus", "grazing"] (default: []) are followed over A and Omega from the special points of each
# line, of orbits up to max_orbit_period, half way to the next line and to the ends of
# curve_span = [low, high] (default: that of sweep.omega); max_curves = 256 and
# max_curve_points = 5000 are stored of a line.

# Keys of study, structure, sweep or solver that take a number or a word, with several values each:
# a list or a range. All is computed at every value of one with every value of another, in one file
# with the keys as its first dimensions.
#[vary]
#structure.gap = {from = 0.5, to = 2.0, count = 16}
"""
