"""The study beside the product is loaded and read; ``make study`` makes and tests the rest."""

from __future__ import annotations

import importlib
from pathlib import Path

import pytest

from adhesis.ensemble.campaign.file import load_campaign

ROOT = Path(__file__).resolve().parents[2]
STUDY = ROOT / "study"


@pytest.mark.parametrize("path", sorted(STUDY.glob("[!_]*.py")), ids=lambda path: path.stem)
def test_what_the_study_uses_of_adhesis_is_there(path: Path) -> None:
    assert importlib.import_module(f"study.{path.stem}").__doc__


def test_the_campaigns_of_the_study_are_valid() -> None:
    campaigns = [load_campaign(path) for path in sorted((STUDY / "campaigns").glob("*.toml"))]
    assert len(campaigns) > 20
    assert all(campaign.task_count for campaign in campaigns)
