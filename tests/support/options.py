"""Words of a command whose options are replaced by others."""

from collections.abc import Sequence


def replacing(words: Sequence[str], more: Sequence[str]) -> list[str]:
    """Return both, without those options of ``words`` (and their value) that ``more`` gives."""
    given = {word.partition("=")[0] for word in more if word.startswith("--")}
    kept: list[str] = []
    place = 0
    while place < len(words):
        step = 2 if words[place] in given else 1
        if step == 1:
            kept.append(words[place])
        place += step
    return [*kept, *more]
