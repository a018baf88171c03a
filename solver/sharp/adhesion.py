"""Laws of adhesion: that of a problem, and what is checked of a law of one's own."""

from __future__ import annotations

import numpy as np

from adhesis.solver._kernels import Adhesion, ProfileAdhesion
from adhesis.solver.model.problem import Problem
from adhesis.solver.model.profile import MIRRORED, Array
from adhesis.solver.sharp.gap.full_contact_stress import StressSource
from adhesis.solver.sharp.symmetry import Symmetry

_PLACES = 2 * np.pi * (np.arange(97) + 0.37) / 97  # θ at which a law is looked at
_STEP = 1e-4  # of the shortest wave: between values whose difference is compared with a slope
_AGREE = 1e-3  # of the largest w, and per wave number of the largest slope that it may have


def symmetry_of(problem: Problem, own: Adhesion | None, near: float) -> Symmetry:
    """Return the symmetry of a problem, as far as a law of one's own has it, too."""
    parts, axes = problem.equal_parts, problem.profile.q0 * problem.mirror_axes
    if own is None:
        return Symmetry(parts, axes, near)

    def works(theta: Array) -> Array:
        return np.array([[own.work(at, recedes)[0] for at in theta] for recedes in (False, True)])

    here = works(_PLACES)

    def is_same_at(theta: Array) -> bool:
        return bool(np.abs(works(theta) - here).max() < MIRRORED * here.max())

    shared = [n for n in range(1, parts + 1) if parts % n == 0]
    shared = [n for n in shared if is_same_at(_PLACES + 2 * np.pi / n)]
    mirrored = np.array([is_same_at(2 * axis - _PLACES) for axis in axes], dtype=bool)
    return Symmetry(max(shared, default=1), axes[mirrored], near)


def adhesion_of(problem: Problem, source: StressSource) -> Adhesion:
    """Return the law of adhesion of a problem."""
    ratio = problem.gamma_open / problem.work_of_adhesion if problem.pinning > 0 else 1.0
    pattern = problem.pattern
    bounds = (pattern.least, pattern.largest) if pattern else (1.0, 1.0)
    return ProfileAdhesion(source.panels, ratio, *bounds)


def check_adhesion(adhesion: Adhesion, problem: Problem, source: StressSource) -> None:
    """Check a law of one's own against its contract (``kernels/edge_law.hpp``) at some places.

    Raises
    ------
    ValueError
        If w is not positive, not within its bounds, or not of period 2π, a slope is not that of w,
        an integral not that of w, w of a receding edge is smaller, or differs although the law does
        not pin; or if a law that pins is to act over a range.
    """
    if adhesion.pins and np.isfinite(problem.strength):
        raise ValueError("the law of adhesion pins edges: it cannot act over a range, too")
    step = _STEP * 2 * np.pi / source.top
    theta = _PLACES
    stretch = np.sqrt(1 + problem.profile.at(theta / problem.profile.q0, 1) ** 2)
    works = []
    for recedes in (False, True):
        how = "recedes" if recedes else "advances"
        work, slope = np.array([adhesion.work(at, recedes) for at in theta]).T
        later, before, next_period = (
            np.array([adhesion.work(at, recedes)[0] for at in theta + way])
            for way in (step, -step, 2 * np.pi)
        )
        ahead, behind = (
            np.array([adhesion.work_up_to(at + way, recedes) for at in theta])
            for way in (step, -step)
        )
        near = _AGREE * np.abs(work).max()
        as_returned = np.abs((later - before) / (2 * step) - slope) < near * source.top
        for holds, rule in (
            (work > 0, "must be positive"),
            (work > adhesion.least - near, f"must be at least {adhesion.least:g}, its least"),
            (
                work < adhesion.largest * stretch + near,
                f"must be at most {adhesion.largest:g}, its largest, times sqrt(1 + h'²)",
            ),
            (np.abs(next_period - work) < near, "must have the period 2π"),
            (as_returned, "must have the slope that work returns with it"),
            (
                np.abs((ahead - behind) / (2 * step) - work) < near,
                "must be the derivative of work_up_to",
            ),
        ):
            if not holds.all():
                at = theta[~holds][0]
                raise ValueError(
                    f"the law of adhesion at θ = {at:.6g}, of an edge that {how}: w {rule}"
                )
        works.append(work)
    advances, recedes_at = works
    if (recedes_at < advances).any():
        raise ValueError("the law of adhesion: an edge that recedes must not have a smaller w")
    if not adhesion.pins and (recedes_at != advances).any():
        raise ValueError(
            "the law of adhesion: edges that recede have another w than those that advance; such a "
            "law must pin"
        )
