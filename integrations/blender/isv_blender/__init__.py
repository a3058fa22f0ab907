"""Blender add-on: volumetric video as objects that follow the timeline, and animated meshes as streams."""

from . import exporting, importing, playback

bl_info = {
    "name": "isv: volumetric video",
    "author": "the isv authors",
    "version": (0, 1, 0),
    "blender": (3, 4, 0),
    "location": "File > Import / Export, Object properties",
    "description": "Plays .isv streams as meshes with colour, and encodes animated meshes",
    "category": "Import-Export",
}


def register() -> None:
    """Add the operators, the panel and the handlers of time."""
    playback.register()
    importing.register()
    exporting.register()


def unregister() -> None:
    """Take out all that :func:`register` added."""
    exporting.unregister()
    importing.unregister()
    playback.unregister()
