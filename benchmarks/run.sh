#!/usr/bin/env bash
# List the benchmarks, or run one: benchmarks/run.sh [NAME [OPTIONS]]
# Needs Python 3.11 or newer with venv; writes .venv.
set -euo pipefail
cd "$(dirname "$0")/.."
[ -x .venv/bin/hpcsweep ] || bash .ci/venv .venv mpich,test
export PYTHONPATH=benchmarks:benchmarks/campaigns:benchmarks/reference:tests/support:tests/campaign:jobs/paper
if [ $# = 0 ]; then
    echo "usage: bash benchmarks/run.sh NAME [OPTIONS]    NAME --help tells the options"
    grep -rl --include='*.py' '^if __name__ ==' benchmarks | sort | while read -r path; do
        printf '  %-18s %s\n' "$(basename "$path" .py)" "$(sed -n '1s/^r\?"""\(.*[^"]\)\("""\)\?$/\1/p' "$path")"
    done
    exit
fi
path=$(find benchmarks -name "$1.py" | head -n 1)
if [ -z "$path" ] || ! grep -q '^if __name__ ==' "$path"; then
    echo "benchmarks/run.sh: $1: there is no such benchmark; without a name it lists them" >&2
    exit 2
fi
shift
exec .venv/bin/python "$path" "$@"
