"""`stseg detect`: boxes of people in the videos of a rig."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from stseg.commands.terminal.standard_error import TerminalReporter, warn
from stseg.errors import ConfigError
from stseg.io.detections.source_detections import read_source
from stseg.tasks import detection


def detect(
    rig: Path,
    /,
    *,
    output: Annotated[Path, Parameter(name=["-o", "--output"], metavar="FOLDER")],
    model: Annotated[str | None, Parameter(metavar="MODEL.onnx|hog")] = None,
    features: Annotated[Path | None, Parameter(metavar="MODEL.onnx")] = None,
    class_: Annotated[tuple[str, ...], Parameter(name="--class", negative="")] = (),
    score: float | None = None,
    overwrite: Annotated[bool, Parameter(negative="")] = False,
) -> None:
    """Find people in the videos of a rig file, and write their boxes and a rig file that uses them.

    Example: stseg detect room.toml --model yolo11n.onnx -o boxes/

    Then: stseg inspect boxes/room.toml -o pictures/, stseg run boxes/room.toml -o run.h5

    Models of the usual families are recognised by their outputs: YOLOv5 to YOLO11, YOLOX, RT-DETR. They are run by
    onnxruntime where it is installed (pip install 'stseg[onnx]'), else by OpenCV. Nothing is downloaded:
    docs/detections.md says where models come from. A command that was stopped or killed goes on when it is given again.

    Parameters
    ----------
    rig
        The rig file.
    output
        Folder for the boxes, FOLDER/CAMERA.csv, and the rig file.
    model
        A detector in ONNX; or hog, a detector of 2005 that needs no file and finds people who stand whole in view.
        Without it, the detectors that the rig file names, or hog.
    features
        A model in ONNX for re-identification, such as OSNet: the boxes get its appearance features, which tell people
        apart. They are FOLDER/CAMERA.features.npy.
    class_
        Name or number of a class to keep, by default person; may be given several times.
    score
        Least score of a box, 0..1; by default 0.25, and 0.3 with hog.
    overwrite
        Replace boxes of another model or video, and the rig file.
    """
    if score is not None and not 0 <= score <= 1:
        raise ConfigError("--score", "", f"{score:g}", "a number of 0..1")
    reporter = TerminalReporter()
    recording = detection.detect(
        rig, output, model=model, features=features, classes=class_, score=score, overwrite=overwrite, progress=reporter
    )
    boxes = 0
    for camera, feed in zip(recording.rig.cameras, recording.sources, strict=True):
        if feed.source.path.parent == recording.path.parent:
            found = read_source(feed.source, camera.size)
            boxes += len(found.kept)
            numbers = "" if found.kept.features is None else f", {found.kept.features.shape[1]} features each"
            print(f"{feed.source.path}: {len(found.kept)} boxes, {len(found.kept) / found.frames:.1f} a frame{numbers}")
    if not boxes:
        warn(["no box was found: are the model's outputs those of a detector, and --class and --score right?"])
    print(f"wrote {recording.path}; next: stseg run {recording.path} -o run.h5")
