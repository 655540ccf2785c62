"""`hpcsweep pack`: compress a results file.

Compress a results file. The copy is compared with the original, dataset by dataset and checksum by
checksum, before it takes its place. Everything reads a packed file, but `run` cannot resume it:
a file that is not complete is packed only into a copy (-o).
"""

from hpcsweep.commands import add_file


def configure(parser) -> None:
    """Add the options of the command."""
    add_file(parser, "OUT", "packed file, must not exist (default: FILE itself is replaced)")


def run(options) -> int:
    """Run the command."""
    from hpcsweep.store import pack
    from hpcsweep.studies.run_names import amount

    before, after = pack(options.file, options.output)
    print(
        f"{options.output or options.file}: {amount(after)}, {amount(before)} before packing; "
        "equal in every dataset and checksum"
    )
    return 0
