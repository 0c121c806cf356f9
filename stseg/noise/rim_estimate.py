"""Rims of silhouettes: background beside foreground, weaker evidence where a segmentation eats the edges of people.

A segmentation that errs along outlines errs alike in all frames of a view: silhouettes come out narrower than bodies,
and legs and arms vanish. Then a pixel of background next to foreground is no evidence of an empty place. A share of
the evidence of such pixels is withdrawn, and learned view by view from people who stand alone: with A pixels of their
bodies, B of them missing and R of them background on the rim, the share

    w = (B - m A) / R,    within 0 and 1,

leaves as much background as a segmentation misses at the usual rate m (`pixel_miss_rate`). Where rims cannot explain
what is missing, the masks are torn: log-odds are those of the view's own rates then, of its missing pixels off the rim
and of foreground away from people. A torn mask holds little foreground that is no person, so what there is says more.

Whole silhouettes have background within the outline of a pillar, too: a limb stands beside it. So of each row of an
outline as many pixels are missing as it has more of background within than of foreground beside, up to half its width
on either side.

Bodies are as wide as the configured population: sizes that are measured in eaten silhouettes hide what is missing. A
short time of one person at the rate m counts beside the measured ones, since one frame of a person shows most of a
segmentation's errors; and a longer one at the mean of all views, which are mostly segmented alike. Measurements are
forgotten (`stseg.records.forgetting`). Only rigs of pixels learn.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from stseg.arrays import Floats, Ints, Singles
from stseg.bodies.outlines import WHOLE_SHARE, Spans, paint_outlines
from stseg.bodies.views import PixelView, View, ViewObservation, ViewObservations
from stseg.config import BodyConfig, DetectionConfig, ErrorRateConfig
from stseg.kernels.accelerate import kernel, part
from stseg.noise.torn_masks import TORN_RATES, with_rates
from stseg.records.forgetting import Forgetting
from stseg.records.people import People

_PRIOR_WEIGHT = 0.25
"""Weight of the first guess, that nothing is withdrawn: seconds of one person in any view."""
_MEAN_WEIGHT = 2.0
"""Weight of the mean of all views in each of them: seconds of one person."""
_LEAST_CLUTTER = 0.01
"""Least clutter of torn masks, 0..1."""


class RimEstimate:
    """Accumulated background inside people who stand alone.

    Parameters
    ----------
    views
        Number of views.
    body
        Sizes of the configured population.
    config
        Usual rates of misses and clutter.
    frame_rate
        Frames per second.
    learning
        Memory, and least evidence of people who count.
    """

    def __init__(
        self, views: int, body: BodyConfig, config: DetectionConfig, frame_rate: float, learning: ErrorRateConfig
    ) -> None:
        self._body, self._evidence = body, learning.minimum_evidence
        self._miss, self._clutter = config.pixel_miss_rate, config.pixel_clutter_rate
        self.shares = Forgetting((views, 3), frame_rate, learning.memory)
        """(view, 3): weight, and weighted sums of the shares of bodies that are missing, and background on the rim;
        seconds."""
        self.clutter = Forgetting((views, 2), frame_rate, learning.memory)
        """(view, 2): weight, and weighted sums of the share of pixels away from people that are foreground; seconds."""

    @property
    def withdrawn(self) -> Floats:
        """Share of the evidence of rim pixels that is withdrawn, 0..1, float64 (view,)."""
        weight, missing, rim = self.shares.with_prior(_MEAN_WEIGHT, self._mean()).T
        return np.asarray(((missing - self._miss * weight) / rim).clip(0.0, 1.0))

    @property
    def torn(self) -> Floats:
        """Miss and clutter rates of each view whose masks are torn, of all others the usual ones, float64 (view, 2)."""
        weight, missing, rim = self.shares.with_prior(_MEAN_WEIGHT, self._mean()).T
        miss = (missing - rim) / (weight - rim)
        count, found = self.clutter.with_prior(_PRIOR_WEIGHT, np.array([1.0, self._clutter])).T
        clutter = np.clip(found / count, _LEAST_CLUTTER, self._clutter)
        rates = np.column_stack([miss, clutter])
        return np.where(miss[:, None] > self._miss, rates, [self._miss, self._clutter])

    @property
    def is_young(self) -> bool:
        """Whether people were measured for less time than the mean of all views counts."""
        return bool(self.shares.sums[:, 0].mean() < _MEAN_WEIGHT)

    def _mean(self) -> Floats:
        """Shares of all views and the first guess for one second of one person, float64 (3,)."""
        total = self.shares.sums.sum(0) + _PRIOR_WEIGHT * np.array([1.0, self._miss, self._miss])
        return np.asarray(total / total[0])

    def applied(self, observations: ViewObservations) -> list[ViewObservation | None]:
        """The observations of all views without the withdrawn share of their rims, by the rates of torn masks."""
        return self._by(self.withdrawn, self.torn, observations)

    def torn_guess(self, observations: ViewObservations) -> list[ViewObservation | None]:
        """The same without any rim, by a guess of the rates of torn masks."""
        number = len(observations)
        return self._by(np.ones(number), np.tile(TORN_RATES, (number, 1)), observations)

    def _by(self, withdrawn: Floats, rates: Floats, observations: ViewObservations) -> list[ViewObservation | None]:
        """Observations without shares (view,) of their rims, by rates (view, 2)."""
        usual = self._miss, self._clutter
        return [
            None if view is None else with_rates(without_rim(view, share), usual, (miss, clutter))
            for view, share, (miss, clutter) in zip(observations, withdrawn.tolist(), rates.tolist(), strict=True)
        ]

    def skip_frame(self) -> None:
        """Defer the weight of a frame that is not measured to the next one."""
        self.shares.skip_frame()
        self.clutter.skip_frame()

    def learn(self, people: People, views: Sequence[View], observations: ViewObservations) -> None:
        """Count one frame."""
        self.shares.forget()
        self.clutter.forget()
        for k, (view, observation) in enumerate(zip(views, observations, strict=True)):
            if isinstance(view, PixelView) and observation is not None and len(people):
                supported = people.supported_without(k, self._evidence)
                widths = self._body.width_of(people.height)
                first, spans, whole = view.whole_outlines(people.ground, people.height, widths)
                counts = np.zeros((len(people), 3))
                _fill_counts(first, spans, observation.raster, counts)
                counted = supported & (counts[:, 0] > WHOLE_SHARE * whole)
                self.shares.add(self.shares.seconds((counts[counted] / counts[counted, :1]).sum(0)), k)
                self.clutter.add(
                    self.clutter.seconds(np.array([1.0, _clutter_of(first, spans, observation.raster)])), k
                )


def without_rim(observation: ViewObservation, withdrawn: float) -> ViewObservation:
    """An observation of pixels in which background beside foreground is weaker evidence by a share, 0..1."""
    if withdrawn <= 0.0:
        return observation
    raster = np.empty_like(observation.raster)
    _fill_without_rim(observation.raster, np.float32(1.0 - withdrawn), raster)
    return replace(observation, raster=raster)


@kernel
def _on_rim(raster: Singles, v: int, u: int) -> bool:
    """Whether one of the eight pixels beside a pixel is foreground."""
    rows, columns = raster.shape
    for j in range(max(v - 1, 0), min(v + 2, rows)):
        for i in range(max(u - 1, 0), min(u + 2, columns)):
            if raster[j, i] > 0:
                return True
    return False


@kernel
def _fill_without_rim(raster: Singles, kept: np.float32, weaker: Singles) -> None:
    """Fill weaker (v, u) with log-odds (v, u), times a share where background lies beside foreground."""
    rows, columns = raster.shape
    for v in range(rows):
        for u in range(columns):
            value = raster[v, u]
            weaker[v, u] = value * kept if value < 0 and _on_rim(raster, v, u) else value


def _clutter_of(first: Ints, spans: Spans, raster: Singles) -> float:
    """Share of the pixels of raster (v, u) outside all outlines, as of `outlines`, that are foreground: 0..1."""
    owner = np.full(raster.shape, -1, np.int16)
    paint_outlines(np.arange(len(first)), first, spans, owner)
    return float((raster[owner < 0] > 0).mean()) if (owner < 0).any() else 0.0


@kernel
def _fill_counts(first: Ints, spans: Spans, raster: Singles, counts: Floats) -> None:
    """Fill counts (n, 3): pixels of each outline (n,), missing among them, and background on the rim of foreground.

    All are 0 for outlines that another one overlaps, and for those that the view does not see.
    """
    covered = np.zeros(raster.shape, np.int64)
    for j in range(len(first)):
        for v in range(first[j], _end(first[j], spans, raster)):
            for u in range(spans[j, v - first[j], 0], spans[j, v - first[j], 1]):
                covered[v, u] += 1
    for j in range(len(first)):
        counts[j] = 0.0
        for v in range(first[j], _end(first[j], spans, raster)):
            left, right = spans[j, v - first[j], 0], spans[j, v - first[j], 1]
            if _most(covered[v], left, right) > 1:
                counts[j] = 0.0
                break
            background = 0
            for u in range(left, right):
                if raster[v, u] <= 0:
                    background += 1
                    counts[j, 2] += _on_rim(raster, v, u)
            counts[j, 0] += right - left
            counts[j, 1] += max(background - _foreground_beside(v, left, right, raster, covered), 0)


@kernel
def _end(first: int, spans: Spans, raster: Singles) -> int:
    """The row after an outline's last one that the raster may have; its first row is -1 where it is not seen."""
    return min(first + spans.shape[1], raster.shape[0]) if first >= 0 else -1


@part
def _most(covered: Ints, left: int, right: int) -> int:
    """Most outlines that cover a pixel of columns left..right of a row, covered (u,)."""
    most = 0
    for u in range(left, right):
        most = max(most, covered[u])
    return most


@kernel
def _foreground_beside(v: int, left: int, right: int, raster: Singles, covered: Ints) -> int:
    """Pixels of foreground beside columns left..right of a row, within half their number, that no outline covers."""
    reach, found = (right - left + 1) // 2, 0
    for u in range(max(left - reach, 0), min(right + reach, raster.shape[1])):
        found += (u < left or u >= right) and covered[v, u] == 0 and raster[v, u] > 0
    return found
