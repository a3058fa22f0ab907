"""Frames of trimesh, Open3D and PyTorch. Stand-ins take the place of what is too large for CI."""

from __future__ import annotations

import io
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import isv
import numpy as np
import pytest
from numpy.typing import NDArray

from conftest import VOXEL, box


def encoded(frame: Any, **options: Any) -> bytes:
    file = io.BytesIO()
    isv.encode([frame], file, voxel=VOXEL, **options)
    return file.getvalue()


MESH = box()
COLORED = box(colored=True)
assert COLORED.colors is not None
COLORS: NDArray[np.uint8] = COLORED.colors


class Tensor:
    """What isv asks of a tensor of Open3D that is on a GPU."""

    def __init__(self, array: Any, on_gpu: bool = True) -> None:
        self.array, self.on_gpu = np.asarray(array), on_gpu

    def cpu(self) -> Tensor:
        return Tensor(self.array, on_gpu=False)

    def numpy(self) -> Any:
        assert not self.on_gpu, "a tensor on a GPU must be copied to the CPU first"
        return self.array


def test_none_of_them_is_imported_for_arrays(tmp_path: Path) -> None:
    text = """
        import sys
        import isv, numpy as np
        isv.encode([(np.eye(3), [[0, 1, 2]])], sys.argv[1], voxel=0.1)
        isv.open(sys.argv[1])[0].mesh()
        print([name for name in ("trimesh", "open3d", "torch", "scipy") if name in sys.modules])
    """
    words = [sys.executable, "-c", "\n".join(line.strip() for line in text.splitlines()), str(tmp_path / "x.isv")]
    assert subprocess.run(words, capture_output=True, text=True, check=True).stdout == "[]\n"


def test_meshes_of_trimesh_are_encoded_with_their_colors() -> None:
    trimesh = pytest.importorskip("trimesh")
    mesh = trimesh.Trimesh(MESH.vertices, MESH.faces, process=False)
    assert encoded(mesh) == encoded(MESH)
    mesh = trimesh.Trimesh(MESH.vertices, MESH.faces, vertex_colors=COLORS, process=False)
    assert encoded(mesh) == encoded(COLORED)
    x, y = (axis.ravel() for axis in np.meshgrid(np.arange(30), np.arange(30)))
    positions = np.stack([0.01 * x, 0.01 * y, 0 * x], axis=1)
    colors = np.tile(np.array([200, 90, 20], np.uint8), (900, 1))
    cloud = trimesh.PointCloud(positions, colors=colors)
    points = isv.Points(positions, None, colors)
    assert encoded(cloud, estimate_normals=True) == encoded(points, estimate_normals=True)


def test_textures_of_trimesh_become_colors_of_vertices() -> None:
    trimesh = pytest.importorskip("trimesh")
    image = pytest.importorskip("PIL.Image")
    picture = image.fromarray(np.repeat(np.array([[[220, 30, 30], [30, 30, 220]]], np.uint8), 2, axis=0))
    corners = np.stack([MESH.vertices[:, 0] / 0.5, MESH.vertices[:, 1]], axis=1)
    visual = trimesh.visual.TextureVisuals(uv=corners, image=picture)
    mesh = trimesh.Trimesh(MESH.vertices, MESH.faces, visual=visual, process=False)
    assert encoded(mesh) == encoded(COLORED)


def test_decoded_meshes_become_those_of_trimesh(stream: Path, colored_stream: Path) -> None:
    trimesh = pytest.importorskip("trimesh")
    with isv.open(stream) as take:
        frame = take[0]
    mesh, plain = frame.to_trimesh(), frame.mesh()
    assert isinstance(mesh, trimesh.Trimesh) and mesh.is_watertight
    assert (mesh.vertices == plain.vertices).all() and (mesh.faces == plain.faces).all()
    assert mesh.volume == pytest.approx(0.5 * 0.4 * 0.4, rel=0.03)
    with isv.open(colored_stream) as take:
        frame = take[0]
    mesh, colored = frame.mesh(normals=True).to_trimesh(), frame.mesh()
    assert colored.colors is not None
    assert (mesh.visual.vertex_colors[:, :3] == colored.colors).all()
    cloud = frame.points(200).to_trimesh()
    assert isinstance(cloud, trimesh.PointCloud) and cloud.vertices.shape == (200, 3)


def legacy_mesh(colors: Any) -> Any:
    return SimpleNamespace(
        vertices=MESH.vertices.astype(np.float64),
        triangles=MESH.faces.astype(np.int32),
        vertex_colors=colors,
        has_vertex_colors=lambda: colors is not None,
    )


def test_meshes_of_open3d_of_either_api_are_encoded() -> None:
    assert encoded(legacy_mesh(None)) == encoded(MESH)
    assert encoded(legacy_mesh(COLORS / 255.0)) == encoded(COLORED)
    vertex = {"positions": Tensor(MESH.vertices)}
    tensors: Any = SimpleNamespace(vertex=vertex, triangle={"indices": Tensor(MESH.faces)})
    assert encoded(tensors) == encoded(MESH)
    for colors in (COLORS, (COLORS / 255.0).astype(np.float32)):
        vertex["colors"] = Tensor(colors)
        assert encoded(tensors) == encoded(COLORED)


def test_points_of_open3d_of_either_api_are_encoded() -> None:
    x, y = (axis.ravel() for axis in np.meshgrid(np.arange(30), np.arange(30)))
    positions = np.stack([0.01 * x, 0.01 * y, 0 * x], axis=1)
    normals = np.tile(np.array([0, 0, 1], np.float32), (900, 1))
    colors = np.tile(np.array([200, 90, 20], np.uint8), (900, 1))
    expected = encoded(isv.Points(positions, normals, colors))
    legacy: Any = SimpleNamespace(
        points=positions,
        normals=normals.astype(np.float64),
        colors=colors / 255.0,
        has_normals=lambda: True,
        has_colors=lambda: True,
    )
    assert encoded(legacy) == expected
    point = {"positions": Tensor(positions), "normals": Tensor(normals), "colors": Tensor(colors)}
    assert encoded(SimpleNamespace(point=point)) == expected


class OnGpu:
    """A tensor of PyTorch that NumPy takes once it was detached and copied."""

    def __init__(self, array: Any) -> None:
        self.array = array

    def __array__(self, dtype: Any = None, copy: Any = None) -> Any:
        raise AssertionError("a tensor on a GPU must be copied to the CPU first")

    def detach(self) -> OnGpu:
        return self

    def cpu(self) -> Any:
        return self.array


def test_tensors_of_pytorch_are_arrays() -> None:
    assert encoded((OnGpu(MESH.vertices), OnGpu(MESH.faces))) == encoded(MESH)


def test_open3d_takes_and_gives_meshes_and_points(colored_stream: Path) -> None:
    open3d = pytest.importorskip("open3d", reason="open3d is not installed")
    with isv.open(colored_stream) as take:
        frame = take[0]
    plain = frame.mesh(normals=True)
    assert plain.normals is not None and plain.colors is not None
    mesh = frame.to_open3d()
    assert isinstance(mesh, open3d.geometry.TriangleMesh)
    assert (np.asarray(mesh.vertices) == plain.vertices).all()
    assert (np.asarray(mesh.triangles) == plain.faces).all()
    assert (np.asarray(mesh.vertex_normals) == plain.normals).all()
    expected = encoded(plain)
    assert encoded(mesh) == expected
    assert encoded(open3d.t.geometry.TriangleMesh.from_legacy(mesh)) == expected
    points = frame.points(2000)
    cloud = points.to_open3d()
    assert encoded(cloud) == encoded(points)
    assert len(cloud.points) == 2000
    tensors = open3d.t.geometry.PointCloud.from_legacy(cloud)
    assert len(isv.open(encoded(tensors))[0].mesh().faces) > 500


def test_random_frames_are_read_by_workers_of_torch(stream: Path) -> None:
    pytest.importorskip("torch", reason="torch is not installed")
    example = Path(__file__).parents[1] / "examples" / "torch_frames.py"
    for method in ("fork", "spawn"):
        words = [sys.executable, str(example), str(stream), "--workers", "3", "--method", method]
        done = subprocess.run(words, capture_output=True, text=True, timeout=300, check=False)
        assert done.returncode == 0, done.stderr
        assert "12 frames" in done.stdout
