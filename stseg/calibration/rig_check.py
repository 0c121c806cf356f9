"""What a recording says of its rig, in words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stseg.calibration.blunders import Late, Shown, all_bystanders, exchanged, in_time, late
from stseg.calibration.box_correspondence import Bystanders, tables_of, whole_in
from stseg.calibration.verdict import LEAST, Disagreement, Verdict, judge
from stseg.geometry import Rig
from stseg.geometry.bodies import BodyTable

_MOST = 80
"""Frames that are looked at, evenly spread over those that are given."""
_LATE = 1.0
"""Seconds by which a stream may be late."""
_FAR = 1.5
"""Cells from which on a view is so far off that another's stream is tried in its place."""
_LOST = 0.6
"""Share of what is usual that a view must confirm not to be lost."""


@dataclass(frozen=True)
class Check:
    """What was found.

    Attributes
    ----------
    verdict
        How each view stands to the others.
    confirmed : tuple of float
        Share of the people within each view's image, by the others, whom it shows; nan where too few are known.
    lost : tuple of int
        Views that show nearly nobody where the others do.
    swapped
        Two views whose streams are exchanged.
    late
        Views that are not of the time of the others; the verdict is that of their frames brought back to their time.
    people
        Number of people (a person in a frame counts once) whom two views or more show.
    """

    verdict: Verdict
    confirmed: tuple[float, ...]
    lost: tuple[int, ...]
    swapped: tuple[int, int] | None
    late: tuple[Late, ...]
    people: int

    @property
    def sound(self) -> bool:
        """Nothing is to be complained of."""
        return not (self.verdict.named or self.verdict.quarrel or self.lost or self.swapped or self.late)


def check_rig(rig: Rig, shown: Shown) -> Check:
    """Hold each view against the others.

    Parameters
    ----------
    rig
    shown
        Boxes of every view in consecutive frames, see `sightings`.
    """
    tables, frames = tables_of(rig), spread(sorted(shown))
    people = all_bystanders(rig, tables, shown, frames)
    share = confirmations(tables, people)
    lost = tuple(int(view) for view in np.flatnonzero(share < _LOST * np.nanmedian(share))) if _known(share) else ()
    verdict = judge(rig, tables, people)
    far = any(one.off > _FAR * rig.grid.cell for one in verdict.named)
    swapped = exchanged(rig, tables, shown, frames, people) if lost or far or not _known(share) else None
    if swapped is not None:
        return Check(Verdict((None,) * len(tables), (), None), tuple(share.tolist()), (), swapped, (), len(people))
    shifted: list[Late] = []
    most = max(1, round(_LATE * rig.frame_rate))
    while len(shifted) < len(tables) // 2 and (one := late(tables, shown, people, most)) is not None:
        shifted.append(one)
        shown = in_time(shown, one, len(tables))
        people = all_bystanders(rig, tables, shown, frames)
    if shifted:
        verdict, share = judge(rig, tables, people), confirmations(tables, people)
    return Check(verdict, tuple(share.tolist()), lost, None, tuple(shifted), len(people))


def spread(frames: Sequence[int]) -> list[int]:
    """At most `_MOST` of the frames, evenly spread."""
    if len(frames) <= _MOST:
        return list(frames)
    return [frames[k] for k in np.rint(np.linspace(0, len(frames) - 1, _MOST)).astype(int)]


def confirmations(tables: Sequence[BodyTable], people: Bystanders) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    """Share of the people within each view's image whom it shows, of those whom two others show; nan where few."""
    share = np.full(len(tables), np.nan)
    for view, table in enumerate(tables):
        inside = whole_in(table, people.ground, people.height)
        others = np.delete(people.seen, view, axis=1).sum(axis=1) >= min(2, len(tables) - 1)
        if (inside & others).sum() >= LEAST:
            share[view] = people.seen[inside & others, view].mean()
    return share


def _known(share: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> bool:
    return bool(np.isfinite(share).sum() > 1)


def in_words(rig: Rig, check: Check) -> list[str]:
    """The verdict, a sentence each; the first says whether all is well."""
    names = [camera.name for camera in rig.cameras]
    words = []
    if check.swapped is not None:
        pair = " and ".join(names[view] for view in check.swapped)
        words.append(f"{pair} seem to be swapped: their frames fit far better the other way round")
    for one in check.late:
        side = "late" if one.frames > 0 else "early"
        words.append(
            f"{names[one.view]} runs {abs(one.frames)} frames {side}: add {-one.frames} to its offset in the rig file"
        )
    words += [off_in_words(names[one.view], one) for one in check.verdict.named if one.view not in check.lost]
    for view in check.lost:
        if check.swapped is None:
            usual = 100 * float(np.nanmedian(check.confirmed))
            words.append(
                f"{names[view]} shows only {100 * check.confirmed[view]:.0f} % of the people whom others see within "
                f"its image (usual: {usual:.0f} %): it is off by more than half a metre, blind, or not this camera's "
                "stream"
            )
    if check.verdict.quarrel is not None:
        first_view, second_view = check.verdict.quarrel
        words.append(
            f"{names[first_view.view]} and {names[second_view.view]} disagree by {100 * first_view.off:.0f} cm: two "
            "views alone do not tell which of them is off"
        )
    silent = [name for name, one in zip(names, check.verdict.views, strict=True) if one is None]
    if silent and check.swapped is None:
        words.append(f"too few people stand alone before {', '.join(silent)} to judge (fewer than {LEAST})")
    if not words:
        worst = max((one for one in check.verdict.views if one is not None), key=lambda one: one.off)
        words.append(
            f"the views agree: none is off by more than a cell ({100 * rig.grid.cell:.0f} cm); "
            f"{names[worst.view]} most, by {100 * worst.off:.0f} cm"
        )
    return words


def off_in_words(name: str, one: Disagreement) -> str:
    """Of a view that is named."""
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
