"""The driver: hands the tasks of a plan to an engine, take by take, and goes on where an earlier run stopped.

What is done is known by files in the output alone. The driver holds the takes that are under way and nothing of others.
"""

from __future__ import annotations

import contextlib
from collections import deque
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from typing import Any

from .engines import Engine
from .plan import Plan, key_of, shard_key
from .rate import Line, corrected, quality_for
from .storage import Store
from .tasks import settings_of, shard_name, take_folder, take_key

__all__ = ["Choices", "Summary", "TakeRun", "count_tasks", "note_failure", "run", "task_at"]

Task = dict[str, Any]

_ROUNDS = 2
"""Corrections of a take that missed its rate, at most."""


@dataclass(frozen=True)
class Choices:
    """What is made of the shards of a take.

    Attributes:
        sample: Frames that are measured, spread over the take.
        spacing: Edge of the square of surface that each sample of a measurement stands for (m) [default: a voxel].
        pictures: Frames that are drawn, those with the largest errors.
        picture_size: Edge of each drawing (pixels).
        package: Command that packages a stream, with ``{stream}``, ``{folder}``, ``{name}`` and ``{fps}``.
        discard_shards: Whether shards are removed once they are joined.
    """

    sample: int = 8
    spacing: float | None = None
    pictures: int = 3
    picture_size: int = 384
    package: str | None = None
    discard_shards: bool = False


@dataclass
class Summary:
    """What became of a plan.

    Attributes:
        done: Takes that were finished.
        reused: Takes that were there already.
        failed: Name and error of takes that failed; of more than a hundred the first.
        failures: Number of takes that failed.
        encoded: Shards that were encoded.
        kept: Shards that were there already. Those of takes that were there count too, unless shards are discarded.
    """

    done: int = 0
    reused: int = 0
    failed: list[tuple[str, str]] = field(default_factory=list)
    failures: int = 0
    encoded: int = 0
    kept: int = 0

    def fail(self, name: str, error: str) -> None:
        """Count a take that failed."""
        self.failures += 1
        if len(self.failed) < 100:
            self.failed.append((name, error))


class TakeRun:
    """A take on its way through its stages: statistics, if it has a rate to meet, then shards, then the finish."""

    def __init__(self, take: Task, output: Store, choices: Choices, scratch: str | None = None) -> None:
        """Begin with a take of a plan."""
        self.take = take
        self.errors: list[str] = []
        self._output, self._finish, self._scratch = output, asdict(choices), scratch
        self._quality: float | None = None
        self._lines: list[Line | None] = [None] * len(take["shards"])
        self._times_s: list[list[float]] = [[] for _ in take["shards"]]
        self._bytes = [0] * len(take["shards"])
        self._left = 0
        self._stage = ""
        self._rounds = 0

    @property
    def has_rate(self) -> bool:
        """Whether the take has a bit rate to meet."""
        return "bitrate_mbps" in self.take

    def key(self) -> str:
        """What the finished take is known by."""
        return take_key(self.take, settings_of({"take": self.take, "quality": self._quality}), self._finish)

    def begin(self) -> list[Task]:
        """The first tasks of the take, or none if it is there already."""
        if self.has_rate:
            known = self._output.read_json(f"{take_folder(self.take)}/rate.json")
            if known is not None and known.get("key") == self._rate_key() and "times_s" in known:
                self._quality = known["quality"]
                self._rounds = known["rounds"]
                self._lines = [Line(**line) for line in known["lines"]]
                self._times_s = known["times_s"]
        row = self._output.read_json(f"{take_folder(self.take)}/take.json")
        if row is not None and row.get("key") == self.key():
            return []
        if self.has_rate and self._quality is None:
            return self._stage_of("measure")
        return self._stage_of("encode")

    def task_of(self, stage: str, index: int) -> Task:
        """A task of a stage by its number, once the quality is known that statistics lead to."""
        if self.has_rate and stage != "measure":
            self._recall_statistics()
        return self._stage_of(stage)[index]

    def _recall_statistics(self) -> None:
        known = self._output.read_json(f"{take_folder(self.take)}/rate.json")
        if known is not None and known.get("key") == self._rate_key():
            self._quality = known["quality"]
            return
        lines = []
        for index, shard in enumerate(self.take["shards"]):
            name = f"{shard_name(self.take, shard)}.statistics.json"
            found = self._output.read_json(name)
            if found is None or "times_s" not in found:
                raise ValueError(f"{name}: the statistics of the shard are not there; run the stage measure first")
            lines.append(Line(**found["line"]))
            self._times_s[index] = found["times_s"]
        self._quality = quality_for(lines, self._target())

    def _rate_key(self) -> str:
        settings = self.take["settings"]
        shards = [shard_key(self.take, shard, settings) for shard in self.take["shards"]]
        return key_of(shards, self.take["bitrate_mbps"])

    def _stage_of(self, stage: str) -> list[Task]:
        self._stage = stage
        common = {"take": self._bare(), "output": self._output.url, "scratch": self._scratch, "quality": self._quality}
        if stage == "finish":
            tasks = [{**common, "take": self.take, "finish": self._finish}]
        else:
            tasks = [{**common, "shard": shard, "index": index} for index, shard in enumerate(self.take["shards"])]
        self._left = len(tasks)
        return [{**task, "task": stage, "tries": 0} for task in tasks]

    def _bare(self) -> Task:
        """The take without its shards: a task has one of them."""
        return {name: value for name, value in self.take.items() if name != "shards"}

    def end(self, task: Task, result: Task) -> list[Task] | None:
        """Take the result of a task. Returns the tasks that follow, or None if the take is at its end."""
        self._left -= 1
        if not result["ok"]:
            self.errors.append(result["error"])
        elif self._stage == "measure":
            self._lines[task["index"]] = Line(**result["line"])
            self._times_s[task["index"]] = result["times_s"]
        elif self._stage == "encode":
            self._bytes[task["index"]] = result["figures"]["bytes"]
        if self._left:
            return []
        if self.errors or self._stage == "finish":
            return None
        if self._stage == "measure":
            self._quality = quality_for(self._known_lines(), self._target())
            self._keep_rate()
            return self._stage_of("encode")
        if self.has_rate and self._rounds < _ROUNDS:
            total = self._total()
            better = corrected(self._quality or 0.0, total, self._target(), self._known_lines())
            if better is not None:
                self._rounds += 1
                self._quality = better
                self._keep_rate()
                return self._stage_of("encode")
        return self._stage_of("finish")

    def _known_lines(self) -> list[Line]:
        return [line for line in self._lines if line is not None]

    def _seconds(self) -> float:
        """Time from the first frame to the end of the last one, pauses and all."""
        times_s = [time for shard in self._times_s for time in shard]
        return float(max(times_s) - min(times_s) + 1 / self.take["fps"])

    def _target(self) -> float:
        """Bytes that the rate has room for."""
        return float(self.take["bitrate_mbps"] * 1e6 / 8 * self._seconds())

    def _total(self) -> float:
        """Bytes of all shards: a little more than those of the stream, which has one header and one index."""
        return float(sum(self._bytes))

    def _keep_rate(self) -> None:
        """Write the quality down, and the budget of each shard: its bytes at that quality."""
        lines = self._known_lines()
        quality = self._quality or 0.0
        self._output.publish_json(
            {
                "key": self._rate_key(),
                "quality": quality,
                "rounds": self._rounds,
                "target_bytes": round(self._target()),
                "lines": [asdict(line) for line in lines],
                "times_s": self._times_s,
                "budgets": [round(line.bytes(quality)) for line in lines],
            },
            f"{take_folder(self.take)}/rate.json",
        )


def run(
    plan: Plan,
    output: Store,
    engine: Engine,
    choices: Choices | None = None,
    *,
    scratch: str | None = None,
    retries: int = 2,
    tell: Callable[[str, int], None] = lambda sentence, takes: None,
) -> Summary:
    """Run a plan: encode what is not there yet, and finish each take as soon as its shards are there.

    Args:
        plan: The plan.
        output: Folder of the streams.
        engine: What runs the tasks.
        choices: What is made of the shards.
        scratch: Folder for the files of tasks on the machines that run them [default: that of the system].
        retries: How often a task is tried again that failed for a reason that may pass.
        tell: Function that is called with a sentence for each take that ends, and the number of takes that have ended.

    Returns:
        What became of the takes. One that fails does not stop the others.
    """
    chosen = choices or Choices()
    summary = Summary()
    active: dict[str, TakeRun] = {}
    ready: deque[Task] = deque()
    takes = plan.takes()

    def ended(name: str, error: str | None) -> None:
        if error is not None:
            summary.fail(name, error)
        tell(f"{name}: {error or 'done'}", summary.done + summary.reused + summary.failures)

    def refill() -> None:
        """Begin takes until there is a task, or no take is left. Takes that are under way come first."""
        while not ready and (take := next(takes, None)) is not None:
            name = take["name"]
            if "error" in take:
                note_failure(output, take, take["error"])
                ended(name, take["error"])
                continue
            try:
                begun = TakeRun(take, output, chosen, scratch)
                tasks = begun.begin()
            except OSError as error:
                ended(name, f"{output.url}: {error}")
                continue
            if tasks:
                active[name] = begun
                ready.extend(tasks)
            else:
                summary.reused += 1
                summary.kept += 0 if chosen.discard_shards else len(take["shards"])
                output.remove(f"{take_folder(take)}/error.json")
                ended(name, None)

    while True:
        while engine.has_room():
            refill()
            if not ready:
                break
            engine.submit(ready.popleft())
        finished = engine.done()
        if not finished:
            return summary
        for task, result in finished:
            name = task["take"]["name"]
            if not result["ok"] and result["retry"] and task["tries"] < retries:
                ready.append({**task, "tries": task["tries"] + 1})
                continue
            if result["ok"] and task["task"] == "encode":
                summary.encoded += not result["reused"]
                summary.kept += result["reused"]
            under_way = active[name]
            try:
                following = under_way.end(task, result)
            except OSError as error:
                under_way.errors.append(f"{output.url}: {error}")
                following = None
            if following is None:
                del active[name]
                if under_way.errors:
                    why = "; ".join(sorted(set(under_way.errors))[:3])
                    note_failure(output, under_way.take, why)
                    ended(name, why)
                else:
                    summary.done += 1
                    ended(name, None)
            else:
                # What follows goes first, so that takes end and few are under way.
                ready.extendleft(reversed(following))


def note_failure(output: Store, take: Task, error: str) -> None:
    """Write down why a take failed, for the report. A full disk has no room for that either."""
    with contextlib.suppress(OSError):
        output.publish_json(
            {"status": "failed", "take": take["name"], "source": take["source"], "error": error},
            f"{take_folder(take)}/error.json",
        )


def task_at(plan: Plan, output: Store, stage: str, index: int, choices: Choices, scratch: str | None) -> Task | None:
    """A task by its number, for schedulers that hold no plan: shards and takes are counted in the order of the plan.

    Returns:
        The task; None if there is nothing to do, as statistics are for takes with a bit rate alone.

    Raises:
        ValueError: The plan has no such task, or statistics are missing.
    """
    number = 0
    for take in plan.takes():
        if "error" in take:
            continue
        count = 1 if stage == "finish" else len(take["shards"])
        if index < number + count:
            if stage == "measure" and "bitrate_mbps" not in take:
                return None
            return TakeRun(take, output, choices, scratch).task_of(stage, index - number)
        number += count
    raise ValueError(f"{plan.path}: task {index} of stage {stage} asked for, but there are {number}")


def count_tasks(plan: Plan) -> tuple[int, int, bool]:
    """The number of shards and of takes that can be encoded, and whether any take has a bit rate to meet."""
    shards = takes = 0
    has_rate = False
    for take in plan.takes():
        if "error" not in take:
            takes += 1
            shards += len(take["shards"])
            has_rate |= "bitrate_mbps" in take
    return shards, takes, has_rate
