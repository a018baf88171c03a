"""Compute the energies of pairs of edges that move together, the least stable motions.

Where a patch is about to vanish or a gap to close, its two edges move together; each one alone is
stabilised by the other, and single moves would follow with a delay of a fraction of a node. The
compliance of the two nodes is the 2 × 2 matrix S = V_JJ - V_JΩ (V_ΩΩ)⁻¹ V_ΩJ, Ω without the pair J:
adding the pair costs ½ dx tᵀ S⁻¹ t, removing it releases ½ dx σᵀ S σ.
"""

from __future__ import annotations

from adhesis.solver.grid.contact import Contact
from adhesis.solver.grid.edges import Edges, Indices, Move
from adhesis.solver.grid.lattice import Lattice
from adhesis.solver.model.profile import Array

# Upper bound of |S_12|/S_11 of any pair (0.3 across a patch of three nodes).
COUPLING = 0.6


def pairs(contact: Contact, edges: Edges, lattice: Lattice) -> list[tuple[Move, Move]]:
    """Compute the moves by one node of the pairs of edges of every patch and gap.

    Both moves of a pair have the energy in J/m that the pair releases.

    Pairs that cannot release energy with any possible coupling in S are skipped.
    """
    count = edges.side.size // 2
    dx, adhesion, compliance = lattice.dx, lattice.adhesion, lattice.compliance
    width, left, right = edges.width[:count], edges.gap[:count], edges.gap[count:]
    t = lattice.gap(contact, edges.outer)
    pull = contact.stress[edges.inner]
    factor, gap_rate = lattice.extra_compliance(contact, edges.outer)
    found: list[tuple[Move, Move]] = []

    def may_release(one: int, two: int, cost: Array, nodes: Indices) -> bool:
        """Return False if the pair cannot release energy with a coupling up to ``COUPLING``."""
        adhesive = adhesion[nodes[one]] + adhesion[nodes[two]]
        return bool(cost[one] + cost[two] < COUPLING * dx * adhesive)

    def add(one: int, two: int, direction: int, s: Array) -> None:
        nodes = edges.outer if direction > 0 else edges.inner
        adhesive = float(adhesion[nodes[one]] + adhesion[nodes[two]])
        g1, g2 = float(gap_rate[one]), float(gap_rate[two])
        s11, s22 = float(s[0, 0]) + factor * g1 * g1, float(s[1, 1]) + factor * g2 * g2
        s12 = float(s[0, 1]) + factor * g1 * g2
        if direction > 0:
            a, b = float(t[one]), float(t[two])
            form = (s22 * a * a - 2 * s12 * a * b + s11 * b * b) / (s11 * s22 - s12 * s12)
            release = dx * (adhesive - 0.5 * form)
        else:
            a, b = float(pull[one]), float(pull[two])
            form = s11 * a * a + 2 * s12 * a * b + s22 * b * b
            release = dx * (0.5 * form - adhesive)
        key = int(edges.side[one]), int(edges.inner[one]), int(edges.inner[two]), direction
        first, second = (Move(edge, direction, 1, release, key) for edge in (one, two))
        found.append((first, second))

    for k in range(count):
        w, a, b = int(width[k]), int(left[k]), int(right[k])
        following = (k + 1) % count
        after, before = int(width[following]), int(width[k - 1])
        if count == 1:
            after = before = 0
        elif count == 2:
            before, after = before // 2, after - after // 2
        # The edges of the patch.
        one, two = k, count + k
        if w >= 3 and (count > 1 or a >= 4):
            if may_release(one, two, edges.growth, edges.outer):
                add(one, two, 1, compliance.across_patch(w, a, b, before, after))
            if may_release(one, two, edges.recession, edges.inner):
                add(one, two, -1, compliance.across_patch(w - 2, a + 1, b + 1, before, after))
        # The edges of the gap on its right.
        one, two = count + k, following
        far = int(width[following])
        if count > 1 and b >= 3 and w > 1 and far > 1:
            if may_release(one, two, edges.growth, edges.outer):
                add(one, two, 1, compliance.across_gap(w, b, far))
            if may_release(one, two, edges.recession, edges.inner):
                add(one, two, -1, compliance.across_gap(w - 1, b + 2, far - 1))
    return found
