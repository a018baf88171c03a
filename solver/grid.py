"""Method ``grid``: contact sets of grid nodes, moved by energy comparison.

Any profile, any contact geometry, no assumption but the grid: the reference for faster methods.
What it does and how accurate it is: docs/methods.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from solver.elasticity import ElasticGrid
from solver.grid_cg import EDGE_COMPLIANCE, Contact, ContactSolver
from solver.grid_edges import Indices, patch_ranges
from solver.grid_relax import Relaxation, ranges_mask
from solver.jumps import Jump, classify
from solver.method import Branch, ContactState, Fields, Method, Path
from solver.problem import Problem

EDGE_OFFSET = 0.190
"""An edge lies this many dx inside the outer face of its contact node (numerical calibration of the
edge stress against K/sqrt(2πr))."""

_DEFAULT_NODES_PER_WAVE = 32
_FEWEST_NODES_PER_WAVE = 8
# A single wave at 32 nodes would be too coarse for its own edges.
_FEWEST_NODES = 1024


@dataclass(frozen=True, eq=False)
class _Patches:
    """What a state remembers: its contact set. Everything else follows from it."""

    first: Indices
    width: Indices


class GridMethod(Method):
    """Contact states on an equally spaced grid.

    Parameters
    ----------
    problem : Problem
    accuracy : float
        Wanted relative error of the loss from the load path: tolerances of stresses, of the
        location of jumps and of the load steps. The grid's own error is set by its nodes.
    nodes_per_wave : int, optional
        Least number of nodes per shortest wave, default 32. The grid has the next power of two, and
        by default no fewer than 1024 nodes.
    nodes : int, optional
        Number of nodes, even, instead of the above.

    Raises
    ------
    ValueError
        If accuracy does not lie between 0 and 1, or the grid is too coarse: fewer than 8 nodes per
        shortest wave.
    """

    name: ClassVar[str] = "grid"

    def __init__(
        self,
        problem: Problem,
        *,
        accuracy: float = 1e-3,
        nodes_per_wave: int | None = None,
        nodes: int | None = None,
    ) -> None:
        super().__init__(problem)
        if not 0 < accuracy < 1:
            raise ValueError(f"accuracy is {accuracy!r}: it must lie between 0 and 1")
        profile = problem.profile
        self.accuracy = accuracy
        self.n = n = _node_count(profile.highest_harmonic, nodes_per_wave, nodes)
        modulus = problem.half_space.modulus
        self.elastic = ElasticGrid(n, profile.period, modulus)
        self.height = profile.heights(n)
        dx = self.elastic.dx
        gamma = problem.work_of_adhesion
        # Gap that adhesion just closes beside an edge: the unit of tolerances on lengths. Without
        # adhesion it is what the curvature makes of half a node.
        closing = float(np.sqrt(2 * gamma * EDGE_COMPLIANCE * dx / modulus))
        curved = 0.125 * dx**2 * float(np.sqrt(profile.m4))
        self.solver = ContactSolver(self.elastic, self.height, max(closing, curved))
        self.relaxation = Relaxation(
            self.elastic,
            self.solver,
            gamma * np.sqrt(1 + profile.slopes(n) ** 2),
            longest_step=max(1, int(0.1 * profile.shortest_wavelength / dx)),
            loose=0.02,
            tight=1e-4,
        )
        self._counters = {"substeps": 0, "bisections": 0}

    # ------------------------------------------------------------------ contract

    def follow(self, state: ContactState, separation: float) -> Path:
        """Follow the quasi-static path from ``state`` to ``separation`` (m).

        See :class:`~solver.method.Method`. A state without contact stays without contact down to
        s = h_max, where the surfaces touch.
        """
        steps = _Steps(self, "loading" if separation <= state.separation else "unloading")
        h_max = self.problem.profile.h_max
        if state.patches == 0:
            if separation > h_max:
                return Path((self.detached(separation),), ())
            contact = steps.first_touch(h_max)
        else:
            contact = self._contact(state)
        steps.run(contact, separation)
        return Path(tuple(steps.states), tuple(steps.jumps))

    def fields(self, state: ContactState, n: int) -> Fields:
        """Stress, displacement and gap of ``state`` on every (nodes/n)-th node.

        Raises
        ------
        ValueError
            If n does not divide the number of nodes.
        """
        if n < 1 or self.n % n:
            raise ValueError(f"fields on {n} nodes: the grid has {self.n}, n must divide that")
        contact = self._contact(state)
        pick = slice(None, None, self.n // n)
        gap = contact.displacement - self.height + state.separation
        gap[contact.mask] = 0.0
        return Fields(
            x=np.arange(n) * (self.problem.profile.period / n),
            height=self.height[pick].copy(),
            stress=contact.stress[pick].copy(),
            displacement=contact.displacement[pick].copy(),
            gap=gap[pick],
        )

    def describe(self) -> dict[str, Any]:
        """Resolution, tolerances and counters."""
        profile = self.problem.profile
        return {
            "nodes": self.n,
            "nodes_per_wave": self.n / max(profile.highest_harmonic, 1),
            "accuracy": self.accuracy,
            "longest_step": self.relaxation.longest_step,
            "sweeps": self.relaxation.sweeps,
            "rejected_sweeps": self.relaxation.rejected,
            "flips": self.relaxation.flips,
            "solves": self.solver.solves,
            "cg_iterations": self.solver.iterations,
            **self._counters,
        }

    # ------------------------------------------------------------------ states

    def _contact(self, state: ContactState) -> Contact:
        """Contact of a state of this method, solved from its contact set alone."""
        contact = self.solver.empty(state.separation)
        patches = state.internal
        if state.patches:
            if not isinstance(patches, _Patches):
                raise ValueError("this state was not made by the method grid")
            contact.mask = ranges_mask(self.n, patches.first, patches.width)
            self.solver.solve(contact, self.relaxation.tight)
        return contact

    def state(self, contact: Contact) -> ContactState:
        """Return the contact state of a solved contact."""
        first, width = patch_ranges(contact.mask)
        if first.size == 0:
            return self.detached(contact.separation)
        dx = self.elastic.dx
        inset = EDGE_OFFSET - 0.5
        left = (first + inset) * dx
        right = (first + width - 1 - inset) * dx
        wrapped = left < 0
        period = self.problem.profile.period
        left, right = left + wrapped * period, right + wrapped * period
        order = np.argsort(left, kind="stable")
        area = float(width.sum()) - 2 * EDGE_OFFSET * first.size
        return ContactState(
            separation=contact.separation,
            edges=np.column_stack((left, right))[order],
            mean_stress=float(contact.stress.mean()),
            elastic_energy=contact.elastic_energy,
            adhesion_energy=self.relaxation.adhesion_energy(contact),
            contact_fraction=max(0.0, area / self.n),
            internal=_Patches(first, width),
        )


class _Steps:
    """Sub-steps of one call of ``follow``, with location of the jumps.

    Between two separations Δs apart the energy of the frozen edges less that of the relaxed ones is
    D. With p̄ the mean stresses, edges that move smoothly give D = ½ λ|Δs||p̄_frozen - p̄_relaxed|,
    so the excess X = D - that is of third order in Δs: a measure of the error of the trapezoidal
    rule, and of the audit. If even D - λ|Δs||p̄_frozen - p̄_relaxed| > 0, the new contact set has
    less energy than the old one already at the old separation: the path has left its local minimum
    there or in between, which is a jump.
    """

    def __init__(self, method: GridMethod, branch: Branch) -> None:
        self.method = method
        self.branch = branch
        self.states: list[ContactState] = []
        self.jumps: list[Jump] = []
        self.energy = method.relaxation.energy
        problem = method.problem
        self.period = problem.profile.period
        self.h_max = problem.profile.h_max
        self.adhesion_scale = problem.work_of_adhesion * self.period

    def first_touch(self, separation: float) -> Contact:
        """Contact at the separation at which the highest crests touch."""
        method = self.method
        before = method.detached(separation)
        self.states.append(before)
        contact = method.solver.empty(separation)
        contact.mask[_crests(method)] = True
        method.solver.solve(contact, method.relaxation.tight)
        if self.energy(contact) < 0:
            relaxed = method.relaxation.relax(contact)
            assert relaxed is not None
            contact = relaxed
            self._jump(before, contact)
        else:
            contact = method.solver.empty(separation)
        return contact

    def run(self, contact: Contact, separation: float) -> None:
        """Go from a relaxed contact to ``separation``, appending states and jumps."""
        accuracy = self.method.accuracy
        start = contact.separation
        step = separation - start
        least = accuracy * self.h_max
        while contact.separation != separation:
            remaining = separation - contact.separation
            if abs(step) >= abs(remaining) * (1 - 1e-9):
                step, target = remaining, separation
            else:
                target = contact.separation + step
            if abs(target - separation) < 1e-12 * self.h_max:
                target = separation
            after, located = self._substep(contact, target, abs(step) > least)
            if after is None:
                self.method._counters["bisections"] += 1
                step /= 2
                continue
            self.method._counters["substeps"] += 1
            if not located:
                self.states.append(self.method.state(after))
            contact = after
            step *= 2
        if not self.states or self.states[-1].separation != separation:
            self.states.append(self.method.state(contact))

    def _substep(
        self, contact: Contact, target: float, divisible: bool
    ) -> tuple[Contact | None, bool]:
        """One step to ``target``: the relaxed contact (None: halve the step), and whether it jumped.

        A jump's two states are appended here.
        """
        method = self.method
        accuracy = method.accuracy
        stride = abs(target - contact.separation)
        frozen = contact.copy()
        frozen.separation = target
        if method.problem.work_of_adhesion == 0:
            return method.relaxation.relax_without_adhesion(frozen), False
        method.solver.solve(frozen, method.relaxation.tight)
        energy = self.energy(frozen)
        stress = float(frozen.stress.mean())
        work = self.period * stride
        noise = 1e-5 * accuracy * self.adhesion_scale

        def jumped(now: float, relaxing: Contact) -> bool:
            change = abs(stress - float(relaxing.stress.mean()))
            return energy - now - work * change > noise

        flips = method.relaxation.flips
        relaxed = method.relaxation.relax(frozen, jumped if divisible else None)
        if relaxed is None:
            return None, False
        flips = method.relaxation.flips - flips
        drop = energy - self.energy(relaxed)
        change = stress - float(relaxed.stress.mean())
        if jumped(self.energy(relaxed), relaxed):
            resolved = work * abs(change) <= max(
                accuracy * drop, 0.02 * accuracy * self.adhesion_scale
            )
            if not resolved and stride > 0.01 * accuracy * self.h_max:
                return None, False
            before = method.state(frozen)
            self.states.append(before)
            self._jump(before, relaxed)
            return relaxed, True
        smooth = 0.5 * work * (change if self.branch == "loading" else -change)
        # One node more or less at each edge is the grid's own unrest, not curvature.
        unrest = (
            0.25 * abs(smooth) * min(1.0, 2 * patch_ranges(frozen.mask)[0].size / max(flips, 1))
        )
        allowed = 0.3 * accuracy * self.adhesion_scale * stride / self.h_max + unrest
        if abs(drop - smooth) > allowed and divisible:
            return None, False
        return relaxed, False

    def _jump(self, before: ContactState, after: Contact) -> None:
        method = self.method
        state = method.state(after)
        kind, length = classify(before.edges, state.edges, self.period)
        self.states.append(state)
        self.jumps.append(
            Jump(
                branch=self.branch,
                separation=after.separation,
                energy_drop=max(0.0, (before.energy - state.energy) / self.period),
                kind=kind,
                patches_before=before.patches,
                patches_after=state.patches,
                contact_before=before.contact_fraction,
                contact_after=state.contact_fraction,
                patch_length=length,
            )
        )


def _node_count(harmonic: int, nodes_per_wave: int | None, nodes: int | None) -> int:
    """Number of nodes of the grid.

    Raises
    ------
    ValueError
        If it is odd or too coarse.
    """
    least = _FEWEST_NODES_PER_WAVE * harmonic
    if nodes is not None:
        if nodes != int(nodes) or nodes % 2 or nodes < least:
            raise ValueError(
                f"nodes is {nodes!r}: the grid needs an even number of at least {least} nodes, "
                f"{_FEWEST_NODES_PER_WAVE} per shortest wave (harmonic {harmonic})"
            )
        return int(nodes)
    if nodes_per_wave is None:
        wanted = max(_DEFAULT_NODES_PER_WAVE * harmonic, _FEWEST_NODES)
    elif nodes_per_wave != int(nodes_per_wave) or nodes_per_wave < _FEWEST_NODES_PER_WAVE:
        raise ValueError(
            f"nodes_per_wave is {nodes_per_wave!r}: it must be a whole number of at least "
            f"{_FEWEST_NODES_PER_WAVE}, or the grid is too coarse for the shortest wave"
        )
    else:
        wanted = int(nodes_per_wave) * harmonic
    return 1 << (wanted - 1).bit_length()


def _crests(method: GridMethod) -> Indices:
    """Nodes nearest to the highest crests of the profile, those of equal height together."""
    profile, dx, n = method.problem.profile, method.elastic.dx, method.n
    h = method.height
    spread = dx**2 * float(np.abs(profile.curvatures(n)).max())
    top = (h >= np.roll(h, 1)) & (h >= np.roll(h, -1)) & (h >= profile.h_max - spread)
    nodes = np.flatnonzero(top)
    x = nodes * dx
    for _ in range(6):
        bend = profile.at(x, 2)
        x = x - np.clip(profile.at(x, 1) / np.where(bend < 0, bend, -np.inf), -dx, dx)
    crest = profile.at(x)
    nodes = nodes[crest >= crest.max() - 1e-9 * profile.h_max]
    # A crest halfway between two nodes has two highest nodes; one of them nucleates.
    return nodes[np.diff(nodes, prepend=nodes[-1] - n) > 1]
