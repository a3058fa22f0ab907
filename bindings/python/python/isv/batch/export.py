"""Jobs for farms with a scheduler of their own: the same shards, by their numbers in the plan."""

from __future__ import annotations

import json
import os
import shlex
import stat
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any

from .driver import Choices, count_tasks
from .plan import Plan

__all__ = ["openjd", "slurm_array"]

_MOST = 1000
"""Tasks of an array: Slurm takes 1001 and OpenJD 1024, unless they are set up otherwise."""


def _stages(plan: Plan) -> list[tuple[str, int]]:
    """The stages of a plan, with their numbers of tasks.

    Raises:
        ValueError: There is nothing to encode.
    """
    shards, takes, has_rate = count_tasks(plan)
    if not takes:
        raise ValueError(f"{plan.path}: there is no take to encode")
    return [*([("measure", shards)] if has_rate else []), ("encode", shards), ("finish", takes)]


def _words(plan: Plan, output: str, stage: str, choices: Choices, scratch: str | None) -> list[str]:
    """The command that runs tasks of a stage, without their numbers."""
    words = [
        sys.executable,
        "-m",
        "isv.batch",
        "task",
        os.path.abspath(plan.path),
        "--output",
        output,
        "--stage",
        stage,
    ]
    usual = asdict(Choices())
    for name, value in asdict(choices).items():
        if value != usual[name]:
            flag = "--" + name.replace("_", "-")
            words += [flag] if value is True else [flag, f"{value}m" if name == "spacing" else str(value)]
    return words + (["--scratch", scratch] if scratch else [])


def slurm_array(
    plan: Plan, output: str, folder: Path, choices: Choices, *, threads: int = 1, scratch: str | None = None
) -> list[Path]:
    """Write job arrays of Slurm, and a script that submits them one after the other.

    Options of ``sbatch``, such as ``--partition``, are given to the script.

    Returns:
        The files: a script for each stage, and ``submit.sh``.
    """
    folder.mkdir(parents=True, exist_ok=True)
    lines = ["#!/bin/sh", "# Submits the stages. Options of sbatch may be given, such as --partition=long.", "set -eu"]
    lines += ['cd "$(dirname "$0")"', "mkdir -p logs"]
    files, after = [], ""
    for stage, tasks in _stages(plan):
        each = -(-tasks // _MOST)
        array = -(-tasks // each)
        words = shlex.join(_words(plan, output, stage, choices, scratch))
        script = "\n".join(
            [
                "#!/bin/sh",
                f"#SBATCH --job-name=isv-{stage}",
                f"#SBATCH --array=0-{array - 1}",
                f"#SBATCH --cpus-per-task={threads}",
                f"#SBATCH --output=logs/{stage}-%a.log",
                f"exec {words} --threads {threads} --first $((SLURM_ARRAY_TASK_ID * {each})) --count {each}",
                "",
            ]
        )
        files.append(_executable(folder / f"{stage}.sbatch", script))
        # Stages begin whatever became of single tasks: a take whose shards are not there says so.
        lines.append(f'{stage}=$(sbatch --parsable {after}"$@" {stage}.sbatch)')
        after = f'--dependency=afterany:"${stage}" '
    report = [sys.executable, "-m", "isv.batch", "report", os.path.abspath(plan.path), "--output", output]
    text = f"#!/bin/sh\n#SBATCH --job-name=isv-report\n#SBATCH --output=logs/report.log\nexec {shlex.join(report)}\n"
    files.append(_executable(folder / "report.sbatch", text))
    lines.append(f'sbatch --parsable {after}"$@" report.sbatch')
    files.append(_executable(folder / "submit.sh", "\n".join([*lines, ""])))
    return files


def _executable(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    path.chmod(path.stat().st_mode | stat.S_IXUSR | stat.S_IXGRP | stat.S_IXOTH)
    return path


def openjd(
    plan: Plan, output: str, path: Path, choices: Choices, *, threads: int = 1, scratch: str | None = None
) -> Path:
    """Write a job template of OpenJD (2023-09), as AWS Deadline Cloud takes it.

    Returns:
        The template.
    """
    steps: list[dict[str, Any]] = []
    for stage, tasks in _stages(plan):
        each = -(-tasks // _MOST)
        words = _words(plan, output, stage, choices, scratch)
        words += ["--threads", str(threads), "--first", "{{Task.Param.First}}", "--count", str(each)]
        last = (-(-tasks // each) - 1) * each
        step: dict[str, Any] = {
            "name": stage.capitalize(),
            "parameterSpace": {
                "taskParameterDefinitions": [{"name": "First", "type": "INT", "range": f"0-{last}:{each}"}]
            },
            "hostRequirements": {"amounts": [{"name": "amount.worker.vcpu", "min": threads}]},
            "script": {"actions": {"onRun": {"command": words[0], "args": words[1:]}}},
        }
        if steps:
            step["dependencies"] = [{"dependsOn": steps[-1]["name"]}]
        steps.append(step)
    report = ["-m", "isv.batch", "report", os.path.abspath(plan.path), "--output", output]
    steps.append(
        {
            "name": "Report",
            "dependencies": [{"dependsOn": "Finish"}],
            "script": {"actions": {"onRun": {"command": sys.executable, "args": report}}},
        }
    )
    template = {"specificationVersion": "jobtemplate-2023-09", "name": "isv-batch", "steps": steps}
    path.write_text(json.dumps(template, indent=2) + "\n", encoding="utf-8")
    return path
