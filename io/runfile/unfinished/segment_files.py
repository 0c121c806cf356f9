"""Files of finished segments, whose names contain their checksums."""

from __future__ import annotations

import re
from hashlib import blake2b, file_digest
from pathlib import Path
from typing import NamedTuple

from stseg.io.outputs.whole_files import sync_folder
from stseg.io.untrusted.bounded_files import is_regular

_SEGMENT = re.compile(r"segment-(\d{5})-([0-9a-f]{32})\.h5")


class FinishedSegments(NamedTuple):
    """Files of segments in a folder: the whole ones by number, and those whose bytes have changed."""

    whole: dict[int, Path]
    broken: list[Path]


def finished_segments(folder: Path) -> FinishedSegments:
    """The files of finished segments in a folder."""
    found = FinishedSegments({}, [])
    for path in sorted(folder.iterdir()):
        name = _SEGMENT.fullmatch(path.name)
        if name is None or not is_regular(path):
            continue
        if checksum(path) == name[2]:
            found.whole[int(name[1])] = path
        else:
            found.broken.append(path)
    return found


def keep_segment(draft: Path) -> Path:
    """Rename a complete, synced segment to the name that contains its checksum."""
    kept = draft.with_name(f"{draft.stem}-{checksum(draft)}.h5")
    draft.replace(kept)
    sync_folder(kept.parent)
    return kept


def checksum(path: Path) -> str:
    """Checksum of a file, 32 hexadecimal digits."""
    with path.open("rb") as file:
        return file_digest(file, lambda: blake2b(digest_size=16)).hexdigest()
