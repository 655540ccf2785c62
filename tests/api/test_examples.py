"""The example in the docstring of every public name runs, and prints what it says."""

import doctest
import inspect
import math
import re
from pathlib import Path

import numpy as np
import pytest
from together import together
from tools import SMALL, made

import hpcsweep

SECONDS = ("curve",)
"""Names whose examples take that long."""
NAMES = [name for name in hpcsweep.__all__ if not name.startswith("__")]


@pytest.fixture(scope="module")
def study(tmp_path_factory) -> Path:
    """A folder with a job and its results, for the examples that read them."""
    folder = tmp_path_factory.mktemp("study")
    (folder / "study.toml").write_text(SMALL)
    made(SMALL, folder / "study.h5")
    return folder


def runs(name: str) -> None:
    names = {"hpcsweep": hpcsweep, "math": math, "np": np, "Path": Path}
    text = inspect.getdoc(getattr(hpcsweep, name))
    examples = doctest.DocTestParser().get_doctest(text, names, name, None, None)
    assert examples.examples, f"{name}: has no example"
    told: list[str] = []
    doctest.DocTestRunner(verbose=False).run(examples, out=told.append)
    assert not told, "".join(told)


@pytest.mark.slow
@together("name", [name for name in NAMES if name not in SECONDS])
def test_the_example_of_a_public_name_runs(study, name, monkeypatch):
    monkeypatch.chdir(study)
    runs(name)


@pytest.mark.slow
def test_an_example_that_takes_seconds_runs(study, monkeypatch):
    monkeypatch.chdir(study)
    for name in SECONDS:
        runs(name)


FUNCTIONS = [name for name in NAMES if inspect.isfunction(getattr(hpcsweep, name))]


def test_public_functions_tell_their_arguments_results_and_errors():
    assert len(FUNCTIONS) > 20
    for name in FUNCTIONS:
        function = getattr(hpcsweep, name)
        headings = re.findall(r"^(\w+)\n-+$", inspect.getdoc(function), re.MULTILINE)
        returns = inspect.signature(function).return_annotation is not None
        told = {"Parameters", "Raises", "Examples"} | ({"Returns"} if returns else set())
        assert told <= set(headings), name
