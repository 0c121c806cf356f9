"""The axes along which the appearance features of a recording's boxes are reduced to a few numbers."""

from __future__ import annotations

import numpy as np

from stseg.arrays import Floats, Singles
from stseg.errors import FormatError
from stseg.io.detections.source_detections import read_source
from stseg.io.recording.recording import Recording
from stseg.records.principal_axes import principal_axes
from stseg.records.tables import FEATURES

_BOXES = 20_000
"""Most boxes of a camera from which axes are learned."""


def appearance_axes(recording: Recording) -> Floats | None:
    """Principal axes of all cameras' features, float64 (feature, FEATURES or less); None where boxes have none.

    Raises
    ------
    SourceError, FormatError
        Where a file cannot be read, or cameras have features of different lengths.
    """
    samples = list[Singles]()
    for camera, feed in zip(recording.rig.cameras, recording.sources, strict=True):
        if feed.source.appearance is None:
            continue
        features = read_source(feed.source, camera.size).kept.features
        if features is None or not len(features):
            continue
        if samples and features.shape[1] != samples[0].shape[1]:
            found, expected = f"{features.shape[1]} numbers a box", f"{samples[0].shape[1]}, as of the cameras before"
            raise FormatError(feed.source.appearance, "", found, expected)
        step = -(-len(features) // _BOXES)
        samples.append(np.asarray(features[::step]))
    return principal_axes(samples, FEATURES) if samples else None
