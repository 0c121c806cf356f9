"""Slow plain definitions of the pixel labels, straight from HW12 eqs 13 to 20."""

from collections.abc import Sequence
from itertools import product

import numpy as np

from stseg.arrays import Bytes, Flags, Floats, Ints, Singles
from stseg.config import LabelConfig
from stseg.pixel_labels.label_likelihood import LabelLikelihood


def nearest_shares(drawn: Sequence[Flags], distance: Floats) -> Floats:
    """Shares of all combinations of draws in which nobody, or each person, is the nearest; float64 (n + 1, v, u).

    `drawn` holds for each person bool (draw, v, u): what each of their pillars covers.
    """
    order = np.argsort(-distance, kind="stable")
    shape, count = drawn[0].shape[1:], 0
    shares = np.zeros((len(drawn) + 1, *shape))
    for chosen in product(*(range(len(own)) for own in drawn)):
        label = np.zeros(shape, int)
        for j in order:  # far to near
            label[drawn[j][chosen[j]]] = j + 1
        for k in range(len(drawn) + 1):
            shares[k] += label == k
        count += 1
    return shares / count


def dense(shown: LabelLikelihood) -> Floats:
    """p_0, p_1, ... in the window, float64 (n + 1, v, u)."""
    edges, first = shown.people.edges, shown.people.first
    shares = np.zeros((len(edges) + 1, *shown.background.shape))
    shares[0] = shown.background
    for j, (left, top, right, bottom) in enumerate(edges.tolist()):
        own = shown.people.share[first[j] : first[j + 1]].reshape(bottom - top, right - left)
        shares[j + 1, top - shown.top : bottom - shown.top, left - shown.left : right - shown.left] = own
    return shares


def adjacency(one: Bytes, other: Bytes, config: LabelConfig) -> float:
    """c2 max(g, 0) of two colours, nats."""
    difference = float(np.linalg.norm(one.astype(float) - other.astype(float)))
    sigmoid = 1 / (1 + np.exp((difference - config.contrast_limit) / config.contrast_slope))
    return config.boundary_weight * max(2 * float(sigmoid) - 1, 0.0)


def energy(label: Ints, foreground: Singles, image: Bytes, shares: Floats, config: LabelConfig) -> float:
    """E of a labelling (v, u) of a window, nats."""
    total, least = 0.0, config.outlier_rate / len(shares)
    rows, columns = label.shape
    for v, u in product(range(rows), range(columns)):
        q, own = foreground[v, u], label[v, u]
        total += config.foreground_weight * (q if own == 0 else 1 - q) - np.log(shares[own, v, u] + least)
        for to_v, to_u in ((v, u + 1), (v + 1, u)):
            if to_v < rows and to_u < columns and label[to_v, to_u] != own:
                total += adjacency(image[v, u], image[to_v, to_u], config)
    return total
