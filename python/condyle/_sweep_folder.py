"""The folder of a sweep: a description of the sweep, and its finished chunks."""

import hashlib
import json
import os
import pickle
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from ._sweep import Job

_Rows = dict[str, NDArray[Any]]

_HEAD = "sweep.json"


class Folder:
    """A folder with one file that identifies the sweep, and a file for each finished chunk."""

    def __init__(self, path: Path) -> None:
        self._path = path

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
        """Creates the folder of a sweep, or opens a folder that contains finished chunks of the same sweep."""
        path = Path(path)
        head: dict[str, Any] = {"variations": len(items), "chunk": chunk, "keep": list(job.keep), **more}
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

    def done(self) -> dict[int, _Rows]:
        """Returns the finished chunks, by index."""
        chunks: dict[int, _Rows] = {}
        for path in sorted(self._path.glob("chunk-*.npz")):
            with np.load(path, allow_pickle=False) as arrays:
                chunks[int(path.stem.removeprefix("chunk-"))] = {name: arrays[name] for name in arrays.files}
        return chunks

    def write(self, number: int, rows: _Rows) -> None:
        """Writes a chunk. The chunk's file appears in the folder only when the file is complete."""
        path = self._path / f"chunk-{number:06d}.npz"
        part = path.with_suffix(".part")
        with open(part, "wb") as file:
            np.savez(file, **rows)  # type: ignore[arg-type]
        os.replace(part, path)


def _pickled(name: str, part: Any) -> bytes:
    try:
        return pickle.dumps(part, protocol=5)
    except (pickle.PicklingError, TypeError, AttributeError) as wrong:
        raise ValueError(f"{name}: a sweep that is written to a folder must be able to pickle it: {wrong}") from wrong


def _write(path: Path, data: bytes) -> None:
    part = path.with_suffix(".part")
    part.write_bytes(data)
    os.replace(part, path)
