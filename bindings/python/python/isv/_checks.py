"""Arrays from outside: each is what it should be, or there is one exception that says what is wrong."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray


def array_of(name: str, value: Any, kinds: str, what: str) -> NDArray[Any]:
    """Make an array of what may be one, without a copy where it is one. ``kinds`` are those of ``dtype.kind``."""
    if hasattr(value, "detach") and hasattr(value, "cpu"):
        value = value.detach().cpu()
    array = np.asarray(value)
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
    if isinstance(frames, tuple):
        start, stop, step = frames[0], frames[1], 1
    else:
        start, stop, step = frames.start or 0, frames.stop, frames.step or 1
    if step != 1:
        raise ValueError(f"{what} follow one another: the step is {step}")
    if start < 0 or (stop is not None and stop <= start):
        raise ValueError(f"{what} {start} to {stop}: there are none")
    return int(start), None if stop is None else int(stop)


def progress_of(progress: Callable[[int, int | None], object] | None) -> Callable[[int, int | None], object] | None:
    """Check a callback."""
    if progress is not None and not callable(progress):
        raise TypeError(f"progress is a function, not {type(progress).__name__}")
    return progress
