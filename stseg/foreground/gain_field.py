"""Local illumination change: a smooth field of gains.

A lamp lights what is near it, a cloud's shadow has borders. The logarithm of the ratio of image to background is then
smooth over the view wherever background shows, and people scatter. So it is fitted on a coarse raster of nodes,

    E(f) = sum_pixels w_p rho(|r_p - f(p)|) + stiffness sum_neighbours |f_a - f_b|^2,   rho(d) = log(1 + d^2 / s^2),

bilinear between the nodes, by weighted least squares with a scale s that falls from all ratios to those of the noise
(graduated non-convexity: Blake and Zisserman 1987), so that it starts where most pixels are and ends on those that
agree. w_p is the probability that a pixel showed background before the light changed.
"""

import numpy as np
from scipy import sparse

from stseg.arrays import Bytes, Floats, Singles

_NODES = (12, 16)  # down and across
_SAMPLES = 6000  # pixels; ample for so few nodes
_SCALES = (0.8, 0.5, 0.3, 0.2, 0.12, 0.08, 0.05, 0.05)  # of the natural logarithm of the ratio
_STIFFNESS = 0.05  # of a pair of nodes, against the pixels of one node
_DARKEST, _BRIGHTEST = 12.0, 250.0  # grey levels: below, rounding spoils the ratio; above, the sensor is saturated
_FARTHEST = 1.1  # of that logarithm: gains beyond a third and three are no light


def gain_field(image: Bytes, background: Singles, empty: Singles) -> Singles:
    """Gain of the background at each pixel since it was learned.

    Parameters
    ----------
    image : uint8 (v, u, 3)
    background : float32 (v, u, 3)
        Grey levels of the background in the light that it was learned in.
    empty : float32 (v, u)
        Probability that each pixel showed background before the light changed, 0..1.

    Returns
    -------
    float32 (v, u, 3)
        Factors within 1/3..3; 1 everywhere if no pixel is usable.
    """
    height, width = image.shape[:2]
    step = max(1, round((height * width / _SAMPLES) ** 0.5))
    observed = image[::step, ::step].astype(np.float64)
    expected = background[::step, ::step].astype(np.float64)
    usable = ((np.minimum(observed, expected) >= _DARKEST) & (np.maximum(observed, expected) <= _BRIGHTEST)).all(-1)
    weight = np.where(usable, empty[::step, ::step], 0.0).ravel()
    ratio = np.log(np.maximum(observed, 1.0) / np.maximum(expected, 1.0)).reshape(-1, 3)
    down, across = (_tents(length, count) for length, count in zip((height, width), _NODES, strict=True))
    pixels = sparse.csr_array(sparse.kron(sparse.csr_array(down[::step]), sparse.csr_array(across[::step])))
    nodes = _fit(ratio, weight, pixels).reshape(*_NODES, 3)
    field = np.einsum("va,abc->vbc", down, nodes)
    field = np.einsum("ub,vbc->vuc", across, np.clip(field, -_FARTHEST, _FARTHEST))
    return np.asarray(np.exp(field), np.float32)


def _fit(ratio: Floats, weight: Floats, pixels: sparse.csr_array) -> Floats:
    """The field at the nodes, float64 (node, 3), of ratios (n, 3) at pixels that are mixtures (n, node) of nodes."""
    used = np.flatnonzero(weight > 0)
    ratio, weight, pixels = ratio[used], weight[used], pixels[used]
    smooth = _STIFFNESS * max(len(used), 1) / pixels.shape[1] * _roughness()
    # Decides only where no pixel and no neighbour does.
    smooth += 1e-6 * np.eye(len(smooth))
    nodes = np.zeros((pixels.shape[1], 3))
    trust = weight
    for scale in _SCALES:
        weighed = pixels.multiply(trust[:, None]).tocsr()
        nodes = _solve((weighed.T @ pixels).toarray() + smooth, weighed.T @ ratio)
        off = ((ratio - pixels @ nodes) ** 2).sum(axis=1)
        trust = weight / (1.0 + off / scale**2)
    return nodes


def _solve(matrix: Floats, right: Floats) -> Floats:
    """The solution of a positive definite system that couples neighbouring nodes only (banded Cholesky)."""
    band = _NODES[1] + 2
    diagonals = [np.pad(np.diagonal(matrix, -below), (0, below)) for below in range(band)]
    from scipy.linalg import solveh_banded  # few runs see a sudden change of light

    return np.asarray(solveh_banded(np.stack(diagonals), right, lower=True))


def _roughness() -> Floats:
    """The quadratic form that sums squared differences of neighbouring nodes, float64 (node, node)."""
    down, across = (np.diff(np.eye(count), axis=0) for count in _NODES)
    return np.asarray(np.kron(down.T @ down, np.eye(_NODES[1])) + np.kron(np.eye(_NODES[0]), across.T @ across))


def _tents(length: int, nodes: int) -> Floats:
    """Linear interpolation weights of the nodes along a side at each of its pixels, float64 (length, nodes)."""
    place = np.linspace(0.0, nodes - 1.0, length)
    return np.asarray(np.maximum(0.0, 1.0 - np.abs(place[:, None] - np.arange(nodes))))
