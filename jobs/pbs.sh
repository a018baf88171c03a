#!/usr/bin/env bash
# A campaign as a PBS job (OpenPBS, PBS Pro, Torque) that submits its own continuation until the
# campaign is finished.
#
#   qsub -l select=2:ncpus=32:mpiprocs=32 -l walltime=12:00:00 -v CAMPAIGN=my.toml jobs/pbs.sh
#
# Submit it from the folder that holds the results (FILE, default: NAME.h5 there). As many ranks are
# started as the job has slots; one of them hands out and waits, the others compute. Without -l
# select (or nodes) it is what the queue gives.
#
# Variables for -v: CAMPAIGN; FILE; OPTIONS="--max-failures 0", options of adhesis run;
# SCRIPT=path of this file (default: jobs/pbs.sh), beside which are the others of its folder; and
# those of docs/clusters.md.
#
# PBS sends no signal ahead of the time limit, so the run is told how much time it has. It stops
# RESERVE=120 seconds before, closes the file and exits with 75, and the job is submitted again; so
# it is when a rank was killed, at most MAX_RESTARTS=50 times in all. A job that is deleted (qdel) is
# not. When all tasks are done or failed a job of its own, on one core, writes the report to NAME/.
#
#PBS -N adhesis
#PBS -S /bin/bash
#PBS -l walltime=24:00:00
#PBS -j oe
#PBS -r y

# The modules that tools/setup.sh was run with, and other settings of the cluster, for example:
#   module load gcc openmpi hdf5-parallel python
#   STAGING=$TMPDIR

set -u
started=$SECONDS
cd "$PBS_O_WORKDIR" || exit 1
SCRIPT=$(readlink -f "${SCRIPT:-jobs/pbs.sh}")
jobs=$(dirname "$SCRIPT")
# shellcheck source=jobs/common.sh
if ! . "$jobs/common.sh"; then
    echo "there is no common.sh in $jobs: set SCRIPT to the path of this file" >&2
    exit 2
fi

if [ $# = 0 ]; then
    read -ra words <<<"${OPTIONS:-}"
    set -- "${CAMPAIGN:?which campaign? usage: qsub -v CAMPAIGN=my.toml jobs/pbs.sh}" \
        ${FILE:+"$FILE"} ${words[@]+"${words[@]}"}
fi
read_arguments "$@"
restarts=${RESTARTS:-0}
if [ "$restarts" -gt 0 ]; then omit_redo; fi
find_adhesis "$PBS_O_WORKDIR"
slots=$(($(wc -l <"$PBS_NODEFILE")))
choose_launcher -n "$slots" -machinefile "$PBS_NODEFILE"

# attribute NAME: of this job; qstat folds long lines
described=$(qstat -f "$PBS_JOBID" | sed -e ':a' -e 'N;$!ba' -e 's/\n\t//g')
attribute() { sed -n "s/^ *$1 = //p" <<<"$described" | head -n 1; }
# What is left of the walltime (hours:minutes:seconds), less the reserve.
seconds() { awk -F: '{ s = 0; for (i = 1; i <= NF; i++) s = 60 * s + $i; print s }'; }
total=$(attribute Resource_List.walltime | seconds)
used=$(attribute resources_used.walltime | seconds)
walltime=()
if [ -n "$total" ]; then
    left=$((total - ${used:-0} - (SECONDS - started) - ${RESERVE:-120}))
    if [ "$left" -lt 60 ]; then left=60; fi
    walltime=(--walltime "$left")
fi
# one that is given takes its place
case " ${options[*]-} " in *" --walltime"*) walltime=() ;; esac

# submit OPTION…: a job script from stdin, with name, queue, account and project of this job
submit() {
    local project queue account
    project=$(attribute project) queue=${PBS_O_QUEUE:-$(attribute queue)} account=$(attribute Account_Name)
    if [ "$project" = _pbs_project_default ]; then project=''; fi
    qsub -N "$(attribute Job_Name)" -S /bin/bash -j oe ${queue:+-q "$queue"} ${account:+-A "$account"} \
        ${project:+-P "$project"} "$@"
}

note "job $PBS_JOBID, $slots ranks, start $((restarts + 1)), ${left:-no} s to go"
run_campaign ${walltime[@]+"${walltime[@]}"}

select=$(attribute Resource_List.select)
if [ -n "$terminated" ]; then
    note "the job was ended from outside: it is not submitted again"
elif is_cut_short; then
    if [ "$restarts" -ge "${MAX_RESTARTS:-50}" ]; then
        note "started $((restarts + 1)) times: not submitted again; qsub it again to resume"
    else
        # With the resources of this job. PBS Pro reports nodes as a number beside select, and takes
        # only one of the two.
        resources=()
        if [ -n "$select" ]; then chunks=select; else chunks=nodes; fi
        for resource in "$chunks" place walltime; do
            value=$(attribute "Resource_List.$resource")
            if [ -n "$value" ]; then resources+=(-l "$resource=$value"); fi
        done
        settings=("SCRIPT=$SCRIPT" "ADHESIS=$ADHESIS" "RESTARTS=$((restarts + 1))")
        for variable in LAUNCHER MAX_RESTARTS RESERVE STAGING REPORT REPORT_OPTIONS; do
            if [ -n "${!variable:-}" ]; then settings+=("$variable=${!variable}"); fi
        done
        script_of env "${settings[@]}" bash "$SCRIPT" "$campaign" "$file" ${options[@]+"${options[@]}"} |
            submit -r y ${resources[@]+"${resources[@]}"} || note "could not be submitted; qsub it again to resume"
    fi
elif is_report_due && [ "${REPORT:-}" != no ]; then
    read -ra more <<<"${REPORT_OPTIONS:-}"
    if [ -n "$select" ]; then core=select=1:ncpus=1; else core=nodes=1:ppn=1; fi
    script_of env ADHESIS="$ADHESIS" "$jobs/report.sh" "$file" "$name" |
        submit -l "$core" -l walltime=1:00:00 ${more[@]+"${more[@]}"} ||
        note "the report could not be submitted; it is written by: $ADHESIS report $file --to $name"
fi
exit "$code"
