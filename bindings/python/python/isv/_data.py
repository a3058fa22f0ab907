"""What frames are made of, as NumPy arrays."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._checks import colors_of, faces_of, normals_of, place_of, places_of

__all__ = ["Camera", "ColorImage", "DepthImage", "Mesh", "Points", "Volume"]


@dataclass(frozen=True, eq=False)
class Mesh:
    """A triangle mesh in metres, right-handed, Y up.

    Attributes:
        vertices: Positions (m), float32 or float64 of shape (V, 3): x, y, z.
        faces: Vertices of each triangle, integers of shape (F, 3), from 0, counter-clockwise seen from outside.
        normals: Unit normals, float32 of shape (V, 3), or None. Encoding does not need them.
        colors: sRGB, uint8 of shape (V, 3), or None.
    """

    vertices: NDArray[Any]
    faces: NDArray[Any]
    normals: NDArray[np.float32] | None = None
    colors: NDArray[np.uint8] | None = None

    def to_trimesh(self) -> Any:
        """Make a ``trimesh.Trimesh`` of the same vertices and faces, in the same order.

        Raises:
            ImportError: trimesh is not installed.
        """
        import trimesh

        return trimesh.Trimesh(
            vertices=self.vertices,
            faces=self.faces.astype(np.int64),
            vertex_normals=self.normals,
            vertex_colors=self.colors,
            process=False,
        )

    def to_open3d(self) -> Any:
        """Make an ``open3d.geometry.TriangleMesh`` of the same vertices and faces, in the same order.

        Raises:
            ImportError: open3d is not installed.
        """
        import open3d

        mesh = open3d.geometry.TriangleMesh(
            open3d.utility.Vector3dVector(self.vertices.astype(np.float64)),
            open3d.utility.Vector3iVector(self.faces.astype(np.int32)),
        )
        if self.normals is not None:
            mesh.vertex_normals = open3d.utility.Vector3dVector(self.normals.astype(np.float64))
        if self.colors is not None:
            mesh.vertex_colors = open3d.utility.Vector3dVector(self.colors / 255.0)
        return mesh


@dataclass(frozen=True, eq=False)
class Points:
    """Points of a surface in metres, right-handed, Y up.

    Attributes:
        positions: Positions (m), float32 or float64 of shape (N, 3): x, y, z.
        normals: Normals that point outside, float32 of shape (N, 3), zero where one is not known; or None.
        colors: sRGB, uint8 of shape (N, 3), or None.
        viewpoint: Place that the points were seen from (m), or None. Estimated normals face it.
    """

    positions: NDArray[Any]
    normals: NDArray[np.float32] | None = None
    colors: NDArray[np.uint8] | None = None
    viewpoint: tuple[float, float, float] | None = None

    def to_trimesh(self) -> Any:
        """Make a ``trimesh.PointCloud`` of the same points, in the same order. It has no normals.

        Raises:
            ImportError: trimesh is not installed.
        """
        import trimesh

        return trimesh.PointCloud(vertices=self.positions, colors=self.colors)

    def to_open3d(self) -> Any:
        """Make an ``open3d.geometry.PointCloud`` of the same points, in the same order.

        Raises:
            ImportError: open3d is not installed.
        """
        import open3d

        cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(self.positions.astype(np.float64)))
        if self.normals is not None:
            cloud.normals = open3d.utility.Vector3dVector(self.normals.astype(np.float64))
        if self.colors is not None:
            cloud.colors = open3d.utility.Vector3dVector(self.colors / 255.0)
        return cloud


@dataclass(frozen=True, eq=False)
class Volume:
    """A sparse signed distance field (TSDF). Blocks that are not there are outside, or were not observed.

    Attributes:
        voxel: Edge of a voxel (m), above 0.
        coords: Places of the blocks, in blocks, int32 of shape (B, 3): x, y, z, each of them once. The lowest corner of
            a block is at ``coords * edge * voxel``.
        distances: Distances at the centres of the voxels (m), float32 of shape (B, edge, edge, edge) with axes
            (block, z, y, x): negative inside, NaN where a voxel was not observed. The edge is 4, 8 or 16 voxels.
        truncation: Distance from the surface at which distances are cut off (voxels).
    """

    voxel: float
    coords: NDArray[np.int32]
    distances: NDArray[np.float32]
    truncation: int = 8

    @property
    def edge(self) -> int:
        """Edge of a block (voxels)."""
        return int(self.distances.shape[1])

    def to_dense(self) -> tuple[NDArray[np.float32], tuple[int, int, int]]:
        """Make one array of all blocks and what is between them.

        Returns:
            Distances (m), float32 with axes (z, y, x), NaN where there is no block or a voxel was not observed, and the
            index (x, y, z) of its first voxel: the centre of the voxel at [k, j, i] is at
            ``(first + (i, j, k) + 0.5) * voxel``.

        Raises:
            MemoryError: The blocks are so far apart that the array has more than 2**31 voxels.
        """
        edge = self.edge
        if len(self.coords) == 0:
            return np.empty((0, 0, 0), np.float32), (0, 0, 0)
        low = self.coords.min(axis=0).astype(np.int64)
        blocks = self.coords.max(axis=0).astype(np.int64) - low + 1
        voxels = int(np.prod(blocks.astype(object))) * edge**3
        if voxels > 2**31:
            raise MemoryError(f"a dense array of these blocks has {voxels} voxels")
        dense = np.full(tuple(int(n) * edge for n in blocks[::-1]), np.nan, np.float32)
        for (x, y, z), block in zip((self.coords - low) * edge, self.distances, strict=True):
            dense[z : z + edge, y : y + edge, x : x + edge] = block
        x, y, z = (int(n) * edge for n in low)
        return dense, (x, y, z)


@dataclass(frozen=True, eq=False)
class Camera:
    """Lens and place of a camera. Lens distortion has been removed.

    Attributes:
        focal: Focal lengths along x and y (pixels).
        principal: Column and row of the principal point (pixels).
        pose: Transform from the camera to the world (m), shape (4, 4). The camera looks along +z; its x points right
            and its y down.
    """

    focal: tuple[float, float]
    principal: tuple[float, float]
    pose: ArrayLike

    @classmethod
    def from_matrix(cls, intrinsics: ArrayLike, pose: ArrayLike) -> Camera:
        """Make a camera of a matrix of intrinsics.

        Args:
            intrinsics: Shape (3, 3), (pixels): ``[[fx, 0, cx], [0, fy, cy], [0, 0, 1]]``.
            pose: Transform from the camera to the world (m), shape (4, 4).

        Raises:
            ValueError: The matrix has another shape, or a skew.
        """
        matrix = np.asarray(intrinsics, np.float64)
        if matrix.shape != (3, 3):
            raise ValueError(f"intrinsics have shape {matrix.shape} in place of (3, 3)")
        if matrix[0, 1] != 0 or matrix[1, 0] != 0 or tuple(matrix[2]) != (0.0, 0.0, 1.0):
            raise ValueError("intrinsics are [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]")
        focal, principal = (matrix[0, 0], matrix[1, 1]), (matrix[0, 2], matrix[1, 2])
        return cls((float(focal[0]), float(focal[1])), (float(principal[0]), float(principal[1])), pose)


@dataclass(frozen=True, eq=False)
class DepthImage:
    """Image of a depth camera.

    Attributes:
        depth: Depths along z (m), float32 of shape (rows, columns); 0 or NaN where there is no reading. Integers are
            taken for millimetres.
        camera: Lens and place of the camera.
    """

    depth: NDArray[Any]
    camera: Camera


@dataclass(frozen=True, eq=False)
class ColorImage:
    """Image of a colour camera.

    Attributes:
        color: sRGB, uint8 of shape (rows, columns, 3).
        camera: Lens and place of the camera.
        depth_image: Number of the depth image of the same frame from about the same place, such as that of an RGB-D
            camera; None if there is none.
    """

    color: NDArray[np.uint8]
    camera: Camera
    depth_image: int | None = None


def mesh_of(vertices: Any, faces: Any, colors: Any = None) -> Mesh:
    """Check the parts of a mesh."""
    places = places_of("vertices", vertices)
    return Mesh(places, faces_of(faces, len(places)), None, colors_of(colors, len(places)))


def points_of(positions: Any, normals: Any = None, colors: Any = None, viewpoint: Any = None) -> Points:
    """Check the parts of points."""
    places = places_of("positions", positions)
    place = None if viewpoint is None else place_of("viewpoint", viewpoint)
    return Points(places, normals_of(normals, len(places)), colors_of(colors, len(places)), place)
