"""Boxes of one camera as a detector finds them, and features of the people in them, as files that a rig names."""

import os
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from itertools import islice
from time import monotonic

import numpy as np

from stseg.arrays import Boxes, Bytes
from stseg.errors import ConfigError, FormatError
from stseg.geometry import Camera
from stseg.io.detections.record import Detections
from stseg.io.detectors.feature_model import FeatureModel
from stseg.io.detectors.hog import HogDetector
from stseg.io.detectors.kept_file import KeptFile
from stseg.io.detectors.networks import runtime
from stseg.io.detectors.people_detector import PERSON, OnnxDetector
from stseg.io.recording.recording import HOG, Source
from stseg.io.recording.streams import Stream, open_stream
from stseg.io.runfile.provenance import sampled_checksum
from stseg.io.runfile.unfinished.work_files import checksum
from stseg.io.untrusted import limits

HEADER = b"frame,left,top,width,height,score\n"
_KEPT_EVERY = 5.0
"""Time after which results are written to the disk, seconds."""
_PICTURES = 8
"""Pictures that are decoded before they are searched."""
_Result = Callable[[int, list[Bytes]], bytes]
"""Bytes to be kept of some pictures, of which the first one's frame is given."""


def make_detector(source: Source) -> OnnxDetector | HogDetector:
    """The detector that a source names; raises InputError where it is none, or has none of the classes."""
    assert source.detector is not None
    least = source.least_score or None
    if source.detector != HOG:
        return OnnxDetector(source.detector, source.classes or (PERSON,), least)
    if set(source.classes) - {PERSON}:
        raise ConfigError(str(HOG), "classes", ", ".join(source.classes), f"{PERSON}, which it finds alone")
    return HogDetector(least)


def request_of(source: Source) -> dict[str, str]:
    """Everything that determines a source's boxes; raises OSError where the model cannot be read."""
    assert source.detector is not None
    by_network = source.detector != HOG
    return {
        "detector": f"{source.detector.name} {checksum(source.detector)}" if by_network else str(HOG),
        "library": runtime() if by_network else HogDetector.runtime,
        "classes": ", ".join(source.classes),
        "score": repr(source.least_score),
        "video": f"{source.path.name} {sampled_checksum(source.without_detector())}",
    }


def feature_request(source: Source) -> dict[str, str]:
    """Everything that determines the features of a source's boxes; raises OSError where a model cannot be read."""
    assert source.features is not None
    return {"features": f"{source.features.name} {checksum(source.features)}, {runtime()}", **request_of(source)}


def detect_frames(
    source: Source, camera: Camera, boxes: KeptFile, by_stamps: bool, advance: Callable[[int], None]
) -> None:
    """Find people in all frames of a camera that are not done; raises InputError.

    Parameters
    ----------
    source, camera
        The video, with its detector.
    boxes
        Their file.
    by_stamps
        See `State`.
    advance
        Called with each number of further frames.
    """
    detector = make_detector(source)
    # A network takes all cores by itself.
    with ThreadPoolExecutor((os.cpu_count() or 1) if source.detector == HOG else 1) as pool:

        def lines(first: int, pictures: list[Bytes]) -> bytes:
            found = enumerate(pool.map(detector.detect, pictures), first)
            return "".join(line for frame, one in found for line in _lines(frame, one)).encode()

        with closing(boxes.begin(HEADER, by_stamps)):
            _each_frame(source, camera, boxes, lines, advance)


def describe_frames(
    source: Source, camera: Camera, boxes: Detections, features: KeptFile, advance: Callable[[int], None]
) -> None:
    """The same for the features of all boxes of a camera, which are in the order of their frames."""
    assert source.features is not None
    model = FeatureModel(source.features)
    shape = len(boxes), model.length
    if len(boxes) > (most := limits.FEATURES_FILE // (2 * model.length)):
        found = f"{len(boxes)} boxes, of {model.length} numbers each"
        raise FormatError(features.path, "", found, f"at most {most}: a greater least score, or shorter videos")

    def rows(first: int, pictures: list[Bytes]) -> bytes:
        found = [boxes.at(frame).pixel for frame in range(first, first + len(pictures))]
        return model.describe(pictures, found).astype("<f2").tobytes()

    header = f"{{'descr': '<f2', 'fortran_order': False, 'shape': {shape}, }}".ljust(117)  # as long for any shape
    with closing(features.begin(b"\x93NUMPY\1\0\x76\0" + header.encode() + b"\n", by_stamps=False)):
        _each_frame(source, camera, features, rows, advance)


def _each_frame(
    source: Source, camera: Camera, kept: KeptFile, result: _Result, advance: Callable[[int], None]
) -> None:
    with closing(open_stream(source.without_detector(), camera)) as stream:
        stream.skip(kept.state.frames)
        pictures, parts, frames, written = _pictures(stream), list[bytes](), 0, monotonic()
        while batch := list(islice(pictures, _PICTURES)):
            parts.append(result(kept.state.frames + frames, batch))
            frames += len(batch)
            advance(len(batch))
            if monotonic() - written > _KEPT_EVERY:
                kept.append(b"".join(parts), frames)
                parts, frames, written = [], 0, monotonic()
        kept.append(b"".join(parts), frames)
    kept.finish()


def _pictures(stream: Stream) -> Iterator[Bytes]:
    while (view := stream.read()) is not None:
        yield np.asarray(view, np.uint8)


def _lines(frame: int, boxes: Boxes) -> list[str]:
    rows = zip(boxes.pixel.tolist(), boxes.score.tolist(), strict=True)
    return [f"{frame},{','.join(f'{edge:.2f}' for edge in pixel)},{score:.4f}\n" for pixel, score in rows]
