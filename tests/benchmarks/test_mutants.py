"""Mutants change one thing, and are noticed where a test looks."""

import shutil

import mutants
import pytest

SOURCE = '''
def middle_of(values: "1 + 1") -> "a < b":
    """Return 1 + 1."""
    low, high = min(values), max(values)
    if not values or low > 3.0:
        raise ValueError(f"{values} has more than {1 + 1}")
    return low + (high - low) / 2
'''


def test_every_mutant_changes_one_operator_constant_or_name(monkeypatch, tmp_path):
    monkeypatch.setattr(mutants, "ROOT", tmp_path)
    path = tmp_path / "middle.py"
    path.write_text(SOURCE)
    made = list(mutants.mutants(path))
    assert {mutant.text for mutant in made} >= {"high", "low", "values", "low >= 3.0", "4.6", "3"}
    assert not any("1 + 1" in str(mutant) or "1 - 1" in str(mutant) for mutant in made)
    for mutant in made:
        lines = zip(SOURCE.splitlines(), mutant.source().splitlines(), strict=True)
        assert [old != new for old, new in lines].count(True) == 1
        compile(mutant.source(), "mutant", "exec")


@pytest.mark.parametrize(("tested", "expected"), [("2.0", False), ("2.0 or True", True)])
def test_a_mutant_lives_where_no_test_looks(monkeypatch, tmp_path, tested, expected):
    here, tree = tmp_path / "here", tmp_path / "tree"
    (here / "tests" / "middle").mkdir(parents=True)
    (here / "middle.py").write_text(SOURCE)
    test = f"def test_it():\n    assert middle_of([1.0, 3.0]) == {tested}\n"
    (here / "tests" / "middle" / "test_it.py").write_text(f"from middle import middle_of\n{test}")
    shutil.copytree(here, tree)
    monkeypatch.setattr(mutants, "ROOT", here)
    mutant = next(
        m for m in mutants.mutants(here / "middle.py") if m.text == "low - (high - low) / 2"
    )
    assert mutants.lives(mutant, tree, ["middle"], processes=0) is expected
    assert (tree / "middle.py").read_text() == SOURCE
