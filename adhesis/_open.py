"""Open results files; what that takes is loaded when it is called."""

from __future__ import annotations

import os
from collections.abc import Iterable
from typing import TYPE_CHECKING

from adhesis.solver import checks

if TYPE_CHECKING:
    from adhesis.ensemble.report.opened import CampaignResults


def open(
    path: str | os.PathLike[str], *, beside: Iterable[str | os.PathLike[str]] = ()
) -> CampaignResults:
    """Open the results file of a campaign, finished or not.

    Parameters
    ----------
    path : path
        The file that ``adhesis run`` writes (HDF5).
    beside : paths
        Results files of other campaigns, for the comparisons of the report.

    Returns
    -------
    CampaignResults
        Labelled arrays (``dataset``, ``curves``, ``spectra``, ``fields``), tables (``losses``,
        ``growth``, ``mechanisms``, ``jumps``) and the figures of the report (``plot``).

    Raises
    ------
    InputError
        If the file is missing, foreign or damaged; one sentence.
    TypeError
        If ``path`` is no path, or ``beside`` no list of them.

    References
    ----------
    docs/python.md, "Results in Python"

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import adhesis
    >>> campaign = adhesis.Campaign({
    ...     "profile": {"period": 2e-3, "n0": 2, "ratio": 2, "h_rms": 1e-6},
    ...     "material": {"young": 1e6, "poisson": 0.5},
    ...     "sweep": {"hurst": [0.8], "work_of_adhesion": [0.01], "realisations": 3},
    ...     "cycle": {"max_penetration": 0.5, "load_steps": 4},
    ... })
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder, "results.h5")
    ...     _ = campaign.run(file)
    ...     int((adhesis.open(file).dataset.loss > 0).sum())  # every loop loses energy
    3
    """
    if isinstance(beside, str | os.PathLike):
        raise TypeError(f"beside is {str(beside)!r}: it must be a list of paths")
    others = [checks.path(f"beside[{place}]", other) for place, other in enumerate(beside)]
    path = checks.path("path", path)
    from adhesis.ensemble.report.opened import (
        CampaignResults,  # xarray and pandas take half a second
    )

    return CampaignResults(path, others)
