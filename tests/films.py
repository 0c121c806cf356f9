"""Videos of three people as cameras deliver them: at any times, with time stamps, in one file or several."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal, Self

import cv2
import numpy as np
from scenes import FRAME_RATE, corner_cameras, mask, rig_of, three_people

from stseg.arrays import Bytes, Floats
from stseg.geometry import Camera
from stseg.io.recording.recording import CameraSource, ClockSource, Recording, Source
from stseg.io.recording.rig_text import format_rig

TICK = 1.0 / FRAME_RATE


def standing(seconds: float) -> Floats:
    """x, y, height of three people who walk to and fro, metres, float64 (3, 3)."""
    return np.asarray(three_people(np.array([1.0 - abs(1.0 - seconds / 6 % 2)]))[0])


def regular(frames: int) -> Floats:
    """When a camera at the rig's rate takes its frames, seconds."""
    return np.asarray(np.arange(frames) * TICK)


@dataclass(frozen=True)
class Film:
    """Recording of one camera."""

    seconds: Floats
    """When it takes its frames, float64 (n,)."""
    files: tuple[int, ...] = ()
    """How many frames each of its files has; one with all of them where nothing is said."""
    suffix: str = ".mkv"
    """Of its files: .mkv holds a stamp for each frame, .avi a rate for all."""
    starts: tuple[float, ...] = ()
    """When each of them starts, seconds after the first."""
    source: CameraSource = field(default_factory=lambda: CameraSource(Source("masks", Path())))
    """Further keys of the rig file."""

    def with_source(self, offset: int = 0, blind: bool = False, clock: ClockSource = "auto") -> Self:
        """The same, with keys of its source in the rig file."""
        missing: Literal["blind", "error"] = "blind" if blind else "error"
        return replace(self, source=CameraSource(Source("masks", Path()), None, offset, missing, clock))


def write_films(folder: Path, films: Sequence[Film]) -> Path:
    """Masks that four cameras record, in a folder that need not exist; the rig file."""
    folder.mkdir(exist_ok=True)
    rig = rig_of(corner_cameras()[: len(films)])
    sources = []
    for camera, film in zip(rig.cameras, films, strict=True):
        paths, begin = [], 0
        for k, length in enumerate(film.files or (len(film.seconds),)):
            paths.append(folder / f"{camera.name}_{k}{film.suffix}")
            _write(paths[-1], camera, film.seconds[begin : begin + length])
            begin += length
        source = Source("masks", paths[0], more=tuple(paths[1:]), starts=film.starts)
        sources.append(replace(film.source, source=source))
    path = folder / "rig.toml"
    path.write_text(format_rig(Recording(path, rig, tuple(sources)), path))
    return path


def write_stamped(path: Path, pictures: Sequence[Bytes], seconds: Sequence[float]) -> None:
    """A video of pictures uint8 (v, u, 3) with these time stamps, kept in milliseconds."""
    plain = path.with_suffix(".plain.avi")
    write_at_rate(plain, pictures)
    size, codec = pictures[0].shape[1::-1], cv2.VideoWriter.fourcc(*"MJPG")
    raw = [cv2.VIDEOWRITER_PROP_RAW_VIDEO, 1, cv2.VIDEOWRITER_PROP_KEY_INTERVAL, 1]
    packets = cv2.VideoCapture(str(plain), cv2.CAP_FFMPEG)
    packets.set(cv2.CAP_PROP_FORMAT, -1)
    writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, codec, 1000.0, size, raw)
    assert writer.isOpened()
    for time in seconds:
        whole, packet = packets.read()
        assert whole
        writer.set(cv2.VIDEOWRITER_PROP_PTS, round(1000 * time))
        writer.write(packet)
    writer.release()
    packets.release()
    plain.unlink()


def write_at_rate(path: Path, pictures: Sequence[Bytes], rate: float = FRAME_RATE, codec: str = "MJPG") -> Path:
    """A video of pictures uint8 (v, u, 3) at one rate, frames per second; its path."""
    writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, cv2.VideoWriter.fourcc(*codec), rate, pictures[0].shape[1::-1])
    assert writer.isOpened()
    for picture in pictures:
        writer.write(picture)
    writer.release()
    return path


def _write(path: Path, camera: Camera, seconds: Floats) -> None:
    pictures = [np.dstack([mask(camera, standing(time))] * 3) for time in seconds.tolist()]
    if path.suffix == ".avi":
        write_at_rate(path, pictures)
    else:
        write_stamped(path, pictures, (seconds - seconds[0]).tolist())
