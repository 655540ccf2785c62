"""`hpcsweep explore`: make a page that shows a whole study in a browser."""

import sys

from hpcsweep.commands import CommandError, add_at, add_file
from hpcsweep.commands.outputs import PAGE, check_overwriting, writing
from hpcsweep.figures.options import BRANCHES, Option, positive, whole_number
from hpcsweep.studies.run_names import count

SUMMARY = "make one page to explore a study in a browser, without a network"
HELP = """\
Make one self-contained page: the map over (A, Omega); pointing at it shows the orbit diagram of
that frame, clicking the phase portrait and numbers of that run."""
OPTIONS = (
    BRANCHES,
    Option(
        "--by-share",
        "show attractors by falling share at each point, the dominant one first (default: each in "
        "a place that it keeps along the amplitudes)",
        action="store_true",
    ),
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


def configure(parser) -> None:
    """Add the options of the command."""
    add_file(parser, "HTML", "page (default: FILE with .html)")
    for option in OPTIONS:
        option.add(parser)
    add_at(parser)


def run(options) -> int:
    """Run the command."""
    from hpcsweep.figures.explorer.page import build_page, check_size, write_page
    from hpcsweep.figures.explorer.page_data import add_branches, gather

    output = options.output or options.file.with_suffix(".html")
    if not output.parent.is_dir():
        raise CommandError(f"{output}: cannot be written: {output.parent} is not a folder")
    check_overwriting(output, PAGE)
    study = gather(
        options.file,
        options.points,
        options.frame_step,
        options.amplitude_step,
        at=options.at,
        by_share=options.by_share,
        say=_progress if sys.stderr.isatty() else None,
    )
    if options.branches is not None:
        add_branches(study, options.branches)
    page, sizes = build_page(study, options.bits)
    check_size(sizes, options.max_mb * 1e6)
    with writing(output):
        write_page(page, output)
    print(f"{output}: {_describe(study, sizes)}")
    return 0


def _progress(done: int, total: int) -> None:
    end = "\n" if done == total else ""
    print(f"\rreading frame {done} of {total}", end=end, file=sys.stderr, flush=True)


def _describe(study, sizes: dict[str, int]) -> str:
    """Format the size and the contents of the page."""
    kept, stored = study.thinned["points"], study.thinned["of_points"]
    return (
        f"{sum(sizes.values()) / 1e6:.3g} MB, {count(study.omega.size, 'frame')} x "
        f"{count(study.amplitude.size, 'amplitude')} x {count(len(study.directions), study.each)}, "
        f"{len(study.points)} stroboscopic points (at most {kept} of {stored} a run)"
    )
