"""Random frames of a stream for training, read by many workers: ``python torch_frames.py take7.isv --workers 4``

Each sample is a fixed number of points of a frame, with their normals. Workers open the stream for themselves.
"""

from __future__ import annotations

import argparse

import isv
import torch
from torch.utils.data import DataLoader, Dataset


class Frames(Dataset[tuple[int, torch.Tensor, torch.Tensor]]):
    """Frames of a stream as tensors: number, positions (P, 3) in metres, normals (P, 3)."""

    def __init__(self, path: str, points: int) -> None:
        self.take = isv.open(path)
        self.points = points

    def __len__(self) -> int:
        return len(self.take)

    def __getitem__(self, number: int) -> tuple[int, torch.Tensor, torch.Tensor]:
        points = self.take[number].points(self.points)
        # The tensors use the memory of the arrays, and these that of the decoder.
        return number, torch.from_numpy(points.positions), torch.from_numpy(points.normals)


def begin_worker(_: int) -> None:
    """Let each worker use one core: there are as many workers as cores."""
    isv.set_threads(1)


def main() -> None:
    """Read each frame once, in random order."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("stream")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--method", choices=["fork", "spawn", "forkserver"], default="fork")
    arguments = parser.parse_args()
    frames = Frames(arguments.stream, points=2048)
    # The parent decodes too: forked workers must not wait for its threads.
    print(f"frame 0: {frames[0][1].shape[0]} points")
    loader = DataLoader(
        frames,
        batch_size=4,
        shuffle=True,
        num_workers=arguments.workers,
        worker_init_fn=begin_worker,
        multiprocessing_context=arguments.method if arguments.workers else None,
    )
    seen = set()
    for numbers, positions, normals in loader:
        assert positions.shape == normals.shape == (len(numbers), 2048, 3)
        seen.update(numbers.tolist())
    assert seen == set(range(len(frames)))
    print(f"{len(seen)} frames by {arguments.workers} workers")


if __name__ == "__main__":
    main()
