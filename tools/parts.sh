# shellcheck shell=bash
# Sourced by tools/setup.sh: parts of an installation, side by side in the background, waited for with
# words. Each has its log, .setup/NAME.log, whose end tells its time and that of the processor.
# What sources this has say() and log; TELL_EVERY is the longest silence in s.

mkdir -p .setup
TELL_EVERY=${TELL_EVERY:-10}
TIMEFORMAT="%R s, %U + %S s of the processor"
declare -A pid text since code
under_way=()
# part NAME TEXT COMMAND…: begin it
part() {
    local name=$1
    text[$name]=$2 since[$name]=$SECONDS
    shift 2
    set -m # a process group of its own, which can be ended whole
    { time "$@"; } >".setup/$name.log" 2>&1 </dev/null &
    set +m
    pid[$name]=$!
    under_way+=("$name")
}
# finish NAME: wait for it; its exit code. A line for every part that ends meanwhile, and every
# TELL_EVERY seconds one with what is under way.
finish() {
    local name still words last=$SECONDS
    while :; do
        still=() words=''
        for name in "${under_way[@]}"; do
            words="${text[$name]}: $((SECONDS - since[$name])) s"
            if kill -0 "${pid[$name]}" 2>/dev/null; then
                still+=("$name")
                continue
            fi
            code[$name]=0
            wait "${pid[$name]}" || code[$name]=$?
            if [ "${code[$name]}" != 0 ]; then words+=", failed"; fi
            cat ".setup/$name.log" >>"$log"
            say "$words"
        done
        under_way=("${still[@]}")
        if [ -n "${code[$1]:-}" ]; then return "${code[$1]}"; fi
        if ((SECONDS - last >= TELL_EVERY)); then
            last=$SECONDS words=''
            for name in "${under_way[@]}"; do
                words+="${words:+; }${text[$name]} ($((SECONDS - since[$name])) s)"
            done
            say "at $SECONDS s: $words"
        fi
        sleep 0.1
    done
}
# step NAME TEXT COMMAND…: a part that is waited for at once
step() { part "$@" && finish "$1"; }
# must NAME TEXT COMMAND…: a step whose log is shown, and which ends all, where it fails
must() {
    step "$@" || {
        cat ".setup/$1.log" >&2
        exit 1
    }
}
# end_parts: end what is still under way, with all that it started
end_parts() {
    local name
    for name in "${under_way[@]}"; do kill -- "-${pid[$name]}" 2>/dev/null || true; done
}
