"""`hpcsweep stress`: try the numerical stability of the solvers."""

import argparse
import json
import sys

from hpcsweep.commands import FAILURE, RAW


def _seed(text: str) -> int:
    value = int(text)
    if not 0 <= value < 2**31:
        raise argparse.ArgumentTypeError(f"must be from 0 to {2**31 - 1}, is {text}")
    return value


def add_to(commands) -> None:
    """Add the command to the parser's commands."""
    stress = commands.add_parser(
        "stress",
        help="test the solvers at the extremes of their range",
        description="Put extreme structures, forcings and states to the solvers, and print what "
        "happened and how long it took.\nA named outcome (NON_FINITE, STEP_LIMIT, "
        "SOLVER_FAILED) is a result; NaN, an exception, a missed cap or a hang is a failure.",
        epilog="exit codes: 0 all passed, 1 something failed",
        formatter_class=RAW,
    )
    stress.add_argument(
        "--quick",
        action="store_true",
        help="3,000 random runs in place of 1,000,000, shorter orbits",
    )
    stress.add_argument("--seed", type=_seed, default=0, help="of the random runs (default: 0)")
    stress.add_argument("--json", action="store_true", help="machine-readable")
    stress.set_defaults(function=_stress)


def _stress(options) -> int:
    from hpcsweep.checks import stress

    rows = stress.stress(
        options.quick, options.seed, say=lambda text: print(f"  {text}", file=sys.stderr)
    )
    if options.json:
        print(json.dumps(stress.as_json(rows), indent=1))
    else:
        print(stress.as_text(rows))
    return 0 if all(row["passed"] for row in rows) else FAILURE
