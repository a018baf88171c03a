"""Ranks of a file with a long path, and campaigns that threads run."""

from __future__ import annotations

import asyncio
import sys

import h5py
import pytest

import adhesis
from tests.support.campaign_support import adhesis as run_adhesis
from tests.support.campaign_support import (
    adhesis_here,
    campaign_text,
    differences,
    done_rows,
    write_campaign,
)


@pytest.mark.mpi
def test_ranks_write_a_file_with_a_path_of_any_length(tmp_path):
    """Open MPI 4.1 has buffers of 256 bytes for a path and what it adds."""
    folder = tmp_path.joinpath("d" * 120, "e" * 200)
    folder.mkdir(parents=True)
    path, out, whole = write_campaign(tmp_path), folder / f"{'n' * 240}.h5", tmp_path / "whole.h5"
    assert adhesis_here("run", path, "--out", whole, fake="").returncode == 0
    process = run_adhesis("run", path, "--out", out, ranks=3, fake="")
    assert process.returncode == 0, process.stderr
    assert differences(out, whole) == []
    with h5py.File(out) as file:
        assert set(file["rank"][:]) <= {1, 2}  # rank 0 only handed out
    assert [path.name for path in folder.iterdir()] == [out.name]


# ------------------------------------------------------------------------ from Python, by threads


def small_campaign() -> adhesis.Campaign:
    return adhesis.Campaign(campaign_text(realisations="1", hurst="[0.7]"))


def test_campaigns_run_outside_the_main_thread(tmp_path):
    """As asyncio.to_thread and servers call them; two at once leave stderr as it was.

    With ranks: tests/ensemble/test_notebook.py.
    """
    outs = [tmp_path / f"{i}.h5" for i in range(2)]
    before = sys.stderr

    async def all_of_them() -> list[adhesis.CampaignResults]:
        return await asyncio.gather(*(asyncio.to_thread(small_campaign().run, out) for out in outs))

    one, two = asyncio.run(all_of_them())
    assert [done_rows(out) for out in outs] == [2, 2]
    assert one.dataset.loss.identical(two.dataset.loss)
    assert sys.stderr is before
