"""Maps of other programs."""

from __future__ import annotations

import struct
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import isv
import numpy as np
import pytest
from isv import maps
from numpy.typing import NDArray

from conftest import VOXEL, sphere_field


def near(field: NDArray[np.float32], truncation: int) -> NDArray[np.float32]:
    """Distances that are nearer than a truncation."""
    return np.where(np.abs(field) < truncation * VOXEL, field, np.float32(np.nan))


@pytest.mark.parametrize("edge", [4, 8, 16])
@pytest.mark.parametrize("first", [(0, 0, 0), (-16, 8, 32), (3, -5, 7)])
def test_dense_fields_come_back_where_they_were(edge: Any, first: tuple[int, int, int]) -> None:
    # No axis is like another.
    field = sphere_field()[:30, :26, 2:]
    volume = maps.from_dense(field, VOXEL, first=first, edge=edge)
    assert volume.edge == edge
    dense, begin = volume.to_dense()
    offset = np.array(first) - begin
    found = np.full(field.shape, np.nan, np.float32)
    for k, j, i in np.ndindex(field.shape):
        x, y, z = offset + (i, j, k)
        if 0 <= z < dense.shape[0] and 0 <= y < dense.shape[1] and 0 <= x < dense.shape[2]:
            found[k, j, i] = dense[z, y, x]
    kept = np.isfinite(near(field, 8))
    assert (found[kept] == field[kept]).all()
    turned = maps.from_dense(field.transpose(2, 1, 0), VOXEL, first=first, edge=edge, axes="xyz")
    assert (turned.coords == volume.coords).all()
    assert turned.distances.tobytes() == volume.distances.tobytes()


def test_blocks_without_surface_are_left_out() -> None:
    field = np.full((32, 32, 32), 5.0, np.float32)
    field[20, 20, 20] = 0.0
    field[1, 1, 1] = np.nan
    volume = maps.from_dense(field, VOXEL)
    assert volume.coords.tolist() == [[2, 2, 2]]
    assert maps.from_dense(np.full((8, 8, 8), np.nan), VOXEL).distances.shape == (0, 8, 8, 8)
    dense, first = maps.from_dense(np.full((8, 8, 8), np.nan), VOXEL).to_dense()
    assert dense.size == 0 and first == (0, 0, 0)


def test_a_dense_array_of_all_the_world_is_refused() -> None:
    far = isv.Volume(VOXEL, np.array([[0, 0, 0], [10**6, 0, 10**6]], np.int32), np.zeros((2, 8, 8, 8), np.float32))
    with pytest.raises(MemoryError):
        far.to_dense()


class FakeGrid:
    """A VoxelBlockGrid by what Open3D documents: slots in any order, x fastest, distances in truncations."""

    def __init__(self, volume: isv.Volume, truncation: float) -> None:
        count, edge = len(volume.coords), volume.edge
        slots = np.random.default_rng(1).permutation(count + 5)[:count].astype(np.int32)
        self.keys = np.zeros((count + 5, 3), np.int32)
        self.tsdf = np.zeros((count + 5, edge, edge, edge, 1), np.float32)
        self.weight = np.zeros((count + 5, edge, edge, edge, 1), np.uint16)
        self.slots, self.edge, self.voxel = slots, edge, volume.voxel
        for slot, coord, block in zip(slots, volume.coords, volume.distances, strict=True):
            self.keys[slot] = coord
            self.tsdf[slot, ..., 0] = np.nan_to_num(block) / (truncation * volume.voxel)
            self.weight[slot, ..., 0] = np.isfinite(block)

    def hashmap(self) -> Any:
        return SimpleNamespace(active_buf_indices=lambda: self.slots, key_tensor=lambda: self.keys)

    def attribute(self, name: str) -> Any:
        return {"tsdf": self.tsdf, "weight": self.weight}[name]

    def voxel_coordinates_and_flattened_indices(self, slots: Any) -> Any:
        cells = np.stack(np.meshgrid(*[np.arange(self.edge)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
        places = (self.keys[slots][:, None] * self.edge + cells) * self.voxel
        return places.reshape(-1, 3).astype(np.float32), np.arange(len(cells))


@pytest.mark.parametrize("edge", [8, 16])
def test_grids_of_open3d_become_volumes(edge: Any) -> None:
    field = sphere_field()
    field[:, :10] = np.nan
    volume = maps.from_dense(field, VOXEL, edge=edge)
    found = maps.from_open3d(FakeGrid(volume, 6.0), truncation=6.0)
    assert found.voxel == pytest.approx(VOXEL, rel=1e-4) and found.truncation == 6
    assert (found.coords == volume.coords).all()
    assert np.array_equal(np.isnan(found.distances), np.isnan(volume.distances))
    assert np.nanmax(np.abs(found.distances - volume.distances)) < 1e-5


@pytest.mark.parametrize("at", [-4000, -1, 0, 5, 30, 50, 333, 20_000])
def test_the_voxel_of_a_grid_of_open3d_does_not_depend_on_its_blocks(at: int) -> None:
    block = isv.Volume(VOXEL, np.array([[at, 0, 0]], np.int32), np.zeros((1, 8, 8, 8), np.float32))
    assert maps.from_open3d(FakeGrid(block, 6.0), truncation=6.0).voxel == VOXEL


def test_grids_of_open3d_itself_become_volumes_and_come_back() -> None:
    open3d = pytest.importorskip("open3d", reason="open3d is not installed")
    field = sphere_field()
    field[:, :10] = np.nan
    volume = maps.from_dense(near(field, 8), VOXEL, edge=16)
    grid = maps.to_open3d(volume)
    found = maps.from_open3d(grid)
    assert (found.coords == volume.coords).all()
    assert np.array_equal(np.isnan(found.distances), np.isnan(volume.distances))
    assert np.nanmax(np.abs(found.distances - volume.distances)) < 1e-5
    # The surface that Open3D extracts lies half a voxel lower, as documented: the sphere is around 16 voxels.
    whole = maps.to_open3d(maps.from_dense(sphere_field(), VOXEL, edge=16), weight=10.0)
    points = whole.extract_point_cloud(weight_threshold=1.0).point["positions"].numpy()
    middle = (16 - 0.5) * VOXEL
    assert len(points) > 500
    assert np.abs(np.linalg.norm(points - middle, axis=1) - 0.2).max() < 0.1 * VOXEL
    assert isinstance(grid, open3d.t.geometry.VoxelBlockGrid)
    # A grid that Open3D itself has filled: a wall 1 m in front of a camera.
    core = open3d.core
    grid = open3d.t.geometry.VoxelBlockGrid(
        ("tsdf", "weight"), (core.float32, core.float32), ((1,), (1,)), 0.02, 16, 1000
    )
    depth = open3d.t.geometry.Image(np.full((48, 64), 1000, np.uint16))
    lens, pose = core.Tensor([[60.0, 0, 31.5], [0, 60, 23.5], [0, 0, 1]]), core.Tensor.eye(4, core.float64)
    lens = lens.to(core.float64)
    blocks = grid.compute_unique_block_coordinates(depth, lens, pose, 1000.0, 3.0, 8.0)
    grid.integrate(blocks, depth, lens, pose, 1000.0, 3.0, 8.0)
    mesh = isv.open(encoded(maps.from_open3d(grid)))[0].mesh()
    middle_of_wall = np.abs(mesh.vertices[:, :2]).max(axis=1) < 0.2
    assert middle_of_wall.sum() > 100
    assert np.abs(mesh.vertices[middle_of_wall, 2] - (1 + 0.01)).max() < 0.3 * 0.02


def encoded(volume: isv.Volume) -> bytes:
    import io

    file = io.BytesIO()
    isv.encode([volume], file)
    return file.getvalue()


def test_layers_of_nvblox_become_volumes_and_come_back() -> None:
    field = sphere_field()[:30, :26, 2:]
    volume = maps.from_dense(near(field, 4), VOXEL, truncation=4)
    blocks, indices = maps.to_nvblox(volume, weight=3.0)
    assert blocks.shape[1:] == (8, 8, 8, 2)
    # The voxel (x, y, z) of a block of nvblox is that of a dense field.
    x, y, z = indices[3] * 8 + (1, 2, 3)
    assert blocks[3, 1, 2, 3, 0] == np.nan_to_num(near(field, 4))[z, y, x]
    found = maps.from_nvblox(list(blocks), list(indices), VOXEL)
    assert (found.coords == volume.coords).all() and found.truncation == 4
    assert np.array_equal(found.distances, volume.distances, equal_nan=True)
    with pytest.raises(ValueError, match="those of nvblox have 8"):
        maps.to_nvblox(maps.from_dense(field, VOXEL, edge=16))
    with pytest.raises(ValueError, match="a block has shape"):
        maps.from_nvblox([np.zeros((8, 8, 8))], [np.zeros(3)], VOXEL)
    with pytest.raises(ValueError, match="0 indices for 1 blocks"):
        maps.from_nvblox([np.zeros((8, 8, 8, 2))], [], VOXEL)


def varint(value: int) -> bytes:
    octets = bytearray()
    while value >= 0x80:
        octets.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes([*octets, value])


def voxblox_file(volume: isv.Volume, packed: bool) -> bytes:
    """A file as voxblox writes it: a count, then messages with their sizes."""
    edge = volume.edge
    layer = b"\x09" + struct.pack("<d", volume.voxel) + b"\x10" + varint(edge) + b"\x1a\x04tsdf"
    messages = [layer]
    for coord, block in zip(volume.coords, volume.distances, strict=True):
        message = b"\x08" + varint(edge) + b"\x11" + struct.pack("<d", volume.voxel)
        for number, place in zip((3, 4, 5), coord * edge * volume.voxel, strict=True):
            message += bytes([number << 3 | 1]) + struct.pack("<d", place)
        message += b"\x30\x01"
        words = []
        for distance in block.ravel():
            seen = np.isfinite(distance)
            bits = struct.unpack("<I", struct.pack("<f", distance if seen else 0.0))[0]
            words += [bits, struct.unpack("<I", struct.pack("<f", 2.0 if seen else 0.0))[0], 0xFF8000FF]
        data = b"".join(varint(word) for word in words)
        if packed:
            message += b"\x3a" + varint(len(data)) + data
        else:
            message += b"".join(b"\x38" + varint(word) for word in words)
        messages.append(message)
    return varint(len(messages)) + b"".join(varint(len(message)) + message for message in messages)


@pytest.mark.parametrize("packed", [False, True])
@pytest.mark.parametrize("edge", [8, 16])
def test_files_of_voxblox_are_read(edge: Any, packed: bool, tmp_path: Path) -> None:
    volume = maps.from_dense(near(sphere_field(), 4)[:, :20], VOXEL, first=(-16, -32, 16), edge=edge, truncation=4)
    path = tmp_path / "map.vxblx"
    path.write_bytes(voxblox_file(volume, packed))
    found = maps.read_voxblox(path)
    assert (found.voxel, found.truncation) == (VOXEL, 4)
    assert (found.coords == volume.coords).all()
    assert np.array_equal(found.distances, volume.distances, equal_nan=True)


def test_damaged_files_of_voxblox_are_refused(tmp_path: Path) -> None:
    volume = maps.from_dense(near(sphere_field(), 4), VOXEL, truncation=4)
    volume = isv.Volume(volume.voxel, volume.coords[:2], volume.distances[:2], 4)
    data = voxblox_file(volume, packed=False)
    path = tmp_path / "map.vxblx"
    for size in range(0, len(data), 97):
        path.write_bytes(data[:size])
        with pytest.raises(ValueError, match=r"map\.vxblx: "):
            maps.read_voxblox(path)
    path.write_bytes(data.replace(b"tsdf", b"esdf", 1))
    with pytest.raises(ValueError, match="a layer of type b'esdf'"):
        maps.read_voxblox(path)
    for at in range(0, len(data), 61):
        damaged = bytearray(data)
        damaged[at] ^= 0x55
        path.write_bytes(damaged)
        try:
            maps.read_voxblox(path)
        except ValueError as error:
            assert "map.vxblx: " in str(error)


def test_wrong_arguments_are_refused() -> None:
    field = sphere_field()
    wrong: list[tuple[Any, dict[str, Any], type[Exception], str]] = [
        (field[0], {}, ValueError, "it has 3 axes"),
        (field.astype(str), {}, TypeError, "it holds numbers"),
        (field, {"voxel": -1.0}, ValueError, "voxel is -1.0"),
        (field, {"voxel": float("nan")}, ValueError, "voxel is nan"),
        (field, {"edge": 5}, ValueError, "edge is 4, 8 or 16"),
        (field, {"axes": "yxz"}, ValueError, "axes is"),
        (field, {"truncation": 0}, ValueError, "truncation is 0"),
    ]
    for array, options, kind, words in wrong:
        with pytest.raises(kind, match=words):
            maps.from_dense(array, **{"voxel": VOXEL, **options})
    with pytest.raises(TypeError, match="VoxelBlockGrid, not int"):
        maps.from_open3d(5)
    with pytest.raises(TypeError, match="they are uint32"):
        maps.from_voxblox([[0, 0, 0]], np.zeros((1, 1536)), VOXEL)
    with pytest.raises(ValueError, match="4, 8 or 16 voxels along an edge"):
        maps.from_voxblox([[0, 0, 0]], np.zeros((1, 1000), np.uint32), VOXEL)
    with pytest.raises(ValueError, match="2 places for 1 blocks"):
        maps.from_voxblox([[0, 0, 0], [1, 0, 0]], np.zeros((1, 1536), np.uint32), VOXEL)
