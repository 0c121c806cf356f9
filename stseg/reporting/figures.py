"""The report's figures, for the page and for files alike, and the pictures of a film."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from stseg.arrays import AnyArray, Boxes, Bytes, Labels, Observation, Rows, ground_of
from stseg.geometry import Rig
from stseg.reporting.charts import clock_time
from stseg.reporting.pictures.canvas import blank, chips, disc, fading_stroke, text
from stseg.reporting.pictures.colours import PAPER, QUIET, Picture, track_colour
from stseg.reporting.pictures.overlay import OverlayView, overlay
from stseg.reporting.pictures.plan import ground_sheet, plan_map, plan_view
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
    """The plan view and the space-time picture of TRAJECTORY (n,), and of a truth (m,) with frame, id, x, y.

    `views` uint8 (plane, y, x) counts the views that see each cell; `names` are of tracks, by id.
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
    figures, trail = [], round(TRAIL * rig.frame_rate)
    plain = [re.sub(r"[^\w.-]+", "_", camera.name) for camera in rig.cameras]
    # File names, numbered where they would coincide.
    names = [name if plain.count(name) == 1 else f"{name}_{k}" for k, name in enumerate(plain)]
    for name, camera, view in zip(names, rig.cameras, instant.views, strict=True):
        picture = overlay(camera, rig.grid, backdrop(view, camera.size), trajectory, instant.frame, trail)
        figures.append(Figure(f"overlay_{name}", picture, f"{camera.name}, frame {instant.frame}"))
    return figures


def backdrop(view: Observation, size: tuple[int, int]) -> Bytes | None:
    """A camera's frame as `overlay` takes it, uint8 (v, u, 3) or (v, u): instances and boxes as masks.

    `size` is width and height of its image, pixels.
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


_MAX_VIEW_WIDTH, _MAX_WIDTH = 960, 1280  # width of a view, and of all views side by side, pixels
_MIN_HEIGHT = 720  # of the film, pixels
_SCREEN_SHAPE = 16 / 9  # width by height: the plan is beside the views or below, where a screen shows the film larger


class RunFilm:
    """A film's pictures, all of one size, of TRAJECTORY (n,); `views` uint8 (plane, y, x) see each cell."""

    def __init__(self, rig: Rig, views: Bytes, trajectory: Rows) -> None:
        self._rig = rig
        self._rows = trajectory[np.argsort(trajectory["frame"], kind="stable")]
        self._trail = round(TRAIL * rig.frame_rate)
        count = len(rig.cameras)
        self._columns = int(np.ceil(np.sqrt(count)))
        self._wide = min(_MAX_VIEW_WIDTH, _MAX_WIDTH // self._columns)
        self._tall = max(OverlayView(camera, self._wide).size[1] for camera in rig.cameras)
        rows = -(-count // self._columns)
        views_size = self._columns * self._wide, rows * self._tall
        side, foot = plan_map(rig, _MIN_HEIGHT, max(views_size[1], _MIN_HEIGHT), 0), plan_map(rig, *views_size, 0)
        width = max(views_size[0] + side.size[0], _SCREEN_SHAPE * max(views_size[1], side.size[1]))
        is_below = max(views_size[0], _SCREEN_SHAPE * (views_size[1] + foot.size[1])) < width
        self._plan = foot if is_below else side
        self._corner = (views_size[0] - foot.size[0]) // 2 if is_below else views_size[0], views_size[1] * is_below
        self._ground, _ = ground_sheet(self._plan, rig, views.max(axis=0), rig.name)
        ends = np.add(self._corner, self._plan.size)
        wide, tall = np.maximum(views_size, ends).tolist()
        self.size = (wide + wide % 2, tall + tall % 2)
        """Width and height, pixels; both even, as video wants them."""
        self._sheet = blank(*self.size, PAPER)

    def picture(self, frame: int, views: Sequence[Observation]) -> Picture:
        """One frame with each camera's observation, in the rig's order; None shows the ruled ground instead."""
        first, stop = np.searchsorted(self._rows["frame"], [frame - self._trail, frame + 1])
        recent = self._rows[first:stop]
        canvas = self._sheet.copy()
        for k, (camera, view) in enumerate(zip(self._rig.cameras, views, strict=True)):
            picture = overlay(
                camera, self._rig.grid, backdrop(view, camera.size), recent, frame, self._trail, width=self._wide
            )
            v, u = (k // self._columns) * self._tall, (k % self._columns) * self._wide
            canvas[v : v + picture.shape[0], u : u + picture.shape[1]] = picture
        (left, top), plan = self._corner, self._plan_of(frame, recent)
        canvas[top : top + plan.shape[0], left : left + plan.shape[1]] = plan
        return canvas

    def _plan_of(self, frame: int, recent: Rows) -> Bytes:
        canvas, plan = self._ground.copy(), self._plan
        present = recent[recent["frame"] == frame]
        places = plan.pixel(ground_of(present))
        for row, place in zip(present, places, strict=True):
            path = recent[recent["id"] == row["id"]]
            opacity = 1 - 0.85 * (frame - path["frame"][:-1]) / max(self._trail, 1)
            colour = track_colour(int(row["id"]))
            fading_stroke(canvas, plan.pixel(ground_of(path)), colour, opacity)
            disc(canvas, place, 8, PAPER)
            disc(canvas, place, 6.5, colour)
        ids = present["id"].tolist()
        chips(canvas, places, [*map(str, ids)], map(track_colour, ids), 13, (*plan.corner, *plan.far_corner), 14)
        clock = f"{clock_time(frame / self._rig.frame_rate)}, frame {frame}"
        text(canvas, clock, (plan.corner[0], plan.size[1] - 38), QUIET, 16, (0, 0.5))
        return canvas
