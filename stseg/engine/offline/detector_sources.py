"""Boxes in place of videos that name a detector: made once, before a run or by `stseg detect`."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from stseg.engine.reporter import Reporter
from stseg.errors import SourceError
from stseg.io.detections.source_detections import read_source
from stseg.io.detectors.detected_boxes import describe_frames, detect_frames, feature_request, make_detector, request_of
from stseg.io.detectors.feature_model import FeatureModel
from stseg.io.detectors.kept_file import KeptFile
from stseg.io.outputs.whole_files import make_folder
from stseg.io.recording.aligned_stream import index_streams
from stseg.io.recording.recording import CameraSource, ClockSource, Recording, Source

Files = dict[int, KeptFile]
"""Files of cameras by the cameras' numbers."""
Pass = Callable[[int, KeptFile, Callable[[int], None]], None]
"""Fills the file of a camera, and tells each number of further frames."""


def with_boxes(recording: Recording, folder: Path, reporter: Reporter, overwrite: bool = False) -> Recording:
    """The recording with boxes in place of each source that names a detector, and its frames as images beside them.

    Boxes and features that are in the folder already are used, those of another model or video only replaced by
    `overwrite`; the frames are searched for the others. The folder has a file of each for a camera.

    Raises
    ------
    InputError
        Where a model is none, a video cannot be read, or the folder holds other boxes.
    """
    boxes, features = Files(), Files()
    for k, (camera, feed) in enumerate(zip(recording.rig.cameras, recording.sources, strict=True)):
        source, name = feed.source, camera.name
        try:
            if source.detector is not None:
                boxes[k] = KeptFile(folder / f"{name}.csv", request_of(source), overwrite)
            if source.features is not None:
                features[k] = KeptFile(folder / f"{name}.features.npy", feature_request(source), overwrite)
        except OSError as error:
            key, model = ("features", source.features) if k in boxes else ("detector", source.detector)
            found = error.strerror or error
            raise SourceError(model, f"camera {name}, {key}", found, "a model in ONNX") from error
    if any(not one.state.whole for one in (*boxes.values(), *features.values())):
        _make_missing(recording, boxes, features, folder, reporter)
    feeds = list(recording.sources)
    for k, one in boxes.items():
        feeds[k] = _with_boxes(feeds[k], one, features.get(k))
    return replace(recording, sources=tuple(feeds))


def _make_missing(recording: Recording, boxes: Files, features: Files, folder: Path, reporter: Reporter) -> None:
    """Search the videos of cameras whose boxes are not whole, and describe the boxes whose features are not."""
    missing_boxes, missing_features = (
        {k: one for k, one in files.items() if not one.state.whole} for files in (boxes, features)
    )
    cameras, sources = recording.rig.cameras, [feed.source for feed in recording.sources]
    for k in missing_boxes:
        make_detector(sources[k])  # refused before hours of work, and before anything is written
    for path in {path for k in missing_features if (path := sources[k].features) is not None}:
        FeatureModel(path)
    make_folder(folder)
    with reporter.progress("counting", None):
        feeds = [replace(feed, source=feed.source.without_detector()) for feed in recording.sources]
        streams = index_streams(replace(recording, sources=tuple(feeds)))
    for note in streams.notes:
        reporter.note(note)
    frames = [sum(map(len, times)) for times in streams.times]

    def detect(k: int, file: KeptFile, advance: Callable[[int], None]) -> None:
        detect_frames(sources[k], cameras[k], file, streams.frame_at_tick[k] is not None, advance)

    def describe(k: int, file: KeptFile, advance: Callable[[int], None]) -> None:
        found = read_source(_with_boxes(recording.sources[k], boxes[k]).source, cameras[k].size).table
        describe_frames(sources[k], cameras[k], found, file, advance)

    _fill(missing_boxes, frames, detect, "detecting", reporter)
    _fill(missing_features, frames, describe, "describing", reporter)


def _fill(files: Files, frames: list[int], one_pass: Pass, task: str, reporter: Reporter) -> None:
    """Fill the files of cameras with that many frames; on an error, note what is kept."""
    if not files:
        return
    done = sum(file.state.frames for file in files.values())
    try:
        with reporter.progress(task, sum(frames[k] for k in files), done) as advance:
            for k, file in files.items():
                one_pass(k, file, advance)
    except BaseException:
        if kept := sum(file.state.frames for file in files.values()):
            folder, noun = next(iter(files.values())).path.parent, "boxes" if task == "detecting" else "features"
            reporter.note(f"the {noun} of {kept} frames are kept in {folder}; the same command goes on from there")
        raise


def _with_boxes(feed: CameraSource, boxes: KeptFile, features: KeptFile | None = None) -> CameraSource:
    """A camera with boxes in place of its video, which are placed in time as that was."""
    appearance = None if features is None else features.path
    source = Source("boxes", boxes.path, frames=boxes.state.frames, appearance=appearance)
    clock: ClockSource = "stamps" if boxes.state.by_stamps else "count"
    return replace(feed, source=source, images=feed.source.without_detector(), background=None, clock=clock)
