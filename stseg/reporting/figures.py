"""The report's figures, for the page and for files alike."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from stseg.arrays import AnyArray, Boxes, Bytes, Labels, Observation, Rows
from stseg.geometry import Camera, Rig
from stseg.reporting.pictures.overlay import overlay
from stseg.reporting.pictures.plan import plan_view
from stseg.reporting.pictures.slices import marginal_picture, volume_picture
from stseg.reporting.pictures.spacetime import spacetime_picture

TRAIL = 5.0
"""Length of a trail, seconds."""


_PLAN_SIZE = (900, 1000)
"""Width and height of the plan at most, pixels: as it is shown beside another picture, its labels can be read."""


@dataclass(frozen=True)
class Figure:
    """A picture."""

    name: str
    """File name without the suffix."""
    picture: Bytes
    """uint8 (v, u, 3): blue, green, red."""
    caption: str


@dataclass(frozen=True)
class Instant:
    """Contents of one frame's figures."""

    frame: int
    log_odds: AnyArray
    """float (plane, y, x): nats; nan where no view sees the cell."""
    label: Labels
    """int32 (plane, y, x): track ids, 0 is background."""
    views: tuple[Observation, ...]
    """Observation of each camera, in the rig's order; None for no camera image."""


def ground_figures(
    rig: Rig, views: Bytes, trajectory: Rows, truth: Rows | None, names: Mapping[int, str]
) -> list[Figure]:
    """The plan view and the space-time picture.

    Parameters
    ----------
    rig
    views : uint8 (plane, y, x)
        Number of views that see each cell.
    trajectory : TRAJECTORY (n,)
    truth : (m,) with frame, id, x, y, or None
    names
        Of tracks, by id.
    """
    plan = plan_view(rig, trajectory, truth, views.max(axis=0), rig.name, *_PLAN_SIZE, names)
    thread = spacetime_picture(rig.grid, trajectory, rig.frame_rate, rig.name)
    return [
        Figure("plan", plan, "From above. The lighter the ground, the more views see what stands there."),
        Figure("spacetime", thread, "In space and time: the ground below, time upwards."),
    ]


def slice_figures(rig: Rig, instant: Instant) -> list[Figure]:
    """All planes of the volume of one frame, and the greatest of them over each ground cell."""
    title = f"Occupancy, frame {instant.frame}"
    planes = volume_picture(instant.log_odds, instant.label, rig.grid, title)
    greatest = marginal_picture(instant.log_odds, instant.label, rig.grid, title)
    outlines = "the tracks' cells are outlined."
    return [
        Figure("slices", planes, f"Frame {instant.frame}, plane by plane; {outlines}"),
        Figure("marginal", greatest, f"Frame {instant.frame}, the greatest log-odds over each ground cell; {outlines}"),
    ]


def camera_figures(rig: Rig, trajectory: Rows, instant: Instant) -> list[Figure]:
    """The people of one frame in every view."""
    figures = []
    trail = round(TRAIL * rig.frame_rate)
    for name, camera, view in zip(_file_names(rig.cameras), rig.cameras, instant.views, strict=True):
        picture = overlay(camera, rig.grid, backdrop(view, camera.size), trajectory, instant.frame, trail)
        figures.append(Figure(f"overlay_{name}", picture, f"{camera.name}, frame {instant.frame}"))
    return figures


def backdrop(view: Observation, size: tuple[int, int]) -> Bytes | None:
    """A camera's frame as `overlay` takes it: colour and masks as they are, instances and boxes as masks.

    Parameters
    ----------
    view
        Observation of the camera.
    size
        Width and height of its image, pixels.

    Returns
    -------
    uint8 (v, u, 3) or (v, u), or None
    """
    if view is None:
        return None
    if not isinstance(view, Boxes):
        return np.where(view > 0, 255, 0).astype(np.uint8) if view.dtype == np.uint16 else view.astype(np.uint8)
    mask = np.zeros(size[::-1], np.uint8)
    for left, top, width, height in view.pixel.tolist():
        u, v = np.clip(np.rint([left, left + width]), 0, size[0]), np.clip(np.rint([top, top + height]), 0, size[1])
        mask[int(v[0]) : int(v[1]), int(u[0]) : int(u[1])] = 255
    return mask


def _file_names(cameras: Sequence[Camera]) -> list[str]:
    """File names of the cameras, numbered where they would coincide."""
    plain = [re.sub(r"[^\w.-]+", "_", camera.name) for camera in cameras]
    return [name if plain.count(name) == 1 else f"{name}_{k}" for k, name in enumerate(plain)]
