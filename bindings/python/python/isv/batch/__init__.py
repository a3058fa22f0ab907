"""Batch encoding: many takes to streams, in shards, by an engine such as Ray.

The command ``isv-batch`` plans takes, runs the plan and reports on it. A shard is a run of whole groups of pictures of
a take, which one worker encodes. The joined shards of a take are the bytes that one encoder would have written.

Modules: ``plan`` decides once what holds for all shards of a take, ``tasks`` is what workers do, ``driver`` hands tasks
to an engine (``engines``, ``ray_engine``), ``report`` writes a table and a page, ``export`` writes jobs for other
schedulers.
"""

from .driver import Choices, Summary, run
from .engines import Engine, InlineEngine, LocalEngine
from .plan import Plan, plan_takes, write_plan
from .storage import Store

__all__ = [
    "Choices",
    "Engine",
    "InlineEngine",
    "LocalEngine",
    "Plan",
    "Store",
    "Summary",
    "plan_takes",
    "run",
    "write_plan",
]
