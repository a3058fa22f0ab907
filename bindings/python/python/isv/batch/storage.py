"""Folders on any file system of fsspec, in which a file has its final name once it is whole."""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import tempfile
import time
import uuid
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import fsspec
from fsspec.implementations.local import LocalFileSystem

__all__ = ["Store", "is_url"]

_ATOMIC = {"s3", "s3a", "gs", "gcs", "abfs", "abfss", "az", "adl"}
"""File systems whose objects appear whole, under their name, when the last byte is there."""


def is_url(path: str) -> bool:
    """Whether a path names a file system, as ``s3://bucket/takes`` does."""
    return "://" in path


def _files_in(folder: str, above: frozenset[tuple[int, int]]) -> Iterator[str]:
    """The names of files in a local folder and in its folders, except in links to folders ``above`` (device, inode)."""
    try:
        status, entries = os.stat(folder), sorted(os.listdir(folder))
    except (FileNotFoundError, NotADirectoryError, PermissionError):
        return
    place = (status.st_dev, status.st_ino)
    if place in above:
        return
    for entry in entries:
        path = os.path.join(folder, entry)
        if os.path.isdir(path):
            for name in _files_in(path, above | {place}):
                yield f"{entry}/{name}"
        else:
            yield entry


class Store:
    """A folder on a local disk or in an object store.

    Attributes:
        url: The folder, as it was given; local ones are absolute.
    """

    def __init__(self, url: str) -> None:
        """Open a folder, which is made when the first file is written."""
        self.url = url.rstrip("/") if is_url(url) else os.path.abspath(url)
        self._fs, root = fsspec.core.url_to_fs(self.url)
        self._root = str(root).rstrip("/")
        protocol = self._fs.protocol
        self._protocols = {protocol} if isinstance(protocol, str) else set(protocol)

    @property
    def is_local(self) -> bool:
        """Whether its files can be opened by their paths."""
        return isinstance(self._fs, LocalFileSystem)

    def path(self, name: str) -> str:
        """The path of a file in its file system."""
        return f"{self._root}/{name}" if name else self._root

    def publish(self, local: str | os.PathLike[str], name: str) -> None:
        """Copy a whole file in. Others see nothing, or what was there before, until all of it is there.

        Raises:
            OSError: It cannot be written. Nothing is left of it.
        """
        final = self.path(name)
        if not self._protocols.isdisjoint(_ATOMIC):
            self._fs.put_file(os.fspath(local), final)
            self._fs.invalidate_cache()
            return
        folder, base = final.rsplit("/", 1)
        self._fs.makedirs(folder, exist_ok=True)
        part = f"{folder}/.{base}.{uuid.uuid4().hex}.part"
        try:
            self._copy(os.fspath(local), part)
            if self.is_local:
                os.replace(part, final)
            else:
                self._fs.mv(part, final)
        except BaseException:
            with contextlib.suppress(Exception):
                self._fs.rm_file(part)
            raise

    def publish_json(self, value: Any, name: str) -> None:
        """Write a value as JSON, whole or not at all."""
        self.publish_bytes((json.dumps(value, indent=1, sort_keys=True) + "\n").encode(), name)

    def publish_bytes(self, data: bytes, name: str) -> None:
        """Write a file of these bytes, whole or not at all."""
        with tempfile.NamedTemporaryFile(prefix="isv-batch-") as file:
            file.write(data)
            file.flush()
            self.publish(file.name, name)

    def _copy(self, local: str, part: str) -> None:
        if not self.is_local:
            self._fs.put_file(local, part)
            return
        with open(local, "rb") as source, open(part, "wb") as target:
            shutil.copyfileobj(source, target, 1 << 20)
            target.flush()
            os.fsync(target.fileno())

    def fetch(self, name: str, local: str | os.PathLike[str]) -> Path:
        """Copy a file out. A local one is not copied: its own path is returned.

        Raises:
            FileNotFoundError: It is not there.
        """
        if self.is_local:
            path = Path(self.path(name))
            path.stat()
            return path
        Path(local).parent.mkdir(parents=True, exist_ok=True)
        self._fs.get_file(self.path(name), os.fspath(local))
        return Path(local)

    def read(self, name: str) -> bytes | None:
        """The bytes of a file, or None if it is not there."""
        try:
            data: bytes = self._fs.cat_file(self.path(name))
        except FileNotFoundError:
            return None
        return data

    def read_json(self, name: str) -> dict[str, Any] | None:
        """The object in a JSON file, or None if there is none that can be read."""
        data = self.read(name)
        if data is None:
            return None
        try:
            value = json.loads(data)
        except ValueError:
            return None
        return value if isinstance(value, dict) else None

    def size(self, name: str) -> int | None:
        """The size of a file (bytes), or None if it is not there."""
        try:
            self._fs.invalidate_cache()
            return int(self._fs.info(self.path(name))["size"])
        except FileNotFoundError:
            return None

    def remove(self, name: str) -> None:
        """Remove a file, if it is there."""
        with contextlib.suppress(FileNotFoundError):
            self._fs.rm_file(self.path(name))
            self._fs.invalidate_cache()

    def names(self, folder: str = "") -> list[str]:
        """The names of files in a folder and in its folders, in order, without those that are not whole.

        Links to local folders are followed.
        """
        root = self.path(folder)
        names: Iterable[str]
        if self.is_local:
            names = _files_in(root, frozenset())
        else:
            self._fs.invalidate_cache()
            try:
                found = self._fs.find(root)
            except FileNotFoundError:
                return []
            names = (str(path)[len(root) :].lstrip("/") for path in found)
        return sorted(name for name in names if name and not name.endswith(".part"))

    def sweep(self, folder: str, older_s: float = 3600.0) -> None:
        """Remove what tasks that were killed had begun to write into a folder, and left for so long (s)."""
        if not self.is_local:
            return
        for path in Path(self.path(folder)).rglob(".*.part"):
            with contextlib.suppress(OSError):
                if time.time() - path.stat().st_mtime > older_s:
                    path.unlink()

    def children(self) -> list[tuple[str, bool]]:
        """The names in the folder itself, each with whether it is a folder."""
        if self.is_local:
            with os.scandir(self._root) as found_here:
                return sorted((entry.name, entry.is_dir()) for entry in found_here if not entry.name.startswith("."))
        self._fs.invalidate_cache()
        entries = self._fs.ls(self._root, detail=True)
        found = ((str(entry["name"]).rstrip("/").rsplit("/", 1)[-1], entry["type"] == "directory") for entry in entries)
        return sorted((name, is_folder) for name, is_folder in found if name and not name.startswith("."))

    def is_folder(self) -> bool:
        """Whether it is a folder that is there."""
        self._fs.invalidate_cache()
        return bool(self._fs.isdir(self._root))

    def exists(self) -> bool:
        """Whether there is anything by this name."""
        self._fs.invalidate_cache()
        return bool(self._fs.exists(self._root))

    def token(self, name: str) -> str:
        """What a file of an object store is known by: its entity tag, or else its size and time of change."""
        info = self._fs.info(self.path(name))
        for key in ("ETag", "etag", "md5Hash", "contentHash", "content_settings"):
            if info.get(key):
                return str(info[key])
        return f"{info.get('size')} {info.get('LastModified') or info.get('mtime') or info.get('created')}"
