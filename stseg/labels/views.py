"""Whom each pixel of each view shows, frame by frame (METHODS 7, HW12 section IV-B)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stseg.arrays import Bytes, Labels, Singles
from stseg.config import LabelConfig
from stseg.geometry import Camera, Rig
from stseg.geometry.bodies import BodyTable
from stseg.graphcut.expansion import expand
from stseg.labels.adjacency import edge_costs
from stseg.labels.body_masks import pillar_patches
from stseg.labels.energy import admissible, most_likely, pixel_energy
from stseg.labels.label_likelihood import LabelLikelihood, nearest
from stseg.labels.placed_people import PlacedPeople


class ViewLabels:
    """The labels of one view.

    Parameters
    ----------
    camera
        The view.
    table
        Its bodies.
    config
        The constants of the labels.
    """

    def __init__(self, camera: Camera, table: BodyTable, config: LabelConfig) -> None:
        self.camera, self.table, self.config = camera, table, config

    def label(self, standing: PlacedPeople, foreground: Singles, image: Bytes | None) -> Labels:
        """Whom each pixel shows.

        Parameters
        ----------
        standing
            Who is there.
        foreground : float32 (v, u)
            Probability that a pixel shows a person, by the view alone, 0..1.
        image : uint8 (v, u, 3)
            Its colours; None where there are none.

        Returns
        -------
        int32 (v, u)
            1 + the index of the person, 0 for background.
        """
        labels = np.zeros(foreground.shape, np.int32)
        shown = self.expected(standing)
        colours = None if image is None else np.ascontiguousarray(image[shown.window])
        across, down = edge_costs(colours, shown.nobody.shape, self.config)
        problem = pixel_energy(shown, np.ascontiguousarray(foreground[shown.window]), across, down, self.config)
        start = most_likely(shown).flat[problem.pixel]
        labels[shown.window].flat[problem.pixel] = expand(problem.energy, admissible(problem.energy, start))
        return labels

    def expected(self, standing: PlacedPeople) -> LabelLikelihood:
        """Whom each pixel around the people shows, before it is looked at."""
        patches = pillar_patches(self.table, standing, self.config)
        return nearest(patches, np.hypot(*(standing.ground - self.camera.centre[:2]).T))


def view_labels(rig: Rig, config: LabelConfig) -> Sequence[ViewLabels]:
    """The labels of all views of a rig."""
    return [ViewLabels(camera, BodyTable.of(camera, rig.grid), config) for camera in rig.cameras]
