"""Labels, panels and legends of all figures; colours are in `hpcsweep.figures.palette`."""

from collections.abc import Iterable, Sequence
from itertools import pairwise
from string import ascii_lowercase

import numpy as np

from hpcsweep.dynamics import classify
from hpcsweep.figures.labels import broken, fitter, legend_below
from hpcsweep.figures.palette import contact_colour
from hpcsweep.job import Job, parse_job, part_of
from hpcsweep.model.coordinates import place_of
from hpcsweep.model.description import in_words
from hpcsweep.model.structure import Structure
from hpcsweep.model.unit_names import in_cycles, unit_of
from hpcsweep.solvers.offers import LINEAR, Capability
from hpcsweep.studies.grid import DOWN, UP, RunGrid
from hpcsweep.studies.points import START
from hpcsweep.studies.study import Kind, Study, as_kind
from hpcsweep.studies.variables import OF_SLIDERS

MARKERS = {UP: "o", DOWN: "v", START: "o"}
"""Of the directions; those of runs on the way down are hollow."""
LEGEND_ROOM = 24
"""Letters of a contact set's name in a legend."""
FEW, FEW_ROOM = 25, 0.02
"""Amplitudes whose outer points get room within the frame, and that room, in spans."""
MAX_FLOORS = 5
"""Floors that are all shown where none are requested; of more the top, the middle and the first."""
SYMBOLS = {"beta": r"\beta", "rho": r"\rho", "zeta": r"\zeta", "g_L": "g_L"}


class PlotError(ValueError):
    """Raised where a request cannot be drawn; the message is one line for the user."""


def demand(capability: Capability, structure, what: str, instead: str) -> None:
    """Refuse a figure that needs what is not known of a structure, and name one that does not."""
    if not capability.of(structure):
        kind = "rigid stops" if structure.is_rigid.any() else "springs that yield"
        raise PlotError(f"{what}: {capability.why} of {kind}; --kind {instead} draws them")


def grazing_amplitude(structure, omega: float) -> float:
    """Return the amplitude of first contact in closed form; infinite where springs may yield."""
    return structure.grazing_amplitude(omega) if LINEAR.of(structure) else np.inf


def set_name(contact: int, labels: int | Sequence[str], room: int | None = LEGEND_ROOM) -> str:
    """Return the name of a contact set in a legend, 'no contact' if it is empty."""
    return classify.contact_name(contact, labels, room) if contact else "no contact"


def set_names(
    contacts: Sequence[int], labels: int | Sequence[str], room: int | None = LEGEND_ROOM
) -> list[str]:
    """Return the names of contact sets in a legend, whole where two would be called the same."""
    names = [set_name(contact, labels, room) for contact in contacts]
    if len({*names}) < len({*contacts}):
        names = [set_name(contact, labels, None) for contact in contacts]
    return names


def commonest_sets(
    contacts: np.ndarray, labels: int | tuple[str, ...], most: int
) -> list[tuple[int, str, str]]:
    """Return the contact sets of runs, small ones first, with their colours and names.

    Parameters
    ----------
    contacts : ndarray of int
    labels : int or tuple of str
        `Structure.contact_labels`.
    most : int
        Sets that have a name; that of rarer ones is empty.
    """
    sets, counts = (part.tolist() for part in np.unique(contacts, return_counts=True))
    named = sorted(range(len(sets)), key=lambda k: -counts[k])[:most]
    names = dict(zip(named, set_names([sets[k] for k in named], labels), strict=True))
    order = sorted(range(len(sets)), key=lambda k: (sets[k].bit_count(), sets[k]))
    return [(sets[k], contact_colour(sets[k], labels), names.get(k, "")) for k in order]


def rarer_sets(count: int) -> str:
    """Name the contact sets that a legend leaves out."""
    return f"{count} rarer set{'' if count == 1 else 's'}"


def new_figure(n_rows: int, height: float, width: float = 7.2):
    """Make a figure of stacked panels with a common horizontal axis.

    Returns
    -------
    figure, list of axes
    """
    figure, axes = new_grid(n_rows, 1, (width, height), sharex=True)
    for axis in axes[:, 0]:
        draw_lattice(axis)
    return figure, list(axes[:, 0])


def draw_lattice(axis) -> None:
    """Draw faint lines at the ticks, under all else."""
    axis.grid(True, color="0.92", linewidth=0.6)
    axis.set_axisbelow(True)


def new_grid(n_rows: int, n_columns: int, size: tuple[float, float], **shared):
    """Make a figure of equal panels.

    Parameters
    ----------
    size : tuple of float
        Width and height in inches.

    Returns
    -------
    figure, ndarray of axes, shape (n_rows, n_columns)
    """
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    return pyplot.subplots(
        n_rows, n_columns, figsize=size, squeeze=False, layout="constrained", **shared
    )


def letter(axes: Sequence) -> None:
    """Letter the panels of a figure, from (a)."""
    for axis, name in zip(axes, ascii_lowercase, strict=False):
        axis.set_title(f"({name})", loc="left", fontsize=9)


def limit_amplitudes(axis, amplitude: np.ndarray) -> None:
    """Limit the horizontal axis to the amplitudes, with room for the outer points of a few."""
    low, high = float(amplitude[0]), float(amplitude[-1])
    room = FEW_ROOM * ((high - low) or abs(high) or 1.0) if amplitude.size <= FEW else 0.0
    axis.set_xlim(low - room, high + room)


def head(figure, *lines: str, fontsize: float = 10):
    """Write the head of a figure, without empty lines, broken where it is too wide; return it."""
    text = "\n".join(filter(None, lines))
    fits = fitter(figure, fontsize)
    figure.suptitle(broken(broken(text, fits), fits, "(?<=,) "), fontsize=fontsize)
    return figure


FAR_OFF = 0.1
"""Share of a frequency by which a request may lie beyond the range of frames."""


def frame_at(study: RunGrid, omega: float | None = None, amplitudes: Sequence[float] = ()) -> int:
    """Return the frame nearest to a frequency, along that to an amplitude, default the first.

    Raises
    ------
    PlotError
        If the frames have no frequencies, or none that is near.
    """
    name = study.run_dims[-2]
    if omega is not None and name != "omega":
        raise PlotError(f"--omega {omega:g}: the sweep is along {study.run_dims[-1]}")
    asked = amplitudes[0] if name == "amplitude" and len(amplitudes) else omega
    if asked is None:
        return 0
    low, high = float(study.frames.min()), float(study.frames.max())
    if not max(low - asked, asked - high) <= FAR_OFF * high:
        raise PlotError(f"--{name} {asked:g}: the results hold {low:.6g} to {high:.6g}")
    return int(np.argmin(np.abs(study.frames - asked)))


def choose_floors(names: Sequence[str], chosen: Sequence[int | str] | None = None) -> list[int]:
    """Return the floors to show, ascending, from 0.

    Parameters
    ----------
    names : sequence of str
        Of the floors of the structure.
    chosen : sequence of int or str, optional
        Requested floors, by name or from 1. Default: all of a few, otherwise the first, the middle
        and the top.

    Raises
    ------
    PlotError
        If a requested floor does not exist.
    """
    n, places = len(names), set()
    if not chosen:
        return list(range(n)) if n <= MAX_FLOORS else [0, (n - 1) // 2, n - 1]
    for floor in map(str, chosen):
        place = place_of(names, floor)
        if place is None:
            is_numbered = [*names] == [str(i) for i in range(1, n + 1)]
            named = "" if is_numbered else f", or one of {', '.join(names)}"
            raise PlotError(f"--floor {floor}: must be from 1 to {n}{named}")
        places.add(place)
    return sorted(places)


def need(results, *names: str) -> None:
    """Refuse results that lack a variable to draw.

    Raises
    ------
    PlotError
        The message names the first missing variable and its key.
    """
    for name in names:
        if name not in results:
            limit = f"set output.{name} = true in the job"
            if name in OF_SLIDERS:
                limit = "nothing of the structure yields"
            raise PlotError(f"the results hold no {name}: {limit}")


def need_amplitudes(study: Study) -> None:
    """Refuse a list of points, which share no amplitudes to draw over.

    Raises
    ------
    PlotError
    """
    if study.is_list:
        raise PlotError("a list of points is no sweep over amplitudes: draw it with --kind map")


def direction_index(there: Iterable[str], direction: str | None) -> int:
    """Return the index of a direction among those there are, the first if none is requested.

    Raises
    ------
    PlotError
    """
    names = [*map(str, there)]
    if direction not in (None, *names):
        raise PlotError(f"--direction {direction}: the results hold {' and '.join(names)} only")
    return names.index(direction or names[0])


def job_of(results) -> Job:
    """Return the job of results; where it varies keys, the job of their part."""
    job = parse_job(results.attrs["job"], "job", str(results.attrs["name"]), is_stored=True)
    place = []
    for axis in job.study.axes:
        if axis.name in results.dims:
            raise PlotError(f"the results hold several {axis.name}: choose one by sel")
        place.append(axis.values.index(results[axis.name].item()))
    return part_of(job, tuple(place))


def study_of(results, kind: type[Kind]) -> Kind:
    """Return the study of results that are of a kind, or their part."""
    return as_kind(job_of(results).study, kind)


def words_of(results, direction: str | None = None) -> str:
    """Return a direction of the results, default their first, in the words of their study."""
    name = str(results["direction"].values[0]) if direction is None else direction
    return study_of(results, RunGrid).words[name]


def structure_of(results) -> Structure:
    """Return the structure of results."""
    return job_of(results).structure


def classes_of(results) -> np.ndarray:
    """Classify every run of results by the settings of their job (`hpcsweep.dynamics`)."""
    job = job_of(results)
    return classify.classify(results, job.settings, job.study.units_at)


def caption(results, omega: float | None = None, more: str = "") -> str:
    """Format the parameters of a campaign, or of one frame if `omega` is given, and `more`."""
    every = job_of(results).study.structures
    words = ",  ".join(filter(None, (parameters(every[0], omega, other=every[-1]), more)))
    part = results.attrs.get("part")
    return f"{part}\n{words}" if part else words


def parameters(structure, omega: float | None = None, other=None) -> str:
    """Format the parameters of a structure, those of an `other` too, and a frequency if any."""
    words = [pair for pair in in_words(structure) if other is None or pair in in_words(other)]
    if omega is not None:
        words.append((r"\Omega", frequency_words(structure, omega)))
    parts = (rf"${SYMBOLS.get(name, name)}$ = {value}" if name else value for name, value in words)
    return ",  ".join(parts)


def frequency_words(structure, omega: float) -> str:
    """Format a frequency, where time has a unit with that and in cycles."""
    unit = f" {unit_of(structure, 'frequency')}" if structure.unit_names.time else ""
    return f"{omega:.6g}{unit}{in_cycles(structure, omega)}"


def stretches(*rows: np.ndarray) -> list[tuple[int, int]]:
    """Return first and last-plus-one index of every stretch over which no row changes."""
    changes = np.any([row[1:] != row[:-1] for row in rows], axis=0)
    return [*pairwise([0, *(np.flatnonzero(changes) + 1).tolist(), rows[0].size])]


def percent(share: float) -> str:
    """Format a share with two significant digits where it is small, never as a false 0 or 100 %."""
    value = 100 * share
    if value == 0 or value == 100:
        return f"{value:.0f} %"
    if value < 0.01:
        return "< 0.01 %"
    if value > 99.95:
        return "> 99.9 %"
    return f"{value:.2f} %" if value < 1 else f"{value:.1f} %"


def shares_text(results, classes: np.ndarray) -> str:
    """Format the shares of the motion classes on one line, always with the undecided ones."""
    names = classify.class_names(structure_of(results))
    parts = [
        f"{names[kind]} {percent(share)}"
        for kind, share in classify.class_shares(classes).items()
        if share > 0 or kind is classify.MotionClass.UNDECIDED
    ]
    noun = f"{job_of(results).study.run_noun}s".capitalize()
    hint = "; chaos is not told: the file holds neither motion nor lyapunov"
    return f"{noun}: " + ", ".join(parts) + ("" if classify.tells_chaos(results) else hint)


def foot(
    figure, handles: list, results, classes: np.ndarray, most: int | None = None, note=""
) -> None:
    """Add a note, the shares of the motion classes and a legend of `most` columns below."""
    shares = shares_text(results, classes)
    legend_below(figure, handles, f"{note}\n{shares}" if note else shares, most)
