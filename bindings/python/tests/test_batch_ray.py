"""Batch encoding on a Ray cluster of two nodes, which are processes here, and in an object store on loopback."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import threading
import time
import uuid
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import isv
import pytest
from isv.batch import Choices, InlineEngine, Plan, Store, Summary, run
from isv.batch.report import status
from isv.batch.sources import Source

from conftest import half_written, skip_without, write_take
from test_batch import BARE, COARSE, inline, planned, serial

# What Ray and the libraries under it warn of is theirs.
pytestmark = pytest.mark.filterwarnings("ignore")


class Nodes:
    """A cluster: a head and workers, each with one processor."""

    def __init__(self) -> None:
        from ray.cluster_utils import Cluster

        self.cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1, "object_store_memory": 80_000_000})
        self.worker = self.add()

    def add(self) -> Any:
        return self.cluster.add_node(num_cpus=1, object_store_memory=80_000_000)

    @property
    def address(self) -> str:
        return str(self.cluster.address)


@pytest.fixture(scope="module")
def nodes(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Nodes]:
    try:
        import ray
    except ImportError:
        skip_without("ray", "Ray is not installed: pip install 'isv[ray]'")
    os.environ["RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO"] = "0"
    os.environ["RAY_USAGE_STATS_ENABLED"] = "0"
    # A node that is gone is known to be so after a second, and not after half a minute.
    os.environ.update(RAY_health_check_period_ms="300", RAY_health_check_failure_threshold="3")
    started = Nodes()
    ray.init(address=started.address, log_to_driver=False, logging_level="error")
    yield started
    ray.shutdown()
    started.cluster.shutdown()


def on_ray(plan: Plan, output: str | Path, choices: Choices = BARE, **more: Any) -> Summary:
    from isv.batch.ray_engine import RayEngine

    with RayEngine(**more) as engine:
        return run(plan, Store(str(output)), engine, choices)


def meanwhile(job: Callable[[], Summary], interfere: Callable[[], object]) -> Summary:
    """Run a job on a thread of its own, and something else beside it."""
    done: list[Summary] = []
    thread = threading.Thread(target=lambda: done.append(job()))
    thread.start()
    interfere()
    thread.join(timeout=120)
    assert done, "the job is still running"
    return done[0]


def encoders(name: str) -> list[int]:
    """Processes of workers that encode a shard of a take, and have done so for a moment."""
    import psutil

    found = []
    for process in psutil.process_iter(["cmdline", "pid"]):
        if f"ray::isv-batch encode {name}" in " ".join(process.info["cmdline"] or []):
            found.append(int(process.info["pid"]))
    return found


def wait_for(what: Callable[[], Any], seconds: float = 60.0) -> Any:
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if found := what():
            return found
        time.sleep(0.005)
    raise AssertionError("it did not happen")


def slow_take(folder: Path) -> Path:
    """A take whose shards take long enough to be met half-way."""
    return write_take(folder, 8)


SLOW: dict[str, Any] = {"voxel": 0.008, "preset": "archive"}


def check_streams(takes: list[Path], out: Path, scratch: Path, **options: Any) -> None:
    for take in takes:
        expected = serial(take, scratch / "serial.isv", **options)
        assert (out / "takes" / take.name / "take.isv").read_bytes() == expected, take.name
    assert half_written(out, killed=True) == []


def test_shards_of_two_nodes_join_to_the_bytes_of_one_encoder(nodes: Nodes, tmp_path: Path) -> None:
    takes = [write_take(tmp_path / "boxes", 16), write_take(tmp_path / "painted", 8, colored=True)]
    # Long enough that one node has not done all before the other has a worker.
    plan = planned(tmp_path, takes, shard_frames=2, **SLOW)
    summary = on_ray(plan, tmp_path / "out", Choices(sample=2, pictures=1, picture_size=64))
    assert (summary.done, summary.encoded, summary.failed) == (2, 12, [])
    check_streams(takes, tmp_path / "out", tmp_path, **SLOW)
    shards = [
        Store(str(tmp_path / "out")).read_json(f"takes/boxes/shards/{n:07}-{n + 2:07}.json") for n in range(0, 16, 2)
    ]
    assert len({shard["worker"] for shard in shards if shard}) >= 2, "both nodes had a part in it"


def test_a_worker_killed_in_mid_shard_and_a_corrupt_take_leave_the_others_right(nodes: Nodes, tmp_path: Path) -> None:
    takes = [slow_take(tmp_path / name) for name in ("a", "b", "broken", "c")]
    (takes[2] / "frame_0005.ply").write_bytes((takes[2] / "frame_0005.ply").read_bytes()[:150])
    plan, out, killed = planned(tmp_path, takes, **SLOW), tmp_path / "out", []

    def kill() -> None:
        killed.append(wait_for(lambda: encoders("b"))[0])
        os.kill(killed[0], signal.SIGKILL)

    summary = meanwhile(lambda: on_ray(plan, out), kill)
    assert killed and summary.done == 3 and summary.failures == 1
    assert "frame_0005.ply" in dict(summary.failed)["broken"]
    assert not (out / "takes" / "broken" / "take.isv").exists()
    check_streams([take for take in takes if take.name != "broken"], out, tmp_path, **SLOW)


def test_a_node_that_goes_takes_nothing_with_it(nodes: Nodes, tmp_path: Path) -> None:
    import ray

    takes = [slow_take(tmp_path / name) for name in ("a", "b", "c")]
    plan, out = planned(tmp_path, takes, **SLOW), tmp_path / "out"

    def remove() -> None:
        wait_for(lambda: len(encoders("a") + encoders("b")) == 2)
        nodes.cluster.remove_node(nodes.worker, allow_graceful=False)

    try:
        summary = meanwhile(lambda: on_ray(plan, out), remove)
        assert (summary.done, summary.failed) == (3, [])
        wait_for(lambda: len([node for node in ray.nodes() if node["Alive"]]) == 1)
        check_streams(takes, out, tmp_path, **SLOW)
    finally:
        nodes.worker = nodes.add()


def test_a_full_disk_leaves_the_takes_that_had_room(nodes: Nodes, tmp_path: Path) -> None:
    """The disk is one of its own, in memory, with room for some of the takes."""
    disk = tmp_path / "disk"
    disk.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=200k", "isv-batch-test", str(disk)]
    if subprocess.run(mount, capture_output=True, check=False).returncode:
        skip_without("mount", "a file system cannot be mounted: root may")
    try:
        takes = [write_take(tmp_path / name, 4) for name in "abcdefghijklmnopqrst"]
        plan = planned(tmp_path, takes)
        summary = on_ray(plan, disk / "out", retries=0)
        assert summary.done > 0 and summary.failures > 0 and summary.done + summary.failures == 20
        assert all("No space left" in error for _, error in summary.failed), summary.failed
        failed = dict(summary.failed)
        check_streams([take for take in takes if take.name not in failed], disk / "out", tmp_path)
        assert not any((disk / "out" / "takes" / name / "take.json").exists() for name in failed)
        # With more room the same command does the rest.
        subprocess.run(["mount", "-o", "remount,size=10m", str(disk)], check=True)
        again = on_ray(plan, disk / "out")
        assert (again.done, again.reused, again.failures) == (summary.failures, summary.done, 0)
        check_streams(takes, disk / "out", tmp_path)
    finally:
        subprocess.run(["umount", "-l", str(disk)], check=True)


def test_200_takes_end_complete_though_the_driver_is_killed_half_way(nodes: Nodes, tmp_path: Path) -> None:
    first = write_take(tmp_path / "takes" / "take_000", 2)
    for number in range(1, 200):
        shutil.copytree(first, tmp_path / "takes" / f"take_{number:03}")
    options = {"voxel": 0.08}
    plan, out = planned(tmp_path, [tmp_path / "takes"], shard_frames=2, **options), tmp_path / "out"
    finish = ["--sample", "0", "--pictures", "0"]
    words = [sys.executable, "-m", "isv.batch", "run", plan.path, "--output", str(out), *finish]
    words += ["--engine", "ray", "--address", nodes.address]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as driver:
        wait_for(lambda: len(list(out.glob("takes/*/take.json"))) >= 40)
        driver.kill()
    before = len(list(out.glob("takes/*/take.json")))
    assert 40 <= before < 200, "the driver was killed half-way"
    # What it had handed out may still be running, beside the driver that comes next.
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    found = status(plan, Store(str(out)))
    assert (found.takes, found.done, found.failed) == (200, 200, 0)
    reused = int(done.stdout.split(" takes done, ")[1].split(" ")[0])
    assert reused >= before
    expected = serial(first, tmp_path / "serial.isv", **options)
    assert all((out / "takes" / f"take_{n:03}" / "take.isv").read_bytes() == expected for n in range(200))
    assert half_written(out / "takes" / "take_000", killed=True) == []


@pytest.fixture
def bucket(monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """An object store on loopback, and the URL of a bucket in it."""
    try:
        import boto3  # type: ignore[import-not-found, import-untyped, unused-ignore]
        import s3fs
        from moto.server import ThreadedMotoServer
    except ImportError:
        skip_without("object-store", "moto and s3fs are not installed")
    server = ThreadedMotoServer(port=0, verbose=False)
    server.start()
    host, port = server.get_host_and_port()
    variables = {
        "AWS_ENDPOINT_URL": f"http://127.0.0.1:{port}",
        "AWS_ACCESS_KEY_ID": "test",
        "AWS_SECRET_ACCESS_KEY": "test",
        "AWS_DEFAULT_REGION": "us-east-1",
    }
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    s3fs.S3FileSystem.clear_instance_cache()
    # Servers of one process share what they hold.
    name = f"takes-{uuid.uuid4().hex}"
    boto3.client("s3").create_bucket(Bucket=name)
    yield f"s3://{name}"
    s3fs.S3FileSystem.clear_instance_cache()
    server.stop()


def upload(folder: Path, url: str) -> None:
    store = Store(url)
    for path in folder.rglob("*"):
        if path.is_file():
            store.publish(path, path.relative_to(folder).as_posix())


def test_takes_of_an_object_store_become_the_same_streams_there(bucket: str, tmp_path: Path) -> None:
    takes = [write_take(tmp_path / "takes" / name, 8, first=at) for name, at in (("a", 0.0), ("b", 0.3))]
    # A pause, which is in the names of frames that are not copied.
    (takes[0] / "frame_0007.ply").rename(takes[0] / "frame_0017.ply")
    upload(tmp_path / "takes", f"{bucket}/in")
    plan = plan_of(tmp_path, f"{bucket}/in")
    assert [take["name"] for take in plan.takes()] == ["a", "b"]
    store = Store(f"{bucket}/out")
    with InlineEngine() as engine:
        summary = run(plan, store, engine, Choices(sample=2, pictures=1, picture_size=64))
    assert (summary.done, summary.failed) == (2, [])
    for take in takes:
        expected = serial(take, tmp_path / "serial.isv")
        assert store.read(f"takes/{take.name}/take.isv") == expected
    names = store.names("takes/a")
    assert "worst.png" in names and not any("part" in name for name in names)
    # Workers copy the frames of their shard, and of the others the names alone.
    scratch = tmp_path / "scratch"
    copy = Source(f"{bucket}/in/a").local(scratch, 4, 8)
    sizes = {path.name: path.stat().st_size for path in sorted(copy.iterdir())}
    assert [size > 0 for size in sizes.values()] == [False] * 4 + [True] * 4
    # A changed object is another input.
    store_in = Store(f"{bucket}/in")
    store_in.publish(takes[1] / "frame_0000.ply", "a/frame_0005.ply")
    with InlineEngine() as engine:
        again = run(plan_of(tmp_path, f"{bucket}/in"), store, engine, Choices(sample=2, pictures=1, picture_size=64))
    assert (again.done, again.reused, again.encoded, again.kept) == (1, 1, 1, 3)


def plan_of(folder: Path, url: str) -> Plan:
    from isv.batch import plan_takes, write_plan
    from isv.batch.engines import ordered
    from isv.batch.sources import find_takes

    options = {"voxel": COARSE, "gop": 2}
    with InlineEngine() as engine:
        write_plan(folder / "plan.json", {}, plan_takes(find_takes(url), options, 4, lambda t: ordered(engine, t)))
    return Plan.open(folder / "plan.json")


def test_a_take_of_an_object_store_that_begins_with_nobody_keeps_its_colours(bucket: str, tmp_path: Path) -> None:
    take = write_take(tmp_path / "takes" / "a", 16, colored=True)
    nobody = "ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nproperty float y\nproperty float z\n"
    for number in range(7):
        (take / f"frame_{number:04}.ply").write_text(nobody + "end_header\n")
    upload(tmp_path / "takes", f"{bucket}/in")
    (planned,) = plan_of(tmp_path, f"{bucket}/in").takes()
    assert planned["settings"]["expect_color"] is True


def test_ray_writes_to_an_object_store(bucket: str, tmp_path: Path) -> None:
    """Ray is started for this test alone: its workers know the store by the environment that they were started in."""
    try:
        import ray  # noqa: F401
    except ImportError:
        skip_without("ray", "Ray is not installed: pip install 'isv[ray]'")
    take = write_take(tmp_path / "takes" / "a", 8)
    upload(tmp_path / "takes", f"{bucket}/in")
    plan = plan_of(tmp_path, f"{bucket}/in")
    words = ["run", plan.path, "--output", f"{bucket}/ray", "--engine", "ray", "--sample", "1", "--pictures", "0"]
    command = [sys.executable, "-m", "isv.batch", *words]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert Store(f"{bucket}/ray").read("takes/a/take.isv") == serial(take, tmp_path / "serial.isv")
    assert b"a,done" in (Store(f"{bucket}/ray").read("takes.csv") or b"")


def test_inline_and_ray_agree(nodes: Nodes, tmp_path: Path) -> None:
    """Rates too, whose quality comes of statistics of all shards."""
    take = write_take(tmp_path / "a", 12)
    plan = planned(tmp_path, [take], bitrate_mbps=0.3)
    assert inline(plan, tmp_path / "inline").done == on_ray(plan, tmp_path / "ray").done == 1
    streams = [tmp_path / name / "takes" / "a" / "take.isv" for name in ("inline", "ray")]
    assert streams[0].read_bytes() == streams[1].read_bytes()
    assert isv.verify(streams[0])[0] == 12
