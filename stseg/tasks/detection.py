"""`stseg.detect`: boxes of people in the videos of a recording, and a rig file that uses them."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from stseg.engine.offline.detector_sources import with_boxes
from stseg.engine.recordings import recording_of
from stseg.engine.reporter import AnyReporter, reporter_of
from stseg.errors import SourceError
from stseg.io.outputs.whole_files import Inputs, require_output
from stseg.io.recording.recording import HOG, CameraSource, Recording
from stseg.io.recording.rigs import read_recording, write_rig
from stseg.io.recording.source_files import recording_files


def detect(
    rig: Path | str | Recording,
    folder: Path | str,
    *,
    model: Path | str | None = None,
    features: Path | str | None = None,
    classes: Sequence[str] = (),
    score: float | None = None,
    overwrite: bool = False,
    progress: AnyReporter = None,
) -> Recording:
    """Find people in the videos of a recording, as `stseg detect` does.

    Parameters
    ----------
    rig
        The rig file, or a recording.
    folder
        Folder of the boxes, CAMERA.csv, and of a rig file that uses them.
    model
        A detector in ONNX, or "hog"; None for the detectors that the rig names, and "hog" where it names none.
    features
        A model in ONNX for appearance features of the boxes; None for those that the rig names.
    classes
        Names or numbers of the classes to keep; none for people.
    score
        Boxes of a lower score are left out; None for the detector's default.
    overwrite
        Whether boxes of another model or video, and the rig file, may be replaced.
    progress
        As of `stseg.track`.

    Returns
    -------
    Recording
        The recording of the rig file that was written.

    Raises
    ------
    InputError
        Where no camera delivers colour, a video cannot be read, or a model is none whose outputs are known.
    """
    recording, place = recording_of(rig), Path(folder)
    output = place / recording.path.name
    if place.exists():
        require_output(output, overwrite, Inputs(recording_files(recording)))
    chosen = None if model is None else HOG if str(model) == str(HOG) else Path(model)
    described = None if features is None else Path(features)
    sources = tuple(_with_detector(feed, chosen, described, tuple(classes), score) for feed in recording.sources)
    if all(feed.source.detector is None for feed in sources):
        kinds = ", ".join(dict.fromkeys(feed.source.kind for feed in sources))
        raise SourceError(recording.path, "camera, source", f"{kinds} alone", "a camera that delivers video or images")
    found = with_boxes(replace(recording, sources=sources), place, reporter_of(progress), overwrite)
    write_rig(output, replace(found, path=output), overwrite)
    return read_recording(output)


def _with_detector(
    feed: CameraSource, model: Path | None, features: Path | None, classes: tuple[str, ...], score: float | None
) -> CameraSource:
    """A camera that delivers colour with the models that are asked for; any other unchanged."""
    source = feed.source
    if source.kind not in ("video", "images") or source.address:
        return feed
    least = source.least_score if score is None else score
    detector, features = model or source.detector or HOG, features or source.features
    chosen = replace(source, detector=detector, features=features, least_score=least)
    return replace(feed, source=replace(chosen, classes=classes or source.classes))
