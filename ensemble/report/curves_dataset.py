"""``curves.nc``: the averaged curves as a NetCDF file that xarray opens, with units."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from adhesis.ensemble.aggregate.average import Aggregate
from adhesis.ensemble.aggregate.mean_curves import QUANTILES
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
# part of a curve -> (what it is, a dimension of its own)
_PARTS = {"mean": ("mean",), "std": ("standard deviation",), "quantiles": ("quantiles", "quantile")}


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
    campaign = data.campaign
    coordinates: list[tuple[str, Any, str, str]] = [
        ("hurst", axes["hurst"], "1", "Hurst exponent"),
        ("work_of_adhesion", axes["work_of_adhesion"], "J m-2", "work of adhesion"),
        *((axis.name, axes[axis.name], axis.unit, axis.meaning) for axis in data.further),
        ("quantile", list(QUANTILES), "1", "quantile over realisations"),
        *(
            (f"{branch}_penetration", values, "1", f"penetration/{depth} on {branch}")
            for branch, values in zip(
                BRANCHES,
                (campaign.loading_penetration, campaign.unloading_penetration),
                strict=True,
            )
        ),
    ]
    out = xr.Dataset(
        coords={name: (name, values, _about(*about)) for name, values, *about in coordinates},
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
        for name, (unit, text) in QUANTITIES.items():
            base = f"{branch}_{name}"
            for part, (what, *further) in _PARTS.items():
                dims = (*further, f"{branch}_penetration")
                values = np.full((*shape, *(out.sizes[dim] for dim in dims)), np.nan)
                for where, cell in zip(place, data.cells, strict=True):
                    values[where] = getattr(cell.curves[base], part)
                about = _about(unit, f"{text}, {what} on {branch}")
                out[f"{base}_{part}"] = ((*key_dims, *dims), values, about)
    return out


def _about(unit: str, text: str) -> dict[str, str]:
    return {"units": unit, "long_name": text}
