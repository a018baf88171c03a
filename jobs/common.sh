# shellcheck shell=bash
# Sourced by the other scripts of this folder: what a job does whatever the batch system.
#
# Variables that the caller may set, all optional: ADHESIS, LAUNCHER, STAGING (docs/clusters.md).

note() { echo "$(date '+%F %T') $*"; }

# find_adhesis FOLDER: sets ADHESIS to its path: as given, else in .venv of FOLDER, else in PATH
find_adhesis() {
    if [ -n "${ADHESIS:-}" ]; then return 0; fi
    ADHESIS=$1/.venv/bin/adhesis
    if [ ! -x "$ADHESIS" ] && ! ADHESIS=$(command -v adhesis); then
        echo "adhesis is neither in $1/.venv nor in PATH: set ADHESIS to its path, or run tools/setup.sh" >&2
        exit 1
    fi
}

# read_arguments CAMPAIGN.toml [FILE.h5] [OPTION…]: sets campaign, name, file, part and options
read_arguments() {
    campaign=$1 name=$(basename "$1" .toml) file='' part=''
    shift
    if [ $# -gt 0 ] && [ "${1#-}" = "$1" ]; then
        file=$1
        shift
    fi
    options=("$@")
    while [ $# -gt 0 ]; do
        case $1 in
            --part) part=${2:-} ;;
            --part=*) part=${1#*=} ;;
            --out | --out=*)
                echo "--out is not an option of this script: give FILE.h5 after CAMPAIGN.toml" >&2
                exit 2
                ;;
        esac
        shift
    done
    file=${file:-$name${part:+.${part/\//-of-}}.h5}
}

# omit_redo: for a job that was restarted. Its first start has marked the tasks that --redo selects
# as pending in the results file; marking them again would compute them anew at each restart.
omit_redo() {
    set -- ${options[@]+"${options[@]}"}
    options=()
    while [ $# -gt 0 ]; do
        case $1 in
            --redo | --hurst | --work-of-adhesion | --realisation) shift ;; # its value follows
            --redo=* | --hurst=* | --work-of-adhesion=* | --realisation=*) ;;
            *) options+=("$1") ;;
        esac
        shift
    done
}

# choose_launcher WORDS…: sets launcher: $LAUNCHER, else mpirun with these words, else srun -n N
choose_launcher() {
    local mpirun
    mpirun=$(cat "$(dirname "$ADHESIS")/../mpirun" 2>/dev/null) # set-up recorded which one fits
    if [ -n "${LAUNCHER:-}" ]; then
        read -ra launcher <<<"$LAUNCHER"
    elif command -v "${mpirun:=mpirun}" >/dev/null; then
        launcher=("$mpirun" "$@")
    else
        launcher=(srun "${@:1:2}")
    fi
    # One thread a rank: the ranks share the cores among themselves.
    export OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 MKL_NUM_THREADS=1 NUMBA_NUM_THREADS=1
}

# follow COMMAND…: runs it and sets code. USR1, TERM, INT and HUP stop it in order, by USR1, which
# mpirun and srun pass on to all ranks; terminated is set if one of them was not USR1. A shell
# handles signals only between commands or in `wait`, so the command runs in the background.
follow() {
    local number
    run='' terminated='' signalled=''
    for number in USR1 TERM INT HUP; do
        # shellcheck disable=SC2064
        trap "pass_on $number" "$number"
    done
    "$@" </dev/null &
    run=$!
    if [ -n "$signalled" ]; then kill -s USR1 "$run" 2>/dev/null || true; fi # it came before run was set
    while :; do
        signalled='' code=0
        wait "$run" || code=$?
        if [ -z "$signalled" ]; then break; fi # a signal ends the wait, but not the command
    done
}
# shellcheck disable=SC2317,SC2034
pass_on() {
    signalled=yes
    note "$1 received"
    if [ "$1" != USR1 ]; then terminated=yes; fi
    if [ -n "$run" ]; then kill -s USR1 "$run" 2>/dev/null || true; fi
}

# is_cut_short: whether the same command, run again, goes on where this one ended
is_cut_short() {
    case $code in
        75) ;;                    # stopped in order, by a signal or at the walltime
        135 | 137 | 138 | 139) ;; # a rank was ended by signal 7, 9, 10 or 11 …
        7 | 9 | 10 | 11 | 15 | 255) ;; # … as MPICH reports it, codes of several ranks by their bits
        205) ;;                   # Open MPI has lost a node
        *) return 1 ;;
    esac
}

# is_complete: whether the results file has no pending task
is_complete() { "$ADHESIS" status "$file" --json | grep '^ "pending": 0,' >/dev/null; }

# is_report_due: whether all that the job computes is done or failed. 0 says so, of which
# run_campaign has made sure; 1 also comes from a launcher that was ended, and after --max-failures,
# so the file is asked. A part is reported on with all others.
is_report_due() { [ -z "$part" ] && { [ "$code" = 0 ] || { [ "$code" = 1 ] && is_complete; }; }; }

# script_of COMMAND…: a job script that runs a command in this folder
script_of() {
    printf '#!/bin/bash\ncd %q && exec' "$PWD"
    printf ' %q' "$@"
    echo
}

# stage_in: sets results to where the run writes: the results file, or its copy below $STAGING
stage_in() {
    results=$file
    if [ -z "${STAGING:-}" ]; then return 0; fi
    target=$(readlink -f "$file")
    stage=$STAGING/adhesis-$(id -u)-$(printf %s "$target" | cksum | cut -d ' ' -f 1)
    results=$stage/$(basename "$file")
    if ! mkdir -p "$stage"; then exit 74; fi
    if [ ! -e "$results" ]; then
        version >"$stage/version"
        if [ -e "$target" ] && ! { cp "$target" "$results.part" && mv "$results.part" "$results"; }; then
            echo "$file could not be copied to $results" >&2
            exit 74
        fi
    elif [ "$(version)" != "$(cat "$stage/version")" ]; then # left by a job that was killed
        echo "$results holds results that were not copied back, and $file has changed since:" \
            "join them (adhesis merge $results --out $file) and remove $stage" >&2
        exit 2
    fi
}
version() { stat -c '%Y %s %i' "$target" 2>/dev/null || echo none; }

# stage_out: copies the results back whole; if that fails they stay where they are, and code is 74
stage_out() {
    if [ -z "${STAGING:-}" ] || [ ! -e "$results" ]; then return 0; fi
    if [ "$(version)" != "$(cat "$stage/version")" ]; then
        note "$file was changed by somebody else; the results of this job stay in $results"
    elif cp "$results" "$target.part" && mv "$target.part" "$target"; then
        rm -rf "$stage"
        return 0
    else
        note "$results could not be copied back to $file: it stays where it is"
    fi
    code=74
}

# run_campaign [OPTION…]: runs the campaign under the launcher, on staged results; sets code
# shellcheck disable=SC2120
run_campaign() {
    stage_in
    follow "${launcher[@]}" "$ADHESIS" run "$campaign" --out "$results" "$@" ${options[@]+"${options[@]}"}
    note "adhesis run ended with $code"
    stage_out
    # srun ends with 0 although it could not start a single rank.
    if [ "$code" = 0 ] && ! is_complete; then
        note "tasks of $file are pending although the launcher (${launcher[0]}) ended with 0: did it start the ranks?"
        code=1
    fi
}
