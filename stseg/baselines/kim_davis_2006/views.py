"""A camera of the particle filter: its raster, and eq. 1 of each person's parts (Kim and Davis 2006)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from stseg.arrays import Bytes, Floats, Ints, Labels, Singles
from stseg.baselines.colour_views import ColourView
from stseg.baselines.kim_davis_2006.appearance import PersonAppearance
from stseg.baselines.kim_davis_2006.axes import fill_axes
from stseg.baselines.kim_davis_2006.bodies import HALF_WIDTH, PARTS, fill_bodies, fill_boxes
from stseg.baselines.kim_davis_2006.colours import FALL, bins_of, fill_density, normalised
from stseg.baselines.kim_davis_2006.likelihood import add_misfit
from stseg.baselines.kim_davis_2006.segmentation import NO_PERSON, Canvas, fill_unoccluded, segment
from stseg.geometry import Camera

_WIDTHS = 2 * float(HALF_WIDTH.mean())
_BOUNDS = np.concatenate([[0.0], PARTS[:-1], [1.0]])
_LEVEL = (np.arange(len(HALF_WIDTH)) + 0.5) / len(HALF_WIDTH)
_AREAS = np.array(
    [2 * HALF_WIDTH[(lower <= _LEVEL) & (upper > _LEVEL)].sum() / len(HALF_WIDTH) for lower, upper in pairwise(_BOUNDS)]
)
"""Area of each part relative to the square of the body's length."""


_VISIBLE = 0.8
"""Least visible fraction of a body for its colours to be learned."""


class ParticleView:
    """A camera's raster.

    Parameters
    ----------
    camera
        With its lens: the raster stores undistorted coordinates of its pixels.
    columns
        Most columns of the raster, which subsamples the image (Kim and Davis 2006, section 6).
    """

    def __init__(self, camera: Camera, columns: int) -> None:
        self.camera = camera
        self.projection, self.centre = camera.projection, camera.centre
        width, height = camera.size
        self.step = max(1, -(-width // columns))
        pixel = np.stack(np.meshgrid(np.arange(0, width, self.step), np.arange(0, height, self.step)), -1).astype(float)
        self.ideal: Singles = np.nan_to_num(camera.ideal(pixel), nan=-1e6).astype(np.float32)
        self.canvas = Canvas.of(*self.ideal.shape[:2])
        self.areas = _AREAS / self.step**2
        self.pixel_buffer: Singles = np.zeros(self.ideal.shape[:2], np.float32)
        self.distance_buffer: Floats = np.zeros(self.ideal.shape[0] * self.ideal.shape[1])

    def bodies(self, ground: Floats, height: Floats) -> Floats:
        """Bodies of people at (n, 2) with heights (n,), see `bodies.fill_bodies`."""
        bodies = np.zeros((len(ground), 5))
        fill_bodies(self.projection, self.centre, ground, height, bodies)
        return bodies

    def prepare(
        self, view: ColourView, ground: Floats, height: Floats, appearances: Sequence[PersonAppearance], margin: Floats
    ) -> ParticleFrame:
        """Prepare a frame for a search within margins (n,), metres, of places (n, 2)."""
        colour = normalised(view.image[:: self.step, :: self.step])
        foreground = (view.likelihood[:: self.step, :: self.step] > 0.5).astype(np.uint8)
        boxes = np.zeros((len(ground), 4), np.int64)
        fill_boxes(self.ideal, self.bodies(ground, height), margin / height, boxes)
        density = np.zeros((len(ground), len(PARTS), *foreground.shape), np.float32)
        for box, appearance, person_density in zip(boxes, appearances, density, strict=True):
            fill_density(colour, foreground, box, appearance.samples, appearance.usable_samples, FALL, person_density)
        return ParticleFrame(self, height, colour, bins_of(colour).astype(np.int32), foreground, boxes, density)


@dataclass(frozen=True)
class ParticleFrame:
    """One view of one frame."""

    view: ParticleView
    height: Floats
    """float64 (n,): heights of the people, metres."""
    colour: Bytes
    """uint8 (v, u, 3): normalised colour of each pixel of the raster."""
    bins: Labels
    """int32 (v, u): its histogram bin."""
    foreground: Bytes
    """uint8 (v, u): its foreground."""
    boxes: Ints
    """int64 (n, 4): search region of each person, see `bodies.fill_boxes`."""
    density: Singles
    """float32 (n, part, v, u): eq. 1 of each person's parts."""

    def segment(self, ground: Floats) -> tuple[Floats, Ints]:
        """Label the view's canvas by a hypothesis (n, 2); the bodies, and their order of occlusion."""
        view, bodies = self.view, self.view.bodies(ground, self.height)
        order = np.argsort(bodies[:, 4], kind="stable")
        segment(bodies, order, self.boxes, view.ideal, self.foreground, self.density, HALF_WIDTH, PARTS, view.canvas)
        return bodies, order

    def fill_axes(self, ground: Floats, median: bool, axes: Floats) -> None:
        """The axes (n, 4) of the people of a hypothesis (n, 2)."""
        view, (bodies, _) = self.view, self.segment(ground)
        camera = view.camera
        fill_axes(
            bodies,
            self.boxes,
            view.ideal,
            view.canvas,
            float(view.step),
            _WIDTHS,
            camera.ground,
            camera.vertical,
            median,
            view.distance_buffer,
            axes,
        )

    def add_misfit(self, ground: Floats, reference: Floats, misfit: Floats) -> None:
        """Add the colour misfit of each person at (n, 2), given q* (n, part, bin), to misfit (n,)."""
        view, bodies = self.view, self.view.bodies(ground, self.height)
        order = np.argsort(bodies[:, 4], kind="stable")
        counts = np.zeros(reference.shape[1:])
        add_misfit(
            bodies,
            order,
            self.boxes,
            view.ideal,
            self.bins,
            reference,
            view.areas,
            HALF_WIDTH,
            PARTS,
            view.canvas.free,
            counts,
            misfit,
        )

    def learned(
        self, ground: Floats, appearances: Sequence[PersonAppearance], share: float, rng: np.random.Generator
    ) -> list[PersonAppearance]:
        """Update colour models of people at places (n, 2) from their visible pixels in this view.

        Occluded people are not updated; a part that has a model is updated only from pixels segmented as the person.
        """
        view, (bodies, order) = self.view, self.segment(ground)
        owner = np.full(self.foreground.shape, NO_PERSON, np.int32)
        unoccluded = np.zeros(len(ground), np.int64)
        fill_unoccluded(bodies, order, self.boxes, view.ideal, HALF_WIDTH, PARTS, view.pixel_buffer, owner, unoccluded)
        whole = unoccluded >= _VISIBLE * view.areas.sum() * (bodies[:, 2:4] ** 2).sum(1)
        result = list(appearances)
        for k in np.flatnonzero(whole & (unoccluded > 0)).tolist():
            rows, columns = slice(*self.boxes[k, :2]), slice(*self.boxes[k, 2:])
            foreground = self.foreground[rows, columns] > 0
            fits = foreground & (view.canvas.label[rows, columns] == k)
            for part in range(len(PARTS)):
                pixels = (fits if result[k].usable_samples[part] else foreground) & (
                    owner[rows, columns] == k * len(PARTS) + part
                )
                result[k] = result[k].learned(part, self.colour[rows, columns][pixels], share, rng)
        return result
