"""Pixel labels of each view, frame by frame (Huang and Wang, TCSVT 22(11), 2012, section IV-B)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stseg.arrays import Bytes, Labels, Singles
from stseg.config import BodyConfig, LabelConfig
from stseg.geometry import Camera, Rig
from stseg.geometry.bodies import BodyTable
from stseg.graphcut.expansion import expand
from stseg.labels.adjacency import edge_costs
from stseg.labels.body_masks import pillar_patches
from stseg.labels.energy import admissible, most_likely_labels, pixel_energy
from stseg.labels.label_likelihood import LabelLikelihood, visible_shares
from stseg.labels.placed_people import PlacedPeople


class ViewLabels:
    """The labels of one view.

    Parameters
    ----------
    camera
        The view.
    table
        Its bodies.
    config, body
        The constants of the labels; sizes of people.
    """

    def __init__(self, camera: Camera, table: BodyTable, config: LabelConfig, body: BodyConfig) -> None:
        self.camera, self.table, self.config, self.body = camera, table, config, body

    def label(self, people: PlacedPeople, foreground: Singles, image: Bytes | None) -> Labels:
        """Person visible at each pixel.

        Parameters
        ----------
        people
            Places and heights of the frame's people.
        foreground : float32 (v, u)
            Probability of a person by the view's foreground, 0..1.
        image : uint8 (v, u, 3)
            Colours, or None.

        Returns
        -------
        int32 (v, u)
            1 + the index of the person, 0 for background.
        """
        labels = np.zeros(foreground.shape, np.int32)
        likelihood = self.label_likelihood(people)
        colours = None if image is None else np.ascontiguousarray(image[likelihood.window])
        across, down = edge_costs(colours, likelihood.background.shape, self.config)
        problem = pixel_energy(
            likelihood, np.ascontiguousarray(foreground[likelihood.window]), across, down, self.config
        )
        start = most_likely_labels(likelihood).flat[problem.pixel]
        labels[likelihood.window].flat[problem.pixel] = expand(problem.energy, admissible(problem.energy, start))
        return labels

    def label_likelihood(self, people: PlacedPeople) -> LabelLikelihood:
        """Prior shares of labels around the people, from their places and heights."""
        patches = pillar_patches(self.table, people, self.config, self.body)
        return visible_shares(patches, np.hypot(*(people.ground - self.camera.centre[:2]).T))


def view_labels(rig: Rig, config: LabelConfig, body: BodyConfig) -> Sequence[ViewLabels]:
    """The labels of all views of a rig."""
    return [ViewLabels(camera, BodyTable.of(camera, rig.grid), config, body) for camera in rig.cameras]
