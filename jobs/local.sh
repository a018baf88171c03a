#!/usr/bin/env bash
# Runs a campaign on the cores of this machine and reports on it.
#
#   jobs/local.sh CAMPAIGN.toml [RANKS]
#
# Results: out/NAME.h5, tables and figures: out/NAME/ (NAME from CAMPAIGN.toml), both below the
# working directory; OUT=DIR puts them elsewhere. A results file of an earlier run is resumed.
# RANKS: one more than the cores that this process may use, since the rank that hands out only
# waits. MPIRUN=PATH chooses the launcher. Exit codes are those of hysteron run; 75: stopped early,
# run it again to resume.
set -euo pipefail

here=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
campaign=${1:?which campaign? usage: jobs/local.sh CAMPAIGN.toml [RANKS]}
cores=$(nproc 2>/dev/null || getconf _NPROCESSORS_ONLN)
ranks=${2:-$((cores + 1))}
name=$(basename "$campaign" .toml)
out=${OUT:-out}

. "$here/tools/mpi.sh"

if [ -x "$here/.venv/bin/hysteron" ]; then
    hysteron=$here/.venv/bin/hysteron
elif ! hysteron=$(command -v hysteron); then
    echo "jobs/local.sh: hysteron is not installed: run make run, or tools/setup.sh" >&2
    exit 1
fi
mkdir -p "$out"

# The ranks share the cores among themselves: one thread each.
export OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 MKL_NUM_THREADS=1 NUMBA_NUM_THREADS=1

choose_mpirun "$here"
if [ -n "$MPIRUN" ] && [ "$ranks" -gt 1 ]; then
    allow_ranks "$ranks" "$cores"
    launch=("$MPIRUN" -n "$ranks")
else
    launch=()
    echo "jobs/local.sh: one process (no mpirun was found, or one rank was asked for)"
fi

code=0
${launch[@]+"${launch[@]}"} "$hysteron" run "$campaign" --out "$out/$name.h5" </dev/null || code=$?
if [ "$code" = 75 ]; then
    echo "jobs/local.sh: stopped early; the same command resumes it ($out/$name.h5)" >&2
fi
# 1: some tasks failed, which the report says too.
if [ "$code" -gt 1 ] || [ ! -e "$out/$name.h5" ]; then exit "$code"; fi
"$hysteron" report "$out/$name.h5" --to "$out/$name"
exit "$code"
