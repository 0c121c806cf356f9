"""What is fuzzed: a valid file, and the call that reads it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fuzz.mutations import mutated
from stseg.errors import StsegError


@dataclass(frozen=True)
class Target:
    """What is fuzzed.

    Attributes
    ----------
    name
        Of the target; its suffix is that of the file.
    valid
        A valid file, which `read` takes without an error; made in a folder.
    read
        Reads a file; raises StsegError for what it does not take.
    mutate
        Makes another file of a valid one.
    """

    name: str
    valid: Callable[[Path], bytes]
    read: Callable[[Path], object]
    mutate: Callable[[bytes, np.random.Generator], bytes] = mutated

    @property
    def suffix(self) -> str:
        """Of its files."""
        return Path(self.name).suffix


def plain(data: bytes | str) -> Callable[[Path], bytes]:
    """A file that needs no folder to be made in."""
    whole = data.encode() if isinstance(data, str) else data
    return lambda _: whole


def answer(target: Target, path: Path) -> str:
    """What a target makes of a file: nothing, or its one line; anything else than StsegError is raised."""
    try:
        target.read(path)
    except StsegError as error:
        line = str(error)
        assert "\n" not in line.strip() or len(line) < 1000, line
        return line
    return ""
