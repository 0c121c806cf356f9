"""Run files with corrected identities: a copy whose tables and labels have other ids."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Mapping
from pathlib import Path

import h5py
import numpy as np

from stseg.arrays import Ints, Rows
from stseg.io.outputs.whole_files import replacing
from stseg.io.runfile import layout
from stseg.model.tables import Tracks

NAMES = "names"
ANSWERS = "answers"
_FRAMES = 32

NewIds = Callable[[Ints, Ints], Ints]
"""Corrected ids of rows by id and frame; 0 where they are deleted."""


def write_corrected(
    run: Path, path: Path, new_ids: NewIds, names: Mapping[int, str], answers: str, overwrite: bool
) -> None:
    """Copy a run file with other ids; evidence (log_odds, ghosts, rates) is copied unchanged.

    Parameters
    ----------
    run, path
        The run file, and the one to write.
    new_ids
    names
        Names by corrected id, kept in the provenance.
    answers
        Text of the answers, kept in the provenance.
    overwrite
        Whether an older file may be replaced.

    Raises
    ------
    OutputError
    """
    with replacing(path, overwrite) as part:
        shutil.copyfile(run, part)
        with h5py.File(part, "r+") as file:
            trajectory = _renamed(file["trajectory"][:], new_ids)
            trajectory = trajectory[np.lexsort((trajectory["id"], trajectory["frame"]))]
            _replace(file, "trajectory", trajectory)
            _replace(file, "tracks", Tracks(trajectory).summary())
            _replace(file, "boxes", _renamed(file["boxes"][:], new_ids))
            events = _renamed(file["events"][:], new_ids)
            events["other"] = new_ids(events["other"], events["frame"])
            _replace(file, "events", events)
            _relabel(file[layout.OCCUPANCY], new_ids)
            _note(file[layout.PROVENANCE], names, answers)


def _renamed(rows: Rows, new_ids: NewIds) -> Rows:
    rows["id"] = new_ids(rows["id"], rows["frame"])
    return np.asarray(rows[rows["id"] > 0])


def _replace(file: h5py.File, name: str, rows: Rows) -> None:
    dataset = file[name]
    dataset.resize((len(rows),))
    dataset[:] = rows


def _relabel(group: h5py.Group, new_ids: NewIds) -> None:
    frames = group["frame"][:]
    for start in range(0, len(frames), _FRAMES):
        label = group["label"][start : start + _FRAMES]
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
    rows = [f"{identity},{own}" for identity, own in sorted(names.items())]
    group.create_dataset(NAMES, data=rows, dtype=text, shape=(len(rows),))
    group.create_dataset(ANSWERS, data=answers, dtype=text)
