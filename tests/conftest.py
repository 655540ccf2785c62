"""Fixtures of all tests; the tools they share are in `campaigns/tools.py`."""

from pathlib import Path

import pytest
from tools import SMALL


@pytest.fixture
def small_job(tmp_path: Path) -> Path:
    """A job of 88 runs that takes a fraction of a second."""
    path = tmp_path / "small.toml"
    path.write_text(SMALL)
    return path
