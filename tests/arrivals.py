"""A small recording that arrives: what a recorder's folder and live cameras show of three walkers, piece by piece."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from threading import Thread

import numpy as np
from films import write_at_rate
from recordings import PLACES, filmed_rig
from scenes import mask, standing_at, walkers

from stseg.arrays import AnyArray, Bytes
from stseg.geometry import Rig
from stseg.io.recording.recording import CameraSource, Recording, Source
from stseg.io.recording.rig_text import format_rig

PIECE = 10
"""Frames of each of its files."""
FRAMES = 4 * PIECE


def films(rig: Rig, frames: int = FRAMES) -> list[list[Bytes]]:
    """What each camera shows: people in dark clothes before a bright, uneven wall, uint8 (v, u, 3) each."""
    truth = walkers(frames)
    shown = []
    for camera in rig.cameras:
        empty = empty_scene(camera.size)
        masks = [mask(camera, standing_at(truth, frame))[..., None] / 255 for frame in range(frames)]
        shown.append([np.rint(empty * (1 - own) + 40 * own).astype(np.uint8) for own in masks])
    return shown


def empty_scene(size: tuple[int, int]) -> Bytes:
    u, v = np.meshgrid(np.arange(size[0]), np.arange(size[1]))
    return np.stack([170 + 20 * np.sin(u / 9 + k) + 10 * np.cos(v / 7) for k in range(3)], -1).astype(np.uint8)


def write_pieces(folder: Path, *, empty: bool) -> Path:
    """The recording in pieces below `folder`/pieces, to arrive in `folder`/in; its rig file."""
    rig, pieces = filmed_rig(), folder / "pieces"
    pieces.mkdir()
    (folder / "in").mkdir()
    for camera, film in zip(rig.cameras, films(rig), strict=True):
        write_at_rate(folder / f"{camera.name}_empty.avi", [empty_scene(camera.size)] * 4)
        for k in range(0, FRAMES, PIECE):
            write_at_rate(pieces / f"{camera.name}_{k // PIECE + 1}.avi", film[k : k + PIECE])
    sources = tuple(
        CameraSource(
            Source("video", folder / "in" / f"{name}_*.avi"),
            Source("video", folder / f"{name}_empty.avi") if empty else None,
        )
        for name in PLACES
    )
    path = folder / "rig.toml"
    path.write_text(format_rig(Recording(path, rig, sources), path))
    return path


def arrive(folder: Path, *numbers: int, pause: float = 0.0) -> None:
    """Pieces of all cameras come into the folder, a pause apart, each first in half and then whole."""
    for number in numbers:
        time.sleep(pause)
        for name in PLACES:
            content = (folder / "pieces" / f"{name}_{number}.avi").read_bytes()
            with (folder / "in" / f"{name}_{number}.avi").open("wb", buffering=0) as file:
                file.write(content[: len(content) // 2])
                time.sleep(0.02)
                file.write(content[len(content) // 2 :])


def meanwhile(work: Callable[[], object]) -> Thread:
    """Something that goes on beside the test."""
    thread = Thread(target=work, daemon=True)
    thread.start()
    return thread


@dataclass
class _Shown:
    camera: "StandIn"
    left: int

    def read(self) -> AnyArray | None:
        camera = self.camera
        number = int((time.monotonic() - camera.begun) / camera.period) + 1
        time.sleep(max(0.0, camera.begun + number * camera.period - time.monotonic()))
        self.left -= 1
        return camera.pictures[number % len(camera.pictures)] if self.left >= 0 else None

    def close(self) -> None: ...


@dataclass
class StandIn:
    """A camera that can be opened like a live stream: it shows pictures by the clock, until it is told to break."""

    pictures: list[Bytes]
    """What it shows, over and over."""
    period: float
    """Seconds from one to the next."""
    breaks: list[int] = field(default_factory=list)
    """After how many pictures each of the streams that are opened breaks; the last one goes on."""
    refused: int = 0
    """How often it cannot be opened after a break."""
    opened: list[float] = field(default_factory=list)
    """When it was opened or refused."""
    begun: float = field(default_factory=time.monotonic)
    """When it showed the first, by time.monotonic."""

    def open(self, address: str, silence: float) -> _Shown:
        """As `FFmpegCapture`."""
        del address, silence
        self.opened.append(time.monotonic())
        if len(self.opened) > 1 and self.refused:
            self.refused -= 1
            raise OSError("nobody is there")
        return _Shown(self, self.breaks.pop(0) if self.breaks else 1 << 60)
