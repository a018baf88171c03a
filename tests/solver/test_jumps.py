"""The kinds of jumps, on the circle."""

import numpy as np

from adhesis.solver.model.jump import JUMP_KINDS, classify


def states(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Draw patches before and after: all others, one with an edge moved, or one more or less."""
    before, after = (np.sort(rng.random(2 * n)).reshape(-1, 2) for n in rng.integers(1, 7, 2))
    change = rng.integers(3)
    if change == 1:
        after = before.copy()
        after[-1, 1] -= 0.1 * np.diff(after[-1])[0]
    elif change == 2:
        after = before[:-1]
    return (after, before) if rng.integers(2) else (before, after)


def test_kinds_follow_from_the_pairs_that_overlap():
    """Counted pair by pair on the circle, without the order of the patches."""
    kinds = set()
    for seed in range(100):
        rng = np.random.default_rng(seed)
        before, after = states(rng)
        shift = rng.random()

        def turned(edges: np.ndarray, shift: float = shift) -> np.ndarray:
            new = edges + shift - (edges[:, :1] + shift >= 1)
            return new[np.argsort(new[:, 0])]

        over = np.array([[a < d and c < b for c, d in after] for a, b in before], int)
        over = over.reshape(len(before), len(after))
        rules = (
            (len(after) == 0, "pull-off"),
            ((over.sum(axis=0) == 0).any(), "snap-in"),
            ((over.sum(axis=0) > 1).any(), "merging"),
            ((over.sum(axis=1) == 0).any(), "vanishing"),
            ((over.sum(axis=1) > 1).any(), "splitting"),
            (np.diff(after).sum() >= np.diff(before).sum(), "spreading"),
            (True, "receding"),
        )
        expected = next(kind for applies, kind in rules if applies)
        found = classify(turned(before), turned(after), 1.0)
        assert found == expected
        kinds.add(found)
    assert kinds == set(JUMP_KINDS) - {"opening"}
