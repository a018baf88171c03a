"""Words of a command whose options are replaced by others; a wave and a small rough scene."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import adhesis.ensemble.command.loop as loop_command
import adhesis.ensemble.command.trace as trace_command
from tests.support.campaign_support import adhesis_here


def forbid_work(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let a command fail that begins to compute."""

    def begins(*_: object, **__: object) -> None:
        raise AssertionError("bad input reached the computation")

    for name in ("run_loop", "run_loops", "run_path"):
        monkeypatch.setattr(loop_command, name, begins)
    monkeypatch.setattr(trace_command, "run_plan", begins)
    monkeypatch.setattr("adhesis.ensemble.bench.benchmark.benchmark", begins)


WAVE_HEIGHTS = 1e-9 * np.cos(2 * np.pi * np.arange(16) / 16)
OF_WAVE = ("--period", 1e-3, "--work-of-adhesion", 2.6e-10, "--young", 1e6, "--poisson", 0.5)

SCENE = [
    "loop", "--hurst", "0.8", "--seed", "4", "--period", "1e-3", "--n0", "3", "--ratio", "6",
    "--work-of-adhesion", "0.005", "--load-steps", "10", "--quiet",
]  # fmt: skip


def replacing(words: Sequence[str], more: Sequence[str]) -> list[str]:
    """Return both, without those options of ``words`` (and their value) that ``more`` gives."""
    given = {word.partition("=")[0] for word in more if word.startswith("--")}
    kept = list(words)
    for option in given.intersection(words):
        place = kept.index(option)
        del kept[place : place + 2]
    return [*kept, *more]


def rough_loop(folder: Path, *words: object) -> tuple[dict[str, Any], str, str]:
    """Run the loop of the scene; returns its document and what it printed, errors last."""
    out = folder / "loop.json"
    done = adhesis_here(*replacing(SCENE, [*map(str, words), "--json", str(out)]))
    assert done.returncode == 0, done.stderr
    return json.loads(out.read_text()), done.stdout, done.stderr
