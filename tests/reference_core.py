"""The core stages by their definitions, one element at a time: slow, plain, without the fast code's ideas."""

import math
from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist

from stseg.arrays import Boxes, Flags, Floats, Ints, Labels, Singles
from stseg.bodies.box_fit import EDGE_GRAIN, PRIOR_NOISE
from stseg.detection.problem import BoxEvidence, DetectionProblem, PixelEvidence, ScoreParameters
from stseg.graphcut.grid_energy import GridEnergy
from stseg.occupancy.fusion import ErrorRates
from stseg.occupancy.visible_cells import SHOULDER
from stseg.records.people import Explanation


def best_pairs(gain: Floats) -> list[tuple[int, int]]:
    """Pairs of row and column, one to one, of the greatest sum; none that gains nothing."""
    rows, columns = linear_sum_assignment(np.minimum(-gain, 0.0))
    return [(j, k) for j, k in zip(rows.tolist(), columns.tolist(), strict=True) if gain[j, k] > 0]


def away_from_border(open_to_people: Flags, cell: float) -> Floats:
    """Distance of each cell's centre to the nearest centre outside, less half a cell; metres, 0 outside."""
    framed = np.pad(open_to_people, 1)
    away = np.zeros(framed.shape)
    away[framed] = (cdist(np.argwhere(framed), np.argwhere(~framed)).min(1) - 0.5) * cell
    return away[1:-1, 1:-1]


def kalman(
    state: Floats, covariance: Floats, place: Floats, noise: Floats, matrix: Floats | None = None
) -> tuple[Floats, Floats]:
    """The textbook's correction of a state by a measured place, `matrix` times the state; its first two by default."""
    matrix = np.eye(2, len(state)) if matrix is None else matrix
    gain = covariance @ matrix.T @ np.linalg.inv(matrix @ covariance @ matrix.T + noise)
    return state + gain @ (place - matrix @ state), (np.eye(len(state)) - gain @ matrix) @ covariance


PRIOR_TOLERANCE = PRIOR_NOISE.of(np.ones(1), np.zeros(1, bool))[0][0]
"""Of a box of score 1 whose feet no other box covers."""
Edge = tuple[int, int, int]
"""Two cells of a flattened volume, and the capacity between them."""


def repulsion(distance: float, parameters: ScoreParameters) -> float:
    """Cost of a pair: excluded within the hard core, linear up to the distance at which bodies touch."""
    if distance < parameters.hard_core:
        return 1e4
    apart = parameters.minimum_distance
    return 2 + 20 * (1 - distance / apart) if distance < apart else 0.0


def half_square(body: Floats, box: Floats, tolerance: Floats, width: float, height: float) -> float:
    """Half the squared distance of a box from a pillar's box in units of its tolerances; infinite far to the side."""
    left, right = np.clip(body[[0, 2]], 0, width - 1)
    top, bottom = np.clip(body[[1, 3]], 0, height - 1)
    if left >= right or top >= bottom:
        return math.inf
    middle, right_off = (left + right) / 2 - (box[0] + box[2]) / 2, right - left - box[2] + box[0]
    off = np.array([middle, right_off, top - box[1], bottom - box[3]])
    off /= max(float(body[3] - body[1]), 8.0) + EDGE_GRAIN
    off[3] = min(off[3], tolerance[4])
    off /= tolerance[:4]
    return math.inf if abs(off[0]) > 4.5 else float((off**2).sum()) / 2


def overlap(a: Floats, b: Floats) -> float:
    """Area that two boxes (left, top, right, bottom) share."""
    shared = np.minimum(a[2:], b[2:]) - np.maximum(a[:2], b[:2])
    return float(shared.clip(0).prod())


def inside(body: Floats, width: float, height: float) -> float:
    """Share of a pillar's box that lies in the image."""
    return 0.0 if np.isnan(body).any() else overlap(body, np.array([0, 0, width, height])) / overlap(body, body)


def cover(bodies: Floats, distance: Floats, width: float, height: float, i: int, k: int) -> float:
    """Share of i's box in the image that lies behind the inner four fifths of the width of k's box."""
    if np.isnan(bodies[[i, k]]).any() or not distance[k] < distance[i] - 0.1:
        return 0.0
    image = np.array([0, 0, width, height])
    seen = np.concatenate([np.maximum(bodies[i, :2], image[:2]), np.minimum(bodies[i, 2:], image[2:])])
    if not (seen[2:] > seen[:2]).all():
        return 0.0
    trunk = bodies[k] + 0.1 * (bodies[k, 2] - bodies[k, 0]) * np.array([1, 0, -1, 0])
    return min(overlap(seen, trunk) / overlap(seen, seen), 1.0)


def set_score(members: Sequence[int], problem: DetectionProblem) -> float:
    """What a set of people says of a frame: each box, pixel and walker speaks for one of them."""
    boxes, pixels, ground, parameters = problem.boxes, problem.pixels, problem.ground, problem.parameters
    total = sum(parameters.prior_log_odds + problem.size_prior[j] - problem.birth_cost[j] for j in members)
    chosen = np.array(members, int)
    gains = problem.birth_cost[chosen, None] + problem.track_gain[chosen]
    total += sum(gains[pair] for pair in best_pairs(gains))
    for i, j in combinations(members, 2):
        apart = math.dist(ground[i], ground[j]) / ((problem.breadth[i] + problem.breadth[j]) / 2)
        total -= repulsion(apart, parameters)
    total += sum(_boxes_of_view(view, members, boxes, parameters) for view in range(len(boxes.boxes)))
    total += sum(_pixels_of_view(view, members, pixels, parameters) for view in range(len(pixels.raster)))
    return float(total)


def left_by_all(boxes: BoxEvidence) -> Floats:
    """Share of the first's pillar that the second leaves, float64 (view, candidate, candidate)."""
    views, candidates = boxes.inside.shape
    left = np.ones((views * candidates, candidates))
    for row in range(len(left)):
        own = slice(boxes.occluders.start[row], boxes.occluders.start[row + 1])
        left[row, boxes.occluders.item[own]] = boxes.occluders.value[own]
    return left.reshape(views, candidates, candidates)


def _boxes_of_view(view: int, members: Sequence[int], boxes: BoxEvidence, parameters: ScoreParameters) -> float:
    total = 0.0
    gains: list[tuple[float, int, int]] = []
    for j in members:
        visible = boxes.inside[view, j] * math.prod(left_by_all(boxes)[view, j, k] for k in members)
        found = min(max(visible / parameters.full_visibility, parameters.hidden_detection_rate), 1.0)
        missing = math.log(1 - (1 - parameters.box_miss_rate) * found)
        total += missing
        worth = parameters.box_log_ratio - missing
        gains += [(worth + boxes.match[view, j, b], j, b) for b in range(boxes.boxes[view])]
    served: set[int] = set()
    taken: set[int] = set()
    for gain, j, b in sorted(gains, reverse=True):
        if gain > 0 and j not in served and b not in taken:
            served.add(j)
            taken.add(b)
            total += gain
    return total


def covered(pixels: PixelEvidence, view: int, j: int) -> Flags:
    """The raster pixels inside a candidate's outline, bool (v, u)."""
    shown = np.zeros(pixels.raster.shape[1:], bool)
    for k, (start, stop) in enumerate(pixels.spans[view, j]):
        row = pixels.first[view, j] + k
        if pixels.first[view, j] >= 0 and row < len(shown):
            shown[row, start:stop] = True
    return shown


def _pixels_of_view(view: int, members: Sequence[int], pixels: PixelEvidence, parameters: ScoreParameters) -> float:
    total = 0.0
    bodies = {j: covered(pixels, view, j) for j in members}
    for v, u in np.ndindex(*pixels.raster.shape[1:]):
        there = [j for j in members if bodies[j][v, u]]
        if there:
            nearest = min(there, key=lambda j: pixels.distance[view, j])
            scale = max(pixels.area[view, nearest], float(pixels.scale[view, v, u]))
            total += parameters.effective_observations * float(pixels.raster[view, v, u]) / scale
    return total


def interact(i: int, j: int, problem: DetectionProblem) -> bool:
    """Whether one of two candidates bears on what the other adds to a set."""
    boxes, pixels, parameters = problem.boxes, problem.pixels, problem.parameters
    room = parameters.minimum_distance * (problem.breadth[i] + problem.breadth[j]) / 2
    if math.dist(problem.ground[i], problem.ground[j]) < room:
        return True
    gains = problem.birth_cost[[i, j], None] + problem.track_gain[[i, j]]
    worth = parameters.box_log_ratio + boxes.match[:, [i, j]] - math.log(parameters.box_miss_rate)
    shared = [(worth[view, :, :number] > 0).all(0).any() for view, number in enumerate(boxes.boxes)]
    left = left_by_all(boxes)
    hidden = (left[:, i, j] < 1) | (left[:, j, i] < 1)
    overlap = [(covered(pixels, view, i) & covered(pixels, view, j)).any() for view in range(len(pixels.raster))]
    return bool((gains > 0).all(0).any() or any(shared) or hidden.any() or any(overlap))


def subsets(number: int) -> Iterator[tuple[int, ...]]:
    """All sets of candidates."""
    for size in range(number + 1):
        yield from combinations(range(number), size)


def clutter(likelihood: Singles, side: int) -> float:
    """Root mean square of the standard deviations of square cells, those cut by the border included."""
    height, width = likelihood.shape
    cells = [
        likelihood[v : v + side, u : u + side].astype(float)
        for v in range(0, height, side)
        for u in range(0, width, side)
    ]
    return math.sqrt(sum(float(np.var(cell)) for cell in cells) / len(cells))


def fused(parameters: Sequence[float], weights: Sequence[float], shares: Sequence[float]) -> float:
    """n_vis sum_i w_i term_i over the views that see a cell (KS09 eq. 7), each as far as it sees it."""
    parts = [weight * share for weight, share in zip(weights, shares, strict=True)]
    return sum(shares) * sum(part * term for part, term in zip(parts, parameters, strict=True)) / sum(parts)


def log_odds_term(likelihood: float, rates: ErrorRates) -> float:
    """What one view says of a cell (docs/how-it-works.md, Fusion)."""
    body = (1 - rates.miss) * likelihood + rates.miss * (1 - likelihood)
    empty = rates.clutter * likelihood + (1 - rates.clutter) * (1 - likelihood)
    return math.log(body / empty)


def pixels_of(footprint: Sequence[int]) -> Iterator[tuple[int, int]]:
    """Rows and columns of a footprint: left, top, width, height."""
    left, top, width, height = map(int, footprint)
    for v in range(top, top + height):
        for u in range(left, left + width):
            yield v, u


def plane_likelihood(
    bodies: Floats, heights: Floats, plane: float, expected: float, spread: float, boxes: Boxes, free: Sequence[int],
    size: tuple[int, int],
) -> float:  # fmt: skip
    """L(X, Z) of one cell: the best of these boxes and of the pillars (height, 4) that reach up to the plane."""
    best = 0.0
    for body, height in zip(bodies, heights, strict=True):
        for b in free:
            left, top, wide, tall = boxes.pixel[b]
            edges = np.clip([left, top, left + wide, top + tall], 0, [size[0] - 1, size[1] - 1] * 2)
            if height >= plane and not np.isnan(body).any():
                prior = math.exp(-0.5 * ((height - expected) / spread) ** 2)
                fit = math.exp(-half_square(body, edges, PRIOR_TOLERANCE, *map(float, size)))
                best = max(best, prior * fit * float(np.clip(boxes.score[b], 0.05, 1)))
    return best


def left_to_cell(
    likelihood: Singles, footprint: Sequence[int], explanation: Explanation, view: int, near: int, away: float,
    people_away: Floats,
) -> tuple[float, float]:  # fmt: skip
    """How much of a cell's footprint a view sees past nearer people, and the mean likelihood that is the cell's there.

    `near` is the person near the cell, -1 for nobody; distances are from the camera along the ground, metres.
    """
    step = explanation.raster_step[view]
    visible, total, pixels = 0, 0.0, list(pixels_of(footprint))
    for v, u in pixels:
        owner = int(explanation.pixel_assignment[view][v // step, u // step])
        elsewhere = owner >= 0 and owner != near
        if elsewhere and people_away[owner] < away - SHOULDER:
            continue
        visible += 1
        total += 0.0 if elsewhere else float(likelihood[v, u])
    return visible / len(pixels), total / max(visible, 1)


def neighbours(energy: GridEnergy) -> list[Edge]:
    """All edges of a window, cell by cell."""
    frames, planes, rows, columns = energy.unary.shape
    index = np.arange(energy.unary.size).reshape(energy.unary.shape)
    found: list[Edge] = []
    for t, z, y, x in np.ndindex(*energy.unary.shape):
        for (later, dz, dy, dx), capacity in zip(energy.offsets.tolist(), energy.capacity.tolist(), strict=True):
            foot = y * columns + x
            if later:
                foot = int(energy.successor[t, y, x]) if t + 1 < frames else -1
            to_z, to_y, to_x = z + dz, foot // columns + dy, foot % columns + dx
            if foot >= 0 and 0 <= to_z < planes and 0 <= to_y < rows and 0 <= to_x < columns:
                found.append((int(index[t, z, y, x]), int(index[t + later, to_z, to_y, to_x]), capacity))
    return found


def lead_ahead(motion: Ints) -> Labels:
    """Where each ground cell leads: movers first, cell by cell, then those that stand still and are in no one's way."""
    ahead = np.full(motion.shape[:3], -1, np.int32)
    for t, field in enumerate(motion):
        for moving in (True, False):
            for y, x in np.ndindex(*field.shape[:2]):
                to_y, to_x = y + int(field[y, x, 0]), x + int(field[y, x, 1])
                inside = 0 <= to_y < field.shape[0] and 0 <= to_x < field.shape[1]
                to = to_y * field.shape[1] + to_x
                if inside and bool(field[y, x].any()) == moving and to not in ahead[t]:
                    ahead[t, y, x] = to
    return ahead


def energy_of(energy: GridEnergy, labels: Flags) -> int:
    """E of a labelling, relative to everything background, in quanta."""
    flat, unary = labels.ravel().tolist(), energy.unary.ravel().tolist()
    gained = sum(u for u, occupied in zip(unary, flat, strict=True) if occupied)
    return sum(b for p, q, b in neighbours(energy) if flat[p] != flat[q]) - gained


def least_energy(energy: GridEnergy) -> tuple[int, Flags]:
    """The least energy of all labellings, and the cells that are occupied in every minimum: the smallest object set."""
    size = energy.unary.size
    labels = ((np.arange(2**size)[:, None] >> np.arange(size)) & 1).astype(bool)
    total = -(labels @ energy.unary.ravel())
    for p, q, b in neighbours(energy):
        total += b * (labels[:, p] != labels[:, q])
    return int(total.min()), labels[total == total.min()].all(0).reshape(energy.unary.shape)
