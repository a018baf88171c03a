#!/usr/bin/env bash
# A campaign as a Slurm job that is requeued until the campaign is finished.
#
#   sbatch --ntasks=64 --time=12:00:00 jobs/slurm.sh CAMPAIGN.toml [FILE.h5] [OPTION…]
#
# Submit it from the folder that holds the results (FILE.h5, default: NAME.h5 there). OPTIONs are
# those of adhesis run, as --redo failed or --max-failures 0. As many ranks are started as the job
# has tasks; one of them hands out and waits, the others compute. With none of --ntasks,
# --ntasks-per-node and --nodes one process computes alone.
#
# Two minutes before the time limit Slurm signals this script, which passes it on: the run stops
# handing out, closes the file and exits with 75, and the job is put back into the queue; so it is
# when a rank was killed or a node lost, at most MAX_RESTARTS=50 times in all. A job that is
# cancelled is not. When all tasks are done or failed a job of its own, on one core, writes the
# report to NAME/.
#
# In a job array %a in an argument stands for the number of the job (jobs/parts.sh makes one):
#
#   sbatch --array=1-20 jobs/slurm.sh CAMPAIGN.toml --part %a/20
#
# Variables to set before submitting, where the defaults do not fit: docs/clusters.md.
#
#SBATCH --job-name=adhesis
#SBATCH --cpus-per-task=1
#SBATCH --hint=nomultithread
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

# The modules that tools/setup.sh was run with, and other settings of the cluster, for example:
#   module load gcc openmpi hdf5-parallel python
#   STAGING=$TMPDIR

set -u
# Slurm runs a copy of this file; the others of its folder lie beside the original.
if [ ! -e "${JOBS:-}/common.sh" ]; then # a JOBS that means something else is common, too
    command=$(scontrol show job "$SLURM_JOB_ID" | sed -n 's/^ *Command=//p' | head -n 1)
    if [ $# -gt 0 ]; then command=${command%" $*"}; fi
    JOBS=$(cd "$SLURM_SUBMIT_DIR" && cd "$(dirname "$command")" && pwd)
fi
# shellcheck source=jobs/common.sh
if ! . "$JOBS/common.sh"; then
    echo "there is no common.sh in $JOBS: set JOBS to the folder jobs of the clone" >&2
    exit 2
fi
# `sbatch --export=…` restricts what srun, and mpirun by srun, hand to the ranks.
export SLURM_EXPORT_ENV=ALL

: "${1:?which campaign? usage: sbatch jobs/slurm.sh CAMPAIGN.toml [FILE.h5] [OPTION…]}"
if [ -n "${SLURM_ARRAY_TASK_ID:-}" ]; then set -- "${@//%a/$SLURM_ARRAY_TASK_ID}"; fi
read_arguments "$@"
restarts=${SLURM_RESTART_COUNT:-0}
if [ "$restarts" -gt 0 ]; then omit_redo; fi
find_adhesis "$SLURM_SUBMIT_DIR"

# Without --ntasks Slurm gives the tasks of each node alone, as 4 or 4(x2),3.
tasks_of_nodes() { tr , '\n' <<<"${SLURM_TASKS_PER_NODE:-1}" | awk -F '[(x)]+' '{ n += $1 * ($2 ? $2 : 1) } END { print n }'; }
ranks=${SLURM_NTASKS:-$(tasks_of_nodes)}
choose_launcher -n "$ranks"

note "job $SLURM_JOB_ID on $SLURM_JOB_NODELIST, $ranks ranks on $SLURM_JOB_CPUS_PER_NODE cores, start $((restarts + 1))"
run_campaign

# SIGTERM comes when the job is cancelled, and also ahead of a preemption, of a job that runs still.
state() { scontrol show job "$SLURM_JOB_ID" | sed -n 's/^ *JobState=\([A-Z_]*\).*/\1/p' | head -n 1; }
if [ -n "$terminated" ] && [ "$(state)" != RUNNING ]; then
    note "the job was ended from outside: it is not requeued"
elif is_cut_short; then
    if [ "$restarts" -ge "${MAX_RESTARTS:-50}" ]; then
        note "started $((restarts + 1)) times: not requeued again; sbatch it again to resume"
    else
        scontrol requeue "$SLURM_JOB_ID" || note "could not be requeued; sbatch it again to resume"
    fi
elif is_report_due && [ "${REPORT:-}" != no ]; then
    read -ra more <<<"${REPORT_OPTIONS:-}"
    script_of env ADHESIS="$ADHESIS" "$JOBS/report.sh" "$file" "$name" |
        sbatch --job-name="$SLURM_JOB_NAME-report" --output=%x-%j.log --time=1:00:00 \
            ${SLURM_JOB_ACCOUNT:+"--account=$SLURM_JOB_ACCOUNT"} \
            ${SLURM_JOB_PARTITION:+"--partition=$SLURM_JOB_PARTITION"} \
            ${SLURM_JOB_QOS:+"--qos=$SLURM_JOB_QOS"} \
            --nodes=1 --ntasks=1 --cpus-per-task=1 ${more[@]+"${more[@]}"} ||
        note "the report could not be submitted; it is written by: $ADHESIS report $file --to $name"
fi
exit "$code"
