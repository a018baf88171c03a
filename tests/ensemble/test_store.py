"""The results file: its shape, what readers see at any moment, and files that are refused."""

import errno
import fcntl
import itertools
import json
import os
import re
import signal
import sys

import h5py
import numpy as np
import pytest
import xarray

from adhesis.ensemble.campaign.file import parse_campaign
from adhesis.ensemble.command.main import main
from adhesis.ensemble.errors import InputError, WriteError
from adhesis.ensemble.results import schema
from adhesis.ensemble.results.checksum import write_head
from adhesis.ensemble.results.layout import create
from adhesis.ensemble.results.read import Results
from adhesis.ensemble.results.schema import DATASETS, DONE, FAILED, PENDING, scales
from adhesis.ensemble.results.write import DatasetRows, DiskFile, Writer
from adhesis.ensemble.run.lock import RunLock, holder
from adhesis.ensemble.task.dataset import KEPT
from adhesis.ensemble.task.row import RESULT_DATASETS
from tests.support.campaign_support import ROOT, campaign_text, run_python, started
from tests.support.fake_run import fake_result
from tools.interrupted import Interrupt


@pytest.fixture
def campaign():
    return parse_campaign(campaign_text())


@pytest.fixture
def path(tmp_path, campaign):
    path = tmp_path / "r.h5"
    create(path, campaign, attributes={"mpi": "none"})
    return path


def test_the_documentation_describes_every_dataset_and_no_other():
    text = (ROOT / "docs" / "results-file.md").read_text()
    described = set()
    for line in text.splitlines():
        if line.startswith("| `"):
            cell = line.split("|")[1]
            names = re.findall(r"`([^`]+)`", cell)
            stem = names[0].split("_", 1)
            described |= {n.replace("unloading_…", f"unloading_{stem[-1]}") for n in names}
    known = {c.name for c in DATASETS} | {s.name for s in scales(parse_campaign(campaign_text()))}
    assert described == known


@pytest.mark.parametrize("list_", ["[0, 1]", "[0.04, 0.0400000001]"])
def test_lists_that_an_earlier_run_took_are_read_with_its_results(list_, tmp_path):
    text = re.sub(r"(work_of_adhesion =).*", rf"\1 {list_}", campaign_text())
    with pytest.raises(InputError, match=r"holds 0,1: write 0\.1|different values"):
        parse_campaign(text)
    create(tmp_path / "r.h5", parse_campaign(text, is_stored=True), attributes={"mpi": "none"})
    with Results(tmp_path / "r.h5") as results:
        assert results.campaign.text == text


def test_a_new_file_is_whole_and_pending_with_units_names_and_scales(path, campaign):
    with Results(path) as results:
        assert results.campaign == campaign
        assert list(results.tasks) == list(campaign.tasks())
        assert not results.status().any()
        for column in RESULT_DATASETS:
            values = results.column(column.name)
            empty = np.isnan(values) if values.dtype.kind == "f" else values == -1
            assert empty.all(), column.name
        assert not results.column("error").view(np.uint8).any()
    assert not list(path.parent.glob("*.part"))
    with h5py.File(path) as file:
        for name, dataset in file.items():
            assert dataset.attrs["units"], name
            assert dataset.attrs["long_name"], name
            assert dataset.is_scale or all(len(dim) == 1 for dim in dataset.dims), name


@pytest.mark.usefixtures("alarm")
def test_an_interrupt_of_writing_arrives_as_itself_after_a_whole_row(path, campaign, monkeypatch):
    """Though it is of a class that errors of HDF5 are of."""
    result = fake_result(campaign, campaign.tasks()[0])
    writer = Writer(path)
    monkeypatch.setattr(Writer, "flush", lambda _: signal.raise_signal(signal.SIGALRM))
    with pytest.raises(Interrupt):
        writer.write_result(0, result)
    monkeypatch.undo()
    writer.close()
    with Results(path) as results:
        assert results.status()[0] == DONE
        assert not results.damaged().size


def test_rows_come_back_as_they_were_written(path, campaign):
    result = fake_result(campaign, campaign.tasks()[3])
    with Writer(path) as writer:
        writer.write_result(3, result, rank=7)
        writer.write_failure(5, "ValueError: " + "γ" * 400, 2.5, rank=1)
    with Results(path) as results:
        assert results.status().tolist() == [0, 0, 0, DONE, 0, FAILED, 0, 0]
        for column in RESULT_DATASETS:
            if column.dims[0] == KEPT:  # tests/ensemble/test_task.py
                continue
            value = np.asarray(result[column.name], column.dtype)
            assert results.column(column.name, slice(3, 4))[0].tobytes() == value.tobytes()
        assert results.column("rank")[3] == 7
        (error,) = results.errors(np.array([5]))
        assert error.startswith("ValueError: γγγ")
        assert set(error[12:]) == {"γ"}
        rows = np.array([1, 3, 4, 5])
        np.testing.assert_array_equal(results.column("loss", rows), results.column("loss")[rows])


@pytest.mark.filterwarnings("error")
def test_xarray_opens_it(path, campaign):
    with Writer(path) as writer:
        writer.write_result(0, fake_result(campaign, campaign.tasks()[0]))
    with xarray.open_dataset(path, engine="h5netcdf") as data:
        assert data.sizes["task"] == 8
        assert data["wall_time"].dtype == "f8"
        assert data["loss"].attrs["units"] == "J m-2"
        assert data["unloading_mean_stress"].dims == ("task", "unloading_penetration")
        assert data["jump_kind"].attrs["flag_meanings"].split()[0] == "pull-off"
        done = data.where(data["status"] == DONE, drop=True)
        assert done.sizes["task"] == 1
        assert float(data["unloading_penetration"][0]) == campaign.cycle.max_penetration


READ_WHILE_WRITING = """
import sys, h5py
path = sys.argv[1]
for _ in range(40):
    with h5py.File(path) as f:  # plain h5py, as a user has it
        done = f["status"][:] == 1
        assert (f["loss"][:][done] > 0).all()
        assert (f["unloading_energy"][:][done] > 0).all()
        assert (f["jump_count"][:][done] >= 0).all()
print("sound")
"""


def test_a_reader_sees_only_whole_rows_while_a_run_writes(path, campaign):
    reader = started([sys.executable, "-c", READ_WHILE_WRITING, str(path)])
    tasks = campaign.tasks()
    with Writer(path) as writer:
        for turn in itertools.count():
            if reader.poll() is not None:
                break
            row = min(turn // 100, 7)
            writer.write_result(row, fake_result(campaign, tasks[row]))
    assert reader.stdout.read() == "sound\n"
    assert reader.returncode == 0


def cuts(before: bytes, after: bytes):
    """What the file may be while it goes from one content to the next: every eighth range."""
    one, two = (np.frombuffer(b, np.uint8) for b in (before, after))
    changed = np.flatnonzero(one != two)
    if not changed.size:
        return
    ranges = np.split(changed, np.flatnonzero(np.diff(changed) > 200) + 1)
    for order in (ranges, ranges[::-1]):
        now = one.copy()
        for number, part in enumerate(order, 1):
            now[part] = two[part]
            if number % 8 == 0 or number == len(order):
                yield now.tobytes()


RECORDED = ("loss", "loading_energy", "wall_time", "error", "checksum", "status")


def test_marking_no_rows_costs_nothing(path, monkeypatch):
    """Most tasks that finish, of a campaign with [stop], leave no row over."""
    with Writer(path) as writer:
        monkeypatch.setattr("adhesis.ensemble.results.write.empty_checksums", None)
        writer.mark([], schema.NOT_NEEDED)


def test_every_moment_of_writing_leaves_a_sound_file(tmp_path, monkeypatch):
    """A kill after each write, and within each flush, must not cost a row.

    Of a row the datasets are recorded that say whether it is whole, and some beside. A killed
    process leaves behind what it has handed to the system: the file as it is then. A row with its
    checksum is whole; of which result it is, the loss says.
    """
    small = {"hurst": "[0.8]", "realisations": "1", "load_steps": "1", "jumps": "1"}
    campaign = parse_campaign(campaign_text(**small) + "field_penetrations = []\n")
    tasks, path = campaign.tasks(), tmp_path / "r.h5"
    create(path, campaign)
    first = fake_result(campaign, tasks[0])
    second = first | {"loss": 2.0, "loading_energy": first["loading_energy"] + 1}
    moments = [path.read_bytes()]

    def recorded(method):
        def wrapper(self, *args):
            method(self, *args)
            if isinstance(self, Writer) or h5py.h5i.get_name(self._id).decode()[1:] in RECORDED:
                moments.append(path.read_bytes())

        return wrapper

    monkeypatch.setattr(DatasetRows, "write", recorded(DatasetRows.write))
    monkeypatch.setattr(Writer, "flush", recorded(Writer.flush))
    with Writer(path) as writer:
        writer.write_result(0, first)
        writer.write_failure(1, "ValueError: no", 2.5)
        writer.mark([0], PENDING)
        writer.write_result(0, second)
        writer.mark([1], PENDING)
        writer.write_result(1, fake_result(campaign, tasks[1]))
    Results(path).close()
    copy, seen, states = tmp_path / "copy.h5", set(), set()
    for before, after in itertools.pairwise(moments):
        for content in cuts(before, after):
            if content in seen:
                continue
            seen.add(content)
            copy.write_bytes(content)
            with Results(copy) as results:
                status = results.status()
                states.add(tuple(status[:2].tolist()))
                assert not results.damaged().size
                if status[0] == DONE:
                    assert results.column("loss")[0] in (first["loss"], 2.0)
                if status[1] == FAILED:
                    assert results.errors(np.array([1])) == ["ValueError: no"]
                    assert results.column("wall_time")[1] == 2.5
    assert len(seen) > 20
    assert states == {(0, 0), (1, 0), (1, 2), (0, 2)} | {(1, 1)}


@pytest.mark.parametrize(
    ("version", "shown"),
    [(np.int32(0), "0"), (np.int32(2), "2"), (np.array([1, 0]), "1.0"), (np.array([1, 4]), "1.4")],
)
def test_a_file_of_another_version_is_refused(path, version, shown):
    assert schema.FILE_VERSION == 1
    with h5py.File(path, "r+") as file:
        file.attrs["file_version"] = version
    write_head(path)
    said = rf"has file version {re.escape(shown)}, and this adhesis reads version 1: read it with"
    with pytest.raises(InputError, match=said):
        Results(path)
    assert main(["status", str(path)]) == 2


def test_a_file_of_many_tasks_is_as_large_as_its_data(tmp_path):
    text = campaign_text(realisations="5000", load_steps="40", jumps="64")
    many = parse_campaign(text)
    create(tmp_path / "many.h5", many)
    size = (tmp_path / "many.h5").stat().st_size
    assert size < 1.02 * schema.file_size(many) + 100_000
    with Results(tmp_path / "many.h5") as results:
        assert len(results) == 20_000


HOLD_LOCK = """
import sys, time
from adhesis.ensemble.run.lock import RunLock
RunLock(sys.argv[1]).acquire(4, 0.0)
print("held", flush=True)
time.sleep(60)
"""


def holding(path, *, join=False):
    """Start a process that holds the lock, or joins it, until it is killed."""
    code = HOLD_LOCK.replace(".acquire(4, 0.0)", ".join()") if join else HOLD_LOCK
    holder = started([sys.executable, "-c", code, str(path)])
    assert holder.stdout.readline() == "held\n"
    return holder


def test_one_run_a_file_and_a_killed_one_holds_nothing(tmp_path):
    path = tmp_path / "r.h5"
    assert holder(path) is None
    # A killed run has left its text, which is longer than that of the next one.
    card = {"host": 200 * "long", "pid": 1, "ranks": 4, "since": "2026-01-01"}
    (tmp_path / "r.h5.lock").write_text(json.dumps(card))
    assert holder(path) is None
    process = holding(path)
    assert holder(path)["pid"] == process.pid
    with pytest.raises(InputError, match=rf"another run .*process {process.pid}, 4 ranks"):
        RunLock(path).acquire(1, 0.2)
    process.kill()
    process.wait()
    assert holder(path) is None  # its file is still there
    lock = RunLock(path)
    lock.acquire(1, 2.0)
    lock.release()
    assert not list(tmp_path.iterdir())


def wanted_by_another_process(path):
    return run_python("-c", HOLD_LOCK.replace("time.sleep(60)", ""), path).returncode != 0


def test_the_lock_lasts_whatever_its_process_opens_and_closes(tmp_path):
    """A POSIX lock would end when the first descriptor of its file is closed."""
    path = tmp_path / "r.h5"
    with RunLock(path) as lock:
        lock.acquire(1, 0.0)
        assert holder(path)["pid"] == os.getpid()
        lock.path.read_bytes()
        with pytest.raises(InputError, match=rf"another run .*process {os.getpid()}"):
            RunLock(path).acquire(1, 0.2)
        assert wanted_by_another_process(path)
    assert not wanted_by_another_process(path)


def test_a_process_that_was_forked_meanwhile_does_not_keep_a_lock_that_was_released(tmp_path):
    path, (end, write) = tmp_path / "r.h5", os.pipe()
    lock = RunLock(path)
    lock.acquire(1, 0.0)
    child = os.fork()
    if not child:
        os.read(end, 1)
        os._exit(0)
    try:
        lock.release(keep_file=True)
        with RunLock(path) as again:
            again.acquire(1, 0.0)
    finally:
        os.write(write, b"x")
        os.waitpid(child, 0)


@pytest.mark.parametrize("code", ["ENOLCK", "ENOSYS", "EOPNOTSUPP"])
def test_a_file_system_without_locks_is_used_after_a_warning(tmp_path, monkeypatch, capsys, code):
    """As Lustre without ``flock``; a lock that another process holds is another error."""

    def refuse(*_):
        raise OSError(getattr(errno, code), os.strerror(getattr(errno, code)))

    monkeypatch.setattr(fcntl, "flock", refuse)
    path = tmp_path / "r.h5"
    with RunLock(path) as lock:
        lock.acquire(2, 0.0)
        printed = capsys.readouterr().err
        assert printed.count("has no locks; make sure that no other run writes there") == 1
        with RunLock(path) as rank:
            rank.join()
        assert capsys.readouterr().err == ""
    assert not list(tmp_path.iterdir())


def fail_while_holding(path, error, then=lambda: None):
    with RunLock(path) as lock:
        lock.acquire(1, 2.0)
        then()
        raise error


def test_the_lock_stays_after_a_failure_so_that_ranks_that_still_write_are_met(tmp_path):
    path = tmp_path / "r.h5"
    orphans = []
    with pytest.raises(RuntimeError):
        fail_while_holding(
            path, RuntimeError("the run failed"), lambda: orphans.append(holding(path, join=True))
        )
    try:
        with pytest.raises(InputError, match="ranks that have outlived it"):
            RunLock(path).acquire(1, 0.2)
    finally:
        orphans[0].kill()
        orphans[0].wait()
    with RunLock(path) as lock:
        lock.acquire(1, 2.0)
    # Bad input is met before any rank writes: nothing stays behind.
    with pytest.raises(InputError, match="bad"):
        fail_while_holding(path, InputError("bad"))
    assert not list(tmp_path.iterdir())


def test_a_lock_file_that_is_replaced_while_a_run_waits_is_not_taken_for_the_lock(
    tmp_path, monkeypatch
):
    """Between opening and locking, its holder removes the file and another run makes its own."""
    path = tmp_path / "r.h5"
    real, holders = os.open, []

    def opened_too_early(name, *rest):
        descriptor = real(name, *rest)
        if not holders:
            os.unlink(name)
            holders.append(holding(path))
        return descriptor

    monkeypatch.setattr("adhesis.ensemble.run.lock.os.open", opened_too_early)
    try:
        with pytest.raises(InputError, match="another run"):
            RunLock(path).acquire(1, 0.2)
    finally:
        holders[0].kill()
        holders[0].wait()


def _replace(path):
    path.rename(path.with_name("old.h5"))
    path.write_bytes(path.with_name("old.h5").read_bytes())


TAKEN_AWAY = {
    "removed": lambda path: path.unlink(),
    "moved with its folder": lambda path: path.parent.rename(f"{path.parent}-old"),
    "replaced": _replace,
    "cut": lambda path: os.truncate(path, 1000),
}


@pytest.mark.parametrize("how", TAKEN_AWAY)
def test_no_row_is_written_into_a_file_that_is_not_there_as_it_was(path, campaign, how):
    """The rows would have been counted as done, and be lost with the file."""
    row = fake_result(campaign, campaign.tasks()[0])
    with Writer(path) as writer:
        writer.write_failure(1, "no result", 1.0)
        TAKEN_AWAY[how](path)
        with pytest.raises(WriteError, match=r"r\.h5 was moved, replaced or removed while"):
            writer.write_result(0, row)


@pytest.mark.filterwarnings("error::pytest.PytestUnraisableExceptionWarning")
def test_a_file_that_is_gone_when_it_is_opened_to_write_is_one_sentence(path):
    path.unlink()
    with pytest.raises(WriteError, match=r"r\.h5 could not be opened: No such file or directory"):
        Writer(path)


def test_what_the_disk_reports_only_when_the_file_is_closed_is_no_success(
    path, campaign, monkeypatch
):
    """As of a network file system that is full: rows that were taken for written may be lost."""
    close = DiskFile.close

    def close_late(self):
        close(self)
        self._error = OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    row = fake_result(campaign, campaign.tasks()[0])
    writer = Writer(path)
    writer.write_result(0, row)
    monkeypatch.setattr(DiskFile, "close", close_late)
    with pytest.raises(WriteError, match=r"r\.h5 could not be closed: No space left on device"):
        writer.__exit__(None, None, None)
    with pytest.raises(TypeError, match="the first error"), Writer(path):
        raise TypeError("the first error")
