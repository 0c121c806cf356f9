"""Frames as a run file packs them."""

from __future__ import annotations

import zlib

import h5py
import numpy as np
import pytest

from stseg.io.runfile.packed_frames import PackedFrame, packed_frame, unpacked_label

SHAPE = (3, 5, 7)


@pytest.fixture
def label() -> np.ndarray:
    """Labels of one frame, some of which need all four bytes."""
    chosen = np.random.default_rng(4)
    return np.where(chosen.random(SHAPE) < 0.2, chosen.integers(-(2**31), 2**31, SHAPE), 0).astype(np.int32)


def test_labels_come_back(label: np.ndarray) -> None:
    assert np.array_equal(unpacked_label(packed_frame(label), SHAPE), label)


def test_hdf5_unpacks_the_same(label: np.ndarray) -> None:
    with h5py.File("any.h5", "w", driver="core", backing_store=False) as file:
        dataset = file.create_dataset("label", SHAPE, np.int32, chunks=SHAPE, compression="gzip", shuffle=True)
        dataset.id.write_direct_chunk((0, 0, 0), packed_frame(label).data)
        assert np.array_equal(dataset[()], label)


@pytest.mark.parametrize("wrong", ["more", "fewer", "cut off", "no deflate", "not shuffled"])
def test_labels_that_were_packed_otherwise_are_refused(label: np.ndarray, wrong: str) -> None:
    packed = packed_frame(label).data
    frames = {
        "more": packed_frame(np.concatenate([label, label])),
        "fewer": packed_frame(label[:2]),
        "cut off": PackedFrame(0, packed[:-6]),
        "no deflate": PackedFrame(0, label.tobytes()),
        "not shuffled": PackedFrame(1, zlib.compress(label.tobytes())),
    }
    with pytest.raises(ValueError, match=r".+"):
        unpacked_label(frames[wrong], SHAPE)
