#!/usr/bin/env bash
# Sets up everything that `make run` and `make test` need, in .venv of this checkout.
#
#   tools/setup.sh            MPI, parallel HDF5, Python packages, adhesis itself
#   tools/setup.sh --test     besides, what tests and linters need (requirements-test.lock)
#   tools/setup.sh --slurm    besides, as root on Debian or Ubuntu, the Slurm and the browser that tests start
#
# What does not wait for one another is done side by side, and every ten seconds a line says what is
# under way. Does nothing if nothing has changed since the last time. Environment:
#   PYTHON            the interpreter for .venv (default: python3)
#   HDF5_DIR          a parallel HDF5 to build h5py against (default: looked for)
#   ADHESIS_APT=no   never install system packages
# Lists of packages are words on purpose.
# shellcheck disable=SC2046,SC2086,SC2030,SC2031,SC2154
set -euo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
cd "$root"
venv=$root/.venv
log=$root/.setup/setup.log
stamp=$venv/adhesis-setup
tests=no slurm=no
for option; do
    case $option in
        --test) tests=yes ;;
        --slurm) slurm=yes tests=yes ;;
        *)
            echo "setup: $option is none of --test, --slurm" >&2
            exit 2
            ;;
    esac
done
SECONDS=0
warnings=()

H5PY=$(sed -n "s/^h5py==//p" requirements.lock)
MPICH=5.0.2
SYSTEM="g++ libc6-dev openmpi-bin libopenmpi-dev libhdf5-openmpi-dev"
SLURM="slurmctld slurmd slurm-client munge"

. tools/mpi.sh
. tools/parts.sh

say() { printf 'setup: %s\n' "$*"; }
warn() {
    warnings+=("$*")
    say "warning: $*"
}
die() {
    say "failed: $*" >&2
    exit 1
}

# required NAME: the end of a part without which there is no installation
required() {
    if ! finish "$1"; then
        tail -n 25 ".setup/$1.log" >&2
        die "${text[$1]} (all of it in .setup/$1.log)"
    fi
}
trap end_parts EXIT
trap 'exit 130' INT
trap 'exit 143' TERM

# ---------------------------------------------------------------------------------- what is here

can_apt() {
    [ "${ADHESIS_APT:-yes}" != no ] && [ "$(id -u)" = 0 ] && [ -e /etc/debian_version ] &&
        command -v apt-get >/dev/null
}

find_python() {
    local name
    for name in "${PYTHON:-python3}" python3.14 python3.13 python3.12 python3.11; do
        if "$name" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then
            python=$(command -v "$name")
            return 0
        fi
        if [ -n "${PYTHON:-}" ]; then break; fi
    done
    return 1
}
has_venv() { "$python" -c 'import ensurepip, venv' 2>/dev/null; }
has_headers() {
    "$python" -c 'import os, sysconfig as s, sys
sys.exit(not os.path.exists(os.path.join(s.get_path("include"), "Python.h")))'
}

is_parallel() { # DIR: does it hold an HDF5 that was built with MPI?
    local header
    for header in "$1/include/H5pubconf.h" "$1/include/H5pubconf-64.h"; do
        if grep -Eqs '^#define +H5_HAVE_PARALLEL +1' "$header" && [ -d "$1/lib" ]; then return 0; fi
    done
    return 1
}
# Sets hdf5 (directory) and compiler; returns 1 if there is no parallel HDF5 or no MPI compiler.
find_parallel_hdf5() {
    local triplet dir flavour
    hdf5='' compiler=''
    if [ -n "${HDF5_DIR:-}" ]; then
        if ! is_parallel "$HDF5_DIR"; then return 1; fi
        hdf5=$HDF5_DIR
    else
        # A cluster's module first: its compiler wrapper is in PATH and knows where it is.
        for flavour in h5pcc h5cc; do
            if [ -n "$hdf5" ] || ! command -v $flavour >/dev/null; then continue; fi
            dir=$($flavour -showconfig 2>/dev/null |
                sed -n 's/^ *Installation point: *//p' | head -n 1) || true
            if [ -n "$dir" ] && is_parallel "$dir"; then hdf5=$dir; fi
        done
        for flavour in hdf5-openmpi hdf5-mpich hdf5; do
            if [ -n "$hdf5" ] || ! command -v pkg-config >/dev/null; then continue; fi
            dir=$(pkg-config --variable=prefix $flavour 2>/dev/null) || true
            if [ -n "$dir" ] && is_parallel "$dir"; then hdf5=$dir; fi
        done
        # Debian and Ubuntu keep one directory for each MPI.
        triplet=$(gcc -dumpmachine 2>/dev/null) || true
        for flavour in openmpi mpich; do
            dir=/usr/lib/$triplet/hdf5/$flavour
            if [ -z "$hdf5" ] && is_parallel "$dir"; then hdf5=$dir; fi
        done
    fi
    compiler=mpicc
    case $hdf5 in
        */hdf5/openmpi) compiler=mpicc.openmpi ;;
        */hdf5/mpich) compiler=mpicc.mpich ;;
    esac
    [ -n "$hdf5" ] && command -v "$compiler" >/dev/null
}
has_mpi() { command -v mpirun >/dev/null || command -v mpiexec >/dev/null; }

has_compiler() { command -v "${CXX:-c++}" >/dev/null; }

key() { # FILE…: what an installation depends on
    cat pyproject.toml CMakeLists.txt adhesis/solver/kernels/* tools/setup.sh tools/mpi.sh tools/parts.sh "$@"
    # Another place, interpreter or MPI module is another installation.
    printf '%s\n' "$root" "$("$python" -c 'import sys; print(sys.version, sys.base_prefix)')" \
        "$(command -v mpicc)" "${HDF5_DIR:-}"
}
digest() { key "$@" | sha256sum | cut -d ' ' -f 1; }
is_stamped() { # STAMP FILE…
    [ -e "$1" ] && [ "$(cat "$1")" = "$(digest "${@:2}")" ]
}
ready() { find_python && [ -x "$venv/bin/adhesis" ] && is_stamped "$stamp" requirements.lock; }
needs_tests() { [ "$tests" = yes ] && ! is_stamped "$stamp-test" requirements.lock requirements-test.lock; }

# missing PACKAGE…: those that dpkg does not have
missing() {
    local package
    for package; do
        if [ "$(dpkg-query -W -f '${db:Status-Status}' "$package" 2>/dev/null)" != installed ]; then
            printf '%s ' "$package"
        fi
    done
}
apt_install() { # RUNLEVEL=1: install, but start no service
    export DEBIAN_FRONTEND=noninteractive RUNLEVEL=1
    apt-get install -y --no-install-recommends "$@" </dev/null ||
        { apt-get update && apt-get install -y --no-install-recommends "$@" </dev/null; }
}
needs() { # NAME PROGRAM: does a test want a program that is missing and may be installed?
    [ "$slurm" = yes ] && ! command -v "$2" >/dev/null && [ ! -e ".setup/no-$1" ] && can_apt
}
need_programs() { needs slurm slurmctld || needs browser chromium; }
install_program() { # NAME TEXT PACKAGE…
    local name=$1 whom=$2
    shift 2
    say "system packages for $whom: $*"
    # Tried once: the tests are skipped and say so, and set-up stays quick.
    step "$name" "system packages for $whom" apt_install "$@" || touch ".setup/no-$name"
}
install_programs() {
    if needs slurm slurmctld; then install_program slurm "the test of the batch script" $SLURM; fi
    if needs browser chromium; then install_program browser "the tests of pages in a browser" chromium; fi
}

# Not the launcher's and not another installation's: what is in .venv is what is meant. Byte code is
# kept whatever the environment says, or every process compiles all that it imports.
unset PYTHONPATH PYTHONHOME PYTHONDONTWRITEBYTECODE
export PIP_DISABLE_PIP_VERSION_CHECK=1 PIP_NO_INPUT=1 PIP_PROGRESS_BAR=off
# The lists hold all that is needed, so nothing has to be resolved. Byte code is made of what is
# imported, at the end: most of pandas and scipy never is.
pip() { "$venv/bin/python" -m pip "$@"; }
install() { pip install --no-deps --no-compile "$@"; }
locked() { grep -E "^($1)==" requirements.lock; }
install_tests() { install $(grep -v '^#' requirements-test.lock); }

mkdir -p .setup/wheels
# Two at a time, of `make run` and `make test` say, would install into one .venv over each other.
if command -v flock >/dev/null && { exec 9>>.setup/lock; } 2>/dev/null && ! flock -n 9; then
    say "another set-up is at work in this folder: waiting for its end"
    flock 9
fi
if ready; then
    if needs_tests; then
        : >"$log"
        part tests "packages for tests and linters" install_tests
        required tests
        digest requirements.lock requirements-test.lock >"$stamp-test"
        install_programs
        say "done in $SECONDS s"
    elif need_programs; then
        install_programs
    else
        say "nothing to do"
    fi
    exit 0
fi
: >"$log"

# ------------------------------------------------------------------- system packages, build tools

TOOLS='setuptools|Cython|numpy|pkgconfig|packaging|scikit_build_core|nanobind|pathspec|cmake|ninja'

make_venv() {
    if [ ! -x "$venv/bin/pip" ] || ! "$venv/bin/python" -m pip --version; then
        "$python" -m venv "$venv"
    fi
}
install_tools() { make_venv && install $(locked "$TOOLS"); }
begin_tools() {
    say "using $("$python" -V) ($python)"
    if [ -x "$venv/bin/python" ] &&
        [ "$("$venv/bin/python" -c 'import sys; print(sys.version, sys.base_prefix)' 2>/dev/null)" != \
            "$("$python" -c 'import sys; print(sys.version, sys.base_prefix)')" ]; then
        say "replacing .venv, which belongs to another Python"
        rm -rf "$venv"
    fi
    rm -f "$stamp" "$stamp-test"
    part tools "virtual environment .venv with build tools" install_tools
}
# Sets wanted: the system's packages that are missing
missing_system_packages() {
    wanted=''
    if ! find_python; then wanted="python3 python3-venv python3-dev"; fi
    if [ -n "${python:-}" ] && [[ $python = /usr/bin/* ]]; then
        # Debian's own interpreter comes without these; pyenv, conda and modules bring them along.
        if ! has_venv; then wanted+=" $(basename "$python")-venv"; fi
        if ! has_headers; then wanted+=" $(basename "$python")-dev"; fi
    fi
    if ! find_parallel_hdf5 || ! has_mpi; then wanted+=" $SYSTEM"; fi
    if [ -z "${CXX:-}" ] && ! has_compiler; then wanted+=" g++"; fi
    wanted=$(missing $wanted)
}

# Python first: what needs no MPI goes on while the rest is installed.
needed="Python 3.11 or newer is needed"
if ! find_python; then
    here=$("${PYTHON:-python3}" -V 2>/dev/null) && needed+=", and ${PYTHON:-python3} is $here"
    if [ -n "${PYTHON:-}" ] || ! can_apt; then die "$needed (say which with PYTHON=…)"; fi
    say "$needed: trying apt-get"
fi
wanted=
if can_apt; then missing_system_packages; fi
for name in $wanted; do
    if [[ $name = python3* ]]; then pythons+=" $name"; else others+=" $name"; fi
done
if [ -n "${pythons:-}" ]; then
    say "system packages for Python:$pythons"
    step python "system packages for Python" apt_install $pythons ||
        warn "apt-get could not install$pythons (see .setup/python.log)"
fi
if [ -n "${others:-}" ]; then
    say "system packages:$others"
    part system "system packages" apt_install $others
    if find_python && has_venv; then begin_tools; fi
    finish system || warn "apt-get could not install$others (see .setup/system.log)"
fi
find_python || die "$needed (say which with PYTHON=…)"
has_venv || die "the venv module of $python is missing (Debian: apt-get install python3-venv)"
has_headers || die "the C headers of $python are missing (Debian: apt-get install python3-dev)"
if [ -z "${pid[tools]:-}" ]; then begin_tools; fi

# --------------------------------------------------------------------------------- what to build

why_serial=
if ! find_parallel_hdf5; then
    if [ -n "${HDF5_DIR:-}" ]; then
        why_serial="HDF5_DIR=$HDF5_DIR is no parallel HDF5, or mpicc is not in PATH"
    else
        why_serial="no parallel HDF5 with its mpicc found (Debian: libhdf5-openmpi-dev; cluster: load its modules or set HDF5_DIR)"
    fi
fi
if ! has_mpi; then why_serial=${why_serial:-"no mpirun in PATH"}; fi

# ------------------------------------------- side by side: h5py, and all other packages with adhesis

build_h5py() {
    # A compile job for each core, and no optimisation: half the time to compile. Calls on tiny datasets take half
    # as long again, but most of a campaign's time is in loops.
    # Without isolation, or the build would first compile an old mpi4py from source.
    local config=$root/.setup/build.cfg
    printf '[build_ext]\nparallel = %s\n' "$(env -u OMP_NUM_THREADS nproc 2>/dev/null || echo 2)" >"$config"
    install $(locked mpi4py) &&
        DIST_EXTRA_CONFIG=$config CC=$compiler HDF5_MPI=ON HDF5_DIR=$hdf5 CFLAGS='-O0 -g0 -w' \
            pip wheel --no-cache-dir --no-build-isolation --no-deps \
            --no-binary=h5py --wheel-dir "$wheels.new" "h5py==$H5PY" &&
        rm -rf "$wheels" && mv "$wheels.new" "$wheels"
}
install_rest() {
    install $(grep -Ev "^(#|h5py==|ziglang==|($TOOLS)==)" requirements.lock) &&
        if [ "$tests" = yes ]; then install_tests; fi
}

required tools
if [ -z "$why_serial" ]; then
    # One folder for each combination: a serial wheel or one of another MPI must not be taken for it.
    wheels=.setup/wheels/$({
        "$venv/bin/python" -c 'import sys, numpy; print(sys.version, numpy.__version__)'
        echo "$H5PY" "$hdf5" "$compiler"
        "$compiler" -show 2>/dev/null
        grep -Es 'define H5_VERS_INFO' "$hdf5/include/H5public.h"
        "${MPIRUN:-mpirun}" --version 2>/dev/null | head -n 1
    } | sha256sum | cut -c 1-12)
    if compgen -G "$wheels/h5py-*.whl" >/dev/null; then
        say "h5py for $hdf5: built before, in $wheels"
    else
        rm -rf "$wheels.new"
        say "building h5py for $hdf5"
        part h5py "building h5py" build_h5py
    fi
fi
install_adhesis() {
    # The kernels are compiled here: half a minute of CPU time.
    if ! has_compiler; then
        install $(locked ziglang) || return 1
        export CXX="$venv/bin/python -m ziglang c++"
    fi
    PATH=$venv/bin:$PATH install --no-build-isolation --editable .
}
part rest "all other packages" install_rest
required rest
part adhesis "adhesis itself, with its kernels" install_adhesis
if [ -n "${pid[h5py]:-}" ] && ! finish h5py; then
    tail -n 15 .setup/h5py.log
    why_serial="h5py could not be built against $hdf5 (see .setup/h5py.log)"
fi
has_mpi_h5py() { "$venv/bin/python" -c 'import h5py, sys; sys.exit(not h5py.get_config().mpi)' 2>>"$log"; }
if [ -z "$why_serial" ]; then
    step installing "installing h5py with parallel HDF5" install --force-reinstall "$wheels"/h5py-*.whl || true
    has_mpi_h5py || why_serial="the h5py in $wheels has no MPI or cannot be loaded"
fi
if [ -n "$why_serial" ]; then
    part serial "installing h5py without MPI" install --force-reinstall --only-binary=h5py "h5py==$H5PY"
    required serial
fi
if ! has_mpi; then
    step mpich "no mpirun in PATH: one from the package mpich" install "mpich==$MPICH" ||
        warn "no MPI: install one (Debian: openmpi-bin); adhesis run works in one process only"
fi
required adhesis
# Byte code of what commands import, also for users who may not write here.
import_all() {
    "$venv/bin/python" -c '
from importlib import import_module
from adhesis.ensemble.command.main import COMMANDS
for name in COMMANDS:
    import_module(f"adhesis.ensemble.command.{name}")
import adhesis.ensemble.bench.benchmark, adhesis.solver.validate.claims
import h5netcdf, markdown_it, matplotlib.pyplot, mpi4py, pandas, rich.live, rich.progress, xarray'
}
part imports "byte code" import_all
required imports

# ----------------------------------------------------------------- the mpirun that fits, and Slurm

sees_two() { # MPIRUN: do two ranks that it starts see each other?
    local sizes
    sizes=$(
        MPIRUN=$1
        allow_ranks 2 1
        cd /tmp && timeout 60 "$1" -n 2 "$venv/bin/python" -P -c \
            'from mpi4py import MPI; print(MPI.COMM_WORLD.size, end=" ", flush=True)' \
            </dev/null
    ) || return 1
    [ "${sizes//[[:space:]]/}" = 22 ] # the ranks' lines may run into each other
}
choose_launcher() {
    local name path
    rm -f "$venv/mpirun"
    for name in ${MPIRUN:-} "$venv/bin/mpirun" mpirun mpiexec mpirun.openmpi mpirun.mpich; do
        path=$(command -v "$name") || continue
        if sees_two "$path"; then
            printf '%s\n' "$path" >"$venv/mpirun"
            return 0
        fi
    done
    return 1
}
step ranks "two ranks that see each other" choose_launcher ||
    warn "no mpirun here starts ranks that mpi4py sees as one job: adhesis run works in one process only (adhesis doctor tells more)"

install_programs

if [ -n "$why_serial" ]; then
    warn "no parallel writing, rank 0 writes the results file: $why_serial"
fi
if [ "$tests" = yes ]; then digest requirements.lock requirements-test.lock >"$stamp-test"; fi
digest requirements.lock >"$stamp"
say "done in $SECONDS s (adhesis doctor tells what was found)"
