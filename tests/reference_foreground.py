"""Slow plain definitions of the foreground stage, written from the formulas and sharing no code with it."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import convolve
from scipy.special import expit

from stseg.arrays import Boxes, Bytes, Floats, Singles
from stseg.config import BackgroundConfig, ChromaticConfig, CodebookConfig, MixtureConfig

UNIFORM = 256.0**-3
GaussianConfig = MixtureConfig | ChromaticConfig
FLOOR, SHIRT = (110, 140, 60), (40, 60, 190)
"""Colours of an empty scene and of a person, BGR."""


def noisy(image: Bytes, rng: np.random.Generator, sd: float = 2.0) -> Bytes:
    """The image with noise."""
    return np.asarray(np.clip(np.round(image + rng.normal(0, sd, image.shape)), 0, 255), np.uint8)


def random_modes(rng: np.random.Generator, modes: int, config: GaussianConfig) -> tuple[Singles, Singles, Singles]:
    """Means, variances and weights of random modes of 3 x 4 pixels."""
    shape = (3, 4, modes, 2) if isinstance(config, ChromaticConfig) else (3, 4, modes)
    mean = rng.uniform(5, 250, (3, 4, modes, 3)).astype(np.float32)
    variance = rng.uniform(6 if isinstance(config, ChromaticConfig) else 16, 400, shape).astype(np.float32)
    weight = rng.dirichlet(np.full(modes, 0.4), (3, 4)).astype(np.float32)
    return mean, variance, weight


def near_modes(rng: np.random.Generator, mean: Singles) -> Bytes:
    """Colours around the modes, in their light, in their shadow, and elsewhere."""
    ratio = rng.choice([1.2, 1.0, 0.8, 0.55, 0.3], mean.shape[:2])
    colours = mean[:, :, 0] * ratio[:, :, None] + rng.normal(0, 6, (*mean.shape[:2], 3))
    return np.asarray(np.clip(np.round(colours), 0, 255), np.uint8)


def planes_of(mean: Singles, variance: Singles, weight: Singles) -> Singles:
    """State float32 (mode, plane, v, u) from means (v, u, mode, 3), variances (v, u, mode, ...) and weights."""
    spread = variance.reshape(*weight.shape, -1)
    planes = np.concatenate([mean, spread, weight[..., None]], -1)
    return np.ascontiguousarray(planes.transpose(2, 3, 0, 1), np.float32)


def modes_of(planes: Singles) -> tuple[Singles, Singles, Singles]:
    """Means, variances and weights of a state, as in `planes_of`."""
    modes = planes.transpose(2, 3, 0, 1)
    variance = modes[..., 3:-1] if modes.shape[-1] > 5 else modes[..., 3]
    return modes[..., :3], variance, modes[..., -1]


def mode_densities(x: Floats, mu: Floats, var: float, darkest: float) -> tuple[float, float]:
    """N(x; mu, var I) and D(x; mu, var) of `stseg.foreground.background.mixture`."""
    lit = math.exp(-((x - mu) @ (x - mu)) / (2 * var)) / (2 * math.pi * var) ** 1.5
    ratio = float(np.clip((x @ mu) / (mu @ mu), darkest, 1))
    residual = x - ratio * mu
    length = (1 - darkest) * float(np.linalg.norm(mu))
    along = 2 * (ratio - darkest) / (1 - darkest) / (length + math.sqrt(2 * math.pi * var))
    return lit, along * math.exp(-(residual @ residual) / (2 * var)) / (2 * math.pi * var)


def posterior(explained: float, dimmed: float, config: BackgroundConfig) -> float:
    """Log-odds of a person, within 5 nats."""
    scene = (1 - config.outlier_rate) * explained + config.outlier_rate * UNIFORM
    person = (1 - config.shadow_confusion) * UNIFORM + config.shadow_confusion * dimmed
    odds = config.foreground_prior * person / ((1 - config.foreground_prior) * scene)
    return float(np.clip(math.log(odds), -5, 5))


def polar(x: Floats, mu: Floats) -> tuple[float, float, float]:
    """Brightness relative to mu, distance from the ray of mu, and the length of mu."""
    ratio = float(x @ mu / (mu @ mu))
    return ratio, float(np.linalg.norm(x - ratio * mu)), float(np.linalg.norm(mu))


def gaussian(distance: float, var: float) -> float:
    """A Gaussian that is 1 in its middle."""
    return math.exp(-(distance**2) / (2 * var))


def chromatic_densities(x: Floats, mu: Floats, across: float, along: float, darkest: float) -> tuple[float, float]:
    """N and D of `stseg.foreground.background.mixture.Chromatic`."""
    ratio, off, length = polar(x, mu)
    disc = gaussian(off, across) / (2 * math.pi * across)
    lit = disc * gaussian((ratio - 1) * length, along) / math.sqrt(2 * math.pi * along)
    t = max((min(ratio, 1) - darkest) / (1 - darkest), 0)
    line = (1 - darkest) * length + math.sqrt(2 * math.pi * along)
    return lit, disc * 2 * t * gaussian(max(ratio - 1, 0) * length, along) / line


def log_odds(
    image: Bytes, gain: Floats, mean: Singles, variance: Singles, weight: Singles, config: GaussianConfig
) -> Floats:
    """Log-odds of foreground (v, u), within 5 nats, of either mixture."""
    out = np.empty(image.shape[:2])
    for v, u in np.ndindex(*out.shape):
        lit, dimmed = 0.0, 0.0
        for k in np.flatnonzero(weight[v, u] >= config.background_weight):
            x, mu = image[v, u].astype(float), np.minimum(gain * mean[v, u, k].astype(float), 255.0)
            if isinstance(config, ChromaticConfig):
                across, along = variance[v, u, k].astype(float)
                n, d = chromatic_densities(x, mu, across, along, config.darkest_shadow)
            else:
                n, d = mode_densities(x, mu, float(variance[v, u, k]), config.darkest_shadow)
            lit, dimmed = lit + float(weight[v, u, k]) * n, dimmed + float(weight[v, u, k]) * d
        out[v, u] = posterior((1 - config.shadow_prior) * lit + config.shadow_prior * dimmed, dimmed, config)
    return out


def squares_of(x: Floats, means: Floats, config: GaussianConfig) -> Floats:
    """Squared residuals from each mode (mode, variance): of all channels, or across and along the ray of its mean."""
    if not isinstance(config, ChromaticConfig):
        return np.asarray(((x - means) ** 2).sum(-1, keepdims=True))
    parts = [polar(x, mu) for mu in means]
    return np.array([(off**2, ((ratio - 1) * length) ** 2) for ratio, off, length in parts])


def updated(
    image: Bytes, gain: Floats, likelihood: Singles, fast: float, slow: float,
    state: tuple[Singles, Singles, Singles], config: GaussianConfig,
) -> tuple[Floats, Floats, Floats]:  # fmt: skip
    """Mean, variance and weight after a frame, of either mixture."""
    mean, variance, weight = (part.astype(float) for part in state)
    variance = variance.reshape(*weight.shape, -1)  # one for all channels, or one across and one along
    least, freedom = np.array([config.minimum_sd**2]), np.array([3])
    if isinstance(config, ChromaticConfig):
        least, freedom = np.array([config.chromatic_sd**2, config.minimum_sd**2]), np.array([2, 1])
    for v, u in np.ndindex(*image.shape[:2]):
        x, w = image[v, u].astype(float), weight[v, u]
        shown = np.minimum(gain * mean[v, u], 255.0)
        squares = squares_of(x, shown, config)
        mahalanobis = np.where(w > 0, (squares / variance[v, u]).sum(-1), np.inf)
        k = int(mahalanobis.argmin())
        if mahalanobis[k] <= config.match_distance**2:
            rate = slow if w[k] < config.background_weight else slow * likelihood[v, u] + fast * (1 - likelihood[v, u])
            w *= 1 - rate
            w[k] += rate
            step = min(rate / w[k], 1)
            mean[v, u, k] += step * (x - shown[k]) / gain
            variance[v, u, k] += step * (squares[k] / freedom - variance[v, u, k])
            variance[v, u, k] = np.maximum(variance[v, u, k], least)
        elif likelihood[v, u] >= 0.5 and w.min() < config.background_weight:
            k = int(w.argmin())
            w *= 1 - slow
            w[k], variance[v, u, k], mean[v, u, k] = slow, config.initial_sd**2, x / gain
    return mean, variance.reshape(state[1].shape), weight


def codeword_densities(
    x: Floats, mu: Floats, low: float, high: float, config: CodebookConfig
) -> tuple[float, float, float]:
    """Densities of a codeword as it was seen, in shadow and in highlight, of `stseg.foreground.background.codebook`."""
    ratio, off, length = polar(x, mu)
    var, span = config.channel_sd**2, math.sqrt(2 * math.pi) * config.channel_sd
    disc = gaussian(off, var) / (2 * math.pi * var)
    lit = gaussian(max(low - ratio, ratio - high, 0) * length, var) / ((high - low) * length + span)
    t = float(np.clip((ratio / low - config.darkest_shadow) / (1 - config.darkest_shadow), 0, 1))
    shadow = 2 * t * gaussian(max(ratio - low, 0) * length, var) / ((1 - config.darkest_shadow) * low * length + span)
    t = float(np.clip((config.brightest_highlight - ratio / high) / (config.brightest_highlight - 1), 0, 1))
    bright = (
        2 * t * gaussian(max(high - ratio, 0) * length, var) / ((config.brightest_highlight - 1) * high * length + span)
    )
    return disc * lit, disc * shadow, disc * bright


def codebook_log_odds(
    image: Bytes, gain: Floats, mean: Singles, bounds: Singles, weight: Singles, config: CodebookConfig
) -> Floats:
    """Log-odds of foreground (v, u), within 5 nats."""
    out = np.empty(image.shape[:2])
    for v, u in np.ndindex(*out.shape):
        parts = np.zeros(3)
        for k in np.flatnonzero(weight[v, u] > 0):
            mu = np.minimum(gain * mean[v, u, k].astype(float), 255.0)
            low, high = bounds[v, u, k].astype(float)
            own = codeword_densities(image[v, u].astype(float), mu, low, high, config)
            parts += weight[v, u, k] / weight[v, u].sum() * np.array(own)
        priors = np.array(
            [1 - config.shadow_prior - config.highlight_prior, config.shadow_prior, config.highlight_prior]
        )
        out[v, u] = posterior(float(parts @ priors), float(parts[1]), config)
    return out


@dataclass
class Codeword:
    """Kim et al. (2005): v and its six-tuple, the brightness as grey levels along v."""

    colour: Floats
    low: float
    high: float
    frequency: float
    weight: float
    longest: int
    first: int
    last: int

    def beyond(self, x: Floats, gain: Floats) -> tuple[float, float]:
        """Squared distance from the codeword's tube in the light of `gain`, and relative brightness."""
        ratio, off, length = polar(x, np.minimum(gain * self.colour, 255.0))
        own = float(np.linalg.norm(self.colour))
        return off**2 + (max(self.low / own - ratio, ratio - self.high / own, 0) * length) ** 2, ratio * own

    def move(self, x: Floats, gain: Floats, step: float) -> None:
        """Towards a colour."""
        self.colour = self.colour + step * (x - np.minimum(gain * self.colour, 255.0)) / gain


Book = list[Codeword | None]


def nearest_codeword(book: Book, x: Floats, gain: Floats, reach: float) -> Codeword | None:
    """The codeword whose tube is nearest, within reach."""
    words = [word for word in book if word is not None and word.beyond(x, gain)[0] <= reach**2]
    return min(words, key=lambda word: word.beyond(x, gain)[0], default=None)


def new_codeword(x: Floats, gain: Floats, now: int, weight: float) -> Codeword:
    """Of a colour that nothing explains."""
    colour = x / gain
    length = float(np.linalg.norm(colour))
    return Codeword(colour, length, length, 1, weight, 0, now, now)


def teach(book: Book, x: Floats, gain: Floats, now: int, reach: float) -> None:
    """A pixel of an empty frame."""
    word = nearest_codeword(book, x, gain, reach)
    if word is not None:
        brightness = word.beyond(x, gain)[1]
        word.longest = max(word.longest, now - word.last - 1)
        word.last, word.frequency = now, word.frequency + 1
        word.weight = word.frequency
        word.low, word.high = min(word.low, brightness), max(word.high, brightness)
        word.move(x, gain, 1 / word.frequency)
    elif None in book:
        book[book.index(None)] = new_codeword(x, gain, now, 1)
    elif len(book) > 1:
        rarest = min(range(1, len(book)), key=lambda k: book[k].frequency)  # type: ignore[union-attr]  # all are there
        book[rarest] = new_codeword(x, gain, now, 1)


def follow(
    book: Book, x: Floats, gain: Floats, likelihood: float, now: int, reach: float, rate: float, turns: tuple[int, int]
) -> None:
    """A pixel of a frame that may show people; `turns` are those of absorption and of absence."""
    absorption, absence = turns
    for k, word in enumerate(book):
        if word is not None and word.first > 0 and now - word.last > (absorption if word.weight else absence):
            book[k] = None
    word = nearest_codeword(book, x, gain, reach)
    if word is None:
        places = [k for k, word in enumerate(book) if word is None or not word.weight]
        if likelihood >= 0.5 and places:
            place = min(places, key=lambda k: -1 if book[k] is None else book[k].last)  # type: ignore[union-attr]
            book[place] = new_codeword(x, gain, now, 0)
        return
    word.last, word.frequency = now, word.frequency + 1
    if word.weight:
        step = max(rate, 1 / word.weight) * (1 - likelihood)
        word.weight += (1 - likelihood) if word.weight < 1 / rate else 0
    else:
        step = max(rate, 1 / word.frequency)
        age = now - word.first
        if age >= absorption and 2 * word.frequency >= age:
            word.weight = min(word.frequency, 1 / rate)
    brightness = word.beyond(x, gain)[1]
    word.low += (min(20 * step, 1) if brightness < word.low else step) * (brightness - word.low)
    word.high += (min(20 * step, 1) if brightness > word.high else step) * (brightness - word.high)
    word.move(x, gain, step)


def pooled(values: Floats, radius: int) -> Floats:
    """Logistic function of the mean around each pixel, by weights that fall straight along each axis."""
    tent = radius + 1.0 - np.abs(np.arange(-radius, radius + 1))
    total, weight = (convolve(each, np.outer(tent, tent), mode="constant") for each in (values, np.ones_like(values)))
    return np.asarray(expit(total / weight))


def commonest(frames: NDArray[np.uint8], reach: float) -> tuple[Floats, Floats]:
    """Mean and variance of the companions of the colour that has most, or first more than half, of them."""
    mean, variance = np.empty(frames.shape[1:]), np.empty(frames.shape[1:3])
    for v, u in np.ndindex(*variance.shape):
        colours = frames[:, v, u].astype(float)
        near = np.linalg.norm(colours[:, None] - colours[None], axis=-1) <= reach
        counts = near.sum(1)
        majority = np.flatnonzero(2 * counts > len(colours))
        companions = colours[near[majority[0] if len(majority) else counts.argmax()]]
        mean[v, u], variance[v, u] = companions.mean(0), companions.var(0).mean()
    return mean, variance


def body_map(boxes: Boxes, size: tuple[int, int], step: int) -> Floats:
    """Every map pixel asks every box."""
    width, height = size
    out = np.zeros((math.ceil(height / step), math.ceil(width / step)))
    for (j, i), _ in np.ndenumerate(out):
        u, v = i * step + (step - 1) / 2, j * step + (step - 1) / 2
        for (left, top, w, h), score in zip(boxes.pixel, boxes.score, strict=True):
            if w > 0 and h > 0 and left <= u <= left + w and top <= v <= top + h:
                across, down = 2 * (u - left) / w - 1, (v - top) / h
                trunk = (across**4 + ((down - 0.565) / 0.435) ** 4) ** 0.25
                head = math.hypot(across / 0.4, (down - 0.1) / 0.1)
                out[j, i] = max(out[j, i], score * float(np.clip((1 - min(trunk, head)) / 0.3, 0, 1)))
    return out
