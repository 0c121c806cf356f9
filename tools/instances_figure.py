"""Draw how boxes give one likelihood for each plane: docs/figures/instances.svg (METHODS 3 'Instances').

    python tools/instances_figure.py [docs/figures/instances.svg]

One camera sees two people; of the second a detector finds the upper half alone, since the first hides the rest. Left,
the boxes and the pillars of three cells. Right, for each cell the likelihood on ten planes: from the boxes, as the
engine computes it, and what a union of the boxes would say.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from stseg.arrays import Floats, Singles
from stseg.config import GhostConfig
from stseg.geometry import Camera, Grid
from stseg.geometry.bodies import BodyTable
from stseg.model.box_fit import TOLERANCE
from stseg.occupancy.box_planes import fill_match_of_planes
from stseg.simulation import SceneSpec
from stseg.simulation.cameras import build_rig

PAGE = Path(__file__).parents[1] / "docs" / "figures" / "instances.svg"
AWAY = np.array([[-0.6, 0.0], [0.4, 0.0], [0.7, 0.35]])
"""Metres from the camera and to its side, from the area's centre: where the first person stands, a place that their box
covers too, where the second stands."""
NAMES = ("where A stands", "1 m behind A", "where B stands")
COLOURS = ("#0072b2", "#d55e00", "#009e73")
TALL = np.array([1.75, 1.70])
"""Metres: heights of the two people."""
CROPPED = 0.55
"""Share of the second person's box that is found."""
SCALE = 2.0
LEFT, TOP, WIDTH, HEIGHT = 155.0, 85.0, 150.0, 170.0
"""The part of the image that is drawn, pixels."""


def scene() -> tuple[Camera, Grid]:
    """A camera and the grid."""
    spec = SceneSpec(name="figure", people=0, area=(4.0, 4.0), seconds=1.0, camera_distance=5.0, distortion=())
    rig = build_rig(spec)
    return rig.cameras[0], rig.grid


def places(camera: Camera) -> Floats:
    """The three cells on the ground, metres, float64 (3, 2)."""
    along = -camera.centre[:2] / np.hypot(*camera.centre[:2])
    return np.asarray(AWAY @ np.stack([along, along[::-1] * (1, -1)]))


def found_boxes(table: BodyTable, ground: Floats) -> Floats:
    """What the detector finds: left, top, right, bottom, float64 (2, 4)."""
    boxes = table.boxes_of(ground[[0, 2]], TALL)
    boxes[1, 3] = boxes[1, 1] + CROPPED * (boxes[1, 3] - boxes[1, 1])
    return np.asarray(boxes)


def per_plane(table: BodyTable, ground: Floats, grid: Grid, boxes: Floats) -> Singles:
    """Likelihood of the three cells on each plane, float32 (plane, 3)."""
    config = GhostConfig()
    heights = np.asarray(config.heights)
    bodies = table.boxes(ground, heights).reshape(len(heights), 1, 3, 4).astype(np.float32)
    likelihood = np.zeros((grid.planes, 1, 3), np.float32)
    nobody, (width, height) = np.full((1, 3), -1), map(float, table.size)
    fill_match_of_planes(
        bodies, heights, config.height_spread, config.height_mean, np.zeros(0), grid.heights, boxes, TOLERANCE,
        np.zeros(2), np.full(2, -1), nobody, width, height, likelihood,
    )  # fmt: skip
    return likelihood[:, 0]


def union(camera: Camera, ground: Floats, grid: Grid, boxes: Floats) -> Floats:
    """Whether each cell's pixel on each plane lies in some box, float64 (plane, 3)."""
    inside = np.zeros((grid.planes, 3))
    for plane, height in enumerate(grid.heights):
        pixel, _ = camera.project(ground, float(height))
        for box in boxes:
            inside[plane] += ((pixel >= box[:2]) & (pixel < box[2:])).all(-1)
    return inside.clip(0, 1)


def rectangle(box: Floats, style: str) -> str:
    """A box of the image."""
    x, y = SCALE * (box[0] - LEFT), SCALE * (box[1] - TOP)
    width, height = SCALE * (box[2:] - box[:2])
    return f'<rect x="{x:.1f}" y="{y:.1f}" width="{width:.1f}" height="{height:.1f}" {style}/>'


def text(x: float, y: float, words: str, style: str = "") -> str:
    """Words."""
    return f'<text x="{x:.1f}" y="{y:.1f}" {style}>{words}</text>'


def picture(table: BodyTable, ground: Floats, boxes: Floats) -> list[str]:
    """The boxes, and the pillars of 1.5 to 1.9 m at the cells."""
    parts = [f'<rect width="{SCALE * WIDTH}" height="{SCALE * HEIGHT}" fill="#f2f2f2"/>']
    parts += [rectangle(box, 'fill="#bbbbbb" fill-opacity="0.6" stroke="#222222" stroke-width="2"') for box in boxes]
    for body in table.boxes(ground, np.array([1.5, 1.7, 1.9])):
        for box, colour in zip(body, COLOURS, strict=True):
            parts.append(rectangle(box, f'fill="none" stroke="{colour}" stroke-dasharray="4 3"'))
    for box, name in zip(boxes, "AB", strict=True):
        parts.append(text(SCALE * (box[0] - LEFT) + 4, SCALE * (box[1] - TOP) + 16, name, 'font-weight="bold"'))
    return parts


def bars(x: float, cell: int, grid: Grid, likelihood: Singles, covered: Floats) -> list[str]:
    """One cell's likelihoods, the lowest plane at the bottom."""
    row, wide = SCALE * HEIGHT / (grid.planes + 2), 80.0
    parts = [text(x, 16, NAMES[cell], f'fill="{COLOURS[cell]}" font-weight="bold"')]
    for plane, height in enumerate(grid.heights):
        y = row * (grid.planes - plane)
        parts += [
            f'<rect x="{x}" y="{y:.1f}" width="{wide * covered[plane, cell]:.1f}" height="{row * 0.8:.1f}" '
            'fill="none" stroke="#888888"/>',
            f'<rect x="{x}" y="{y:.1f}" width="{wide * likelihood[plane, cell]:.1f}" height="{row * 0.8:.1f}" '
            f'fill="{COLOURS[cell]}"/>',
        ]
        if cell == 0:
            parts.append(text(x - 6, y + row * 0.65, f"{height:.1f} m", 'text-anchor="end"'))
    return parts


def figure() -> str:
    """The whole figure."""
    camera, grid = scene()
    table = BodyTable.of(camera, grid)
    ground = places(camera)
    boxes = found_boxes(table, ground)
    likelihood, covered = per_plane(table, ground, grid, boxes), union(camera, ground, grid, boxes)
    parts = picture(table, ground, boxes)
    for cell in range(3):
        parts += bars(SCALE * WIDTH + 60 + 120 * cell, cell, grid, likelihood, covered)
    width, height = SCALE * WIDTH + 60 + 3 * 120, SCALE * HEIGHT
    key = "filled: likelihood from the boxes; outlined: from their union"
    parts.append(text(SCALE * WIDTH + 60, height - 6, key))
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {height:.0f}" '
            'font-family="sans-serif" font-size="12">',
            f'<rect width="{width:.0f}" height="{height:.0f}" fill="white"/>',
            *parts,
            "</svg>\n",
        ]
    )


def main() -> None:
    """Write the figure."""
    page = Path(sys.argv[1]) if len(sys.argv) > 1 else PAGE
    page.write_text(figure(), encoding="utf-8")
    print(f"wrote {page}")


if __name__ == "__main__":
    main()
