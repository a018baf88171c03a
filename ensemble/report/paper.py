"""Numbers of the paper: Carbone, Pierro & Recchia, arXiv 1511.08891.

Only what is known first hand stands here. Its Table 1 has nine losses (three H, three γ); eight of
them are not at hand and stay blank rather than guessed.
"""

from __future__ import annotations

REFERENCE = "G. Carbone, E. Pierro, G. Recchia, arXiv 1511.08891 (2015)"

# (H, γ in J/m²) -> dimensionless energy loss, mean of 10 realisations, no error given.
TABLE_1: dict[tuple[float, float], float] = {(0.8, 0.04): 19.36}
TABLE_1_CELLS = 9

# H -> mean square slope that the paper quotes.
M2: dict[float, float] = {0.7: 5.1e-3, 0.8: 2.7e-3, 0.9: 1.5e-3}


def table_1(hurst: float, work_of_adhesion: float) -> float | None:
    """Loss of the paper's Table 1 at (H, γ in J/m²), None if it is not known."""
    for (h, g), value in TABLE_1.items():
        if abs(h - hurst) < 1e-9 and abs(g - work_of_adhesion) < 1e-9:
            return value
    return None


def m2(hurst: float) -> float | None:
    """Mean square slope that the paper quotes for H, None if it gives none."""
    return next((value for h, value in M2.items() if abs(h - hurst) < 1e-9), None)
