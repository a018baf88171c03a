#!/usr/bin/env bash
# Makes the documentation site in docs/_build, from docs/, the docstrings and examples/.
#
# What it is made with (docs/requirements.lock) is kept in .setup/docs, apart from .venv: nothing
# else needs it. A warning is an error.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
python=${PYTHON:-.venv/bin/python}
say() { echo "docs: $*"; }
log=.setup/docs.log
. tools/parts.sh
trap end_parts EXIT
tools=.setup/docs
if ! cmp -s docs/requirements.lock "$tools/requirements.lock"; then
    rm -rf "$tools"
    must docs-tools "installing what the site is made with into $tools" \
        "$python" -m pip --no-input --disable-pip-version-check install --quiet --target "$tools" \
        -r docs/requirements.lock
    cp docs/requirements.lock "$tools/"
fi
site() {
    PYTHONPATH=$tools:. OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 \
        "$python" -m sphinx --fail-on-warning --keep-going --quiet -b html docs docs/_build
}
must docs-site "running the examples, making the pages" site
echo "docs: open docs/_build/index.html"
