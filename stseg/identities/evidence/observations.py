"""Observations of the identity search: committed rows in the order of time, with what each says of its person."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from stseg.arrays import Flags, Floats, Ints, Rows
from stseg.config import Config
from stseg.identities.evidence.size_model import SizeModel
from stseg.noise.lasting_error import PLACE_ERROR
from stseg.records.border import Border
from stseg.tracking.row_groups import EXCHANGE_DISTANCE, near_rows


class ObservedRows(NamedTuple):
    """Rows of a run in the order of time, for kernels."""

    ground: Floats
    """float64 (n, 2): metres."""
    variance: Floats
    """float64 (n,): variance of each coordinate, square metres."""
    previous: Ints
    """int64 (n,): the observation before in the same filter track, -1 for none."""
    certain: Flags
    """bool (n,): whether the observation continues its filter track without doubt, far from all others."""
    inside: Floats
    """float64 (n,): how far inside the area: 0 at the border, 1 from `detection.border_width` on."""
    precision: Floats
    """float64 (n, size): inverse variance of each size."""
    information: Floats
    """float64 (n, size): the precision times the deviation of the size from the population's mean."""
    hash_number: Ints
    """int64 (n,): a number for each row, drawn at random, of 62 bits (Zobrist hashing)."""


@dataclass(frozen=True)
class Observations:
    """Rows of a run, frame by frame."""

    order: Ints
    """int64 (n,): index of each observation in the trajectory."""
    start: Ints
    """int64 (frame + 1,): first observation of each frame that has rows."""
    seconds: Floats
    """float64 (frame,)."""
    rows: ObservedRows
    """Their evidence."""

    @cached_property
    def number(self) -> Ints:
        """int64 (n,): the observation of each row of the trajectory."""
        return np.argsort(self.order)

    @cached_property
    def frame(self) -> Ints:
        """int64 (n,): index of the frame of each observation."""
        return np.repeat(np.arange(len(self.seconds)), np.diff(self.start))

    def at(self, chosen: Ints, left_out: Ints, stand_in: Ints) -> Observations:
        """Some of them alone, int64 (k,), rising; people of whom none was observed before are new there.

        The size evidence of those that are left out, int64 (m,), counts for chosen ones that stand in for each, (m,).
        """
        frames, start = np.unique(self.frame[chosen], return_index=True)
        place = np.full(len(self.order) + 1, -1)  # the last is that of no observation
        place[chosen] = np.arange(len(chosen))
        one, previous = self.rows, place[self.rows.previous[chosen]]
        precision, information = one.precision[chosen], one.information[chosen]
        np.add.at(precision, place[stand_in], one.precision[left_out])
        np.add.at(information, place[stand_in], one.information[left_out])
        certain, inside, numbers = one.certain[chosen] & (previous >= 0), one.inside[chosen], _hash_numbers(len(chosen))
        places = one.ground[chosen], one.variance[chosen], previous, certain, inside
        rows = ObservedRows(*places, precision, information, numbers)
        return Observations(self.order[chosen], np.append(start, len(chosen)), self.seconds[frames], rows)


def observe(
    trajectory: Rows, sizes: Sequence[Floats], model: SizeModel, frame_rate: float, border: Border, config: Config
) -> Observations:
    """Observations of a trajectory, TRAJECTORY (n,) in any order.

    `sizes`, float64 (n,) each, are those of each row, nan where unmeasured, `model` their noise and spread.
    `frame_rate` is in frames per second; people come and go at the border; `config` holds the constants of all stages.
    """
    order = np.lexsort((trajectory["id"], trajectory["frame"]))
    frame, track = trajectory["frame"][order], trajectory["id"][order]
    frames, start = np.unique(frame, return_index=True)
    ground = np.column_stack([trajectory["x"][order], trajectory["y"][order]])
    precision, information = model.evidence(sizes, order)
    alike = PLACE_ERROR.row_variance(frame_rate)
    variance = alike * (trajectory["xx"] + trajectory["yy"])[order] / 2
    previous, inside = _previous(frame, track), border.inside(ground, config.detection.border_width)
    alone = np.ones(len(order), bool)
    alone[near_rows(trajectory, EXCHANGE_DISTANCE)[0]] = False
    places = ground, variance, previous, _certain(frame, previous, alone[order]), inside
    observed = ObservedRows(*places, precision, information, _hash_numbers(len(order)))
    return Observations(order, np.append(start, len(order)), frames / frame_rate, observed)


def _hash_numbers(number: int) -> Ints:
    return np.random.default_rng(0).integers(1 << 61, size=number) * 2 + 1


def _previous(frame: Ints, track: Ints) -> Ints:
    by_track = np.lexsort((frame, track))
    previous = np.full(len(frame), -1)
    same = np.diff(track[by_track]) == 0
    previous[by_track[1:][same]] = by_track[:-1][same]
    return previous


def _certain(frame: Ints, previous: Ints, alone: Flags) -> Flags:
    """Rows that follow their track in the very next frame, far from all others in both."""
    follows = (previous >= 0) & (frame - frame[previous] == 1)
    return np.asarray(alone & alone[previous] & follows)
