"""What Python gives is what the command line gives, bit for bit."""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import Any

import isv
import numpy as np
import pytest

from conftest import VOXEL, Command, box, boxes, capture, read_ply, write_ply


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


def test_verdicts_and_measurements_of_parts_are_those_of_the_command_line(
    command: Command, stream: Path, tmp_path: Path
) -> None:
    said = json.loads(command("verify", "--json", stream))[0]
    assert isv.verify(stream) == (said["frames"], said["frames_hashed"]) == (12, 0)
    damaged = bytearray(stream.read_bytes())
    damaged[len(damaged) // 2] ^= 1
    (tmp_path / "damaged.isv").write_bytes(damaged)
    with pytest.raises(isv.IsvError) as failure:
        isv.verify(tmp_path / "damaged.isv")
    assert failure.value.kind == "stream"
    # One frame against another one, and against a mesh of it elsewhere.
    same = isv.evaluate(stream, stream, spacing=0.01, frames=(2, 3), test_frames=(2, 3))
    moved = isv.evaluate(stream, stream, spacing=0.01, frames=(2, 3), test_frames=(7, 8))
    assert same["p2s_mean_mm"] < 1e-9 and moved["p2s_mean_mm"] > 5
    write_ply(tmp_path / "box.ply", box(0.7))
    far, near = (
        isv.evaluate(tmp_path / "box.ply", stream, spacing=0.01, frames=(0, 1), test_frames=(7, 8), origin=origin)
        for origin in (None, (0.63, 0, 0))
    )
    assert near["p2s_mean_mm"] < 3 < 100 < far["p2s_mean_mm"]
    with pytest.raises(isv.IsvError, match="1 of them, but test_frames has 2"):
        isv.evaluate(stream, stream, frames=(2, 3), test_frames=(7, 9))


def test_parts_encoded_apart_join_to_the_whole(tmp_path: Path) -> None:
    folder = tmp_path / "take"
    folder.mkdir()
    for number, mesh in enumerate(boxes(6)):
        write_ply(folder / f"frame_{number + 10 * (number > 3):04}.ply", mesh)
    fixed: dict[str, Any] = {"voxel": VOXEL, "gop": 2, "fixed_gop": True}
    isv.encode(folder, tmp_path / "whole.isv", **fixed)
    for part, frames in (("a", (0, 4)), ("b", (4, 6))):
        isv.encode(folder, tmp_path / f"{part}.isv", frames=frames, time_origin=0, **fixed)
    parts = [tmp_path / "a.isv", tmp_path / "b.isv"]
    assert isv.join(parts, tmp_path / "joined.isv", keep_times=True) == 6
    assert (tmp_path / "joined.isv").read_bytes() == (tmp_path / "whole.isv").read_bytes()
    isv.join(parts, tmp_path / "followed.isv")
    assert (tmp_path / "followed.isv").read_bytes() != (tmp_path / "whole.isv").read_bytes(), "the pause is gone"


def test_what_is_left_open_is_settled_as_encoding_does_it(stream: Path, tmp_path: Path) -> None:
    for number, mesh in enumerate(boxes(4, colored=True)):
        write_ply(tmp_path / f"frame_{number}.ply", mesh)
    settled = isv.settle(tmp_path, frames=(1, 4), fps=12.5)
    assert settled["frames"] == [1, 4] and settled["fps"] == 12.5 and settled["voxel"] == 0.005
    assert (settled["sign"], settled["color"], settled["profile"]) == ("closed", True, "main")
    assert isv.settle(tmp_path, color=False, profile="paper")["color"] is False
    assert settled["quality"] is None, "nothing was tried"
    of_stream = isv.settle(stream)
    assert (of_stream["content"], of_stream["sign"], of_stream["voxel"]) == ("volumes", None, VOXEL)
    with pytest.raises(ValueError, match="every is 0"):
        isv.settle(tmp_path, every=0)


def test_frames_are_drawn_as_the_command_line_draws_them(command: Command, stream: Path, tmp_path: Path) -> None:
    isv.draw(stream, tmp_path / "found.png", [3, 4], size=64, columns=2)
    command(
        "render",
        stream,
        "-o",
        tmp_path / "expected.png",
        "--frames",
        "3..5",
        "--size",
        64,
        "--captions",
        "--columns",
        2,
    )
    assert (tmp_path / "found.png").read_bytes() == (tmp_path / "expected.png").read_bytes()
    isv.draw(stream, tmp_path / "errors.png", [3], size=64, against=stream, against_first=1)
    assert (tmp_path / "errors.png").read_bytes() != (tmp_path / "found.png").read_bytes()
    for frames, size in (([], 64), ([3], 3), ([30], 64)):
        with pytest.raises(ValueError):
            isv.draw(stream, tmp_path / "wrong.png", frames, size=size)
    assert not (tmp_path / "wrong.png").exists()


def test_mp4_files_hold_streams_and_say_what_they_are(command: Command, tmp_path: Path) -> None:
    stream, muxed, direct = tmp_path / "take.isv", tmp_path / "take.mp4", tmp_path / "direct.mp4"
    frames = boxes(4)
    isv.encode(frames, stream, voxel=VOXEL, title="Boxes", capture_device="none")
    isv.encode(frames, direct, voxel=VOXEL, title="Boxes", capture_device="none")
    assert isv.mux(stream, muxed) == 4
    assert muxed.read_bytes() == direct.read_bytes()
    command("demux", muxed, "-o", tmp_path / "back.isv")
    isv.demux(muxed, tmp_path / "own.isv")
    assert stream.read_bytes() == (tmp_path / "back.isv").read_bytes() == (tmp_path / "own.isv").read_bytes()
    facts = isv.info(muxed)
    assert (facts["metadata"]["title"], facts["metadata"]["device"]) == ("Boxes", "none")
    assert [track["codec"] for track in facts["tracks"]] == ["isv1"]
    with isv.open(stream) as take, isv.open(muxed) as other:
        assert take[3].mesh().vertices.tobytes() == other[3].mesh().vertices.tobytes()
    with isv.open(muxed.read_bytes()) as take:
        assert len(take) == 4
    isv.cut(muxed, tmp_path / "part.mp4", slice(0, 2))
    assert isv.info(tmp_path / "part.mp4")["frames"] == 2
    with pytest.raises(isv.IsvError):
        isv.mux(stream, tmp_path / "no.mp4", sound=stream)
    assert not (tmp_path / "no.mp4").exists()
