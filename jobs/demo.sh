#!/usr/bin/env bash
# All set-up, then a job on two ranks and its picture: jobs/demo.sh [JOB.toml]
# Needs Python 3.11 or newer with venv; writes .venv and out/.
set -euo pipefail
cd "$(dirname "$0")/.."
job=${1:-jobs/demo.toml}
name=$(basename "$job" .toml)
bash .ci/venv .venv mpich
mkdir -p out
.venv/bin/mpirun -n 2 .venv/bin/hpcsweep run "$job" -o "out/$name.h5"
.venv/bin/hpcsweep status "out/$name.h5"
.venv/bin/hpcsweep plot "out/$name.h5" --color period -o "out/$name.png"
