"""Damage results files at random, and judge what every command makes of them (tools/damage.py).

    python tools/fuzz/damage.py --seed N [--seconds 60]

Bits of a random byte are inverted, in bytes that rows hold and in all others, and the file is cut
short at random places. Cases are judged in another process, so that a crash of HDF5 is seen, within
4 GB of memory. A case is repeated by its seed, kind and number.
"""

import argparse
import os
import resource
import sys
import tempfile
import time
from collections import Counter
from contextlib import closing
from functools import cache
from itertools import count
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parent.parent.parent))

import numpy as np

from tools.damage import Damage
from tools.isolated import Isolated

KINDS = ("rows", "head", "cuts")
LIMIT = 300.0  # s of CPU time of one case
_MEMORY = 4 * 2**30
_damage = cache(Damage)


def draw(damage: Damage, seed: int, kind: str, number: int) -> tuple[str, bytes]:
    """Return a damaged file and in words what was done to it."""
    rng = np.random.default_rng((seed, KINDS.index(kind), number))
    if kind == "cuts":
        size = int(rng.integers(0, len(damage.content)))
        return f"cut to {size} bytes", damage.content[:size]
    place = int(rng.choice(damage.places(of_rows=kind == "rows")))
    mask = int(rng.integers(1, 256)) if rng.random() < 0.5 else 1 << int(rng.integers(8))
    return f"byte {place} ^ {mask}", damage.flipped(place, mask)


def judged(folder: str, seed: int, kind: str, number: int) -> tuple[str, str, str]:
    """Damage a file and judge it: what was done to it, what it is, and why."""
    resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, _MEMORY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    damage = _damage(Path(folder))
    what, content = draw(damage, seed, kind, number)
    return what, *damage.judge(content)


def main() -> int:
    """Judge cases until the time is over; returns 1 if one is wrong."""
    parser = argparse.ArgumentParser(description=__doc__, allow_abbrev=False)
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--seconds", type=float, default=60.0)
    args = parser.parse_args()
    end = time.monotonic() + args.seconds
    found: dict[str, Counter[str]] = {kind: Counter() for kind in KINDS}
    with tempfile.TemporaryDirectory() as folder, closing(Isolated(judged, LIMIT)) as isolated:
        for number in count():
            for kind in KINDS:
                answer, ended = isolated(folder, args.seed, kind, number)
                what, verdict, reason = answer or ("", "WRONG", ended)
                found[kind][verdict] += 1
                if verdict == "WRONG":
                    print(f"{kind} {number}: {what}: {reason}", flush=True)
            wrong = sum(counts["WRONG"] for counts in found.values())
            if number % 25 == 24:
                print(f"{number + 1} of each kind, {wrong} wrong", flush=True)
            if time.monotonic() > end:
                break
    for kind, counts in found.items():
        print(f"{kind}: {', '.join(f'{n} {verdict}' for verdict, n in sorted(counts.items()))}")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
