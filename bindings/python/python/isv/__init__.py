"""isv: volumetric video. Moving 3-D geometry to small streams and back, as NumPy arrays.

``isv.encode(source, "take.isv")`` writes a stream, ``isv.open("take.isv")`` reads one. Coordinates of streams are
right-handed, Y up, in metres; colours are 8-bit sRGB. Warnings and decisions go to the logger ``isv``.
"""

from . import maps
from ._data import Camera, ColorImage, DepthImage, Mesh, Points, Volume
from ._encode import EncodeOptions, Report, Writer, encode
from ._isv import IsvError, __version__
from ._jobs import Repaired, cut, demux, draw, evaluate, info, join, mux, repair, set_threads, settle, verify
from ._take import Frame, SurfaceParts, Take, open

__all__ = [
    "Camera",
    "ColorImage",
    "DepthImage",
    "EncodeOptions",
    "Frame",
    "IsvError",
    "Mesh",
    "Points",
    "Repaired",
    "Report",
    "SurfaceParts",
    "Take",
    "Volume",
    "Writer",
    "__version__",
    "cut",
    "demux",
    "draw",
    "encode",
    "evaluate",
    "info",
    "join",
    "maps",
    "mux",
    "open",
    "repair",
    "set_threads",
    "settle",
    "verify",
]
