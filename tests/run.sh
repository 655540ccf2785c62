#!/usr/bin/env bash
# All set-up, then the tests: tests/run.sh [pytest arguments]
# Needs Python 3.11 or newer with venv; writes .venv.
set -euo pipefail
cd "$(dirname "$0")/.."
export PYTHONDONTWRITEBYTECODE=  # pytest keeps the tests as it has rewritten them
bash .ci/venv .venv mpich,test
# once, before many tests want the kernels; some processes leave no core idle at the end
.venv/bin/python benchmarks/reference/warm_up.py &
.venv/bin/python -m pytest -qq --collect-only >/dev/null &  # else each process rewrites the tests
.venv/bin/hpcsweep warmup --jobs 2
wait
exec .venv/bin/python -m pytest -n 2 --dist worksteal \
    -m "not slow and not mpio and not browser and not slurm" "$@"
