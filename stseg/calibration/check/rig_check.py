"""Check of a rig against the boxes of its recording, the verdict as text, and the coverage of its views."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stseg.arrays import Floats, even_rows
from stseg.bodies.pillars import BodyTable
from stseg.calibration.check.blunders import (
    BoxesByFrame,
    StreamDelay,
    find_stream_delay,
    find_swapped_streams,
    match_frames,
    without_delay,
)
from stseg.calibration.check.box_correspondence import BoxCorrespondences, tables_of, wholly_visible
from stseg.calibration.check.verdict import MIN_PEOPLE, Disagreement, Verdict, judge
from stseg.geometry import Rig

_MAX_FRAMES = 80
"""Greatest number of frames in use, evenly spread."""
_MAX_DELAY = 1.0
"""Largest stream delay that is tested, seconds."""
_LOST_CONFIRMATION = 0.6
"""Share of the median confirmation rate below which a view counts as lost."""


@dataclass(frozen=True)
class Check:
    """Result of a rig check."""

    verdict: Verdict
    """Disagreement of each view with the others."""
    confirmed: tuple[float, ...]
    """tuple of float: share of the people inside each view's image (by the others) that it has a box of; nan where
    there are few."""
    lost: tuple[int, ...]
    """tuple of int: views that confirm almost no person of the others."""
    swapped: tuple[tuple[int, int], ...]
    """Two views with swapped streams; several pairs where the frames fit alike with each of them swapped."""
    delays: tuple[StreamDelay, ...]
    """Delayed streams; the verdict holds with their delays undone."""
    people: int
    """Number of people (a person in a frame counts once) that two views or more show."""

    @property
    def sound(self) -> bool:
        """Whether no fault was found."""
        return not (self.verdict.named or self.verdict.unresolved or self.lost or self.swapped or self.delays)


def check_rig(rig: Rig, boxes_by_frame: BoxesByFrame) -> Check:
    """Compare each view with the others by the boxes of every view in consecutive frames (`isolated_boxes`)."""
    tables, frames = tables_of(rig), sorted(boxes_by_frame)
    frames = [frames[k] for k in even_rows(len(frames), _MAX_FRAMES)]
    people = match_frames(rig, tables, boxes_by_frame, frames)
    share = confirmations(tables, people)
    if swapped := find_swapped_streams(rig, boxes_by_frame):
        return Check(Verdict((None,) * len(tables), (), None), tuple(share.tolist()), (), swapped, (), len(people))
    lost: tuple[int, ...] = ()
    if np.isfinite(share).sum() > 1:
        lost = tuple(np.flatnonzero(share < _LOST_CONFIRMATION * np.nanmedian(share)).tolist())
    verdict = judge(rig, tables, people)
    shifted: list[StreamDelay] = []
    most = max(1, round(_MAX_DELAY * rig.frame_rate))
    while (
        len(shifted) < len(tables) // 2 and (one := find_stream_delay(tables, boxes_by_frame, people, most)) is not None
    ):
        shifted.append(one)
        boxes_by_frame = without_delay(boxes_by_frame, one, len(tables))
        people = match_frames(rig, tables, boxes_by_frame, frames)
    if shifted:
        verdict, share = judge(rig, tables, people), confirmations(tables, people)
    return Check(verdict, tuple(share.tolist()), lost, (), tuple(shifted), len(people))


def confirmations(tables: Sequence[BodyTable], people: BoxCorrespondences) -> Floats:
    """Confirmation rate of each view: share of people seen by two others that it shows; nan where there are few."""
    share = np.full(len(tables), np.nan)
    for view, table in enumerate(tables):
        inside = wholly_visible(table, people.ground, people.height)
        others = np.delete(people.has_box, view, axis=1).sum(axis=1) >= min(2, len(tables) - 1)
        if (inside & others).sum() >= MIN_PEOPLE:
            share[view] = people.has_box[inside & others, view].mean()
    return share


def verdict_text(rig: Rig, check: Check) -> list[str]:
    """The verdict as sentences; the first says whether the rig is sound."""
    names = [camera.name for camera in rig.cameras]
    sentences = []
    if check.swapped:
        sentences.append(swapped_text(rig, check.swapped))
    for one in check.delays:
        side = "late" if one.frames > 0 else "early"
        sentences.append(
            f"{names[one.view]} runs {abs(one.frames)} frames {side}: add {-one.frames} to its offset in the rig file"
        )
    sentences += [disagreement_text(names[one.view], one) for one in check.verdict.named if one.view not in check.lost]
    for view in check.lost:
        usual = 100 * float(np.nanmedian(check.confirmed))
        sentences.append(
            f"{names[view]} shows only {100 * check.confirmed[view]:.0f} % of the people that others see within its "
            f"image (usual: {usual:.0f} %): it is off by more than half a metre, blind, or not this camera's stream"
        )
    if check.verdict.unresolved is not None:
        first_view, second_view = check.verdict.unresolved
        sentences.append(
            f"{names[first_view.view]} and {names[second_view.view]} disagree by {100 * first_view.off:.0f} cm: two "
            "views alone do not tell which of them is off"
        )
    if not sentences and any(check.verdict.views):
        sentences.append(_agreement_text(rig, check.verdict))
    silent = [name for name, one in zip(names, check.verdict.views, strict=True) if one is None]
    if silent and not check.swapped:
        sentences.append(f"too few people stand alone before {', '.join(silent)} to judge (fewer than {MIN_PEOPLE})")
    return sentences


def _agreement_text(rig: Rig, verdict: Verdict) -> str:
    """Sentence on views of which none is named."""
    judged = [one for one in verdict.views if one is not None]
    worst, doubtful = max(judged, key=lambda one: one.off), max(judged, key=lambda one: one.error)
    cell = f"a cell ({100 * rig.grid.cell:.0f} cm)"
    if doubtful.error > rig.grid.cell:
        may = f"{rig.cameras[doubtful.view].name} may be by {100 * doubtful.error:.0f} cm"
        return f"no view is certainly off by more than {cell}, but by so few people {may}: check more --frames"
    most = f"{rig.cameras[worst.view].name} most, by {100 * worst.off:.0f} cm"
    if worst.off <= rig.grid.cell:
        return f"the views agree: none is off by more than {cell}; {most}"
    least = f"certainly by {100 * worst.certainly_off:.0f} cm"
    return f"no view is certainly off by more than {cell}; {most}, {least}: check more --frames"


def swapped_text(rig: Rig, swapped: Sequence[tuple[int, int]]) -> str:
    """Sentence on pairs of views of which one has swapped streams."""
    pairs = ", or ".join(" and ".join(rig.cameras[view].name for view in pair) for pair in swapped)
    return f"{pairs} seem to be swapped: their frames fit far better the other way round"


def disagreement_text(name: str, one: Disagreement) -> str:
    """Sentence on a displaced view."""
    feet = f"feet {100 * one.feet:.0f} cm ({one.pixels:.0f} px, {100 * one.ground:.0f} cm on the ground)"
    ways = []
    if abs(one.right) > 0.03:
        ways.append(f"{100 * abs(one.right):.0f} cm to the {'right' if one.right > 0 else 'left'}")
    if abs(one.down) > 0.03:
        ways.append(f"{100 * abs(one.down):.0f} cm {'down' if one.down > 0 else 'up'}")
    where = f", on the whole {' and '.join(ways)}" if ways else ", in different directions (turned?)"
    return (
        f"{name} is off: of {one.people} people it shows {feet} and heads {100 * one.heads:.0f} cm "
        f"from where the others say{where}"
    )
