"""Read instrument formats through SurfaceTopography, an optional dependency.

The extra ``instruments`` installs it. It is under the MIT licence, and reads line scans as such
(Dektak, Mahr, Mitutoyo, Igor, netCDF) beside some forty formats of maps. Its conventions differ by
format: a physical size is n steps in some, and n - 1 in those whose files hold the distance from
first to last point. So the step is always computed from its positions.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from types import ModuleType
from typing import Any, NoReturn

import numpy as np

from adhesis.ensemble.errors import InputError, parameter, reason
from adhesis.ensemble.quantities import LENGTH
from adhesis.ensemble.trace.reading.source import Source
from adhesis.solver.model.profile import Array

HINT = f"{sys.executable} -m pip install 'SurfaceTopography>=1.27'"


# Formats of the package that any file of some size, or any text, is taken for.
_TAKE_ANYTHING = ("asc", "xyz", "hgt")


def available() -> bool:
    """Return whether the optional dependency is installed."""
    from importlib.util import find_spec

    return find_spec("SurfaceTopography") is not None


def read_scan(
    source: Source, row: int | None, channel: int | None
) -> tuple[Array, Array, str, float | None]:
    """Read a line scan, or one row of a map, from an instrument file.

    Returns positions and heights (NaN: not measured) in m, a description, and the radius of the
    tip in m, if it is known. InputError if no reader knows the file, it is damaged, it gives no
    length or unit, it holds a map and no row is chosen, or the chosen channel or row is not there.
    """
    io = _library()
    with _quiet():
        try:
            reader = io.open_topography(source.name if source.content is None else source.open())
            channels = list(reader.channels)
        except Exception as error:  # each reader raises exceptions of its own
            text = _one_line(error)
            if text.startswith("tried "):  # and then lists every reader
                _refuse_unknown(source)
            source.refuse(f"is no instrument format that can be read: {text}")
        chosen = _channel(source, channels, channel)
        if chosen.physical_sizes is None or chosen.unit is None:
            if reader.format() in _TAKE_ANYTHING:
                _refuse_unknown(source)
            source.refuse(
                f"states no lengths or no unit of its heights ({_name(reader)}): export them as "
                f"text, and give {parameter('step')} and {parameter('unit')}",
            )
        try:
            topography = reader.topography(channel_index=chosen.index)
            heights: Array = np.ma.filled(np.ma.asarray(topography.heights(), dtype=float), np.nan)
            positions, heights, where = _line(source, topography, heights, row)
        except InputError:
            raise
        except Exception as error:
            source.refuse(f"cannot be read as heights: {_one_line(error)}")
    metres = LENGTH.units[LENGTH.unit_named(str(topography.unit))]
    label = f"{_name(reader)}, channel {chosen.name!r}{where}, lengths in {topography.unit}"
    return positions * metres, heights * metres, label, _tip_radius(topography)


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep warnings and logs of the readers from stderr; a program's own handlers get the logs."""
    import logging
    import warnings

    nowhere = logging.NullHandler()  # without any handler messages go to stderr
    logging.root.addHandler(nowhere)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        logging.root.removeHandler(nowhere)


def _refuse_unknown(source: Source) -> NoReturn:
    if not source.holds_zero_bytes():
        source.refuse(
            "begins as an instrument's file, and no reader of them can read it: it is damaged, cut "
            "off, or of another version, so export the trace as text",
        )
    source.refuse(
        "is neither text nor an instrument format that can be read: it holds zero bytes (a padded "
        "text, or one in UTF-16 without a mark, is to be saved anew as UTF-8), and no reader of "
        "instruments' files knows it",
    )


def _name(reader: Any) -> str:
    return str(getattr(type(reader), "_name", None) or reader.format())


def _library() -> ModuleType:
    # NuMPI, which it imports, initialises MPI if it can import mpi4py; reading needs no ranks.
    hidden = "mpi4py" not in sys.modules
    if hidden:
        sys.modules["mpi4py"] = None  # type: ignore[assignment]  # None: cannot be imported
    try:
        import SurfaceTopography.IO as io
    finally:
        if hidden:
            del sys.modules["mpi4py"]
    module: ModuleType = io
    return module


def _channel(source: Source, channels: list[Any], wanted: int | None) -> Any:
    if wanted is not None:
        if not 0 <= wanted < len(channels):
            raise InputError(
                f"{parameter('channel')} is {wanted}: {source} has the channels 0 to "
                f"{len(channels) - 1}"
            )
        return channels[wanted]
    heights = [c for c in channels if "height" in str(getattr(c, "data_kind", "height")).lower()]
    if not heights:
        names = ", ".join(f"{c.index} {c.name}" for c in channels) or "none"
        raise InputError(
            f"{source} holds no channel of heights (its channels: {names}): export the trace as "
            "text"
        )
    return heights[0]


def _line(
    source: Source, topography: Any, heights: Array, row: int | None
) -> tuple[Array, Array, str]:
    """Return positions and heights of a line scan, or of one row of a map, in the file's unit."""
    if heights.ndim == 1:
        if row is not None:
            raise InputError(f"{parameter('row')} is {row}: {source} holds a line, no map")
        return np.asarray(topography.positions(), dtype=float), heights, ""
    points, rows = heights.shape
    if row is None and rows > 1:
        raise InputError(
            f"{source} holds a map of {points} × {rows} heights: {parameter('row')} K takes one of "
            f"its rows, 0 to {rows - 1}, as the trace"
        )
    row = row or 0
    check_row(str(source), row, rows)
    step = topography.physical_sizes[0] / points
    where = f", row {row} of {rows}" if rows > 1 else ""
    return step * np.arange(points), heights[:, row], where


def check_row(name: str, row: int, rows: int) -> None:
    """Refuse a row beyond those of a map (InputError)."""
    if row >= rows:
        raise InputError(f"{parameter('row')} is {row}: {name} has the rows 0 to {rows - 1}")


def _tip_radius(topography: Any) -> float | None:
    try:
        radius = topography.info["instrument"]["parameters"]["tip_radius"]
        return float(radius["value"]) * LENGTH.units[LENGTH.unit_named(str(radius["unit"]))]
    except (KeyError, TypeError, ValueError, InputError):
        return None


def _one_line(error: Exception) -> str:
    text = reason(error)
    return text if len(text) < 160 else text[:157] + "..."
