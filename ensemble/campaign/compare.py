"""Compare two campaigns by meaning: what has grown, and what is another campaign's.

Order, comments and the spelling of numbers do not matter, and neither do the few keys that cannot
change a result.
"""

from __future__ import annotations

from typing import Any

from adhesis.ensemble.campaign.rules import shown
from adhesis.ensemble.campaign.tables import KEYS, TURNING_POINTS, Campaign
from adhesis.ensemble.errors import InputError


def differing(one: Campaign, two: Campaign) -> list[str]:
    """Return the keys ("cycle.load_steps") whose values two campaigns do not share."""
    mine, other = one.values(), two.values()
    return [key for key in mine if mine[key] != other[key]]


def growth(
    path: object, old: Campaign, new: Campaign, here: object = "this campaign"
) -> tuple[str, ...]:
    """Return the keys by which the campaign of a results file grew.

    Keys that cannot change a result are left out. InputError for another campaign, with both values
    of each key that differs otherwise.
    """
    before, after = old.values(), new.values()
    grown, other = [], []
    cells = [{one.identity(task) for task in one.tasks().of_cells()} for one in (old, new)]
    is_kept = cells[0] <= cells[1]
    for key in differing(old, new):
        was, value = before[key], after[key]
        if KEYS[key].metadata["free"]:
            continue
        if _extends(key, was, value) and is_kept:
            grown.append(key)
        else:
            here_there = ("not given" if v is None else shown(v) for v in (value, was))
            other.append(f"{key} is {' here and '.join(here_there)} there")
    if other:
        keys = "; ".join(other)
        raise InputError(f"{path} holds another campaign: {keys} (here: {here}, there: {path})")
    return tuple(grown)


def _extends(key: str, was: Any, now: Any) -> bool:
    if key in ("sweep.realisations", "stop.most"):
        return bool(now > was)
    if key == "stop.relative_error":
        return None not in (was, now) and bool(now < was)
    if key not in ("sweep.hurst", "sweep.work_of_adhesion") and not KEYS[key].metadata["axis"]:
        return False
    # All turning points of a profile belong together: they do not become more.
    if key in [f"cycle.{name}" for name in TURNING_POINTS]:
        return False
    fewer, more = (set(value) if isinstance(value, list) else {value} for value in (was, now))
    return fewer < more
