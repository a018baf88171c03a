"""The kinds of jumps, on the circle."""

from __future__ import annotations

import numpy as np
import pytest

from adhesis.solver.model.jump import JUMP_KINDS, SMALL_SCALE, Jump, classify

NONE = np.empty((0, 2))


def patches(*edges: tuple[float, float]) -> np.ndarray:
    return np.array(edges, dtype=float).reshape(-1, 2)


@pytest.mark.parametrize(
    ("before", "after", "kind", "length"),
    [
        (NONE, patches((0.4, 0.5)), "snap-in", 0.1),
        (patches((0.1, 0.2)), patches((0.1, 0.2), (0.5, 0.6)), "snap-in", 0.1),
        (patches((0.1, 0.2), (0.3, 0.4)), patches((0.1, 0.4)), "merging", 0.3),
        (patches((0.1, 0.4)), patches((0.1, 0.2), (0.3, 0.4)), "splitting", 0.3),
        (patches((0.1, 0.2), (0.5, 0.7)), patches((0.1, 0.2)), "vanishing", 0.2),
        (patches((0.1, 0.2), (0.5, 0.7)), NONE, "pull-off", 0.2),
        (patches((0.1, 0.2), (0.5, 0.6)), patches((0.1, 0.2), (0.5, 0.7)), "spreading", 0.2),
        (patches((0.1, 0.2), (0.5, 0.7)), patches((0.1, 0.2), (0.5, 0.6)), "receding", 0.2),
        # The same patch, written from the other side of the period.
        (patches((0.9, 1.1)), patches((0.9, 1.2)), "spreading", 0.3),
        (patches((0.02, 0.1)), patches((0.98, 1.1)), "spreading", 0.12),
        (patches((0.02, 0.1), (0.8, 0.9)), patches((0.8, 1.1)), "merging", 0.3),
        # Several events: a new patch counts before a merger, a merger before a loss.
        (patches((0.1, 0.2), (0.3, 0.4)), patches((0.1, 0.4), (0.6, 0.7)), "snap-in", 0.3),
        (
            patches((0.1, 0.2), (0.3, 0.4), (0.6, 0.7)),
            patches((0.1, 0.4)),
            "merging",
            0.3,
        ),
    ],
)
def test_kind_and_largest_changed_patch(before, after, kind, length):
    found, largest = classify(before, after, 1.0)
    assert found == kind
    assert largest == pytest.approx(length)


def test_only_running_edges_are_small_scale():
    kinds = {
        kind: Jump("loading", 0.0, 0.0, kind, 1, 1, 0.1, 0.2, 0.1).small_scale
        for kind in JUMP_KINDS
    }
    assert {kind for kind, small in kinds.items() if small} == {"spreading", "receding"}
    assert {"spreading", "receding"} == SMALL_SCALE


@pytest.mark.parametrize("seed", range(8))
def test_kinds_of_many_patches_follow_from_the_pairs_that_overlap(seed):
    """Counted pair by pair on the circle, without the order of the patches."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(1, 7))
    before, after = (
        np.sort(rng.random(2 * n)).reshape(-1, 2) for n in (count, int(rng.integers(1, 7)))
    )
    # a state of which only one edge has moved, every other time
    if seed % 2:
        after = before.copy()
        after[-1, 1] += 1e-3
    shift = rng.random()

    def turned(edges: np.ndarray) -> np.ndarray:
        new = edges + shift - (edges[:, :1] + shift >= 1)
        return new[np.argsort(new[:, 0])]

    over = np.array(
        [[a < d and c < b for c, d in after.tolist()] for a, b in before.tolist()]
    ).astype(int)
    rules = (
        (over.sum(axis=0).min() == 0, "snap-in"),
        (over.sum(axis=0).max() > 1, "merging"),
        (over.sum(axis=1).min() == 0, "vanishing"),
        (over.sum(axis=1).max() > 1, "splitting"),
        (np.diff(after).sum() >= np.diff(before).sum(), "spreading"),
        (True, "receding"),
    )
    expected = next(kind for applies, kind in rules if applies)
    found, length = classify(turned(before), turned(after), 1.0)
    assert found == expected
    if seed % 2:
        assert length == pytest.approx(after[-1, 1] - after[-1, 0])
