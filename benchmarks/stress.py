"""Numerical stability: extreme structures, forcings and states, and whether the solvers stand them.

A named outcome (NON_FINITE, STEP_LIMIT, SOLVER_FAILED) is a result; NaN, an exception, a missed cap
or a hang is a failure. Exit codes: 0 all passed, 1 something failed.
"""

import hpcsweep.commands.one_thread  # noqa: F401  # isort: skip  (before numpy is loaded)
import argparse
import json
import sys

from stability import runs


def _seed(text: str) -> int:
    value = int(text)
    if not 0 <= value < 2**31:
        raise argparse.ArgumentTypeError(f"must be from 0 to {2**31 - 1}, is {text}")
    return value


def main(arguments: list[str] | None = None) -> int:
    """Put all cases to the solvers; return the exit code."""
    parser = argparse.ArgumentParser(
        prog="stress",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--quick",
        action="store_true",
        help="3,000 random runs in place of 1,000,000, shorter orbits",
    )
    parser.add_argument("--seed", type=_seed, default=0, help="of the random runs (default: 0)")
    parser.add_argument("--json", action="store_true", help="machine-readable")
    options = parser.parse_args(arguments)
    rows = runs.stress(
        options.quick, options.seed, say=lambda text: print(f"  {text}", file=sys.stderr)
    )
    if options.json:
        print(json.dumps(runs.as_json(rows), indent=1))
    else:
        print(runs.as_text(rows))
    return 0 if all(row["passed"] for row in rows) else 1


if __name__ == "__main__":
    sys.exit(main())
