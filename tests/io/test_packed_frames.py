"""Frames as a run file packs them."""

from __future__ import annotations

import zlib

import h5py
import numpy as np
import pytest

from stseg.io.runfile.packed_frames import PackedFrame, packed_frame, renamed_label, unpacked_label

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


@pytest.mark.parametrize("greatest", [1, 255, 70000])
def test_few_labels_are_renamed_as_they_are_packed(greatest: int) -> None:
    chosen = np.random.default_rng(greatest)
    few = chosen.integers(0, 256, SHAPE, np.int32)
    names = chosen.integers(0, greatest + 1, 256, np.int32)
    assert renamed_label(packed_frame(few), few.size, names) == packed_frame(names[few])


def test_labels_that_are_many_or_packed_otherwise_are_not_renamed_so(label: np.ndarray) -> None:
    names, few = np.zeros(256, np.int32), packed_frame(np.ones(SHAPE, np.int32)).data
    broken = [packed_frame(label), PackedFrame(1, few), PackedFrame(0, few[:-6]), PackedFrame(0, few[5:])]
    assert [renamed_label(one, label.size, names) for one in broken] == [None] * 4


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
