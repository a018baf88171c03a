"""``curves.nc``: the averaged curves as a NetCDF file that xarray opens, with units."""

from __future__ import annotations

import numpy as np
import xarray as xr

from adhesis.ensemble.aggregate.average import QUANTILES, Aggregate
from adhesis.ensemble.escape import printable
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
    campaign = data.campaign
    depth = f"penetration/{'max_penetration' if campaign.has_axis('max_penetration') else 'h_max'}"
    names = [axis.name for axis in campaign.axes]
    out = xr.Dataset(
        coords={name: ("cell", [cell.at[name] for cell in data.cells]) for name in names},
        attrs={
            "title": "Loading-unloading curves averaged over realisations",
            "source": printable(data.path.name),
            "Conventions": "CF-1.11",
        },
    )
    text = "quantile over realisations"
    out["quantile"] = ("quantile", list(QUANTILES), _about("1", text))
    done = np.array([cell.done for cell in data.cells], np.int32)
    out["realisations"] = ("cell", done, _about("1", "realisations that were averaged"))
    for branch in BRANCHES:
        along = f"{branch}_penetration"
        out[along] = (along, getattr(campaign, along), _about("1", f"{depth} on {branch}"))
        for name, (unit, text) in QUANTITIES.items():
            base = f"{branch}_{name}"
            for part, (what, *further) in _PARTS.items():
                values = np.array([getattr(cell.curves[base], part) for cell in data.cells])
                about = _about(unit, f"{text}, {what} on {branch}")
                out[f"{base}_{part}"] = (("cell", *further, along), values, about)
    out = out.set_index(cell=names).unstack("cell", fill_value={"realisations": 0})
    meanings = ("Hurst exponent", "work of adhesion", *(axis.meaning for axis in data.further))
    for axis, meaning in zip(campaign.axes, meanings, strict=True):
        out[axis.name].attrs = _about(axis.unit, meaning)
    return out.transpose(*names, ...)


def _about(unit: str, text: str) -> dict[str, str]:
    return {"units": unit, "long_name": text}
