#!/usr/bin/env bash
# A campaign as a Slurm job that comes back by itself until the campaign is finished.
#
#   sbatch --ntasks=64 --time=12:00:00 jobs/slurm.sh CAMPAIGN.toml [FILE.h5]
#
# Submit it from the folder that holds the results (FILE.h5, default: NAME.h5 there); the report
# goes to NAME/ beside it when all tasks are done. Set before submitting, where the defaults do not
# fit: ADHESIS=path of the adhesis command (default: .venv of the submit folder, then PATH),
# LAUNCHER="srun --mpi=pmix" (default: mpirun if there is one, then srun), MAX_RESTARTS=50. One of
# the tasks hands out and waits, the others compute.
#
# Two minutes before the time limit Slurm signals this script, which passes it on: the run stops
# handing out, closes the file and exits with 75, and the job is put back into the queue. A job
# that is cancelled is not. After the loss of a node Slurm itself requeues it (--requeue).
#
#SBATCH --job-name=adhesis
#SBATCH --ntasks=2
#SBATCH --cpus-per-task=1
#SBATCH --time=24:00:00
#SBATCH --signal=B:USR1@120
#SBATCH --requeue
#SBATCH --open-mode=append
#SBATCH --output=%x-%j.log
#
# Where the cluster wants them:
##SBATCH --account=…
##SBATCH --partition=…
##SBATCH --mem-per-cpu=1G

set -u

# The modules that tools/setup.sh was run with, for example:
#   module load gcc openmpi hdf5-parallel python

campaign=${1:?which campaign? usage: sbatch jobs/slurm.sh CAMPAIGN.toml [FILE.h5]}
name=$(basename "$campaign" .toml)
file=${2:-$name.h5}
restarts=${SLURM_RESTART_COUNT:-0}

if [ -z "${ADHESIS:-}" ]; then
    ADHESIS=$SLURM_SUBMIT_DIR/.venv/bin/adhesis
    if [ ! -x "$ADHESIS" ]; then ADHESIS=$(command -v adhesis); fi
fi
if [ -z "${LAUNCHER:-}" ]; then
    mpirun=$(dirname "$ADHESIS")/../mpirun # set-up wrote down which one fits
    if [ -s "$mpirun" ]; then mpirun=$(cat "$mpirun"); else mpirun=mpirun; fi
    LAUNCHER=srun
    if command -v "$mpirun" >/dev/null; then LAUNCHER="$mpirun -n $SLURM_NTASKS"; fi
fi
# One thread a rank: the ranks share the cores among themselves.
export OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 MKL_NUM_THREADS=1 NUMBA_NUM_THREADS=1

# A signal reaches the run only if somebody passes it on: mpirun and srun do, to all ranks, and
# they get it from here. That is why they run in the background.
signalled='' cancelled=''
# shellcheck disable=SC2317
pass_on() {
    signalled=yes
    echo "$(date '+%F %T') $1 received"
    if [ "$1" = TERM ]; then cancelled=yes; fi
    kill -s "$1" "$run" 2>/dev/null
}
run=
trap 'pass_on USR1' USR1
trap 'pass_on TERM' TERM

echo "$(date '+%F %T') job $SLURM_JOB_ID on $SLURM_JOB_NODELIST, $SLURM_NTASKS ranks, start $((restarts + 1))"
$LAUNCHER "$ADHESIS" run "$campaign" --out "$file" &
run=$!
while :; do
    signalled=
    wait "$run"
    code=$?
    # A signal ends the wait, but not the run.
    if [ -z "$signalled" ]; then break; fi
done
echo "$(date '+%F %T') adhesis run ended with $code"

if [ "$code" = 75 ] && [ -z "$cancelled" ]; then
    if [ "$restarts" -ge "${MAX_RESTARTS:-50}" ]; then
        echo "started $((restarts + 1)) times: not requeued again; sbatch it again to resume"
    else
        scontrol requeue "$SLURM_JOB_ID" || echo "could not be requeued; sbatch it again to resume"
    fi
elif [ "$code" -le 1 ] && [ -e "$file" ]; then # 1: some tasks failed, which the report says too
    "$ADHESIS" report "$file" --to "$name" || code=$?
fi
exit "$code"
