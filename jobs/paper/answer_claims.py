"""Answer the claims of the paper: python jobs/paper/answer_claims.py FILE.h5 ...

Each claim is answered yes, no or cannot tell, with our numbers, for the damping of each file.
Claims 1 to 5, 8 and 9 are about Omega = 0.445 (figure3.toml), 6 and 7 about maps over Omega and A
(figure6.toml and figure6-beta100.toml, or bluecrystal.toml and bluecrystal-beta100.toml; of two
maps the one of more runs counts). Chaos is identified by the largest Lyapunov exponent: jobs must
set output.lyapunov = true.
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from claims import judge_files, report

from hpcsweep.store import StoreError


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the answers; return the exit code."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("files", type=Path, nargs="+", metavar="FILE")
    form = parser.add_mutually_exclusive_group()
    form.add_argument("--json", action="store_true", help="machine-readable")
    form.add_argument("--markdown", action="store_true", help="as a table in Markdown")
    options = parser.parse_args(arguments)
    try:
        answers = judge_files(options.files)
    except StoreError as error:
        print(f"answer_claims: error: {error}", file=sys.stderr)
        return 2
    write = report.as_json if options.json else report.as_text
    print(report.as_markdown(answers) if options.markdown else write(answers))
    return 0


if __name__ == "__main__":
    sys.exit(main())
