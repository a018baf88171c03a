"""The mixed problem of given edges by its Riemann-Hilbert solution: an oracle for tests.

F = σ + iH[σ] is the boundary value of a function analytic in the unit disc. With T(θ) the product
of sin((θ-a)/2) sin((θ-b)/2) over all patches, the part beyond full contact is (u + τ)/sqrt(T), u a
principal value integral of sqrt(T) σ_full over the gaps and τ a trigonometric polynomial fixed by
the closure of every gap and by the mean gap. Gauss-Chebyshev nodes in each gap; cost N². Stresses
in units of E*/2, lengths of 1/q0.
"""

import numpy as np
from scipy.fft import dct

from adhesis.solver.references.full_contact import full_contact_stress


def explicit_solution(stress, gaps, separation, nodes):
    """Return p = 2p̄/E* and the opening C at every gap end, shape (L, 2), for L gaps.

    ``stress`` is a function θ → 2σ_full/E*, ``gaps`` has shape (L, 2).
    """
    c, _, slope = _solve(stress, gaps, separation, nodes)
    # near an end t' = (dt/dθ half)/(half sqrt(1-x²)), t = C sqrt(r): |t'| = C/(2 sqrt(r))
    half = np.diff(gaps, axis=1)[:, 0] / 2
    factor = 2 * np.sqrt(half / 2) / half
    return c, np.stack([slope[:, -1] * factor, -slope[:, 0] * factor], axis=1)


def scaled_stress(profile):
    """Return the function θ → 2σ_full/E*."""
    return lambda theta: full_contact_stress(profile, 2.0, theta / profile.q0)


def _solve(stress, gaps, separation, nodes):
    """Constants, θ and dt/dx sqrt(1-x²) at Lobatto nodes x = cos(jπ/N), right ends first."""
    count = len(gaps)
    centre, half = gaps.mean(axis=1), np.diff(gaps, axis=1)[:, 0] / 2
    edges = gaps.ravel()

    def product(theta):
        """T up to sign, scaled by 2 per factor; positive in the gaps."""
        return np.abs(np.prod(2 * np.sin((theta[:, None] - edges) / 2), axis=1))

    def kernel(x):
        return 1 / np.tan(x / 2) if count % 2 == 0 else 1 / np.sin(x / 2)

    j = np.arange(nodes)
    source_x = np.cos((j + 0.5) * np.pi / nodes)
    target_x = np.cos(np.arange(nodes + 1) * np.pi / nodes)  # Lobatto: ends included
    sign = (-1.0) ** np.arange(count)
    phi = centre[:, None] + half[:, None] * source_x
    root = np.sqrt(product(phi.ravel()).reshape(phi.shape))
    # ∫ D κ dφ with D ∝ sqrt(1-x²): first-kind rule, weight π/N · sqrt(1-x²)
    weight = half[:, None] * np.sqrt(1 - source_x**2) * np.pi / nodes
    strength = sign[:, None] * root * stress(phi.ravel()).reshape(phi.shape) * weight

    theta = centre[:, None] + half[:, None] * target_x
    # gap by gap, as all at once may take gigabytes
    apart = (of_gap[:, None] - phi.ravel() for of_gap in theta)
    u = np.stack([kernel(x) @ strength.ravel() for x in apart]) / (-2 * np.pi)
    basis = [np.prod(np.sin((theta[..., None] - centre) / 2), axis=-1)]
    for k in range(count):
        others = np.delete(centre, k)
        rest = np.prod(np.sin((theta[..., None] - others) / 2), axis=-1)
        basis.append(np.cos((theta - centre[k]) / 2) * rest)
    basis = np.stack(basis)

    # T = (own ends) · (rest): own ends give 1/sqrt(1-x²), the rest is smooth in the gap.
    smooth = np.empty_like(theta)
    for k in range(count):
        others = np.delete(edges, [2 * k, 2 * k + 1])
        rest = np.abs(np.prod(2 * np.sin((theta[k][:, None] - others) / 2), axis=1))
        x = half[k] * (1 - target_x) / 2
        y = half[k] * (1 + target_x) / 2
        own = 4 * np.sinc(x / np.pi) * np.sinc(y / np.pi) * half[k] ** 2 / 4
        smooth[k] = np.sqrt(rest * own)
    ends = np.ones(nodes + 1)
    ends[[0, -1]] = 0.5
    rule = np.pi / nodes * ends  # Lobatto-Chebyshev for ∫ g/sqrt(1-x²) dx

    def closure(w):
        """∫_gap t' of each gap, and the sum of ∫ t, for t' = -sign·w/sqrt(T)."""
        slope = -sign[:, None] * w / smooth * half[:, None]
        closed = slope @ rule
        mean = -np.sum((slope * half[:, None] * target_x) @ rule)
        return np.append(closed, mean)

    matrix = np.stack([closure(b) for b in basis], axis=1)
    right = -closure(u)
    right[-1] += 2 * np.pi * separation
    c = np.linalg.solve(matrix, right)
    w = u + np.tensordot(c, basis, axes=1)
    return c, theta, -sign[:, None] * w / smooth * half[:, None]


def between(spans):
    """Return what lies behind each of the spans of a period of 2π, shape (L, 2)."""
    return np.stack([spans[:, 1], np.append(spans[1:, 0], spans[0, 0] + 2 * np.pi)], axis=1)


def explicit_nodes(profile, gaps, least_nodes=96):
    """Return how many nodes every gap has in :func:`explicit_openings`."""
    widest = float(np.diff(gaps, axis=1).max()) / 2
    patch = np.diff(between(gaps), axis=1)[:, 0]
    # a narrow patch beside a wide gap asks for nodes as dense as it is, and 1/sqrt of it suffices
    narrow = float(np.sqrt(widest / patch.min()))
    return int(np.ceil(max(least_nodes, 12 * widest * profile.highest_harmonic, 12 * narrow)))


def explicit_openings(profile, gaps, separation, least_nodes=96):
    """Return θ and the opening q0 t of every gap, each of shape (L, nodes + 1).

    From the profile's own coefficients, for gaps and separation in units of 1/q0: nothing of the
    method ``sharp`` takes part. The nodes are so dense that the shortest wave has 24 at least.
    """
    nodes = explicit_nodes(profile, gaps, least_nodes)
    _, theta, slope = _solve(scaled_stress(profile), gaps, separation, nodes)
    # x = cos φ: dt/dφ = -slope, with t = 0 at φ = 0; slope is a polynomial in x, a cosine series
    series = dct(slope, type=1, axis=1) / nodes
    series[:, [0, -1]] /= 2
    n = np.arange(1, nodes)
    phi = np.arange(nodes + 1) * np.pi / nodes
    opening = -(series[:, 1:-1] / n) @ np.sin(np.multiply.outer(n, phi))
    return theta[:, ::-1], opening[:, ::-1]
