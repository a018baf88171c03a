"""The tables of a campaign: every key with its rule, its meaning and its default.

Every key has one rule. What a campaign means is here, and by what two differ: order, comments and
the spelling of numbers do not matter, and neither do the few keys that cannot change a result. How
its file is read is in :mod:`adhesis.ensemble.campaign.file`.
"""

from __future__ import annotations

import math
from dataclasses import MISSING, Field, dataclass, field, fields, replace
from functools import cached_property
from itertools import chain, product
from operator import attrgetter, itemgetter
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from adhesis.ensemble.campaign.rules import Rule, choice, list_of, list_of_names, number_in, shown
from adhesis.ensemble.campaign.tasks import WHOLE, Part, Task, Tasks
from adhesis.ensemble.errors import InputError
from adhesis.ensemble.quantities import HEIGHT
from adhesis.solver import checks
from adhesis.solver.checks import Bounds
from adhesis.solver.model.jump import BRANCHES, Branch
from adhesis.solver.model.problem import Measure
from adhesis.solver.model.profile import NORMALISATIONS, Amplitudes, Array
from adhesis.solver.registry import METHOD_NAMES, MethodName

# Units of bounds as UDUNITS reads them; numbers without a unit and in units of h_max have "1".
_UDUNITS = {"m": "m", "m²": "m2", "Pa": "Pa", "Pa/m of nominal area": "Pa m-1", "J/m²": "J m-2"}


def _key(
    rule: Rule | Bounds | tuple[str, ...], meaning: str, default: Any = MISSING, **marks: bool
) -> Any:
    """Return a dataclass field for one key; its rule may be given as bounds, or as a choice.

    The mark ``free`` is that of a key which cannot change a result: it may differ when a file is
    resumed. ``axis`` is that of a number that may be a list, and then is an axis.
    """
    rule = number_in(rule) if isinstance(rule, Bounds) else rule
    rule = choice(*rule) if isinstance(rule, tuple) else rule
    metadata = {"rule": rule, "meaning": meaning, "free": False, "axis": False}
    return field(default=default, metadata=metadata | marks)


def _axis(rule: Rule | Bounds, meaning: str, default: Any = None) -> Any:
    return _key(rule, meaning, default, axis=True)


def _whole(low: int, high: int, meaning: str, default: Any = MISSING) -> Any:
    return _key(Bounds(low, high, whole=True), meaning, default)


# The far side of a stiffness may go beyond 1; at a fixed separation the file's rules refuse that.
_DISPLACEMENT = Bounds(0.0, checks.FAR_DISPLACEMENT.high, without_low=True)
_STORED = Bounds(-1000, 1, without_low=True, without_high=True)  # penetrations of fields


@dataclass(frozen=True)
class ProfileTable:
    """``[profile]``: the rough profile, by the spectral method."""

    period: float = _axis(checks.LENGTH, "period λ in m", MISSING)
    n0: int = _axis(checks.HARMONIC, "lowest harmonic: its wave number is n0 · 2π/λ", MISSING)
    ratio: int = _axis(checks.HARMONIC, "highest over lowest wave number, q_max/q_min", MISSING)
    rolloff: float = _axis(
        checks.ROLLOFF,
        "roll-off over lowest wave number, q_r/q_min: the spectrum is flat below",
        1.0,
    )
    h_rms: float | None = _axis(
        number_in(NORMALISATIONS["h_rms"], HEIGHT), "root mean square height in m"
    )
    m2: float | None = _axis(NORMALISATIONS["m2"], "mean square slope")
    c0: float | None = _axis(
        NORMALISATIONS["c0"], "|a_n0|² in m², the same for every H (C0 of the spectrum)"
    )
    amplitudes: Amplitudes = _key(
        get_args(Amplitudes),
        "amplitudes fixed by the power law, or scattered about it (a Gaussian process)",
        "deterministic",
    )

    @property
    def normalisation(self) -> dict[str, float]:
        """The one of h_rms, m2 and c0 that is given, by name."""
        named = {name: getattr(self, name) for name in NORMALISATIONS}
        return {name: value for name, value in named.items() if value is not None}


@dataclass(frozen=True)
class MaterialTable:
    """``[material]``: the elastic half-space, and the strength of the interface."""

    young: float = _axis(checks.YOUNG, "Young's modulus E in Pa", MISSING)
    poisson: float = _axis(checks.POISSON, "Poisson's ratio ν", MISSING)
    adhesion_range: float | None = _axis(
        checks.ADHESION_RANGE,
        "range δ of adhesion in m: surfaces attract each other from a gap of δ on; by default zero",
    )
    strength: float | None = _axis(checks.STRENGTH, "instead of it, the strength γ/δ in Pa")
    work_of_adhesion_open: float | None = _axis(
        checks.WORK_OF_ADHESION,
        "work of adhesion in J/m² where an edge recedes, at least γ, at which it advances; between "
        "both it is pinned. By default γ",
    )
    measure: Measure = _key(
        get_args(Measure), "adhesion acts on the length of the profile, or on its projection", "arc"
    )
    stripes: int | None = _axis(
        checks.HARMONIC,
        "the work of adhesion varies so many times along the period, about γ: "
        "γ (1 + stripe_amplitude cos(2π stripes x/λ + stripe_phase))",
    )
    stripe_amplitude: float | None = _axis(checks.SHARE, "share of γ by which it varies")
    stripe_phase: float = _axis(checks.FINITE, "phase of the stripes at x = 0, in rad", 0.0)

    @property
    def opens(self) -> bool:
        """Whether adhesion has a range."""
        return not (self.adhesion_range is None and self.strength in (None, math.inf))


@dataclass(frozen=True)
class SweepTable:
    """``[sweep]``: one task for every H, γ (and what else is a list) and realisation."""

    hurst: tuple[float, ...] = _key(list_of(number_in(checks.HURST)), "Hurst exponents H")
    work_of_adhesion: tuple[float, ...] = _key(
        list_of(number_in(checks.WORK_OF_ADHESION)), "works of adhesion γ in J/m²"
    )
    realisations: int = _whole(
        1, 2**31 - 1, "profiles for every cell; with [stop] the first of them"
    )
    seed: int = _whole(0, 2**63 - 1, "seed of all profiles", 0)
    zip: tuple[tuple[str, ...], ...] = _key(
        list_of_names(),
        "groups of keys whose lists vary together, instead of in all combinations",
        (),
    )


PathControl = Literal["separation", "load"]


@dataclass(frozen=True, kw_only=True)
class CycleTable:
    """``[cycle]``: the loading path."""

    max_penetration: float | None = _axis(
        Rule(number_in(checks.MAX_PENETRATION).text, number_in(_DISPLACEMENT).read),
        "Δ~max, the penetration in units of h_max at which unloading starts; with a preload, at "
        "which it starts at the latest",
    )
    max_stress: float | None = _axis(
        checks.MAX_STRESS,
        "mean stress in Pa at which unloading starts under a load, instead of max_penetration",
    )
    preload: float | None = _axis(
        checks.MAX_STRESS,
        "mean stress in Pa that a machine reaches before it unloads; max_penetration is then the "
        "latest turning point, and the end of the curves (by default 0.999; needed with a "
        "stiffness)",
    )
    control: PathControl = _key(
        get_args(PathControl), "what is prescribed along the path", "separation"
    )
    load_steps: int = _key(checks.LOAD_STEPS, "equal steps of the loading branch")
    stiffness: float | None = _axis(
        checks.SPRING,
        "stiffness k of what holds the half-space, in Pa/m of nominal area; by default the "
        "separation is fixed. With it, penetrations of the path and of curves are u_tot/h_max",
    )
    unloading_until: float = _key(
        Bounds(-1000, 0.0, without_high=True),
        "end of the stored unloading curve, in units of h_max (the loop itself ends at detachment)",
        -8.0,
    )

    @property
    def under_load(self) -> bool:
        """Whether the path is one of the mean stress."""
        return self.control == "load"

    @property
    def turning_point(self) -> float:
        """Turning point: Δ/h_max, u_tot/h_max of a stiffness, p̄ in Pa of a load or preload."""
        point = self.max_stress if self.under_load else self.preload or self.max_penetration
        assert point is not None  # the file is read so
        return point

    @property
    def turns_at_stress(self) -> bool:
        """Whether the turning point is a mean stress: under a load, or at a preload."""
        return self.under_load or self.preload is not None

    @property
    def deepest(self) -> float:
        """Δ/h_max that the loop does not exceed: its latest turning point; 1 under a load."""
        if self.under_load:
            return 1.0
        return checks.FULL_PENETRATION if self.max_penetration is None else self.max_penetration


@dataclass(frozen=True)
class SolverTable:
    """``[solver]``: the method and its accuracy."""

    method: MethodName = _key(METHOD_NAMES, "how contact states are found; auto chooses", "auto")
    accuracy: float = _key(checks.ACCURACY, "wanted relative error of the loss", 1e-3)
    nodes_per_wave: int | None = _key(
        checks.NODES_PER_WAVE, "nodes per shortest wave, instead of those of accuracy", None
    )
    time_limit: float | None = _key(
        Bounds(1e-30, 1e30, unit="s"), "longest time of one task in s", None, free=True
    )


@dataclass(frozen=True)
class OutputTable:
    """``[output]``: what is kept of a loop, besides losses and curves."""

    jumps: int = _whole(1, 100_000, "places in the catalogue of jumps of a task", 512)
    field_penetrations: tuple[float, ...] | None = _key(
        list_of(number_in(_STORED), may_be_empty=True),
        "penetrations Δ/h_max at which spectra and gaps are kept, on both branches; by default a "
        "third, two thirds and all of max_penetration",
        None,
    )
    field_realisations: int = _whole(
        0, 1000, "so many first realisations keep the fields themselves", 1
    )
    field_nodes: int = _whole(
        16, 65_536, "most nodes of a field that is kept (a power of two is)", 4096
    )


TURNING_POINTS = ("max_penetration", "max_stress", "preload")
"""Keys of the cycle of which one is the turning point."""

Steered = Literal["loss_dimensionless", "loss"]


@dataclass(frozen=True)
class StopTable:
    """``[stop]``: realisations in batches until a mean of every cell is known well enough."""

    relative_error: float | None = _key(
        Bounds(0, 1, without_low=True, without_high=True),
        "how far the 95 % interval of the mean of the quantity may reach from it, over it",
        None,
    )
    quantity: Steered = _key(
        get_args(Steered),
        "column of the results file whose mean is to be known so well",
        "loss_dimensionless",
    )
    batch: int = _whole(1, 2**63 - 1, "realisations that a cell gets at a time", 8)
    most: int = _whole(1, 2**31 - 1, "most realisations of a cell", 1000)


Table = Literal["profile", "material", "sweep", "cycle", "solver", "output", "stop"]
_SWEPT = ("sweep.hurst", "sweep.work_of_adhesion")
_TABLES = (ProfileTable, MaterialTable, SweepTable, CycleTable, SolverTable, OutputTable, StopTable)
TABLES: dict[Table, type] = dict(zip(get_args(Table), _TABLES, strict=True))
KEYS: dict[str, Field[Any]] = {
    f"{table}.{entry.name}": entry for table in TABLES for entry in fields(TABLES[table])
}
"""Every key ("cycle.load_steps") with its rule, meaning and default."""
# Those that may have several values, in the order of the axes; H and γ always are axes.
_AXES = (*_SWEPT, *(key for key, entry in KEYS.items() if entry.metadata["axis"]))


@dataclass(frozen=True)
class Axis:
    """One key of a campaign that has several values (H and γ always are axes)."""

    table: str  # "profile"
    name: str  # "ratio"
    # As they are combined: ascending, or, where keys vary together, in the order of the first; ints
    # where the key is a whole number
    values: tuple[float, ...]
    unit: str
    meaning: str

    @property
    def key(self) -> str:
        """As "profile.ratio"."""
        return f"{self.table}.{self.name}"


@dataclass(frozen=True)
class Campaign:
    """A checked campaign. Built by :mod:`adhesis.ensemble.campaign.file`.

    Equal if they mean the same; ``text`` is the TOML as it was written. Where a key of the profile,
    material or cycle is a list, its table holds the smallest value, ``lists`` all of them as given,
    by key, and :meth:`at` gives the campaign with the values of a task.
    """

    profile: ProfileTable
    material: MaterialTable
    sweep: SweepTable
    cycle: CycleTable
    solver: SolverTable
    output: OutputTable
    stop: StopTable = StopTable()
    lists: dict[str, tuple[float, ...]] = field(default_factory=dict)
    text: str = field(default="", compare=False, repr=False)

    @cached_property
    def _groups(self) -> list[list[Axis]]:
        """The axes in groups that vary together, in the order of the axes, values sorted.

        The order of the values in a file does not matter, except that those of keys which vary
        together belong to one another.
        """
        given = self.lists | {key: self.value(key) for key in _SWEPT}
        member = {name: names for names in self.sweep.zip for name in names}
        groups: dict[tuple[str, ...], list[Axis]] = {}
        for key in _AXES:
            if key in given:
                (table, name), about = key.split("."), KEYS[key].metadata
                bounds = about["rule"].bounds
                unit = _UDUNITS.get(bounds.unit, "1") if bounds else "1"
                axis = Axis(table, name, given[key], unit, about["meaning"])
                groups.setdefault(member.get(name, (name,)), []).append(axis)
        for group in groups.values():
            columns = zip(*sorted(zip(*(axis.values for axis in group), strict=True)), strict=True)
            group[:] = [replace(a, values=v) for a, v in zip(group, columns, strict=True)]
        return list(groups.values())

    @cached_property
    def axes(self) -> tuple[Axis, ...]:
        """H, γ, and every key of the profile, material and cycle that has several values."""
        found = {axis.key: axis for group in self._groups for axis in group}
        return tuple(found[key] for key in _AXES if key in found)

    @cached_property
    def cells(self) -> list[tuple[float, ...]]:
        """Values on the axes of every cell, in the order of the rows of a results file.

        They are all combinations of the groups, the last one varying fastest.
        """
        rows = (zip(*(axis.values for axis in group), strict=True) for group in self._groups)
        keys = [axis.key for group in self._groups for axis in group]
        place = [keys.index(axis.key) for axis in self.axes]
        return [itemgetter(*place)([*chain(*parts)]) for parts in product(*rows)]

    @cached_property
    def finest_harmonic(self) -> int:
        """Highest harmonic of all profiles."""
        return int(max(n0 * ratio for n0, ratio in self.in_cells("profile.n0", "profile.ratio")))

    def in_cells(self, *keys: str) -> list[tuple[Any, ...]]:
        """Return the different values that these keys have together in a cell, ascending."""
        axes = dict(
            zip((axis.key for axis in self.axes), zip(*self.cells, strict=True), strict=True)
        )
        columns = (axes.get(key) or [self.value(key)] * len(self.cells) for key in keys)
        return sorted(set(zip(*columns, strict=True)))

    def has_axis(self, name: str) -> bool:
        """Whether a key ("max_penetration") has several values."""
        return any(axis.name == name for axis in self.axes[2:])

    @property
    def task_count(self) -> int:
        """Number of tasks."""
        return math.prod(len(group[0].values) for group in self._groups) * self.realisations

    @property
    def realisations(self) -> int:
        """Realisations of a cell; with ``[stop]``, the most that it may get."""
        return self.sweep.realisations if self.stop.relative_error is None else self.stop.most

    def at(self, task: Task) -> Campaign:
        """Return the campaign with the values of a task in its tables, and without other axes."""
        if not task.others:
            return self
        tables: dict[str, Any] = {"sweep": replace(self.sweep, zip=())}
        for axis, (name, value) in zip(self.axes[2:], task.others, strict=True):
            table = tables.get(axis.table, getattr(self, axis.table))
            tables[axis.table] = replace(table, **{name: value})
        return replace(self, lists={}, **tables)

    @cached_property
    def _turning(self) -> Axis | None:
        """The axis of turning points, unless other keys vary with it."""
        alone = (group[0] for group in self._groups if len(group) == 1)
        return next((axis for axis in alone if axis.name in TURNING_POINTS), None)

    def branch_of(self, task: Task) -> Task:
        """Return what the tasks that share a task's loading branch have in common.

        They differ in their turning point alone, which it is without; the task itself, if it has a
        branch of its own.
        """
        if self._turning is None:
            return task
        name = self._turning.name
        return replace(task, others=tuple(other for other in task.others if other[0] != name))

    def sharing(self, task: Task) -> list[Task]:
        """Return the tasks that share a task's loading branch, by turning point, and it itself."""
        if self._turning is None:
            return [task]
        name, others = self._turning.name, dict(task.others)
        turns = self._turning.values
        return [replace(task, others=tuple((others | {name: turn}).items())) for turn in turns]

    def identity(self, task: Task) -> tuple[Any, ...]:
        """Return what identifies the cell of a task, also in a campaign that grew new axes."""
        here = self.at(task)
        rest = map(here.value, _AXES[len(_SWEPT) :])
        return (task.hurst, task.work_of_adhesion, *rest)

    def tasks(self, part: Part = WHOLE) -> Tasks:
        """Return every task, or those of a part: by H, γ, what else is an axis, and realisation.

        The order does not depend on that of the file, so that a grown campaign has the rows of one
        that was this large from the start.
        """
        names = tuple(axis.name for axis in self.axes[2:])
        return Tasks(self.cells, names, self.realisations, self.sweep.seed, self.rows(part))

    def rows(self, part: Part = WHOLE) -> NDArray[np.int64]:
        """Rows of the whole campaign that belong to a part, ascending.

        Tasks that share a loading branch go to the same part.
        """
        if part == WHOLE or self._turning is None:
            return np.arange(part.number - 1, self.task_count, part.of)
        branches = np.arange(self.task_count).reshape(-1, self.realisations)
        first: dict[tuple[float, ...], int] = {}
        turn = [axis.name for axis in self.axes].index(self._turning.name)
        for number, cell in enumerate(self.cells):
            rest = cell[:turn] + cell[turn + 1 :]
            branches[number] = first.setdefault(rest, len(first)) * self.realisations
        branches += np.arange(self.realisations)
        return np.flatnonzero(branches.ravel() % part.of == part.number - 1)

    @cached_property
    def penetration(self) -> dict[Branch, Array]:
        """Δ/h_max of the stored curves: loading ascending, unloading descending by the same step.

        The loading curve has shape (load_steps + 1,). With several ``max_penetration`` both are in
        units of it, and that of unloading is as long as the smallest one needs; under a load they
        reach 1, whatever the turning point.
        """
        steps, smallest = self.cycle.load_steps, self.cycle.deepest
        last = math.ceil(self.cycle.unloading_until / smallest * steps - 1e-9)
        top = 1.0 if self.has_axis("max_penetration") else smallest
        places = {"loading": np.arange(steps + 1), "unloading": np.arange(steps, last - 1, -1)}
        return {branch: top * places[branch] / steps for branch in BRANCHES}

    def curve_axes(self, task: Task) -> dict[Branch, Array]:
        """Return Δ/h_max of the curves of a task, which share the axes of the results file."""
        several = self.has_axis("max_penetration")
        unit = self.at(task).cycle.turning_point if several else 1.0
        return {branch: unit * axis for branch, axis in self.penetration.items()}

    def value(self, key: str) -> Any:
        """Return the value in the tables of a key ("cycle.load_steps")."""
        return attrgetter(key)(self)

    def values(self) -> dict[str, Any]:
        """Every value by its key ("sweep.hurst"), defaults included, lists ascending."""
        found = {key: self.value(key) for key in KEYS}
        found = {k: sorted(v) if type(v) is tuple else v for k, v in found.items()}
        return found | {axis.key: list(axis.values) for axis in self.axes}


# ---------------------------------------------------------------------- two campaigns


def differing(one: Campaign, two: Campaign) -> list[str]:
    """Return the keys ("cycle.load_steps") whose values two campaigns do not share."""
    mine, other = one.values(), two.values()
    return [key for key in mine if mine[key] != other[key]]


def growth(
    path: object, old: Campaign, new: Campaign, here: object = "this campaign"
) -> tuple[str, ...]:
    """Return the keys by which the campaign of a results file grew.

    Keys that cannot change a result are left out. InputError for another campaign, with both values
    of each key that differs otherwise.
    """
    before, after = old.values(), new.values()
    grown, other = [], []
    cells = [{one.identity(task) for task in one.tasks().of_cells()} for one in (old, new)]
    is_kept = cells[0] <= cells[1]
    for key in differing(old, new):
        was, value = before[key], after[key]
        if KEYS[key].metadata["free"]:
            continue
        if _extends(key, was, value) and is_kept:
            grown.append(key)
        else:
            here_there = ("not given" if v is None else shown(v) for v in (value, was))
            other.append(f"{key} is {' here and '.join(here_there)} there")
    if other:
        keys = "; ".join(other)
        raise InputError(f"{path} holds another campaign: {keys} (here: {here}, there: {path})")
    return tuple(grown)


def _extends(key: str, was: Any, now: Any) -> bool:
    if key in ("sweep.realisations", "stop.most"):
        return bool(now > was)
    if key == "stop.relative_error":
        return None not in (was, now) and bool(now < was)
    if key not in ("sweep.hurst", "sweep.work_of_adhesion") and not KEYS[key].metadata["axis"]:
        return False
    # All turning points of a profile belong together: they do not become more.
    if key in [f"cycle.{name}" for name in TURNING_POINTS]:
        return False
    fewer, more = (set(value) if isinstance(value, list) else {value} for value in (was, now))
    return fewer < more
