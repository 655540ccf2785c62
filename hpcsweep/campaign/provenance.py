"""Collect the provenance of results: versions, machine, time."""

import functools
import platform
import shlex
import subprocess
import sys
import time
from importlib import metadata
from pathlib import Path

LIBRARIES = ("numpy", "scipy", "numba", "h5py", "mpi4py")


def version() -> str:
    """Return the version of hpcsweep."""
    return _version_of("hpcsweep", "unknown (not installed)")


def _version_of(package: str, missing: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return missing


@functools.cache
def library_versions() -> str:
    """Return the versions of Python and of the libraries the results depend on."""
    versions = (f"{name} {_version_of(name, 'not installed')}" for name in LIBRARIES)
    return ", ".join([f"python {platform.python_version()}", *versions])


@functools.cache
def git_commit() -> str:
    """Return the commit of a source checkout, with ``+`` if it was changed; else ''."""
    folder = Path(__file__).resolve().parent.parent
    if not (folder.parent / ".git").exists():
        return ""
    try:
        commit = subprocess.run(
            ["git", "-C", folder, "describe", "--always", "--abbrev=40", "--dirty=+"],
            capture_output=True,
            text=True,
            timeout=10,
            check=True,
        )
    except (OSError, subprocess.SubprocessError):
        return ""
    return commit.stdout.strip()


def collect(mpi_library: str, hosts: list[str]) -> dict[str, str | int]:
    """Collect the attributes that a campaign file stores when it is created."""
    # loads numba, which `version` does not need
    from hpcsweep.kernels.compile.cache import processor

    created = time.strftime("%Y-%m-%dT%H:%M:%S%z")
    command = shlex.join(["hpcsweep", *sys.argv[1:]]).encode(errors="replace").decode()
    return {
        "hpcsweep_version": version(),
        "git_commit": git_commit(),
        "libraries": library_versions(),
        "processor": processor(),
        "mpi": mpi_library,
        "hosts": " ".join(sorted(set(hosts))),
        "ranks": len(hosts),
        "created": created,
        "command": command,
        "history": f"{created}: {command} (hpcsweep {version()})",
    }
