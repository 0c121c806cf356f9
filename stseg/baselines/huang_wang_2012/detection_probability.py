"""Target detection probability: agreement of a pillar at each place with the foreground of all views (HW12 eqs 1 to 6).

    Omega_i(X | h, r) = sum_(u,v) F_i M_i / sum_(u,v) M_i                      (HW12 eq. 5)
    p(F_i | X)        = sum over a lattice of h and r of Omega_i p(h) p(r)     (eq. 6)
    G(X)              = p(X) prod_i p(F_i | X)                                 (eqs 1, 3)

M_i is the image of the pillar of height h and width r at X (eq. 4), F_i the likelihood of foreground inside the image
and e outside it (eq. 2): the rate at which people are out of a view. Here the product is taken over the ratios p(F_i |
X) / level, the level being the share of a pillar above which its foreground is evidence for a person. A view that
does not see the pillar at all has ratio 1, so places in different numbers of views compare. (The paper has e for such a
view, as if the level were e: then every place with a little foreground is a sample, and clutter makes candidates.)
p(F_i | X) is at least the rate at which a view misses a whole person, so that one blind view has no veto.
p(X) is uniform over the area.
"""

from collections.abc import Sequence

import numpy as np

from stseg.arrays import Flags, Floats, Singles
from stseg.baselines.huang_wang_2012.pillar_strips import PillarStrips
from stseg.config import BodyConfig, ProposalConfig
from stseg.errors import SourceError
from stseg.geometry import Rig
from stseg.geometry.grid import inside_polygon
from stseg.geometry.summed_area import TOP_LEVEL, SummedArea, fill_summed_area, sum_of
from stseg.kernels.accelerate import kernel

_LATTICE_RANGE = 2.0
"""Range of the lattice of heights and widths, standard deviations; the paper's range is illegible."""
_PIXEL_BOUND = 1e6
"""Pixels; nothing farther outside an image matters."""


class DetectionProbability:
    """The detection probability of one rig: pillars are projected once, frames are evaluated one by one.

    Parameters
    ----------
    rig
        The cameras and the area.
    config, body
        The paper's constants; sizes of people.
    steps
        Image pixels to a map pixel, for each view; 1 where not given.
    """

    def __init__(self, rig: Rig, config: ProposalConfig, body: BodyConfig, steps: Sequence[int] | None = None) -> None:
        self.rig, self.config, self.spacing = rig, config, config.lattice_spacing
        grid = rig.grid
        x, y = (np.arange(a + config.lattice_spacing / 2, b, config.lattice_spacing) for a, b in (grid.x, grid.y))
        self.ground = np.stack(np.meshgrid(x, y), -1)
        """float64 (y, x, 2): the lattice, metres, `spacing` apart."""
        flat = self.ground.reshape(-1, 2)
        self.inside = np.ones(len(flat), bool) if grid.polygon is None else inside_polygon(flat, grid.polygon)
        self.heights, self.height_share = _lattice(body.height_mean, body.height_spread, config.body_sizes)
        self.widths, self.width_share = _lattice(body.width_mean, body.width_spread, config.body_sizes)
        self.steps = list(steps or [1] * len(rig.cameras))
        self.pillars = [
            PillarStrips.of(camera, flat, self.heights, body.width_mean, step)
            for camera, step in zip(rig.cameras, self.steps, strict=True)
        ]

    def log_ratio(self, maps: Sequence[Singles | None]) -> Floats:
        """log of G, each view's part of it relative to the level, at each place of the lattice.

        Parameters
        ----------
        maps : float32 (v, u)
            F_i of each view, 0..1; None where it is blind.

        Returns
        -------
        float64 (y, x)
            Nats: above 0 where the views together are evidence for a person; -inf outside the area.

        Raises
        ------
        SourceError
            Where a map is missing or of another size than its camera's image.
        """
        self._require(maps)
        total = np.where(self.inside, 0.0, -np.inf)
        for pillars, soft_map in zip(self.pillars, maps, strict=True):
            if soft_map is not None:
                total += self.view_log_ratio(self.chance(pillars, soft_map))
        return total.reshape(self.ground.shape[:2])

    def chance(self, pillars: PillarStrips, soft_map: Singles) -> Floats:
        """p(F_i | X) of one view (eq. 6), float64 (place,); nan where it does not see the pillar."""
        sums = np.empty((soft_map.shape[0] + 1, soft_map.shape[1] + 1), np.uint32)
        fill_summed_area(soft_map, 0, 0, sums)
        chance = np.empty(len(pillars.edge))
        fill_chance(
            sums,
            pillars.upright,
            pillars.edge,
            pillars.middle,
            pillars.half,
            pillars.base,
            self.widths,
            self.height_share,
            self.width_share,
            self.config.unseen_rate,
            chance,
        )
        return chance

    def view_log_ratio(self, chance: Floats) -> Floats:
        """One view's log(p(F_i | X) / level), nats; 0 where it does not see the pillar."""
        config = self.config
        return np.where(np.isnan(chance), 0.0, np.log(np.fmax(chance, config.view_miss_rate) / config.covered_share))

    def _require(self, maps: Sequence[Singles | None]) -> None:
        cameras = self.rig.cameras
        if len(maps) != len(cameras):
            raise SourceError("maps", "number", len(maps), f"{len(cameras)}, one a camera")
        for camera, step, soft_map in zip(cameras, self.steps, maps, strict=True):
            width, height = camera.size
            expected = (-(-height // step), -(-width // step))
            if soft_map is not None and soft_map.shape != expected:
                raise SourceError(f"camera {camera.name}", "shape of the map", soft_map.shape, f"{expected}")


def _lattice(mean: float, spread: float, number: int) -> tuple[Floats, Floats]:
    """Sizes around the mean and their Gaussian shares, which sum to 1."""
    steps = np.linspace(-_LATTICE_RANGE, _LATTICE_RANGE, number)
    weight = np.exp(-0.5 * steps**2)
    return mean + spread * steps, weight / weight.sum()


@kernel
def fill_chance(
    sums: SummedArea,
    upright: Flags,
    edge: Singles,
    middle: Singles,
    half: Singles,
    base: int,
    widths: Floats,
    height_share: Floats,
    width_share: Floats,
    outside: float,
    chance: Floats,
) -> None:
    """Fill chance (place,) with p(F_i | X) (HW12 eqs 5, 6), nan where the view sees nothing of the pillar.

    Parameters
    ----------
    sums : uint32 (v + 1, u + 1)
        Summed-area table of F_i in levels of 1 / TOP; see `stseg.geometry.summed_area`.
    upright, edge, middle, half, base
        See `stseg.baselines.huang_wang_2012.pillar_strips.PillarStrips`.
    widths, width_share, height_share : float64 (r,), (r,), (h,)
        The lattice's widths, metres, and the prior probabilities of its widths and heights.
    outside
        e, F_i outside the image.
    """
    rows, columns = sums.shape[0] - 1, sums.shape[1] - 1
    foreground, covered, within = np.empty(len(widths)), np.empty(len(widths)), np.empty(len(widths))
    for i in range(len(edge)):
        chance[i] = np.nan
        if np.isnan(edge[i, 0]):
            continue
        foreground[:], covered[:], within[:] = 0.0, 0.0, 0.0
        total = 0.0
        # Rows and columns change places where the pillar lies across the image.
        length, breadth = (rows, columns) if upright[i] else (columns, rows)
        for k in range(middle.shape[1]):
            one, other = _nearest(edge[i, k]), _nearest(edge[i, k + 1])
            first, last = min(one, other), max(one, other)
            tall = last - first
            first, last = min(max(first, 0), length), min(max(last, 0), length)
            for j in range(len(widths)):
                left = _nearest(middle[i, k] - half[i, k] * widths[j])
                right = max(_nearest(middle[i, k] + half[i, k] * widths[j]), left + 1)
                covered[j] += tall * (right - left)
                left, right = min(max(left, 0), breadth), min(max(right, 0), breadth)
                if first < last and left < right:
                    within[j] += (last - first) * (right - left)
                    if upright[i]:
                        foreground[j] += sum_of(sums, left, first, right, last)
                    else:
                        foreground[j] += sum_of(sums, first, left, last, right)
                if k >= base and covered[j] > 0:
                    omega = (foreground[j] / TOP_LEVEL + outside * (covered[j] - within[j])) / covered[j]
                    total += height_share[k - base] * width_share[j] * omega
        if within.max() > 0:  # rounded to pixels, the widest pillar may miss an image that a narrower one meets
            chance[i] = total


@kernel
def _nearest(edge: float) -> int:
    """The nearest edge between pixels; what is far outside the image is held within reach of whole numbers."""
    return int(np.floor(min(max(float(edge), -_PIXEL_BOUND), _PIXEL_BOUND) + 0.5))
