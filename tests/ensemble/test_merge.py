"""Parts of a campaign that were computed apart, joined into one results file."""

import errno

import h5py
import numpy as np
import pytest

from adhesis.ensemble.aggregate.average import aggregate
from adhesis.ensemble.aggregate.status import as_text, read_status
from adhesis.ensemble.campaign.file import load_campaign, parse_campaign
from adhesis.ensemble.campaign.tasks import Part
from adhesis.ensemble.command.main import main
from adhesis.ensemble.errors import InputError, WriteError
from adhesis.ensemble.report.markdown_page import write_page
from adhesis.ensemble.results import layout
from adhesis.ensemble.results.checksum import write_head
from adhesis.ensemble.results.layout import create, merge
from adhesis.ensemble.results.read import Results
from adhesis.ensemble.results.schema import DONE, FAILED, PENDING
from adhesis.ensemble.results.write import Writer
from tests.support.campaign_support import campaign_text, differences, run_python, write_campaign
from tests.support.fake_run import fake_result, run_file
from tests.support.synthetic_results import sign

CAMPAIGN = campaign_text(realisations="3")


def computed(path, part="1/1", text=CAMPAIGN, skip=(), fail=()):
    """Write the results file of a part with made-up rows; some left out, some failed."""
    campaign, share = parse_campaign(text), Part.parse(part)
    create(path, campaign, part=share)
    with Writer(path) as writer:
        for row, task in enumerate(campaign.tasks(share)):
            whole = int(campaign.rows(share)[row])
            if whole in fail:
                writer.write_failure(row, "ValueError: no", 1.0)
            elif whole not in skip:
                writer.write_result(row, fake_result(campaign, task))
    return path


def parts(folder, count, **others):
    return [computed(folder / f"p{k}.h5", f"{k}/{count}", **others) for k in range(1, count + 1)]


def test_parts_merged_equal_the_file_of_one_run(tmp_path, capsys):
    path, whole = write_campaign(tmp_path), tmp_path / "whole.h5"
    run_file(path, whole)
    names = [tmp_path / f"part{k}.h5" for k in (1, 2)]
    for k, name in enumerate(names, start=1):
        run_file(path, name, part=Part(k, 2))
    assert main(["merge", *map(str, reversed(names)), "--out", str(tmp_path / "all.h5")]) == 0
    assert "8 rows taken over from 2 files; 8 of 8 tasks done" in capsys.readouterr().out
    assert differences(tmp_path / "all.h5", whole) == []
    with h5py.File(tmp_path / "all.h5") as one, h5py.File(whole) as two:
        assert set(one.attrs) == set(two.attrs)
        for name in ("campaign", "commit", "numpy", "adhesis_version", "seed"):
            assert one.attrs[name] == two.attrs[name]


def test_a_merge_is_resumed_and_grown(tmp_path):
    """Missing parts come later; then the campaign gains realisations, and parts of those."""
    one, two, three = parts(tmp_path, 3)
    out = tmp_path / "all.h5"
    assert merge([one, three], out).done == 8
    assert merge([two, one], out).taken == 4
    assert differences(out, computed(tmp_path / "whole.h5")) == []
    path = write_campaign(tmp_path, realisations="4", hurst="[0.7, 0.75, 0.8]")
    assert run_file(path, out).computed == 12
    assert differences(out, computed(tmp_path / "larger.h5", text=path.read_text())) == []
    # Parts of the smaller campaign still fit into the larger file.
    assert merge([two], out).taken == 0


def test_rows_stay_sound_when_a_number_of_the_campaign_becomes_an_axis(tmp_path):
    out = computed(tmp_path / "all.h5", skip=(2,))
    part = computed(tmp_path / "part.h5")
    grown = write_campaign(tmp_path, realisations="3", young="[1e6, 2e6]")
    assert run_file(grown, out).computed == 13
    with Results(out) as results:
        assert results.status().tolist() == [DONE] * 24
    created = tmp_path / "grown.h5"
    create(created, load_campaign(grown))
    assert merge([part], created).done == 12
    with Results(created) as results:
        assert np.bincount(results.status()).tolist() == [12, 12]


def test_what_failed_in_one_part_gives_way_to_what_was_done_in_another(tmp_path):
    first = computed(tmp_path / "a.h5", fail=(3, 4), skip=(9,))
    second = computed(tmp_path / "b.h5", fail=(4, 9), skip=(5,))
    for order in ([first, second], [second, first]):
        out = tmp_path / f"{order[0].stem}.all.h5"
        merged = merge(order, out)
        assert (merged.done, merged.failed) == (10, 2)
        with Results(out) as results:
            assert results.status()[[3, 4, 5, 9]].tolist() == [DONE, FAILED, DONE, FAILED]
            loss = fake_result(results.campaign, results.tasks[3])["loss"]
            assert results.column("loss")[3] == loss


def test_what_failed_in_a_part_is_computed_again_in_that_part(tmp_path):
    path = computed(tmp_path / "a b.h5", "2/3", fail=(1,))
    text = as_text(read_status(path))
    assert text.startswith(f"{path}, part 2/3 of a campaign: ")
    assert f"\nagain: adhesis run CAMPAIGN.toml --out '{path}' --part 2/3 --redo failed" in text
    assert "3 loops of 4 tasks, part 2/3 of the campaign: " in write_page(aggregate(path), {})


def refused(sources, out) -> str:
    before = out.read_bytes() if out.exists() else None
    with pytest.raises(InputError) as caught:
        merge(sources, out)
    assert (out.read_bytes() if out.exists() else None) == before
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_foreign_doubled_and_damaged_parts_are_refused_and_nothing_is_written(tmp_path):
    one, two = parts(tmp_path, 2)
    out = tmp_path / "all.h5"
    other = computed(tmp_path / "o.h5", "2/2", campaign_text(realisations="3", seed="6"))
    assert "sweep.seed is 5 here and 6 there" in refused([one, other], out)
    again = computed(tmp_path / "again.h5", "2/2")
    assert merge([one, two, again], tmp_path / "same.h5").done == 12  # the same bits: no matter
    with h5py.File(again, "r+") as file:
        file["unloading_energy"][5, 2] *= 1 + 1e-15
    sign(again)
    sentence = refused([one, two, again], out)
    assert "again.h5" in sentence
    assert "and their unloading_energy differs" in sentence
    merge([one, two], out)
    assert "differs" in refused([again], out)
    with h5py.File(two, "r+") as file:
        file["seed"][3] += 1
    assert "p2.h5 is damaged or truncated, or another program has changed" in refused([two], out)
    write_head(two)
    sentence = refused([two], out)
    assert "p2.h5 is damaged: its seed is not that of its campaign (" in sentence
    two.write_bytes(two.read_bytes()[:5000])
    assert "damaged or truncated" in refused([one, two], out)
    assert "merged into itself" in refused([one, out], out)
    (tmp_path / "link.h5").symlink_to(one)
    assert "link.h5 is named twice: give each file once" in refused(
        [one, tmp_path / "link.h5"], out
    )
    assert "is part 1/2 of its campaign" in refused([again], one)


def test_a_merge_that_the_disk_refuses_leaves_the_old_file(tmp_path, monkeypatch):
    """Rows are copied into a new file, so that no moment leaves half of a row behind."""
    one, two = parts(tmp_path, 2)
    out = tmp_path / "all.h5"
    merge([one], out)
    before = out.read_bytes()
    places = layout.Source.places

    def full(source, dataset):
        if dataset.name == "loss":
            raise OSError(errno.ENOSPC, "No space left on device")
        return places(source, dataset)

    with monkeypatch.context() as then:
        then.setattr(layout.Source, "places", full)
        with pytest.raises(WriteError, match=r"all\.h5 cannot be written: No space left on device"):
            merge([two], out)
    assert out.read_bytes() == before
    assert not list(tmp_path.glob("*.part"))
    assert merge([two], out).done == 12


def test_a_part_is_what_it_is(tmp_path, capsys):
    path, out = write_campaign(tmp_path), tmp_path / "p.h5"
    run_file(path, out, part=Part(2, 3))
    with Results(out) as results:
        assert results.part == Part(2, 3)
        assert list(results.tasks) == list(results.campaign.tasks())[1::3]
        assert results.column("task").tolist() == [1, 4, 7]
    more = tmp_path / "more.toml"
    more.write_text(campaign_text(realisations="3"))
    for campaign, words, sentence in (
        (path, ("--part", "1/3", "--out", out), "holds part 2/3 of it, and part 1/3 of it"),
        (path, ("--dry-run", "--out", out), "part 2/3 of it, and the whole campaign is wanted"),
        (more, ("--part", "2/3", "--out", out), "a part does not grow"),
    ):
        assert main(["run", str(campaign), *map(str, words)]) == 2
        assert sentence in capsys.readouterr().err


MERGED = """
import sys
from adhesis.ensemble.results import checksum, layout
from adhesis.ensemble.results.layout import merge
from adhesis.ensemble.run.launch import peak_bytes
checksum._BLOCK_BYTES = layout._BLOCK_BYTES = 2**20
half, whole, *parts = sys.argv[1:]
merge(parts[:2], half)
before = peak_bytes()
merge(parts[2:], whole)
print(peak_bytes() - before)
"""


def test_memory_of_a_merge_does_not_grow_with_the_files(tmp_path):
    """Blocks of 1 MB; once files are joined, those twice as large take no more memory."""
    text = campaign_text(realisations="800", load_steps="100").replace("-3", "-1")
    text += "field_penetrations = []\nfield_realisations = 0\n"
    names = []
    for campaign in (parse_campaign(text.replace("800", "400")), parse_campaign(text)):
        for k in (1, 2):
            names.append(tmp_path / f"{campaign.realisations}-{k}.h5")
            create(names[-1], campaign, part=Part(k, 2))
            with h5py.File(names[-1], "r+") as file:
                file["status"][:] = DONE
                file["loss"][:] = np.arange(k - 1, campaign.task_count, 2)
            sign(names[-1])
    half, out = tmp_path / "half.h5", tmp_path / "all.h5"
    done = run_python("-c", MERGED, half, out, *names)
    assert out.stat().st_size - half.stat().st_size > 19e6
    assert int(done.stdout) < 6e6
    with Results(out) as results:
        np.testing.assert_array_equal(results.column("loss"), np.arange(campaign.task_count))
        assert PENDING not in results.status()
