"""File > Import > Volumetric video (.isv)."""

from __future__ import annotations

import os

import bpy
from bpy_extras.io_utils import ImportHelper

from . import playback, streams


class ImportIsv(bpy.types.Operator, ImportHelper):
    """Import a stream as an object that follows the timeline."""

    bl_idname = "import_scene.isv"
    bl_label = "Import volumetric video"
    bl_options = {"REGISTER", "UNDO"}

    filename_ext = ".isv"
    filter_glob: bpy.props.StringProperty(default="*.isv", options={"HIDDEN"})
    set_range: bpy.props.BoolProperty(
        name="Set the scene's range and rate",
        default=True,
        description="The scene gets the take's frames a second, and its last frame is the take's",
    )

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Open the stream, and link an object that plays it."""
        path = bpy.path.abspath(self.filepath)
        try:
            take = streams.take(path, 1)
        except (OSError, RuntimeError, ValueError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        scene = context.scene
        name = os.path.splitext(os.path.basename(path))[0]
        target = bpy.data.objects.new(name, bpy.data.meshes.new(name))
        context.collection.objects.link(target)
        properties = target.isv
        properties.start = scene.frame_start
        properties.last = len(take) - 1
        if self.set_range:
            # Blender's rate is an integer over a factor.
            scene.render.fps = max(1, round(take.fps))
            scene.render.fps_base = scene.render.fps / take.fps
            scene.frame_end = scene.frame_start + len(take) - 1
        properties.path = path
        playback.show(target, scene)
        if properties.problem:
            self.report({"ERROR"}, properties.problem)
            bpy.data.objects.remove(target)
            return {"CANCELLED"}
        for other in context.selected_objects:
            other.select_set(False)
        target.select_set(True)
        context.view_layer.objects.active = target
        return {"FINISHED"}


def _menu(menu: bpy.types.Menu, _context: bpy.types.Context) -> None:
    menu.layout.operator(ImportIsv.bl_idname, text="Volumetric video (.isv)")


def register() -> None:
    """Add the operator and its entry in the menu."""
    bpy.utils.register_class(ImportIsv)
    bpy.types.TOPBAR_MT_file_import.append(_menu)


def unregister() -> None:
    """Take them out."""
    bpy.types.TOPBAR_MT_file_import.remove(_menu)
    bpy.utils.unregister_class(ImportIsv)
