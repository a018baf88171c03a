#!/usr/bin/env bash
# Runs a campaign on the cores of this machine and reports on it.
#
#   jobs/local.sh CAMPAIGN.toml [RANKS]
#
# Results: out/NAME.h5, tables and figures: out/NAME/ (NAME from CAMPAIGN.toml), both below the
# working directory; OUT=DIR puts them elsewhere. A results file of an earlier run is resumed.
# RANKS: one more than the cores that this process may use, since the rank that hands out only
# waits. MPIRUN=PATH chooses the launcher. Exit codes are those of adhesis run; 75: stopped early,
# run it again to resume.
set -euo pipefail

here=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
campaign=${1:?which campaign? usage: jobs/local.sh CAMPAIGN.toml [RANKS]}
# nproc goes by OMP_NUM_THREADS, which says nothing of ranks
ranks=${2:-$(($(env -u OMP_NUM_THREADS nproc 2>/dev/null || getconf _NPROCESSORS_ONLN) + 1))}
name=$(basename "$campaign" .toml)
out=${OUT:-out}

if [ -x "$here/.venv/bin/adhesis" ]; then
    adhesis=$here/.venv/bin/adhesis
elif ! adhesis=$(command -v adhesis); then
    echo "jobs/local.sh: adhesis is not installed: run make run, or tools/setup.sh" >&2
    exit 1
fi
mkdir -p "$out"

# A shell that waits for a command in the foreground keeps signals to itself until that has ended;
# so the run goes to the background, and is told to stop in order.
run='' signalled=''
# shellcheck disable=SC2317
stop() {
    signalled=yes
    if [ -n "$run" ]; then kill -s USR1 "$run" 2>/dev/null || true; fi
}
trap stop USR1 TERM INT HUP
"$adhesis" run "$campaign" --out "$out/$name.h5" --ranks "$ranks" </dev/null &
run=$!
while :; do
    signalled='' code=0
    wait "$run" || code=$?
    # A signal ends the wait, but not the run.
    if [ -z "$signalled" ]; then break; fi
done
trap - USR1 TERM INT HUP
if [ "$code" = 75 ]; then
    echo "jobs/local.sh: stopped early; the same command resumes it ($out/$name.h5)" >&2
fi
# 1: some tasks failed, which the report says too.
if [ "$code" -gt 1 ] || [ ! -e "$out/$name.h5" ]; then exit "$code"; fi
"$adhesis" report "$out/$name.h5" --to "$out/$name"
exit "$code"
