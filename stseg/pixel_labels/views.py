"""Pixel labels of each view, frame by frame (Huang and Wang, T-ASE 9(1), 2012, section IV-B)."""

from collections.abc import Sequence

import numpy as np

from stseg.arrays import Bytes, Labels, Singles
from stseg.bodies.pillars import BodyTable
from stseg.config import BodyConfig, LabelConfig
from stseg.geometry import Camera, Rig
from stseg.graphcut.expansion import expand
from stseg.pixel_labels.appearance import BodyRows, ColourSums, ViewAppearance, colour_log_ratios
from stseg.pixel_labels.label_likelihood import LabelLikelihood, PlacedPeople, pillar_patches, visible_shares
from stseg.pixel_labels.pixel_energy import admissible, edge_costs, most_likely_labels, pixel_energy


class ViewLabels:
    """The labels of one view of a camera with its table of bodies, by constants of the labels and sizes of people."""

    def __init__(self, camera: Camera, table: BodyTable, config: LabelConfig, body: BodyConfig) -> None:
        self.camera, self.table, self.config, self.body = camera, table, config, body

    def label(
        self, people: PlacedPeople, foreground: Singles, image: Bytes | None, appearance: ViewAppearance | None = None
    ) -> Labels:
        """Person visible at each pixel, int32 (v, u): 1 + the index of the person, 0 for background.

        `people` are the frame's, with places and heights; `foreground` float32 (v, u) is the probability of a person by
        the view's foreground, 0..1; `image` uint8 (v, u, 3) its colours, or None. `appearance` holds the colours that
        the people's tracks wear in this view; None where they are not known.
        """
        labels = np.zeros(foreground.shape, np.int32)
        likelihood = self.label_likelihood(people)
        colours = None if image is None else np.ascontiguousarray(image[likelihood.window])
        across, down = edge_costs(colours, likelihood.background.shape, self.config)
        worn = None
        if colours is not None and appearance is not None:
            worn = colour_log_ratios(appearance, likelihood, self.rows(people), people.track, colours)
        probability = np.ascontiguousarray(foreground[likelihood.window])
        problem = pixel_energy(likelihood, probability, across, down, self.config, worn)
        start = most_likely_labels(likelihood).flat[problem.pixel]
        labels[likelihood.window].flat[problem.pixel] = expand(problem.energy, admissible(problem.energy, start))
        return labels

    def learn(self, people: PlacedPeople, image: Bytes, sums: ColourSums) -> None:
        """Add the colours of people who are not hidden; image uint8 (v, u, 3)."""
        likelihood = self.label_likelihood(people)
        sums.add(likelihood, self.rows(people), people.track, np.ascontiguousarray(image[likelihood.window]))

    def rows(self, people: PlacedPeople) -> BodyRows:
        """Image rows of heads and feet; 0 behind the camera."""
        pixels = [self.camera.project(people.ground, height)[0] for height in (people.height, 0.0)]
        head, feet = (np.nan_to_num(pixel[:, 1]) for pixel in pixels)
        return BodyRows(head, feet)

    def label_likelihood(self, people: PlacedPeople) -> LabelLikelihood:
        """Prior shares of labels around the people, from their places and heights."""
        patches = pillar_patches(self.table, people, self.config, self.body)
        return visible_shares(patches, np.hypot(*(people.ground - self.camera.centre[:2]).T))


def view_labels(rig: Rig, config: LabelConfig, body: BodyConfig) -> Sequence[ViewLabels]:
    """The labels of all views of a rig."""
    return [ViewLabels(camera, BodyTable.of(camera, rig.grid), config, body) for camera in rig.cameras]
