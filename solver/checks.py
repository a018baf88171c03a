"""Check arguments: each function returns the converted value or raises with one sentence.

A value of the wrong type raises a TypeError, a wrong value of the right type a ValueError; the
sentence is "NAME is VALUE: it must be RULE" for both. Each bound is defined here once, for Python,
the command line and campaign files.
"""

from __future__ import annotations

import math
import numbers
import os
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from decimal import ROUND_CEILING, ROUND_FLOOR, Context, Decimal
from pathlib import Path
from typing import Any, TypeGuard, TypeVar

import numpy as np
from numpy.typing import NDArray

T = TypeVar("T")

_LONGEST = 80  # characters of a value in a message


@dataclass(frozen=True)
class Bounds:
    """Bounds of a number.

    Parameters
    ----------
    low, high : float
    without_low, without_high : bool
        Whether the bound itself is excluded.
    or_zero : bool
        Whether 0 is allowed as well.
    or_infinite : bool
        Whether +∞ is allowed as well.
    whole : bool
        Whether it must be a whole number.
    unit : str
        Empty for a number without a unit.
    note : str
        Appended to the rule in messages.
    """

    low: float = -math.inf
    high: float = math.inf
    without_low: bool = False
    without_high: bool = False
    or_zero: bool = False
    or_infinite: bool = False
    whole: bool = False
    unit: str = ""
    note: str = ""

    def holds(self, number: float) -> bool:
        """Return whether a number lies within the bounds; NaN never does, ±∞ only if allowed."""
        if (self.or_zero and number == 0) or (self.or_infinite and number == math.inf):
            return True
        above = number > self.low if self.without_low else number >= self.low
        below = number < self.high if self.without_high else number <= self.high
        return above and below and abs(number) != math.inf

    @property
    def text(self) -> str:
        """Rule in words, to follow "it must be"."""
        low, high = plain(self.low), plain(self.high)
        kind = "a whole number" if self.whole else "a number"
        between = math.isfinite(self.low) and math.isfinite(self.high)
        if between and self.without_low and self.without_high:
            rule = f"{kind} between {low} and {high}, both excluded"
        elif between and not (self.without_low or self.without_high):
            positive = self.low > 0 and not self.whole
            rule = f"{'a positive number' if positive else kind} from {low} to {high}"
        else:
            parts = []
            if math.isfinite(self.low):
                parts.append(f"above {low}" if self.without_low else f"of at least {low}")
            if math.isfinite(self.high):
                parts.append(f"below {high}" if self.without_high else f"at most {high}")
            finite = not (between or self.whole)
            rule = f"{'a finite number' if finite else kind} {' and '.join(parts)}".strip()
        if self.or_zero:
            rule = f"0 or {rule}"
        if self.or_infinite:
            rule = f"infinite, {rule}" if self.or_zero else f"infinite or {rule}"
        return rule + (f", in {self.unit}" if self.unit else "") + self.note


# Beyond these, fourth powers of wave numbers times squares of heights, and quotients of energies,
# leave the range of floating-point numbers.
_LEAST, _MOST = 1e-30, 1e30

LENGTH = Bounds(1e-12, 1e6, unit="m")
"""A period, or a thickness: from a hundredth of an atom to a thousand kilometres."""

HEIGHT = Bounds(_LEAST, _MOST, unit="m")
COEFFICIENT = Bounds(1e-6 * _LEAST, 1e6 * _MOST, unit="m")
HEIGHT_SQUARE = Bounds(_LEAST**2, _MOST**2, unit="m²")

RMS_SLOPE = Bounds(1e-12, 100.0, note="; are heights and period both in m?")
"""Small-strain theory assumes slopes far below 1; loops warn above 0.3. Profiles that test methods
reach some tens; a slope of 100 is a flank at 89.4° to the mean line. Heights in µm taken for m make
the slope 1e6 times too large, and surfaces have slopes of 1e-4 and more. A slope of 1e-12 is the
size of an atomic nucleus on a millimetre."""

MEAN_SQUARE_SLOPE = Bounds(RMS_SLOPE.low**2, RMS_SLOPE.high**2)

YOUNG = Bounds(1e-3, 1e15, unit="Pa")
"""From a thousandth of the modulus of the softest gels to a thousand times that of diamond."""

POISSON = Bounds(-1.0, 0.5, without_low=True)
WORK_OF_ADHESION = Bounds(_LEAST, _MOST, or_zero=True, unit="J/m²")
SHARE = Bounds(0.0, 1.0, without_high=True)
"""Share of the work of adhesion by which it varies along the profile."""
STRENGTH = Bounds(_LEAST, _MOST, or_infinite=True, unit="Pa")
ADHESION_RANGE = Bounds(1e-15, 1.0, unit="m")
"""From the size of a nucleus to lengths that no adhesion has."""
STIFFNESS = Bounds(
    _LEAST,
    _MOST,
    or_zero=True,
    or_infinite=True,
    unit="Pa/m of nominal area",
    note=" (0 is load control, infinite a fixed separation)",
)
SPRING = Bounds(_LEAST, _MOST, unit="Pa/m of nominal area")
STRESS = Bounds(unit="Pa")
MAX_STRESS = Bounds(_LEAST, _MOST, unit="Pa")
# Nearer to full contact no method resolves the last gap: losses at 1 - 1e-7 and 1 - 1e-8 were wrong
# by 1 and by 25 %.
MAX_PENETRATION = Bounds(
    1e-12,
    1.0 - 1e-6,
    note=" (in units of h_max; at 1 the mean gap would be zero, and no such state exists)",
)
FULL_PENETRATION = 0.999
"""Δ/h_max at which a loop turns that has not reached its preload: nearly full contact."""
FAR_DISPLACEMENT = Bounds(1e-12, 1e12, unit="units of h_max")
HURST = Bounds(0.0, 1.0, without_low=True, without_high=True)
ROLLOFF = Bounds(1.0)
SEED = Bounds(0, whole=True)

MOST_WAVES = 100_000
"""Larger profiles need gigabytes of memory; loops have been tested up to a tenth of it."""

HARMONIC = Bounds(1, MOST_WAVES, whole=True)

LOAD_STEPS = Bounds(1, 100_000, whole=True)

ACCURACY = Bounds(1e-10, 1.0, without_high=True)
"""The field is solved to a hundredth of the accuracy, at best to 1e-14 in double precision: at
1e-10 two decimal digits remain."""

NODES_PER_WAVE = Bounds(8, 100_000, whole=True, note="; fewer are too coarse for the shortest wave")

NODES = Bounds(1, 1 << 26, whole=True)
"""An array of so many nodes takes half a gigabyte."""

FINITE = Bounds()


def plain(number: float) -> str:
    """Format a number without padding: 1e9, not 1e+09."""
    if isinstance(number, int):
        return str(number)
    mantissa, e, exponent = f"{number:.6g}".partition("e")
    return mantissa + (f"e{int(exponent)}" if e else "")


def at_least(bound: float, digits: int) -> str:
    """Format a lower bound for a message, rounded up: the number that is shown is allowed."""
    return _rounded(bound, digits, ROUND_CEILING)


def at_most(bound: float, digits: int) -> str:
    """Format an upper bound, rounded down; see :func:`at_least`."""
    return _rounded(bound, digits, ROUND_FLOOR)


def _rounded(bound: float, digits: int, rounding: str) -> str:
    number = Context(digits, rounding).create_decimal(repr(float(bound)))
    return f"{float(number):.{digits}g}"


def counted(number: int, name: str) -> str:
    """Format a count with its noun: "1 jump", "2 jumps", "3 losses"."""
    plural = "es" if name.endswith(("s", "ch")) else "s"
    return f"{number} {name}{'' if number == 1 else plural}"


def shown(value: object) -> str:
    """Return the repr of a value on one line, shortened for a message."""
    if isinstance(value, np.ma.MaskedArray) and value.ndim == 0 and np.ma.is_masked(value):
        return "masked"
    if isinstance(value, np.generic | np.ndarray) and value.ndim == 0 and not carries_unit(value):
        value = value.item()
    try:
        text = repr(value)
    except ValueError:  # an integer of thousands of digits
        text = "a number of thousands of digits"
    except RecursionError:
        text = f"a {type(value).__name__} that is nested too deep"
    text = "".join(c if c.isprintable() else " " for c in text)
    text = " ".join(text.split()) if "\n" in text or "  " in text else text
    return text if len(text) <= _LONGEST else f"{text[:60]} … {text[-10:]}"


_SI = r"(?:m|[Mm]et(?:er|re)s?|Pa|N|J|rad|s)[\^*²³]*-?\d?"
_SI_UNIT = re.compile(rf"[-1]?|(?:1/)?{_SI}(?:[ */·]+{_SI})*")


def carries_unit(value: object) -> bool:
    """Return whether a value is a number or array with a unit, which NumPy would drop."""
    # The attributes of a table are its columns.
    owner = value if isinstance(value, np.ndarray) else type(value)
    if hasattr(owner, "units") or hasattr(owner, "unit"):
        return True
    # Of pandas, perhaps by column, and xarray; an SI unit is that of the numbers.
    attributes = getattr(value, "attrs", {})
    unit = attributes.get("units", "") if isinstance(attributes, Mapping) else ""
    if isinstance(unit, Mapping):
        unit = unit.get(getattr(value, "name", None), "")
    return unit is not None and not _SI_UNIT.fullmatch(str(unit))


def number_of(value: object) -> float | int | None:
    """Convert a real number, NumPy scalars included, to int or float; None for anything else.

    Neither a bool nor an object that carries a unit, as "1 MPa" of astropy or pint, is a number
    here. A fraction too large for a float gives NaN.
    """
    if carries_unit(value):
        return None
    if isinstance(value, np.ndarray):  # np.ma takes time to load, and is not needed for others
        if value.ndim > 0 or np.ma.is_masked(value):
            return None
        value = value.item()
    if _is_bool(value):
        return None
    if isinstance(value, numbers.Integral):
        return int(value)
    if isinstance(value, numbers.Real | Decimal):
        try:
            return float(value)
        except (OverflowError, ValueError):  # large fraction; signalling NaN
            return math.nan
    return None


def real(name: str, value: object, bounds: Bounds = FINITE) -> float:
    """Return a real number between its bounds as a float.

    Raises
    ------
    TypeError
        If it is not a real number: a bool, a text, None, a complex number, an array of several.
    ValueError
        If it is out of bounds or not finite.
    """
    number = number_of(value)
    if number is None:
        raise TypeError(_sentence(name, value, bounds.text))
    try:
        number = float(number)
    except OverflowError:  # an integer beyond the range of floats, out of all bounds
        number = math.nan
    if not bounds.holds(number):
        raise ValueError(_sentence(name, value, bounds.text))
    return number + 0.0  # -0.0 becomes 0.0


def whole(name: str, value: object, bounds: Bounds) -> int:
    """Return a whole number between its bounds as an int; accepts 10.0.

    Raises
    ------
    TypeError, ValueError
        As :func:`real`.
    """
    number = number_of(value)
    if number is None:
        raise TypeError(_sentence(name, value, bounds.text))
    sound = isinstance(number, int) or (math.isfinite(number) and number == int(number))
    if not sound or not bounds.holds(int(number)):
        raise ValueError(_sentence(name, value, bounds.text))
    return int(number)


def flag(name: str, value: object) -> bool:
    """Return True or False; TypeError for anything else."""
    if not _is_bool(value):
        raise TypeError(_sentence(name, value, "True or False"))
    return bool(value)


def choice(name: str, value: T, choices: Iterable[T]) -> T:
    """Return one of several names; TypeError if it is not a text, ValueError for another one."""
    names = tuple(choices)
    rule = f"one of {', '.join(map(str, names))}"
    if not isinstance(value, str):
        raise TypeError(_sentence(name, value, rule))
    if value not in names:
        raise ValueError(_sentence(name, value, rule))
    return value


def instance(name: str, value: T, kind: type[Any], how: str) -> T:
    """Return an object of a class; otherwise a TypeError with ``how`` to make one."""
    if not isinstance(value, kind):
        made = type(value)
        if (made.__module__, made.__qualname__) == (kind.__module__, kind.__qualname__):
            raise TypeError(
                f"{name} is a {kind.__name__} made before a reload of adhesis (importlib.reload, "
                "%autoreload), which makes new classes: start Python anew, and leave adhesis out "
                "of the reload"
            )
        article = "an" if kind.__name__[0] in "AEIOU" else "a"
        raise TypeError(_sentence(name, value, f"{article} {kind.__name__}; make one with {how}"))
    return value


def function(name: str, value: T) -> T:
    """Return a function, or None; TypeError for anything else."""
    if value is not None and not callable(value):
        raise TypeError(_sentence(name, value, "a function, or None"))
    return value


def path(name: str, value: object) -> Path:
    """Return a path; TypeError for anything else.

    Raises
    ------
    TypeError
        If it is no path, or one of bytes.
    ValueError
        If no file can have this name: it is empty, or holds a NUL or half a character.
    """
    if not isinstance(value, str | os.PathLike) or not isinstance(os.fspath(value), str):
        raise TypeError(_sentence(name, value, "a path"))
    text = os.fspath(value)
    try:
        possible = bool(text) and b"\0" not in os.fsencode(text)
    except UnicodeEncodeError:
        possible = False
    if not possible:
        raise ValueError(_sentence(name, text, "the name of a file"))
    return Path(text)


def row(
    name: str, values: object, *, entry: str = "value", imaginary: bool = False
) -> NDArray[Any]:
    """Return a row of numbers as an array of float64 (complex128 if ``imaginary``), shape (n,).

    Accepts lists, arrays, objects that NumPy converts to arrays (a column of a table) and
    iterators, with entries of any real type. The caller checks whether they are finite, and how
    many.

    Raises
    ------
    TypeError
        If it is not a row of numbers: a text, a mapping, booleans, complex numbers, objects.
    ValueError
        If an entry is masked, or it has several dimensions.
    """
    if isinstance(values, str | bytes | Mapping | set | frozenset) or values is None:
        raise TypeError(_sentence(name, values, "a row of numbers"))
    if carries_unit(values):
        raise TypeError(_with_unit(name))
    if not hasattr(values, "__array__") and not isinstance(values, list | tuple):
        if not isinstance(values, Iterable):
            raise TypeError(_sentence(name, values, "a row of numbers"))
        values = list(values)
    masked = np.ma.getmaskarray(values) if isinstance(values, np.ma.MaskedArray) else None
    if masked is not None and masked.any():
        first = int(np.flatnonzero(masked)[0])
        raise ValueError(
            f"{name}[{first}] is masked ({int(masked.sum())} in all): every {entry} must be given; "
            "fill what is missing first"
        )
    if isinstance(values, list | tuple):  # to NumPy [True, 2] is [1, 2], and ["1", 2] are texts
        for index, value in enumerate(values):
            of_row = isinstance(value, list | tuple | np.ndarray) and np.ndim(value) > 0
            if not of_row and number_of(value) is None:
                if imaginary and isinstance(value, numbers.Complex) and not _is_bool(value):
                    continue
                raise TypeError(_sentence(f"{name}[{index}]", value, "a real number"))
    try:
        array = np.asarray(values)
    except ValueError:
        raise ValueError(f"{name} holds rows of different lengths: it must be one row") from None
    if array.ndim != 1:
        raise ValueError(f"{name} has {array.ndim} dimensions: it must be one row of numbers")
    if array.dtype.kind == "O":
        found = [number_of(value) for value in array]
        if None in found:
            index = found.index(None)
            raise TypeError(_sentence(f"{name}[{index}]", array[index], "a real number"))
        return np.array(found, dtype=np.complex128 if imaginary else np.float64)
    if array.dtype.kind not in ("fiuc" if imaginary else "fiu"):
        kinds = {"b": "booleans", "c": "complex numbers", "U": "texts", "S": "texts"}
        held = kinds.get(array.dtype.kind, str(array.dtype))
        raise TypeError(f"{name} holds {held}: every {entry} must be a real number")
    return np.asarray(array, dtype=np.complex128 if imaginary else np.float64)


def reals(name: str, values: object) -> NDArray[np.float64]:
    """Return real numbers of any shape as an array; NaN and ±∞ pass.

    Raises
    ------
    TypeError
        If it holds anything else: texts, booleans, complex numbers, objects.
    ValueError
        If an entry is masked, or rows differ in length.
    """
    if carries_unit(values):
        raise TypeError(_with_unit(name))
    if np.ma.is_masked(values):
        raise ValueError(f"{name} holds masked values: every value must be given")
    try:
        array = np.asarray(values)
    except ValueError:
        raise ValueError(f"{name} holds rows of different lengths") from None
    if array.dtype.kind not in "fiu":
        raise TypeError(_sentence(name, values, "a real number, or an array of them"))
    return np.asarray(array, dtype=np.float64)


def check_index(name: str, values: Any) -> None:
    """Raise ValueError if a column of pandas, or a row of xarray, has rows left out or moved.

    Its numeric index then has unequal steps; other objects pass.
    """
    # tables and columns of pandas have iloc
    indexes = [values.index] if hasattr(values, "iloc") else getattr(values, "indexes", {}).values()
    index = next(iter(indexes), None)
    if index is None or index.dtype.kind not in ("i", "u", "f"):
        return
    apart = np.diff(index.to_numpy(float, na_value=np.nan))
    if apart.size and np.ptp(apart) > 0.5 * np.abs(apart).min():
        raise ValueError(
            f"the index of {name} leaves rows out, or has another order, and the heights have no "
            "positions: put the rows in (reindex), or number them anew (reset_index(drop=True))"
        )


def finite_row(
    name: str, values: object, *, entry: str = "value", imaginary: bool = False
) -> NDArray[Any]:
    """Return a row of finite numbers, as :func:`row`; ValueError if one is not finite."""
    array = row(name, values, entry=entry, imaginary=imaginary)
    bad = np.flatnonzero(~np.isfinite(array))
    if bad.size:
        raise ValueError(
            f"{name}[{bad[0]}] is {array[bad[0]]}: every {entry} must be a finite number"
        )
    return array


def _is_bool(value: object) -> TypeGuard[bool | np.bool_]:
    return isinstance(value, bool | np.bool_)


def _with_unit(name: str) -> str:
    return f"{name} carries a unit, which would be lost: convert it to SI units, and give numbers"


def _sentence(name: str, value: object, rule: str) -> str:
    return f"{name} is {_described(value)}: it must be {rule}"


def _described(value: object) -> str:
    """Describe a value in a message: its repr, for other objects only their class."""
    plainly = (str, bytes, numbers.Number, np.generic, np.ndarray, list, tuple, dict, set)
    if value is None or isinstance(value, plainly):
        return shown(value)
    if isinstance(value, type):
        return f"the class {value.__name__}"
    kind = type(value).__name__
    return f"{'an' if kind[0] in 'AEIOUaeiou' else 'a'} {kind}"
