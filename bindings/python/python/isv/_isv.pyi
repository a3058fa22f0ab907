"""The extension module. Its users are the other modules of the package: what it has may change in any version."""

from collections.abc import Callable
from os import PathLike
from pathlib import Path
from typing import Any, TypeAlias, final

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "Frame",
    "IsvError",
    "Reader",
    "SurfaceParts",
    "Writer",
    "__version__",
    "cut",
    "demux",
    "draw",
    "encode",
    "evaluate",
    "frame_files",
    "info",
    "join",
    "mux",
    "repair",
    "set_threads",
    "settle_options",
    "verify",
]

__version__: str

_Path: TypeAlias = str | PathLike[str]
_Settings: TypeAlias = tuple[int, bool, bool, int | None]
_Report: TypeAlias = tuple[int, int, int, int, float, float, float | None]
_Camera: TypeAlias = tuple[tuple[float, float], tuple[float, float], list[list[float]]]
_Progress: TypeAlias = Callable[[int, int | None], object] | None
_Frames: TypeAlias = tuple[int, int | None]

class IsvError(ValueError):
    kind: str

@final
class Reader:
    @classmethod
    def open(cls, path: _Path, settings: _Settings) -> Reader: ...
    @classmethod
    def from_bytes(cls, name: str, bytes: bytes | bytearray, settings: _Settings) -> Reader: ...
    @classmethod
    def from_file(cls, name: str, file: object, seekable: bool, settings: _Settings) -> Reader: ...
    @property
    def frames(self) -> int | None: ...
    @property
    def fps(self) -> float | None: ...
    @property
    def voxel(self) -> float | None: ...
    def read_end(self) -> None: ...
    def next_frame(self) -> Frame | None: ...
    def frame(self, number: int) -> Frame: ...
    def frame_from(self, number: int) -> Frame | None: ...

@final
class Frame:
    @property
    def number(self) -> int: ...
    @property
    def timestamp_ns(self) -> int: ...
    def mesh(
        self, normals: bool
    ) -> tuple[NDArray[np.float32], NDArray[np.uint32], NDArray[np.float32] | None, NDArray[np.uint8] | None]: ...
    def points(
        self, count: int | None
    ) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.uint8] | None]: ...
    def volume(self) -> tuple[float, int, int, NDArray[np.int32], NDArray[np.float32]]: ...

@final
class SurfaceParts:
    def __new__(cls, normals: bool) -> SurfaceParts: ...
    def update(self, frame: Frame) -> tuple[list[tuple[int, int, int]], list[tuple[int, int, int]]]: ...
    def places(self) -> list[tuple[int, int, int]]: ...
    def mesh(
        self, place: tuple[int, int, int], frame: Frame, normals: bool
    ) -> (
        tuple[NDArray[np.float32], NDArray[np.uint32], NDArray[np.float32] | None, NDArray[np.uint8] | None] | None
    ): ...

@final
class Writer:
    def __new__(cls, output: object, options: dict[str, Any]) -> Writer: ...
    def push_mesh(
        self,
        vertices: NDArray[np.float32] | NDArray[np.float64],
        faces: NDArray[np.uint32],
        colors: NDArray[np.uint8] | None,
        time_ns: int | None,
    ) -> None: ...
    def push_points(
        self,
        positions: NDArray[np.float32] | NDArray[np.float64],
        normals: NDArray[np.float32] | None,
        colors: NDArray[np.uint8] | None,
        viewpoint: tuple[float, float, float] | None,
        time_ns: int | None,
    ) -> None: ...
    def push_depth(
        self,
        depths: list[tuple[NDArray[np.float32], _Camera]],
        colors: list[tuple[NDArray[np.uint8], _Camera, int | None]],
        time_ns: int | None,
    ) -> None: ...
    def push_volume(
        self,
        voxel_m: float,
        truncation_voxels: int,
        coords: NDArray[np.int32],
        distances: NDArray[np.float32],
        time_ns: int | None,
    ) -> None: ...
    def finish(self) -> _Report: ...
    def abandon(self) -> None: ...

def encode(input: _Path, output: object, options: dict[str, Any], progress: _Progress) -> _Report: ...
def evaluate(
    reference: _Path,
    test: _Path,
    spacing: float,
    frames: _Frames | None,
    test_frames: _Frames | None,
    units: list[str],
    origins: list[tuple[float, float, float] | None],
    up: list[str],
    animations: list[str | None],
    fps: float,
    progress: _Progress,
) -> str: ...
def info(path: _Path) -> str: ...
def repair(
    input: _Path, output: _Path, header_from: _Path | None
) -> tuple[int, int, int, list[tuple[int, int]], bool]: ...
def mux(input: _Path, output: _Path, sound: _Path | None) -> int: ...
def demux(input: _Path, output: _Path) -> None: ...
def join(inputs: list[_Path], output: _Path, keep_times: bool) -> int: ...
def frame_files(input: _Path) -> list[Path] | None: ...
def settle_options(input: _Path, options: dict[str, Any], every: int) -> str: ...
def verify(path: _Path) -> tuple[int, int]: ...
def draw(
    input: _Path,
    output: _Path,
    frames: list[int],
    size: int,
    columns: int | None,
    against: tuple[_Path, str, tuple[float, float, float] | None, str, int, str | None, float] | None,
    range_m: float,
) -> None: ...
def cut(input: _Path, output: _Path, frames: _Frames) -> int: ...
def set_threads(threads: int | None) -> None: ...
