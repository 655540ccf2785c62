"""`hpcsweep explore`: make a page on which a whole study is explored in a browser."""

import argparse
import sys
from pathlib import Path

from hpcsweep.commands import USER_ERROR, complain, file_name, positive
from hpcsweep.commands.outputs import PAGE, overwriting

MOST_MB = 150.0


def add_to(commands) -> None:
    """Add the command to the parser's commands."""
    explore = commands.add_parser(
        "explore",
        help="make one page to explore a study in a browser, without a network",
        description="Make one self-contained page: the map over (A, Omega); pointing at it shows "
        "the orbit diagram of that frame, clicking the phase portrait and numbers of that run.",
    )
    explore.add_argument("file", type=Path, metavar="FILE")
    explore.add_argument(
        "-o", "--output", type=file_name, metavar="HTML", help="page (default: FILE with .html)"
    )
    explore.add_argument(
        "--points",
        type=_whole(1, 10_000_000),
        metavar="K",
        help="at most K stroboscopic points of a run (default: as many as keep the page small)",
    )
    explore.add_argument(
        "--bits",
        type=_whole(6, 16),
        default=12,
        metavar="B",
        help="resolution of the points: 1/2^B of a frame's range (default: %(default)s)",
    )
    explore.add_argument(
        "--frame-step",
        type=_whole(1, 10_000_000),
        default=1,
        metavar="N",
        help="keep every Nth frame",
    )
    explore.add_argument(
        "--amplitude-step",
        type=_whole(1, 10_000_000),
        default=1,
        metavar="N",
        help="keep every Nth amplitude",
    )
    explore.add_argument(
        "--max-mb",
        type=positive,
        default=MOST_MB,
        metavar="MB",
        help="refuse to write a larger page (default: %(default)g)",
    )
    explore.set_defaults(function=_explore)


def _whole(least: int, most: int):
    """Make a converter of arguments that must be whole numbers in a range."""

    def convert(text: str) -> int:
        if not text.isascii() or not text.isdigit() or not least <= int(text) <= most:
            raise argparse.ArgumentTypeError(
                f"must be a whole number from {least} to {most}, is {text}"
            )
        return int(text)

    return convert


def _explore(options) -> int:
    from hpcsweep.figures.explorer.page import PageTooLarge, build_page, check_size, write_page
    from hpcsweep.figures.explorer.page_data import gather
    from hpcsweep.figures.style import PlotError
    from hpcsweep.store import StoreError

    output = options.output or options.file.with_suffix(".html")
    if not output.parent.is_dir():
        complain(f"{output}: cannot be written: {output.parent} is not a folder")
        return USER_ERROR
    problem = overwriting(output, PAGE)
    if problem is not None:
        complain(problem)
        return USER_ERROR
    try:
        study = gather(
            options.file,
            options.points,
            options.frame_step,
            options.amplitude_step,
            say=_progress if sys.stderr.isatty() else None,
        )
        page, sizes = build_page(study, options.bits)
        check_size(sizes, options.max_mb * 1e6)
    except (StoreError, PlotError, PageTooLarge) as error:
        complain(str(error))
        return USER_ERROR
    try:
        write_page(page, output)
    except OSError as error:
        complain(f"{output}: cannot be written: {error.strerror or error}")
        return USER_ERROR
    print(f"{output}: {_describe(study, sizes)}")
    return 0


def _progress(done: int, total: int) -> None:
    end = "\n" if done == total else ""
    print(f"\rreading frame {done} of {total}", end=end, file=sys.stderr, flush=True)


def _describe(study, sizes: dict[str, int]) -> str:
    """Say how large the page is and what is in it."""
    kept, stored = study.thinned["points"], study.thinned["of_points"]
    return (
        f"{sum(sizes.values()) / 1e6:.3g} MB, {study.omega.size} frames x "
        f"{study.amplitude.size} amplitudes x {len(study.directions)} {study.each}s, "
        f"{len(study.points)} stroboscopic points (at most {kept} of {stored} a run)"
    )
