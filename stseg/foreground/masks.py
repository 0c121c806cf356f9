"""Masks of an external segmenter as likelihood maps."""

from __future__ import annotations

import numpy as np

from stseg.arrays import Bytes, Singles
from stseg.errors import SourceError

_LIKELIHOOD = np.arange(256, dtype=np.float32) / np.float32(255)


def mask_likelihood(mask: Bytes) -> Singles:
    """Foreground likelihood of a mask image.

    Parameters
    ----------
    mask : uint8 (v, u)
        0..255: certainly background to certainly foreground.

    Returns
    -------
    float32 (v, u)
        mask / 255. The fusion accounts for the segmenter's error rates.

    Raises
    ------
    SourceError
        Where it is not a grey image.
    """
    if mask.ndim != 2 or mask.dtype != np.uint8:
        raise SourceError("mask", "", f"{mask.dtype} {mask.shape}", "uint8 (v, u)")
    return np.asarray(_LIKELIHOOD[mask])
