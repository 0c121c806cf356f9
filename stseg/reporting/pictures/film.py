"""Pictures of a film: all views with pillars and ids, and the plan beside them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stseg.arrays import Bytes, Observation, Rows
from stseg.geometry import Rig
from stseg.reporting.charts import clock_time
from stseg.reporting.figures import TRAIL, backdrop
from stseg.reporting.pictures.canvas import blank, chip, chip_size, disc, fading_stroke, place_labels, text
from stseg.reporting.pictures.colours import NIGHT, PAPER, QUIET, track_colour
from stseg.reporting.pictures.overlay import OverlayView, overlay
from stseg.reporting.pictures.plan import ground_sheet, plan_map

_MAX_VIEW_WIDTH, _MAX_WIDTH = 960, 1280  # width of a view, and of all views side by side, pixels
_MIN_HEIGHT = 720  # of the film, pixels


class RunFilm:
    """A film's pictures, all of one size.

    Parameters
    ----------
    rig
    views : uint8 (plane, y, x)
        Number of views that see each cell.
    trajectory : TRAJECTORY (n,)
    """

    def __init__(self, rig: Rig, views: Bytes, trajectory: Rows) -> None:
        self._rig = rig
        self._rows = trajectory[np.argsort(trajectory["frame"], kind="stable")]
        self._trail = round(TRAIL * rig.frame_rate)
        count = len(rig.cameras)
        self._columns = int(np.ceil(np.sqrt(count)))
        self._wide = min(_MAX_VIEW_WIDTH, _MAX_WIDTH // self._columns)
        self._tall = max(OverlayView(camera, self._wide).size[1] for camera in rig.cameras)
        rows = -(-count // self._columns)
        height = max(rows * self._tall, _MIN_HEIGHT)
        self._plan = plan_map(rig, height, height)
        self._ground = ground_sheet(self._plan, rig, views.max(axis=0), rig.name)
        wide, tall = self._columns * self._wide + self._plan.size[0], max(height, self._plan.size[1])
        self.size = (wide + wide % 2, tall + tall % 2)
        """Width and height, pixels; both even, as video wants them."""

    def picture(self, frame: int, views: Sequence[Observation]) -> Bytes:
        """One frame.

        Parameters
        ----------
        frame
        views
            Observation of each camera, in the rig's order; None shows the ruled ground instead.

        Returns
        -------
        uint8 (v, u, 3)
            Blue, green, red.
        """
        first, stop = np.searchsorted(self._rows["frame"], [frame - self._trail, frame + 1])
        recent = self._rows[first:stop]
        canvas = blank(*self.size, NIGHT)
        for k, (camera, view) in enumerate(zip(self._rig.cameras, views, strict=True)):
            picture = overlay(
                camera, self._rig.grid, backdrop(view, camera.size), recent, frame, self._trail, width=self._wide
            )
            v, u = (k // self._columns) * self._tall, (k % self._columns) * self._wide
            canvas[v : v + picture.shape[0], u : u + picture.shape[1]] = picture
        left = self._columns * self._wide
        canvas[:, left:] = PAPER
        plan = self._plan_of(frame, recent)
        canvas[: plan.shape[0], left : left + plan.shape[1]] = plan
        return canvas

    def _plan_of(self, frame: int, recent: Rows) -> Bytes:
        canvas, plan = self._ground.copy(), self._plan
        present = recent[recent["frame"] == frame]
        places = plan.pixel(np.stack([present["x"], present["y"]], -1))
        for row, place in zip(present, places, strict=True):
            path = recent[recent["id"] == row["id"]]
            opacity = 1 - 0.85 * (frame - path["frame"][:-1]) / max(self._trail, 1)
            colour = track_colour(int(row["id"]))
            fading_stroke(canvas, plan.pixel(np.stack([path["x"], path["y"]], -1)), colour, 3, opacity)
            disc(canvas, place, 8, PAPER)
            disc(canvas, place, 6.5, colour)
        words = [str(int(row["id"])) for row in present]
        sizes = [chip_size(word, 13) for word in words]
        centres = place_labels(places, sizes, (*plan.corner, *plan.far_corner), 14)
        for row, word, (u, v) in zip(present, words, centres.tolist(), strict=True):
            chip(canvas, word, (u, v), track_colour(int(row["id"])), 13)
        clock = f"{clock_time(frame / self._rig.frame_rate)}, frame {frame}"
        text(canvas, clock, (plan.corner[0], plan.size[1] - 38), QUIET, 16, (0, 0.5))
        return canvas
