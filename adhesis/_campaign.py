"""Campaigns from Python; what it takes to run one is loaded when one is run."""

from __future__ import annotations

import io
import json
import os
import re
import warnings
from collections.abc import Mapping
from contextlib import suppress
from decimal import Decimal
from html import escape
from numbers import Real
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from adhesis.solver import checks

if TYPE_CHECKING:
    from adhesis.ensemble.campaign.tables import Campaign as Tables
    from adhesis.ensemble.report.opened import CampaignResults
    from adhesis.ensemble.run.price import Price

_RANKS = checks.Bounds(1, 100_000, whole=True)
_DEEPEST = 8  # lists in lists; no key has more than two
_PILOT = checks.Bounds(0.0, 1e6, without_low=True, unit="s")


class Campaign:
    """A campaign: loops for every Hurst exponent, work of adhesion and realisation.

    Parameters
    ----------
    source : dict, str or path
        The tables of docs/campaign-file.md as a dictionary of dictionaries; or as TOML text, of
        several lines; or a campaign file. Lengths in m, stresses in Pa, works of adhesion in J/m².

    Attributes
    ----------
    text : str
        The campaign as TOML; the results file keeps it. Read-only: another campaign is another
        object.

    Raises
    ------
    InputError
        If the file cannot be read, or a key or value breaks a rule; one sentence.
    TypeError
        If ``source`` is none of them.

    References
    ----------
    docs/python.md, "A campaign"

    Examples
    --------
    >>> import adhesis
    >>> campaign = adhesis.Campaign({
    ...     "profile": {"period": 2e-3, "n0": 2, "ratio": 6, "h_rms": 1e-6},
    ...     "material": {"young": 1e6, "poisson": 0.5},
    ...     "sweep": {"hurst": [0.7, 0.9], "work_of_adhesion": [0.01, 0.04], "realisations": 3},
    ...     "cycle": {"max_penetration": 0.8, "load_steps": 8},
    ... })
    >>> campaign
    <Campaign: 4 cells, 12 tasks>
    """

    def __init__(self, source: Mapping[str, Any] | str | os.PathLike[str]) -> None:
        from adhesis.ensemble.campaign.file import load_campaign, parse_campaign

        if isinstance(source, Mapping):
            self._tables = parse_campaign(_toml(source))
        elif isinstance(source, str) and "\n" in source:
            self._tables = parse_campaign(source)
        elif isinstance(source, str | os.PathLike):
            self._tables = load_campaign(checks.path("source", source))
        else:
            raise TypeError(
                f"source is a {type(source).__name__}: it must be a dictionary of tables, TOML "
                "text or the path of a campaign file"
            )

    @property
    def tables(self) -> Tables:
        """The checked tables, by name; what ``text`` means."""
        return self._tables

    @property
    def text(self) -> str:
        """The campaign as TOML."""
        return self._tables.text

    def __repr__(self) -> str:
        cells, tasks = len(self.tables.cells), self.tables.task_count
        return f"<Campaign: {checks.counted(cells, 'cell')}, {checks.counted(tasks, 'task')}>"

    def _repr_html_(self) -> str:
        """Return the number of tasks and the campaign file, for notebooks."""
        return f"<p>{escape(repr(self))}</p><pre>{escape(self.text)}</pre>"

    def __eq__(self, other: object) -> bool:
        """Whether both compute the same."""
        return isinstance(other, Campaign) and self.tables == other.tables

    __hash__ = None  # type: ignore[assignment]

    def price(self, out: str | os.PathLike[str] | None = None, *, seconds: float = 20.0) -> Price:
        """Estimate what the campaign costs, from pilot loops; nothing is written.

        Parameters
        ----------
        out : path, optional
            Its results file, if there is one: the loops that are done are not counted again.
        seconds : float
            How long pilot loops are run, in s.

        Returns
        -------
        adhesis.ensemble.run.price.Price
            ``seconds`` of CPU time, ``file_bytes``, ``rank_bytes``, ``makespan(workers)`` in s;
            ``print`` shows it as ``adhesis run --dry-run`` does.

        Raises
        ------
        InputError
            If the results file is damaged, or holds another campaign.
        ValueError
            If ``seconds`` is not positive.
        TypeError
            If ``out`` is no path, or ``seconds`` no number.
        """
        path = None if out is None else checks.path("out", out)
        seconds = checks.real("seconds", seconds, _PILOT)
        from adhesis.ensemble.results.layout import check_results_file

        if path is not None:
            check_results_file(path)
        from adhesis.ensemble.run.price import price

        return price(self.tables, path, seconds=seconds)

    def run(
        self,
        out: str | os.PathLike[str],
        *,
        ranks: int = 1,
        progress: bool = False,
    ) -> CampaignResults:
        """Compute what is missing in the results file, and open it.

        It runs in any thread; signals stop it in order in the main thread alone.

        Parameters
        ----------
        out : path
            The results file. One of this campaign is resumed, one of a smaller campaign extended.
        ranks : int
            1 computes in this process. More start processes beside it, which compute, while this
            one hands out: one more than cores is right.
        progress : bool
            Whether lines on stderr, or in the notebook, show how far the campaign is.

        Returns
        -------
        CampaignResults
            As :func:`adhesis.open` returns it. Failed tasks are counted in its ``repr``, and in a
            warning with the first reason; warnings also count losses that are doubtful.

        Raises
        ------
        InputError
            If the file holds another campaign, is damaged, in use or not writable; or the ranks
            cannot be started.
        RuntimeError
            If the run ended before its last task, by a signal, an error of a rank or 20 failed
            tasks: what was done is kept, and the same call goes on.
        ValueError
            If ``ranks`` is out of range.
        TypeError
            If a value is of the wrong type.
        """
        # The folder may be another one before the run ends: threads share it.
        path = checks.path("out", out).absolute()
        ranks = checks.whole("ranks", ranks, _RANKS)
        checks.flag("progress", progress)
        from adhesis.ensemble.results.layout import check_results_file

        check_results_file(path)
        from adhesis._open import open as open_results
        from adhesis.ensemble.reporter import log
        from adhesis.ensemble.run.launch import check_ranks
        from adhesis.ensemble.run.plan import Options
        from adhesis.ensemble.run.session import run_campaign

        check_ranks(ranks)
        say = log if progress else lambda text: None
        stream = None if progress else io.StringIO()  # stderr is that of all threads
        options = Options(processes=ranks - 1)
        summary = run_campaign(self.tables, path, options=options, say=say, stream=stream)
        say(f"{path}: {summary}")
        if summary.stopped:
            raise RuntimeError(
                f"the campaign stopped early: {summary.stopped}; {summary.pending} of "
                f"{summary.total} tasks are left in {path}, and the same call goes on"
            )
        results = open_results(path)
        _warn(path)
        return results


def _warn(path: Path) -> None:
    """Warn of failed tasks, with the first reason, and of doubtful losses."""
    from adhesis.ensemble.aggregate.status import doubts, read_status

    status = read_status(path)
    found = [sentence for sentence, *_ in doubts(status)]
    if status["failed"]:
        found.insert(
            0,
            f"{status['failed']} of {checks.counted(status['tasks'], 'task')} failed, and the "
            f"averages leave them out; first reason: {status['failures'][0]['error']}",
        )
    for sentence in found:
        warnings.warn(sentence, stacklevel=3)


def _toml(source: Mapping[str, Any]) -> str:
    """Return a dictionary of tables as TOML.

    Raises
    ------
    InputError
        If a value is none that a key can have, or lists are nested deeper than those of any key, as
        in a list that contains itself.
    """
    lines: list[str] = []
    for name, table in source.items():
        if not isinstance(table, Mapping):
            lines.insert(0, f"{_key(name)} = {_value(str(name), table)}")
            continue
        lines.append(f"[{_key(name)}]")
        for key, value in table.items():
            lines.append(f"{_key(key)} = {_value(f'[{name}] {key}', value)}")
    return "\n".join(lines) + "\n"


def _key(name: object) -> str:
    text = str(name)
    return text if re.fullmatch(r"[\w-]+", text, re.ASCII) else json.dumps(text)


def _value(where: str, value: Any, depth: int = 0) -> str:
    rule = "a number, a text, true or false, or a list of these"
    if checks.carries_unit(value):
        _refuse(where, value, f"{rule}, and carry no unit, which would be lost")
    if hasattr(value, "tolist"):  # a number or an array of NumPy
        value = value.tolist()
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int):
        return int.__repr__(value)  # a class of a user's own may print anything
    if isinstance(value, Real | Decimal):
        with suppress(OverflowError, ValueError):  # of a fraction, of a signalling NaN
            return float.__repr__(float(value))
    if isinstance(value, str):
        return json.dumps(str(value), ensure_ascii=False)
    if isinstance(value, list | tuple):
        if depth <= _DEEPEST:
            return f"[{', '.join(_value(where, entry, depth + 1) for entry in value)}]"
        rule = "a value or a list of values, and no list in which lists are nested so deep"
    _refuse(where, value, rule)


def _refuse(where: str, value: object, rule: str) -> NoReturn:
    from adhesis.ensemble.errors import InputError

    raise InputError(f"campaign: {where} is {checks.shown(value)}: it must be {rule}")
