"""Takes in other processes, and jobs that are interrupted."""

from __future__ import annotations

import io
import multiprocessing
import os
import pickle
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import isv
import numpy as np
import pytest

from conftest import VOXEL, box, boxes


def test_takes_are_pickled_with_their_options(stream: Path) -> None:
    for source in (stream, stream.read_bytes()):
        with isv.open(source, lod=2) as take:
            copy = pickle.loads(pickle.dumps(take))
            assert (copy[7].mesh().vertices == take[7].mesh().vertices).all()
            assert len(copy) == 12
        assert not copy.closed and pickle.loads(pickle.dumps(take)).closed
    with stream.open("rb") as file, isv.open(file) as take, pytest.raises(TypeError, match="cannot be pickled"):
        pickle.dumps(take)


def test_errors_are_pickled_with_their_kind(stream: Path) -> None:
    with pytest.raises(isv.IsvError) as failure:
        list(isv.open(stream.read_bytes()[:60] + b"x" * 200))
    copy = pickle.loads(pickle.dumps(failure.value))
    assert (type(copy), str(copy), copy.kind) == (isv.IsvError, str(failure.value), failure.value.kind)


def test_arrays_of_frames_are_pickled(stream: Path) -> None:
    with isv.open(stream) as take:
        mesh, volume = take[0].mesh(), take[0].volume()
    assert (pickle.loads(pickle.dumps(mesh)).vertices == mesh.vertices).all()
    assert (pickle.loads(pickle.dumps(volume)).coords == volume.coords).all()


def sum_of(take: isv.Take, number: int) -> float:
    return float(take[number].mesh().vertices.sum())


def run_script(text: str, *arguments: object, timeout: float = 120) -> str:
    """Run a program of its own, which forks before pytest's threads are there. It hangs where a pool is not."""
    words = [sys.executable, "-W", "ignore", "-c", textwrap.dedent(text), *map(str, arguments)]
    done = subprocess.run(words, capture_output=True, text=True, timeout=timeout, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


WORKERS = """
    import multiprocessing, sys
    import isv

    take, numbers = isv.open(sys.argv[2]), [11, 2, 7, 3, 4, 9, 0, 5]

    def number_of(number):
        return float(take[number].mesh(normals=True).vertices.sum())

    def begin(handle):
        global take
        take = handle

    if __name__ == "__main__":
        expected = [number_of(number) for number in numbers]
        context = multiprocessing.get_context(sys.argv[1])
        with context.Pool(3, begin, (take,)) as pool:
            assert pool.map(number_of, numbers, chunksize=1) == expected
        # The parent goes on.
        assert [number_of(number) for number in numbers] == expected
        print("sound")
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system has no fork")
def test_workers_that_were_forked_decode_what_their_parent_does(stream: Path) -> None:
    assert run_script(WORKERS, "fork", stream) == "sound\n"


def test_workers_that_were_spawned_decode_what_their_parent_does(stream: Path) -> None:
    context = multiprocessing.get_context("spawn")
    with isv.open(stream) as take:
        expected = [sum_of(take, number) for number in (11, 2, 7)]
        with context.Pool(2) as pool:
            assert pool.starmap(sum_of, [(take, number) for number in (11, 2, 7)]) == expected


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system has no fork")
def test_all_jobs_run_in_a_process_that_was_forked_and_in_its_child(stream: Path, tmp_path: Path) -> None:
    text = """
        import io, os, sys
        from pathlib import Path
        import isv

        stream, folder = Path(sys.argv[1]), Path(sys.argv[2])

        def jobs(name):
            with isv.open(stream) as take:
                volume = take[3].volume()
                meshes = [frame.mesh() for frame in take]
            file = io.BytesIO()
            isv.encode(meshes[:3], file, voxel=0.02)
            isv.encode(stream, folder / f"{name}.isv", frames=slice(0, 3))
            isv.repair(stream, folder / f"{name}-repaired.isv")
            figures = isv.evaluate(stream, folder / f"{name}.isv", frames=slice(0, 3))
            return file.getvalue(), (folder / f"{name}.isv").read_bytes(), figures, volume.distances.tobytes()

        def forked(work):
            child = os.fork()
            if child == 0:
                try:
                    work()
                    os._exit(0)
                except BaseException as error:
                    print(repr(error), file=sys.stderr, flush=True)
                    os._exit(1)
            assert os.waitpid(child, 0)[1] == 0

        expected = jobs("parent")

        def grandchild():
            assert jobs("grandchild") == expected

        def child():
            assert jobs("child") == expected
            isv.set_threads(2)
            assert jobs("two") == expected
            forked(grandchild)

        forked(child)
        assert jobs("again") == expected
        print("sound")
    """
    assert run_script(text, stream, tmp_path) == "sound\n"


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system has no fork")
def test_a_child_of_a_parent_that_is_decoding_does_not_wait_for_it(stream: Path) -> None:
    text = """
        import os, sys, threading
        import isv

        take, go_on = isv.open(sys.argv[1]), True

        def decode():
            while go_on:
                for frame in take:
                    frame.mesh()

        threads = [threading.Thread(target=decode) for _ in range(3)]
        for thread in threads:
            thread.start()
        for _ in range(10):
            child = os.fork()
            if child == 0:
                ok = len(take[7].mesh().faces) > 100 and len([frame.points(50) for frame in take]) == 12
                os._exit(0 if ok else 1)
            assert os.waitpid(child, 0)[1] == 0
        go_on = False
        for thread in threads:
            thread.join()
        print("sound")
    """
    assert run_script(text, stream) == "sound\n"


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system has no fork")
def test_an_open_file_is_not_shared_with_a_child(stream: Path) -> None:
    text = """
        import os, sys
        import isv

        file = open(sys.argv[1], "rb")
        take = isv.open(file)
        child = os.fork()
        if child == 0:
            try:
                take[0]
            except TypeError as error:
                assert "forked process" in str(error)
                os._exit(0)
            os._exit(1)
        assert os.waitpid(child, 0)[1] == 0
        print(len(take[0].mesh().faces) > 0)
    """
    assert run_script(text, stream) == "True\n"


def test_what_a_callback_raises_ends_the_job(tmp_path: Path, stream: Path) -> None:
    def stop(done: int, total: int | None) -> None:
        if done == 2:
            raise ZeroDivisionError

    for source in (boxes(4), iter(boxes(4)), stream):
        with pytest.raises(ZeroDivisionError):
            isv.encode(source, tmp_path / "out.isv", voxel=VOXEL, progress=stop)
    with pytest.raises(ZeroDivisionError):
        isv.evaluate(stream, stream, progress=stop)
    assert list(tmp_path.iterdir()) == []


INTERRUPTED = """
    import signal
    import sys
    import isv

    # Jobs in the background of a shell are begun with this signal ignored.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    print("ready", flush=True)
    try:
        {job}
    except KeyboardInterrupt:
        print("interrupted", flush=True)
"""

JOBS = {
    "a path": 'isv.encode(sys.argv[1], sys.argv[2], voxel=0.002, preset="archive")',
    "an iterable": "isv.encode((mesh for mesh in iter(lambda: isv.open(sys.argv[1])[0].mesh(), None)), sys.argv[2])",
    "an evaluation": "isv.evaluate(sys.argv[1], sys.argv[1], spacing=0.002)",
    "frames": "[frame.mesh() for _ in range(10**9) for frame in isv.open(sys.argv[1])]",
    "a live stream": "import socket; pair = socket.socketpair(); list(isv.open(pair[1]))",
}


@pytest.mark.skipif(sys.platform == "win32", reason="signals are those of Unix")
@pytest.mark.parametrize("job", JOBS)
def test_an_interrupt_ends_a_job_soon_and_leaves_nothing(job: str, stream: Path, tmp_path: Path) -> None:
    text = textwrap.dedent(INTERRUPTED).format(job=JOBS[job])
    words = [sys.executable, "-c", text, str(stream), str(tmp_path / "out.isv")]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        time.sleep(0.7)
        assert process.poll() is None, "the job was over too soon to be interrupted"
        process.send_signal(signal.SIGINT)
        begin = time.monotonic()
        assert process.stdout.readline() == "interrupted\n"
        assert time.monotonic() - begin < 10
    assert process.returncode == 0
    assert list(tmp_path.iterdir()) == []


def test_other_threads_run_while_the_codec_works(stream: Path) -> None:
    """The interpreter would stand still for the whole time of a job that kept its lock."""
    import threading

    beats, go_on = [time.monotonic()], True

    def beat() -> None:
        while go_on:
            time.sleep(0.002)
            beats.append(time.monotonic())

    x, y = np.meshgrid(np.linspace(0, 1, 700), np.linspace(0, 1, 700))
    vertices = np.stack([x, y, 0.02 * np.sin(40 * x) * np.sin(40 * y)], axis=-1).reshape(-1, 3)
    corner = (np.arange(699)[:, None] * 700 + np.arange(699)).ravel()
    faces = np.concatenate(
        [np.stack([corner, corner + 1, corner + 700], 1), np.stack([corner + 1, corner + 701, corner + 700], 1)]
    )
    file = io.BytesIO()
    thread = threading.Thread(target=beat)
    with isv.Writer(file, voxel=0.003) as writer:
        thread.start()
        begin = time.monotonic()
        writer.push((vertices, faces))
        took = time.monotonic() - begin
        go_on = False
    thread.join()
    longest = np.diff([beat for beat in beats if beat >= begin - 0.01]).max(initial=0)
    assert len(beats) > 10 and longest < max(0.5 * took, 0.2), f"{longest:.3f} s of {took:.3f} s without a beat"


def test_a_box_is_encoded_in_a_worker_that_was_spawned() -> None:
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        assert pool.apply(encode_a_box) == encode_a_box()


def encode_a_box() -> bytes:
    file = io.BytesIO()
    isv.encode([box()], file, voxel=VOXEL)
    return file.getvalue()
