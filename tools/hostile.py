"""Hostile scenes: how they are drawn, followed and judged; see tools/fuzz/loops.py."""

import math
import time
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from adhesis import (
    Control,
    HalfSpace,
    LoopResult,
    Method,
    Problem,
    make_method,
    run_loop,
    self_affine_profile,
    stripes,
)
from adhesis.solver._kernels import SearchedGaps
from adhesis.solver.loading.zero_range import DOUBTFUL_EXCESS
from adhesis.solver.method import ContactState, PathError
from adhesis.solver.model.profile import Amplitudes
from adhesis.solver.peaks import highest_peaks
from adhesis.solver.registry import MethodName
from adhesis.solver.sharp.method import SharpMethod
from adhesis.solver.sharp.tolerances import LONGEST_GRIFFITH_CRACK
from tests.support.explicit_solution import between, explicit_nodes, explicit_openings

TIGHT = 4  # every so many scenes are followed again, to 1e-5 or a hundred times as accurately
GRID = 20
_MOST_WAVES = 250  # of the scenes that are not of many patches
_WEAK = 1e-3  # for so weak adhesion accuracy is dear: one in four of these
_LOOKED_AT = 6  # states, and those at jumps
_MOST_BY_WIDTH = 3000  # waves over the root of the narrowest length, for independent openings
_MOST_NODES = 20_000  # of these
_OVERLAP = 1e-6
_TENSION = 1e-3  # relative, of a tension inside patches from fields
_MISSED = 1e-3  # of the range of adhesion
_DECADES = 1e-4  # least strength that is drawn, of the largest tension inside patches
LAWS = ("one", "open", "pattern", "range", "many")
"""Laws of adhesion: one γ, two works, γ(x), a range; ``many`` has one γ and many patches."""
CONTROLS = ("separation", "stiffness", "load")
MOST_DECADES = 0.5
"""Decimal logarithm of the largest γ_open/γ - 1 that is drawn unless another one is asked for."""


@dataclass(frozen=True)
class Scene:
    """One hostile loop; γ is ``g`` times E* h_rms² q0 n0.

    ``strength`` in Pa. ``weakness`` places it between the largest tension inside patches (0) and
    the least strength that is allowed (1), and above 1 it is 1 and the range of adhesion over
    ``edge_range``; :func:`weakened` makes it of that. It is infinite at -1. ``opening`` is
    γ_open/γ, ``stripes`` are number, amplitude and phase of γ(x), and ``stiffness`` is in stress
    scales over h_max, 0 for a load.
    """

    hurst: float
    n0: int
    ratio: int
    seed: int
    amplitudes: Amplitudes
    h_rms: float
    g: float
    max_penetration: float
    load_steps: int
    accuracy: float
    weakness: float = -1.0
    strength: float = math.inf
    opening: float = 1.0
    stripes: tuple[int, float, float] | None = None
    stiffness: float = math.inf

    def problem(self) -> Problem:
        """Period 2 mm, E = 1 MPa, ν = 0.5."""
        profile = self_affine_profile(
            self.hurst, period=2e-3, n0=self.n0, ratio=self.ratio, seed=self.seed,
            h_rms=self.h_rms, amplitudes=self.amplitudes,
        )  # fmt: skip
        half_space = HalfSpace(1e6, 0.5)
        gamma = self.g * half_space.modulus * self.h_rms**2 * profile.q0 * self.n0
        problem = Problem(
            *(profile, half_space, gamma),
            strength=self.strength,
            work_of_adhesion_open=self.opening * gamma,
            pattern=stripes(*self.stripes) if self.stripes else None,
        )
        scale = problem.stress_scale / profile.h_max
        return replace(problem, control=Control(scale * self.stiffness))

    def turn(self, problem: Problem) -> dict[str, float]:
        """Return the turning point as prescribed, for ``run_loop``."""
        stress = self.max_penetration * self.n0 / 2  # roughly that at this penetration
        if self.stiffness == 0:
            return {"max_stress": stress * problem.stress_scale}
        far = 0.0 if math.isinf(self.stiffness) else stress / self.stiffness
        return {"max_penetration": self.max_penetration + far}


def draw(
    seed: int,
    number: int,
    law: str = "one",
    control: str = "separation",
    decades: float = MOST_DECADES,
) -> Scene:
    """Draw the scene of a number: mostly few waves, one in fifty up to 250.

    Where adhesion is weak, thousands of fields go into each jump: few crests there. With a range
    adhesion is mostly weak, as only there tension inside patches reaches the strength. ``many`` are
    scenes of 20 to 80 patches and hundreds of waves. Of two works of adhesion γ_open/γ - 1 is at
    most 10**``decades``.
    """
    if law == "many":
        scene = _draw_many(np.random.default_rng([seed, number, 2]))
    else:
        scene = _draw(np.random.default_rng([seed, number]))
    rng = np.random.default_rng([seed, number, 3])
    if control != "separation":
        held = 0.0 if control == "load" else float(10 ** rng.uniform(-1.5, 2))
        scene = replace(scene, stiffness=held)
    if law == "open" or (law == "pattern" and rng.integers(4) == 0):
        scene = replace(scene, opening=1 + float(10 ** rng.uniform(-2, decades)))
    if law == "pattern":
        count = int(10 ** rng.uniform(0, math.log10(2 * scene.n0 * scene.ratio + 1)))
        pattern = count, float(rng.uniform(0.01, 0.95)), float(rng.uniform(0, 2 * math.pi))
        scene = replace(scene, stripes=pattern)
    return _with_range(scene, np.random.default_rng([seed, number, 1])) if law == "range" else scene


def _with_range(scene: Scene, rng: np.random.Generator) -> Scene:
    g = 10 ** rng.uniform(-4.5, -0.5)
    most = 12 if g < _WEAK else 40
    ratio = max(2, min(scene.ratio, most // scene.n0))  # a single wave has no tension inside
    depth = max(scene.max_penetration, float(rng.uniform(0.6, 0.99)))
    weakness = float(rng.uniform(-0.1, 1))
    if rng.integers(2):
        weakness, g = 1 + float(10 ** rng.uniform(-2.5, 0)), scene.g
    return replace(scene, g=float(g), ratio=ratio, max_penetration=depth, weakness=weakness)


def weakened(scene: Scene) -> Scene:
    """Return a scene with the strength of its ``weakness``.

    The range of adhesion is at most four decades above that below which no patch would open.
    """
    if scene.weakness == -1:
        return scene
    problem = scene.problem()
    loop = run_loop(
        SharpMethod(problem, accuracy=1e-2),
        load_steps=scene.load_steps,
        **scene.turn(problem),
    )
    inside = loop.largest_interior_tension
    longest = LONGEST_GRIFFITH_CRACK * problem.profile.shortest_wavelength * (1 - 1e-9)
    modulus, gamma = problem.half_space.modulus, problem.work_of_adhesion
    least = max(float(np.sqrt(4 * modulus * gamma / (np.pi * longest))), _DECADES * inside)
    if scene.weakness > 1:
        return replace(scene, strength=max(least, gamma / (loop.edge_range * (scene.weakness - 1))))
    if inside <= least:
        return replace(scene, strength=least)
    return replace(scene, strength=inside * (least / inside) ** scene.weakness)


def _draw_many(rng: np.random.Generator) -> Scene:
    return Scene(
        hurst=round(float(rng.uniform(0.7, 0.9)), 3),
        n0=int(rng.integers(8, 15)),
        ratio=int(10 ** rng.uniform(1.55, 2.2)),
        seed=int(rng.integers(10**6)),
        amplitudes="rayleigh",
        h_rms=1e-6,
        g=float(10 ** rng.uniform(-0.6, 0.0)),
        max_penetration=float(rng.uniform(0.6, 0.95)),
        load_steps=int(rng.integers(10, 41)),
        accuracy=1e-3,
    )


def _draw(rng: np.random.Generator) -> Scene:
    kind = rng.integers(6)
    depth = float(rng.uniform(0.05, 0.99))
    if kind == 0:
        depth = float(10 ** rng.uniform(-4, -1))
    elif kind == 1:
        depth = 1 - float(10 ** rng.uniform(-6, -1))
    n0 = int(rng.integers(1, 5 if kind == 3 else 7))
    most = 12 if kind == 3 else int(rng.choice([12, 40, 250], p=[0.82, 0.16, 0.02]))
    ratio = int(min(np.ceil(10 ** rng.uniform(0, 1.8)), most // n0))
    rough = (-5, -3.7) if kind == 2 else (-7, -5)
    weak = (-5, -1.5) if kind == 3 else (-1.5, 0.8)
    return Scene(
        hurst=round(float(rng.uniform(0.2, 0.95)), 3),
        n0=n0,
        ratio=max(1, ratio),
        seed=int(rng.integers(10**6)),
        amplitudes=str(rng.choice(["deterministic", "rayleigh"])),
        h_rms=float(10 ** rng.uniform(*rough)),
        g=float(10 ** rng.uniform(*weak)),
        max_penetration=depth,
        load_steps=int(rng.integers(1, 40)),
        accuracy=float(rng.choice([1e-2, 1e-3, 1e-4], p=[0.3, 0.6, 0.1])),
    )


def follow(
    scene: Scene, accuracy: float, name: MethodName = "sharp"
) -> tuple[LoopResult, list[str], dict[str, float]]:
    """Follow a loop; return it, what is wrong with it, and what is known of the tension inside."""
    problem = scene.problem()
    method = make_method(name, problem, accuracy=accuracy)
    states: list[ContactState] = []
    loop = run_loop(
        method,
        load_steps=scene.load_steps,
        **scene.turn(problem),
        on_state=lambda _, state: states.append(state),
    )
    wrong, found = _of_loop(loop), {}
    if isinstance(method, SharpMethod):
        wrong += _of_states(method, states)
        if math.isfinite(problem.strength):
            found["not held"] = method.nucleation.heals
            missed = 0.0 if found["not held"] else missed_by(method, states)
            if missed > _MISSED * method.nucleation.range + method.nucleation.tolerance:
                wrong.append(f"a touch is missed by {missed / method.nucleation.range:.1e} ranges")
            found["excess"] = _of_fields(method, states)
            found["flagged"] = any("the tension inside patches" in w for w in loop.warnings)
            if found["excess"] > DOUBTFUL_EXCESS * (1 + _TENSION) and not found["flagged"]:
                wrong.append(f"tension of {found['excess']:.3f} strengths inside without a doubt")
    return loop, wrong, found


def missed_by(method: SharpMethod, states: list[ContactState]) -> float:
    """Return how far a gap has closed, at most, beyond where surfaces touch; lengths in 1/q0.

    Nothing is known of the states before, nor of touches that were tried and did not hold.
    """
    missed = 0.0
    for state in states:
        if state.patches:
            method.nucleation.searched, method.nucleation.healed = SearchedGaps(), []
            field = method.edges.field(state.internal.gaps, method.states.prescribed_of(state))
            missed = max(missed, -method.nucleation.minimum(field)[0])
    return missed


def _of_fields(method: SharpMethod, states: list[ContactState]) -> float:
    """Return the largest local maximum of tension at nodes inside patches of some states.

    In units of the strength, from the fields that a method hands out.
    """
    kept = [state for state in states if state.patches]
    rng = np.random.default_rng(1)
    nodes = 1 << int(np.ceil(np.log2(24 * method.problem.profile.highest_harmonic)))
    largest = 0.0
    for k in rng.choice(len(kept), min(_LOOKED_AT, len(kept)), replace=False):
        fields = method.fields(kept[k], nodes)
        tension = np.where(fields.stress != 0, -fields.stress, np.nan)
        # of a gap between two nodes there is no other sign
        middle = kept[k].internal.gaps.mean(axis=1)
        tension[np.rint(middle / (2 * np.pi) * nodes).astype(int) % nodes] = np.nan
        for node in highest_peaks(tension, 1):
            largest = max(largest, float(tension[node]) / method.problem.strength)
    return largest


def _of_loop(loop: LoopResult) -> list[str]:
    """What is wrong with the numbers of a loop."""
    wrong = []
    problem, h_max = loop.problem, loop.problem.profile.h_max
    prescribed = problem.control.prescribed(loop.separation, loop.mean_stress)
    # a load is not carried out of contact
    kept = loop.patches > 0 if problem.control.is_load else np.ones(loop.patches.size, bool)
    prescribed, branches = prescribed[kept], loop.branch[kept]
    for what in ("separation", "mean_stress", "energy", "contact_fraction"):
        if not np.all(np.isfinite(getattr(loop, what))):
            wrong.append(f"{what} is not finite")
    jumps = loop.jumps[:-1] if problem.control.is_load else loop.jumps  # where the solid falls off
    least = min((j.energy_drop for j in jumps), default=0.0)
    if least < -loop.loss_error:
        wrong.append(f"a drop of {least:.1e} J/m² is negative beyond {loop.loss_error:.1e}")
    if loop.loss - loop.closing_drop < -loop.loss_error:
        wrong.append(f"the loss {loop.loss:.3e} is negative beyond its error {loop.loss_error:.1e}")
    if not abs(loop.loss - loop.loss_from_drops) <= loop.loss_error:
        wrong.append(f"audit {loop.audit_residual:.1e} beyond loss_error {loop.loss_error:.1e}")
    for branch, sign in (("loading", -1), ("unloading", 1)):
        x = prescribed[branches == branch]
        back = float(np.max(-sign * np.diff(x), initial=0.0)) / problem.prescribed_range
        if back > 1e-12:
            wrong.append(f"{branch}: the path steps back by {back:.1e}")
    lost = loop.separation[(loop.patches == 0)]
    if not problem.control.is_load and np.min(lost) < h_max * (1 - 1e-6):
        wrong.append(f"contact is lost at s = {np.min(lost) / h_max:.6f} h_max")
    return wrong


def _of_states(method: Method, states: list[ContactState]) -> list[str]:
    """What is wrong with the states: overlaps, by the method's fields and independently of it."""
    profile = method.problem.profile
    nodes = 1 << int(np.ceil(np.log2(24 * profile.highest_harmonic + 64)))
    rng = np.random.default_rng(0)
    at_jumps = [
        k
        for k in range(len(states) - 1)
        if states[k].separation == states[k + 1].separation and states[k].patches
    ]
    chosen = set(rng.choice(len(states), min(_LOOKED_AT, len(states)), replace=False).tolist())
    chosen |= set(rng.choice(at_jumps, min(_LOOKED_AT, len(at_jumps)), replace=False).tolist())
    worst = 0.0
    for k in sorted(chosen):
        if states[k].patches:
            found = method.fields(states[k], nodes).gap.min() / profile.h_max
            worst = min(worst, float(found), independent_clearance(method, states[k]))
    return [f"surfaces overlap by {-worst:.1e} h_max"] if worst < -_OVERLAP else []


def independent_clearance(method: Method, state: ContactState) -> float:
    """Least gap over h_max by the Riemann-Hilbert solution, with what the field's error allows.

    0 where edges are too close to each other for that, or ask for too many nodes.
    """
    profile = method.problem.profile
    edges = state.edges * profile.q0
    gaps = between(edges)
    narrowest = min(float(np.diff(gaps, axis=1).min()), float(np.diff(edges, axis=1).min()))
    if len(gaps) * profile.highest_harmonic / np.sqrt(narrowest) > _MOST_BY_WIDTH:
        return 0.0
    if len(gaps) * explicit_nodes(profile, gaps) > _MOST_NODES:
        return 0.0
    _, opening = explicit_openings(profile, gaps, state.separation * profile.q0)
    room = 10 * getattr(method.report(), "field_tolerance", 0.0)
    return float(opening.min() / (profile.h_max * profile.q0)) + room


def judge(scene: Scene, number: int) -> dict[str, Any]:
    """Follow a scene and say what came of it."""
    started = time.process_time()
    found: dict[str, Any] = {"wrong": [], "kind": "loop"}
    try:
        scene = weakened(scene)
        found |= {"strength": scene.strength}
        found |= {"range": scene.problem().work_of_adhesion / scene.strength}
        loop, found["wrong"], inside = follow(scene, scene.accuracy)
        found |= {"loss": loop.loss, "loss_error": loop.loss_error, "races": loop.races}
        found |= {"audit": loop.audit_residual, "drops": loop.loss_from_drops}
        found |= inside
        many = scene.n0 * scene.ratio > _MOST_WAVES  # of a single jump nothing else shows the error
        if many or number % (TIGHT if scene.g > _WEAK else 4 * TIGHT) == 0:
            found["kind"] = "tight"
            _compare(found, loop, follow(scene, min(1e-5, 1e-2 * scene.accuracy))[0])
        elif (
            number % GRID == 1
            and scene.n0 * scene.ratio <= 40
            and scene.g > 0.03
            and math.isinf(scene.strength)  # ``grid`` knows no range
            and scene.opening == 1  # nor two works of adhesion
        ):
            found["kind"] = "grid"
            _compare(found, loop, follow(scene, max(scene.accuracy, 1e-3), "grid")[0])
    except PathError as error:
        found["kind"] = f"PathError: {str(error).split(' at ')[0][:60]}"
    except Exception as error:
        found["wrong"] = [f"{type(error).__name__}: {error}"]
    found["seconds"] = time.process_time() - started
    return found


def _compare(found: dict[str, Any], loop: LoopResult, other: LoopResult) -> None:
    """Take down how far another loop of the scene is; beyond the errors of both it is wrong."""
    off = abs(loop.loss - other.loss_from_drops)
    found |= {"off": off, "other_error": other.loss_error}
    alike = any("parts of the profile are alike" in text for text in loop.warnings)
    found["raced"] = bool(loop.races or other.races or alike)
    if off > loop.loss_error + other.loss_error and not found["raced"]:
        name = other.method.name
        found["wrong"].append(
            f"loss {loop.loss:.6e} is {off / abs(loop.loss):.1e} from {name}'s, reported are "
            f"{loop.loss_error / abs(loop.loss):.1e} and {other.loss_error / abs(loop.loss):.1e}"
        )
