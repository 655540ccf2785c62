"""A share of `bash benchmarks/run.sh matrix_lies`, which judges 300 pairs and more."""

import pytest
from stability.matrix_lies import FORMATS, LIES, judge

QUICK = [kind for kind in FORMATS if kind != "mat"]
"""Those that are read in this process."""


@pytest.mark.parametrize("lie", [*LIES, ""])
def test_a_pair_of_matrices_with_a_lie_is_read_right_or_refused(tmp_path, lie):
    for seed, kind in enumerate(QUICK):
        folder = tmp_path / kind
        folder.mkdir()
        outcome, said = judge(folder, kind, lie, 1000 + seed)
        assert outcome == "right" if not lie else outcome != "wrong", f"{kind}: {said}"


@pytest.mark.slow
def test_every_lie_in_every_format_is_read_right_or_refused(tmp_path):
    for k, (kind, lie) in enumerate((kind, lie) for kind in FORMATS for lie in LIES):
        folder = tmp_path / str(k)
        folder.mkdir()
        outcome, said = judge(folder, kind, lie, k)
        assert outcome != "wrong", f"{kind}, {lie}, {k}: {said}"
