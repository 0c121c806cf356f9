"""What a frame's candidates are judged by, as arrays that the search kernels read.

Two forms of evidence stand side by side, since a rig may mix them: boxes, each of which speaks for one person at most,
and pixels, each of which belongs to the nearest person whose body covers it. Both are used once (METHODS 7).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from stseg.arrays import Floats, Ints, Singles
from stseg.model.outlines import Spans

Owners = NDArray[np.int16]
"""int16 (view, v * u): the candidate whom each raster pixel shows, -1 for nobody. Small: it is walked all the time."""


class Parameters(NamedTuple):
    """The constants of the pass; see `stseg.config.DetectionConfig` for their meaning. Nats and shares."""

    person: float
    apart: float
    hit: float
    box_miss: float
    hidden_below: float
    whole_above: float
    least: float
    body_weight: float


class BoxEvidence(NamedTuple):
    """Boxes of all views that deliver boxes.

    Attributes
    ----------
    match : float64 (view, candidate, box)
        Log-likelihood of the box given the candidate's pillar, nats, 0 at a perfect fit; -inf where there is no box.
    boxes : int64 (view,)
        Number of boxes of each view.
    cover : float64 (view, candidate, candidate)
        Share of the first's pillar that the second hides where both are there; 0 where the second is farther away.
    inside : float64 (view, candidate)
        Share of the candidate's pillar inside the image.
    """

    match: Floats
    boxes: Ints
    cover: Floats
    inside: Floats


class PixelEvidence(NamedTuple):
    """Foreground pixels of all views that deliver them, on rasters coarser than the images.

    Attributes
    ----------
    raster : float32 (view, v, u)
        Log-odds of foreground, nats.
    first : int64 (view, candidate)
        First raster row of each candidate's outline; -1 where the view does not see it.
    spans : int16 (view, candidate, row, 2)
        First and last column (exclusive) of each row from `first` on; empty rows have both 0.
    area : float64 (view, candidate)
        Pixels of the whole outline, those outside the raster included.
    order : float64 (view, candidate)
        Distance from the camera on the ground, metres.
    """

    raster: Singles
    first: Ints
    spans: Spans
    area: Floats
    order: Floats


class Problem(NamedTuple):
    """A frame's candidates and all that is known of them.

    Attributes
    ----------
    boxes, pixels
        What the views say.
    own : float64 (candidate,)
        What speaks for each candidate by itself, nats.
    newcomer : float64 (candidate,)
        What it costs that nobody was expected there, nats.
    known : float64 (candidate, walker)
        What speaks for each candidate by being each walker, beyond a newcomer who costs nothing, nats.
    ground : float64 (candidate, 2)
        Metres.
    terms
        The pass's constants.
    owner : int64 (at least boxes, at least v * u, at least walkers)
        Scratch: after a view was scored, the place in the set of whoever owns each box or pixel, -1 for nobody; after
        the walkers were, of whoever is each walker.
    parts : float64 (view, candidate + 1)
        Scratch: after a set was scored, what each view says of each of its members, nats; views with boxes first.
    """

    boxes: BoxEvidence
    pixels: PixelEvidence
    own: Floats
    newcomer: Floats
    known: Floats
    ground: Floats
    terms: Parameters
    owner: Ints
    parts: Floats
