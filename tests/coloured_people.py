"""People in clothes of plain colours before the four cameras of the room, for trackers by colour."""

from collections.abc import Sequence

import numpy as np
from scenes import found, mask, people, room

from stseg.arrays import Bytes, Floats, Rows
from stseg.geometry import Camera
from stseg.records.sparse_volume import SparseVolume
from stseg.trackers import Commit, FrameObservations, FusedFrame, TrackingMethod

RIG = room()
SHIRTS = ((40, 40, 200), (200, 60, 40), (50, 170, 60), (180, 170, 40))
"""BGR of the clothes of four people."""
FLOOR = (120, 128, 134)


def painted(camera: Camera, standing: Floats) -> Bytes:
    """A camera's image of people, the nearest in front."""
    image = np.full((camera.size[1], camera.size[0], 3), FLOOR, np.uint8)
    away = np.hypot(*(standing[:, :2] - camera.centre[:2]).T)
    for k in np.argsort(-away):
        image[mask(camera, standing[k : k + 1]) > 127] = SHIRTS[k]
    return image


def observations_of(standing: Floats) -> FrameObservations:
    """Images of all cameras, and perfect foreground."""
    likelihood = [(mask(camera, standing) / np.float32(255)).astype(np.float32) for camera in RIG.cameras]
    return FrameObservations([painted(camera, standing) for camera in RIG.cameras], likelihood)


def frame_of(frame: int, standing: Floats) -> FusedFrame:
    """A frame in which the pass finds these people."""
    volume = SparseVolume.whole(np.full(RIG.grid.shape, -3.0, np.float32))
    return FusedFrame(frame, found(standing), found(people()), volume)


def follow(
    tracker: TrackingMethod, frames: int, walks: Sequence[tuple[float, float, float, float]], found_until: int = 1000
) -> list[Commit]:
    """People who walk from x, y by a step a frame; after `found_until` frames the pass finds nobody."""
    commits: list[Commit] = []
    for frame in range(frames):
        standing = people(*((x + frame * dx, y + frame * dy) for x, y, dx, dy in walks))
        tracker.predict(frame)
        commits += tracker.add(
            frame_of(frame, standing if frame < found_until else people()), observations_of(standing)
        )
    return commits


def rows_of(commits: Sequence[Commit]) -> Rows:
    return np.concatenate([commit.trajectory for commit in commits])
