"""What Python gives is what the command line gives, bit for bit."""

from __future__ import annotations

import io
import json
from pathlib import Path

import isv
import numpy as np
import pytest

from conftest import VOXEL, Command, boxes, capture, read_ply, write_ply


@pytest.fixture(scope="module")
def textured(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A stream of 3 frames of a capture with texture."""
    path = tmp_path_factory.mktemp("textured") / "take.isv"
    isv.encode(capture("liam_textured"), path, voxel=0.01, frames=slice(0, 3))
    return path


@pytest.fixture(params=["boxes", "capture"])
def any_stream(request: pytest.FixtureRequest) -> Path:
    name = {"boxes": "colored_stream", "capture": "textured"}[request.param]
    path = request.getfixturevalue(name)
    assert isinstance(path, Path)
    return path


@pytest.mark.parametrize("lod", [1, 2, 4])
def test_meshes_are_those_of_the_command_line(command: Command, any_stream: Path, tmp_path: Path, lod: int) -> None:
    command("decode", any_stream, "-o", tmp_path / "out", "--normals", "--lod", lod)
    with isv.open(any_stream, lod=lod) as take:  # type: ignore[arg-type]
        for frame in take:
            expected = read_ply(tmp_path / "out" / f"frame_{frame.number:04}.ply")
            mesh = frame.mesh(normals=True)
            assert mesh.normals is not None and mesh.colors is not None
            assert mesh.vertices.tobytes() == expected["positions"].tobytes()
            assert (mesh.faces == expected["faces"]).all()
            assert mesh.normals.tobytes() == expected["normals"].tobytes()
            assert (mesh.colors == expected["colors"]).all()
            plain = frame.mesh()
            assert plain.normals is None and plain.vertices.tobytes() == mesh.vertices.tobytes()


@pytest.mark.parametrize("count", [None, 1000])
def test_points_are_those_of_the_command_line(
    command: Command, any_stream: Path, tmp_path: Path, count: int | None
) -> None:
    many = [] if count is None else ["--points", count]
    command("decode", any_stream, "-o", tmp_path / "out", "--as", "points", *many)
    with isv.open(any_stream) as take:
        for frame in take:
            expected = read_ply(tmp_path / "out" / f"frame_{frame.number:04}.ply")
            points = frame.points(count)
            assert points.normals is not None and points.colors is not None
            assert points.positions.tobytes() == expected["positions"].tobytes()
            assert points.normals.tobytes() == expected["normals"].tobytes()
            assert (points.colors == expected["colors"]).all()


def test_volumes_are_those_of_the_command_line(command: Command, any_stream: Path, tmp_path: Path) -> None:
    command("decode", any_stream, "-o", tmp_path / "out", "--as", "volume")
    with isv.open(any_stream) as take:
        for frame in take:
            folder = tmp_path / "out" / f"frame_{frame.number:04}"
            grid = json.loads((folder / "grid.json").read_text())
            volume = frame.volume()
            assert volume.voxel == grid["voxel_size_m"]
            assert (volume.coords == np.load(folder / "coords.npy")).all()
            # Distances are whole 256ths of a voxel: files have them in truncations, arrays in metres.
            codes = np.rint(np.load(folder / "tsdf.npy").astype(np.float64) * volume.truncation * 256)
            assert grid["tsdf_unit"] == "truncation" and len(np.unique(codes)) > 500
            observed = np.load(folder / "weight.npy") > 0
            expected = codes.astype(np.float32) * np.float32(volume.voxel / 256)
            expected[~observed.reshape(expected.shape)] = np.nan
            assert np.array_equal(volume.distances, expected, equal_nan=True)


def test_facts_are_those_of_the_command_line(command: Command, any_stream: Path) -> None:
    assert isv.info(any_stream) == json.loads(command("info", "--json", any_stream))


def test_errors_are_those_of_the_command_line(command: Command, stream: Path, tmp_path: Path) -> None:
    coarse = tmp_path / "coarse.isv"
    isv.encode(boxes(3), coarse, voxel=2 * VOXEL)
    found = isv.evaluate(stream, coarse, spacing=0.01, frames=slice(0, 3))
    printed = command("eval", "--json", stream, coarse, "--spacing", "1cm", "--frames", "0..3")
    assert found == json.loads(printed)
    assert len(found["frames"]) == 3 and 0 < found["p2s_mean_mm"] < 20


def test_a_folder_becomes_the_bytes_of_the_command_line(command: Command, tmp_path: Path) -> None:
    folder = tmp_path / "take"
    folder.mkdir()
    frames = boxes(6, colored=True)
    for number, mesh in enumerate(frames):
        write_ply(folder / f"frame_{number:04}.ply", mesh)
    command("encode", folder, "-o", tmp_path / "expected.isv", "--voxel", "20mm", "--gop", 4, "--fps", 25)
    expected = (tmp_path / "expected.isv").read_bytes()
    steps: list[tuple[int, int | None]] = []
    report = isv.encode(
        folder,
        tmp_path / "found.isv",
        voxel=VOXEL,
        gop=4,
        fps=25,
        progress=lambda done, total: steps.append((done, total)),
    )
    assert (tmp_path / "found.isv").read_bytes() == expected
    assert report.bytes == len(expected) and steps == [(done, 6) for done in range(1, 7)]
    # The same meshes as arrays, and the path to a file object.
    for source in (frames, folder):
        file = io.BytesIO()
        isv.encode(source, file, voxel=VOXEL, gop=4, fps=25)
        assert file.getvalue() == expected


def test_a_capture_becomes_the_bytes_of_the_command_line(command: Command, textured: Path, tmp_path: Path) -> None:
    command("encode", capture("liam_textured"), "-o", tmp_path / "expected.isv", "--voxel", "10mm", "--frames", "0..3")
    assert textured.read_bytes() == (tmp_path / "expected.isv").read_bytes()


def test_options_are_those_of_the_command_line(command: Command, tmp_path: Path) -> None:
    write_ply(tmp_path / "frame.ply", boxes(1)[0])
    pairs: list[tuple[isv.EncodeOptions, list[object]]] = [
        ({"quality": 80, "preset": "archive"}, ["--quality", 80, "--preset", "archive"]),
        ({"bitrate_mbps": 0.5, "fps": 12.5}, ["--bitrate", "0.5M", "--fps", 12.5]),
        ({"max_error": 0.001, "refresh": "gradual"}, ["--max-error", "1mm", "--refresh", "gradual"]),
        ({"sign": "offset", "shell_offset": 2.0}, ["--sign", "offset", "--offset", 2]),
        ({"profile": "paper", "checksums": True}, ["--profile", "paper", "--checksums"]),
        ({"units": "cm", "up": "z", "origin": (1, 2, 3)}, ["--units", "cm", "--up", "z", "--origin", "1,2,3"]),
        ({"voxel": "auto"}, ["--voxel", "auto"]),
    ]
    for options, flags in pairs:
        options.setdefault("voxel", 0.001 if "units" in options else VOXEL)
        words = [] if options["voxel"] == "auto" else ["--voxel", f"{options['voxel'] * 1000:g}mm"]
        command("encode", tmp_path / "frame.ply", "-o", tmp_path / "expected.isv", *words, *flags)
        isv.encode(tmp_path / "frame.ply", tmp_path / "found.isv", **options)
        assert (tmp_path / "found.isv").read_bytes() == (tmp_path / "expected.isv").read_bytes(), options


def test_edits_are_those_of_the_command_line(command: Command, stream: Path, tmp_path: Path) -> None:
    assert isv.join([stream, stream], tmp_path / "joined.isv") == 24
    command("join", stream, stream, "-o", tmp_path / "expected.isv")
    assert (tmp_path / "joined.isv").read_bytes() == (tmp_path / "expected.isv").read_bytes()
    assert isv.cut(stream, tmp_path / "part.isv", slice(5, 9)) == 4
    command("cut", stream, "5..9", "-o", tmp_path / "expected.isv")
    assert (tmp_path / "part.isv").read_bytes() == (tmp_path / "expected.isv").read_bytes()
    damaged = bytearray(stream.read_bytes())[:-30]
    second = [at for at in range(len(damaged)) if damaged[at : at + 4] == b"ISVP"][6]
    damaged[second + 60] ^= 1
    (tmp_path / "damaged.isv").write_bytes(damaged)
    report = isv.repair(tmp_path / "damaged.isv", tmp_path / "repaired.isv")
    command("repair", tmp_path / "damaged.isv", "-o", tmp_path / "expected.isv")
    assert (tmp_path / "repaired.isv").read_bytes() == (tmp_path / "expected.isv").read_bytes()
    assert 0 < report.kept < 12 and len(report.damage) >= 1 and not report.had_end
