"""KD06 pixel by pixel, as its equations stand, without rasters of people's neighbourhoods or running products."""

from itertools import product

import numpy as np

from stseg.arrays import Bytes, Floats, Ints, Labels, Singles
from stseg.baselines.kim_davis_2006.bodies import HALF_WIDTH, LOOSENESS, PARTS
from stseg.baselines.kim_davis_2006.colours import BINS, CHROMA_SPAN, SPREAD
from stseg.geometry import Camera


def density(colour: Bytes, samples: Bytes) -> float:
    """Eq. 1 of one colour, relative to evenly spread colours; 0.05 of them are anybody's."""
    span = np.array([CHROMA_SPAN, CHROMA_SPAN, 255.0])
    off = (colour.astype(float) - samples.astype(float)) / 255 * span / SPREAD
    kernels = np.exp(-(off**2)).prod(1) * (span / (np.sqrt(np.pi) * SPREAD)).prod()
    return float(0.95 * kernels.mean() + 0.05)


def place(camera: Camera, person: Floats, height: float, pixel: Floats) -> tuple[float, float]:
    """h and w of a pixel, from projected feet and head."""
    feet, _ = camera.project(person, 0.0)
    head, _ = camera.project(person, height)
    axis = head - feet
    along = float((pixel - feet) @ axis / (axis @ axis))
    return along, float(np.linalg.norm(pixel - feet - along * axis) / np.linalg.norm(axis))


def covered(along: float, across: float) -> float:
    """Eq. 3 with a logistic W; beyond the ends, the distance from the nearest of them."""
    level = float(np.clip(along, 0, 1))
    half_width = HALF_WIDTH[min(int(level * len(HALF_WIDTH)), len(HALF_WIDTH) - 1)]
    return float(1 - 1 / (1 + np.exp(-(np.hypot(across, along - level) - half_width) / LOOSENESS)))


def part_of(along: float) -> int:
    """Legs, trunk or head."""
    return int(np.searchsorted(PARTS, along, side="right"))


def prior(camera: Camera, ground: Floats, height: Floats, pixel: Floats, k: int) -> float:
    """Eq. 4: nobody nearer covers the pixel, and person k does."""
    away = np.hypot(*(ground - camera.centre[:2]).T)
    own = covered(*place(camera, ground[k], height[k], pixel))
    nearer = [covered(*place(camera, ground[n], height[n], pixel)) for n in np.flatnonzero(away < away[k])]
    return own * float(np.prod([1 - one for one in nearer]))


def posterior(camera: Camera, ground: Floats, height: Floats, pixel: Floats, likely: Floats) -> tuple[int, float]:
    """Eq. 2: the likeliest person (-1 for a stranger) and their share, given P(x | k) float (n, part)."""
    places = [place(camera, g, h, pixel) for g, h in zip(ground, height, strict=True)]
    priors = [prior(camera, ground, height, pixel, k) for k in range(len(ground))]
    joint = [own * likely[k, part_of(places[k][0])] for k, own in enumerate(priors)]
    nobody = float(np.prod([1 - covered(*one) for one in places]))
    best = int(np.argmax(joint))
    return (best if joint[best] >= nobody else -1), joint[best] / (sum(joint) + nobody)


def median_line(distances: Floats) -> float:
    """The place whose median of squared distances is least, of all that lie amid two of them."""
    amid = [(a + b) / 2 for a, b in product(distances, repeat=2)]
    half = len(distances) // 2
    worst = [np.sort(np.abs(distances - middle))[half] for middle in amid]
    return float(min(worst))


def ground_line(camera: Camera, pixel: Floats) -> Floats:
    """The ground line below the vertical whose image passes through a pixel: a, b, c with a^2 + b^2 = 1, up to sign."""
    feet = camera.back_project(pixel)
    way = feet - camera.centre[:2]
    normal = np.array([way[1], -way[0]]) / np.linalg.norm(way)
    return np.append(normal, -normal @ feet)


def meeting(axes: Floats, held: float, before: Floats) -> Floats:
    """Eq. 5 by least squares of rows, axes (view, 4)."""
    rows = np.concatenate([axes[:, 3:] * axes[:, :2], held * np.eye(2)])
    right = np.concatenate([-axes[:, 3] * axes[:, 2], held * before])
    return np.asarray(np.linalg.lstsq(rows, right, rcond=None)[0])


def misfit(
    camera: Camera, ground: Floats, height: Floats, ideal: Singles, bins: Labels, reference: Floats, areas: Floats,
    ordinary: float,
) -> Floats:  # fmt: skip
    """Eqs 6 and 7: the sum over the parts of d^2, float64 (n,)."""
    total = np.zeros(len(ground))
    for k, (person, tall) in enumerate(zip(ground, height, strict=True)):
        counts = np.zeros((len(PARTS), int(np.prod(BINS))))
        for v, u in np.ndindex(bins.shape):
            if prior(camera, ground, height, ideal[v, u].astype(float), k) > 0.5:
                counts[part_of(place(camera, person, tall, ideal[v, u].astype(float))[0]), bins[v, u]] += 1
        feet, head = camera.project(person, 0.0)[0], camera.project(person, tall)[0]
        for r in range(len(PARTS)):
            if counts[r].sum() and reference[k, r].sum():
                share = min(counts[r].sum() / max(areas[r] * float(((head - feet) ** 2).sum()), 1.0), 1.0)
                square = 1 - np.sqrt(reference[k, r] * counts[r] / counts[r].sum()).sum()
                total[k] += share * square + (1 - share) * ordinary
            else:
                total[k] += ordinary
    return total


def boxes_everywhere(people: int, shape: tuple[int, int]) -> Ints:
    """Everybody is sought in the whole raster."""
    return np.tile(np.array([0, shape[0], 0, shape[1]]), (people, 1))
