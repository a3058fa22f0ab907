"""Arguments from outside: each is what it should be, or there is one exception that says what is wrong."""

from __future__ import annotations

import math
import operator
import re
import reprlib
import sys
from collections.abc import Callable
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

_METRES = {"": 1.0, "m": 1.0, "dm": 0.1, "cm": 0.01, "mm": 0.001, "um": 1e-6}
"""Metres in the units that a length may be stated in by mistake. A length without a unit has metres."""


def array_of(name: str, value: Any, kinds: str, what: str) -> NDArray[Any]:
    """Make an array of what may be one, without a copy where it is one. ``kinds`` are those of ``dtype.kind``."""
    if hasattr(value, "detach") and hasattr(value, "cpu"):
        value = value.detach().cpu()
    try:
        array = np.asarray(value)
    except ValueError as error:
        # Rows of several lengths.
        raise ValueError(f"{name}: {error}") from None
    if array.size == 0 and array.dtype == np.float64 and not hasattr(value, "dtype"):
        # An empty list says nothing of its elements.
        return array
    if array.dtype.kind not in kinds:
        raise TypeError(f"{name} have dtype {array.dtype}: they are {what}")
    return array


def rows_of(name: str, array: NDArray[Any], columns: int) -> NDArray[Any]:
    """Check that an array has so many columns. An empty list has no rows."""
    if array.ndim == 1 and array.size == 0:
        return array.reshape(0, columns)
    if array.ndim != 2 or array.shape[1] != columns:
        raise ValueError(f"{name} have shape {array.shape} in place of (N, {columns})")
    return array


def places_of(name: str, value: Any) -> NDArray[Any]:
    """Check places: finite numbers of shape (N, 3), as float32 or float64."""
    array = rows_of(name, array_of(name, value, "fiu", "numbers (metres)"), 3)
    if array.dtype not in (np.float32, np.float64):
        array = array.astype(np.float32 if array.dtype == np.float16 else np.float64)
    if not np.isfinite(array).all():
        row = int(np.flatnonzero(~np.isfinite(array).all(axis=1))[0])
        raise ValueError(f"{name}: row {row} is {array[row].tolist()}, which is not finite")
    return array


def faces_of(value: Any, vertices: int) -> NDArray[np.uint32]:
    """Check faces: integers of shape (F, 3), each below the number of vertices."""
    array = rows_of("faces", array_of("faces", value, "iu", "integers, the numbers of vertices"), 3)
    if array.size and not (int(array.min()) >= 0 and int(array.max()) < vertices):
        wrong = int(array.min()) if int(array.min()) < 0 else int(array.max())
        raise ValueError(f"faces: vertex {wrong} asked for, but there are {vertices}")
    return array.astype(np.uint32, copy=False)


def normals_of(value: Any, count: int) -> NDArray[np.float32] | None:
    """Check normals: finite numbers of shape (N, 3), one a point."""
    if value is None:
        return None
    array = places_of("normals", value)
    return same_count("normals", array, count).astype(np.float32, copy=False)


def colors_of(value: Any, count: int) -> NDArray[np.uint8] | None:
    """Check colours: uint8 of shape (N, 3), or (N, 4), of which the last is left out."""
    if value is None:
        return None
    array = array_of("colors", value, "u", "uint8 (sRGB, 0 to 255)")
    if array.dtype != np.uint8:
        if array.size:
            raise TypeError(f"colors have dtype {array.dtype}: they are uint8 (sRGB, 0 to 255)")
        array = array.astype(np.uint8)
    if array.ndim == 2 and array.shape[1] == 4:
        array = array[:, :3]
    return same_count("colors", rows_of("colors", array, 3), count)


def same_count(name: str, array: NDArray[Any], count: int) -> NDArray[Any]:
    """Check that there is a row for each vertex or point."""
    if len(array) != count:
        raise ValueError(f"there are {len(array)} {name} for {count} positions")
    return array


def depth_of(value: Any) -> NDArray[np.float32]:
    """Check a depth image: metres, or integers, which are millimetres."""
    array = array_of("depths", value, "fiu", "numbers (metres), or integers (millimetres)")
    if array.ndim != 2:
        raise ValueError(f"a depth image has shape {array.shape} in place of (rows, columns)")
    if array.dtype.kind in "iu":
        return array.astype(np.float32) / np.float32(1000)
    return array.astype(np.float32, copy=False)


def frames_of(frames: slice | range | tuple[int, int] | None, what: str = "frames") -> tuple[int, int | None] | None:
    """Check a range of frames: its first one and the one behind its last, or None for the end."""
    if frames is None:
        return None
    first: Any
    end: Any
    if isinstance(frames, tuple):
        if len(frames) != 2:
            raise ValueError(f"{what} are {shown(frames)}: a tuple has two numbers, the first frame and the end")
        first, end, step = *frames, 1
    elif isinstance(frames, (slice, range)):
        first, end, step = frames.start, frames.stop, 1 if frames.step is None else frames.step
    else:
        wanted = "a slice such as slice(10, 20), a range, or a tuple (first, end)"
        raise TypeError(f"{what} are {shown(frames)}: {wanted}")
    if step != 1:
        raise ValueError(f"{what} follow one another: the step is {shown(step)}")
    start = 0 if first is None else _index(what, first, "a frame number")
    stop = None if end is None else _index(what, end, "a frame number")
    if start < 0 or (stop is not None and stop <= start):
        raise ValueError(f"{what} {shown(start)} to {shown(stop)}: there are none")
    if max(start, stop or 0) > sys.maxsize:
        raise ValueError(f"{what} {shown(start)} to {shown(stop)}: numbers up to {sys.maxsize}")
    return start, stop


def progress_of(progress: Callable[[int, int | None], object] | None) -> Callable[[int, int | None], object] | None:
    """Check a callback."""
    if progress is not None and not callable(progress):
        raise TypeError(f"progress is a function, not {type(progress).__name__}")
    return progress


def shown(value: Any) -> str:
    """Show a value in a message, which long values do not fill."""
    if isinstance(value, int) and value.bit_length() > 128:
        return f"an integer of {value.bit_length()} bits"
    return reprlib.repr(value)


def number_of(name: str, value: Any, unit: str) -> float:
    """Check a number. It may be one of NumPy, but neither text nor a truth value."""
    if isinstance(value, (str, bytes, bool, np.bool_)):
        length = _metres_in(value) if unit == "metres" else None
        hint = "" if length is None else f", such as {name}={length:g}"
        raise TypeError(f"{name} is {shown(value)}: a number ({unit}){hint}")
    try:
        return float(value)
    except (TypeError, ValueError):
        raise TypeError(f"{name} is {shown(value)}: a number ({unit})") from None
    except OverflowError:
        raise ValueError(f"{name} is {shown(value)}: too large ({unit})") from None


def voxel_of(name: str, value: Any) -> float | Literal["auto"]:
    """Check the edge of a voxel: a length, or "auto"."""
    if isinstance(value, str):
        if value == "auto":
            return "auto"
        length = _metres_in(value) or 0.005
        raise ValueError(f'{name} is {shown(value)}: a number (metres), such as {name}={length:g}, or "auto"')
    return number_of(name, value, "metres")


def _metres_in(text: object) -> float | None:
    """Length (m) that a text such as ``5mm`` states, as the command line takes it."""
    if not isinstance(text, str):
        return None
    found = re.fullmatch(r"([0-9]+\.?[0-9]*|\.[0-9]+)\s*(um|mm|cm|dm|m|)", text.strip())
    return None if found is None else float(found[1]) * _METRES[found[2]]


def whole_of(name: str, value: Any, low: int = 0, high: int = sys.maxsize) -> int:
    """Check a whole number from ``low`` to ``high``."""
    number = _index(name, value, "a whole number")
    if not low <= number <= high:
        wanted = f"from {low} on" if high == sys.maxsize else f"from {low} to {high}"
        raise ValueError(f"{name} is {shown(number)}: a number {wanted}")
    return number


def bytes_of(name: str, value: Any) -> int:
    """Check a number of bytes above 0."""
    number = _index(name, value, "a number of bytes above 0")
    if not 0 < number < 2**64:
        raise ValueError(f"{name} is {shown(number)}: a number of bytes above 0 and below 2**64")
    return number


def _index(name: str, value: Any, what: str) -> int:
    try:
        if not isinstance(value, (bool, np.bool_)):
            return operator.index(value)
    except TypeError:
        pass
    raise TypeError(f"{name} is {shown(value)}: {what}")


def flag_of(name: str, value: Any) -> bool:
    """Check a truth value."""
    if not isinstance(value, (bool, np.bool_)):
        raise TypeError(f"{name} is {shown(value)}: True or False")
    return bool(value)


def text_of(name: str, value: Any) -> str:
    """Check a text."""
    if not isinstance(value, str):
        raise TypeError(f"{name} is {shown(value)}: text (str)")
    try:
        value.encode()
    except UnicodeEncodeError:
        raise ValueError(f"{name} is {shown(value)}: text with half of a surrogate pair") from None
    return value


def place_of(name: str, value: Any) -> tuple[float, float, float]:
    """Check a place: three finite coordinates."""
    x, y, z = numbers_of(name, value, 3, "coordinates (x, y, z)")
    if not all(math.isfinite(coordinate) for coordinate in (x, y, z)):
        raise ValueError(f"{name} is {shown(value)}: coordinates are finite")
    return x, y, z


def numbers_of(name: str, value: Any, count: int, what: str) -> tuple[float, ...]:
    """Check a sequence of so many numbers."""
    try:
        parts = None if isinstance(value, (str, bytes)) else tuple(value)
    except TypeError:
        parts = None
    if parts is None:
        raise TypeError(f"{name} is {shown(value)}: {count} {what}")
    if len(parts) != count:
        raise ValueError(f"{name} is {shown(value)}: {count} {what}")
    return tuple(number_of(name, part, what) for part in parts)
