"""Compare two campaign files' datasets bit for bit.

    bash benchmarks/run.sh compare A.h5 B.h5

Called otherwise, it needs tests/support on PYTHONPATH.
"""

import sys
from pathlib import Path

from tools import assert_same_datasets, datasets

if __name__ == "__main__":
    left, right = map(Path, sys.argv[1:])
    assert_same_datasets(left, right)
    print(f"{left.name} and {right.name}: {len(datasets(left))} datasets, equal to the last bit")
