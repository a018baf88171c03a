"""``curves.nc``: the averaged curves as a NetCDF file that xarray opens, with units."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import xarray as xr

from ensemble.aggregate.average import Aggregate
from ensemble.aggregate.curves import QUANTILES
from solver.method import BRANCHES

# curve -> (unit, what it is)
QUANTITIES = {
    "mean_stress": ("Pa", "mean stress, compression positive"),
    "mean_stress_dimensionless": ("1", "dimensionless mean stress 2 p/(E* q0 h_max)"),
    "mean_stress_over_slope": ("1", "dimensionless mean stress over the root mean square slope"),
    "contact_fraction": ("1", "contact fraction A/A0"),
    "patches": ("1", "number of contact patches in one period"),
    "energy": ("J m-1", "elastic and adhesion energy of one period per unit depth"),
}


def curves_dataset(data: Aggregate) -> xr.Dataset:
    """Collect every averaged curve: (hurst, work_of_adhesion, [quantile,] penetration)."""
    hursts, gammas = data.hursts, data.works_of_adhesion
    place = [(hursts.index(c.hurst), gammas.index(c.work_of_adhesion)) for c in data.cells]
    key = ("hurst", "work_of_adhesion")
    out = xr.Dataset(
        coords={
            "hurst": ("hurst", list(hursts), _about("1", "Hurst exponent")),
            "work_of_adhesion": (
                "work_of_adhesion",
                list(gammas),
                _about("J m-2", "work of adhesion"),
            ),
            "quantile": ("quantile", list(QUANTILES), _about("1", "quantile over realisations")),
            "loading_penetration": (
                "loading_penetration",
                data.campaign.loading_penetration,
                _about("1", "penetration/h_max on loading"),
            ),
            "unloading_penetration": (
                "unloading_penetration",
                data.campaign.unloading_penetration,
                _about("1", "penetration/h_max on unloading"),
            ),
        },
        attrs={
            "title": "Loading-unloading curves averaged over realisations",
            "source": data.path.name,
            "Conventions": "CF-1.11",
        },
    )
    count = np.zeros((len(hursts), len(gammas)), dtype=np.int32)
    for where, cell in zip(place, data.cells, strict=True):
        count[where] = cell.done
    out["realisations"] = (key, count, _about("1", "realisations that were averaged"))
    for branch in BRANCHES:
        axis = f"{branch}_penetration"
        points = out.sizes[axis]
        for name, (unit, text) in QUANTITIES.items():
            mean = np.full((len(hursts), len(gammas), points), np.nan)
            std = mean.copy()
            quantiles = np.full((len(hursts), len(gammas), len(QUANTILES), points), np.nan)
            for where, cell in zip(place, data.cells, strict=True):
                curve = cell.curves[f"{branch}_{name}"]
                mean[where], std[where], quantiles[where] = curve.mean, curve.std, curve.quantiles
            base = f"{branch}_{name}"
            out[f"{base}_mean"] = ((*key, axis), mean, _about(unit, f"{text}, mean on {branch}"))
            out[f"{base}_std"] = (
                (*key, axis),
                std,
                _about(unit, f"{text}, standard deviation on {branch}"),
            )
            out[f"{base}_quantiles"] = (
                (*key, "quantile", axis),
                quantiles,
                _about(unit, f"{text}, quantiles on {branch}"),
            )
    return out


def write_curves(data: Aggregate, path: Path) -> None:
    """Write :func:`curves_dataset` as NetCDF 4, replacing a file that is there."""
    path.unlink(missing_ok=True)
    curves_dataset(data).to_netcdf(path, engine="h5netcdf")


def _about(unit: str, text: str) -> dict[str, str]:
    return {"units": unit, "long_name": text}
