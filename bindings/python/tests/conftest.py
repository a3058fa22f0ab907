"""What tests share: frames that move, streams of them, the command line and captures."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn

import isv
import numpy as np
import pytest
from numpy.typing import NDArray

ROOT = Path(__file__).resolve().parents[3]
VOXEL = 0.02


def box(x: float = 0.0, colored: bool = False) -> isv.Mesh:
    """A box of 0.5 m along x and 0.4 m along y and z, whose lowest corner is at x."""
    vertices = [[x + 0.5 * (i & 1), 0.2 * (i & 2), 0.1 * (i & 4)] for i in range(8)]
    quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
    faces = [triangle for a, b, c, d in quads for triangle in ([a, b, c], [a, c, d])]
    red, blue = [220, 30, 30], [30, 30, 220]
    colors = np.array([blue if i & 1 else red for i in range(8)], np.uint8) if colored else None
    return isv.Mesh(np.array(vertices, np.float32), np.array(faces, np.int64), None, colors)


def boxes(frames: int, colored: bool = False) -> list[isv.Mesh]:
    """Boxes that move 1 cm a frame."""
    return [box(0.01 * number, colored) for number in range(frames)]


def sphere_field(radius: float = 0.2, voxel: float = VOXEL, cells: int = 32) -> NDArray[np.float32]:
    """Distances from a sphere around the middle of a dense array with axes (z, y, x)."""
    places = (np.arange(cells) + 0.5 - cells / 2) * voxel
    z, y, x = np.meshgrid(places, places, places, indexing="ij")
    field: NDArray[np.float32] = (np.sqrt(x * x + y * y + z * z) - radius).astype(np.float32)
    return field


@pytest.fixture(scope="session")
def stream(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A stream of 12 boxes with a keyframe every 5 frames."""
    path = tmp_path_factory.mktemp("stream") / "boxes.isv"
    isv.encode(boxes(12), path, voxel=VOXEL, gop=5, fps=25)
    return path


@pytest.fixture(scope="session")
def colored_stream(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A stream of 3 coloured boxes."""
    path = tmp_path_factory.mktemp("colored") / "boxes.isv"
    isv.encode(boxes(3, colored=True), path, voxel=VOXEL)
    return path


Command = Callable[..., str]


@pytest.fixture(scope="session")
def command() -> Command:
    """The command line: a function of its arguments that returns what it prints."""
    built = [ROOT / "target" / profile / "isv" for profile in ("debug", "release")]
    found = [Path(os.environ["ISV_BIN"])] if "ISV_BIN" in os.environ else [path for path in built if path.exists()]
    if not found:
        pytest.skip("the command line is not built: cargo build -p isv-cli, or ISV_BIN")

    def run(*arguments: object) -> str:
        words = [str(found[0]), *map(str, arguments)]
        done = subprocess.run(words, capture_output=True, text=True, timeout=600, check=False)
        assert done.returncode == 0, done.stderr
        return done.stdout

    return run


def capture(name: str) -> Path:
    """The folder of a capture."""
    folder = Path(os.environ.get("ISV_DATA", ROOT.parent / "shared" / "data")) / name
    if not folder.is_dir():
        pytest.skip(f"the capture {name} is not there: ISV_DATA names the folder of captures")
    return folder


PLY_TYPES = {"float": "<f4", "double": "<f8", "uchar": "u1", "int": "<i4", "uint": "<u4"}


def read_ply(path: Path) -> dict[str, NDArray[Any]]:
    """Columns of the vertices of a binary PLY file, and its triangles as "faces"."""
    data = path.read_bytes()
    header, _, body = data.partition(b"end_header\n")
    assert b"binary_little_endian" in header
    kinds: list[tuple[str, str]] = []
    counts = {}
    element = ""
    for line in header.decode().splitlines():
        match line.split():
            case ["element", element, count]:
                counts[element] = int(count)
            case ["property", kind, name] if element == "vertex":
                kinds.append((name, PLY_TYPES[kind]))
    vertices = np.frombuffer(body, np.dtype(kinds), counts["vertex"])
    columns = {name: vertices[name] for name, _ in kinds}
    columns["positions"] = np.stack([vertices[axis] for axis in "xyz"], axis=1)
    if "nx" in columns:
        columns["normals"] = np.stack([vertices[axis] for axis in ("nx", "ny", "nz")], axis=1)
    if "red" in columns:
        columns["colors"] = np.stack([vertices[name] for name in ("red", "green", "blue")], axis=1)
    if counts.get("face"):
        faces = np.frombuffer(body[vertices.nbytes :], np.dtype([("n", "u1"), ("corners", "<i4", 3)]), counts["face"])
        assert (faces["n"] == 3).all()
        columns["faces"] = faces["corners"]
    return columns


def write_ply(path: Path, mesh: isv.Mesh) -> None:
    """Write a mesh as a binary PLY file in single precision."""
    colored = mesh.colors is not None
    kinds = [(axis, "<f4") for axis in "xyz"] + [(name, "u1") for name in ("red", "green", "blue") if colored]
    vertices = np.zeros(len(mesh.vertices), np.dtype(kinds))
    for column, axis in enumerate("xyz"):
        vertices[axis] = mesh.vertices[:, column]
    if mesh.colors is not None:
        for column, name in enumerate(("red", "green", "blue")):
            vertices[name] = mesh.colors[:, column]
    faces = np.zeros(len(mesh.faces), np.dtype([("n", "u1"), ("corners", "<i4", 3)]))
    faces["n"], faces["corners"] = 3, mesh.faces
    names = {"<f4": "float", "u1": "uchar"}
    lines = ["ply", "format binary_little_endian 1.0", f"element vertex {len(vertices)}"]
    lines += [f"property {names[kind]} {name}" for name, kind in kinds]
    lines += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header", ""]
    path.write_bytes("\n".join(lines).encode() + vertices.tobytes() + faces.tobytes())


def skip_without(need: str, why: str) -> NoReturn:
    """Skip a test for want of something, or fail if ISV_REQUIRE names it. ISV_SKIPS gets a line of it."""
    if need in os.environ.get("ISV_REQUIRE", "").split(","):
        pytest.fail(f"{why}, and ISV_REQUIRE asks for {need}")
    if "ISV_SKIPS" in os.environ:
        test = os.environ.get("PYTEST_CURRENT_TEST", "").split(" ")[0]
        with open(os.environ["ISV_SKIPS"], "a", encoding="utf-8") as file:
            file.write(f"{need}\t{test}\n")
    pytest.skip(why)


def write_take(
    folder: Path, frames: int, *, first: float = 0.0, colored: bool = False, open_from: int | None = None
) -> Path:
    """Write a take of boxes that move, each a file. From a frame on two sides of them may be left."""
    folder.mkdir(parents=True, exist_ok=True)
    for number in range(frames):
        mesh = box(first + 0.01 * number, colored)
        if open_from is not None and number >= open_from:
            mesh = isv.Mesh(mesh.vertices, mesh.faces[:4], None, mesh.colors)
        write_ply(folder / f"frame_{number:04}.ply", mesh)
    return folder


def half_written(folder: Path, *, killed: bool = False) -> list[Path]:
    """Files that are not whole, and streams that cannot be verified. Tasks that were killed leave hidden files."""
    found = [path for path in folder.rglob("*") if ".part" in path.name and not (killed and path.name.startswith("."))]
    for path in folder.rglob("*.isv"):
        try:
            isv.verify(path)
        except isv.IsvError:
            found.append(path)
    return found
