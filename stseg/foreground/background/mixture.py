"""Gaussian mixture background model; foreground is what the mixture does not explain.

After Khan and Shah 2009, section 3, and Huang and Wang 2012; docs/how-it-works.md, Foreground.

For a pixel of colour x (BGR, grey levels), with background modes k of weight w_k, mean mu_k and variance var_k,

    L(x) = f p(x | person) / (f p(x | person) + (1 - f) p(x | scene)),
    p(x | scene)  = (1 - e) sum_k w_k [(1 - s) N(x; mu_k, var_k I) + s D(x; mu_k, var_k)] + e U,
    p(x | person) = (1 - m) U + m sum_k w_k D(x; mu_k, var_k),

the posterior probability that the pixel shows a person: a function of the squared Mahalanobis distances to the modes.
Its log-odds are held within 5 nats and averaged over neighbours. U is the uniform density of colours and D a mode in
shadow: a Gaussian around the segment from `darkest_shadow` mu to mu, of the mode's own chromaticity, denser towards mu
since penumbras are commoner than deep shadows:

    D(x; mu, var) = 2 t exp(-|x - r mu|^2 / (2 var)) / (2 pi var (l + sqrt(2 pi var))),
    r = clip(x.mu / |mu|^2, darkest, 1),   t = (r - darkest) / (1 - darkest),   l = (1 - darkest) |mu|.

Some clothes look like a darkened wall (m), so L stays soft in the shadow range: about f m / (f m + (1 - f) s).

Learning (Stauffer and Grimson 1999, with selective rates). A frame updates the nearest mode within `match_distance`
standard deviations. A mode of weight `background_weight` or more is background and learns with rate dt / memory times
(1 - L). Any other mode, and a new one, which takes the place of the weakest, learns so slowly that its weight reaches
`background_weight` after `absorption_time` seconds: a person may stand that long without fading, and a chair put down
for longer becomes background. Where background shows meanwhile, such a mode is forgotten within the
memory; so what flickers must be learned from the empty scene. A colour that only a shadow explains updates nothing, and
people replace no mode of the background.

Light that changes over the whole view, slowly or at once, is a gain of each channel on all means
(`stseg.foreground.channel_gain`); where a part of it turns darker that is a shadow, where brighter new background after
`absorption_time`.
"""

from __future__ import annotations

from typing import ClassVar

from stseg.config import MixtureConfig
from stseg.foreground.background.gaussian_model import GaussianModel


class Mixture(GaussianModel):
    """Isotropic Gaussian mixture of one view."""

    name: ClassVar[str] = "mixture"
    variances: ClassVar[int] = 1

    def __init__(self, size: tuple[int, int], frame_rate: float, config: MixtureConfig | None = None) -> None:
        super().__init__(size, frame_rate, MixtureConfig() if config is None else config)

    def _least_sds(self) -> tuple[float, float]:
        return self.config.minimum_sd, self.config.minimum_sd
