"""The explorer as a figure: its name, its options; `hpcsweep explore` makes it."""

from hpcsweep.figures.options import BRANCHES, Option, positive, whole_number

NAME = "explorer"
DRAWS = "motions"
WRITES = (".html",)
HELP = """\
Make one self-contained page: the map over (A, Omega); pointing at it shows the orbit diagram of
that frame, clicking the phase portrait and numbers of that run."""
OPTIONS = (
    BRANCHES,
    Option(
        "--points",
        "at most K stroboscopic points of a run (default: as many as keep the page small)",
        type=whole_number(1, 10_000_000),
        metavar="K",
    ),
    Option(
        "--bits",
        "resolution of the points: 1/2^B of a frame's range (default: %(default)s)",
        type=whole_number(6, 16),
        default=12,
        metavar="B",
    ),
    *(
        Option(
            f"--{each}-step",
            f"keep every Nth {each}",
            type=whole_number(1, 10_000_000),
            default=1,
            metavar="N",
        )
        for each in ("frame", "amplitude")
    ),
    Option(
        "--max-mb",
        "refuse to write a larger page (default: %(default)g)",
        type=positive,
        default=150.0,
        metavar="MB",
    ),
)
