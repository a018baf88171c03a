#!/usr/bin/env bash
# Writes the report of a campaign, on one core, after joining the results of its parts if it has any.
#
#   jobs/report.sh FILE.h5 [DIR [PARTS]]
#
# DIR: where the report goes (default: FILE). PARTS=20 joins FILE.1-of-20.h5, FILE.2-of-20.h5 … into
# FILE.h5 before. Exit code 75: tasks are pending, so that there is no report yet.
set -u
jobs=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
# shellcheck source=jobs/common.sh
. "$jobs/common.sh"
file=$(path_of "${1:?which results? usage: jobs/report.sh FILE.h5 [DIR [PARTS]]}")
folder=$(path_of "${2:-${file%.h5}}")
find_adhesis "$jobs/.."
if [ -n "${3:-}" ]; then
    files=()
    for ((k = 1; k <= $3; k++)); do
        if [ -e "${file%.h5}.$k-of-$3.h5" ]; then files+=("${file%.h5}.$k-of-$3.h5"); fi
    done
    if [ ${#files[@]} = 0 ]; then
        echo "there are no results of parts: ${file%.h5}.1-of-$3.h5 and so on" >&2
        exit 2
    fi
    "$ADHESIS" merge "${files[@]}" --out "$file" || exit
fi
if ! is_complete; then
    note "tasks of $file are pending: no report (adhesis status $file lists them)"
    exit 75
fi
exec "$ADHESIS" report "$file" --to "$folder"
