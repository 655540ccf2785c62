"""`hpcsweep animate`: make a film of the orbit diagrams over Omega.

Make a film of the orbit diagrams, or of a measure, one frame a forcing frequency, with fixed axes:
MP4 or, by the ending of OUT, GIF. Start it under mpirun to use many ranks; alone it uses several
processes. The film is the same for any number. Needs the extra 'video' (imageio-ffmpeg).
"""

import functools
import os
from dataclasses import fields

from hpcsweep.commands import FAILURE, CommandError, abort, add_at, add_file, complain
from hpcsweep.commands.outputs import FILM, PICTURE, check_overwriting
from hpcsweep.figures.options import (
    BRANCHES,
    COLOUR,
    FLOORS,
    Option,
    file_name,
    positive,
    whole_number,
)

OPTIONS = (
    Option(
        "--poster", "also write the frame with most kinds of motion", type=file_name, metavar="PNG"
    ),
    Option("--fps", "frames per second (default: 25)", type=positive),
    Option("--every", "take every Kth frame", type=whole_number(1), metavar="K"),
    Option("--direction", "sweeps that are drawn (default: both)", choices=("up", "down", "both")),
    COLOUR,
    FLOORS,
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
    parser.add_argument(
        "--processes",
        type=whole_number(1),
        default=0,
        metavar="N",
        help="processes, where there is one rank (default: the cores)",
    )
    add_at(parser)


def run(options) -> int:
    """Make the film on all ranks."""
    from hpcsweep.campaign.progress import make_progress
    from hpcsweep.figures.film.film import check, make
    from hpcsweep.figures.film.frames import Request
    from hpcsweep.figures.style import PlotError
    from hpcsweep.parallel.mpi import on_master, world
    from hpcsweep.store import StoreError

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
        if request.poster is not None:
            check_overwriting(request.poster, PICTURE)

    try:
        on_master(comm, accept, PlotError, CommandError)
        processes = options.processes or len(os.sched_getaffinity(0))
        n_frames = make(request, comm, processes, functools.partial(make_progress, unit="frame"))
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
