"""Batch encoding against the same shards by hand: ``python benches/batch.py CAPTURE [TAKES] [ROUNDS]``

The capture is encoded as so many takes, each of which is one shard. Prints a table. Overhead: processor time of all of
a run on Ray (driver, workers and daemons) over that of the same tasks one after the other in one process. Scaling: time
of the same tasks on a cluster of one processor over that on one of two, beside what plain processes gain on the same
machine. Starting clusters is left out.

Ray gives its workers a niceness of 15. On a machine that others use too, set ``RAY_worker_niceness=0``.
"""

from __future__ import annotations

import multiprocessing
import statistics
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import isv
import psutil
import ray
from isv.batch import Choices, InlineEngine, Plan, Store, plan_takes, run, write_plan
from isv.batch.driver import task_at
from isv.batch.engines import ordered
from isv.batch.ray_engine import RayEngine
from isv.batch.tasks import run_task

VOXEL, GOP = 0.004, 10
CHOICES = Choices(sample=0, pictures=0)


def cpu_of_workers() -> float:
    """Processor time of this process and of all of Ray's, its daemons among them (s)."""
    total = 0.0
    for process in [psutil.Process(), *psutil.Process().children(recursive=True)]:
        try:
            times = process.cpu_times()
        except psutil.Error:
            continue
        total += times.user + times.system
    return total


def warm(task: dict[str, Any]) -> None:
    """Run a task on each processor of the cluster, so that its worker has started."""
    remote = ray.remote(run_task).options(scheduling_strategy="SPREAD")
    count = int(ray.cluster_resources()["CPU"])
    ray.get([remote.remote(task) for _ in range(2 * count)])


def by_hand(plan: Plan, folder: Path) -> tuple[float, float]:
    """Run the same tasks one after the other in this process. Returns processor and wall time (s)."""
    isv.set_threads(1)
    cpu, wall = time.process_time(), time.monotonic()
    with InlineEngine() as engine:
        run(plan, Store(str(folder / "out")), engine, CHOICES)
    return time.process_time() - cpu, time.monotonic() - wall


def encoded(plan: Plan, folder: Path) -> float:
    """Encode all shards and do nothing else. Returns processor time (s)."""
    isv.set_threads(1)
    cpu = time.process_time()
    for take in plan.takes():
        for shard in take["shards"]:
            isv.encode(take["source"], folder / "shard.isv", frames=tuple(shard["frames"]), **take["settings"])
    return time.process_time() - cpu


def by_processes(plan: Plan, folder: Path, processes: int) -> float:
    """Encode all shards in so many processes without an engine: what the machine allows. Returns wall time (s)."""
    store = Store(str(folder / "plain"))
    shards = sum(len(take["shards"]) for take in plan.takes())
    tasks = [task_at(plan, store, "encode", number, CHOICES, None) for number in range(shards)]
    nothing = {"task": "plan", "name": "", "source": str(folder / "none"), "options": {}, "shard_frames": 1}
    with ProcessPoolExecutor(processes, mp_context=multiprocessing.get_context("spawn")) as pool:
        list(pool.map(run_task, [nothing] * (4 * processes)))
        wall = time.monotonic()
        results = list(pool.map(run_task, [{**task, "threads": 1} for task in tasks if task is not None]))
        took = time.monotonic() - wall
    assert all(result["ok"] for result in results)
    return took


def on_ray(plan: Plan, folder: Path, cpus: int) -> tuple[float, float]:
    """Run the plan on a cluster of so many processors. Returns processor and wall time (s)."""
    ray.init(address="local", num_cpus=cpus, log_to_driver=False, logging_level="error", include_dashboard=False)
    try:
        warm({"task": "plan", "name": "", "source": str(folder / "none"), "options": {}, "shard_frames": 1})
        with RayEngine() as engine:
            cpu, wall = cpu_of_workers(), time.monotonic()
            summary = run(plan, Store(str(folder / "out")), engine, CHOICES)
            took = cpu_of_workers() - cpu, time.monotonic() - wall
    finally:
        ray.shutdown()
    assert not summary.failures, summary.failed
    return took


def main() -> None:
    """Measure, and print the table."""
    capture = Path(sys.argv[1])
    takes = int(sys.argv[2]) if len(sys.argv) > 2 else 12
    rounds = int(sys.argv[3]) if len(sys.argv) > 3 else 3
    figures: list[dict[str, float]] = []
    with tempfile.TemporaryDirectory() as scratch:
        place = Path(scratch)
        found = [(f"take_{number}", str(capture)) for number in range(takes)]
        options = {"voxel": VOXEL, "gop": GOP}
        with InlineEngine() as engine:
            write_plan(place / "plan.json", {}, plan_takes(found, options, 300, lambda t: ordered(engine, t)))
        plan = Plan.open(place / "plan.json")
        for number in range(rounds):
            folders = [place / f"{number}{name}" for name in ("hand", "one", "two")]
            for folder in folders:
                folder.mkdir()
            bare, hand = encoded(plan, folders[0]), by_hand(plan, folders[0])
            one, two = on_ray(plan, folders[1], 1), on_ray(plan, folders[2], 2)
            plain = [by_processes(plan, folders[count], count) for count in (1, 2)]
            figures.append(
                {
                    "processor time over by hand, 1 worker": one[0] / hand[0],
                    "processor time over by hand, 2 workers": two[0] / hand[0],
                    "wall time over by hand, 1 worker": one[1] / hand[1],
                    "wall time, 1 worker over 2": one[1] / two[1],
                    "wall time without an engine, 1 process over 2": plain[0] / plain[1],
                    "by hand over encoding alone, processor time": hand[0] / bare,
                    "by hand (s of processor time)": hand[0],
                }
            )
    print(f"| {capture.name}, {takes} times | median | rounds |")
    print("|---|---|---|")
    for name in figures[0]:
        values = [figure[name] for figure in figures]
        print(f"| {name} | {statistics.median(values):.3f} | {', '.join(f'{value:.3f}' for value in values)} |")


if __name__ == "__main__":
    main()
