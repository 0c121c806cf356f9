"""Files of an unfinished run, read as untrusted: finished segments, named by their checksums, and time stamps."""

import re
from hashlib import blake2b, file_digest
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from stseg.arrays import Floats
from stseg.io.outputs.whole_files import replacing, sync_folder
from stseg.io.recording.aligned_stream import StreamIndex, index_from_times
from stseg.io.recording.recording import Recording
from stseg.io.recording.source_files import source_parts
from stseg.io.recording.video.time_stamps import pack_stamps, unpack_stamps
from stseg.io.untrusted import limits
from stseg.io.untrusted.bounded_files import is_regular, require_regular
from stseg.io.untrusted.numpy_files import read_npz

_SEGMENT = re.compile(r"segment-(\d{5})-([0-9a-f]{32})\.h5")
_STAMPS = 1 << 32
"""Bytes of all time stamps, unpacked."""


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
    require_regular(path)
    with path.open("rb") as file:
        return file_digest(file, lambda: blake2b(digest_size=16)).hexdigest()


def read_stream_times(path: Path, recording: Recording) -> StreamIndex | None:
    """The stream index of stored time stamps; None where there are none, or not of this recording."""
    try:
        stored = read_npz(path, _STAMPS)
        times = tuple(
            tuple(_stamps(stored.get(f"times{k}_{file}")) for file in range(one))
            for k, one in enumerate(_counts(stored))
        )
    except (OSError, ValueError):
        return None
    expected = [len(source_parts(source.timed, "")) for source in recording.sources]
    return index_from_times(recording, times) if list(map(len, times)) == expected else None


def write_stream_times(path: Path, streams: StreamIndex) -> None:
    """Store the time stamps of all streams, whole or not at all; of a file without any, its number of frames."""
    times = {f"times{k}_{j}": pack_stamps(one) for k, files in enumerate(streams.times) for j, one in enumerate(files)}
    files = np.array([len(one) for one in streams.times], np.int64)
    with replacing(path, overwrite=True) as part, part.open("wb") as file:
        np.savez_compressed(file, files=files, **times)  # type: ignore[arg-type]


def _counts(stored: Any) -> list[int]:
    """Number of files of each camera; ValueError where the archive does not say it."""
    files = stored.get("files")
    if files is None or files.ndim != 1 or files.dtype != np.int64 or not 0 < len(files) <= limits.CAMERAS:
        raise ValueError("no numbers of files")
    return [int(count) for count in files]


def _stamps(stored: Any) -> Floats:
    """The time stamps of a file; ValueError where they are none."""
    counts = stored is not None and stored.dtype == np.int64 and stored.shape == (1,)
    if stored is None or stored.ndim != 1 or not (counts or stored.dtype == np.float64):
        raise ValueError("no time stamps")
    if not 0 <= (stored[0] if counts else len(stored)) <= limits.FRAMES:
        raise ValueError("more time stamps than a recording has frames")
    return unpack_stamps(stored)
