"""Point clouds of ``sensor_msgs/PointCloud2`` as arrays, by its documented layout. Needs NumPy alone."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

# Numbers of sensor_msgs/PointField.
_DTYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
_FLOAT32 = 7

Field = tuple[str, int, int, int]
"""Name, offset (bytes), number of the data type, and count of a ``PointField``."""


def to_arrays(cloud: Any) -> tuple[NDArray[np.float32], NDArray[np.uint8] | None]:
    """Read a message.

    Args:
        cloud: A ``PointCloud2``, or what has its attributes.

    Returns:
        Positions float32 (N, 3) in metres, and colours uint8 (N, 3) from a field ``rgb`` or ``rgba``, or None. Points that
        are not finite are left out.

    Raises:
        ValueError: There are no fields x, y, z, or the data is too short.
    """
    fields = {field.name: field for field in cloud.fields}
    if not {"x", "y", "z"} <= fields.keys():
        raise ValueError(f"a cloud has fields x, y and z, not {sorted(fields)}")
    rows, columns = int(cloud.height), int(cloud.width)
    data = np.frombuffer(bytes(cloud.data), np.uint8)
    if data.size < rows * cloud.row_step or cloud.row_step < columns * cloud.point_step:
        raise ValueError(f"{data.size} bytes are too few for {rows} x {columns} points")
    data = data[: rows * cloud.row_step].reshape(rows, cloud.row_step)[:, : columns * cloud.point_step]
    points = data.reshape(rows * columns, cloud.point_step)
    order = ">" if cloud.is_bigendian else "<"

    def column(name: str, dtype: str) -> NDArray[Any]:
        offset, size = fields[name].offset, np.dtype(dtype).itemsize
        if offset + size > cloud.point_step:
            raise ValueError(f"field {name} lies beyond a point of {cloud.point_step} bytes")
        return np.ascontiguousarray(points[:, offset : offset + size]).view(order + dtype)[:, 0]

    positions = np.stack([column(name, _DTYPES[fields[name].datatype]) for name in "xyz"], axis=1).astype(np.float32)
    finite = np.isfinite(positions).all(axis=1)
    name = next((name for name in ("rgb", "rgba") if name in fields), None)
    if name is None:
        return positions[finite], None
    packed = column(name, "u4")
    colours = np.stack([packed >> shift & 255 for shift in (16, 8, 0)], axis=1).astype(np.uint8)
    return positions[finite], colours[finite]


def layout(has_colours: bool) -> list[Field]:
    """Return the fields of a message that :func:`to_bytes` makes the data of."""
    names = ("x", "y", "z", "rgb") if has_colours else ("x", "y", "z")
    return [(name, 4 * place, _FLOAT32, 1) for place, name in enumerate(names)]


def to_bytes(positions: NDArray[np.float32], colours: NDArray[np.uint8] | None) -> bytes:
    """Return the data of points, little-endian, as :func:`layout` says: positions (N, 3), and colours (N, 3) if there are any."""
    if colours is None:
        return positions.astype("<f4").tobytes()
    points = np.empty((len(positions), 4), "<f4")
    points[:, :3] = positions
    red, green, blue = (colours[:, channel].astype("<u4") for channel in range(3))
    points[:, 3] = (red << 16 | green << 8 | blue).astype("<u4").view("<f4")
    return points.tobytes()
