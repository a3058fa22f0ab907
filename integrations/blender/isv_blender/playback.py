"""Objects that show the frame of a take which belongs to the scene's frame."""

from __future__ import annotations

from typing import Any

import bpy
from bpy.app.handlers import persistent

from . import streams, timing

# What the geometry of a mesh was made of: kept with the mesh, so that undo takes both back.
SHOWN = "isv_shown"


def _changed(properties: Playback, context: bpy.types.Context) -> None:
    show(properties.id_data, context.scene)


class Playback(bpy.types.PropertyGroup):
    """How an object plays a take."""

    path: bpy.props.StringProperty(name="Stream", subtype="FILE_PATH", update=_changed)
    start: bpy.props.FloatProperty(
        name="Start", default=1.0, update=_changed, description="Frame of the scene at which the range begins"
    )
    first: bpy.props.IntProperty(name="First", min=0, update=_changed, description="First frame of the range")
    last: bpy.props.IntProperty(name="Last", min=0, update=_changed, description="Last frame of the range")
    speed: bpy.props.FloatProperty(name="Speed", default=1.0, min=0.001, soft_max=10.0, update=_changed)
    reverse: bpy.props.BoolProperty(name="Reverse", update=_changed)
    extend: bpy.props.EnumProperty(
        name="Outside",
        items=[
            ("HOLD", "Hold", "The first and the last frame of the range stay"),
            ("LOOP", "Loop", "The range is repeated"),
            ("HIDE", "Hide", "Nothing is shown"),
        ],
        update=_changed,
    )
    lod: bpy.props.EnumProperty(
        name="Detail",
        items=[("1", "Full", ""), ("2", "Half", "Half of the resolution"), ("4", "Quarter", "A quarter of it")],
        update=_changed,
    )
    problem: bpy.props.StringProperty()


def show(target: bpy.types.Object, scene: bpy.types.Scene) -> None:
    """Give an object the geometry of the frame that belongs to the scene's frame. What goes wrong is in its panel."""
    properties = target.isv
    if not properties.path or target.type != "MESH":
        return
    try:
        _show(target, scene, properties)
        problem = ""
    except (LookupError, OSError, RuntimeError, ValueError) as error:
        problem = str(error)
    if properties.problem != problem:
        properties.problem = problem
        if problem:
            print(f"isv: {target.name}: {problem}")


def _show(target: bpy.types.Object, scene: bpy.types.Scene, properties: Any) -> None:
    path = bpy.path.abspath(properties.path)
    lod = int(properties.lod)
    take = streams.take(path, lod)
    end = len(take) - 1
    first = min(properties.first, end)
    number = timing.shown(
        scene.frame_current_final,
        scene.render.fps / scene.render.fps_base,
        take.fps,
        start=properties.start,
        first=first,
        last=min(max(properties.last, first), end),
        speed=properties.speed,
        reverse=properties.reverse,
        extend=properties.extend,
    )
    if end < 0:
        # A take without frames is nothing to show.
        number = None
    wanted = f"{path}\n{lod}\n{number}"
    mesh = target.data
    if mesh.get(SHOWN) == wanted:
        return
    if number is None:
        mesh.clear_geometry()
    else:
        surface = take[number].mesh()
        streams.fill(mesh, surface)
        if surface.colors is not None and not mesh.materials:
            mesh.materials.append(streams.material())
    mesh[SHOWN] = wanted


@persistent
def _on_frame(scene: bpy.types.Scene, _graph: object = None) -> None:
    for target in scene.objects:
        show(target, scene)


@persistent
def _on_load(_path: object = None) -> None:
    streams.close_all()
    for scene in bpy.data.scenes:
        _on_frame(scene)


class IsvPanel(bpy.types.Panel):
    """The take of an object, and how it is played."""

    bl_label = "Volumetric video"
    bl_idname = "OBJECT_PT_isv"
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "object"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Show the panel for objects that play a take."""
        return context.object is not None and bool(context.object.isv.path)

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the properties."""
        properties = context.object.isv
        layout = self.layout
        layout.use_property_split = True
        for name in ("path", "start", "first", "last", "speed", "reverse", "extend", "lod"):
            layout.prop(properties, name)
        if properties.problem:
            layout.label(text=properties.problem, icon="ERROR")


_CLASSES = (Playback, IsvPanel)


def register() -> None:
    """Add properties, panel and handlers."""
    for added in _CLASSES:
        bpy.utils.register_class(added)
    bpy.types.Object.isv = bpy.props.PointerProperty(type=Playback)
    # Before the scene is evaluated, so that the new geometry is what is rendered.
    bpy.app.handlers.frame_change_pre.append(_on_frame)
    bpy.app.handlers.load_post.append(_on_load)


def unregister() -> None:
    """Take them out."""
    bpy.app.handlers.load_post.remove(_on_load)
    bpy.app.handlers.frame_change_pre.remove(_on_frame)
    del bpy.types.Object.isv
    for added in reversed(_CLASSES):
        bpy.utils.unregister_class(added)
    streams.close_all()
