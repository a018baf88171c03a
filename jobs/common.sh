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

# read_arguments CAMPAIGN.toml [FILE.h5] [OPTION…]: sets campaign, name, file, part, patience
# and options
read_arguments() {
    campaign=$(path_of "$1") name=$(basename -- "$1" .toml) file='' part='' patience=10
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
            --patience) patience=${2:-} ;;
            --patience=*) patience=${1#*=} ;;
            --out | --out=*)
                echo "--out is not an option of this script: give FILE.h5 after CAMPAIGN.toml" >&2
                exit 2
                ;;
        esac
        shift
    done
    file=$(path_of "${file:-$name${part:+.${part/\//-of-}}.h5}")
    if [[ ! $patience =~ ^[0-9]+(\.[0-9]+)?$ ]]; then patience=10; fi # the run reports it
}

# path_of NAME: the same file, by a name that is no option
path_of() { case $1 in -*) printf %s "./$1" ;; *) printf %s "$1" ;; esac; }

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
    export OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 MKL_NUM_THREADS=1
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

# Staging. One job at a time holds FILE.h5.staging: with STAGING from before it copies FILE.h5 to its
# folder there until after it has copied it back, without it while it runs, as its FILE.h5 must not be
# replaced. The launcher inherits the lock, which lasts as long as either of them. A file is copied
# back only when nobody writes to it, and removed only after that.

# stage_in: sets results to where the run writes: the results file, or its copy below $STAGING
stage_in() {
    results=$file
    if ! target=$(readlink -f "$file") || [ -z "$target" ]; then
        if [ -z "${STAGING:-}" ]; then return 0; fi # the run itself says so
        refuse 2 "$file cannot be written: there is no folder $(dirname "$file")"
    fi
    hold "$target.staging"
    if [ -z "${STAGING:-}" ]; then return 0; fi
    if [ -e "$target" ] && [ ! -f "$target" ]; then refuse 2 "$file is no ordinary file"; fi
    if is_written "$target"; then
        refuse 2 "$file is being written by another run: wait until it has ended"
    fi
    stage=$STAGING/adhesis-$(id -u)-$(printf %s "$target" | cksum | cut -d ' ' -f 1)
    own_folder
    results=$stage/$(basename "$file") found=yes
    if [ ! -e "$results" ]; then
        found=''
        if ! version >"$stage/version"; then refuse 74 "$stage/version could not be written"; fi
        if [ -e "$target" ] && ! copy "$target" "$results"; then
            refuse 74 "$file could not be copied to $results"
        fi
    elif is_changed; then # left by a job that was killed
        if ! cmp -s "$results" "$target"; then
            refuse 2 "$results holds results that were not copied back, and $file has changed since:" \
                "join them (adhesis merge $results --out $file) and remove $stage"
        fi
        # only of equal files: a job that is killed here leaves it empty
        if ! version >"$stage/version"; then refuse 74 "$stage/version could not be written"; fi
    fi
}

# stage_out: copies the results back whole; if that fails they stay where they are, and code is 74
stage_out() {
    if [ -z "${STAGING:-}" ]; then
        release
        return 0
    fi
    if [ "$code" = 2 ] && [ -n "$found" ]; then
        note "the run did nothing; $results stays as it was" # ranks of an earlier job may write to it
    elif is_written "$results"; then
        note "$results is being written by another run: it stays where it is"
        code=74
    elif [ ! -e "$results" ] || put_back; then
        rm -f "$results" "$results".{copy,part,lock} "$stage/version"
        rmdir "$stage" 2>/dev/null || true # another campaign may have a name of the same checksum
    else
        code=74
    fi
    release
}

# put_back: replaces the results file by its copy, unless somebody else has changed it
put_back() {
    if cmp -s "$results" "$target"; then return 0; fi
    if ! copy_beside "$results" "$target"; then
        note "$results could not be copied back to $file: it stays where it is"
    elif is_changed || is_written "$target"; then
        note "$file was changed by somebody else; the results of this job stay in $results"
    elif mv -fT "$target.copy" "$target"; then
        return 0
    fi
    rm -f "$target.copy"
    return 1
}

# refuse CODE TEXT…: ends the job before it has begun
refuse() {
    echo "${*:2}" >&2
    release
    exit "$1"
}

# hold LOCK: takes the lock of this job, for which it waits as long as the run would (--patience).
# Without STAGING the job goes on where there are no such locks, and so can be no job that has it.
hold() {
    local refused
    lock=$1
    while :; do
        if [ -L "$lock" ] || { [ -e "$lock" ] && [ ! -f "$lock" ]; }; then
            refuse 2 "$lock is a link or no ordinary file, and not the lock of a job: remove it"
        fi
        if ! { exec {held}<>"$lock"; } 2>/dev/null; then
            held=''
            if [ -z "${STAGING:-}" ]; then return 0; fi
            refuse 74 "$lock cannot be written"
        fi
        refused=0
        flock -w "${patience:-10}" -E 99 "$held" || refused=$?
        # its last holder may just have removed the file
        if [ "$refused" = 0 ] && [ "$lock" -ef "/dev/fd/$held" ]; then return 0; fi
        exec {held}>&-
        held=''
        case $refused in
            0) ;;
            99) refuse 2 "$file is held by another job ($lock): wait until it has ended" ;;
            *)
                if [ -z "${STAGING:-}" ]; then
                    rm -f "$lock"
                    return 0
                fi
                refuse 2 "STAGING needs the command flock, and locks of files where $file is: leave it out"
                ;;
        esac
    done
}

# release: lets go of the lock, if it is held
release() {
    if [ -z "${held:-}" ]; then return 0; fi
    rm -f "$lock"
    exec {held}>&-
    held=''
}

# own_folder: makes the folder $stage, or accepts it, if nobody else can write there
own_folder() {
    local problem=''
    mkdir -p "$STAGING" && mkdir -m 700 "$stage" 2>/dev/null
    if [ ! -d "$stage" ] && [ ! -L "$stage" ]; then refuse 74 "the folder $stage cannot be made"; fi
    if [ -L "$stage" ]; then
        problem="$stage is a link"
    elif [ ! -O "$stage" ]; then
        problem="$stage belongs to $(stat -c %U "$stage")"
    elif [ $((8#$(stat -c %a "$stage") & 8#022)) != 0 ]; then
        problem="others can write to $stage"
    elif [ $((8#$(stat -Lc %a "$STAGING") & 8#1002)) = 2 ]; then
        problem="others can replace the folders in $STAGING, which all can write to and which is not sticky"
    else
        return 0
    fi
    refuse 2 "$problem: remove it, or set STAGING to a folder where nobody else can write"
}

version() { stat -c '%.Y %s %i' "$target" 2>/dev/null || echo none; }

# is_changed: whether the results file is another one than when it was copied
is_changed() { [ "$(version)" != "$(cat "$stage/version" 2>/dev/null)" ]; }

# is_written FILE: whether a run writes to a results file now
is_written() { [ -e "$1" ] && "$ADHESIS" status "$1" --json 2>/dev/null | grep '^ "run": {' >/dev/null; }

# copy FROM TO: whole or not at all
copy() { copy_beside "$1" "$2" && mv -fT "$2.copy" "$2"; }

# copy_beside FROM TO: to TO.copy, on disk and equal; a link of that name is removed, not followed
copy_beside() {
    if cp --remove-destination "$1" "$2.copy" && sync "$2.copy" && cmp -s "$1" "$2.copy"; then return 0; fi
    rm -f "$2.copy"
    return 1
}

# run_campaign [OPTION…]: runs the campaign under the launcher, on staged results; sets code
# shellcheck disable=SC2120
run_campaign() {
    stage_in
    follow "${launcher[@]}" "$ADHESIS" run "$campaign" --out "$results" "$@" ${options[@]+"${options[@]}"}
    note "adhesis run ended with $code"
    stage_out
    if [ "$code" = 74 ]; then
        note "results could not be written: this job does not come back; make space, and submit it again"
    fi
    # srun ends with 0 although it could not start a single rank.
    if [ "$code" = 0 ] && ! is_complete; then
        note "tasks of $file are pending although the launcher (${launcher[0]}) ended with 0: did it start the ranks?"
        code=1
    fi
}
