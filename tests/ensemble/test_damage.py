"""Damaged results files: found, named, never taken for sound; whole in bytes that a run wrote."""

import json
import os
import re
import shutil
import zlib

import h5py
import numpy as np
import pytest

import adhesis
import adhesis.ensemble.results.read as reading
from adhesis.ensemble.aggregate.average import aggregate
from adhesis.ensemble.aggregate.status import as_text, read_status
from adhesis.ensemble.campaign.file import load_campaign
from adhesis.ensemble.command.main import main
from adhesis.ensemble.errors import InputError
from adhesis.ensemble.report.findings import missing
from adhesis.ensemble.report.markdown_page import write_page
from adhesis.ensemble.results import checksum
from adhesis.ensemble.results.checksum import write_head
from adhesis.ensemble.results.layout import merge
from adhesis.ensemble.results.read import Results
from adhesis.ensemble.results.schema import DAMAGED, DONE, FAILED, PENDING, ROW_DATASETS
from adhesis.ensemble.run.session import Options, run_campaign
from adhesis.ensemble.task.dataset import KEPT
from tests.support.campaign_support import differences, write_campaign
from tests.support.crafted_hdf5 import made, put, virtual
from tests.support.fake_run import fake_engine
from tools.damage import Damage


@pytest.fixture(scope="module")
def damage(tmp_path_factory) -> Damage:
    return Damage(tmp_path_factory.mktemp("damage"))


@pytest.fixture
def path(damage, tmp_path):
    return shutil.copy(damage.sound, tmp_path / "r.h5")


def changed(path, change) -> bytes:
    with h5py.File(path, "r+") as file:
        change(file)
    return path.read_bytes()


def test_a_sound_file_is_sound(damage):
    assert damage.judge(damage.content) == ("harmless", "")


def test_random_bytes_of_rows_are_found_and_computed_again(damage, path):
    rng = np.random.default_rng(1)
    places = damage.places(of_rows=True)
    for number in range(8):
        content = damage.flipped(int(rng.choice(places)), 1 << int(rng.integers(8)))
        path.write_bytes(content)
        with Results(path) as results:
            assert results.damaged().size == 1
        if number < 1:
            verdict, reason = damage.judge(content)
            assert verdict == "named", reason


def test_random_bytes_beside_the_rows_and_cuts_are_refused(damage):
    rng = np.random.default_rng(2)
    places = damage.places(of_rows=False)
    for _ in range(16):
        place, mask = int(rng.choice(places)), 1 << int(rng.integers(8))
        verdict, reason = damage.judge(damage.flipped(place, mask))
        assert verdict == "refused", (place, mask, reason)
    for size in rng.integers(0, len(damage.content), 5).tolist():
        verdict, reason = damage.judge(damage.content[:size])
        assert verdict == "refused", (size, reason)


def _set(name, row, value):
    def change(file):
        where = (row,) + (0,) * (file[name].ndim - 1)
        file[name][where] = value

    return change


@pytest.mark.parametrize("first", range(0, len(ROW_DATASETS), 8))
def test_a_bit_of_any_number_of_a_row_names_it(path, first):
    """Of each row another dataset; of those that not all rows have, the first one that has."""
    named = set()
    with h5py.File(path, "r+") as file:
        for row, dataset in enumerate(ROW_DATASETS[first : first + 8]):
            data = file[dataset.name]
            if dataset.name == "status":  # below
                continue
            place = row if data.shape[0] == 8 else 0
            named.add(row if data.shape[0] == 8 else int(file[KEPT][0]))
            values = np.asarray(data[place])
            found = bytearray(values.tobytes())
            found[0] ^= 1
            data[place] = np.frombuffer(found, values.dtype).reshape(values.shape)
    with Results(path) as results:
        assert set(results.damaged().tolist()) == named


@pytest.mark.parametrize(("row", "status"), [(5, 7), (5, FAILED), (5, 3), (7, DONE)])
def test_a_row_with_the_status_of_another_end_is_named(path, row, status):
    changed(path, _set("status", row, status))
    with Results(path) as results:
        assert results.damaged().tolist() == [row]


def test_a_row_that_lost_its_status_is_pending_and_not_damaged(damage, path):
    """A kill between checksum and status leaves just that behind."""
    assert damage.judge(changed(path, _set("status", 2, PENDING))) == ("pending", "rows (2,)")


@pytest.mark.parametrize(
    ("name", "pending", "place"),
    [
        ("hurst", False, r" \(.* in row 3\)"),
        ("realisation", True, r" \(.* in row 3\)"),
        ("unloading_penetration", False, ""),
    ],
)
def test_a_task_or_an_axis_of_another_campaign_is_refused(damage, path, name, pending, place):

    def change(file):
        file[name][3] = file[name][3] + 1
        if pending:
            file["status"][3] = PENDING

    assert damage.judge(changed(path, change))[0] == "refused"
    write_head(path)
    verdict, sentence = damage.judge(path.read_bytes())
    assert verdict == "refused"
    assert re.search(rf"its {name} is not that of its campaign{place}", sentence)


def test_a_file_whose_rows_have_not_all_numbers_of_today_is_not_called_damaged(
    damage, path, monkeypatch
):
    changed(path, lambda file: file.__delitem__("friction"))
    with monkeypatch.context() as then:
        then.setattr(
            checksum, "ROW_DATASETS", [d for d in checksum.ROW_DATASETS if d.name != "friction"]
        )
        write_head(path)
    verdict, sentence = damage.judge(path.read_bytes())
    assert verdict == "refused"
    assert "was written by another state of adhesis, without friction: read it with" in sentence


PROMISES = {
    "a size beyond memory": lambda file: made(file, "loss", (10**12,)),
    "a name less": lambda file: file.move("loss", "moved"),
    "what another file holds": lambda file: virtual(file, "loss", "sound.h5", "loss"),
    "any file": lambda file: made(file, "loss", external=[("/proc/self/environ", 0, 64)]),
    "a long text": lambda file: put(
        file.attrs, file.attrs["campaign"] + "#" * 40_000_000, "campaign"
    ),
}


@pytest.mark.parametrize("kind", PROMISES)
def test_headers_that_promise_something_else_are_refused_before_they_are_read(
    path, kind, monkeypatch
):
    read = []
    monkeypatch.setattr(Results, "column", lambda self, name, rows=None: read.append(name))
    changed(path, PROMISES[kind])
    sign_all(path)
    with pytest.raises(InputError) as caught:
        Results(path)
    assert "\n" not in str(caught.value)
    assert not read


def sign_all(path):
    """Give a file a head that is right for it: the checksum of its length, with no rows left out.

    Without HDF5, which would follow the links in it.
    """
    content = bytearray(path.read_bytes())
    mark, length = b"adhesis head 1: ", 8192
    place = content.find(mark)
    table = f"{len(content)} 0+{len(content)} {place}+{length} ".encode()
    text = mark + f"{zlib.crc32(table):08x} ".encode() + table
    content[place : place + length] = text.ljust(length, b".")
    path.write_bytes(content)


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        *(("loss", kind) for kind in ("sound", "soft", "nowhere", "pipe")),
        *((name, "pipe") for name in ("status", "hurst", "task", "unloading_penetration", "x")),
    ],
)
def test_a_link_is_refused_before_it_is_followed(path, name, kind, tmp_path):
    """HDF5 opens what an external link names, and a pipe without a writer lets it wait."""
    os.mkfifo(tmp_path / "pipe")

    def change(file):
        if name in file:
            file.move(name, "moved")
        if kind == "soft":
            file[name] = h5py.SoftLink("/moved")
        else:
            target = {"pipe": tmp_path / "pipe", "sound": path, "nowhere": "none.h5"}[kind]
            file[name] = h5py.ExternalLink(str(target), "/loss")

    changed(path, change)
    sign_all(path)
    with pytest.raises(InputError, match=f"is damaged: its {name} is a link, and not in the file"):
        Results(path)


ATTRIBUTES = {
    "another seed": lambda file: file.attrs.modify("seed", 77),
    "a seed of several numbers": lambda file: file.attrs.create("seed", [5, 5]),
    "a part": lambda file: file.attrs.create("part", "1/1 "),
    "no part": lambda file: file.attrs.create("part", "3/2"),
    "another unit": lambda file: file["loss"].attrs.modify("units", "mJ m-2"),
    "the unit of an axis": lambda file: file["unloading_penetration"].attrs.modify("units", "m"),
    "no unit": lambda file: file["loss"].attrs.pop("units"),
    "a factor": lambda file: file["loss"].attrs.create("scale_factor", 2.0),
    "other names of flags": lambda file: file["status"].attrs.modify("flag_meanings", "a b c d"),
    "other flags": lambda file: file["status"].attrs.modify(
        "flag_values", np.arange(1, 5, 1, "u1")
    ),
    "another dimension": lambda file: _another_dimension(file["loss"], file["field_task"]),
}


def _another_dimension(dataset, scale):
    dataset.dims[0].detach_scale(dataset.dims[0][0])
    dataset.dims[0].attach_scale(scale)


@pytest.mark.parametrize("name", ATTRIBUTES)
def test_an_attribute_that_is_not_the_campaigns_is_refused(path, name, capsys):
    """Other programs go by it, and the checksum of the head can be made right."""
    changed(path, ATTRIBUTES[name])
    write_head(path)
    assert main(["verify", str(path)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    if name == "another seed":
        assert "is damaged: its attribute seed is 77, and that of its campaign is 5" in line
    assert "--part" not in line  # no option was used
    assert name != "no part" or "is damaged: its attribute part is '3/2'" in line


def test_verify_names_the_rows_and_what_is_to_be_done(path, capsys):
    assert main(["verify", str(path)]) == 0
    assert "r.h5 is sound: 8 rows have their checksum (7 done, 1 failed), 0 are pending" in (
        capsys.readouterr().out
    )
    changed(path, _set("loss", 3, 1.0))
    changed(path, _set("status", 6, 9))
    assert main(["verify", str(path)]) == 1
    said = capsys.readouterr().out
    assert "2 of 8 written rows are damaged" in said
    assert "row 3: H = 0.7, γ = 0.04 J/m², realisation 1, seed" in said
    assert "adhesis run CAMPAIGN.toml" in said
    assert main(["verify", str(path), "--json"]) == 1
    reported = json.loads(capsys.readouterr().out)
    assert [d["row"] for d in reported["damaged"]] == [3, 6]
    assert (reported["done"], reported["failed"], reported["pending"]) == (5, 1, 0)
    assert main(["verify", str(path.with_name("none.h5"))]) == 2
    assert "does not exist" in capsys.readouterr().err


def test_status_report_and_python_name_damaged_rows(path):
    changed(path, _set("loss", 3, 1.0))
    text = as_text(read_status(path))
    assert "8 tasks, 6 done, 0 pending, 1 failed, 1 damaged" in text
    assert "damaged: row 3; damaged rows are not used" in text
    sentences = missing(aggregate(path))
    assert any("r.h5 is damaged in row 3" in sentence for sentence in sentences)
    assert "\n\n6 loops of 8 tasks: " in write_page(aggregate(path), {})
    with pytest.warns(UserWarning, match="damaged in row 3"):
        results = adhesis.open(path)
    assert repr(results).endswith("6 done, 1 failed, 0 pending, 1 damaged>")
    assert int(np.isnan(results.dataset.loss).sum()) == 2
    assert not (results.dataset.loss == 1.0).any()
    assert len(results.jumps) > 0


def test_a_run_says_that_it_computes_damaged_rows_again(damage, path):
    changed(path, _set("loss", 3, 1.0))
    said: list[str] = []
    engine = fake_engine("fail=0.8:0.04:1")
    summary = run_campaign(
        damage.campaign, path, options=Options(patience=0.0), say=said.append, engine=engine
    )
    assert summary.computed == 1
    assert f"{path} is damaged in row 3; this run computes damaged rows again" in said
    assert differences(path, damage.sound) == []


def test_a_merge_takes_a_damaged_row_from_another_file(damage, path, tmp_path):
    other = shutil.copy(damage.sound, tmp_path / "other.h5")
    changed(path, _set("loss", 3, 1.0))
    changed(other, _set("loss", 5, 1.0))
    merged = merge([path, other], tmp_path / "all.h5")
    assert len(merged.doubts) == 2
    assert "damaged in row 3" in merged.doubts[0]
    assert differences(tmp_path / "all.h5", damage.sound) == []
    merged = merge([other], path)  # into the damaged file itself
    assert merged.taken == 1
    assert [doubt.partition(" is ")[0] for doubt in merged.doubts] == [str(other)]
    assert differences(path, damage.sound) == []


def test_a_row_that_a_run_computes_again_while_it_is_read_is_not_called_damaged(path, monkeypatch):
    with h5py.File(path) as file:
        status, loss = (file[name].id.get_offset() for name in ("status", "loss"))
    real, looks = reading.row_checksums, []

    def meanwhile(*args):
        if not looks:
            with path.open("r+b") as handle:
                handle.seek(status + 3)
                handle.write(bytes([PENDING]))
                handle.seek(loss + 8 * 3)
                handle.write(np.array([np.nan]).tobytes())
        looks.append(args)
        return real(*args)

    monkeypatch.setattr(reading, "row_checksums", meanwhile)
    with Results(path) as results:
        assert results.status()[3] == PENDING
        assert DAMAGED not in results.status()
    assert len(looks) == 2


def test_rows_of_several_versions_are_told_apart(tmp_path, monkeypatch):
    toml, path = write_campaign(tmp_path), tmp_path / "r.h5"
    campaign, options = load_campaign(toml), Options(patience=0.0, max_failures=2)
    stopped = run_campaign(
        campaign, path, options=options, engine=fake_engine("fail=0.8:*:*")
    ).stopped
    assert stopped == "2 tasks failed (the limit is adhesis run --max-failures 2)"
    assert "versions or processors" not in as_text(read_status(path))
    monkeypatch.setattr("adhesis.ensemble.run.session.processor", lambda: "another")
    summary = run_campaign(campaign, path, options=options, engine=fake_engine(""))
    counts = read_status(path)["computed_by"]
    assert sum(counts.values()) == 6
    assert [count for text, count in counts.items() if text.endswith("processor another")] == [
        summary.computed
    ]
    assert "has rows of 2 versions or processors" in as_text(read_status(path))
    assert any("2 versions or processors" in reported for reported in missing(aggregate(path)))
    merged = merge([path], tmp_path / "all.h5")
    assert any("2 versions or processors" in reported for reported in merged.doubts)
    assert read_status(tmp_path / "all.h5")["computed_by"] == counts
