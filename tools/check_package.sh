#!/usr/bin/env bash
# Builds source distribution and wheel, installs the wheel into a bare environment that sees neither
# an MPI nor the system's HDF5, and uses it there: loop, run, report, status, doctor.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
python=$(realpath -s "${PYTHON:-.venv/bin/python}")
place=$(mktemp -d)
say() { echo "package: $*"; }
log=.setup/check-package.log
. tools/parts.sh
trap 'end_parts; rm -rf "$place"' EXIT
export PIP_DISABLE_PIP_VERSION_CHECK=1
unset PYTHONPATH PYTHONHOME HDF5_DIR MPIRUN

echo "package: source distribution, and the wheel from it"
"$python" -c "import sys; from scikit_build_core.build import build_sdist as b; b(sys.argv[1])" \
    "$place" >"$place/build.log" 2>&1 || { tail -n 20 "$place/build.log" >&2; exit 1; }
tar -xzf "$place"/adhesis-*.tar.gz -C "$place"
"$python" -m pip --no-input wheel --quiet --no-deps --no-build-isolation \
    --wheel-dir "$place" "$place"/adhesis-*/
rm -rf "$place"/adhesis-*/
"$python" tools/read_package.py "$place"/adhesis-*.whl "$place"/adhesis-*.tar.gz "$(git rev-parse HEAD)"

echo "package: a bare environment"
"$python" -m venv "$place/venv"
must package "installing the wheel and what it needs" \
    "$place/venv/bin/python" -m pip --no-input install --quiet "$place"/adhesis-*.whl
# Nothing of this machine is in PATH: no mpirun, no compiler.
adhesis() { (cd "$place" && env -i PATH="$place/venv/bin" HOME="$place" adhesis "$@"); }

printf '%s\n' '[profile]' 'period = 1e-3' 'n0 = 1' 'ratio = 4' 'h_rms = 1e-6' '[material]' \
    'young = 1e6' 'poisson = 0.5' '[sweep]' 'hurst = [0.8]' 'work_of_adhesion = [0.01, 0.04]' \
    'realisations = 2' 'seed = 1' '[cycle]' 'max_penetration = 0.6' 'load_steps = 4' \
    >"$place/small.toml"
adhesis --version
adhesis sample trace.csv && adhesis new my.toml
echo "package: loop, run, status, report"
adhesis loop --hurst 0.8 --seed 1 --period 1e-3 --n0 1 --ratio 4 --max-penetration 0.6 \
    --load-steps 4 --json loop.json >/dev/null
test -s "$place/loop.json"
adhesis run my.toml --dry-run >/dev/null
adhesis run small.toml
adhesis status small.h5 >/dev/null
adhesis report small.h5 --to report >/dev/null
test -s "$place/report/report.md" && test -s "$place/report/losses.csv"
echo "package: doctor"
adhesis doctor | tee "$place/doctor"
grep -q "mpi4py" "$place/doctor"
echo "package: good"
