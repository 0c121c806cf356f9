"""How far a rig is from the true one, whatever world it was made in.

    python tools/experiment.py rig TRUE.toml MADE.toml [-o MOVED.toml] [--keep-scale]

The made rig is moved by the similarity that brings its ground nearest to the true one (with --keep-scale, by turn and
shift alone: what a rig with a known distance is worth). Then, for the cells of the true grid that each true camera sees
on the ground: how far is the place that the made camera shows at the same pixel? And for points at head height above
them: how high does the made camera have them, above the true place? MOVED.toml is the made rig in the true world with
the true grid and streams, for `stseg run` and `stseg evaluate` against the same truth.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np

from stseg.arrays import Complexes, Floats
from stseg.geometry import Camera, Rig
from stseg.io.recording.recording import Recording
from stseg.io.recording.rigs import read_rig, write_rig

HEAD = 1.7
"""Metres."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("true", type=Path)
    parser.add_argument("made", type=Path)
    parser.add_argument("-o", "--output", type=Path)
    parser.add_argument("--keep-scale", action="store_true")
    options = parser.parse_args()
    true, made = read_rig(options.true), read_rig(options.made)
    factor, shift = similarity(true.rig, made.rig, options.keep_scale)
    moved = replace(true.rig, cameras=tuple(moved_camera(camera, factor, shift) for camera in made.rig.cameras))
    print(f"scale: {abs(factor):.4f}")
    print("camera      ground cm: median  95 %     head height cm: median  95 %")
    rows = [errors(*pair, true.rig) for pair in zip(true.rig.cameras, moved.cameras, strict=True)]
    for camera, row in zip(true.rig.cameras, rows, strict=True):
        print(f"{camera.name:12}{line(row)}")
    print(f"{'all':12}{line((np.concatenate([row[0] for row in rows]), np.concatenate([row[1] for row in rows])))}")
    if options.output is not None:
        sources = tuple(
            replace(source, offset=own.offset, on_missing=own.on_missing)
            for source, own in zip(true.sources, made.sources, strict=True)
        )
        write_rig(options.output, Recording(options.output, moved, sources))


def similarity(true: Rig, made: Rig, keep_scale: bool) -> tuple[complex, complex]:
    """Factor and shift from the made ground to the true one, by least squares over what the true cameras see."""
    pairs = [seen_ground(*cameras, true) for cameras in zip(true.cameras, made.cameras, strict=True)]
    x, y = (np.concatenate([pair[k] for pair in pairs]) for k in (1, 0))
    known = ~np.isnan(x)
    x, y = x[known], y[known]
    factor = np.vdot(x - x.mean(), y - y.mean()) / np.vdot(x - x.mean(), x - x.mean())
    if keep_scale:
        factor /= abs(factor)
    return complex(factor), complex(y.mean() - factor * x.mean())


def seen_ground(true: Camera, made: Camera, rig: Rig) -> tuple[Complexes, Complexes]:
    """Cells that the true camera sees, and where the made one has them, as x + iy."""
    ground = rig.grid.ground[rig.grid.inside()]
    pixel, ahead = true.project(ground, 0.0)
    seen = ahead & true.inside(pixel)
    return complex_of(ground[seen]), complex_of(made.back_project(pixel[seen]))


def complex_of(ground: Floats) -> Complexes:
    """x + iy of ground points (n, 2)."""
    return np.asarray(ground[:, 0] + 1j * ground[:, 1], np.complex128)


def moved_camera(camera: Camera, factor: complex, shift: complex) -> Camera:
    """A camera in the world that points factor z + shift are in."""
    move = np.array([[factor.real, -factor.imag, shift.real], [factor.imag, factor.real, shift.imag], [0, 0, 1]])
    return replace(camera, ground=camera.ground @ np.linalg.inv(move), vertical=camera.vertical / abs(factor))


def errors(true: Camera, made: Camera, rig: Rig) -> tuple[Floats, Floats]:
    """Distances on the ground and errors of height at the head, metres; nan where the made camera has no ground."""
    ground, shown = seen_ground(true, made, rig)
    above = rig.grid.ground[rig.grid.inside()]
    pixel, ahead = true.project(above, HEAD)
    seen = ahead & true.inside(pixel)
    return np.abs(shown - ground), height_errors(made, above[seen], pixel[seen])


def height_errors(made: Camera, ground: Floats, pixel: Floats) -> Floats:
    """How much too high or low the made camera has points at head height, metres, float64 (n,)."""
    low, high = (made.project(ground, height)[0] for height in (HEAD - 0.1, HEAD + 0.1))
    way = (high - low) / 0.2
    return np.asarray(np.abs(((pixel - (low + high) / 2) * way).sum(axis=1) / (way**2).sum(axis=1)))


def line(row: tuple[Floats, Floats]) -> str:
    ground, head = (100 * one for one in row)
    figures = [np.nanmedian(ground), np.nanpercentile(ground, 95), np.nanmedian(head), np.nanpercentile(head, 95)]
    return "{:18.1f}{:7.1f}{:24.1f}{:7.1f}".format(*figures)
