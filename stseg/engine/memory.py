"""Memory and time that a ground takes, estimated from the rig before any work; memory is compared with the machine's.

Measured: a ground of 20 m x 20 m and 7 views, 0.9 GiB; 40 m x 40 m, 3.8 GiB; tables of 100 m x 100 m, cells of 2 m and
2 views, 0.5 GiB of boxes and 0.7 GiB of pixels.
"""

from math import prod
from pathlib import Path

from stseg.config import Config
from stseg.engine.workers.worker_processes import PROCESS_MEMORY
from stseg.errors import ConfigError
from stseg.geometry import Rig
from stseg.io.machine import free_memory

_CELL = 315
"""Bytes of each cell and view: footprints, and the volumes of a window."""
_TABLE_POINT, _TABLE_STEP = 100, 0.12
"""Bytes of each point of a view's table of projected places, and distance of these, metres (`bodies.pillars`)."""
_PILLAR = 160
"""Bytes of each pillar of the birth lattice in a view: its box, its outline, its place in indices."""

_TABLE_SECONDS = 3e-4
"""Time in which the tables of a square metre are made for a view, seconds, about: tables of 100 m x 100 m, 3 s."""
_LONG_TABLES = 10.0
"""Time from which on they are announced, seconds."""


def process_memory(rig: Rig, config: Config) -> int:
    """Bytes that a process of a run is taken to need."""
    return PROCESS_MEMORY + _of_cells(rig) + _of_ground(rig, config)


def require_memory(rig: Rig, config: Config, path: Path | str) -> None:
    """Raise ConfigError where a process needs more memory than is free; `path` names the rig."""
    needed, free = process_memory(rig, config), free_memory()
    if needed <= free:
        return
    takes = f"about {needed / 2**30:.1f} GiB of memory with {len(rig.cameras)} cameras"
    fits = f"what fits into the {free / 2**30:.1f} GiB that are free"
    if _of_cells(rig) > _of_ground(rig, config):
        found = f"{rig.grid.cell!r}, whose {prod(rig.grid.shape):.1e} cells take {takes}"
        raise ConfigError(path, "grid.cell", found, f"{fits}: larger cells, or a smaller ground")
    x, y = (high - low for low, high in (rig.grid.x, rig.grid.y))
    remedy = "a smaller ground (are these centimetres?), or a larger detection.lattice_spacing"
    raise ConfigError(path, "scene.x, scene.y", f"{x:g} m x {y:g} m, which take {takes}", f"{fits}: {remedy}")


def ground_note(rig: Rig) -> str:
    """A line on the time before the first frame, where a large ground makes it long; else nothing."""
    x, y = (high - low for low, high in (rig.grid.x, rig.grid.y))
    seconds = len(rig.cameras) * x * y * _TABLE_SECONDS
    ground = f"tables of a ground of {x:g} m x {y:g} m in {len(rig.cameras)} views"
    return f"{ground}: about {seconds:.0f} s of work (is it in centimetres?)" if seconds > _LONG_TABLES else ""


def _of_cells(rig: Rig) -> int:
    return len(rig.cameras) * prod(rig.grid.shape) * _CELL


def _of_ground(rig: Rig, config: Config) -> int:
    """Bytes of what goes with the area and not with its cells."""
    area = (rig.grid.x[1] - rig.grid.x[0]) * (rig.grid.y[1] - rig.grid.y[0])
    pillars = len(config.body.heights) / config.detection.lattice_spacing**2
    return int(len(rig.cameras) * area * (_TABLE_POINT / _TABLE_STEP**2 + _PILLAR * pillars))
