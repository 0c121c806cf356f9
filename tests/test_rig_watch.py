"""A run holds its views against each other and says which one is off, and from when on."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scenes import box_moments, corner_cameras, rig_of, walkers

from stseg.arrays import Boxes
from stseg.commands.rig_watch import WARNING, RigWatch, told
from stseg.geometry import Camera, Rig
from stseg.identity.segments import Segment
from stseg.tracks import EVENT

FRAMES = 40


def watched(rig: Rig, shown_by: Sequence[Camera]) -> list[str]:
    """What a segment under a rig says when its boxes come from these cameras."""
    watch = RigWatch(rig, Segment(1, 90, 100, 100 + FRAMES))
    for moment in box_moments(rig_of(shown_by), walkers(FRAMES), 0, FRAMES):
        watch.witness(100 + moment.frame, [view for view in moment.views if isinstance(view, Boxes)])
    events = watch.warnings()
    assert (events["kind"] == WARNING).all()
    assert (events["frame"] == 100).all()
    return told(events)


def moved(camera: Camera, metres: float) -> Camera:
    """A camera that is believed to stand where the ground is shifted."""
    shift = np.array([[1.0, 0.0, metres], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    return Camera(camera.name, camera.size, camera.ground @ shift, camera.vertical)


def test_views_that_agree_are_not_spoken_of() -> None:
    cameras = corner_cameras()
    assert watched(rig_of(cameras, 0.1), cameras) == []


def test_the_view_that_is_off_is_named_with_the_frame() -> None:
    cameras = corner_cameras()
    rig = rig_of([*cameras[:2], moved(cameras[2], 0.5), cameras[3]], 0.1)
    (warning,) = watched(rig, cameras)
    assert warning.startswith("from frame 100 on: corner2 is off: feet ")


def test_each_view_is_told_once() -> None:
    rows = [(0, WARNING, 0, 0, b"west is off: a"), (50, WARNING, 0, 0, b"west is off: b"), (60, b"birth", 1, 0, b"x"),
            (70, WARNING, 0, 0, b"east is off: c")]  # fmt: skip
    said = told(np.array(rows, EVENT))
    assert said == ["from frame 0 on: west is off: a", "from frame 70 on: east is off: c"]


def test_few_people_say_nothing() -> None:
    cameras = corner_cameras()
    watch = RigWatch(rig_of(cameras), Segment(0, 0, 0, 5))
    assert len(watch.warnings()) == 0
