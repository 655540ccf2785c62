"""`hpcsweep merge`: make the results file of a job of those of its parts.

Write the results file of a job that hpcsweep split has cut, from the complete files of all of its
parts. It equals that of a run of the whole job, to the last bit.
"""

from hpcsweep.figures.options import file_name


def configure(parser) -> None:
    """Add the options of the command."""
    parser.add_argument("files", type=file_name, nargs="+", metavar="FILE", help="of all parts")
    parser.add_argument(
        "-o", "--output", type=file_name, required=True, metavar="WHOLE", help="must not exist"
    )


def run(options) -> int:
    """Run the command."""
    from hpcsweep.parallel.mpi import launched_rank
    from hpcsweep.store import merge

    if launched_rank() == 0:
        n_runs = merge(options.files, options.output)
        print(f"{options.output}: {n_runs} runs of {len(options.files)} parts")
    return 0
