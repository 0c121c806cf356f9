"""Texts and attributes of HDF5 files from outside.

A text of any length is a reference of 16 bytes into a global heap, with the text's length. HDF5 takes memory for that
length, up to 4 GiB, before it looks into the heap; so memory is bounded while one is read.
"""

from __future__ import annotations

from typing import Any

import h5py

from stseg.arrays import AnyArray
from stseg.io.machine import bounded_growth

_GROWTH = 1 << 30
"""Bytes: texts have at most 2^24, and threads beside want some."""


def read_text(dataset: h5py.Dataset) -> str:
    """A single text, with bytes that are no UTF-8 escaped; ValueError where it is none."""
    with bounded_growth(_GROWTH):
        text = dataset.asstr(errors="surrogateescape")[()]
    if not isinstance(text, str):
        raise ValueError(f"{dataset.name}: no text")
    return text


def read_texts(dataset: h5py.Dataset) -> AnyArray:
    """Texts, str objects in the dataset's shape; raises what h5py raises where it holds others."""
    with bounded_growth(_GROWTH):
        return dataset.asstr()[()]  # type: ignore[no-any-return]


def read_attribute(owner: h5py.Group | h5py.Dataset, key: str) -> Any:
    """An attribute as h5py gives it; KeyError where there is none."""
    with bounded_growth(_GROWTH):
        return owner.attrs[key]
