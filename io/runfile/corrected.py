"""Run files with corrected identities: a copy whose tables and labels have other ids."""

import shutil
from collections.abc import Callable, Mapping
from pathlib import Path

import h5py
import numpy as np

from stseg.arrays import Ints, Rows
from stseg.errors import FormatError
from stseg.io.outputs.whole_files import replacing
from stseg.io.runfile import layout
from stseg.io.untrusted import limits
from stseg.io.untrusted.safe_hdf5 import hdf5_file
from stseg.records.tables import Tracks

NAMES = "names"
ANSWERS = "answers"
_FRAMES = 32

NewIds = Callable[[Ints, Ints], Ints]
"""Corrected ids of rows by id and frame; 0 where they are deleted."""


def write_corrected(
    run: Path,
    path: Path,
    tracks: Tracks,
    answers: Rows,
    new_ids: NewIds,
    names: Mapping[int, str],
    text: str,
    overwrite: bool,
) -> None:
    """Copy a run file to a path with other tracks; evidence (log_odds, ghosts, rates) is copied unchanged.

    `answers` are the ANSWER rows (n,) so far, `new_ids` gives the ids of the labels. The provenance keeps `names` by
    corrected id and the text of the answers. OutputError where it cannot be written; FormatError where a table cannot
    be resized, or labels are no ids.
    """
    with replacing(path, overwrite) as part:
        shutil.copyfile(run, part)
        with hdf5_file(part, "r+") as file:
            for name, rows in (
                ("trajectory", tracks.trajectory),
                ("tracks", tracks.summary()),
                ("boxes", tracks.boxes),
                ("events", tracks.events),
                ("answers", answers),
            ):
                _replace(run, file[name], rows)
            _relabel(run, file[layout.OCCUPANCY], new_ids)
            _note(file[layout.PROVENANCE], names, text)


def _replace(run: Path, dataset: h5py.Dataset, rows: Rows) -> None:
    if dataset.chunks is None or dataset.maxshape != (None,):
        raise FormatError(run, dataset.name, "a table of fixed size", "one that can grow, as stseg writes it")
    dataset.resize((len(rows),))
    dataset[:] = rows


def _relabel(run: Path, group: h5py.Group, new_ids: NewIds) -> None:
    frames = group["frame"][:]
    for start in range(0, len(frames), _FRAMES):
        label = group["label"][start : start + _FRAMES]
        if not 0 <= label.min(initial=0) <= label.max(initial=0) <= limits.FRAMES:
            raise FormatError(run, f"{layout.OCCUPANCY}/label", "labels that are no ids", f"0 to {limits.FRAMES}")
        for k, frame in enumerate(frames[start : start + _FRAMES].tolist()):
            old = np.unique(label[k][label[k] > 0]).astype(np.int64)
            new = new_ids(old, np.full(len(old), frame, np.int64))
            if (old != new).any():
                table = np.zeros(int(label[k].max()) + 1, label.dtype)
                table[old] = new
                group["label"][start + k] = table[label[k]]


def _note(group: h5py.Group, names: Mapping[int, str], answers: str) -> None:
    text = h5py.string_dtype()
    for name in (NAMES, ANSWERS):
        if name in group:
            del group[name]
    rows = [f"{identity},{name}" for identity, name in sorted(names.items())]
    group.create_dataset(NAMES, data=rows, dtype=text, shape=(len(rows),))
    group.create_dataset(ANSWERS, data=answers, dtype=text)
