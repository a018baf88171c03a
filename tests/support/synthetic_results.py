"""Results files with numbers whose averages are known, for the tests of aggregator and report."""

from pathlib import Path

import h5py
import numpy as np

from adhesis.ensemble.campaign.file import parse_campaign
from adhesis.ensemble.campaign.tables import Campaign
from adhesis.ensemble.results.checksum import row_checksums, write_head
from adhesis.ensemble.results.layout import create
from adhesis.ensemble.results.schema import axis_datasets, kept_rows
from adhesis.ensemble.task.dataset import KEPT
from adhesis.ensemble.task.fields import GAP_EDGES, FieldPlan
from adhesis.solver.model.jump import JUMP_KINDS
from tests.support.campaign_support import campaign_text

OF_PAPER = {"period": 6.283185307179586e-3, "n0": 10, "seed": 1}
PATH = {"load_steps": 20, "unloading_until": -2.0}


def text_of(
    hurst=(0.7, 0.8), gamma=(0.01, 0.04), realisations=6, jumps=32, ratio=10, max_penetration=0.9
) -> str:
    """The paper's profile, material and path if ``ratio`` is 100; lists are further axes."""
    values = OF_PAPER | PATH | {"realisations": realisations, "ratio": ratio}
    values |= {"hurst": list(hurst), "work_of_adhesion": list(gamma)}
    values |= {"max_penetration": max_penetration, "jumps": f"{jumps}\nfield_nodes = 256"}
    text = campaign_text(**{key: str(value) for key, value in values.items()})
    return text.replace('[solver]\nmethod = "grid"\nnodes_per_wave = 16\n\n', "")


def campaign(*args, **changes) -> Campaign:
    return parse_campaign(text_of(*args, **changes))


def rows(campaign: Campaign, seed: int = 7) -> dict[str, np.ndarray]:
    """Random but plausible values of every dataset along the task axis; all tasks done."""
    rng = np.random.default_rng(seed)
    tasks = campaign.tasks()
    n, slots = len(tasks), campaign.output.jumps
    hurst = np.array([t.hurst for t in tasks])
    gamma = np.array([t.work_of_adhesion for t in tasks])
    h_max = 3e-6 * (1 + 0.1 * rng.standard_normal(n))
    scale = 0.5 * (1e6 / 0.75) * 1000 * h_max
    up, down = campaign.penetration["loading"], campaign.penetration["unloading"]
    size = np.sqrt(gamma / 0.04)[:, None] * (1 + 0.1 * rng.standard_normal(n))[:, None]
    loading = size * (up - 3 * up * (1 - up)) * 2
    pull_off = -1.2 * size
    stuck = down > pull_off
    unloading = np.where(stuck, (down - 0.9) * 3 + loading[:, -1:], 0.0)
    share = rng.uniform(0.05, 0.3, n)
    top = np.array([campaign.at(t).cycle.max_penetration or 0.9 for t in tasks])
    loss = (top / 0.9) ** 2 * 0.4 * gamma * (1 + 0.2 * rng.standard_normal(n)) * (1.5 - hurst)
    audit = 0.01 * rng.standard_normal(n)
    drops = loss * (1 - audit)
    out = {
        "hurst": hurst,
        "work_of_adhesion": gamma,
        "realisation": np.array([t.realisation for t in tasks], dtype=np.int32),
        "seed": np.array([t.seed for t in tasks], dtype=np.int64),
        "status": np.ones(n, dtype=np.uint8),
        "wall_time": rng.uniform(1, 2, n),
        "cpu_time": rng.uniform(1, 2, n),
        "h_max": h_max,
        "h_rms": np.full(n, 1e-6),
        "m2": 2e-3 * (0.8 / hurst) ** 4,
        "m4": 1e8 * (0.8 / hurst) ** 6,
        "loss": loss,
        "loss_dimensionless": loss / (scale * h_max),
        "loss_from_drops": drops,
        "loss_small_scale": share * drops,
        "loss_large_scale": (1 - share) * drops,
        "gamma_open": gamma,
        "audit_residual": audit,
        "loss_error": 1e-4 * loss,
        "valid_range": 1e-2 * h_max,
        "edge_range": 2e-2 * h_max,
        "touch_range": 3e-2 * h_max,
        "largest_interior_tension": gamma / (1e-2 * h_max),
        "races": (np.arange(n) % 7 == 3).astype(np.int32),
        "energy_at_stake": np.where(np.arange(n) % 7 == 3, 0.02 * loss, 0.0),
        "pull_off_penetration": pull_off[:, 0],
        "pull_off_stress": -unloading.min(axis=1) * scale,
        "work_gained": 0.3 * loss,
        "work_spent": 1.3 * loss,
        "largest_contact_fraction": np.clip(0.4 * size[:, 0], 0, 1),
        "loading_mean_stress": loading * scale[:, None],
        "unloading_mean_stress": unloading * scale[:, None],
        "loading_contact_fraction": np.clip(0.3 * size * up, 0, 1),
        "unloading_contact_fraction": np.where(stuck, np.clip(0.4 * size, 0, 1), 0.0),
        "loading_patches": np.broadcast_to(np.arange(up.size) // 3, (n, up.size)).astype(np.int32),
        "unloading_patches": np.where(stuck, 3, 0).astype(np.int32),
        "loading_energy": -1e-6 * np.ones((n, up.size)),
        "unloading_energy": np.where(stuck, -2e-6, 0.0),
        "jump_count": rng.integers(1, slots + 1, n).astype(np.int32),
    }
    none = ("rank", "friction", "zone_error", "openings")
    out |= {name: np.zeros(n) for name in none}
    out |= {name: np.full(n, np.inf) for name in ("turn_range", "opening_strength")}
    used = np.arange(slots) < out["jump_count"][:, None]
    kinds = rng.integers(0, len(JUMP_KINDS), (n, slots))
    energy = 10 ** rng.uniform(-8, -3, (n, slots))
    for name, value, empty, dtype in (
        ("jump_branch", rng.integers(0, 2, (n, slots)), -1, np.int8),
        ("jump_kind", kinds, -1, np.int8),
        ("jump_penetration", rng.uniform(-1, 0.9, (n, slots)), np.nan, float),
        ("jump_energy_drop", energy, np.nan, float),
        ("jump_patch_length", rng.uniform(1e-6, 1e-4, (n, slots)), np.nan, float),
        ("jump_patches_after", rng.integers(0, 5, (n, slots)), -1, np.int32),
    ):
        out[name] = np.where(used, value, empty).astype(dtype)
    for place, dataset in enumerate(axis_datasets(campaign)):
        out[dataset.name] = np.array([t.others[place][1] for t in tasks])
    return out | _fields(campaign, hurst, h_max, rng)


def _fields(campaign: Campaign, hurst, h_max, rng) -> dict[str, np.ndarray]:
    """Power-law spectra -(2H+1) and -(2+H), Gaussian heights, exponential gaps, waves as shapes."""
    plan = FieldPlan(campaign)
    n, states = hurst.size, (2, plan.penetration.size)
    q = plan.wave_number / (10 * 2 * np.pi / plan.period)
    scatter = 1 + 0.1 * rng.standard_normal((n, *states, 1))
    rigid = 1e-16 * q ** -(2 * hurst[:, None] + 1)
    deformed = 0.2e-16 * scatter * (q ** -(2 + hurst[:, None]))[:, None, None, :]
    height = np.linspace(-5, 5, 81)
    height = np.exp(-(((height[1:] + height[:-1]) / 2) ** 2) / 2) / np.sqrt(2 * np.pi)
    gap = np.sqrt(GAP_EDGES[:-1] * GAP_EDGES[1:])
    kept = kept_rows(campaign)
    x = plan.position
    wave = h_max[kept, None] * np.cos(10 * 2 * np.pi * x / plan.period)
    surface = np.broadcast_to(0.5 * wave[:, None, None, :], (kept.size, *states, x.size))
    return {
        "psd_height": rigid,
        "height_density": np.broadcast_to(height, (n, height.size)),
        "psd_displacement": deformed,
        "gap_density": np.broadcast_to(0.7 * np.exp(-gap), (n, *states, gap.size)),
        "field_height": wave,
        "field_displacement": surface,
        "field_stress": np.zeros(surface.shape),
        "field_gap": surface - wave[:, None, None, :] + h_max[kept, None, None, None],
    }


def write(path: Path, plan: Campaign | str, values: dict[str, np.ndarray] | None = None) -> Path:
    """Write a results file of a campaign, or of its text; its rows if no other values are given."""
    plan = parse_campaign(plan) if isinstance(plan, str) else plan
    create(path, plan, attributes={"adhesis_version": "0.1.0"})
    with h5py.File(path, "r+") as file:
        for name, value in (rows(plan) if values is None else values).items():
            file[name][...] = value
    return sign(path)


def sign(path: Path) -> Path:
    """Give a results file and its rows the checksums of what they hold, as if all were written."""
    with h5py.File(path, "r+") as file:
        file["checksum"][...] = row_checksums(
            lambda name, rows: file[name][rows], *(file[KEPT][:], np.arange(file["task"].size))
        )
    write_head(path)
    return path
