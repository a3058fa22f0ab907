"""Open streams, and their frames as Blender's meshes."""

from __future__ import annotations

import importlib
import os
from typing import Any

import bpy
import numpy as np

HOW_TO_INSTALL = 'the Python package "isv" is missing: install it for Blender\'s Python with pip'
COLOUR = "Col"

# Streams by path, level of detail and the file's time: a file that was written anew is another stream.
_open_streams: dict[tuple[str, int, float], Any] = {}


def package() -> Any:
    """Return the package ``isv``.

    Raises:
        RuntimeError: It is not installed; the message says how to install it.
    """
    try:
        return importlib.import_module("isv")
    except ImportError as error:
        raise RuntimeError(f"{HOW_TO_INSTALL} ({error})") from error


def take(path: str, lod: int) -> Any:
    """Return the take at an absolute path, which stays open.

    Args:
        path: The stream.
        lod: Level of detail: 1, 2 or 4.

    Raises:
        OSError: The file cannot be opened.
        RuntimeError: The package is not installed.
        ValueError: The file is no stream.
    """
    key = (path, lod, os.stat(path).st_mtime)
    if key not in _open_streams:
        for old in [other for other in _open_streams if other[:2] == key[:2]]:
            _open_streams.pop(old).close()
        _open_streams[key] = package().open(path, lod=lod)
    return _open_streams[key]


def close_all() -> None:
    """Close all streams."""
    while _open_streams:
        _open_streams.popitem()[1].close()


def fill(mesh: bpy.types.Mesh, surface: Any) -> None:
    """Replace the geometry of a mesh.

    Args:
        mesh: The mesh; its materials stay.
        surface: An ``isv.Mesh``: vertices (V, 3) in metres with Y up, faces (F, 3), colours (V, 3) as sRGB or None.
    """
    vertices, faces = surface.vertices, surface.faces
    mesh.clear_geometry()
    # Blender has Z up: (x, y, z) becomes (x, -z, y), as in its glTF importer.
    turned = np.empty_like(vertices, dtype=np.float32)
    turned[:, 0], turned[:, 1], turned[:, 2] = vertices[:, 0], -vertices[:, 2], vertices[:, 1]
    mesh.vertices.add(len(vertices))
    mesh.vertices.foreach_set("co", turned.ravel())
    mesh.loops.add(faces.size)
    mesh.loops.foreach_set("vertex_index", faces.astype(np.int32).ravel())
    mesh.polygons.add(len(faces))
    mesh.polygons.foreach_set("loop_start", np.arange(0, faces.size, 3, dtype=np.int32))
    if bpy.app.version < (3, 6):
        # Newer versions derive it.
        mesh.polygons.foreach_set("loop_total", np.full(len(faces), 3, dtype=np.int32))
    mesh.polygons.foreach_set("use_smooth", np.ones(len(faces), dtype=bool))
    mesh.update(calc_edges=True)
    if surface.colors is not None and len(vertices):
        colours = np.ones((len(vertices), 4), dtype=np.float32)
        colours[:, :3] = surface.colors / np.float32(255)
        attribute = mesh.color_attributes.new(COLOUR, "BYTE_COLOR", "POINT")
        attribute.data.foreach_set("color_srgb", colours.ravel())


def material() -> bpy.types.Material:
    """Return the material that shows the colours of vertices."""
    name = "isv colour"
    found = bpy.data.materials.get(name)
    if found is not None:
        return found
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    nodes, links = made.node_tree.nodes, made.node_tree.links
    colour = nodes.new("ShaderNodeVertexColor")
    colour.layer_name = COLOUR
    colour.location = (-300, 300)
    shader = next(node for node in nodes if node.type == "BSDF_PRINCIPLED")
    # Captured light is in the colour already: no highlights on top.
    shader.inputs["Roughness"].default_value = 1.0
    links.new(colour.outputs["Color"], shader.inputs["Base Color"])
    return made
