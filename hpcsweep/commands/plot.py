"""`hpcsweep plot`: draw a results file."""

from pathlib import Path

from hpcsweep.commands import USER_ERROR, complain


def add_to(commands) -> None:
    """Add the command to the parser's commands."""
    plot = commands.add_parser(
        "plot",
        help="draw the orbit diagram of one frame",
        description="Draw the orbit diagram of one frame: the stroboscopic displacement of each "
        "floor against the forcing amplitude, sweeps up and down, contact regions along the top.",
    )
    plot.add_argument("file", type=Path, metavar="FILE")
    plot.add_argument(
        "-o", "--output", type=Path, metavar="PNG", help="picture (default: FILE with .png)"
    )
    plot.add_argument(
        "--omega", type=float, help="frequency; the nearest frame is drawn (default: the first)"
    )
    plot.add_argument(
        "--color",
        choices=("direction", "contact", "period"),
        default="direction",
        help="what the colours tell (default: %(default)s)",
    )
    plot.set_defaults(function=_plot)


def _plot(options) -> int:
    from hpcsweep.figures import orbit_diagram
    from hpcsweep.store import StoreError, open_results

    output = options.output or options.file.with_suffix(".png")
    try:
        results = open_results(options.file)
        orbit_diagram.draw(results, output, omega=options.omega, color=options.color)
    except (StoreError, orbit_diagram.PlotError) as error:
        complain(str(error))
        return USER_ERROR
    except OSError as error:
        complain(f"{output}: cannot be written: {error.strerror or error}")
        return USER_ERROR
    print(output)
    return 0
