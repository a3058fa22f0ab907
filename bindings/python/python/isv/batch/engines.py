"""Engines: what runs tasks. Each holds a bounded number of them, whatever the length of the plan."""

from __future__ import annotations

import multiprocessing
import os
from collections import deque
from collections.abc import Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from types import TracebackType
from typing import Any, Protocol

from .tasks import run_task

__all__ = ["Engine", "InlineEngine", "LocalEngine", "ordered"]

Task = dict[str, Any]


class Engine(Protocol):
    """A way to run tasks, on this machine or on many."""

    def has_room(self) -> bool:
        """Whether another task may be submitted."""

    def submit(self, task: Task) -> None:
        """Take a task."""

    def done(self) -> list[tuple[Task, Task]]:
        """Wait for at least one task to end. Returns such tasks with their results; nothing if there are no tasks."""

    def close(self) -> None:
        """Give up what still runs."""

    def __enter__(self) -> Engine: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...


class _Closing:
    """The part of engines that closes them at the end of a ``with`` block."""

    def close(self) -> None:
        """Give up what still runs."""

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


class InlineEngine(_Closing):
    """Runs each task in this process, one after the other."""

    def __init__(self) -> None:
        self._waiting: deque[Task] = deque()

    def __enter__(self) -> InlineEngine:
        return self

    def has_room(self) -> bool:
        """Whether another task may be submitted."""
        return not self._waiting

    def submit(self, task: Task) -> None:
        """Take a task."""
        self._waiting.append(task)

    def done(self) -> list[tuple[Task, Task]]:
        """Run the next task."""
        if not self._waiting:
            return []
        task = self._waiting.popleft()
        return [(task, run_task(task))]


class LocalEngine(_Closing):
    """Runs tasks in processes of this machine.

    A process that dies takes the others of its pool with it. Their tasks are run again: one at a time, so that the task
    that kills processes is found.
    """

    def __init__(self, workers: int | None = None, *, threads: int = 1, retries: int = 2) -> None:
        """Make an engine.

        Args:
            workers: Number of processes [default: one for each ``threads`` processors].
            threads: Threads of each.
            retries: How often a task whose process died is run again.
        """
        processors = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
        self._workers = workers or max(1, processors // threads)
        self._threads, self._retries = threads, retries
        self._pool: ProcessPoolExecutor | None = None
        self._running: dict[Future[Task], Task] = {}
        self._is_alone = False
        self._suspects: deque[Task] = deque()
        self._deaths: dict[int, int] = {}

    def __enter__(self) -> LocalEngine:
        return self

    def has_room(self) -> bool:
        """Whether another task may be submitted."""
        return len(self._running) < 2 * self._workers and not self._suspects and not self._is_alone

    def submit(self, task: Task) -> None:
        """Take a task."""
        if self._pool is None:
            # Processes are not forked: threads of the codec would be missing in them.
            context = multiprocessing.get_context("spawn")
            self._pool = ProcessPoolExecutor(self._workers, mp_context=context)
        try:
            future = self._pool.submit(run_task, {**task, "threads": self._threads})
        except BrokenProcessPool:
            self._suspects.append(task)
            self._renew()
            return
        self._running[future] = task

    def done(self) -> list[tuple[Task, Task]]:
        """Wait for at least one task to end."""
        while self._running or self._suspects:
            if not self._running:
                self._is_alone = True
                self.submit(self._suspects.popleft())
                continue
            finished, _ = wait(self._running, return_when=FIRST_COMPLETED)
            ended = [end for future in finished if (end := self._end(future)) is not None]
            if not self._running:
                self._is_alone = False
            if ended:
                return ended
        return []

    def _end(self, future: Future[Task]) -> tuple[Task, Task] | None:
        task = self._running.pop(future)
        try:
            result = future.result()
        except BrokenProcessPool:
            self._renew()
            deaths = self._deaths.get(id(task), 0) + self._is_alone
            if deaths > self._retries:
                self._deaths.pop(id(task), None)
                return task, {"ok": False, "error": f"its process died {deaths} times", "retry": False}
            self._deaths[id(task)] = deaths
            self._suspects.append(task)
            return None
        self._deaths.pop(id(task), None)
        return task, result

    def _renew(self) -> None:
        if self._pool is not None:
            self._pool.shutdown(wait=False, cancel_futures=True)
            self._pool = None

    def close(self) -> None:
        """Give up what still runs."""
        if self._pool is not None:
            processes = list((self._pool._processes or {}).values())
            self._pool.shutdown(wait=False, cancel_futures=True)
            for process in processes if self._running else []:
                process.terminate()
            self._pool = None
        self._running.clear()
        self._suspects.clear()


def ordered(engine: Engine, tasks: Iterable[Task], ahead: int = 256) -> Iterator[Task]:
    """Run tasks, and return their results in order. Each result holds its task as ``of``."""
    source = iter(tasks)
    results: dict[int, Task] = {}
    submitted = returned = 0
    more = True
    while True:
        while more and engine.has_room() and submitted - returned < ahead:
            task = next(source, None)
            if task is None:
                more = False
                break
            engine.submit({**task, "number": submitted})
            submitted += 1
        if returned == submitted:
            return
        if returned not in results:
            results.update((task["number"], {**result, "of": task}) for task, result in engine.done())
        while returned in results:
            yield results.pop(returned)
            returned += 1
