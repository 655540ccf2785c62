"""What tests of the cache share."""

import pytest


@pytest.fixture(autouse=True)
def nothing_kept_elsewhere(monkeypatch, tmp_path_factory):
    """Start programs with an empty folder for kernels that a cache cannot take."""
    monkeypatch.setenv("TMPDIR", str(tmp_path_factory.mktemp("elsewhere")))
