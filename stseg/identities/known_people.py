"""What a run tells of its people to later ones: means of height and colours of each."""

from __future__ import annotations

import numpy as np

from stseg.arrays import AnyArray, Floats, Ints, Rows
from stseg.identities.evidence.appearance_model import row_means
from stseg.records.tables import KNOWN


def known_people(committed: Rows, appearance: Rows) -> Rows:
    """Means over the rows of every person, KNOWN (k,), by rising id.

    Colours are without the offsets of the cameras. Features of a detector are left out: they lie along axes of their
    recording.

    Parameters
    ----------
    committed : TRAJECTORY (n,)
        Rows as a tracker committed them, under final ids; 0 for none.
    appearance : APPEARANCE (l,)
        Of detections.
    """
    people = np.unique(committed["id"][committed["id"] > 0])
    owner = np.where(committed["id"] > 0, np.searchsorted(people, committed["id"]), -1)
    known = np.zeros(len(people), KNOWN)
    known["id"] = people
    known["height"], known["heights"] = _means(committed["height"][:, None], owner, len(people), 0)
    known["colours"], known["looks"] = _means(row_means(committed, appearance, "colours"), owner, len(people))
    return known


def _means(value: AnyArray, owner: Ints, people: int, column: int | None = None) -> tuple[Floats, Ints]:
    """Mean of the finite rows of value (n, k) of each person, float64 (people, k), nan without, and their numbers."""
    rows = np.flatnonzero(np.isfinite(value).all(axis=1) & (owner >= 0))
    number = np.bincount(owner[rows], minlength=people)
    sums = np.zeros((people, value.shape[1]))
    np.add.at(sums, owner[rows], value[rows])
    mean = np.where(number[:, None] > 0, sums / np.maximum(number, 1)[:, None], np.nan)
    return (mean if column is None else mean[:, column]), number
