"""What an sdist and a wheel must hold: python tests/packaging/contents.py FILE.tar.gz FILE.whl."""

import subprocess
import sys
import tarfile
import tomllib
import zipfile
from email.parser import Parser
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
CODE = ("hpcsweep/",)
TREE = (*CODE, "docs/", "jobs/", "slurm/", "tests/")
TOP = {"CHANGELOG.md", "CITATION.cff", "CONTRIBUTING.md", "LICENSE", "NOTICE", "README.md"}
TOP |= {"pyproject.toml", "codemeta.json", ".zenodo.json"}


def tracked(*folders: str) -> set[str]:
    """Return the files of some folders that git knows."""
    listed = subprocess.run(
        ["git", "ls-files", *folders], cwd=ROOT, capture_output=True, text=True, check=True
    )
    return set(listed.stdout.split("\n")) - {""}


def sdist_files(path: Path) -> set[str]:
    """Return what an sdist holds, without its top folder."""
    with tarfile.open(path) as archive:
        files = [member.name for member in archive.getmembers() if member.isfile()]
    return {name.partition("/")[2] for name in files}


def check_wheel(path: Path) -> None:
    """Compare the code in a wheel with git, and its metadata with pyproject.toml."""
    with zipfile.ZipFile(path) as archive:
        names = set(archive.namelist())
        (metadata,) = (name for name in names if name.endswith(".dist-info/METADATA"))
        reported = Parser().parsestr(archive.read(metadata).decode())
    code = {name for name in names if ".dist-info/" not in name}
    assert code == tracked(*CODE), code ^ tracked(*CODE)
    assert reported["Version"] == PROJECT["version"]
    assert reported["Description-Content-Type"] == "text/markdown"
    licences = {"LICENSE", "NOTICE"}
    assert licences <= {Path(name).name for name in names}
    assert sorted(reported.get_all("Provides-Extra")) == sorted(PROJECT["optional-dependencies"])


def check_sdist(path: Path) -> None:
    """Compare the files in an sdist with those of git."""
    missing = (tracked(*TREE) | TOP) - sdist_files(path)
    assert not missing, missing


if __name__ == "__main__":
    for file in map(Path, sys.argv[1:]):
        (check_wheel if file.suffix == ".whl" else check_sdist)(file)
        print(f"{file.name}: {file.stat().st_size / 1e6:.1f} MB, complete")
