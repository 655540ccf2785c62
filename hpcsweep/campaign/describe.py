"""Describe what a job computes, in numbers to check before an hour of computing, and warn."""

from collections.abc import Iterator

import numpy as np
from scipy.linalg import eigh
from scipy.special import expit

from hpcsweep.job import Job
from hpcsweep.model.confinement import unconfined
from hpcsweep.model.description import SPRINGLESS, few, modes_kept, one_line, slow
from hpcsweep.model.equilibrium import pressed
from hpcsweep.model.isolation import isolated_period
from hpcsweep.model.reduction import absurd
from hpcsweep.model.unit_names import in_cycles, is_in_gaps, is_in_own_units, known_unit, unit_of
from hpcsweep.studies.run_names import count
from hpcsweep.studies.study import Lines, Study

MAX_MODES = 12
"""Number of lowest modes that are listed."""
MAX_WORDS = 6
"""Number of values of a key that are words, names of structures say, that are listed."""
HEAVIER = 2.0
"""Damping ratio while all slip, over that while all stick, which is warned of."""
PULLED = 0.01
"""Part of a gap over which smooth contacts may pull at rest without a warning."""
ROUNDING = 1e-12
"""Entry of a mode, over its largest, that is 0."""
ENOUGH_MASS = 0.9
"""Effective mass of the modes of a model, over all that the base moves, without a warning."""
LARGE = 1e8
"""Bytes from which on memory is told."""


def title(job: Job) -> str:
    """Name a job, its runs and its solver."""
    return f"{job.name}: {study_text(job.study)}, solver {job.settings.solver}"


def study_text(study: Study) -> str:
    """Format the number of runs of a study, and their dimensions."""
    sizes = [count(study.dimensions[dim], dim) for dim in study.run_dims]
    runs = count(study.n_runs, study.run_noun)
    return f"{' x '.join(sizes)} = {runs} ({study.kind.replace('_', ' ')})"


def describe(job: Job) -> Lines:
    """Describe the structure and the study of a job, by names and texts, warnings last."""
    study, structure = job.study, job.structure
    yield from (("note", text) for text in job.notes)
    yield "structure", one_line(structure)
    yield from _model(structure)
    yield "units", _units(structure)
    yield from (("varied", f"{axis.key}: {_listed(axis.values)}") for axis in study.axes)
    if study.n_parts > 1:
        yield "below", f"{study.describe_part((0,) * len(study.axes))}, the first part"
    yield from _modes(structure)
    yield from (("contact", text) for text in _contacts(structure))
    yield from (("slider", text) for text in _sliders(structure))
    if structure.sliders:
        yield "", _slipping(structure)
    if sliding := isolated_period(structure):
        yield "", f"while the bearings alone slip the longest period is {sliding:.6g}"
    if structure.collapse_drift is not None:
        limits, unit = few(structure.drift_limits.tolist()), known_unit(structure, "length")
        yield "collapse", f"beyond a drift of {limits}{unit}"
    if told := unconfined(structure):
        yield "free", f"the structure {told}"
    yield from (("at rest", text) for text in _at_rest(structure, study))
    yield from study.lines()
    yield from (("warning", text) for text in warnings(job))


def warnings(job: Job) -> list[str]:
    """Return one line for each thing that looks like a mistake."""
    return [*_warnings(job.structure), *job.study.warnings()]


def _listed(values) -> str:
    if not isinstance(values[0], str):
        return few(values)
    more = f" and {len(values) - MAX_WORDS} more" if len(values) > MAX_WORDS else ""
    return ", ".join(values[:MAX_WORDS]) + more


def _units(structure) -> str:
    if is_in_gaps(structure):
        return "lengths in gaps, time in 1/omega_0, frequencies in omega_0"
    if not is_in_own_units(structure):
        return "length as given, time in 1/omega_0, frequencies in omega_0"
    if not any(structure.unit_names):
        return "those in which masses, stiffnesses and lengths are given; [units] names them"
    names = ("length", "velocity", "acceleration", "force", "frequency")
    return ", ".join(f"{name} {unit_of(structure, name)}" for name in names)


def _model(structure) -> Lines:
    """Yield what became of the coordinates of a finite element model, and effective masses."""
    if (reduction := structure.reduction) is None:
        return
    took = f"; its modes took {reduction.memory / 1e9:.2g} GB" * (reduction.memory > LARGE)
    yield (
        "model",
        f"{reduction.coordinates} coordinates, {reduction.empty} of them fixed or empty, "
        f"{reduction.massless} without mass condensed{took}",
    )
    highest = reduction.frequencies[-1]
    where = "in a motion with contact"
    if reduction.force_error is not None:
        where = f"and {reduction.force_error:.2g} of forces of contacts under the records"
    yield (
        "reduced to",
        f"{reduction.modes} modes, up to omega = {highest:.6g}{in_cycles(structure, highest)}; "
        f"estimated error {reduction.error:.2g} of displacements {where}",
    )
    shares = ", ".join(f"{share:.3g}" for share in reduction.shares[:MAX_MODES])
    more = ", ..." if reduction.modes > MAX_MODES else ""
    total = sum(reduction.shares)
    yield "mass", f"effective shares of the modes {shares}{more}, together {total:.4g}"


def _modes(structure) -> Lines:
    """Yield natural frequencies, periods, damping ratios and mode shapes."""
    frequencies = structure.frequencies
    kept = modes_kept(structure)
    for i in range(min(frequencies.size, MAX_MODES)):
        shape = structure.modes[:, i]
        shape = shape / shape[np.argmax(np.abs(shape))] + 0.0
        shape[np.abs(shape) < ROUNDING] = 0.0
        entries = ", ".join(f"{value:.3g}" for value in shape[:MAX_MODES])
        more = ", ..." if shape.size > MAX_MODES else ""
        yield (
            f"mode {i + 1}",
            f"{_rate(structure, i)}, shape ({entries}{more})"
            + ", stands for those left out" * (i >= kept),
        )
    if (more := frequencies.size - MAX_MODES) > 0:
        yield "", f"and {more} modes more, up to omega = {frequencies[-1]:.6g}"


def _rate(structure, i: int) -> str:
    """Tell frequency, period and damping of a mode; of a rigid one how its speeds decay."""
    if i < structure.n_rigid:
        rate, unit = structure.rigid_rates[i], known_unit(structure, "time")
        decay = f"speeds decay in {1.0 / rate:.4g}{unit}" if rate > 0.0 else "no damping"
        return f"no spring, {decay}"
    omega = structure.frequencies[i]
    frequency = f"omega = {omega:.6g}{in_cycles(structure, omega)}, period {2 * np.pi / omega:.6g}"
    return f"{frequency}, {_damping(structure, i)}"


def _damping(structure, i: int, article: str = "") -> str:
    """Tell the damping ratio of a mode, or how it decays where it hardly has a spring."""
    ratio, omega = structure.damping_ratios[i], structure.frequencies[i]
    if ratio <= SPRINGLESS:
        return f"{article}damping ratio {ratio:.4g}"
    fast, late, unit = 0.5 / (ratio * omega), 2.0 * ratio / omega, known_unit(structure, "time")
    return f"hardly a spring: speeds decay in {fast:.4g}{unit}, displacements in {late:.4g}{unit}"


def _contacts(structure) -> list[str]:
    names = structure.contact_names
    if structure.names.contacts:
        names = {number: f"{number}, {name}" for number, name in names.items()}
    length = known_unit(structure, "length")
    return [
        f"{names[k]}: gap {contact.gap:.6g}{length}, stiffness {contact.stiffness:.6g}"
        + ("" if contact.restitution is None else f", restitution {contact.restitution:.6g}")
        for k, contact in zip(structure.contact_numbers, structure.contacts, strict=True)
    ] or ["none"]


def _sliders(structure) -> list[str]:
    length, force = (known_unit(structure, name) for name in ("length", "force"))
    return [
        f"{name}: stiffness {slider.stiffness:.6g}, slips at {slider.strength:.6g}{force}, "
        f"{slider.limit:.6g}{length}"
        f"{f', then with {slider.slips:.6g}{force}' if slider.kinetic else ''}"
        f"{'' if slider.returns is None else f', back at {slider.returns:.6g}{force}'}"
        f"{'' if slider.backbone is None else f', degrades: {slider.backbone}'}"
        for name, slider in zip(structure.slider_names, structure.sliders, strict=True)
    ]


def _slipping(structure) -> str:
    """Return the longest period while all sliders slip; the modes are those while they stick."""
    squares = eigh(structure.elastic_stiffness, structure.mass_matrix, eigvals_only=True)
    if squares[0] <= ROUNDING * squares[-1]:
        return "while all slip some motion has no stiffness; modes are those while all stick"
    period = 2 * np.pi / np.sqrt(squares[0])
    return f"while all slip the longest period is {period:.6g}; modes are those while all stick"


def _at_rest(structure, study: Study) -> Iterator[str]:
    """Yield one line if contacts hold the structure away from u = 0."""
    names = structure.contact_names
    numbers = np.array(structure.contact_numbers)[pressed(structure)].tolist()
    if not numbers:
        return
    where = ", ".join(f"{u:.6g}" for u in structure.rest[: structure.n_floors])
    initial = study.initial_state[: structure.rest.size]
    start = "the initial state is not there"
    if study.starts_at_rest:
        start = "every run starts there"
    elif np.allclose(initial, structure.rest, 1e-9, 1e-12 * structure.length_unit):
        start = "the initial state"
    yield (
        f"contact {', '.join(names[k] for k in numbers)} pressed, static equilibrium at u = "
        f"({where}): {start}"
    )


def _warnings(structure) -> Iterator[str]:
    ratios = structure.damping_ratios[: modes_kept(structure)]
    yield from slow(structure)
    if (reduction := structure.reduction) is not None:
        yield from reduction.told
        if (share := sum(reduction.shares)) < ENOUGH_MASS:
            yield (
                f"the modes that are kept have {share:.3g} of the mass that the base moves: "
                f"structure.model.reduce with more modes, for {ENOUGH_MASS:g} of it"
            )
        if structure.lowest > 0.0 and (text := absurd(structure.lowest)):
            yield text
    if ratios.max() > 1:
        at = int(ratios.argmax())
        above = ", above 1" * bool(ratios[at] <= SPRINGLESS)
        yield f"mode {at + 1} has {_damping(structure, at, 'the ')}{above}"
    if structure.matrices is None and not np.all(np.array(structure.stiffness_ratio) >= 1):
        least = float(np.min(structure.stiffness_ratio))
        if least > 0:
            yield f"the contact is softer than a storey: stiffness_ratio = {least:g}"
    elif structure.matrices is not None:
        yield from _soft_contacts(structure)
    yield from _pulling_contacts(structure)
    yield from _sticking_dashpots(structure)


def _sticking_dashpots(structure) -> Iterator[str]:
    """Yield one line if dashpots by a ratio of what sticks are heavy beside what slips.

    Of sliders that are tables of a job: storeys that yield have the ratio of their first stiffness.
    """
    if not structure.sliders or structure.matrices is None or structure.names.storeys:
        return
    by_stiffness = structure.rayleigh is None or structure.rayleigh_factors[1] > 0.0
    if structure.matrices.damping is not None or not by_stiffness:
        return
    squares, shapes = eigh(structure.elastic_stiffness, structure.mass_matrix)
    first = int(np.argmax(squares > ROUNDING * squares[-1]))
    omega, shape = np.sqrt(abs(squares[first])), shapes[:, first]
    ratio, mode = shape @ structure.damping_matrix @ shape / (2 * omega), structure.n_rigid
    meant = structure.damping_ratios[mode]
    if ratio > HEAVIER * meant > 0.0:
        more = "" if structure.reduction is not None else ", or structure.matrices.damping,"
        factor = "alpha" if structure.rayleigh else f"{2 * meant * omega:.4g}"
        yield (
            f"the damping ratio {meant:.4g} is that of mode {mode + 1} while all sliders stick: "
            f"its dashpots are {ratio:.3g} of critical while all slip; structure.rayleigh = "
            f"[{factor}, 0.0]{more} gives the frame its own"
        )


def _pulling_contacts(structure) -> Iterator[str]:
    """Yield one line if open smooth contacts pull the structure at rest towards them."""
    gaps = np.array([max(contact.gap, 0.0) for contact in structure.contacts])
    if np.isinf(structure.sharpness) or not gaps.any():
        return
    force = structure.contact_stiffness * expit(-structure.sharpness * gaps) * gaps
    rows = structure.directions
    moved = rows @ np.linalg.pinv(structure.held_stiffness) @ rows.T @ force
    if (share := moved[gaps > 0] / gaps[gaps > 0]).max() > PULLED:
        name = [*structure.contact_names.values()][int(force.argmax())]
        yield (
            f"smooth contacts pull at rest, over {share.max():.2g} gaps, {name} with "
            f"{force.max():.4g}{known_unit(structure, 'force')}: sharpness must be far above "
            f"{structure.sharpness:g}, or inf"
        )


def _soft_contacts(structure) -> Iterator[str]:
    """Yield one line if contacts are softer than the structure is to a force along them."""
    directions, stiffness = structure.directions, structure.contact_stiffness
    flexible = np.linalg.pinv(structure.held_stiffness)
    yielding = stiffness * np.einsum("ki,ij,kj->k", directions, flexible, directions)
    soft = (yielding > 0) & (yielding < 1) & ~structure.felt.any(axis=1)
    if soft.any():
        names = ", ".join(np.array([*structure.contact_names.values()])[soft].tolist())
        least = stiffness[soft].min()
        yield f"contact {names}: softer than the structure along it, stiffness {least:.4g}"
