#!/bin/sh
# Build the kernels in place: build.sh [compiler] [flags]
set -e
cd "$(dirname "$0")"
python=../../.venv/bin/python
nb=$($python -c "import nanobind, os; print(os.path.dirname(nanobind.__file__))")
include=$($python -c "import sysconfig; print(sysconfig.get_path('include'))")
suffix=$($python -c "import sysconfig; print(sysconfig.get_config_var('EXT_SUFFIX'))")
cxx=${1:-g++}
flags="-std=c++20 -O3 -ffp-contract=off -fPIC -fvisibility=hidden -Wall -Wextra -Wno-psabi ${2:-}"
out=${BUILD:-/tmp/kernels_build}
mkdir -p "$out"
objects=
for source in *.cpp; do
    object=$out/${source%.cpp}.o
    objects="$objects $object"
    if [ ! -e "$object" ] || [ -n "$(find . -newer "$object" -name '*.?pp')" ]; then
        optimise=$flags
        [ "$source" = bindings.cpp ] && optimise="$flags -Os"
        $cxx $optimise -I"$nb/include" -I"$include" -c "$source" -o "$object"
    fi
done
[ -e "$out/nanobind.o" ] || $cxx -std=c++17 -Os -fPIC -fvisibility=hidden -fno-strict-aliasing \
    -DNDEBUG -I"$nb/include" -I"$nb/ext/robin_map/include" -I"$include" -w \
    -c "$nb/src/nb_combined.cpp" -o "$out/nanobind.o"
$cxx -shared -o "../_kernels$suffix" $objects "$out/nanobind.o"
