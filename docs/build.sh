#!/usr/bin/env bash
# All set-up, then the documentation: docs/build.sh leaves docs/_build/html/index.html
# Needs Python 3.11 or newer with venv; writes .venv and what .gitignore names in docs/.
set -euo pipefail
cd "$(dirname "$0")/.."
bash .ci/venv .venv mpich,docs
export PATH=$PWD/.venv/bin:$PATH
# what examples have left of another version of the program is refused by this one
find docs -maxdepth 2 -name '*.h5*' -delete
hpcsweep warmup --jobs 2
python -m sphinx --fail-on-warning --keep-going --quiet -b html docs docs/_build/html
echo "docs/_build/html/index.html"
