"""``curves.nc``: the averaged curves as a NetCDF file that xarray opens, with units."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from adhesis.ensemble.aggregate.average import Aggregate
from adhesis.ensemble.aggregate.mean_curves import QUANTILES
from adhesis.ensemble.outputs import write_netcdf
from adhesis.solver.method import BRANCHES

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
    """Collect every averaged curve: (hurst, work_of_adhesion, …, [quantile,] penetration).

    Further axes of the campaign follow γ; NaN where a cell is not there, as keys vary together.
    """
    axes: dict[str, list[Any]] = {
        "hurst": list(data.hursts),
        "work_of_adhesion": list(data.works_of_adhesion),
        **{axis.name: sorted(set(axis.values)) for axis in data.further},
    }
    place = [
        tuple(values.index(value) for values, value in zip(axes.values(), cell.point, strict=True))
        for cell in data.cells
    ]
    key_dims, shape = tuple(axes), tuple(map(len, axes.values()))
    depth = "max_penetration" if data.campaign.has_axis("max_penetration") else "h_max"
    out = xr.Dataset(
        coords={
            "hurst": ("hurst", axes["hurst"], _about("1", "Hurst exponent")),
            "work_of_adhesion": (
                "work_of_adhesion",
                axes["work_of_adhesion"],
                _about("J m-2", "work of adhesion"),
            ),
            **{
                axis.name: (axis.name, axes[axis.name], _about(axis.unit, axis.meaning))
                for axis in data.further
            },
            "quantile": ("quantile", list(QUANTILES), _about("1", "quantile over realisations")),
            "loading_penetration": (
                "loading_penetration",
                data.campaign.loading_penetration,
                _about("1", f"penetration/{depth} on loading"),
            ),
            "unloading_penetration": (
                "unloading_penetration",
                data.campaign.unloading_penetration,
                _about("1", f"penetration/{depth} on unloading"),
            ),
        },
        attrs={
            "title": "Loading-unloading curves averaged over realisations",
            "source": data.path.name,
            "Conventions": "CF-1.11",
        },
    )
    count = np.zeros(shape, dtype=np.int32)
    for where, cell in zip(place, data.cells, strict=True):
        count[where] = cell.done
    out["realisations"] = (key_dims, count, _about("1", "realisations that were averaged"))
    for branch in BRANCHES:
        axis = f"{branch}_penetration"
        points = out.sizes[axis]
        for name, (unit, text) in QUANTITIES.items():
            mean = np.full((*shape, points), np.nan)
            std = mean.copy()
            quantiles = np.full((*shape, len(QUANTILES), points), np.nan)
            for where, cell in zip(place, data.cells, strict=True):
                curve = cell.curves[f"{branch}_{name}"]
                mean[where], std[where], quantiles[where] = curve.mean, curve.std, curve.quantiles
            base = f"{branch}_{name}"
            out[f"{base}_mean"] = (
                (*key_dims, axis),
                mean,
                _about(unit, f"{text}, mean on {branch}"),
            )
            out[f"{base}_std"] = (
                (*key_dims, axis),
                std,
                _about(unit, f"{text}, standard deviation on {branch}"),
            )
            out[f"{base}_quantiles"] = (
                (*key_dims, "quantile", axis),
                quantiles,
                _about(unit, f"{text}, quantiles on {branch}"),
            )
    return out


def write_curves(data: Aggregate, path: Path) -> None:
    """Write :func:`curves_dataset` as NetCDF 4, replacing a file that is there."""
    write_netcdf(path, curves_dataset(data))


def _about(unit: str, text: str) -> dict[str, str]:
    return {"units": unit, "long_name": text}
