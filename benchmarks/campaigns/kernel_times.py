"""Seconds that each kernel takes to be compiled and loaded; one and two processes that compile.

bash benchmarks/run.sh kernel_times: a table in Markdown. Processor time of each kernel, of all
processes together, and by the clock; the most memory that one process had.
"""

import json
import os
import subprocess
import sys
import tempfile
import time

LOAD = """
import json, time
begun = time.process_time()
import hpcsweep.solvers.flow
from hpcsweep.kernels.compile import entry_points
found = {"imports": time.process_time() - begun}
for one in entry_points.ALL:
    begun = time.process_time()
    one.load()
    found[one.name] = time.process_time() - begun
print(json.dumps(found))
"""


def run(cache: str, *arguments: str) -> tuple[str, float, float, float]:
    """Run Python; return what it says, processor time and clock (s), and memory (MB)."""
    begun = time.monotonic()
    # with a process between, the memory is of this command's processes alone
    code = (
        "import json, resource, subprocess, sys\n"
        "done = subprocess.run(sys.argv[1:], stdout=subprocess.PIPE, text=True, check=True)\n"
        "used = resource.getrusage(resource.RUSAGE_CHILDREN)\n"
        "print(json.dumps([done.stdout, used.ru_utime + used.ru_stime, used.ru_maxrss / 1e3]))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, sys.executable, *arguments],
        env={**os.environ, "NUMBA_CACHE_DIR": cache},
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    )
    said, seconds, memory = json.loads(done.stdout)
    return said, seconds, time.monotonic() - begun, memory


def main() -> None:
    """Measure, and print the table."""
    columns: list[dict[str, float]] = []
    totals = []
    for jobs in (1, 2):
        with tempfile.TemporaryDirectory() as cache:
            _, *total = run(cache, "-m", "hpcsweep", "warmup", "--jobs", str(jobs))
            totals.append(total)
    with tempfile.TemporaryDirectory() as cache:
        for _ in ("compiled", "loaded"):
            said, *total = run(cache, "-c", LOAD)
            columns.append(json.loads(said))
            totals.append(total)
    print("| kernel | compiled | loaded |")
    print("|---|---|---|")
    for name in sorted(columns[0], key=lambda name: -columns[0][name]):
        words = [f"{column[name]:.3g}" for column in columns]
        print(f"| `{name.removeprefix('hpcsweep.solvers.flow.')}` | {' | '.join(words)} |")
    print("\n| | warmup, one process | two | compiled as above | loaded |\n|---|---|---|---|---|")
    for what, place in (("processor time, all", 0), ("by the clock", 1), ("memory (MB)", 2)):
        print(f"| {what} | {' | '.join(f'{total[place]:.3g}' for total in totals)} |")


if __name__ == "__main__":
    main()
