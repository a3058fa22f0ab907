"""File > Export > Volumetric video (.isv)."""

from __future__ import annotations

from collections.abc import Iterator

import bpy
import numpy as np
from bpy_extras.io_utils import ExportHelper

from . import streams


class ExportIsv(bpy.types.Operator, ExportHelper):
    """Encode the selected meshes over the scene's range, as they are rendered."""

    bl_idname = "export_scene.isv"
    bl_label = "Export volumetric video"

    filename_ext = ".isv"
    filter_glob: bpy.props.StringProperty(default="*.isv", options={"HIDDEN"})
    voxel: bpy.props.FloatProperty(
        name="Voxel", default=0.005, min=0.0001, unit="LENGTH", description="Edge of a voxel (m): what is smaller is lost"
    )
    quality: bpy.props.FloatProperty(name="Quality", default=50.0, min=0.0, max=100.0)
    colour: bpy.props.BoolProperty(
        name="Colour", default=True, description="Keep the active colour attribute of each mesh"
    )

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Step through the scene, and encode each frame."""
        targets = [found for found in context.selected_objects if found.type == "MESH"]
        if not targets:
            self.report({"ERROR"}, "select the meshes to export")
            return {"CANCELLED"}
        scene = context.scene
        before = scene.frame_current
        try:
            report = streams.package().encode(
                frames(context, targets, self.colour),
                bpy.path.abspath(self.filepath),
                voxel=self.voxel,
                quality=self.quality,
                fps=scene.render.fps / scene.render.fps_base,
            )
        except (OSError, RuntimeError, ValueError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        finally:
            scene.frame_set(before)
        self.report({"INFO"}, f"{report.frames} frames, {report.bytes} bytes")
        return {"FINISHED"}


def frames(
    context: bpy.types.Context, targets: list[bpy.types.Object], colour: bool
) -> Iterator[tuple[np.ndarray, ...]]:
    """Yield the meshes of objects at each frame of the scene, with modifiers, as one.

    Args:
        context: The context of the operator.
        targets: The objects.
        colour: Whether colours are kept.

    Yields:
        Vertices (V, 3) in metres with Y up, faces (F, 3), and colours (V, 3) as sRGB if any object has some.
    """
    scene = context.scene
    keeps_colour = colour and any(target.data.color_attributes for target in targets)
    for frame in range(scene.frame_start, scene.frame_end + 1):
        scene.frame_set(frame)
        graph = context.evaluated_depsgraph_get()
        vertices, faces, colours = [np.empty((0, 3), np.float32)], [np.empty((0, 3), np.uint32)], []
        count = 0
        for target in targets:
            evaluated = target.evaluated_get(graph)
            mesh = evaluated.to_mesh()
            positions, corners = arrays(mesh, np.array(evaluated.matrix_world, dtype=np.float64))
            vertices.append(positions)
            faces.append(corners + np.uint32(count))
            colours.append(vertex_colours(mesh))
            count += len(positions)
            evaluated.to_mesh_clear()
        parts = (np.concatenate(vertices), np.concatenate(faces))
        yield (*parts, np.concatenate(colours)) if keeps_colour else parts


def arrays(mesh: bpy.types.Mesh, matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the vertices (V, 3), in metres with Y up, and the triangles (F, 3) of a mesh that is placed by a matrix (4, 4)."""
    positions = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", positions)
    placed = positions.reshape(-1, 3) @ matrix[:3, :3].T + matrix[:3, 3]
    mesh.calc_loop_triangles()
    corners = np.empty(3 * len(mesh.loop_triangles), np.int32)
    mesh.loop_triangles.foreach_get("vertices", corners)
    faces = corners.reshape(-1, 3).astype(np.uint32)
    if np.linalg.det(matrix[:3, :3]) < 0:
        # A mirrored object keeps its outside.
        faces = faces[:, ::-1]
    return np.stack([placed[:, 0], placed[:, 2], -placed[:, 1]], axis=1).astype(np.float32), faces


def vertex_colours(mesh: bpy.types.Mesh) -> np.ndarray:
    """Return the active colours of a mesh as sRGB (V, 3): those of corners averaged at vertices; white without any."""
    count = len(mesh.vertices)
    active = mesh.color_attributes.active_color if mesh.color_attributes else None
    if active is None:
        return np.full((count, 3), 255, np.uint8)
    values = np.empty(4 * len(active.data), np.float32)
    active.data.foreach_get("color_srgb", values)
    colours = values.reshape(-1, 4)[:, :3]
    if active.domain == "CORNER":
        vertices = np.empty(len(mesh.loops), np.int32)
        mesh.loops.foreach_get("vertex_index", vertices)
        sums = np.zeros((count, 3))
        np.add.at(sums, vertices, colours)
        colours = sums / np.maximum(np.bincount(vertices, minlength=count), 1)[:, None]
    return np.clip(np.rint(255 * colours), 0, 255).astype(np.uint8)


def _menu(menu: bpy.types.Menu, _context: bpy.types.Context) -> None:
    menu.layout.operator(ExportIsv.bl_idname, text="Volumetric video (.isv)")


def register() -> None:
    """Add the operator and its entry in the menu."""
    bpy.utils.register_class(ExportIsv)
    bpy.types.TOPBAR_MT_file_export.append(_menu)


def unregister() -> None:
    """Take them out."""
    bpy.types.TOPBAR_MT_file_export.remove(_menu)
    bpy.utils.unregister_class(ExportIsv)
