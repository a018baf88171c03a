"""A results file as an object of Python: labelled arrays, tables, and every figure of the report.

What the report writes to disk is here in memory; the file is opened anew at each access, so that a
run may go on writing to it.
"""

from __future__ import annotations

import inspect
import warnings
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from functools import cached_property, partial
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import xarray as xr
from numpy.typing import NDArray

from adhesis.ensemble.aggregate.average import QUANTILES, Aggregate, aggregate
from adhesis.ensemble.campaign.tables import Campaign
from adhesis.ensemble.escape import printable
from adhesis.ensemble.quantities import with_units
from adhesis.ensemble.report.html import picture_of, table_of
from adhesis.ensemble.report.tables import campaign_tables
from adhesis.ensemble.report.tables.table import Table
from adhesis.ensemble.results import schema
from adhesis.ensemble.results.read import Results
from adhesis.ensemble.task.dataset import KEPT, Dataset
from adhesis.ensemble.task.fields import FIELD_DATASETS
from adhesis.ensemble.task.row import CURVES, JUMP_COUNT, JUMPS, NUMBERS, TIMES
from adhesis.solver.model.jump import BRANCHES, JUMP_KINDS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from adhesis.ensemble.report.figures.style import PublishedFigure

# Dimensions of the file under the names that they have here.
_RENAMED = {
    "field_branch": "branch",
    "field_penetration": "penetration",
    "field_position": "position",
}
_NO_RESULTS = ("error", schema.CHECKSUM.name, schema.ORIGIN.name)
# curve -> (unit, what it is)
_CURVES = {
    "mean_stress": ("Pa", "mean stress, compression positive"),
    "mean_stress_dimensionless": ("1", "dimensionless mean stress 2 p/(E* q0 h_max)"),
    "mean_stress_over_slope": ("1", "dimensionless mean stress over the root mean square slope"),
    "contact_fraction": ("1", "contact fraction A/A0"),
    "patches": ("1", "number of contact patches in one period"),
    "energy": ("J m-1", "elastic and adhesion energy of one period per unit depth"),
}
# part of a curve -> (what it is, a dimension of its own)
_PARTS = {"mean": ("mean",), "std": ("standard deviation",), "quantiles": ("quantiles", "quantile")}


class Plots:
    """One method for each figure of the report; docs/theory.md says what each shows.

    Every method returns the figure, which a notebook displays. With ``ax``, one Axes of matplotlib
    or several, its first panels are drawn into these, and their figure is returned. What is drawn
    are averages over the realisations that are finished.
    """

    def __init__(self, results: CampaignResults) -> None:
        self._results = results

    def __dir__(self) -> list[str]:
        from adhesis.ensemble.report.figures.catalogue import ALL

        return [item.draw.__name__ for item in ALL] + ["loss_along"]

    def __repr__(self) -> str:
        return f"<Plots: {', '.join(dir(self))}>"

    def __getattr__(self, name: str) -> Callable[..., Figure]:
        """Return the method of a figure of the catalogue, by the name of the function."""
        if name.startswith("_") or name not in dir(self):
            raise AttributeError(name)
        from adhesis.ensemble.report.figures.catalogue import ALL

        item = next(item for item in ALL if item.draw.__name__ == name)

        def draw(ax: object = None) -> Figure:
            return self._draw(item.of, ax)

        _, _, further = (inspect.getdoc(item.draw) or "").partition("\n\n")
        draw.__name__, draw.__doc__ = name, f"{item.title}.\n\n{item.caption}\n\n{further}".strip()
        return draw

    def _draw(self, function: Callable[[Aggregate], PublishedFigure], ax: object) -> Figure:
        """Draw a figure; each method calls this alone, so that a warning is of the user's line."""
        from adhesis.ensemble.report.figures.style import drawn_into

        with drawn_into(ax):
            return function(self._results.averages).finish()

    def loss_along(self, name: str, ax: object = None) -> Figure:
        """Loss along a further axis of the campaign ("max_penetration"), with intervals.

        Raises
        ------
        ValueError
            If the campaign has no such axis beside H and γ.
        """
        from adhesis.ensemble.report.figures.loss_figures import along
        from adhesis.ensemble.report.further_axes import with_figure

        axes = {axis.name: axis for axis in with_figure(self._results.averages)}
        if name not in axes:
            known = ", ".join(axes) or "none"
            raise ValueError(f"{name!r} is no axis with a figure of its own: there are {known}")
        return self._draw(partial(along, axes[name]), ax)


class CampaignResults(AbstractContextManager["CampaignResults"]):
    """Results of a campaign, finished or not; made by :func:`adhesis.open`.

    Parameters
    ----------
    path : path
        The results file.
    beside : sequence of path
        Results files of other campaigns, for the comparisons.

    Attributes
    ----------
    path : Path
    campaign : Campaign
        What was asked for: its tables are attributes (``campaign.cycle.max_penetration``).
    plot : Plots
        One method for each figure of the report.

    Warns
    -----
    UserWarning
        If rows are damaged, which are left out as if they were pending, or if rows were computed by
        several versions or processors.

    Raises
    ------
    InputError
        If a file is missing, foreign or damaged beyond its rows.
    """

    def __init__(self, path: Path | str, beside: Sequence[Path | str] = ()) -> None:
        self.path = Path(path)
        self._beside = tuple(beside)
        for other in self._beside:
            Results(other).close()  # refused now, and not when a comparison is drawn
        with Results(self.path) as results:
            self.campaign: Campaign = results.campaign
            status = results.status()
            for doubt in results.doubts():
                warnings.warn(doubt, stacklevel=3)
        states = {"done": schema.DONE, "failed": schema.FAILED, "pending": schema.PENDING}
        self._counts = {name: int(np.sum(status == state)) for name, state in states.items()}
        if schema.DAMAGED in status:
            self._counts["damaged"] = int(np.sum(status == schema.DAMAGED))
        self.plot = Plots(self)

    def __exit__(self, *_: object) -> None:
        """Forget what was read; the file itself is closed after each access anyway."""
        for name in [n for n, v in vars(type(self)).items() if isinstance(v, cached_property)]:
            self.__dict__.pop(name, None)

    def __repr__(self) -> str:
        counts = ", ".join(f"{number} {name}" for name, number in self._counts.items())
        return f"<CampaignResults {self.path}: {counts}>"

    def _repr_html_(self) -> str:
        """Return counts, mean losses with the warnings of the report, and their figure."""
        from adhesis.ensemble.report import findings
        from adhesis.ensemble.report.further_axes import with_figure

        rows = [("file", str(self.path)), *((k, str(n)) for k, n in self._counts.items())]
        rows.append(("axes", ", ".join(self.axes)))
        if not self._counts["done"]:
            return table_of(rows)
        rows += [("warning", text) for text in findings.warnings(self.averages)]
        names = [f"loss_{part} [J/m^2]" for part in ("mean", "ci_low", "ci_high")]
        losses = self.losses[names]
        # Of an index pandas writes six decimals, which small lengths have in common.
        places = [tuple(f"{value:g}" for value in place) for place in losses.index]
        losses.index = pd.MultiIndex.from_tuples(places, names=losses.index.names)
        table: str = losses.to_html(float_format="{:.4g}".format)
        several = with_figure(self.averages) if len(self.averages.hursts) == 1 else []
        draw = partial(self.plot.loss_along, several[0].name) if several else None
        figure: Any = (draw or self.plot.loss_against_hurst)()
        return table_of(rows) + table + picture_of(figure, "losses")

    @cached_property
    def averages(self) -> Aggregate:
        """Everything averaged over realisations, as the report has it.

        Raises
        ------
        InputError
            If no task is finished.
        """
        return aggregate(self.path, self._beside)

    @property
    def axes(self) -> tuple[str, ...]:
        """Names of the axes: H, γ, further lists of the campaign, realisation."""
        return (*(axis.name for axis in self.campaign.axes), "realisation")

    # ------------------------------------------------------------------ arrays

    @cached_property
    def dataset(self) -> xr.Dataset:
        """Every number and every curve of every loop, SI units.

        Dimensions hurst, work_of_adhesion, further axes of the campaign if it has any, realisation,
        and the penetration of either branch;
        NaN (-1 for counts) where a task is not done. A damaged one counts as pending.
        """
        numbers = (*schema.TASK_DATASETS, *schema.RUN_DATASETS, *TIMES, *NUMBERS)
        wanted = (*numbers, *chain(*CURVES.values()), JUMP_COUNT)
        return self._arranged([d for d in wanted if d.name not in (*self.axes, *_NO_RESULTS)])

    @cached_property
    def spectra(self) -> xr.Dataset:
        """Spectral densities in m³, and densities of heights and gaps, of every loop."""
        return self._arranged([d for d in FIELD_DATASETS if d.dims[0] != KEPT])

    @cached_property
    def fields(self) -> xr.Dataset:
        """Profile, displacement and gap in m, stress in Pa, of the first realisations, if kept."""
        return self._arranged([d for d in FIELD_DATASETS if d.dims[0] == KEPT])

    @cached_property
    def curves(self) -> xr.Dataset:
        """Both branches averaged over realisations: mean, std, quantiles (``curves.nc``)."""
        return curves_dataset(self.averages)

    # ------------------------------------------------------------------ tables

    @cached_property
    def losses(self) -> pd.DataFrame:
        """``losses.csv``: mean losses with 95 % intervals and errors, one row for each cell."""
        return _frame(campaign_tables.losses(self.averages), self.axes[:-1])

    @cached_property
    def growth(self) -> pd.DataFrame:
        """``growth.csv``: growth of the loss from one γ to the next, on the same profiles."""
        return _frame(campaign_tables.paired(self.averages), ())

    @cached_property
    def mechanisms(self) -> pd.DataFrame:
        """Jumps by kind, their number and share of the drops (``jumps.csv``)."""
        return _frame(campaign_tables.jumps(self.averages), (*self.axes[:-1], "kind"))

    @cached_property
    def jumps(self) -> pd.DataFrame:
        """The catalogue: one row for each jump of each finished loop, in the order of the path."""
        with Results(self.path) as results:
            rows = np.flatnonzero(results.status() == schema.DONE)
            used = results.column("jump_kind", rows) >= 0
            loop, _ = np.nonzero(used)
            out = {name: values[rows][loop] for name, values in _axes(results).items()}
            for d in JUMPS:
                out[d.name.removeprefix("jump_")] = results.column(d.name, rows)[used]
        out["branch"] = np.array(BRANCHES)[out["branch"]]
        out["kind"] = np.array(JUMP_KINDS)[out["kind"]]
        return with_units(pd.DataFrame(out))

    # ------------------------------------------------------------------ inside

    def _arranged(self, datasets: Sequence[Dataset]) -> xr.Dataset:
        """Datasets of one first dimension, which is spread over the axes of the campaign."""
        with Results(self.path) as results:
            rows = np.arange(len(results))
            if datasets[0].dims[0] == KEPT:
                rows = results.column(KEPT)
            status = results.status()
            status[status == schema.DAMAGED] = schema.PENDING
            empty = ~np.isin(status[rows], (schema.DONE, schema.FAILED))
            known = {scale.name: scale for scale in schema.scales(results.campaign, results.part)}
            found = xr.Dataset(coords={k: ("task", v[rows]) for k, v in _axes(results).items()})
            for d in datasets:
                values = status if d is schema.STATUS else results.column(d.name)
                if d not in schema.TASK_DATASETS and d is not schema.STATUS:
                    values[empty] = d.fill
                dims = [_RENAMED.get(dim, dim) for dim in d.dims[1:]]
                found[d.name] = (("task", *dims), values, d.described)
                for dim, name in zip(d.dims[1:], dims, strict=True):
                    label = list(BRANCHES) if name == "branch" else known[dim].numbers
                    found[name] = (name, label, known[dim].described)
        fills = {d.name: d.fill for d in datasets}
        spread = found.set_index(task=list(self.axes)).unstack("task", fill_value=fills)
        return spread.transpose(*self.axes, ...).assign_attrs(source=printable(self.path.name))


def _axes(results: Results) -> dict[str, NDArray[Any]]:
    """Values of every task on each axis, row by row; of a part, those of its rows."""
    tasks = results.tasks
    names = ("hurst", "work_of_adhesion", *tasks.names, "realisation")
    return {name: tasks.column(name) for name in names}


def _frame(table: Table, index: Sequence[str]) -> pd.DataFrame:
    units = {}
    for column in table.columns:
        plain, _, unit = column.name.partition(" [")
        units[plain if plain in index else column.name] = unit.rstrip("]").replace("^2", "²")
    frame = pd.DataFrame([list(row) for row in table.rows], columns=list(units))
    frame = frame.set_index(list(index)) if index else frame
    frame.attrs["units"] = units
    return frame


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
    for branch, places in campaign.penetration.items():
        along = f"{branch}_penetration"
        out[along] = (along, places, _about("1", f"{depth} on {branch}"))
        for name, (unit, text) in _CURVES.items():
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
