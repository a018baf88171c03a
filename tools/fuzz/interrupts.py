"""Interrupts at random moments: what the handler of a signal raises has to arrive unchanged.

A timer (SIGALRM) goes off at a random moment, and its handler raises. Counted is what the work then
ends in: ``raised`` (that exception), ``done`` (it was ready before), ``lost`` (the handler raised,
and nothing arrived), or another exception. Afterwards the same method goes on from a state that is
known, and must give the bits of an uninterrupted loop. The work is done in processes of its own, so
that a crash is counted too.

- ``strong``, ``weak``: loops of ``sharp`` at paper scale, γ = 0.04 and 0.0025 J/m²
- ``grid``: loops of ``grid``
- ``first``: the first loop of a process
- ``trace``, ``pool``: ``loss_of_trace`` in one process, and with processes of its own
- ``campaign``: a campaign in one process

    python tools/fuzz/interrupts.py --seed N [--seconds 60]
"""

import argparse
import itertools
import os
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parent.parent.parent))

import numpy as np

from tools.interrupted import interrupted
from tools.isolated import Isolated

KINDS = ("strong", "weak", "grid", "first", "trace", "pool", "campaign")
LOAD_STEPS = 40
LIMIT = 300.0  # s of CPU time of one interrupt, its set-up included


# ---------------------------------------------------------------------------------- the kinds


def make(method: str, work_of_adhesion: float, ratio: int) -> Any:
    """Return a method for the paper's profile, up to ``ratio`` times its longest wave."""
    from adhesis import Problem, make_method
    from tests.support.scenes import HALF_SPACE, of_paper

    problem = Problem(of_paper(1, ratio=ratio), HALF_SPACE, work_of_adhesion)
    options: dict[str, Any] = {"nodes_per_wave": 8} if method == "grid" else {}
    return make_method(method, problem, **options)  # type: ignore[arg-type]


def bits(state: Any) -> tuple[object, ...]:
    """Numbers of a state, for comparison."""
    return state.mean_stress, state.elastic_energy, state.separation, state.edges.tobytes()


class Loops:
    """Stretches of one loop, each from a load step that is drawn, and loops from the beginning."""

    def __init__(self, method: str, work_of_adhesion: float, ratio: int) -> None:
        from adhesis.solver.loading.loop import run_loop

        self._run_loop = run_loop
        self.method = make(method, work_of_adhesion, ratio)
        self.passed: list[tuple[float, Any]] = []
        started = time.monotonic()
        self._loop(lambda _, drive, state: self.passed.append((drive, state)))
        self.step = (time.monotonic() - started) / len(self.passed)

    def _loop(self, progress: Any = None) -> None:
        self._run_loop(self.method, max_penetration=0.9, load_steps=LOAD_STEPS, progress=progress)

    def _follow(self, first: int, last: int) -> list[Any]:
        """Go on from a load step to another; returns the states there."""
        state = self.passed[first][1]
        states = []
        for drive, _ in self.passed[first + 1 : last + 1]:
            prescribed = self.method.problem.prescribed(drive)
            state = self.method.follow(state, prescribed).states[-1]
            states.append(state)
        return states

    def once(self, rng: np.random.Generator) -> str:
        """Interrupt once; what it ended in, and whether the method still gives the same bits."""
        steps = len(self.passed)
        first = int(rng.integers(-steps // 4, steps - 1))
        delay = float(rng.uniform(0.0, 5 * self.step)) + 1e-6
        if first < 0:
            ended = interrupted(self._loop, delay)
        else:
            ended = interrupted(lambda: self._follow(first, steps), delay)
        again = int(rng.integers(0, steps - 1))
        (state,) = self._follow(again, again + 1)
        if bits(state) != bits(self.passed[again + 1][1]):
            return f"OTHER BITS after {ended}"
        return ended


@dataclass(frozen=True)
class Once:
    """Work that is interrupted as a whole, and what is looked at afterwards."""

    work: Callable[[], object]
    longest: float  # s within which it is interrupted
    check: Callable[[str], str] = str  # what it ended in, with what else is wrong

    def once(self, rng: np.random.Generator) -> str:
        """Interrupt once."""
        return self.check(interrupted(self.work, float(rng.uniform(0.0, self.longest)) + 1e-6))


def first_loop() -> str:
    """Return the bits of a loop; its first is that of a process."""
    from adhesis.solver.loading.loop import run_loop

    return run_loop(make("sharp", 0.04, 4), max_penetration=0.8, load_steps=4).loss.hex()


def trace(processes: int) -> Callable[[], object]:
    """Return ``loss_of_trace`` of a small trace."""
    from adhesis.ensemble.trace.answer import loss_of_trace
    from adhesis.ensemble.trace.prepare import prepare_trace
    from adhesis.ensemble.trace.reading.measured_trace import Trace
    from adhesis.solver.model.half_space import HalfSpace
    from adhesis.solver.model.profile import self_affine_profile

    profile = self_affine_profile(0.8, period=1e-3, n0=4, ratio=6, seed=2, h_rms=1e-6)
    x = np.linspace(0.0, 1e-3, 400, endpoint=False, dtype=np.float64)
    heights = profile.at(x) + 5e-9 * np.random.default_rng(0).standard_normal(400)
    prepared = prepare_trace(Trace(heights, 1e-3 / 400, "t.txt"))
    contact: dict[str, Any] = {"half_space": HalfSpace(1e6, 0.5), "work_of_adhesion": 0.04}
    return lambda: loss_of_trace(prepared, processes=processes, **contact)


def without_children(ended: str) -> str:
    """Processes that were started must be gone."""
    end = time.monotonic() + 20
    while children() and time.monotonic() < end:
        time.sleep(0.02)  # one whose start was interrupted ends when its input does
    return f"PROCESSES LEFT after {ended}" if children() else ended


def children() -> list[int]:
    """Living processes that this one has started (Linux)."""
    from tests.support.campaign_support import has_ended

    own = Path(f"/proc/self/task/{os.getpid()}/children").read_text().split()
    return [int(pid) for pid in own if not has_ended(int(pid))]


CAMPAIGN = """
profile = { period = 1e-3, n0 = 1, ratio = 16, h_rms = 1e-6 }
material = { young = 1e6, poisson = 0.5 }
sweep = { hurst = [0.7, 0.8], work_of_adhesion = [0.01, 0.04], realisations = 20, seed = 5 }
cycle = { max_penetration = 0.6, load_steps = 8, unloading_until = -3 }
"""


def campaign() -> Once:
    """Return a campaign in this process; its file must be sound and have no failed task."""
    from adhesis.ensemble.aggregate.status import read_status
    from adhesis.ensemble.campaign.file import parse_campaign
    from adhesis.ensemble.run.session import run_campaign

    read = parse_campaign(CAMPAIGN)
    path = Path(tempfile.gettempdir(), f"interrupts-{os.getpid()}.h5")

    def check(ended: str) -> str:
        failed = read_status(path)["failed"] if path.exists() else 0
        for file in path.parent.glob(f"{path.name}*"):
            file.unlink()
        return f"{failed} FAILED TASKS, {ended}" if failed else ended

    return Once(lambda: run_campaign(read, path), 3.0, check)


@cache
def kind_of(name: str) -> Any:
    """Set up what is interrupted."""
    kinds: dict[str, Callable[[], Any]] = {
        "strong": lambda: Loops("sharp", 0.04, 100),
        "weak": lambda: Loops("sharp", 0.0025, 100),
        "grid": lambda: Loops("grid", 0.04, 8),
        "first": lambda: Once(first_loop, 3.0, lambda ended: f"{ended} {first_loop()}"),
        "trace": lambda: Once(trace(0), 2.0, without_children),
        "pool": lambda: Once(trace(2), 8.0, without_children),
        "campaign": campaign,
    }
    return kinds[name]()


def once(name: str, seed: int, number: int) -> str:
    """Interrupt once; returns what it ended in."""
    ended: str = kind_of(name).once(np.random.default_rng([seed, KINDS.index(name), number]))
    return ended


def main() -> int:
    """Return 1 if an interrupt did not arrive as what it was."""
    parser = argparse.ArgumentParser(description=__doc__, allow_abbrev=False)
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--seconds", type=float, default=60.0, help="about so long, in all")
    args = parser.parse_args()
    until = time.monotonic() + args.seconds
    wrong = 0
    for place, name in enumerate(KINDS):
        started = time.monotonic()
        end = started + (until - started) / (len(KINDS) - place)
        count: Counter[str] = Counter()
        with closing(Isolated(once, LIMIT)) as isolated:
            for number in itertools.count():
                if count and time.monotonic() > end:
                    break
                how, died = isolated(name, args.seed, number)
                count[how or f"CRASH: {died}"] += 1
                if name == "first" and not died:
                    isolated.close()
        bad = sum(n for how, n in count.items() if how.split()[0] not in ("raised", "done"))
        bad += name == "first" and len({how.split()[-1] for how in count}) > 1
        wrong += bad
        print(
            f"interrupts: {name}, seed {args.seed}: {count.total()} in "
            f"{time.monotonic() - started:.0f} s, {bad} wrong; {dict(count)}",
            flush=True,
        )
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
