"""Takes as inputs: which files each frame is made of, what they are known by, and copies of remote ones."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from .. import _isv
from .storage import Store, is_url

__all__ = ["Source", "find_takes"]

_SINGLE = {".isv", ".glb", ".gltf"}
"""Files that hold a whole take."""


@dataclass(frozen=True)
class _Layout:
    """Files of a take, by their names below its folder.

    Attributes:
        frames: The file of each frame, in order; empty where frames are not files of their own.
        owners: The frame of each other file that belongs to one frame alone.
        shared: Files that any frame may need.
    """

    frames: list[str]
    owners: dict[str, int]
    shared: list[str]

    def needed(self, first: int, end: int) -> list[str]:
        """The files that frames from ``first`` up to ``end`` need, in order of their names."""
        own = [name for name, frame in self.owners.items() if first <= frame < end]
        return sorted({*self.frames[first:end], *own, *self.shared})


class Source:
    """A take to encode: a folder, a pattern, a file, or one of these in an object store.

    A copy of a remote take has all names, so that frames have their numbers and times, but content only where it is
    needed.
    """

    def __init__(self, url: str) -> None:
        """Name a take. Nothing is read."""
        self.url = url if is_url(url) else os.path.abspath(url)
        if is_url(url) and any(mark in url for mark in "*?["):
            raise ValueError(f"{url}: patterns are for local files; name the folder")
        self._layout: _Layout | None = None
        self._copy: Path | None = None

    @property
    def is_local(self) -> bool:
        """Whether the encoder can read it where it is."""
        return not is_url(self.url)

    def _store(self) -> tuple[Store, str]:
        """The folder of the take, and the name of its file if it is one."""
        if any(mark in os.path.basename(self.url) for mark in "*?["):
            return Store(os.path.dirname(self.url) or "."), ""
        store = Store(self.url)
        if store.is_folder():
            return store, ""
        folder, _, name = self.url.rpartition("/")
        return Store(folder), name

    def local(self, scratch: Path, first: int = 0, end: int | None = None) -> Path:
        """A path that the encoder can read frames from ``first`` up to ``end`` of."""
        if self.is_local:
            return Path(self.url)
        store, single = self._store()
        copy = scratch / "take"
        copy.mkdir(parents=True, exist_ok=True)
        if single:
            return store.fetch(single, copy / single)
        layout = self._layout_in(store, copy)
        wanted = layout.needed(first, len(layout.frames) if end is None else end)
        for name in wanted:
            if (copy / name).stat().st_size == 0:
                store.fetch(name, copy / name)
        return copy

    def _layout_in(self, store: Store, copy: Path) -> _Layout:
        if self._layout is not None and self._copy == copy:
            return self._layout
        names = store.names()
        if not names:
            raise FileNotFoundError(f"{self.url}: there are no files")
        for name in names:
            (copy / name).parent.mkdir(parents=True, exist_ok=True)
            (copy / name).touch()
        self._layout, self._copy = _layout_of(copy, names), copy
        return self._layout

    def frame_count(self, scratch: Path) -> int | None:
        """Number of frames where each is a file of its own, found without reading one; None otherwise."""
        if self.is_local:
            files = _isv.frame_files(self.url)
            return None if files is None else len(files)
        store, single = self._store()
        if single:
            return None
        (scratch / "take").mkdir(parents=True, exist_ok=True)
        layout = self._layout_in(store, scratch / "take")
        return len(layout.frames) or None

    def fingerprint(self, first: int, end: int, scratch: Path) -> str:
        """What the files that frames from ``first`` up to ``end`` need are known by: a hash of names and content.

        Content of local files is hashed. Files of object stores are known by their entity tags.
        """
        digest = hashlib.sha256()
        if self.is_local:
            root, names = self._local_files(first, end)
            for name in names:
                digest.update(f"{name}\0{_hash_of(root / name)}\n".encode())
            return digest.hexdigest()
        store, single = self._store()
        names = [single] if single else self._layout_in(store, scratch / "take").needed(first, end)
        for name in names:
            digest.update(f"{name}\0{store.token(name)}\n".encode())
        return digest.hexdigest()

    def _local_files(self, first: int, end: int) -> tuple[Path, list[str]]:
        path = Path(self.url)
        if path.is_file():
            return path.parent, [path.name]
        root = path if path.is_dir() else Path(os.path.dirname(self.url))
        if self._layout is None:
            if path.is_dir():
                names = Store(self.url).names()
            else:
                found = _isv.frame_files(self.url) or []
                root = Path(os.path.commonpath([os.path.dirname(file) for file in found]))
                beside = {os.path.dirname(file) for file in found}
                inside = (entry for folder in beside for entry in Path(folder).iterdir() if entry.is_file())
                names = sorted(os.path.relpath(entry, root) for entry in inside)
            self._layout = _layout_of(Path(self.url), names, root)
        return root, self._layout.needed(first, end)


def _layout_of(path: Path, names: list[str], root: Path | None = None) -> _Layout:
    """Sort the files of a take: those of frames, those that belong to one, and others."""
    root = root or path
    files = _isv.frame_files(path)
    if files is None:
        return _Layout([], {}, names)
    frames = [os.path.relpath(file, root) for file in files]
    stems = {os.path.splitext(name)[0]: number for number, name in enumerate(frames)}
    taken = set(frames)
    owners: dict[str, int] = {}
    shared: list[str] = []
    for name in names:
        if name in taken:
            continue
        owner = _owner(os.path.splitext(name)[0], stems)
        if owner is None:
            shared.append(name)
        else:
            owners[name] = owner
    return _Layout(frames, owners, shared)


def _owner(stem: str, stems: dict[str, int]) -> int | None:
    """The frame with whose name a file's name begins, as ``frame_7_skin`` does with ``frame_7``, if any."""
    for length in range(len(stem), 0, -1):
        if stem[:length] in stems and not stem[length : length + 1].isdigit():
            return stems[stem[:length]]
    return None


def _hash_of(path: Path) -> str:
    with open(path, "rb") as file:
        return (
            hashlib.file_digest(file, "sha256").hexdigest() if hasattr(hashlib, "file_digest") else _hash_slowly(path)
        )


def _hash_slowly(path: Path) -> str:
    """The hash in pieces, for Python 3.10."""
    digest = hashlib.sha256()
    with open(path, "rb") as file:
        while piece := file.read(1 << 20):
            digest.update(piece)
    return digest.hexdigest()


def find_takes(url: str) -> Iterator[tuple[str, str]]:
    """Find the takes that a path names.

    A folder of frames, a pattern of files and a file are one take. Any other folder is one of takes: each folder in it,
    and each ``.isv``, ``.glb`` or ``.gltf`` file.

    Returns:
        The name and the path of each take.

    Raises:
        FileNotFoundError: There is nothing by this name.
    """
    base = url.rstrip("/")
    if not is_url(base) and any(mark in os.path.basename(base) for mark in "*?["):
        yield _name_of(os.path.dirname(os.path.abspath(base))), base
        return
    store = Store(base)
    if not store.exists():
        raise FileNotFoundError(f"{url}: no such folder or file")
    is_one, takes = not store.is_folder() or _is_take(store), 0
    for name, is_folder in [] if is_one else store.children():
        if is_folder or os.path.splitext(name)[1].lower() in _SINGLE:
            takes += 1
            yield _name_of(name), f"{store.url}/{name}"
    if takes == 0:
        # What holds no takes either is said when it is planned.
        yield _name_of(base), store.url


def _is_take(store: Store) -> bool:
    """Whether a folder is a take itself: isv finds frames in it. Of remote ones names are looked at alone."""
    if store.is_local:
        try:
            _isv.frame_files(store.url)
        except ValueError:
            return False
        return True
    files = {name for name, is_folder in store.children() if not is_folder}
    return any(os.path.splitext(name)[1].lower() not in {*_SINGLE, "", ".md", ".txt"} for name in files)


def _name_of(path: str) -> str:
    """A name for a take that can be one of a folder. Takes of one folder have different ones."""
    base = os.path.basename(path.rstrip("/")) or "take"
    kept = "".join(letter if letter.isalnum() or letter in "-_." else "_" for letter in base).lstrip(".")
    return kept if kept == base else f"{kept or 'take'}-{hashlib.sha256(base.encode()).hexdigest()[:6]}"
