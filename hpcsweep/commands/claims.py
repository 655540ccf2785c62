"""`hpcsweep claims`: answer the claims of the paper."""

from pathlib import Path

from hpcsweep.commands import RAW, USER_ERROR, complain

HELP = """\
Answer each claim of the paper yes, no or cannot tell, with our numbers, for the damping of each
file. Claims 1 to 5, 8 and 9 are about Omega = 0.445 (jobs/figure3.toml), 6 and 7 about maps over
Omega and A (jobs/figure6.toml and jobs/figure6-beta100.toml, or jobs/bluecrystal.toml and
jobs/bluecrystal-beta100.toml; of two maps the one of more runs counts). Chaos is told by the
largest Lyapunov exponent: jobs must set output.lyapunov = true."""


def add_to(commands) -> None:
    """Add the command to the parser's commands."""
    claims = commands.add_parser(
        "claims",
        help="answer the claims of the paper, with numbers",
        description=HELP,
        formatter_class=RAW,
    )
    claims.add_argument("files", type=Path, nargs="+", metavar="FILE")
    how = claims.add_mutually_exclusive_group()
    how.add_argument("--json", action="store_true", help="machine-readable")
    how.add_argument("--markdown", action="store_true", help="as a table in Markdown")
    claims.set_defaults(function=_claims)


def _claims(options) -> int:
    from hpcsweep.claims import judge_files, report
    from hpcsweep.store import StoreError

    try:
        answers = judge_files(options.files)
    except StoreError as error:
        complain(str(error))
        return USER_ERROR
    write = report.as_json if options.json else report.as_text
    print(report.as_markdown(answers) if options.markdown else write(answers))
    return 0
