"""The folder of a sweep: a description of the sweep, and its finished chunks."""

import hashlib
import json
import os
import pickle
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ._arguments import described

if TYPE_CHECKING:
    from ._variations import Job

_Rows = dict[str, NDArray[Any]]

_HEAD = "sweep.json"

_DIGEST = "variations (SHA-256)"
"""Name of the digest of a chunk's variations, in the file of the chunk."""


class Folder:
    """A folder with one file that identifies the sweep, and a file for each finished chunk."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._digests: dict[int, str] = {}

    @classmethod
    def open(cls, path: "str | os.PathLike[str]") -> "Folder":
        """Opens a folder that contains a sweep."""
        if not (Path(path) / _HEAD).is_file():
            raise ValueError(f"folder: {path} holds no sweep (no {_HEAD})")
        return cls(Path(path))

    @classmethod
    def create(
        cls, path: "str | os.PathLike[str]", job: "Job", items: Any, chunk: int, more: dict[str, str]
    ) -> "Folder":
        """Creates the folder of a sweep, or opens a folder that contains finished chunks of the same sweep. `items` are
        None if the variations come from an iterator.
        """
        if not isinstance(path, (str, os.PathLike)):
            raise TypeError(f"folder: expected a path, found {described(path)}")
        path = Path(path)
        count = None if items is None else len(items)
        head: dict[str, Any] = {"variations": count, "chunk": chunk, "keep": list(job.keep), **more}
        head["solver"] = job.solver.__name__
        head["vary"] = None if job.vary is None else f"{job.vary.__module__}.{job.vary.__qualname__}"
        for name, part in (
            ("problem", job.problem),
            ("start", job.start),
            ("settings", job.settings),
            ("items", items),
        ):
            head[f"{name} (SHA-256)"] = hashlib.sha256(_pickled(name, part)).hexdigest()
        path.mkdir(parents=True, exist_ok=True)
        if (path / _HEAD).exists():
            there = json.loads((path / _HEAD).read_text())
            other = [name for name in sorted(head.keys() | there.keys()) if head.get(name) != there.get(name)]
            if other:
                raise ValueError(
                    f"folder: {path} holds the results of another sweep, which differs in {', '.join(other)}"
                )
        else:
            _write(path / _HEAD, json.dumps(head, indent=1).encode())
        return cls(path)

    def done(self) -> set[int]:
        """Returns the indices of the finished chunks."""
        return {int(path.stem.removeprefix("chunk-")) for path in self._path.glob("chunk-*.npz")}

    def compare(self, number: int, items: Any) -> None:
        """Compares variations of an iterator with the variations of the finished chunk with the same index, or keeps
        their digest until the chunk is written.
        """
        digest = hashlib.sha256(_pickled("variations", items)).hexdigest()
        path = self._file(number)
        if path.exists():
            with np.load(path, allow_pickle=False) as arrays:
                if _DIGEST not in arrays.files or arrays[_DIGEST].item() != digest:
                    raise ValueError(f"folder: {self._path} holds other variations in chunk {number}")
        else:
            self._digests[number] = digest

    def read(self, number: int) -> _Rows:
        """Returns the rows of a finished chunk."""
        with np.load(self._file(number), allow_pickle=False) as arrays:
            return {name: arrays[name] for name in arrays.files if name != _DIGEST}

    def write(self, number: int, rows: _Rows) -> None:
        """Writes a chunk. The chunk's file appears in the folder only when the file is complete."""
        path = self._file(number)
        part = path.with_suffix(".part")
        written = rows | {"error": np.asarray(rows["error"], str)}
        if number in self._digests:
            written[_DIGEST] = np.array(self._digests.pop(number))
        with open(part, "wb") as file:
            np.savez(file, **written)  # type: ignore[arg-type]
        os.replace(part, path)

    def _file(self, number: int) -> Path:
        return self._path / f"chunk-{number:06d}.npz"


def _pickled(name: str, part: Any) -> bytes:
    try:
        return pickle.dumps(part, protocol=5)
    except (pickle.PicklingError, TypeError, AttributeError) as wrong:
        raise ValueError(f"{name}: a sweep that is written to a folder must be able to pickle it: {wrong}") from wrong


def _write(path: Path, data: bytes) -> None:
    part = path.with_suffix(".part")
    part.write_bytes(data)
    os.replace(part, path)
