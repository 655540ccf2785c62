"""The film as a figure: its name, its options; `hpcsweep animate` makes it."""

from hpcsweep.figures.options import BRANCHES, FLOORS, Option, file_name, positive, whole_number

NAME = "film"
DRAWS = "motions"
WRITES = (".mp4", ".gif")
HELP = """\
Make a film of the orbit diagrams, or of a measure, one frame a forcing frequency, with fixed axes:
MP4 or, by the ending of OUT, GIF. Start it under mpirun to use many ranks; alone it uses several
processes. The film is the same for any number. Needs the extra 'video' (imageio-ffmpeg)."""
OPTIONS = (
    Option(
        "--poster", "also write the frame with most kinds of motion", type=file_name, metavar="PNG"
    ),
    Option("--fps", "frames per second (default: %(default)g)", type=positive, default=25.0),
    Option("--every", "take every Kth frame", type=whole_number(1), default=1, metavar="K"),
    Option(
        "--direction",
        "sweeps that are drawn (default: %(default)s)",
        choices=("up", "down", "both"),
        default="both",
    ),
    Option(
        "--color",
        "what the colours show (default: %(default)s)",
        choices=("direction", "contact", "period"),
        default="direction",
    ),
    FLOORS,
    Option(
        "--show",
        "measure drawn in place of stroboscopic displacements: storey_drift, displacement, "
        "acceleration, contact_force, impacts, impact_velocity, impulse or contact_time",
        default="",
        metavar="MEASURE",
    ),
    BRANCHES,
    Option(
        "--width",
        "even (default: 1280, GIF 960); the height follows from the number of floors shown",
        type=whole_number(1),
        default=0,
        metavar="PIXELS",
    ),
)
