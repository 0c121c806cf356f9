"""Principal axes of appearance features: the few numbers that tell most about the boxes of a recording."""

from collections.abc import Sequence

import numpy as np

from stseg.arrays import Floats, Singles


def principal_axes(features: Sequence[Singles], number: int) -> Floats:
    """Axes of the greatest variance within cameras (Pearson 1901), float64 (feature, number or less).

    `features` float32 (box, feature) are those of each camera; their means may differ. `number` is that of axes, at
    most.
    """
    scatter = np.zeros((features[0].shape[1],) * 2)
    for camera_features in features:
        centred = camera_features.astype(np.float64) - camera_features.mean(axis=0, dtype=np.float64)
        scatter += centred.T @ centred
    axes = np.linalg.eigh(scatter)[1][:, ::-1][:, :number]
    largest = np.abs(axes).argmax(axis=0)
    return np.asarray(axes * np.sign(axes[largest, np.arange(axes.shape[1])]))
