"""Maps of other programs as :class:`isv.Volume`, and back.

========================  ==========================================  =======================================
program                   function                                    layout as of
========================  ==========================================  =======================================
NumPy                     :func:`from_dense`, ``Volume.to_dense``
Open3D VoxelBlockGrid     :func:`from_open3d`, :func:`to_open3d`      Open3D 0.20
nvblox (nvblox_torch)     :func:`from_nvblox`, :func:`to_nvblox`      2025: ``TsdfLayer.get_all_blocks``
voxblox                   :func:`from_voxblox`, :func:`read_voxblox`  2019: ``Block.proto``, ``Layer.proto``
========================  ==========================================  =======================================

None of these programs is imported, but for :func:`to_open3d`.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Iterator, Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._data import Volume

__all__ = [
    "from_dense",
    "from_nvblox",
    "from_open3d",
    "from_voxblox",
    "read_voxblox",
    "to_nvblox",
    "to_open3d",
]

_EDGES = (4, 8, 16)


def from_dense(
    field: ArrayLike,
    voxel: float,
    *,
    first: Sequence[int] = (0, 0, 0),
    axes: Literal["zyx", "xyz"] = "zyx",
    truncation: int = 8,
    edge: Literal[4, 8, 16] = 8,
) -> Volume:
    """Make a volume of a dense array of distances.

    Args:
        field: Distances at the centres of voxels (m), a 3-D array of numbers: negative inside, NaN where nothing was
            observed.
        voxel: Edge of a voxel (m).
        first: Index (x, y, z) of the first voxel: the centre of the voxel (i, j, k) is at
            ``(first + (i, j, k) + 0.5) * voxel``.
        axes: Axes of the array: ``field[z, y, x]`` or ``field[x, y, z]``.
        truncation: Distance from the surface at which distances are cut off (voxels).
        edge: Edge of a block (voxels). Streams of profile "main" have blocks of 8.

    Returns:
        The volume. Blocks in which all distances are cut off, or nothing was observed, are left out.

    Raises:
        TypeError: The field holds no numbers.
        ValueError: The field has no 3 axes, or another argument is out of range.
    """
    array = np.asarray(field)
    if array.dtype.kind not in "fiu":
        raise TypeError(f"a field has dtype {array.dtype}: it holds numbers (metres)")
    if array.ndim != 3:
        raise ValueError(f"a field has shape {array.shape}: it has 3 axes")
    if axes not in ("zyx", "xyz"):
        raise ValueError(f'axes is "zyx" or "xyz", not {axes!r}')
    if edge not in _EDGES:
        raise ValueError(f"edge is 4, 8 or 16, not {edge!r}")
    array = array.astype(np.float32, copy=False)
    if axes == "xyz":
        array = array.transpose(2, 1, 0)
    low = np.floor_divide(np.asarray(first, np.int64), edge)
    before = np.asarray(first, np.int64) - low * edge
    blocks = -(-(before + array.shape[::-1]) // edge)
    padded = np.full(tuple(int(n) * edge for n in blocks[::-1]), np.nan, np.float32)
    x, y, z = (int(n) for n in before)
    padded[z : z + array.shape[0], y : y + array.shape[1], x : x + array.shape[2]] = array
    nx, ny, nz = (int(n) for n in blocks)
    cubes = padded.reshape(nz, edge, ny, edge, nx, edge).transpose(0, 2, 4, 1, 3, 5)
    cubes = cubes.reshape(-1, edge, edge, edge)
    index = np.stack(np.unravel_index(np.arange(len(cubes)), (nz, ny, nx)), axis=1)[:, ::-1] + low
    return _kept(index, cubes, voxel, truncation)


def from_open3d(grid: Any, *, truncation: float = 8.0) -> Volume:
    """Make a volume of an ``open3d.t.geometry.VoxelBlockGrid`` with the attributes "tsdf" and "weight".

    Open3D has its samples at the lowest corners of voxels, a stream at their centres: what is decoded lies half a voxel
    farther along each axis than in Open3D.

    Args:
        grid: The grid. Its blocks have 4, 8 or 16 voxels along an edge.
        truncation: What ``integrate`` was told as ``trunc_voxel_multiplier`` (voxels): a TSDF of 1 is that far away.

    Returns:
        The volume. Voxels of weight 0 are not observed.

    Raises:
        TypeError: The grid is none.
        ValueError: The blocks have another edge, or the truncation is out of range.
    """
    if not (hasattr(grid, "hashmap") and hasattr(grid, "attribute")):
        raise TypeError(f"a grid is an open3d VoxelBlockGrid, not {type(grid).__name__}")
    if not 0 < truncation <= 64:
        raise ValueError(f"truncation is {truncation}: a number of voxels above 0")
    hashmap = grid.hashmap()
    slots = _numpy(hashmap.active_buf_indices()).astype(np.int64)
    coords = _numpy(hashmap.key_tensor())[slots]
    tsdf = _numpy(grid.attribute("tsdf"))[slots]
    weight = _numpy(grid.attribute("weight"))[slots]
    edge = tsdf.shape[1]
    if edge not in _EDGES:
        raise ValueError(f"the grid has blocks of {edge} voxels: they have 4, 8 or 16")
    voxel = float(_open3d_voxel(grid))
    shape = (len(slots), edge, edge, edge)
    distances = tsdf.reshape(shape).astype(np.float32) * np.float32(truncation * voxel)
    distances[weight.reshape(shape) == 0] = np.nan
    return _sorted(coords, distances, voxel, round(truncation))


def to_open3d(volume: Volume, *, weight: float = 1.0, device: str = "CPU:0") -> Any:
    """Make an ``open3d.t.geometry.VoxelBlockGrid`` of a volume, with the attributes "tsdf" and "weight" (float32).

    The surface lies half a voxel lower along each axis than in the volume, as :func:`from_open3d` says.

    Args:
        volume: The volume.
        weight: Weight of observed voxels; others have 0.
        device: Device of the grid.

    Raises:
        ImportError: open3d is not installed.
    """
    import open3d

    core = open3d.core
    count, edge = len(volume.coords), volume.edge
    place = core.Device(device)
    grid = open3d.t.geometry.VoxelBlockGrid(
        ("tsdf", "weight"),
        (core.float32, core.float32),
        ((1,), (1,)),
        volume.voxel,
        edge,
        max(count, 1),
        place,
    )
    if count == 0:
        return grid
    slots, _ = grid.hashmap().activate(core.Tensor(np.ascontiguousarray(volume.coords), device=place))
    unobserved = np.isnan(volume.distances)
    tsdf = volume.distances / np.float32(volume.truncation * volume.voxel)
    tsdf = np.clip(np.where(unobserved, np.float32(1), tsdf), -1, 1).astype(np.float32)
    weights = np.where(unobserved, 0, weight).astype(np.float32)
    index = slots.to(core.int64)
    for name, values in (("tsdf", tsdf), ("weight", weights)):
        attribute = grid.attribute(name)
        attribute[index] = core.Tensor(values.reshape(count, edge, edge, edge, 1), device=place)
    return grid


def from_nvblox(
    blocks: Sequence[Any], indices: Sequence[Any], voxel: float, *, truncation: int = 4, min_weight: float = 0.0
) -> Volume:
    """Make a volume of a TSDF layer of nvblox.

    ``from_nvblox(*layer.get_all_blocks(), layer.voxel_size())`` with ``layer = mapper.tsdf_layer_view()``.

    Args:
        blocks: Blocks of shape (8, 8, 8, 2) with axes (x, y, z, channel), whose channels are the distance (m) and the
            weight: tensors of PyTorch on any device, or arrays.
        indices: Places of the blocks (x, y, z), in blocks.
        voxel: Edge of a voxel (m).
        truncation: Distance at which nvblox cut distances off (voxels): its ``truncation_distance_vox``.
        min_weight: Voxels of this weight or less are not observed.

    Raises:
        ValueError: The blocks have another shape, or there is another number of indices.
    """
    if len(blocks) != len(indices):
        raise ValueError(f"there are {len(indices)} indices for {len(blocks)} blocks")
    samples = np.stack([_numpy(block) for block in blocks]) if len(blocks) else np.empty((0, 8, 8, 8, 2), np.float32)
    if samples.shape[1:] != (8, 8, 8, 2):
        raise ValueError(f"a block has shape {samples.shape[1:]} in place of (8, 8, 8, 2)")
    coords = np.array([_numpy(index) for index in indices], np.int64).reshape(-1, 3)
    distances = samples[..., 0].transpose(0, 3, 2, 1).astype(np.float32)
    distances[samples[..., 1].transpose(0, 3, 2, 1) <= min_weight] = np.nan
    return _sorted(coords, distances, voxel, truncation)


def to_nvblox(volume: Volume, *, weight: float = 1.0) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """Make blocks as nvblox has them of a volume with blocks of 8 voxels.

    Args:
        volume: The volume.
        weight: Weight of observed voxels; others have distance and weight 0.

    Returns:
        Blocks, float32 of shape (B, 8, 8, 8, 2) with axes (block, x, y, z, channel), and their places, int32 of shape
        (B, 3), in blocks.

    Raises:
        ValueError: The volume has blocks of another edge.
    """
    if volume.edge != 8:
        raise ValueError(f"the volume has blocks of {volume.edge} voxels: those of nvblox have 8")
    distances = volume.distances.transpose(0, 3, 2, 1)
    observed = ~np.isnan(distances)
    blocks = np.stack([np.where(observed, distances, 0), observed * np.float32(weight)], axis=-1)
    return blocks.astype(np.float32), volume.coords.astype(np.int32)


def from_voxblox(
    coords: ArrayLike,
    voxel_data: ArrayLike,
    voxel: float,
    *,
    truncation: int = 4,
    min_weight: float = 0.0,
) -> Volume:
    """Make a volume of the blocks of a TSDF layer of voxblox.

    Args:
        coords: Places of the blocks (x, y, z), in blocks: ``round(origin / (voxels_per_side * voxel_size))``.
        voxel_data: The field ``voxel_data`` of each block, uint32 of shape (B, 3 * voxels_per_side**3): for each voxel,
            x fastest, then y, then z, the bits of its distance (m), of its weight, and its colour.
        voxel: Edge of a voxel (m).
        truncation: Distance at which voxblox cut distances off (voxels).
        min_weight: Voxels of this weight or less are not observed.

    Raises:
        TypeError: The data are not uint32.
        ValueError: The blocks have no 4, 8 or 16 voxels along an edge.
    """
    words = np.asarray(voxel_data)
    if words.dtype != np.uint32:
        raise TypeError(f"voxel_data have dtype {words.dtype}: they are uint32")
    edges = [edge for edge in _EDGES if words.ndim == 2 and words.shape[1] == 3 * edge**3]
    if not edges:
        raise ValueError(f"voxel_data have shape {words.shape}: blocks have 4, 8 or 16 voxels along an edge")
    edge = edges[0]
    samples = words.reshape(len(words), edge, edge, edge, 3)
    distances = np.ascontiguousarray(samples[..., 0]).view(np.float32).copy()
    weights = np.ascontiguousarray(samples[..., 1]).view(np.float32)
    distances[~(weights > min_weight)] = np.nan
    return _sorted(np.asarray(coords, np.int64).reshape(-1, 3), distances, voxel, truncation)


def read_voxblox(path: str | os.PathLike[str], *, truncation: int = 4, min_weight: float = 0.0) -> Volume:
    """Read a file of voxblox (``.vxblx``, ``.tsdf``) that holds one TSDF layer: the one that its server saves.

    Args:
        path: The file.
        truncation: Distance at which voxblox cut distances off (voxels).
        min_weight: Voxels of this weight or less are not observed.

    Raises:
        OSError: The file cannot be read.
        ValueError: The file is damaged, or holds another kind of layer.
    """
    with open(path, "rb") as file:
        data = file.read()
    try:
        return _voxblox_layer(data, truncation, min_weight)
    except (IndexError, struct.error):
        raise ValueError(f"{os.fspath(path)}: the file ends inside a message") from None
    except ValueError as error:
        raise ValueError(f"{os.fspath(path)}: {error}") from None


def _voxblox_layer(data: bytes, truncation: int, min_weight: float) -> Volume:
    count, at = _varint(data, 0)
    messages = []
    while at < len(data):
        size, at = _varint(data, at)
        if at + size > len(data):
            raise IndexError
        messages.append(data[at : at + size])
        at += size
    if count != len(messages) or not messages:
        raise ValueError(f"there are {len(messages)} messages in place of {count}")
    layer = {number: value for number, value, _ in _fields(messages[0])}
    kind = layer.get(3, b"")
    if kind != b"tsdf":
        raise ValueError(f"a layer of type {kind!r} in place of b'tsdf'")
    voxel, side = layer.get(1), layer.get(2)
    if not isinstance(voxel, float) or not voxel > 0 or side not in _EDGES:
        raise ValueError(f"blocks of {side} voxels of {voxel} m: they have 4, 8 or 16 along an edge")
    coords, blocks = [], []
    for message in messages[1:]:
        origin, words = _voxblox_block(message)
        if len(words) != 3 * int(side) ** 3:
            raise ValueError(f"a block has {len(words)} words in place of {3 * int(side) ** 3}")
        coords.append(np.rint(np.array(origin) / (voxel * int(side))))
        blocks.append(words.astype(np.uint32))
    if not blocks:
        edge = int(side)
        return Volume(voxel, np.empty((0, 3), np.int32), np.empty((0, edge, edge, edge), np.float32), truncation)
    places = np.array(coords)
    if not (np.isfinite(places).all() and np.abs(places).max() < 2**30):
        raise ValueError("a block is too far away")
    return from_voxblox(places, np.stack(blocks), voxel, truncation=truncation, min_weight=min_weight)


def _varint(data: bytes, at: int) -> tuple[int, int]:
    """Read a number of Protocol Buffers. Returns it and the place behind it."""
    value = 0
    for shift in range(0, 64, 7):
        byte = data[at]
        at += 1
        value |= (byte & 0x7F) << shift
        if byte < 0x80:
            return value, at
    raise ValueError("a number has more than 64 bits")


def _varints(data: bytes) -> NDArray[np.uint64]:
    """Read numbers of Protocol Buffers, one after the other."""
    octets = np.frombuffer(data, np.uint8)
    ends = np.flatnonzero(octets < 0x80)
    if len(octets) and (len(ends) == 0 or ends[-1] != len(octets) - 1):
        raise IndexError
    starts = np.concatenate([[0], ends[:-1] + 1]) if len(ends) else ends
    lengths = ends - starts + 1
    if len(lengths) and lengths.max() > 10:
        raise ValueError("a number has more than 64 bits")
    values = np.zeros(len(ends), np.uint64)
    for octet in range(int(lengths.max(initial=0))):
        longer = lengths > octet
        low = (octets[starts[longer] + octet] & 0x7F).astype(np.uint64)
        values[longer] |= low << np.uint64(7 * octet)
    return values


def _voxblox_block(message: bytes) -> tuple[list[float], NDArray[np.uint64]]:
    """The origin of a block (m) and its data. These come last: each number by itself, or all of them packed."""
    origin = [0.0, 0.0, 0.0]
    for number, value, at in _fields(message):
        if number in (3, 4, 5) and isinstance(value, float):
            origin[number - 3] = value
        elif number == 7 and isinstance(value, bytes):
            return origin, _varints(value)
        elif number == 7:
            keys_and_values = _varints(message[at:])
            if len(keys_and_values) % 2 or (keys_and_values[::2] != 7 << 3).any():
                raise ValueError("a block has fields behind its data")
            return origin, keys_and_values[1::2]
    return origin, np.empty(0, np.uint64)


def _fields(message: bytes) -> Iterator[tuple[int, Any, int]]:
    """The fields of a message of Protocol Buffers: numbers, doubles, floats and bytes, and where each begins."""
    at = 0
    while at < len(message):
        begin = at
        key, at = _varint(message, at)
        number, wire = key >> 3, key & 7
        if wire == 0:
            value, at = _varint(message, at)
            yield number, value, begin
        elif wire == 1:
            yield number, struct.unpack_from("<d", message, at)[0], begin
            at += 8
        elif wire == 2:
            size, at = _varint(message, at)
            if at + size > len(message):
                raise IndexError
            yield number, message[at : at + size], begin
            at += size
        elif wire == 5:
            yield number, struct.unpack_from("<f", message, at)[0], begin
            at += 4
        else:
            raise ValueError(f"a field of wire type {wire}")


def _numpy(value: Any) -> NDArray[Any]:
    """An array of a tensor of PyTorch or Open3D, or of what NumPy takes."""
    for step in ("detach", "cpu", "numpy"):
        if hasattr(value, step):
            value = getattr(value, step)()
    return np.asarray(value)


def _open3d_voxel(grid: Any) -> float:
    """Edge of a voxel (m): the grid does not state it, but gives the places of voxels."""
    slots = grid.hashmap().active_buf_indices()
    if len(slots) == 0:
        return 1.0
    places = np.unique(_numpy(grid.voxel_coordinates_and_flattened_indices(slots[:1])[0])[:, 0])
    first = int(_numpy(grid.hashmap().key_tensor())[int(_numpy(slots)[0]), 0]) * len(places)
    ends = [(first, places[0]), (first + len(places) - 1, places[-1])]
    # Places are in single precision: of the end with the larger number less is rounded for each voxel.
    number, place = max(ends, key=lambda end: abs(end[0]))
    return round(float(place) / number, 8)


def _sorted(coords: NDArray[Any], distances: NDArray[np.float32], voxel: float, truncation: int) -> Volume:
    """Blocks in the order of their places, so that equal maps become equal volumes."""
    if not (voxel > 0 and np.isfinite(voxel)):
        raise ValueError(f"voxel is {voxel}: a length is above 0 (metres)")
    if len(coords) != len(distances):
        raise ValueError(f"there are {len(coords)} places for {len(distances)} blocks")
    order = np.lexsort(coords.T)
    blocks = np.ascontiguousarray(distances[order])
    return Volume(float(voxel), coords[order].astype(np.int32), blocks, int(truncation))


def _kept(coords: NDArray[Any], cubes: NDArray[np.float32], voxel: float, truncation: int) -> Volume:
    """The blocks in which something is nearer than the truncation."""
    if not (voxel > 0 and np.isfinite(voxel)):
        raise ValueError(f"voxel is {voxel}: a length is above 0 (metres)")
    if not 0 < truncation < 2**16:
        raise ValueError(f"truncation is {truncation}: a number of voxels above 0")
    near = (np.abs(cubes) < truncation * voxel).any(axis=(1, 2, 3))
    return _sorted(coords[near], cubes[near], voxel, truncation)
