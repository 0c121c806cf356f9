"""Writing of video files."""

import os
from collections.abc import Iterable
from pathlib import Path

import cv2

from stseg.arrays import Bytes
from stseg.errors import OutputError
from stseg.io.outputs.whole_files import MARK, replacing
from stseg.io.untrusted.values import require_utf8

_FORMATS = {
    ".webm": (".mkv", "VP80", bytes([0xEC, 0x80 | len(MARK)])),
    ".mp4": (".mp4", "vp09", (8 + len(MARK)).to_bytes(4) + b"free"),
}
"""Container, codec, and head of a part that players pass over, by a film's ending: VP9, all that OpenCV has for MP4 and
browsers, takes four times the time of VP8. WebM is Matroska by another name, in which OpenCV knows VP8."""


def require_film_name(path: Path) -> None:
    """Refuse a name without the ending of a video that is written here; raises OutputError."""
    if path.suffix.lower() not in _FORMATS:
        raise OutputError(path, "", f"the ending {path.suffix!r}", f"a name that ends in {' or '.join(_FORMATS)}")


def write_film(path: Path, pictures: Iterable[Bytes], frame_rate: float, overwrite: bool) -> int:
    """Write pictures as a film that browsers play, whole or not at all; their number. Raises OutputError.

    The pictures are one or more, uint8 (v, u, 3), blue, green, red, all of one size; the path ends in .webm or .mp4. An
    older file is replaced where `overwrite` says so.
    """
    require_film_name(path)
    require_utf8(path, "a video")
    container, codec, passed_over = _FORMATS[path.suffix.lower()]
    with replacing(path, overwrite) as part:
        film = part.with_name(part.name + container)  # the ending decides the container
        try:
            count = _write(film, pictures, frame_rate, codec)
            with film.open("r+b") as file:
                head = file.read(64).replace(b"matroska", b"webm\0\0\0\0")
                file.seek(0)
                file.write(head)
                file.seek(0, os.SEEK_END)
                file.write(passed_over + MARK)
            film.replace(part)
        finally:
            film.unlink(missing_ok=True)
    return count


def _write(film: Path, pictures: Iterable[Bytes], frame_rate: float, codec: str) -> int:
    writer, count = cv2.VideoWriter(), 0
    try:
        for picture in pictures:
            size = (picture.shape[1], picture.shape[0])
            if not count and not writer.open(
                str(film), cv2.CAP_FFMPEG, cv2.VideoWriter.fourcc(*codec), frame_rate, size
            ):
                raise OutputError(film, "", "a video that cannot be opened", "a place that can be written")
            writer.write(picture)
            count += 1
    finally:
        writer.release()
    if not film.is_file() or not film.stat().st_size:
        raise OutputError(film, "", "an empty file after writing", "room on the disk")
    return count
