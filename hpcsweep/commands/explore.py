"""`hpcsweep explore`: make one page to explore a study in a browser, without a network.

Make one self-contained page: the map over (A, Omega); pointing at it shows the orbit diagram of
that frame, clicking the phase portrait and numbers of that run. Of responses to records: curves of
incremental dynamic analysis, fragility and profiles of all structures, linked by the record that is
pointed at.
"""

import contextlib

from hpcsweep.commands import CommandError, add_at, add_file
from hpcsweep.commands.outputs import PAGE, check_overwriting, writing
from hpcsweep.figures.options import BRANCHES, ROWS, Option, positive, whole_number
from hpcsweep.studies.run_names import count

HELD = ("motions", "attractors", "responses")
"""Holdings of files that have a page."""
STEP = whole_number(1, 10_000_000)
OPTIONS = (
    BRANCHES,
    ROWS,
    Option(
        "--by-share",
        "show attractors by falling share at each point, the dominant one first (default: each in "
        "a place that it keeps along the amplitudes)",
        action="store_true",
    ),
    Option(
        "--points",
        "at most K stroboscopic points of a run (default: as many as keep the page small)",
        type=STEP,
        metavar="K",
    ),
    Option("--frame-step", "keep every Nth frame", type=STEP, default=1, metavar="N"),
    Option("--amplitude-step", "keep every Nth amplitude", type=STEP, default=1, metavar="N"),
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
    add_at(parser, "the first values, of responses to records all")


def run(options) -> int:
    """Run the command."""
    from hpcsweep.store import Frames

    output = options.output or options.file.with_suffix(".html")
    if not output.parent.is_dir():
        raise CommandError(f"{output}: cannot be written: {output.parent} is not a folder")
    check_overwriting(output, PAGE)
    with contextlib.closing(Frames(options.file, HELD, options.at)) as frames:
        make = _responses if frames.study.content == "responses" else _motions
        page, contents, advice = make(options, frames)
    if len(page) > options.max_mb * 1e6:
        limit = f"the limit is {options.max_mb:.3g} MB: use {advice}, or raise --max-mb"
        raise CommandError(f"the page would have {len(page) / 1e6:.3g} MB, {limit}")
    with writing(output):
        output.write_text(page, encoding="utf-8")
    print(f"{output}: {len(page) / 1e6:.3g} MB, {contents}")
    return 0


def _motions(options, frames):
    """Return the page of a map, its contents and how to have less."""
    from hpcsweep.figures.explorer.page import build_page
    from hpcsweep.figures.explorer.page_data import gather

    steps = options.frame_step, options.amplitude_step
    study = gather(frames, options.points, *steps, options.by_share, options.branches)
    study = study.in_rows(options.floors) if options.floors else study
    kept, stored = study.thinned["points"], study.thinned["of_points"]
    along = count(study.amplitude.size, study.dims[1])
    contents = (
        f"{count(study.omega.size, 'frame')} x "
        f"{along} x {count(len(study.directions), study.each)}, "
        f"{len(study.points)} stroboscopic points (at most {kept} of {stored} a run)"
    )
    advice = "fewer --points, a --frame-step or --amplitude-step"
    return build_page(study), contents, advice


def _responses(options, frames):
    """Return the same of a study of records."""
    from hpcsweep.figures.explorer.page import fill_page
    from hpcsweep.figures.explorer.responses import gather_responses, pack_responses

    for option in OPTIONS[:-1]:
        if getattr(options, option.keyword) not in (option.arguments.get("default"), False):
            raise CommandError(f"{option.flag}: is for maps; {options.file} holds responses")
    meta, arrays = gather_responses(frames)
    contents = (
        f"{count(len(meta['records']), 'record')} x {count(len(meta['scales']), 'scale')} x "
        f"{count(len(meta['parts']), 'structure')}, {', '.join(meta['responses'])}"
    )
    page = fill_page("records", meta["name"], *pack_responses(meta, arrays))
    return page, contents, "--at KEY=VALUE for one of the structures"
