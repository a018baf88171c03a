"""Stripes of the work of adhesion in a campaign: keys of [material] that may be axes."""

from __future__ import annotations

import pytest

from adhesis.ensemble.campaign.file import parse_campaign
from adhesis.ensemble.errors import InputError
from adhesis.ensemble.task.compute import check_task, make_problem
from adhesis.solver.model.pattern import stripes
from tests.support.campaign_support import campaign_text


def text(keys: str) -> str:
    return campaign_text(work_of_adhesion="[0.04]", poisson=f"0.5\n{keys}")


def test_every_key_of_stripes_may_be_an_axis():
    keys = "stripes = [2, 8]\nstripe_amplitude = [0.1, 0.3]\nstripe_phase = 0.5"
    campaign = parse_campaign(text(keys))
    assert campaign.has_axis("stripes")
    assert campaign.has_axis("stripe_amplitude")
    found = [make_problem(campaign, task).pattern for task in campaign.tasks()]
    wanted = [stripes(n, e, 0.5) for n in (2, 8) for e in (0.1, 0.3)]
    assert all(pattern in wanted for pattern in found)
    assert all(pattern in found for pattern in wanted)


def test_without_stripes_there_is_no_pattern():
    campaign = parse_campaign(text(""))
    assert make_problem(campaign, campaign.tasks()[0]).pattern is None


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ("stripes = 0", r"stripes is 0: it must be"),
        ("stripes = 2\nstripe_amplitude = 1", r"stripe_amplitude is 1: it must be"),
        ("stripes = 2", "the amplitude of stripes of the work of adhesion is missing"),
        ("stripe_amplitude = 0.1", "the number of stripes of the work of adhesion is missing"),
        ("stripe_phase = 1.0", "the number of stripes of the work of adhesion is missing"),
        (
            "stripes = 2\nstripe_amplitude = 0.1\nstrength = 1e8",
            "method is .grid. beside a range or strength of adhesion",
        ),
    ],
)
def test_wrong_stripes_of_a_campaign_are_refused(keys: str, message: str):
    def check() -> None:
        campaign = parse_campaign(text(keys))
        check_task(campaign, campaign.tasks()[0])

    with pytest.raises(InputError, match=message):
        check()
