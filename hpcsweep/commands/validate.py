"""`hpcsweep validate`: check whether a results file is sound.

Check whether a results file is sound, also while a campaign writes it: the layout, the checksum of
every committed block, and what the numbers of every run promise of each other. A random sample of
runs is then computed again: periodic ones once round their orbit by the other solver (flow for bdf,
bdf for flow; flow at a tighter tolerance where contacts have dashpots, springs yield or a model is
reduced), aperiodic ones over single forcing periods, and each of them whole by flow from its stored
start. Blocks that are not committed yet are no fault.

exit codes:
  0   sound
  1   not sound: every line says what is wrong and where
  2   a mistake in what was asked: no such file, no HDF5, not a file of hpcsweep
"""

import dataclasses
import json
from collections import Counter

from hpcsweep.commands import FAILURE, Rows, add_file, listing
from hpcsweep.figures.options import whole_number


def configure(parser) -> None:
    """Add the options of the command."""
    add_file(parser)
    parser.add_argument(
        "--samples",
        type=whole_number(0),
        default=20,
        metavar="K",
        help="runs to compute again (default: %(default)s)",
    )
    parser.add_argument(
        "--seed",
        type=whole_number(0),
        default=0,
        help="of the choice of these runs (default: %(default)s)",
    )
    parser.add_argument("--json", action="store_true", help="machine-readable")


def run(options) -> int:
    """Run the command."""
    from hpcsweep.checks.validate import validate

    report = validate(options.file, options.samples, options.seed)
    if options.json:
        print(json.dumps({**dataclasses.asdict(report), "sound": report.sound}, indent=1))
    else:
        print(listing(f"{report.file}: {'sound' if report.sound else 'NOT SOUND'}", _rows(report)))
    return 0 if report.sound else FAILURE


def _rows(report) -> Rows:
    """Format a report for people."""
    from hpcsweep.solvers.solver import SOLVERS

    packed = f"{', packed' * report.packed}{'; not complete' * (not report.complete)}"
    yield "blocks", f"{report.committed} of {report.blocks} committed{packed}"
    if report.means_other_runs:
        yield "sample", "none: the job of this earlier version means other runs to this one"
    compared = [run for run in report.sample if run.difference is not None]
    if compared:
        worst = max(compared, key=lambda run: run.difference / run.allowed)
        yield (
            "sample",
            f"{len(compared)} of {len(report.sample)} runs compared with {worst.solver} "
            f"at {SOLVERS[worst.solver].tight:g}: the largest difference is "
            f"{worst.difference:.2g}, {worst.allowed:.2g} allowed ({worst.at}; {worst.compared})",
        )
    elif report.sample:
        why = report.sample[0].compared.removeprefix("nothing: ")
        yield "sample", f"0 of {len(report.sample)} runs compared: {why}"
    whole = [run for run in report.sample if run.whole_run]
    if whole:
        counts = Counter(run.whole_run for run in whole)
        periodic = sum(run.orbit_period > 0 for run in whole)
        yield (
            "whole",
            f"{len(whole)} runs ({periodic} periodic) from their stored start by flow: "
            f"{counts['equal']} equal to the last bit, {counts['same']} within tolerance, "
            f"{counts['other']} others",
        )
    yield from (("problem", problem) for problem in report.problems)
    if report.n_problems > len(report.problems):
        yield "", f"and {report.n_problems - len(report.problems)} more"
