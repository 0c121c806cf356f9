"""One target for each parser and reader: a folder with the file, and the call that reads it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from run_files import write_small_run

from fuzz import corpus
from stseg.errors import StsegError
from stseg.geometry import Camera
from stseg.io.calibrations.formats import FORMATS, ImportOptions, read_cameras
from stseg.io.calibrations.point_files import read_points
from stseg.io.config_file import read_config
from stseg.io.exports import formats as exports
from stseg.io.live.arriving_files import FileNotes
from stseg.io.live.live_table import LiveTable
from stseg.io.outputs.whole_files import replacing
from stseg.io.recording.pictures import read_picture
from stseg.io.recording.recording import Source, SourceKind
from stseg.io.recording.rigs import parse_rig, read_rig
from stseg.io.recording.streams import open_stream
from stseg.io.recording.video_stream import VideoStream
from stseg.io.runfile.runs import read_run
from stseg.io.runfile.work_folder import WorkFolder
from stseg.io.track_csv import read_tracks_csv

CAMERA = Camera("cam1", (64, 48), np.eye(3), np.array([0.0, 0.0, -1.0]))
OPTIONS = ImportOptions((64, 48), "m", 1.75)


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
    """

    name: str
    valid: Callable[[Path], bytes]
    read: Callable[[Path], object]

    @property
    def suffix(self) -> str:
        """Of its files."""
        return Path(self.name).suffix


def _plain(data: bytes | str) -> Callable[[Path], bytes]:
    whole = data.encode() if isinstance(data, str) else data
    return lambda _: whole


def _importer(format: str) -> Callable[[Path], object]:
    return lambda path: read_cameras(format, [path], OPTIONS)


def _frames(kind: SourceKind) -> Callable[[Path], object]:
    def read(path: Path) -> None:
        stream = open_stream(Source(kind, path), CAMERA)
        for _ in range(20):
            if stream.read() is None:
                break
        stream.close()

    return read


def _video(path: Path) -> None:
    stream = VideoStream(Source("video", path), CAMERA)
    stream.times()
    stream.close()
    _frames("video")(path)


def _run(path: Path) -> None:
    run = read_run(path)
    for table in ("tracks", "events", "ghosts", "windows", "rates", "shifts", "timings"):
        getattr(run, table)
    for frame in run.frames[:2].tolist():
        run.read_frame(frame)
    for to in ("csv", "jupedsim", "wildtrack", "mot-boxes", "geojson", "mf-json"):
        with replacing(path.with_name("out"), overwrite=True) as part:
            exports.write_tracks(to, part, run)


def _streams(path: Path) -> None:
    rig = path.with_name("rig.toml")
    rig.write_bytes(corpus.RIG)
    path.with_name("boxes.csv").write_bytes(corpus.BOXES)
    with WorkFolder(path.with_name("q.h5"), {}) as work:
        (work.path / "streams.npz").write_bytes(path.read_bytes())
        work.streams(read_rig(rig))


def _begun(path: Path) -> None:
    with WorkFolder(path.with_name("q.h5"), {"config": {"a": 1}, "rig": {"b": "c"}}) as work:
        (work.path / "begun.json").write_bytes(path.read_bytes())
    with WorkFolder(path.with_name("q.h5"), {"config": {"a": 1}, "rig": {"b": "c"}}):
        pass


def _live_table(path: Path) -> None:
    copy = path.with_name("live.csv")
    copy.write_bytes(path.read_bytes())
    with LiveTable(copy, 10.0, 5):
        pass


def _small_run(folder: Path) -> bytes:
    return write_small_run(folder / "small.h5").read_bytes()


TARGETS = (
    Target("rig.toml", _plain(corpus.RIG), lambda path: parse_rig(path.read_text("utf-8", "replace"), path)),
    Target("rig_file.toml", _plain(corpus.RIG), read_rig),
    Target("config.toml", _plain(corpus.CONFIG), read_config),
    Target("boxes.csv", _plain(corpus.BOXES), _frames("boxes")),
    Target("mot.txt", _plain(corpus.MOT), _frames("boxes")),
    Target("coco.json", _plain(corpus.COCO), _frames("boxes")),
    Target("coco_data.json", _plain(corpus.COCO_DATA), _frames("instances")),
    Target("cvat.xml", _plain(corpus.CVAT), _frames("instances")),
    Target("tracks.csv", _plain(corpus.TRACKS), read_tracks_csv),
    Target("points.csv", _plain(corpus.POINTS), read_points),
    Target("matrix.txt", _plain(corpus.NUMBERS), _importer("matrix")),
    Target("matrix.npy", lambda _: corpus.npy(), _importer("matrix")),
    Target("matrix.npz", lambda _: corpus.npz(), _importer("matrix")),
    Target("matrix.mat", lambda _: corpus.mat(), _importer("matrix")),
    Target("matrix_hdf5.mat", corpus.matlab_hdf5, _importer("matrix")),
    Target("opencv.xml", _plain(corpus.OPENCV), _importer("opencv")),
    Target("tsai.xml", _plain(corpus.TSAI), _importer("tsai")),
    Target("pom.txt", _plain(corpus.POM), _importer("pom")),
    Target("krt.json", _plain(corpus.KRT), _importer("krt")),
    Target("poses.toml", _plain(corpus.POSES), _importer("anipose")),
    Target("nvidia.json", _plain(corpus.NVIDIA), _importer("nvidia")),
    Target("kalibr.yaml", _plain(corpus.KALIBR), _importer("kalibr")),
    Target("run.h5", _small_run, _run),
    Target("streams.npz", lambda _: corpus.npz(), _streams),
    Target("begun.json", _plain(corpus.BEGUN), _begun),
    Target("files.json", _plain(corpus.NOTES), FileNotes),
    Target("live.table.csv", _plain(corpus.LIVE_TABLE), _live_table),
    Target("indexed.png", lambda _: corpus.png(True), lambda path: read_picture(path, "instances", (64, 48), "")),
    Target("grey.png", lambda _: corpus.png(False), lambda path: read_picture(path, "instances", (64, 48), "")),
    Target("mask.png", lambda _: corpus.png(True), lambda path: read_picture(path, "masks", (64, 48), "")),
    Target("mjpeg.avi", lambda folder: corpus.video(folder, ".avi", "MJPG"), _video),
    Target("mpeg4.mp4", lambda folder: corpus.video(folder, ".mp4", "mp4v"), _video),
)  # fmt: skip
"""All of them."""

assert {"opencv", "tsai", "pom", "krt", "anipose", "nvidia", "kalibr", "matrix"} <= set(FORMATS)


def answer(target: Target, path: Path) -> str:
    """What a target makes of a file: nothing, or its one line; anything else than StsegError is raised."""
    try:
        target.read(path)
    except StsegError as error:
        line = str(error)
        assert "\n" not in line.strip() or len(line) < 1000, line
        return line
    return ""


__all__ = ["TARGETS", "Target", "answer"]
