"""`hpcsweep animate`: make a film of the orbit diagrams over Omega.

Make a film of the orbit diagrams, or of a measure, one frame a forcing frequency, with fixed axes:
MP4 or, by the ending of OUT, GIF. Start it under mpirun to use several cores; the film is the same
for any number of ranks. Needs the extra 'video' (imageio-ffmpeg).
"""

import functools
from dataclasses import fields

from hpcsweep.commands import FAILURE, CommandError, abort, add_at, add_file, complain
from hpcsweep.commands.outputs import FILM, check_overwriting
from hpcsweep.figures.options import BRANCHES, COLOUR, FLOORS, ROWS, Option, positive, whole_number

OPTIONS = (
    Option("--fps", "frames per second (default: 25)", type=positive),
    Option("--every", "take every Kth frame", type=whole_number(1), metavar="K"),
    COLOUR,
    FLOORS,
    ROWS,
    Option(
        "--show",
        "measure drawn in place of stroboscopic displacements: storey_drift, displacement, "
        "floor_acceleration, contact_force, impacts, impact_velocity, impulse or contact_share",
        metavar="MEASURE",
    ),
    BRANCHES,
    Option(
        "--width",
        "even (default: 1280, GIF 960); the height follows from the number of floors shown",
        type=whole_number(1),
        metavar="PIXELS",
    ),
)


def configure(parser) -> None:
    """Add the options of the command."""
    add_file(parser, "OUT", "film, .mp4 or .gif (default: FILE.mp4)")
    for option in OPTIONS:
        option.add(parser)
    add_at(parser)


def run(options) -> int:
    """Make the film on all ranks."""
    from hpcsweep.campaign.progress import make_progress
    from hpcsweep.figures.film.film import check, load, make
    from hpcsweep.figures.film.frames import Request
    from hpcsweep.figures.style import PlotError
    from hpcsweep.parallel.mpi import on_master, world
    from hpcsweep.store import StoreError

    load()
    comm = world()
    chosen = {field.name: getattr(options, field.name) for field in fields(Request)}
    values = {name: value for name, value in chosen.items() if value is not None}
    values["output"] = options.output or options.file.with_suffix(".mp4")
    values["floors"] = tuple(options.floors or ())
    request = Request(**values)

    def accept() -> None:
        """Refuse what cannot be drawn or written."""
        try:
            check(request)
        except StoreError as error:
            raise PlotError(str(error)) from None
        check_overwriting(request.output, FILM)

    try:
        on_master(comm, accept, PlotError, CommandError)
        n_frames = make(request, comm, functools.partial(make_progress, unit="frame"))
    except (PlotError, CommandError):
        raise
    except Exception as error:
        return abort(comm, error)
    if n_frames is None:
        complain("stopped by a signal; no film was written", comm.rank)
        return FAILURE
    if comm.rank == 0:
        print(f"{request.output}: {n_frames} frames")
    return 0
