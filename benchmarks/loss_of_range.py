"""Loss against the range of adhesion, by ``sharp`` and by ``zones``.

    python benchmarks/loss_of_range.py table [--scenes paper 1GPa steel] [--most-nodes 40000]
    python benchmarks/loss_of_range.py figure OUT.png

The first prints the loss of loops at ranges that are shares of ``edge_range``, over that of zero
range: by ``sharp``, which leaves zones out and opens nothing from inside, where it takes the range,
and by ``zones``, where no more than so many nodes resolve the zones. What it printed is kept in
``loss_of_range.txt``, of which the second draws docs/figures/loss_of_range.png.

Scenes of H = 0.8, h_rms = 1 µm, γ = 0.04 J/m², ν = 0.5, Δ/h_max = 0.9: the paper's profile with
seed 1; and n0 = 2, ratio 25, period 2 mm, seed 0 with E = 1 GPa and 200 GPa.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from adhesis import HalfSpace, Problem, make_method, run_loop, self_affine_profile
from adhesis.solver.method import PathError
from adhesis.solver.zones.resolution import node_count

GAMMA, DEPTH = 0.04, 0.9
NARROW = {"period": 2e-3, "n0": 2, "ratio": 25, "seed": 0}
SCENES = {
    "paper": ({"period": 2e-3 * np.pi, "n0": 10, "ratio": 100, "seed": 1}, 1e6),
    "1GPa": (NARROW, 1e9),
    "steel": (NARROW, 2e11),
}
TITLES = {
    "paper": "the paper's scene, E = 1 MPa",
    "1GPa": "ratio 25, E = 1 GPa",
    "steel": "ratio 25, E = 200 GPa",
}
SHARES = (0.01, 0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 0.67, 1.0, 1.5, 2.0)  # of edge_range
HEAD = "scene edge_share range_nm sharp doubts zones from_drops error seconds nodes"
KEPT = Path(__file__).with_suffix(".txt")


def problem_of(scene: str, adhesion_range: float | None = None) -> Problem:
    """Problem of a scene at a range in m."""
    shape, young = SCENES[scene]
    profile = self_affine_profile(0.8, h_rms=1e-6, **shape)
    return Problem(profile, HalfSpace(young, 0.5), GAMMA, adhesion_range=adhesion_range)


def table(scenes: list[str], most_nodes: int, shares: list[float]) -> None:
    """Print a row for each range, and the four ranges of each scene."""
    print(HEAD)
    for scene in scenes:
        zero = run_loop(make_method("sharp", problem_of(scene)), max_penetration=DEPTH)
        ranges = " ".join(f"{1e9 * one:.4g}" for one in (zero.valid_range, *zero.outer_ranges))
        print(f"# {scene}: {zero.loss:.6g} J/m²; valid edge touch turn {ranges} nm", flush=True)
        for share in shares:
            delta = share * zero.edge_range
            problem, cells = problem_of(scene, delta), ["-"] * 6
            nodes = node_count(problem)
            try:
                loop = run_loop(make_method("sharp", problem), max_penetration=DEPTH)
                cells[:2] = f"{loop.loss / zero.loss:.5f}", f"{len(loop.range_warnings())}"
            except (ValueError, PathError) as error:  # the range is refused, or the path is lost
                print(f"# {str(error)[:100]}")
            if nodes <= most_nodes:
                loop = run_loop(make_method("zones", problem), max_penetration=DEPTH)
                lost = loop.loss_from_drops / zero.loss
                cells[2:] = (
                    f"{loop.loss / zero.loss:.5f}", f"{lost:.5f}",
                    f"{loop.loss_error / zero.loss:.2g}", f"{loop.seconds:.0f}",
                )  # fmt: skip
            print(f"{scene} {share:g} {1e9 * delta:.4g}", *cells, nodes, flush=True)


def figure(path: Path) -> None:
    """Draw the kept table."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt
    from matplotlib.ticker import NullFormatter

    lines = KEPT.read_text("utf-8").splitlines()
    figure, panels = plt.subplots(1, len(SCENES), figsize=(11, 3.8), layout="constrained")
    for axes, (scene, title) in zip(panels, TITLES.items(), strict=True):
        (head,) = (line for line in lines if line.startswith(f"# {scene}: "))
        valid, edge, touch, _ = map(float, head.removesuffix(" nm").split()[-4:])
        rows = np.array([line.split() for line in lines if line.startswith(f"{scene} ")])
        numbers = np.where(rows[:, 2:] == "-", "nan", rows[:, 2:]).astype(float)
        delta, sharp, doubts, zones, _, error = numbers.T[:6]
        known, sure = np.isfinite(sharp), doubts == 0
        axes.plot(delta[known], sharp[known], "-", color="#1f5fa8", lw=1, label="sharp")
        axes.plot(delta[sure], sharp[sure], "o", color="#1f5fa8", ms=5, label="without a doubt")
        doubtful = known & ~sure
        open_ = {"mfc": "white", "color": "#1f5fa8", "ms": 5, "label": "doubtful"}
        axes.plot(delta[doubtful], sharp[doubtful], "o", **open_)
        style = {"fmt": "x", "color": "#c4472b", "ms": 7, "label": "zones"}
        axes.errorbar(delta, zones, error, **style)
        for name, at in (("inside", valid), ("edge", edge), ("touch", touch)):
            if at > 2 * delta.max():
                continue
            axes.axvline(at, color="0.6", lw=0.8, zorder=0)
            side = "left" if name == "touch" else "right"
            place = {"transform": axes.get_xaxis_transform(), "rotation": 90, "va": "bottom"}
            axes.text(at, 0.03, f" {name} ", ha=side, fontsize=8, color="0.4", **place)
        axes.set(xscale="log", xlabel="range δ (nm)", title=title)
        axes.set(
            **({"yscale": "log", "ylim": (2e-4, 2)} if scene == "steel" else {"ylim": (0, 1.1)})
        )
        axes.xaxis.set_minor_formatter(NullFormatter())
    panels[0].set_xticks([10, 30, 100, 300], ["10", "30", "100", "300"])
    panels[0].set_ylabel("loss over that of zero range")
    panels[0].legend(frameon=False, fontsize=8, loc="lower left")
    figure.savefig(path, dpi=160)


def main() -> None:
    """Print the table, or draw it."""
    parser = argparse.ArgumentParser(description=__doc__, allow_abbrev=False)
    parser.add_argument("what", choices=["table", "figure"])
    parser.add_argument("out", nargs="?", type=Path)
    parser.add_argument("--scenes", nargs="+", choices=SCENES, default=list(SCENES))
    parser.add_argument("--shares", nargs="+", type=float, default=SHARES)
    parser.add_argument("--most-nodes", type=int, default=40_000)
    args = parser.parse_args()
    if args.what == "table":
        table(args.scenes, args.most_nodes, args.shares)
    else:
        figure(args.out)


if __name__ == "__main__":
    main()
