#!/usr/bin/env bash
# Builds the kernels so that a bad address or undefined arithmetic ends the process, runs their tests
# and random scenes with that module, and removes it again.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
python=$(realpath -s "${PYTHON:-.venv/bin/python}")
cmake -G Ninja -S . -B build/sanitized -DADHESIS_SANITIZE=ON -DPython_EXECUTABLE="$python" \
    -DCMAKE_LIBRARY_OUTPUT_DIRECTORY="$PWD/build/sanitized/adhesis/solver"
cmake --build build/sanitized -j "${JOBS:-1}"
# a copy of the sources around that module
cp -rL adhesis tests tools build/sanitized/
cd build/sanitized
# Python itself does not free what it holds at its end
export ASAN_OPTIONS=detect_leaks=0 LD_PRELOAD
LD_PRELOAD="$(c++ -print-file-name=libasan.so) $(c++ -print-file-name=libubsan.so)"
export PYTHONPATH=$PWD
"$python" -m pytest -q -p no:cacheprovider \
    tests/solver/test_descent.py tests/solver/test_sharp_field.py tests/solver/test_touch.py \
    tests/solver/test_sharp_many.py tests/solver/test_hostile.py "$@"
"$python" tools/fuzz/loops.py --seed 1 --scenes "${SCENES:-200}"
