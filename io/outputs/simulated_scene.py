"""A simulated scene as a folder of files: rigs, films, masks, boxes and truth, written frame by frame.

rig.toml  rig_masks.toml  rig_boxes.toml  [rig_instances.toml]    one rig file for each kind of foreground
truth.csv                                                         frame,id,x,y,height of the people in the area
cam1.avi  cam1_empty.avi                                          films in colour (Motion JPEG)
cam1_masks.avi                                                    silhouettes, 0..255 (FFV1: lossless)
cam1_boxes.csv                                                    simulated detections
cam1_instances/000000.png                                         ids, 16 bits, optional

A scene that has but some kinds of foreground leaves out the files of the others.
"""

import os
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from pathlib import Path
from typing import IO

os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")

import cv2
import numpy as np

from stseg.arrays import Bytes
from stseg.errors import OutputError
from stseg.geometry import Camera
from stseg.io.outputs.whole_files import clear_frames, marked_png, require_empty
from stseg.io.recording.recording import BodyPrior, CameraSource, Recording, Source, SourceKind
from stseg.io.recording.rigs import write_rig
from stseg.io.untrusted.bounded_files import is_regular
from stseg.io.untrusted.values import require_utf8
from stseg.simulation.film import SceneFilm
from stseg.simulation.rendering.render import RenderedView

_ANYBODY = BodyPrior()
_SCENE = "stseg-scene"
"""Name of the empty file by which the folder of a scene is known."""


def write_scene(
    folder: Path,
    scene: SceneFilm,
    *,
    body: BodyPrior = _ANYBODY,
    instances: bool = False,
    overwrite: bool = False,
    frame_done: Callable[[], object] = lambda: None,
) -> None:
    """Film a scene into a folder, which is made if it does not exist.

    `body` is what the rig files say of the bodies. With `instances` there are instance images, too, one file a camera
    and frame; with `overwrite` the folder need not be empty, and files of an older scene are replaced. `frame_done`
    is called after each frame. OutputError where the folder holds something already, or cannot be written to.
    """
    require_utf8(folder, "a video")
    require_empty(folder, overwrite)
    with _as_output_error(folder):
        folder.mkdir(parents=True, exist_ok=True)
        if not is_regular(folder / _SCENE):
            for path in _outputs(folder, scene):
                if os.path.lexists(path):
                    raise OutputError(path, "", "a file that stseg did not make", "another folder, or none of its name")
            (folder / _SCENE).touch()
        if links := [path.name for path in folder.iterdir() if path.is_symlink()]:
            raise OutputError(folder, "", f"{links[0]}, a link", "no links, which would be written through")
        if "video" in scene.spec.kinds:
            _write_empty(folder, scene)
        with ExitStack() as open_files:
            truth = open_files.enter_context((folder / "truth.csv").open("w", encoding="utf-8"))
            truth.write("frame,id,x,y,height\n")
            films = [
                open_files.enter_context(_CameraFiles(folder, camera, scene, instances)) for camera in scene.rig.cameras
            ]
            for frame_set in scene.frame_sets():
                np.savetxt(truth, frame_set.truth, fmt="%d,%d,%.4f,%.4f,%.3f")
                for film, view in zip(films, frame_set.views, strict=True):
                    film.write(frame_set.frame, view)
                frame_done()
    # Last: a rig file promises that its sources exist.
    _write_rigs(folder, scene, body, instances)


class _Video:
    """A video file being written; failures that OpenCV ignores raise OutputError."""

    def __init__(self, path: Path, camera: Camera, rate: float, quality: int | None) -> None:
        self._path, (width, height) = path, camera.size
        # OpenCV's own encoder has a quality, FFmpeg's has none; FFmpeg has a lossless one.
        if quality is not None:
            code, backend = cv2.VideoWriter.fourcc(*"MJPG"), cv2.CAP_OPENCV_MJPEG
        else:
            code, backend = cv2.VideoWriter.fourcc(*"FFV1"), cv2.CAP_FFMPEG
        self._writer = cv2.VideoWriter(str(path), backend, code, rate, (width, height), quality is not None)
        if not self._writer.isOpened():
            raise OutputError(path, f"camera {camera.name}", "a video that cannot be opened", "a place to write to")
        if quality is not None:
            self._writer.set(cv2.VIDEOWRITER_PROP_QUALITY, quality)

    def write(self, picture: Bytes) -> None:
        self._writer.write(picture)

    def close(self) -> None:
        self._writer.release()
        if not self._path.is_file() or not self._path.stat().st_size:
            raise OutputError(self._path, "", "an empty file after writing", "room on the disk")


class _CameraFiles(AbstractContextManager["_CameraFiles"]):
    """The output files of one camera."""

    def __init__(self, folder: Path, camera: Camera, scene: SceneFilm, instances: bool) -> None:
        rate, paths = scene.rig.frame_rate, _paths(folder, camera)
        self._instances: Path | None = paths["instances"] if instances else None
        if self._instances is not None:
            clear_frames(self._instances)
        with ExitStack() as stack:
            self._boxes: IO[str] = stack.enter_context(paths["boxes"].open("w", encoding="utf-8"))
            self._videos = dict[str, _Video]()
            for kind in ("video", "masks"):
                if kind in scene.spec.kinds:
                    quality = scene.spec.quality if kind == "video" else None
                    self._videos[kind] = _Video(paths[kind], camera, rate, quality)
                    stack.callback(self._videos[kind].close)
            self._boxes.write("frame,left,top,width,height,score\n")
            self._stack = stack.pop_all()

    def write(self, frame: int, view: RenderedView) -> None:
        """Write one frame."""
        for kind, video in self._videos.items():
            video.write(view.image if kind == "video" else view.mask)
        rows = np.column_stack([np.full(len(view.boxes), frame), view.boxes.pixel, view.boxes.score])
        np.savetxt(self._boxes, rows, fmt="%d,%.1f,%.1f,%.1f,%.1f,%.3f")
        if self._instances is not None:
            _, png = cv2.imencode(".png", view.instances)
            (self._instances / f"{frame:06d}.png").write_bytes(marked_png(png.tobytes()))

    def __exit__(self, *reason: object) -> None:
        self._stack.close()


def _write_empty(folder: Path, scene: SceneFilm) -> None:
    """Films of the scene without people."""
    with ExitStack() as stack:
        videos = []
        for camera in scene.rig.cameras:
            videos.append(_Video(_paths(folder, camera)["empty"], camera, scene.rig.frame_rate, scene.spec.quality))
            stack.callback(videos[-1].close)
        for images in scene.empty():
            for video, image in zip(videos, images, strict=True):
                video.write(image)


def _write_rigs(folder: Path, scene: SceneFilm, body: BodyPrior, instances: bool) -> None:
    kinds: tuple[SourceKind, ...] = (*scene.spec.kinds, *(("instances",) if instances else ()))
    for kind in kinds:
        path = folder / rig_name(kind)
        sources = tuple(_source(folder, camera, kind, scene.spec.frames) for camera in scene.rig.cameras)
        write_rig(path, Recording(path, scene.rig, sources, body), overwrite=True)


def rig_name(kind: SourceKind) -> str:
    """Name of the rig file of one kind of foreground."""
    return "rig.toml" if kind == "video" else f"rig_{kind}.toml"


def _outputs(folder: Path, scene: SceneFilm) -> Iterator[Path]:
    """Every file and folder that a scene may write."""
    yield folder / "truth.csv"
    kinds: tuple[SourceKind, ...] = (*scene.spec.kinds, "instances")
    yield from (folder / rig_name(kind) for kind in kinds)
    for camera in scene.rig.cameras:
        yield from _paths(folder, camera).values()


def _source(folder: Path, camera: Camera, kind: SourceKind, frames: int) -> CameraSource:
    paths = _paths(folder, camera)
    source = Source(kind, paths[kind], frames=frames if kind == "boxes" else None)
    return CameraSource(source, Source("video", paths["empty"]) if kind == "video" else None)


def _paths(folder: Path, camera: Camera) -> dict[str, Path]:
    names = {
        "video": f"{camera.name}.avi",
        "empty": f"{camera.name}_empty.avi",
        "masks": f"{camera.name}_masks.avi",
        "boxes": f"{camera.name}_boxes.csv",
        "instances": f"{camera.name}_instances",
    }
    return {kind: folder / name for kind, name in names.items()}


@contextmanager
def _as_output_error(folder: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise OutputError(error.filename or folder, "", error.strerror or error, "a place to write to") from error
