"""A share of the fuzzer's cases; `bash benchmarks/run.sh fuzz --cases 20000` does them all."""

import fuzz
import pytest

SHARE = {
    **{"job": 6, "journal": 1, "data": 2, "packed": 2, "cut": 2, "removed": 2},
    **{"study": 8},
    **{"kernel": 10, "output": 5, "link": 3, "threads": 4},
    **{"session": 4, "range": 200, "yield": 60},
    **{"model": 12, "rows": 8, "portfolio": 12, "table": 8, "plot": 6},
}
SECONDS = ("job", "session", "table", "plot")
"""Kinds of which a share takes seconds."""


@pytest.fixture(scope="module")
def patient(tmp_path_factory):
    return fuzz.Patient(tmp_path_factory.mktemp("fuzz"))


@pytest.mark.parametrize(
    "kind",
    [pytest.param(kind, marks=[pytest.mark.slow] * (kind in SECONDS)) for kind in SHARE],
)
def test_a_share_of_the_cases_of_each_kind(patient, kind):
    outcomes = {seed: patient.case(kind, seed) for seed in range(SHARE[kind])}
    assert {seed: what for seed, what in outcomes.items() if what not in fuzz.ALLOWED} == {}


@pytest.mark.slow
def test_the_fuzzer_sees_what_ends_otherwise(patient, monkeypatch):
    """It must be able to fail: an exception that is no line, results that differ."""
    monkeypatch.setattr(fuzz._Server, "patient", patient)

    def broken(path):
        raise KeyError("no line")

    with monkeypatch.context() as context:
        context.setattr(fuzz, "load_job", broken)
        assert fuzz.serve(("job", 1)) == (fuzz.OTHERWISE, "KeyError: 'no line'")
    with monkeypatch.context() as context:
        wrong = {**patient.results, "metadata": patient.results["metadata"] + 1}
        context.setattr(patient, "results", wrong)
        outcome, what = fuzz.serve(("data", 1))
        assert outcome == fuzz.OTHERWISE
        assert "open_results gives other results" in what


@pytest.mark.slow
def test_the_command_tries_cases_of_all_kinds(capsys):
    code = fuzz.main(["--cases", "20", "--seed", "17"])
    assert code == 0, capsys.readouterr().out
