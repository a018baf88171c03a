"""The scripts of jobs/: what they decide, where batch system, launcher and adhesis are stand-ins.

tests/ensemble/test_slurm.py runs the same scripts in a real Slurm.
"""

import json
import re
import subprocess
from dataclasses import dataclass
from pathlib import Path
from textwrap import dedent

import pytest

from tests.support.processes import executable, ran

JOBS = Path(__file__).parents[2] / "jobs"

# Each writes its arguments to the file `calls`. `adhesis run` ends with $CODE, after it has sent
# the signal $SIGNAL to the script, if any, and has received what the script passes on.
STAND_INS = {
    "adhesis": """
        if [ "$1" = run ]; then
            file=$4
            echo "$CODE" >"$file"
            if [ -n "${SIGNAL:-}" ]; then
                trap 'exit $CODE' USR1
                kill -s "$SIGNAL" $PPID
                for _ in $(seq 1000); do sleep 0.02; done
                exit 99
            fi
            exit "$CODE"
        fi
        [ "$1" = status ] && printf '{\\n "tasks": 9,\\n "pending": %s,\\n}\\n' "$PENDING"
        exit 0""",
    # Running as root or with more ranks than cores is for the owner of a cluster to allow.
    "mpirun": """
        batch=${SLURM_JOB_ID:-}${PBS_JOBID:-}
        [ -n "$batch" ] && env | grep "RUN_AS_ROOT\\|OVERSUBSCRIBE" && exit 98
        shift 2; [ "$1" = -machinefile ] && shift 2; exec "$@" """,
    "scontrol": """
        [ "$1" = requeue ] ||
        printf 'JobId=7\\n   JobState=%s Reason=None\\n   Command=%s\\n' "$STATE" "$COMMAND" """,
    "sbatch": 'cat >>"$CALLS.submitted" </dev/stdin; echo "${SBATCH_SAYS:-7}"',
    # -f folds lines that are longer than 78 characters, and goes on after a tab.
    "qstat": 'cat "$QSTAT"',
}
# The options of qsub's manual page that take a value.
QSUB = """
    import getopt, json, os, sys
    options, rest = getopt.getopt(sys.argv[1:], "a:A:c:C:e:hIj:J:k:l:m:M:N:o:p:P:q:r:S:u:v:VW:z")
    script = open(rest[0]).read() if rest else sys.stdin.read()
    with open(os.environ["CALLS"] + ".qsub", "a") as file:
        print(json.dumps({"options": options, "script": script}), file=file)
"""


@dataclass
class Cluster:
    """A folder to submit from, and what was called in it."""

    folder: Path
    env: dict[str, str]

    def run(self, *command: str | Path, **env: str) -> subprocess.CompletedProcess[str]:
        return ran(*command, cwd=self.folder, env=self.env | env, timeout=None)

    def calls(self, program: str) -> list[list[str]]:
        path = self.folder / "calls"
        lines = [line.split("|") for line in path.read_text().splitlines()] if path.exists() else []
        return [words[1:-1] for words in lines if words[0] == program]

    def qsub(self) -> list[dict[str, str]]:
        """The jobs that were submitted to PBS: their options, with several `l`, and `script`."""
        path = self.folder / "calls.qsub"
        jobs = map(json.loads, path.read_text().splitlines()) if path.exists() else ()
        return [
            {
                "l": " ".join(value for name, value in job["options"] if name == "-l"),
                "script": job["script"],
            }
            | {name: value for name, value in job["options"] if name != "-l"}
            for job in jobs
        ]


@pytest.fixture
def cluster(tmp_path: Path) -> Cluster:
    folder = tmp_path / "a study, of two words"
    programs = folder / "bin"
    for name, text in STAND_INS.items():
        log = f'printf \'%s|\' {name} "$@" >>"$CALLS"; echo >>"$CALLS"'
        executable(programs / name, f"#!/bin/bash\n{log}\n{text}\n")
    executable(programs / "qsub", f"#!/usr/bin/env python3\n{dedent(QSUB)}")
    (folder / "nodes").write_text("a\na\nb\nb\n")
    (folder / "qstat").write_text(
        "Job Id: 17.head\n    Job_Name = wide\n    queue = small\n    Account_Name = ab12\n"
        "    project = rough\n    Resource_List.nodect = 2\n    Resource_List.nodes = 2\n"
        "    Resource_List.select = 2:ncpus=2:mpiprocs=2:mem=4gb:cpu_type=a_long_name_of\n"
        "\t_a_processor\n"
        "    Resource_List.walltime = 01:30:00\n    resources_used.walltime = 00:00:30\n"
    )
    env = {
        "PATH": f"{programs}:/usr/bin:/bin",
        "CALLS": str(folder / "calls"),
        "CODE": "0",
        "PENDING": "0",
        "ADHESIS": str(programs / "adhesis"),
    }
    return Cluster(folder, env)


def slurm(
    cluster: Cluster, *arguments: str, **env: str
) -> tuple[subprocess.CompletedProcess[str], str]:
    copy = cluster.folder / "slurm_script"  # Slurm runs a copy
    copy.write_bytes((JOBS / "slurm.sh").read_bytes())
    settings = {
        "SLURM_JOB_ID": "7",
        "SLURM_SUBMIT_DIR": str(cluster.folder),
        "SLURM_JOB_NODELIST": "n[1-2]",
        "SLURM_JOB_CPUS_PER_NODE": "4(x2)",
        "SLURM_JOB_NAME": "wide",
        "SLURM_JOB_PARTITION": "small",
        "STATE": "RUNNING",
        "COMMAND": " ".join([str(JOBS / "slurm.sh"), *arguments]),
    }
    done = cluster.run("bash", copy, *arguments, **(settings | env))
    requeued = ["requeue", "7"] in cluster.calls("scontrol")
    assert not (requeued and cluster.calls("sbatch"))
    return done, "requeue" if requeued else "report" if cluster.calls("sbatch") else "nothing"


@pytest.mark.parametrize(
    ("code", "env", "action"),
    [
        (0, {}, "report"),
        (1, {}, "report"),  # some tasks failed
        (1, {"PENDING": "3"}, "nothing"),  # the launcher was ended, or --max-failures
        (0, {"REPORT": "no"}, "nothing"),
        (0, {"JOBS": "4"}, "report"),  # as make and build systems leave it: it is no folder
        *((code, {}, "requeue") for code in (75, 137, 139, 205, 9, 255)),
        *((code, {}, "nothing") for code in (2, 70, 74, 127, 134)),
        (75, {"SLURM_RESTART_COUNT": "49"}, "requeue"),
        *((code, {"SLURM_RESTART_COUNT": "50"}, "nothing") for code in (75, 137)),
        (205, {"SLURM_RESTART_COUNT": "3", "MAX_RESTARTS": "3"}, "nothing"),
        (75, {"SIGNAL": "USR1"}, "requeue"),
        *((code, {"SIGNAL": "TERM", "STATE": "CANCELLED"}, "nothing") for code in (0, 1, 75, 205)),
        (75, {"SIGNAL": "TERM"}, "requeue"),  # ahead of a preemption
    ],
)
def test_slurm_job_is_requeued_reported_or_left(cluster, code, env, action):
    done, seen = slurm(cluster, "study.toml", CODE=str(code), **env)
    assert (done.returncode, seen) == (code, action), done.stdout + done.stderr
    refused = "results could not be written: this job does not come back" in done.stdout
    assert refused == (code == 74)


def test_launcher_that_ends_with_0_but_starts_no_rank_is_a_failure(cluster: Cluster) -> None:
    done, seen = slurm(cluster, "study.toml", LAUNCHER="true", PENDING="9")
    assert (done.returncode, seen) == (1, "nothing")
    assert "tasks of study.h5 are pending although the launcher (true) ended with 0" in done.stdout


def test_signal_between_the_start_of_a_run_and_its_number_reaches_it(cluster: Cluster) -> None:
    """Bash handles a signal before the next command: here before it has noted the run's number."""
    script = f""". "{JOBS}/common.sh"
        set -T
        late() {{ until [ -e listens ]; do sleep 0.02; done; kill -s TERM $$; }}
        trap '[ "$BASH_COMMAND" != "run=\\$!" ] || late' DEBUG
        follow bash -c "trap 'exit 75' USR1; touch listens; while :; do sleep 0.02; done"
        echo "$code $terminated"
    """
    assert cluster.run("bash", "-c", script).stdout.split()[-2:] == ["75", "yes"]


@pytest.mark.parametrize(
    ("env", "ranks"),
    [
        ({"SLURM_NTASKS": "8", "SLURM_TASKS_PER_NODE": "4(x2)"}, 8),
        ({"SLURM_TASKS_PER_NODE": "4(x2),3"}, 11),
        ({"SLURM_TASKS_PER_NODE": "1"}, 1),
        ({}, 1),
    ],
)
def test_slurm_job_has_the_ranks_that_slurm_gave(cluster, env, ranks):
    slurm(cluster, "study.toml", **env)
    assert [words[:2] for words in cluster.calls("mpirun")] == [["-n", str(ranks)]]
    assert not re.search(r"^#SBATCH --n(odes|tasks)", (JOBS / "slurm.sh").read_text(), re.MULTILINE)


@pytest.mark.parametrize(
    ("arguments", "env", "run"),
    [
        (["s.toml"], {}, "s.toml --out s.h5"),
        (["s.toml", "r.h5"], {}, "s.toml --out r.h5"),
        (
            ["d/s.toml", "--max-failures", "0", "--redo", "failed", "--hurst=0.7"],
            {},
            "d/s.toml --out s.h5 --max-failures 0 --redo failed --hurst=0.7",
        ),
        (  # its tasks were marked by the first start
            ["s.toml", "--redo", "failed", "--hurst=0.7", "--realisation", "2", "--max-failures=0"],
            {"SLURM_RESTART_COUNT": "1"},
            "s.toml --out s.h5 --max-failures=0",
        ),
        (
            ["s.toml", "--part", "%a/20"],
            {"SLURM_ARRAY_TASK_ID": "3"},
            "s.toml --out s.3-of-20.h5 --part 3/20",
        ),
        (
            ["s.toml", "x.%a.h5", "--part=%a/20"],
            {"SLURM_ARRAY_TASK_ID": "3"},
            "s.toml --out x.3.h5 --part=3/20",
        ),
    ],
)
def test_slurm_job_passes_options_on(cluster, arguments, env, run):
    done, action = slurm(cluster, *arguments, **env)
    assert done.returncode == 0, done.stderr
    assert cluster.calls("adhesis")[0] == ["run", *run.split()]
    assert action == ("nothing" if "part" in run else "report")  # a part is reported on with all


def test_names_that_begin_with_a_dash_are_no_options(cluster: Cluster) -> None:
    done, action = slurm(cluster, "-dash.toml")
    assert (done.returncode, action) == (0, "report"), done.stderr
    done = cluster.run("bash", cluster.folder / "calls.submitted")
    assert done.returncode == 0, done.stderr
    assert cluster.calls("adhesis")[-1] == ["report", "./-dash.h5", "--to", "./-dash"]
    done = cluster.run(JOBS / "local.sh", "-dash.toml", "3", OUT="-out", MPIRUN="mpirun")
    assert (done.returncode, done.stderr) == (0, "")
    assert cluster.calls("mpirun")[-1][:2] == ["-n", "3"]
    names = "./-dash.toml --out ./-dash.h5", "./-dash.toml --out ./-out/-dash.h5"
    runs = [words[1:] for words in cluster.calls("adhesis") if words[0] == "run"]
    assert runs == [name.split() for name in names]


@pytest.mark.parametrize("name", ["slurm.sh", "pbs.sh"])
def test_modules_are_loaded_before_unset_variables_are_errors(name: str) -> None:
    """The start-up files of modules use variables that may be unset."""
    text = (JOBS / name).read_text()
    assert 0 < text.index("#   module load") < text.index("\nset -u\n")


def test_slurm_job_takes_no_other_file(cluster: Cluster) -> None:
    done, _ = slurm(cluster, "s.toml", "--out", "r.h5")
    assert done.returncode == 2
    assert "give FILE.h5 after CAMPAIGN.toml" in done.stderr
    assert cluster.calls("adhesis") == []


def test_report_is_a_job_of_its_own_on_one_core(cluster: Cluster) -> None:
    slurm(cluster, "s.toml", "my results.h5", SLURM_JOB_ACCOUNT="ab12")
    (words,) = cluster.calls("sbatch")
    assert {"--ntasks=1", "--nodes=1", "--partition=small", "--account=ab12"} <= set(words)
    assert [call[0] for call in cluster.calls("adhesis")] == ["run", "status"]
    script = cluster.folder / "calls.submitted"
    done = cluster.run("bash", script, ADHESIS="")
    assert done.returncode == 0, done.stderr
    assert cluster.calls("adhesis")[-1] == ["report", "my results.h5", "--to", "s"]


@pytest.mark.parametrize("pending", ["0", "2"])
def test_parts_are_an_array_and_a_job_that_joins_them(cluster: Cluster, pending: str) -> None:
    done = cluster.run(
        *(JOBS / "parts.sh", "3", "--time=1:00:00", "--mem=1G", "s.toml", "--max-failures", "0"),
        SBATCH_SAYS="41;east",
    )
    assert done.returncode == 0, done.stderr
    array, merge = cluster.calls("sbatch")
    assert {"--array=1-3", "--time=1:00:00", "--mem=1G"} <= set(array)
    place = array.index(str(JOBS / "slurm.sh"))
    part = ["s.toml", "s.%a-of-3.h5", "--part", "%a/3", "--max-failures", "0"]
    assert array[place + 1 :] == part
    assert {"--dependency=afterany:41", "--ntasks=1", "--time=1:00:00"} <= set(merge)
    for number in (1, 3):  # part 2 was cancelled before it began
        (cluster.folder / f"s.{number}-of-3.h5").touch()
    done = cluster.run("bash", cluster.folder / "calls.submitted", PENDING=pending)
    assert done.returncode == (75 if pending == "2" else 0), done.stderr
    merged, *_, last = cluster.calls("adhesis")
    assert merged == ["merge", "s.1-of-3.h5", "s.3-of-3.h5", "--out", "s.h5"]
    assert last[0] == ("status" if pending == "2" else "report")


@pytest.mark.parametrize("parts", ["0", "x", ""])
def test_parts_are_counted(cluster: Cluster, parts: str) -> None:
    done = cluster.run(JOBS / "parts.sh", parts, "s.toml")
    assert (done.returncode, cluster.calls("sbatch")) == (2, [])
    assert f"PARTS is '{parts}'" in done.stderr


def pbs(cluster: Cluster, **env: str) -> subprocess.CompletedProcess[str]:
    return cluster.run("bash", JOBS / "pbs.sh", **(pbs_variables(cluster) | env))


def pbs_variables(cluster: Cluster) -> dict[str, str]:
    return {
        "PBS_O_WORKDIR": str(cluster.folder),
        "PBS_NODEFILE": str(cluster.folder / "nodes"),
        "PBS_JOBID": "17.head",
        "QSTAT": str(cluster.folder / "qstat"),
        "CAMPAIGN": "study.toml",
        "SCRIPT": str(JOBS / "pbs.sh"),
    }


def test_pbs_job_tells_the_run_its_time_and_submits_the_report(cluster: Cluster) -> None:
    done = pbs(cluster, OPTIONS="--max-failures 0")
    assert done.returncode == 0, done.stderr
    (run,) = (" ".join(words) for words in cluster.calls("adhesis") if words[0] == "run")
    match = re.fullmatch(r"run study.toml --out study.h5 --walltime (\d+) --max-failures 0", run)
    assert match is not None, run
    assert 5240 <= int(match[1]) <= 5250  # an hour and a half, less 30 s and two minutes
    assert cluster.calls("mpirun")[0][:2] == ["-n", "4"]
    (job,) = cluster.qsub()
    assert job["l"] == "select=1:ncpus=1 walltime=1:00:00"
    assert (job["-q"], job["-A"], job["-P"]) == ("small", "ab12", "rough")
    (cluster.folder / "job").write_text(job["script"])
    ran("bash", cluster.folder / "job", env=cluster.env, cwd="/", check=True, timeout=None)
    assert cluster.calls("adhesis")[-1] == ["report", "study.h5", "--to", "study"]


def test_pbs_job_submits_a_continuation_with_all_that_it_was_given(cluster: Cluster) -> None:
    programs = cluster.folder / "bin"
    executable(programs / "mine", (programs / "mpirun").read_text().replace("mpirun", "mine"))
    settings = {"LAUNCHER": "mine -n 3", "MAX_RESTARTS": "2", "FILE": "r,1.h5"}
    options = {"OPTIONS": "--redo failed --max-failures 0"}
    assert pbs(cluster, CODE="75", PBS_O_QUEUE="route", **settings, **options).returncode == 75
    for restart in (1, 2):
        job = cluster.qsub()[-1]
        assert "-v" not in job
        assert (job["-N"], job["-q"], job["-A"], job["-P"]) == ("wide", "route", "ab12", "rough")
        chunks = "2:ncpus=2:mpiprocs=2:mem=4gb:cpu_type=a_long_name_of_a_processor"
        assert job["l"] == f"select={chunks} walltime=01:30:00"
        (cluster.folder / "job").write_text(job["script"])
        # A job of PBS has the variables of PBS alone, and begins in the home folder.
        kept = {key: value for key, value in cluster.env.items() if key != "ADHESIS"}
        given = {k: v for k, v in pbs_variables(cluster).items() if k.startswith(("PBS", "Q"))}
        given |= {"CODE": "137", "PBS_O_QUEUE": "route"}
        done = ran("bash", cluster.folder / "job", env=kept | given, cwd="/", timeout=None)
        assert done.returncode == 137, done.stderr
        assert f"start {restart + 1}" in done.stdout
        runs = [words for words in cluster.calls("adhesis") if words[0] == "run"]
        assert runs[-1][:4] == ["run", "study.toml", "--out", "r,1.h5"]
        assert runs[-1][-2:] == ["--max-failures", "0"]
        assert "--redo" not in runs[-1]
        assert cluster.calls("mine")[-1][:2] == ["-n", "3"]
    assert len(cluster.qsub()) == 2
    assert "not submitted again" in done.stdout


@pytest.mark.parametrize(
    "env",
    [
        {"CODE": "75", "RESTARTS": "3", "MAX_RESTARTS": "3"},
        {"CODE": "75", "SIGNAL": "TERM"},  # qdel
        {"CODE": "1", "PENDING": "3"},
        {"CODE": "2"},
    ],
)
def test_pbs_job_that_submits_nothing(cluster: Cluster, env: dict[str, str]) -> None:
    done = pbs(cluster, **env)
    assert (done.returncode, cluster.qsub()) == (int(env["CODE"]), []), done.stderr
