"""Damage results files at random, and judge what every command makes of them (tools/damage.py).

    python tools/fuzz/damage.py --seed N [--seconds T] [--old]
                                [--rows 300] [--head 300] [--cuts 100]

Bits of a random byte are inverted, in bytes that rows hold and in all others, and the file is cut
short at random places. Each case is judged in a process of its own, so that a crash of HDF5 is
seen, within 4 GB of memory. With --seconds new cases are drawn until the time is over. A case is
repeated by its seed, kind and number.
"""

from __future__ import annotations

import argparse
import multiprocessing as mp
import os
import resource
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parent.parent.parent))

import numpy as np

from tools.damage import Damage

KINDS = ("rows", "head", "cuts")
LIMIT = 300.0  # s of one case, also on a busy machine
_MEMORY = 4 * 2**30


def draw(damage: Damage, seed: int, kind: str, number: int) -> tuple[str, bytes]:
    """Return a damaged file and in words what was done to it."""
    rng = np.random.default_rng((seed, KINDS.index(kind), number))
    if kind == "cuts":
        size = int(rng.integers(0, len(damage.content)))
        return f"cut to {size} bytes", damage.content[:size]
    place = int(rng.choice(damage.places(of_rows=kind == "rows")))
    mask = int(rng.integers(1, 256)) if rng.random() < 0.5 else 1 << int(rng.integers(8))
    return f"byte {place} ^ {mask}", damage.flipped(place, mask)


def _judge(damage: Damage, content: bytes, answer: Any) -> None:
    resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, _MEMORY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    answer.send(damage.judge(content))


def judged(damage: Damage, content: bytes) -> tuple[str, str]:
    """Judge a damaged file in a process of its own."""
    context = mp.get_context("fork")
    answer, sender = context.Pipe(duplex=False)
    process = context.Process(target=_judge, args=(damage, content, sender))
    process.start()
    sender.close()
    try:
        return answer.recv() if answer.poll(LIMIT) else ("WRONG", f"longer than {LIMIT:g} s")
    except EOFError:
        process.join()
        return "WRONG", f"the process ended with {process.exitcode}"
    finally:
        process.kill()
        process.join()


def main() -> int:
    """Judge as many cases as are asked for; returns 1 if one is wrong."""
    parser = argparse.ArgumentParser(
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--seconds", type=float, help="draw cases for so long")
    for kind, count in zip(KINDS, (300, 300, 100), strict=True):
        parser.add_argument(f"--{kind}", type=int, default=count, help="number of cases")
    parser.add_argument("--old", action="store_true", help="a file of version 1.0")
    args = parser.parse_args()
    most = {kind: 10**9 if args.seconds else getattr(args, kind) for kind in KINDS}
    end = time.monotonic() + args.seconds if args.seconds else float("inf")
    found: dict[str, Counter[str]] = {kind: Counter() for kind in KINDS}
    wrong = 0
    print(f"seed {args.seed}", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        damage = Damage(Path(folder), old=args.old)
        for rows in [(), *((row,) for row in range(damage.campaign.task_count))]:
            damage.answer(rows)  # once, and not in every process
        for number in range(max(most.values())):
            for kind in KINDS:
                if number >= most[kind] or time.monotonic() > end:
                    continue
                what, content = draw(damage, args.seed, kind, number)
                verdict, reason = judged(damage, content)
                found[kind][verdict] += 1
                if verdict == "WRONG":
                    wrong += 1
                    print(f"{kind} {number}: {what}: {reason}", flush=True)
            if number % 25 == 24:
                print(f"{number + 1} of each kind, {wrong} wrong", flush=True)
            if time.monotonic() > end:
                break
    for kind, counts in found.items():
        reported = ", ".join(f"{count} {verdict}" for verdict, count in sorted(counts.items()))
        print(f"{kind}: {reported or 'none'}")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
