#!/usr/bin/env bash
# A campaign as a Slurm job array, a part of the tasks each, and a job that joins and reports them.
#
#   jobs/parts.sh PARTS [OPTION OF SBATCH…] CAMPAIGN.toml [FILE.h5] [OPTION OF ADHESIS RUN…]
#
# For example, on up to 20 single cores: jobs/parts.sh 20 --time=12:00:00 my.toml
#
# Options of sbatch in the form --name=value, without --array. Part K writes FILE.K-of-PARTS.h5; once all jobs of
# the array have ended, whether done, failed or cancelled, what there is of them is joined into FILE.h5 (default:
# NAME.h5), and the report is written if no task is left. Each job is that of jobs/slurm.sh.
set -eu
jobs=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
# shellcheck source=jobs/common.sh
. "$jobs/common.sh"
usage="usage: jobs/parts.sh PARTS [OPTION OF SBATCH…] CAMPAIGN.toml [FILE.h5] [OPTION OF ADHESIS RUN…]"
parts=${1:-}
case $parts in
    '' | 0* | *[!0-9]*)
        echo "PARTS is '$parts': it must be a positive whole number; $usage" >&2
        exit 2
        ;;
esac
shift
batch=()
while [ "${1:-}" != "${1#-}" ]; do
    batch+=("$1")
    shift
done
: "${1:?which campaign? $usage}"
read_arguments "$@"
array=$(sbatch --parsable --output=%x-%A_%a.log ${batch[@]+"${batch[@]}"} --array="1-$parts" \
    "$jobs/slurm.sh" "$campaign" "${file%.h5}.%a-of-$parts.h5" --part "%a/$parts" ${options[@]+"${options[@]}"})
array=${array%%;*}
merge=$(script_of "$jobs/report.sh" "$file" "$name" "$parts" |
    sbatch --parsable --job-name=adhesis-merge --output=%x-%j.log ${batch[@]+"${batch[@]}"} \
        --dependency="afterany:$array" --nodes=1 --ntasks=1 --ntasks-per-node=1 --cpus-per-task=1)
echo "parts: job array $array; joined and reported by job ${merge%%;*}"
