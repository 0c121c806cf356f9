"""Volumes of frames as a run file packs them: copied from file to file without being unpacked."""

from __future__ import annotations

from typing import NamedTuple


class PackedFrame(NamedTuple):
    """The log-odds of one frame, packed.

    Attributes
    ----------
    filters
        HDF5's mask of the filters that were left out.
    data
        The bytes of the chunk.
    """

    filters: int
    data: bytes
