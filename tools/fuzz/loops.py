"""Hostile loops: random scenes far from the ordinary, each followed under a time limit and judged.

A scene is drawn from the seed and its number alone; what repeats one is printed. Judged is that the
loop ends in time and without a crash; that stresses, energies and losses are finite, drops are not
negative, and states come in order; that surfaces nowhere overlap and contact is not lost below
s = h_max; that loop integral and sum of drops agree within ``loss_error``; for every fifth scene
that a run a thousand times as accurate agrees within both errors, where nothing raced; and for
every twentieth that ``grid`` does. A path that is refused (PathError) is counted.
"""

from __future__ import annotations

import argparse
import multiprocessing as mp
import os
import sys
import time
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parent.parent.parent))

import numpy as np

from adhesis import (
    HalfSpace,
    LoopResult,
    Problem,
    make_method,
    run_loop,
    self_affine_profile,
)
from solver.method import ContactState, PathError

LIMIT = 120.0  # s of one scene
TIGHT = 5
GRID = 20


@dataclass(frozen=True)
class Scene:
    """One hostile loop; γ is ``g`` times E* h_rms² q0 n0."""

    hurst: float
    n0: int
    ratio: int
    seed: int
    amplitudes: str
    h_rms: float
    g: float
    max_penetration: float
    load_steps: int
    accuracy: float

    def problem(self) -> Problem:
        """Period 2 mm, E = 1 MPa, ν = 0.5."""
        profile = self_affine_profile(
            self.hurst, period=2e-3, n0=self.n0, ratio=self.ratio, seed=self.seed,
            h_rms=self.h_rms, amplitudes=self.amplitudes,  # type: ignore[arg-type]
        )  # fmt: skip
        half_space = HalfSpace(1e6, 0.5)
        gamma = self.g * half_space.modulus * self.h_rms**2 * profile.q0 * self.n0
        return Problem(profile, half_space, gamma)


def draw(seed: int, number: int) -> Scene:
    """Draw the scene of a number."""
    rng = np.random.default_rng([seed, number])
    kind = rng.integers(6)
    depth = float(rng.uniform(0.05, 0.99))
    if kind == 0:
        depth = float(10 ** rng.uniform(-4, -1))
    elif kind == 1:
        depth = 1 - float(10 ** rng.uniform(-6, -1))
    n0 = int(rng.integers(1, 9))
    ratio = int(min(np.ceil(10 ** rng.uniform(0, 1.8)), 250 // n0))
    return Scene(
        hurst=round(float(rng.uniform(0.2, 0.95)), 3),
        n0=n0,
        ratio=max(1, ratio),
        seed=int(rng.integers(10**6)),
        amplitudes=str(rng.choice(["deterministic", "rayleigh"])),
        h_rms=float(10 ** rng.uniform(-7, -5) if kind != 2 else 10 ** rng.uniform(-5, -3.7)),
        g=float(10 ** (rng.uniform(-1.5, 0.8) if kind != 3 else rng.uniform(-5, -1.5))),
        max_penetration=depth,
        load_steps=int(rng.integers(1, 60)),
        accuracy=float(rng.choice([1e-2, 1e-3, 1e-4])),
    )


def followed(scene: Scene, accuracy: float, name: str = "sharp") -> tuple[LoopResult, list[str]]:
    """Loop of a scene, and what is wrong with it."""
    problem = scene.problem()
    method = make_method(name, problem, accuracy=accuracy)  # type: ignore[arg-type]
    states: list[ContactState] = []
    loop = run_loop(
        method,
        max_penetration=scene.max_penetration,
        load_steps=scene.load_steps,
        on_state=lambda _, state: states.append(state),
    )
    wrong = []
    h_max = problem.profile.h_max
    for what in ("separation", "mean_stress", "energy", "contact_fraction"):
        if not np.all(np.isfinite(getattr(loop, what))):
            wrong.append(f"{what} is not finite")
    if min((j.energy_drop for j in loop.jumps), default=0.0) < 0:
        wrong.append("an energy drop is negative")
    if loop.loss < -loop.loss_error:
        wrong.append(f"the loss {loop.loss:.3e} is negative beyond its error {loop.loss_error:.1e}")
    if abs(loop.loss - loop.loss_from_drops) > loop.loss_error:
        wrong.append(f"audit {loop.audit_residual:.1e} beyond loss_error {loop.loss_error:.1e}")
    for branch, sign in (("loading", -1), ("unloading", 1)):
        s = loop.separation[loop.branch == branch]
        back = float(np.max(-sign * np.diff(s), initial=0.0)) / h_max
        if back > 1e-12:
            wrong.append(f"{branch}: the path steps back by {back:.1e} h_max")
    lost = loop.separation[(loop.patches == 0)]
    if np.min(lost) < h_max * (1 - 1e-6):
        wrong.append(f"contact is lost at s = {np.min(lost) / h_max:.6f} h_max")
    rng = np.random.default_rng(0)
    in_contact = [state for state in states if state.patches]
    nodes = 1 << int(np.ceil(np.log2(24 * problem.profile.highest_harmonic + 64)))
    if name == "sharp":
        for k in rng.choice(len(in_contact), min(6, len(in_contact)), replace=False):
            least = float(method.fields(in_contact[k], nodes).gap.min()) / h_max
            if least < -1e-6:
                wrong.append(f"surfaces overlap by {-least:.1e} h_max")
    return loop, wrong


def judge(scene: Scene, number: int) -> dict[str, Any]:
    """Follow a scene and say what came of it."""
    started = time.process_time()
    found: dict[str, Any] = {"wrong": [], "kind": "loop"}
    try:
        loop, found["wrong"] = followed(scene, scene.accuracy)
        found["races"] = loop.races
        if number % TIGHT == 0:
            found["kind"] = "tight"
            tight, _ = followed(scene, 1e-3 * scene.accuracy)
            off = abs(loop.loss - tight.loss)
            found["ratio"] = loop.loss_error / max(off, 1e-300)
            if off > loop.loss_error + tight.loss_error and not (loop.races or tight.races):
                found["wrong"].append(
                    f"loss {loop.loss:.6e} is {off:.1e} from the tight run's, loss_error "
                    f"{loop.loss_error:.1e} and {tight.loss_error:.1e}"
                )
        elif number % GRID == 1 and scene.n0 * scene.ratio <= 40 and scene.g > 0.03:
            found["kind"] = "grid"
            coarse, _ = followed(scene, 1e-3, "grid")
            off = abs(loop.loss - coarse.loss)
            if off > loop.loss_error + max(coarse.loss_error, 0.02 * loop.loss) and not loop.races:
                found["wrong"].append(f"loss {loop.loss:.6e}, grid {coarse.loss:.6e}")
    except PathError as error:
        found["kind"] = f"PathError: {str(error).split(' at ')[0][:60]}"
    except Exception as error:
        found["wrong"] = [f"{type(error).__name__}: {error}"]
    found["seconds"] = time.process_time() - started
    return found


def _work(tasks: Any, results: Any) -> None:
    for seed, number in iter(tasks.get, None):
        results.put((number, judge(draw(seed, number), number)))


class Worker:
    """A process that judges scenes, and can be ended."""

    def __init__(self) -> None:
        context = mp.get_context("spawn")
        self.tasks, self.results = context.Queue(), context.Queue()
        self.process = context.Process(target=_work, args=(self.tasks, self.results), daemon=True)
        self.process.start()

    def judge(self, seed: int, number: int) -> dict[str, Any]:
        """Judge one scene; a process that dies or takes too long is a failure."""
        self.tasks.put((seed, number))
        end = time.monotonic() + LIMIT
        while time.monotonic() < end:
            try:
                found: dict[str, Any] = self.results.get(timeout=0.5)[1]
                return found
            except Exception:
                if not self.process.is_alive():
                    return {"wrong": [f"the process died: {self.process.exitcode}"], "kind": "died"}
        self.process.kill()
        self.process.join()
        return {"wrong": [f"not done after {LIMIT:.0f} s"], "kind": "late"}


def main() -> int:
    """Return 1 if a scene came out wrong."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--seconds", type=float, default=600.0)
    parser.add_argument("--scenes", type=int, default=10**9, help="at most so many")
    parser.add_argument("--number", type=int, help="this scene alone")
    args = parser.parse_args()
    if args.number is not None:
        print(draw(args.seed, args.number))
        found = judge(draw(args.seed, args.number), args.number)
        print(found)
        return int(bool(found["wrong"]))
    end, shown = time.monotonic() + args.seconds, time.monotonic()
    worker = Worker()
    kinds: Counter[str] = Counter()
    failures = races = number = 0
    ratios = []
    for number in range(args.scenes):
        if time.monotonic() > end and number:
            break
        found = worker.judge(args.seed, number)
        if not worker.process.is_alive():
            worker = Worker()
        kinds[found["kind"]] += 1
        races += bool(found.get("races"))
        ratios += [found["ratio"]] if "ratio" in found else []
        if found["wrong"]:
            failures += 1
            again = f"python tools/fuzz/loops.py --seed {args.seed} --number {number}"
            print(f"{'; '.join(found['wrong'])}\n    {again}\n    {draw(args.seed, number)}")
        if time.monotonic() - shown > 14:
            shown = time.monotonic()
            print(f"fuzz: {number + 1} loops, {failures} wrong, {races} with races", flush=True)
    print(f"fuzz: {sum(kinds.values())} loops, {failures} wrong, {races} with races; {dict(kinds)}")
    if ratios:
        print(
            f"fuzz: loss_error over the distance from tight runs: median {np.median(ratios):.2g}, "
            f"{np.mean(np.array(ratios) < 1):.1%} below 1"
        )
    return int(failures > 0)


if __name__ == "__main__":
    sys.exit(main())
