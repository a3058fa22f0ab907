"""Which frame of a take is shown at a frame of a scene."""

from __future__ import annotations

import math


def shown(
    scene_frame: float,
    scene_fps: float,
    take_fps: float,
    *,
    start: float = 1.0,
    first: int = 0,
    last: int = 0,
    speed: float = 1.0,
    reverse: bool = False,
    extend: str = "HOLD",
) -> int | None:
    """Return the number of the take's frame that is shown.

    Args:
        scene_frame: Frame of the scene; fractions count.
        scene_fps: Frames a second of the scene.
        take_fps: Frames a second of the take.
        start: Frame of the scene at which the range begins.
        first: First frame of the range in the take.
        last: Last frame of the range, which belongs to it.
        speed: Seconds of the take in a second of the scene; above 0.
        reverse: Whether the range is played from its end.
        extend: What is shown before and after the range: "HOLD" its first and last frame, "LOOP" the range again,
            "HIDE" nothing.

    Returns:
        A number in ``first ..= last``, or None where nothing is shown.
    """
    count = last - first + 1
    # Frames that meet exactly must not be missed by rounding.
    step = math.floor((scene_frame - start) / scene_fps * take_fps * speed + 1e-4)
    if extend == "LOOP":
        step %= count
    elif extend == "HIDE" and not 0 <= step < count:
        return None
    step = min(max(step, 0), count - 1)
    return last - step if reverse else first + step
