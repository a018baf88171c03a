#!/usr/bin/env bash
# A campaign as a PBS job (OpenPBS, PBS Pro, Torque) that submits its own continuation until the
# campaign is finished.
#
#   qsub -l select=2:ncpus=32:mpiprocs=32 -l walltime=12:00:00 -v CAMPAIGN=my.toml jobs/pbs.sh
#
# Submit it from the folder that holds the results ($FILE, default: NAME.h5 there); the report goes
# to NAME/ beside it when all tasks are done. Further variables for -v, where the defaults do not
# fit: ADHESIS=path of the adhesis command (default: .venv of the submit folder, then PATH),
# LAUNCHER="mpiexec" (default: mpirun on all slots of the job), SCRIPT=path of this file (default:
# jobs/pbs.sh), MAX_RESTARTS=50.
#
# PBS sends no signal ahead of the time limit, so the run is told how much time it has. It stops
# two minutes before, closes the file and exits with 75, and the job is submitted again. A job that
# is deleted (qdel) is not.
#
#PBS -N adhesis
#PBS -l select=1:ncpus=32:mpiprocs=32
#PBS -l walltime=24:00:00
#PBS -j oe
#PBS -r y

set -u
started=$SECONDS
cd "$PBS_O_WORKDIR" || exit 1

# The modules that tools/setup.sh was run with, for example:
#   module load gcc openmpi hdf5-parallel python

campaign=${CAMPAIGN:?which campaign? usage: qsub -v CAMPAIGN=my.toml jobs/pbs.sh}
name=$(basename "$campaign" .toml)
file=${FILE:-$name.h5}
restarts=${RESTARTS:-0}
limit=${MAX_RESTARTS:-50}

if [ -z "${ADHESIS:-}" ]; then
    ADHESIS=$PBS_O_WORKDIR/.venv/bin/adhesis
    if [ ! -x "$ADHESIS" ]; then ADHESIS=$(command -v adhesis); fi
fi
slots=$(wc -l <"$PBS_NODEFILE")
if [ -z "${LAUNCHER:-}" ]; then
    mpirun=$(dirname "$ADHESIS")/../mpirun # set-up wrote down which one fits
    if [ -s "$mpirun" ]; then mpirun=$(cat "$mpirun"); else mpirun=mpirun; fi
    LAUNCHER="$mpirun -n $((slots)) -machinefile $PBS_NODEFILE"
fi
# One thread a rank: the ranks share the cores among themselves.
export OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 MKL_NUM_THREADS=1 NUMBA_NUM_THREADS=1

# What is left of the walltime (hours:minutes:seconds), less two minutes.
seconds() { awk -F: '{ s = 0; for (i = 1; i <= NF; i++) s = 60 * s + $i; print s }'; }
job() { qstat -f "$PBS_JOBID" | sed -n "s/^ *$1 = //p" | head -n 1; }
total=$(job Resource_List.walltime | seconds)
used=$(job resources_used.walltime | seconds)
walltime=()
if [ -n "$total" ]; then
    left=$((total - ${used:-0} - (SECONDS - started) - 120))
    if [ "$left" -lt 60 ]; then left=60; fi
    walltime=(--walltime "$left")
fi

cancelled=''
trap 'cancelled=yes; kill -s TERM "$run" 2>/dev/null' TERM
echo "$(date '+%F %T') job $PBS_JOBID, $((slots)) ranks, start $((restarts + 1)), ${left:-no} s to go"
run=
$LAUNCHER "$ADHESIS" run "$campaign" --out "$file" ${walltime[@]+"${walltime[@]}"} &
run=$!
while :; do
    before=$cancelled
    wait "$run"
    code=$?
    # A signal ends the wait, but not the run.
    if [ "$cancelled" = "$before" ]; then break; fi
done
echo "$(date '+%F %T') adhesis run ended with $code"

if [ "$code" = 75 ] && [ -z "$cancelled" ]; then
    if [ "$restarts" -ge "$limit" ]; then
        echo "started $((restarts + 1)) times: not submitted again; qsub it again to resume"
    else
        # With the resources of this job, and not with those at the top of this file.
        options=()
        for resource in select nodes place walltime; do
            value=$(job "Resource_List.$resource")
            # PBS Pro reports nodes as a number beside select, and takes only one of the two.
            if [ "$resource" = nodes ] && [ ${#options[@]} -gt 0 ]; then continue; fi
            if [ -n "$value" ]; then options+=(-l "$resource=$value"); fi
        done
        variables=CAMPAIGN=$campaign,FILE=$file,ADHESIS=$ADHESIS,RESTARTS=$((restarts + 1))
        variables+=,MAX_RESTARTS=$limit,SCRIPT=${SCRIPT:-jobs/pbs.sh}
        qsub ${options[@]+"${options[@]}"} -v "$variables" "${SCRIPT:-jobs/pbs.sh}" ||
            echo "could not be submitted; qsub it again to resume"
    fi
elif [ "$code" -le 1 ] && [ -e "$file" ]; then # 1: some tasks failed, which the report says too
    "$ADHESIS" report "$file" --to "$name" || code=$?
fi
exit "$code"
