"""Ray as an engine: a laptop, Slurm, Kubernetes or a cloud, whatever its cluster runs on."""

from __future__ import annotations

from types import TracebackType
from typing import Any

from .tasks import run_task

__all__ = ["RayEngine"]

Task = dict[str, Any]

_AHEAD = 8
"""Tasks that Ray is given beyond the processors of its cluster: workers do not wait for the driver, and a cluster that
can grow does."""


class RayEngine:
    """Runs tasks on a cluster of Ray.

    Ray itself runs a task again whose worker or node was lost. Each task has so many processors, and as many threads.
    """

    def __init__(self, address: str | None = None, *, threads: int = 1, retries: int = 2) -> None:
        """Connect to a cluster, or start one on this machine.

        Args:
            address: Address of the cluster, "auto" for the one that this machine is part of [default: a new one].
            threads: Threads of a task.
            retries: How often a task is run again whose worker or node was lost.

        Raises:
            ImportError: Ray is not installed.
            ConnectionError: The cluster cannot be reached.
        """
        import ray

        self._ray = ray
        self._owns = not ray.is_initialized()
        if self._owns:
            alone: dict[str, Any] = {"include_dashboard": False} if address is None else {}
            ray.init(address=address or "local", log_to_driver=False, logging_level="warning", **alone)
        self._threads = threads
        self._options = {"num_cpus": threads, "max_retries": retries, "retry_exceptions": False}
        self._remote = ray.remote(run_task)
        self._running: dict[Any, Task] = {}

    def __enter__(self) -> RayEngine:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _slots(self) -> int:
        return int(self._ray.cluster_resources().get("CPU", 0) // self._threads)

    def has_room(self) -> bool:
        """Whether another task may be submitted."""
        return len(self._running) < self._slots() + _AHEAD

    def submit(self, task: Task) -> None:
        """Take a task."""
        name = f"isv-batch {task['task']} {task.get('take', task)['name']}"
        reference = self._remote.options(name=name, **self._options).remote({**task, "threads": self._threads})
        self._running[reference] = task

    def done(self) -> list[tuple[Task, Task]]:
        """Wait for at least one task to end."""
        if not self._running:
            return []
        ready, _ = self._ray.wait(list(self._running), num_returns=1)
        more, _ = self._ray.wait(list(self._running), num_returns=len(self._running), timeout=0)
        return [(self._running.pop(reference), self._result(reference)) for reference in {*ready, *more}]

    def _result(self, reference: Any) -> Task:
        try:
            result: Task = self._ray.get(reference)
        except self._ray.exceptions.RayError as error:
            first = str(error).strip().splitlines()[0] if str(error).strip() else type(error).__name__
            return {"ok": False, "error": f"Ray gave the task up: {first}", "retry": False}
        return result

    def close(self) -> None:
        """Give up what still runs, and leave the cluster."""
        for reference in self._running:
            self._ray.cancel(reference, force=True)
        self._running.clear()
        if self._owns:
            self._ray.shutdown()
