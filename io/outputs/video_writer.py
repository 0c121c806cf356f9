"""Writing of video files."""

from collections.abc import Iterable
from pathlib import Path

import cv2

from stseg.arrays import Bytes
from stseg.errors import OutputError
from stseg.io.outputs.whole_files import MARK, replacing
from stseg.io.untrusted.values import require_utf8

_ENDING = ".mp4"


def require_film_name(path: Path) -> None:
    """Refuse a name without the ending of a video that is written here; raises OutputError."""
    if path.suffix.lower() != _ENDING:
        raise OutputError(path, "", f"the ending {path.suffix!r}", f"a name that ends in {_ENDING}")


def write_film(path: Path, pictures: Iterable[Bytes], frame_rate: float, overwrite: bool) -> int:
    """Write pictures as an MP4 file of VP9, which browsers play, whole or not at all; their number. Raises OutputError.

    The pictures are one or more, uint8 (v, u, 3), blue, green, red, all of one size; the path ends in .mp4, and an
    older file is replaced where `overwrite` says so.
    """
    require_film_name(path)
    require_utf8(path, "a video")
    with replacing(path, overwrite) as part:
        film = part.with_name(part.name + _ENDING)  # the ending decides the container
        try:
            count = _write(film, pictures, frame_rate)
            with film.open("ab") as file:
                file.write((8 + len(MARK)).to_bytes(4) + b"free" + MARK)  # a box that players pass over
            film.replace(part)
        finally:
            film.unlink(missing_ok=True)
    return count


def _write(film: Path, pictures: Iterable[Bytes], frame_rate: float) -> int:
    writer, count = cv2.VideoWriter(), 0
    try:
        for picture in pictures:
            size = (picture.shape[1], picture.shape[0])
            if not count and not writer.open(
                str(film), cv2.CAP_FFMPEG, cv2.VideoWriter.fourcc(*"vp09"), frame_rate, size
            ):
                raise OutputError(film, "", "a video that cannot be opened", "a place that can be written")
            writer.write(picture)
            count += 1
    finally:
        writer.release()
    if not film.is_file() or not film.stat().st_size:
        raise OutputError(film, "", "an empty file after writing", "room on the disk")
    return count
