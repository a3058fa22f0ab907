"""Frames to messages and back. Needs the package ``isv`` alone, no ROS.

A message is a prefix, a name and bytes of a stream. The prefix is little-endian: the number of the stream and that of the message
in it, both from 0 and of 32 bits; the time of the frame (ns, 64 bits); the bytes of the name (16 bits). The name is that of the
coordinate frame, in UTF-8. Each group of pictures is a stream of its own, so that who listens from now on, or missed a message,
goes on at the next one.
"""

from __future__ import annotations

import struct
import threading
from typing import Any, NamedTuple

import isv

_PREFIX = struct.Struct("<IIqH")
_WRAP = 1 << 32
_LONGEST_NAME = (1 << 16) - 1


class Arrived(NamedTuple):
    """A frame that came, and what its sender said of it."""

    frame: isv.Frame
    #: Time of the frame (ns), by the sender's clock.
    stamp_ns: int
    #: Name of the coordinate frame that it is in.
    frame_id: str


class Sender:
    """Encodes frames to messages."""

    def __init__(self, *, voxel: float, gop: int = 30, **options: Any) -> None:
        """Begin.

        Args:
            voxel: Edge of a voxel (m).
            gop: Frames of a group: a listener waits for at most so many.
            options: Other options of ``isv.Writer``, such as ``quality`` or ``up``.

        Raises:
            ValueError: An option has a value that it cannot have.
        """
        if gop < 1:
            raise ValueError(f"gop is {gop}: a group has at least 1 frame")
        self._options = {"preset": "realtime", **options, "voxel": voxel, "gop": gop}
        self._gop = gop
        self._stream = -1
        self._writer: isv.Writer | None = None
        self._had_colors = False
        self._sink = _Sink()
        self._number = 0

    def push(self, frame: Any, stamp_ns: int = 0, frame_id: str = "") -> bytes:
        """Encode a frame, of any kind that ``isv.Writer.push`` takes: a cloud, a mesh, a field.

        Args:
            frame: The frame.
            stamp_ns: Its time (ns, 64 bits with a sign).
            frame_id: Name of the coordinate frame that it is in, of 65,535 bytes at most.

        Returns:
            The message.

        Raises:
            TypeError: The frame is none of these.
            ValueError: It cannot be used, and the next frame begins a group; or the time or the name is too long.
        """
        name = frame_id.encode()
        if len(name) > _LONGEST_NAME or not -(1 << 63) <= stamp_ns < 1 << 63:
            raise ValueError("stamp_ns has 64 bits at most, and frame_id 65535 bytes")
        self._had_colors |= getattr(frame, "colors", None) is not None
        if self._writer is None or self._number == self._gop:
            self._begin()
        assert self._writer is not None
        try:
            self._writer.push(frame)
        except Exception:
            self._writer = None
            raise
        message = _PREFIX.pack(self._stream, self._number, stamp_ns, len(name)) + name + self._sink.take()
        self._number += 1
        return message

    def _begin(self) -> None:
        self._sink = _Sink()
        # A group may begin with an empty frame, which has no colours.
        expected = {"expect_color": True} if self._had_colors and self._options.get("color", True) else {}
        self._writer = isv.Writer(self._sink, **{**self._options, **expected})
        self._stream = (self._stream + 1) % _WRAP
        self._number = 0


class Receiver:
    """Decodes messages to frames."""

    def __init__(self, **options: Any) -> None:
        """Begin.

        Args:
            options: Options of ``isv.open``, such as ``lod`` or ``memory_limit``.
        """
        self._options = options
        self._decoding: _Decoding | None = None
        self._next: tuple[int, int] | None = None

    def push(self, message: bytes) -> list[Arrived]:
        """Decode a message.

        Args:
            message: The message as it came.

        Returns:
            The frames that it completes: one, or none after a loss, until a group begins.

        Raises:
            ValueError: The message is none, or damaged. Decoding goes on at the next group.
        """
        if len(message) < _PREFIX.size:
            raise ValueError(f"a message has at least {_PREFIX.size} bytes, not {len(message)}")
        stream, number, stamp_ns, length = _PREFIX.unpack_from(message)
        name, data = message[_PREFIX.size :][:length], message[_PREFIX.size + length :]
        if number == 0:
            self.close()
            self._decoding = _Decoding(self._options)
        elif self._decoding is None or self._next != (stream, number):
            self.close()
            return []
        assert self._decoding is not None
        self._next = (stream, number + 1)
        try:
            frame_id = name.decode()
            frames = self._decoding.feed(data)
            if not frames:
                raise ValueError("a message that completes no frame: it was cut, or it is none")
        except Exception:
            self.close()
            raise
        return [Arrived(frame, stamp_ns, frame_id) for frame in frames]

    def close(self) -> None:
        """Forget what came, until a group begins."""
        if self._decoding is not None:
            self._decoding.end()
        self._decoding, self._next = None, None


class _Sink:
    """A file that keeps what is written until it is taken."""

    def __init__(self) -> None:
        self._parts: list[bytes] = []

    def write(self, data: bytes) -> int:
        self._parts.append(bytes(data))
        return len(data)

    def flush(self) -> None:
        pass

    def take(self) -> bytes:
        data = b"".join(self._parts)
        self._parts.clear()
        return data


class _Decoding:
    """A stream that is decoded by a thread as its bytes come."""

    def __init__(self, options: dict[str, Any]) -> None:
        self._options = options
        self._changed = threading.Condition()
        self._bytes = b""
        self._ended = False
        # Whether the thread has read all bytes and waits for more, or has ended.
        self._idle = False
        self._frames: list[isv.Frame] = []
        self._error: Exception | None = None
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def read(self, size: int = -1) -> bytes:
        """Give bytes to the decoder: waits for some, and has none at the end."""
        with self._changed:
            while not self._bytes and not self._ended:
                self._idle = True
                self._changed.notify_all()
                self._changed.wait()
            self._idle = False
            end = len(self._bytes) if size < 0 else size
            given, self._bytes = self._bytes[:end], self._bytes[end:]
            return given

    def feed(self, data: bytes) -> list[isv.Frame]:
        """Decode bytes, and return the frames that they complete."""
        with self._changed:
            self._bytes += data
            self._idle = False
            self._changed.notify_all()
            while not self._idle and self._thread.is_alive() and self._error is None:
                self._changed.wait(timeout=1.0)
            frames, self._frames = self._frames, []
            if self._error is not None:
                raise self._error
            return frames

    def end(self) -> None:
        """End the thread."""
        with self._changed:
            self._ended = True
            self._bytes = b""
            self._changed.notify_all()
        self._thread.join()

    def _run(self) -> None:
        try:
            with isv.open(self, **self._options) as take:
                for frame in take:
                    with self._changed:
                        self._frames.append(frame)
        except Exception as error:
            with self._changed:
                if not self._ended:
                    self._error = error
        finally:
            with self._changed:
                self._idle = True
                self._changed.notify_all()
