"""Python against the command line, in turn, on the same frames: ``python benches/paired.py CAPTURE [ROUNDS]``

Decoding: the command line's own times from packet to mesh (``--stats``: no files, no start) against a loop over the
take with ``frame.mesh()``. Encoding of arrays: the command line's own times from mesh to packet against
``isv.encode`` of arrays. Encoding of a folder: both from start to end, the command line's process among it.

ISV_BIN names the command line. Prints a table of medians; the ratio is the median of the ratios of each round.
"""

from __future__ import annotations

import io
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import isv
import numpy as np
import trimesh

VOXEL = 0.005
BIN = os.environ["ISV_BIN"]


def command(*words: object) -> None:
    """Run the command line."""
    subprocess.run([BIN, *map(str, words)], check=True, capture_output=True)


def seconds(job: Callable[[], object]) -> float:
    """Time that a job takes (s)."""
    begin = time.perf_counter()
    job()
    return time.perf_counter() - begin


def stated(path: Path, *keys: str) -> float:
    """Sum of the times of all frames (s) in a file of ``--stats``."""
    frames = json.loads(path.read_text())["frames"]
    return sum(float(frame[key]) for frame in frames for key in keys) / 1e3


def main() -> None:
    """Measure, and print the table."""
    folder, rounds = Path(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 7
    paths = sorted(folder.glob("*.ply"))
    with tempfile.TemporaryDirectory() as scratch:
        place = Path(scratch)
        stream, stats = place / "take.isv", place / "stats.json"
        command("encode", folder, "-o", stream, "--voxel", "5mm")
        meshes = []
        for path in paths:
            mesh = trimesh.load(path, process=False)
            meshes.append((np.asarray(mesh.vertices, np.float32), np.asarray(mesh.faces, np.uint32)))

        def decode_command() -> float:
            command("decode", stream, "-o", place / "out", "--stats", stats)
            return stated(stats, "decode_ms", "surface_ms")

        def decode_python() -> float:
            def job() -> None:
                with isv.open(stream) as take:
                    for frame in take:
                        frame.mesh()

            return seconds(job)

        def arrays_command() -> float:
            command("encode", folder, "-o", place / "x.isv", "--voxel", "5mm", "--stats", stats)
            return stated(stats, "ingest_ms", "encode_ms")

        def arrays_python() -> float:
            return seconds(lambda: isv.encode(meshes, io.BytesIO(), voxel=VOXEL))

        def folder_command() -> float:
            return seconds(lambda: command("encode", folder, "-o", place / "x.isv", "--voxel", "5mm"))

        def folder_python() -> float:
            return seconds(lambda: isv.encode(folder, place / "y.isv", voxel=VOXEL))

        print(f"| {folder.name}, {len(paths)} frames | command line (ms a frame) | Python (ms a frame) | ratio |")
        print("|---|---|---|---|")
        for name, one, other in (
            ("decode to meshes", decode_command, decode_python),
            ("encode arrays", arrays_command, arrays_python),
            ("encode the folder", folder_command, folder_python),
        ):
            pairs = [(one(), other()) for _ in range(rounds)]
            each = [1e3 * statistics.median(times) / len(paths) for times in zip(*pairs, strict=True)]
            ratio = statistics.median(b / a for a, b in pairs)
            print(f"| {name} | {each[0]:.1f} | {each[1]:.1f} | {ratio:.3f} |")


if __name__ == "__main__":
    main()
