#!/usr/bin/env bash
# Runs a campaign on the cores of this machine and reports on it.
#
#   jobs/local.sh CAMPAIGN.toml [RANKS [OPTION…]]
#
# Results: out/NAME.h5, tables and figures: out/NAME/ (NAME from CAMPAIGN.toml), both below the
# working directory; OUT=DIR puts them elsewhere. A results file of an earlier run is resumed.
# RANKS: one more than the cores that this process may use, since the rank that hands out only
# waits. OPTIONs are those of adhesis run, as --redo failed. Ranks are started by MPIRUN, by
# default the mpirun that set-up found to work, or without one by adhesis itself. Exit codes are
# those of adhesis run; 75: stopped early, run it again to resume.
set -euo pipefail

here=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
# shellcheck source=jobs/common.sh
. "$here/jobs/common.sh"
campaign=$(path_of "${1:?which campaign? usage: jobs/local.sh CAMPAIGN.toml [RANKS [OPTION…]]}")
# shellcheck source=tools/mpi.sh
. "$here/tools/mpi.sh"
# nproc goes by OMP_NUM_THREADS, which says nothing of ranks
cores=$(env -u OMP_NUM_THREADS nproc 2>/dev/null || getconf _NPROCESSORS_ONLN)
ranks=${2:-$((cores + 1))}
name=$(basename "$campaign" .toml)
out=$(path_of "${OUT:-out}")

find_adhesis "$here"
mkdir -p "$out"
MPIRUN=${MPIRUN:-$(cat "$here/.venv/mpirun" 2>/dev/null || true)}
command=("$ADHESIS" run "$campaign" --out "$out/$name.h5" "${@:3}")
if [ "$ranks" -gt 1 ] 2>/dev/null && [ -n "$MPIRUN" ]; then # adhesis reports what is no number
    allow_ranks "$ranks" "$cores"
    command=("$MPIRUN" -n "$ranks" "${command[@]}")
    set -m # Ctrl-C reaches mpirun through this script alone: it would end the ranks at once
else
    command+=(--ranks "$ranks")
fi
follow "${command[@]}"
trap - USR1 TERM INT HUP
if [ "$code" = 75 ]; then
    echo "jobs/local.sh: stopped early; the same command resumes it ($out/$name.h5)" >&2
fi
# 1: some tasks failed, which the report says too.
if [ "$code" -gt 1 ] || [ ! -e "$out/$name.h5" ]; then exit "$code"; fi
"$ADHESIS" report "$out/$name.h5" --to "$out/$name"
exit "$code"
