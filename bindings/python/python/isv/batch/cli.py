"""The command ``isv-batch``."""

from __future__ import annotations

import argparse
import json
import os
import re
import sys
from collections.abc import Callable, Iterator, Sequence
from itertools import chain
from pathlib import Path
from typing import Any

from .driver import Choices, Summary, note_failure, run, task_at
from .engines import Engine, LocalEngine, ordered
from .export import openjd, slurm_array
from .plan import Plan, plan_takes, shard_length, write_plan
from .report import status, write_report
from .sources import find_takes
from .storage import Store
from .tasks import run_task, take_folder

__all__ = ["main"]

_METRES = {"m": 1.0, "dm": 0.1, "cm": 0.01, "mm": 0.001, "um": 1e-6, "in": 0.0254, "ft": 0.3048}


class _Wrong(Exception):
    """A command line that cannot be run: exit status 2."""


def _length(text: str) -> float:
    """A length with its unit, in metres."""
    match = re.fullmatch(r"([0-9.eE+-]+?)\s*(um|mm|cm|dm|m|in|ft)", text.strip())
    try:
        return float(match[1]) * _METRES[match[2]]  # type: ignore[index]
    except (TypeError, ValueError):
        raise argparse.ArgumentTypeError(f"{text!r}: a length has a unit, such as 5mm or 0.02m") from None


def _voxel(text: str) -> float | str:
    return "auto" if text == "auto" else _length(text)


def _rate(text: str) -> float:
    """A bit rate, in millions of bits a second."""
    match = re.fullmatch(r"([0-9.]+)\s*([kMG]?)", text.strip())
    try:
        return float(match[1]) * {"": 1e-6, "k": 1e-3, "M": 1.0, "G": 1e3}[match[2]]  # type: ignore[index]
    except (TypeError, ValueError):
        raise argparse.ArgumentTypeError(f"{text!r}: a rate is bits a second, such as 800k or 2M") from None


def _fps(text: str) -> float:
    over, _, under = text.partition("/")
    try:
        return float(over) / float(under or 1)
    except (ValueError, ZeroDivisionError):
        raise argparse.ArgumentTypeError(f"{text!r}: a frame rate, such as 30, 29.97 or 30000/1001") from None


def _place(text: str) -> tuple[float, ...]:
    parts = text.split(",")
    try:
        place = tuple(float(part) for part in parts)
    except ValueError:
        place = ()
    if len(place) != 3:
        raise argparse.ArgumentTypeError(f"{text!r}: a place is X,Y,Z")
    return place


def _frames(text: str) -> tuple[int, int | None]:
    match = re.fullmatch(r"(\d*)\.\.(\d*)", text)
    if not match or text == "..":
        raise argparse.ArgumentTypeError(f"{text!r}: a range is A..B, from A up to but not including B")
    return int(match[1] or 0), int(match[2]) if match[2] else None


def _encoding(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``isv encode``, by the names that they have there."""
    units = ["m", "dm", "cm", "mm", "in", "ft", "us-ft"]
    group = parser.add_argument_group("Options of isv encode")

    def add(flag: str, name: str, **more: Any) -> None:
        group.add_argument(flag, dest=f"encode_{name}", default=None, **more)

    def switch(flag: str, name: str, value: object, words: str) -> None:
        group.add_argument(flag, dest=f"encode_{name}", default=None, action="store_const", const=value, help=words)

    add("--voxel", "voxel", type=_voxel, metavar="LENGTH|auto", help="edge of a voxel")
    add("--quality", "quality", type=float, metavar="0..100", help="quality of all frames [default: 50]")
    add("--bitrate", "bitrate_mbps", type=_rate, metavar="RATE", help="bits a second of each take, such as 2M")
    add("--max-error", "max_error", type=_length, metavar="LENGTH", help="RMS surface error of every frame")
    add("--fps", "fps", type=_fps, help="frames a second [default: the input's, else 30]")
    add("--gop", "gop", type=int, metavar="FRAMES", help="frames of a group of pictures [default: 30]")
    add("--frames", "frames", type=_frames, metavar="A..B", help="only these frames of each take")
    add("--animation", "animation", metavar="NAME", help="animation of glTF files, by name or number from 0")
    add("--preset", "preset", choices=["realtime", "balanced", "archive"], help="work to take on [default: balanced]")
    add("--refresh", "refresh", choices=["keyframes", "gradual"], help="gradual: a take is one shard")
    add("--profile", "profile", choices=["main", "paper"], help="set of the codec's tools [default: main]")
    add("--sign", "sign", choices=["auto", "closed", "offset", "sheet"], help="how inside is told from outside")
    add("--offset", "shell_offset", type=float, metavar="VOXELS", help="half the thickness of a shell")
    add("--units", "units", choices=units, help="unit of the input [default: m]")
    add("--up", "up", choices=["y", "z", "x", "-y", "-z", "-x"], help="axis that points up [default: y]")
    add("--origin", "origin", type=_place, metavar="X,Y,Z", help="place that becomes the origin, in the input's unit")
    add("--viewpoint", "viewpoint", type=_place, metavar="X,Y,Z", help="place that points were seen from")
    add(
        "--max-depth", "max_depth", type=_length, metavar="LENGTH", help="leave out what depth cameras saw farther away"
    )
    add("--max-blocks", "max_blocks", type=int, metavar="N", help="refuse frames that need more blocks")
    add("--timestamps", "timestamps", choices=["source", "rate"], help="what packets are stamped with")
    add("--colour-quality", "color_quality", type=float, metavar="0..100", help="quality of colour [default: 50]")
    switch("--no-colour", "color", False, "leave colour out")
    switch("--checksums", "checksums", True, "put a hash of every frame into the stream")
    switch("--skip-bad-frames", "skip_bad_frames", True, "leave out frames that cannot be used")
    switch("--drop-invalid-points", "drop_invalid_points", True, "leave out points that are not finite")
    group.add_argument("--band", choices=["surface", "full"], help="full: keep the whole band, by profile paper")
    group.add_argument("--normals", choices=["given", "estimate"], help="normals of points")
    group.add_argument("--fusion", choices=["per-frame", "accumulate"], help="accumulate: a take is one shard")


def _options(args: argparse.Namespace) -> dict[str, Any]:
    """The options of :func:`isv.encode` that were given."""
    given = {
        name.removeprefix("encode_"): value
        for name, value in vars(args).items()
        if name.startswith("encode_") and value is not None
    }
    flags = (
        ("full_band", args.band == "full"),
        ("estimate_normals", args.normals == "estimate"),
        ("accumulate_depth", args.fusion == "accumulate"),
    )
    given |= {name: True for name, asked in flags if asked}
    targets = [flag for flag in ("quality", "bitrate_mbps", "max_error") if flag in given]
    if len(targets) > 1:
        raise _Wrong("--quality, --bitrate and --max-error: only one of them can be met")
    if given.get("gop", 30) < 1:
        raise _Wrong("--gop: at least 1 frame")
    if "bitrate_mbps" in given and not given["bitrate_mbps"] > 0:
        raise _Wrong("--bitrate: a rate above 0")
    if "bitrate_mbps" in given and given.get("profile") == "paper":
        raise _Wrong("--bitrate: this is a setting of profile main, not of profile paper")
    return given


def _running(parser: argparse.ArgumentParser) -> None:
    """Add the choice of an engine."""
    group = parser.add_argument_group("Engine")
    group.add_argument("--engine", choices=["local", "ray"], default="local", help="what runs tasks [default: local]")
    group.add_argument("--address", help="address of a Ray cluster, or auto [default: Ray on this machine alone]")
    group.add_argument(
        "--workers", type=int, metavar="N", help="processes of the engine local [default: by processors]"
    )
    group.add_argument("--threads", type=int, default=1, metavar="N", help="processors of a task [default: 1]")
    group.add_argument("--retries", type=int, default=2, metavar="N", help="further tries of a lost task [default: 2]")


def _engine(args: argparse.Namespace) -> Engine:
    if args.threads < 1 or (args.workers is not None and args.workers < 1) or args.retries < 0:
        raise _Wrong("--threads and --workers are at least 1, --retries at least 0")
    if args.engine == "local":
        if args.address is not None:
            raise _Wrong("--address: this is for --engine ray")
        return LocalEngine(args.workers, threads=args.threads, retries=args.retries)
    if args.workers is not None:
        raise _Wrong("--workers: this is for --engine local; Ray has the processors of its cluster")
    try:
        from .ray_engine import RayEngine

        return RayEngine(args.address, threads=args.threads, retries=args.retries)
    except ImportError as error:
        raise _Wrong(f"--engine ray: {error}; install the package isv with its extra 'ray'") from None


def _finishing(parser: argparse.ArgumentParser) -> None:
    """Add what is made of finished takes."""
    usual = Choices()
    group = parser.add_argument_group("Finished takes")
    group.add_argument("--sample", type=int, default=usual.sample, metavar="N", help="frames to measure [default: 8]")
    group.add_argument("--spacing", type=_length, metavar="LENGTH", help="spacing of measurements [default: a voxel]")
    group.add_argument(
        "--pictures", type=int, default=usual.pictures, metavar="N", help="worst frames to draw [default: 3]"
    )
    group.add_argument("--picture-size", type=int, default=usual.picture_size, metavar="PIXELS", help="[default: 384]")
    group.add_argument(
        "--package",
        metavar="COMMAND",
        help="command for each stream, with {stream}, {folder}, {name} and {fps}; files in {folder} are kept",
    )
    group.add_argument("--discard-shards", action="store_true", help="remove shards once they are joined")
    group.add_argument("--scratch", metavar="DIR", help="folder for files of tasks [default: the system's]")


def _choices(args: argparse.Namespace) -> Choices:
    if args.sample < 0 or args.pictures < 0 or not 16 <= args.picture_size <= 4096:
        raise _Wrong("--sample and --pictures are at least 0, --picture-size is 16 to 4096")
    return Choices(args.sample, args.spacing, args.pictures, args.picture_size, args.package, args.discard_shards)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="isv-batch",
        description="Encode many takes in shards, on one machine or on many.",
        epilog="Exit status: 0 done, 1 a take failed, 2 the command line was wrong. Guide: docs/guide/src/archive.md",
    )
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")

    def command(name: str, words: str, job: Callable[[argparse.Namespace], int]) -> argparse.ArgumentParser:
        made = commands.add_parser(name, help=words, description=words)
        made.set_defaults(job=job)
        return made

    plan = command("plan", "Decide once for each take what must not differ between its shards.", _plan)
    plan.add_argument(
        "takes", nargs="*", metavar="TAKES", help="takes, or folders of takes; also URLs such as s3://..."
    )
    plan.add_argument("--list", metavar="FILE", help="more takes: a path a line")
    plan.add_argument("-o", "--output", required=True, metavar="plan.json", help="plan to write")
    plan.add_argument("--shard-frames", type=int, metavar="N", help="frames of a shard [default: about 300]")
    _encoding(plan)
    _running(plan)

    begin = command("run", "Encode, join, check and measure the takes of a plan.", _run)
    begin.add_argument("plan", metavar="plan.json")
    begin.add_argument("--output", required=True, metavar="DIR", help="folder or URL for the streams")
    begin.add_argument("--table", default="takes.csv", metavar="NAME", help="takes.csv or takes.parquet")
    _finishing(begin)
    _running(begin)

    for name, words, job in (
        ("status", "Say how far a plan is.", _status),
        ("report", "Write the table of takes and the page of the worst ones.", _report),
    ):
        made = command(name, words, job)
        made.add_argument("plan", metavar="plan.json")
        made.add_argument("--output", metavar="DIR", help="folder of the streams [default: that of the last run]")
        if name == "status":
            made.add_argument("--json", action="store_true", help="print JSON")
        else:
            made.add_argument("--table", default="takes.csv", metavar="NAME", help="takes.csv or takes.parquet")
            made.add_argument("--page", type=int, default=100, metavar="N", help="takes on the page [default: 100]")

    made = command("export", "Write jobs for Slurm or OpenJD around the same shards.", _export)
    made.add_argument("plan", metavar="plan.json")
    made.add_argument("--output", required=True, metavar="DIR", help="folder or URL for the streams")
    kinds = made.add_mutually_exclusive_group(required=True)
    kinds.add_argument("--slurm-array", metavar="FOLDER", help="folder to write job arrays and submit.sh to")
    kinds.add_argument("--openjd", metavar="FILE.json", help="job template to write")
    made.add_argument("--threads", type=int, default=1, metavar="N", help="processors of a task [default: 1]")
    _finishing(made)

    made = command("task", "Run tasks of a plan by their numbers, as exported jobs do.", _task)
    made.add_argument("plan", metavar="plan.json")
    made.add_argument("--output", required=True, metavar="DIR", help="folder or URL for the streams")
    made.add_argument("--stage", required=True, choices=["measure", "encode", "finish"])
    made.add_argument("--first", required=True, type=int, metavar="N", help="number of the first task, from 0 on")
    made.add_argument("--count", type=int, default=1, metavar="N", help="tasks to run, as far as there are any")
    made.add_argument("--threads", type=int, default=1, metavar="N", help="threads [default: 1]")
    _finishing(made)
    return parser


_SIGNED = ("--up", "--origin", "--viewpoint")
"""Options whose values may begin with a minus sign."""


def _joined(words: Sequence[str]) -> list[str]:
    """Join options and values that begin with a minus sign: argparse takes ``--up=-y``, but not ``--up -y``."""
    joined: list[str] = []
    for number, word in enumerate(words):
        if word == "--":
            return [*joined, *words[number:]]
        last = joined[-1] if joined else ""
        # Options may be shortened, as `--view`.
        is_signed = len(last) > 2 and any(option.startswith(last) for option in _SIGNED)
        if is_signed and re.match(r"-([xyz]$|\.?[0-9])", word):
            joined[-1] = f"{last}={word}"
        else:
            joined.append(word)
    return joined


def main(words: Sequence[str] | None = None) -> int:
    """Run the command line. Returns the exit status."""
    args = _parser().parse_args(_joined(sys.argv[1:] if words is None else words))
    try:
        status_code: int = args.job(args)
        return status_code
    except _Wrong as error:
        print(f"isv-batch: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("isv-batch: interrupted; the same command goes on where it stopped", file=sys.stderr)
        return 130
    except (OSError, ValueError, ImportError) as error:
        print(f"isv-batch: {' '.join(str(error).split())}", file=sys.stderr)
        return 1


def _plan(args: argparse.Namespace) -> int:
    options = _options(args)
    try:
        frames = shard_length(options.get("gop", 30), args.shard_frames)
    except ValueError as error:
        raise _Wrong(str(error)) from None
    named = [*args.takes]
    if args.list is not None:
        lines = Path(args.list).read_text(encoding="utf-8").splitlines()
        named += [line.strip() for line in lines if line.strip() and not line.startswith("#")]
    if not named:
        raise _Wrong("name takes, or a file of them with --list")

    def found() -> Iterator[tuple[str, str]]:
        names: set[str] = set()

        def unique(name: str) -> str:
            number, free = 2, name
            while free in names:
                free, number = f"{name}-{number}", number + 1
            names.add(free)
            return free

        for path in named:
            takes = find_takes(path)
            first = next(takes)
            second = next(takes, None)
            # Takes of a folder begin with its name where there are several. A name that is taken gets a number.
            if second is None:
                yield unique(first[0]), first[1]
                continue
            prefix = "" if len(named) == 1 else unique(os.path.basename(os.path.abspath(path))) + "-"
            for name, source in chain([first, second], takes):
                yield unique(f"{prefix}{name}"), source

    def told() -> Iterator[dict[str, Any]]:
        for take in plan_takes(found(), options, frames, lambda tasks: ordered(engine, tasks)):
            if "error" in take:
                print(f"isv-batch: {take['name']}: {take['error']}", file=sys.stderr)
            yield take

    with _engine(args) as engine:
        counts = write_plan(args.output, {"options": options, "shard_frames": frames}, told())
    print(
        f"{args.output}: {counts['takes']} takes, {counts['frames']} frames in {counts['shards']} shards"
        + (f"; {counts['failed']} takes cannot be encoded" if counts["failed"] else "")
    )
    return 1 if counts["failed"] else 0


def _run(args: argparse.Namespace) -> int:
    plan, output, choices = Plan.open(args.plan), Store(args.output), _choices(args)
    _check_table(args.table)
    _remember(args.plan, output)
    is_shown = sys.stderr.isatty()

    def tell(sentence: str, ended: int) -> None:
        if is_shown:
            print(f"\r\x1b[K{ended} takes: {sentence}"[:120], end="", file=sys.stderr, flush=True)

    with _engine(args) as engine:
        summary = run(plan, output, engine, choices, scratch=args.scratch, retries=args.retries, tell=tell)
    if is_shown:
        print("\r\x1b[K", end="", file=sys.stderr)
    write_report(plan, output, args.table)
    return _told(summary, output)


def _check_table(table: str) -> None:
    """Refuse a table that could not be written before anything is encoded."""
    if not table.endswith((".csv", ".parquet")):
        raise _Wrong(f"--table {table}: a name that ends in .csv or .parquet")
    if table.endswith(".parquet"):
        try:
            import pyarrow.parquet  # noqa: F401
        except ImportError as error:
            raise _Wrong(f"--table {table}: {error}; pip install pyarrow, or take takes.csv") from None


def _told(summary: Summary, output: Store) -> int:
    for name, error in summary.failed:
        print(f"isv-batch: {name}: {error}", file=sys.stderr)
    if summary.failures > len(summary.failed):
        print(f"isv-batch: and {summary.failures - len(summary.failed)} more takes failed", file=sys.stderr)
    print(
        f"{output.url}: {summary.done} takes done, {summary.reused} were there, {summary.failures} failed; "
        f"{summary.encoded} shards encoded, {summary.kept} were there"
    )
    return 1 if summary.failures else 0


def _remembered(plan: str) -> str:
    """Name of the file beside a plan that says where it was last run to."""
    return f"{os.path.splitext(plan)[0]}.run.json"


def _remember(plan: str, output: Store) -> None:
    try:
        Path(_remembered(plan)).write_text(json.dumps({"output": output.url}) + "\n", encoding="utf-8")
    except OSError as error:
        print(f"isv-batch: {error}: status and report need --output", file=sys.stderr)


def _output(args: argparse.Namespace) -> Store:
    if args.output is not None:
        return Store(args.output)
    try:
        return Store(json.loads(Path(_remembered(args.plan)).read_text(encoding="utf-8"))["output"])
    except (OSError, ValueError, KeyError):
        raise _Wrong(f"{args.plan} has not been run from here: name the folder of the streams with --output") from None


def _status(args: argparse.Namespace) -> int:
    plan = Plan.open(args.plan)
    output = _output(args)
    found = status(plan, output)
    if args.json:
        print(json.dumps({**vars(found), "waiting": found.waiting, "output": output.url}))
        return 0
    print(f"{output.url}: {found.done} of {found.takes} takes done, {found.failed} failed, {found.waiting} waiting")
    if found.shards_done:
        print(f"{found.shards_done} shards of takes that are not done are encoded")
    return 0


def _report(args: argparse.Namespace) -> int:
    plan = Plan.open(args.plan)
    _check_table(args.table)
    if args.page < 0:
        raise _Wrong("--page: at least 0 takes")
    output = _output(args)
    counts = write_report(plan, output, args.table, args.page)
    told = ", ".join(f"{count} {name}" for name, count in sorted(counts.items()))
    print(f"{output.url}/{args.table} and {output.url}/index.html: {told or 'no takes'}")
    return 0


def _export(args: argparse.Namespace) -> int:
    plan, output, choices = Plan.open(args.plan), Store(args.output).url, _choices(args)
    if args.threads < 1:
        raise _Wrong("--threads: at least 1")
    _remember(args.plan, Store(output))
    more: dict[str, Any] = {"threads": args.threads, "scratch": args.scratch}
    if args.openjd is not None:
        print(openjd(plan, output, Path(args.openjd), choices, **more))
    else:
        files = slurm_array(plan, output, Path(args.slurm_array), choices, **more)
        print(f"{files[-1]}: run it where sbatch is")
    return 0


def _task(args: argparse.Namespace) -> int:
    plan, output, choices = Plan.open(args.plan), Store(args.output), _choices(args)
    failed = 0
    for index in range(args.first, args.first + args.count):
        try:
            task = task_at(plan, output, args.stage, index, choices, args.scratch)
        except ValueError as error:
            # The last task of an array may be for fewer shards than the others.
            if index > args.first and "asked for, but there are" in str(error):
                break
            raise
        if task is None:
            continue
        result = run_task({**task, "threads": args.threads})
        name = f"{task['take']['name']}, {args.stage} {index}"
        print(
            f"{name}: {'done' if result['ok'] else result['error']}",
            file=sys.stderr if not result["ok"] else sys.stdout,
        )
        if not result["ok"]:
            failed += 1
            # Why a shard is missing says more than that it is.
            if args.stage != "finish" or output.read(f"{take_folder(task['take'])}/error.json") is None:
                note_failure(output, task["take"], result["error"])
    return 1 if failed else 0
