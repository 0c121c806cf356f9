"""Boxes in place of videos that name a detector: made once, before a run or by `stseg detect`."""

from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import replace
from pathlib import Path

from stseg.engine.reporter import Reporter
from stseg.errors import SourceError
from stseg.io.detectors.detected_boxes import DetectedBoxes, detect_frames, make_detector, request_of
from stseg.io.outputs.whole_files import make_folder
from stseg.io.recording.aligned_stream import index_streams
from stseg.io.recording.recording import CameraSource, ClockSource, Recording, Source


def with_boxes(recording: Recording, folder: Path, reporter: Reporter, overwrite: bool = False) -> Recording:
    """The recording with boxes in place of each source that names a detector, and its frames as images beside them.

    Boxes that are in the folder already are used; the frames are searched for the others.

    Parameters
    ----------
    recording
        The rig and its streams.
    folder
        Folder of the boxes, one file a camera.
    reporter
        Receives progress.
    overwrite
        Whether boxes of another detector or video may be replaced.

    Raises
    ------
    InputError
        Where a detector is none, a video cannot be read, or the folder holds other boxes.
    """
    sources = {k: feed.source for k, feed in enumerate(recording.sources) if feed.source.detector is not None}
    if not sources:
        return recording
    boxes = {k: _boxes(recording, k, source, folder, overwrite) for k, source in sources.items()}
    missing = [k for k, one in boxes.items() if not one.state.whole]
    if missing:
        _detect(recording, {k: boxes[k] for k in missing}, folder, reporter)
    feeds = [_with_boxes(feed, boxes[k]) if k in boxes else feed for k, feed in enumerate(recording.sources)]
    return replace(recording, sources=tuple(feeds))


def _boxes(recording: Recording, k: int, source: Source, folder: Path, overwrite: bool) -> DetectedBoxes:
    try:
        request = request_of(source)
    except OSError as error:
        key = f"camera {recording.rig.cameras[k].name}, detector"
        raise SourceError(source.detector, key, error.strerror or error, "a model in ONNX, or hog") from error
    return DetectedBoxes(folder, recording.rig.cameras[k].name, request, overwrite)


def _detect(recording: Recording, boxes: dict[int, DetectedBoxes], folder: Path, reporter: Reporter) -> None:
    """Search the videos of the cameras whose boxes are not whole."""
    for k in boxes:
        make_detector(recording.sources[k].source)  # refused before hours of work, and before anything is written
    make_folder(folder)
    with reporter.progress("counting", None):
        feeds = [replace(feed, source=feed.source.without_detector()) for feed in recording.sources]
        streams = index_streams(replace(recording, sources=tuple(feeds)))
    for note in streams.notes:
        reporter.note(note)
    frames = {k: sum(map(len, streams.times[k])) for k in boxes}
    done = sum(one.state.frames for one in boxes.values())
    with reporter.progress("detecting", sum(frames.values()), done) as advance, _kept(boxes, reporter):
        for k, one in boxes.items():
            by_stamps = streams.frame_at_tick[k] is not None
            with closing(one.begin(by_stamps)):
                detect_frames(recording.sources[k].source, recording.rig.cameras[k], one, advance)


@contextmanager
def _kept(boxes: dict[int, DetectedBoxes], reporter: Reporter) -> Iterator[None]:
    """On an error, note what is kept."""
    try:
        yield
    except BaseException:
        if frames := sum(one.state.frames for one in boxes.values()):
            folder = next(iter(boxes.values())).path.parent
            reporter.note(f"the boxes of {frames} frames are kept in {folder}; the same command goes on from there")
        raise


def _with_boxes(feed: CameraSource, boxes: DetectedBoxes) -> CameraSource:
    """A camera with boxes in place of its video, which are placed in time as that was."""
    source = Source("boxes", boxes.path, frames=boxes.state.frames)
    clock: ClockSource = "stamps" if boxes.state.by_stamps else "count"
    return replace(feed, source=source, images=feed.source.without_detector(), background=None, clock=clock)
