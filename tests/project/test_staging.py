"""Staging of jobs/: whatever jobs do to each other, no row that was written is lost.

Batch system and run are stand-ins: a run appends rows to the open results file, one after the
other, and keeps others out by a lock, as adhesis does. Some jobs have the real run, with tasks that
take no time.
"""

import json
import os
import random
import shutil
import signal
import stat
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from tests.support.campaign_support import (
    adhesis_here,
    campaign_text,
    done_rows,
    environment,
    wait_until,
)
from tests.support.processes import executable, ran

JOBS = Path(__file__).parent.parent.parent / "jobs"
ROWS = 30

# The file `ledger` has a line for each row that was written, `refused` for each run that did
# nothing.
ADHESIS = f"""#!/bin/bash
if [ "$1" = status ]; then
    [ -e "$2" ] || exit 2
    held=null
    if [ -e "$2.lock" ] && ! flock -n "$2.lock" true; then held='{{'; fi
    printf '{{\\n "pending": %s,\\n "run": %s\\n}}\\n' $(({ROWS} - $(wc -l <"$2"))) "$held"
    exit 0
fi
file=$4
exec 8<>"$file.lock"
if ! flock -n 8; then echo x >>refused; exit 2; fi
trap 'exit 75' USR1
exec 7>>"$file"
declare -A done
while read -r row; do done[$row]=yes; done <"$file"
for ((row = 1; row <= {ROWS}; row++)); do
    if [ -n "${{done[$row]:-}}" ]; then continue; fi
    sleep 0.004
    echo "$row" >&7
    echo "$row" >>ledger
done
"""
SCONTROL = """#!/bin/bash
if [ "$1" = show ]; then echo "   JobState=RUNNING"; fi
"""


@dataclass
class Site:
    """A folder to submit from, with stand-ins, and the jobs that were started."""

    folder: Path
    env: dict[str, str] = field(default_factory=dict)
    started: list[subprocess.Popen[str]] = field(default_factory=list)

    def start(self, *options: str, **env: str) -> subprocess.Popen[str]:
        return self.execute("bash", str(JOBS / "slurm.sh"), "s.toml", *options, **env)

    def run_by_hand(self, **env: str) -> subprocess.Popen[str]:
        """Start adhesis itself, which knows nothing of STAGING."""
        adhesis = str(self.folder / "bin" / "adhesis")
        return self.execute(adhesis, "run", "s.toml", "--out", "s.h5", **env)

    def execute(self, *command: str, **env: str) -> subprocess.Popen[str]:
        programs = self.folder / "bin"
        settings = {
            "PATH": f"{programs}:/usr/bin:/bin",
            "ADHESIS": str(programs / "adhesis"),
            "JOBS": str(JOBS),
            "LAUNCHER": "env",
            "REPORT": "no",
            "SLURM_JOB_ID": "7",
            "SLURM_SUBMIT_DIR": str(self.folder),
            "SLURM_JOB_NODELIST": "n1",
            "SLURM_JOB_CPUS_PER_NODE": "1",
            "SLURM_JOB_NAME": "study",
        }
        job = subprocess.Popen(
            command,
            cwd=self.folder,
            env=self.env | settings | env,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
        )
        self.started.append(job)
        return job

    def lines(self, name: str) -> list[str]:
        path = self.folder / name
        return path.read_text().split() if path.exists() else []

    def is_quiet(self) -> bool:
        for job in self.started:
            job.poll()
            try:
                os.killpg(job.pid, 0)
            except ProcessLookupError:
                continue
            return False
        return True


@contextmanager
def site(folder: Path) -> Iterator[Site]:
    """Make a site; what still runs in the end is ended."""
    for name, text in {"adhesis": ADHESIS, "scontrol": SCONTROL}.items():
        executable(folder / "bin" / name, text)
    made = Site(folder)
    try:
        yield made
    finally:
        for job in made.started:
            with suppress(ProcessLookupError):
                os.killpg(job.pid, signal.SIGKILL)
        for job in made.started:
            job.communicate()


@dataclass
class Start:
    """One start of a job, and what meets it when so many more rows have been written."""

    disk: str
    patience: str
    end: str
    rows: int


@dataclass
class Job:
    """A job that starts, and comes back, when so many rows have been written."""

    begin: int
    starts: list[Start]
    process: subprocess.Popen[str] | None = None
    end: str = ""
    at: int = 0

    def go_on(self, here: Site, others_rest: bool) -> bool:
        """Start, end or wait; returns whether there is more to come."""
        written = len(here.lines("ledger"))
        if self.process is None:
            if not self.starts:
                return False
            if written >= self.begin or others_rest:
                start = self.starts.pop(0)
                self.begin, self.end, self.at = 0, start.end, written + start.rows
                self.process = here.start("--patience", start.patience, STAGING=start.disk)
        elif self.process.poll() is not None:
            self.process = None
        elif self.end and written >= self.at:
            number = {"limit": signal.SIGUSR1, "cancel": signal.SIGTERM}.get(self.end)
            if self.end == "kill all":
                os.killpg(self.process.pid, signal.SIGKILL)
            else:
                self.process.send_signal(number or signal.SIGKILL)
            self.end = ""
        return True


def drawn_job(draw: random.Random, disks: list[str], first: bool) -> Job:
    ends = ["", "kill script", "kill all", "limit", "limit", "cancel"]
    starts = [
        Start(
            draw.choice(disks),
            draw.choice(["0", "0.1", "20"]),
            draw.choice(ends),
            draw.randrange(ROWS // 2),
        )
        for _ in range(draw.randint(1, 3))
    ]
    return Job(0 if first else draw.randrange(ROWS), starts)


def interleave(folder: Path, seed: int) -> None:
    """Two or three jobs of one campaign that start, are refused, killed, stopped and come back."""
    draw = random.Random(seed)
    disks = draw.choice([["disk1"], ["disk1"], ["disk1", "disk2"], ["disk1", "disk2", ""]])
    jobs = [drawn_job(draw, disks, first) for first in (True, False, False)[: draw.randint(2, 3)]]
    with site(folder) as here:
        end = time.monotonic() + 120
        while sum(
            job.go_on(here, not any(o.process for o in jobs if o is not job)) for job in jobs
        ):
            assert time.monotonic() < end, f"seed {seed}"
            time.sleep(0.003)
        while not here.is_quiet():  # runs outlive scripts that were killed
            assert time.monotonic() < end, f"seed {seed}"
            time.sleep(0.01)
        at_work, copies = f"seed {seed}", folder.glob("disk*/*/s.h5")
        kept = {row for copy in copies for row in copy.read_text().split()}
        assert {*here.lines("ledger")} <= {*here.lines("s.h5"), *kept}, at_work
        if disks == ["disk1"]:
            # A last job, alone, finds all that the others have left, and nothing was done twice.
            last = here.start(STAGING="disk1")
            text, _ = last.communicate(timeout=60)
            assert last.returncode == 0, f"{at_work}: {text}"
            assert sorted(map(int, here.lines("s.h5"))) == list(range(1, ROWS + 1)), at_work
            assert len(here.lines("ledger")) == len(set(here.lines("ledger"))), at_work
            assert [*(folder / "disk1").iterdir(), *folder.glob("s.h5.*")] == [], at_work


def test_no_interleaving_of_jobs_loses_a_row(tmp_path: Path) -> None:
    with ThreadPoolExecutor(8) as pool:
        for done in [pool.submit(interleave, tmp_path / f"{k}", k) for k in range(12)]:
            done.result()


SHORT_COPY = 'cp() { head -c 3 "$2" >"$3"; }'


@pytest.mark.parametrize(
    ("before", "within", "words"),
    [
        ("", "echo other >>s.h5", "changed by somebody else"),
        # as long ago and in the same place as what was copied, and of another length alone
        ("", "touch -r s.h5 t; echo other >>s.h5; touch -r t s.h5", "changed by somebody else"),
        ("", "touch written", "being written by another run"),
        ("", SHORT_COPY, "could not be copied back"),
        (SHORT_COPY, "", "could not be copied to"),
    ],
    ids=["changed", "changed in length alone", "written", "copied back in part", "copied in part"],
)
def test_results_that_are_not_copied_back_whole_stay(before, within, words, tmp_path):
    """``written`` makes the stand-in of status report a run."""
    (tmp_path / "s.h5").write_text("earlier\n")
    script = f"""
        status() {{ if [ -e written ]; then echo ' "run": {{'; fi; }}
        . {JOBS}/common.sh
        STAGING=disk ADHESIS=status file=s.h5 code=0
        {before}
        stage_in
        echo mine >>"$results"
        {within}
        stage_out
        exit "$code"
    """
    done = ran("bash", "-c", script, cwd=tmp_path)
    assert done.returncode == 74, done
    assert words in done.stdout + done.stderr
    assert (tmp_path / "s.h5").read_text().startswith("earlier\n")
    if not before:
        kept = next(tmp_path.glob("disk/*/s.h5"))
        assert kept.read_text() == "earlier\nmine\n"
        assert "mine" not in (tmp_path / "s.h5").read_text()


@pytest.fixture
def real(tmp_path: Path) -> Iterator[Site]:
    """A site with the real command, and a campaign of 40 tasks that take no time.

    A run stays in its fourth task until there is a file `free`.
    """
    with site(tmp_path) as here:
        (tmp_path / "s.toml").write_text(campaign_text(realisations="10"))
        fake = JOBS.parent / "tests" / "support" / "fake_run.py"
        (tmp_path / "bin" / "adhesis").write_text(
            f'#!/bin/sh\nexec "{sys.executable}" "{fake}" "hold=${{HOLD:-3}} free=free" "$@"\n'
        )
        here.env = environment()
        yield here


def staged(here: Site) -> Path:
    return next(here.folder.glob("disk1/*/s.h5"), here.folder / "none")


def test_rows_of_a_killed_run_come_back(real: Site) -> None:
    first = real.start(STAGING="disk1", LAUNCHER="setsid --wait")
    wait_until(lambda: done_rows(staged(real)) == 3)
    record = json.loads((staged(real).parent / "s.h5.lock").read_text())
    os.kill(record["pid"], signal.SIGKILL)
    text, _ = first.communicate(timeout=60)
    assert first.returncode == 137, text
    assert done_rows(real.folder / "s.h5") == 3
    assert not staged(real).exists()


def test_the_noted_version_is_not_written_anew_beside_rows_that_are_left(real: Site) -> None:
    """A job that is killed while it writes it would make the next one refuse the rows."""
    first = real.start(STAGING="disk1")
    wait_until(lambda: done_rows(staged(real)) == 3)
    os.killpg(first.pid, signal.SIGKILL)
    first.wait()
    noted = (staged(real).parent / "version").stat()
    second = real.start("--patience", "60", STAGING="disk1")
    wait_until(lambda: done_rows(staged(real)) > 3)
    assert (staged(real).parent / "version").stat().st_mtime_ns == noted.st_mtime_ns
    (real.folder / "free").touch()
    text, _ = second.communicate(timeout=120)
    assert second.returncode == 0, text


def test_a_run_of_somebody_else_and_a_job_do_not_destroy_each_other(real: Site) -> None:
    """The other run has no STAGING; it writes to the results file itself."""
    by_hand = real.run_by_hand()
    results = real.folder / "s.h5"
    wait_until(lambda: done_rows(results) == 3)
    refused = real.start(STAGING="disk1")
    text, _ = refused.communicate(timeout=60)
    assert (refused.returncode, "s.h5 is being written by another run" in text) == (2, True), text
    assert not (real.folder / "disk1").exists()
    by_hand.send_signal(signal.SIGUSR1)
    assert by_hand.wait(60) == 75
    job = real.start(STAGING="disk1")
    wait_until(lambda: done_rows(staged(real)) == 6)
    by_hand = real.run_by_hand(HOLD="0")  # writes no row before the job ends
    wait_until(lambda: (real.folder / "s.h5.lock").exists())
    job.send_signal(signal.SIGUSR1)
    text, _ = job.communicate(timeout=60)
    assert job.returncode == 74, text
    assert f"stay in {staged(real).relative_to(real.folder)}" in text
    (real.folder / "free").touch()
    assert by_hand.wait(120) == 0
    assert done_rows(results) == 40
    again = real.start(STAGING="disk1")
    text, _ = again.communicate(timeout=60)
    assert again.returncode == 2, text
    assert f"adhesis merge {staged(real).relative_to(real.folder)} --out s.h5" in text
    joined = adhesis_here("merge", staged(real), "--out", results)
    assert joined.returncode == 0, joined.stderr


VICTIM, ATTACKER = 64_001, 64_002  # two accounts, which need no name
OPEN = "mkdir -m 777 $stage"


@pytest.fixture
def shared() -> Iterator[Path]:
    """A folder as /tmp, of which all accounts may use `disk`, and the first one `work`."""
    # pytest's own folder is closed to others
    top = Path(tempfile.mkdtemp(prefix="adhesis-staging-"))
    for folder, mode in (top, 0o755), (top / "disk", 0o1777), (top / "work", 0o755):
        folder.mkdir(exist_ok=True)
        folder.chmod(mode)
    shutil.copy(JOBS / "common.sh", top)
    (top / "work" / "s.h5").write_text("rows of the victim")
    if os.geteuid() == 0:
        for path in (top / "work", top / "work" / "s.h5"):
            os.chown(path, VICTIM, VICTIM)
    yield top
    shutil.rmtree(top)


def shell(shared: Path, script: str, account: int = VICTIM) -> subprocess.CompletedProcess[str]:
    """Run a script as an account where the tests may, in the folder of the results."""
    other = {"user": account, "group": account, "extra_groups": []} if os.geteuid() == 0 else {}
    stage = os.path.relpath(stage_of(shared), shared / "work")  # a path from / may have spaces
    env = {"PATH": f"{shared}:/usr/bin:/bin", "stage": stage}
    script = f". ../common.sh\nSTAGING=../disk file=s.h5 options=()\n{script}"
    return ran("bash", "-c", script, cwd=shared / "work", env=env, **other)


def stage_of(shared: Path) -> Path:
    """The folder that anybody can foretell."""
    target = os.path.realpath(shared / "work" / "s.h5")
    sum_of = ran("cksum", input=target, check=True).stdout.split()[0]
    user = VICTIM if os.geteuid() == 0 else os.getuid()
    return shared / "disk" / f"adhesis-{user}-{sum_of}"


@pytest.mark.parametrize(
    ("account", "planted", "words"),
    [
        (ATTACKER, f"{OPEN}; ln -s ../../work/precious $stage/version", "belongs to"),
        (ATTACKER, f"{OPEN}; echo none >$stage/version; echo forged >$stage/s.h5", "belongs to"),
        (ATTACKER, "mkdir -m 777 ../disk/x; ln -s x $stage", "is a link"),
        (VICTIM, "mkdir ../work/x; ln -s ../work/x $stage", "is a link"),
        (VICTIM, "mkdir $stage; chmod 770 $stage", "others can write to"),
        (VICTIM, "mkdir $stage; chmod 702 $stage", "others can write to"),
        (VICTIM, "touch $stage", "cannot be made"),
        (VICTIM, "mkfifo $stage", "cannot be made"),
        (os.geteuid(), "chmod 777 ../disk", "is not sticky"),
        (VICTIM, "mkdir -m 700 $stage", ""),
        (VICTIM, "mkdir -m 755 $stage", ""),
    ],
)
def test_a_folder_that_others_can_fill_or_rename_is_refused(shared, account, planted, words):
    (shared / "work" / "precious").write_text("a line")
    if os.geteuid() == 0:
        os.chown(shared / "work" / "precious", VICTIM, VICTIM)
    elif account == ATTACKER:
        pytest.skip("only root can act for other accounts")
    assert shell(shared, planted, account).returncode == 0
    done = shell(shared, "stage_in; code=0; stage_out; exit $code")
    assert done.returncode == {"": 0, "cannot be made": 74}.get(words, 2), done.stderr
    assert words in done.stderr
    assert len(done.stderr.splitlines()) == bool(words)
    assert (shared / "work" / "precious").read_text() == "a line"
    assert (shared / "work" / "s.h5").read_text() == "rows of the victim"


def test_the_folder_is_private_and_a_job_that_comes_back_finds_it(shared: Path) -> None:
    done = shell(shared, "umask 0; stage_in; echo new rows >$results; kill -9 $$")
    assert done.returncode == -signal.SIGKILL, done.stderr
    assert stat.S_IMODE(stage_of(shared).stat().st_mode) == 0o700
    done = shell(shared, "stage_in; code=0; stage_out; exit $code")
    assert done.returncode == 0, done.stderr
    assert (shared / "work" / "s.h5").read_text() == "new rows\n"
    assert not stage_of(shared).exists()


@pytest.mark.parametrize("name", ["s.h5.copy", "s.h5.staging"])
@pytest.mark.parametrize("planted", ["ln -s precious {}", "ln -s missing {}", "mkfifo {}"])
def test_links_and_pipes_beside_the_results_are_not_followed(shared, name, planted):
    assert shell(shared, f"echo a line >precious; {planted.format(name)}").returncode == 0
    done = shell(shared, "stage_in; echo new rows >$results; code=0; stage_out; exit $code")
    refused = name == "s.h5.staging"
    assert done.returncode == (2 if refused else 0), done.stderr
    assert ("is a link or no ordinary file" in done.stderr) == refused
    rows = (shared / "work" / "s.h5").read_text()
    assert rows == ("rows of the victim" if refused else "new rows\n")
    assert (shared / "work" / "precious").read_text() == "a line\n"
    assert not (shared / "work" / "missing").exists()
