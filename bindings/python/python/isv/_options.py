"""Options of encoding: each has the type and the range of its kind, or there is one exception that names it."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from ._checks import bytes_of, flag_of, number_of, place_of, text_of, voxel_of, whole_of

_count = partial(whole_of, low=1, high=2**32 - 1)
_length = partial(number_of, unit="metres")
_percent = partial(number_of, unit="0 to 100")

_KINDS: dict[str, Callable[[str, Any], Any]] = {
    "quality": _percent,
    "bitrate_mbps": partial(number_of, unit="millions of bits a second"),
    "max_error": _length,
    "two_passes": flag_of,
    "voxel": voxel_of,
    "fps": partial(number_of, unit="frames a second"),
    "gop": _count,
    "fixed_gop": flag_of,
    "time_origin": whole_of,
    "preset": text_of,
    "refresh": text_of,
    "color": flag_of,
    "expect_color": flag_of,
    "color_quality": _percent,
    "profile": text_of,
    "full_band": flag_of,
    "checksums": flag_of,
    "title": text_of,
    "capture_device": text_of,
    "metadata": text_of,
    "timestamps": text_of,
    "sign": text_of,
    "shell_offset": partial(number_of, unit="voxels"),
    "estimate_normals": flag_of,
    "viewpoint": place_of,
    "accumulate_depth": flag_of,
    "max_depth": _length,
    "max_blocks": _count,
    "units": text_of,
    "origin": place_of,
    "up": text_of,
    "animation": text_of,
    "skip_bad_frames": flag_of,
    "drop_invalid_points": flag_of,
    "memory_limit": bytes_of,
}
"""Check of each option. The extension checks which texts an option takes, and which options go together."""


def options_of(options: Mapping[str, Any]) -> dict[str, Any]:
    """Check options of encoding. Options with the value None are left out.

    Raises:
        TypeError: There is no such option, or it is of another type.
        ValueError: An option has a value that it cannot have.
    """
    given: dict[str, Any] = {}
    for name, value in options.items():
        check = _KINDS.get(name)
        if check is None:
            near = difflib.get_close_matches(name, _KINDS, n=1)
            hint = f"; is {near[0]} meant?" if near else ""
            raise TypeError(f"{name} is no option of encoding{hint}")
        if value is not None:
            given[name] = check(name, value)
    return given
