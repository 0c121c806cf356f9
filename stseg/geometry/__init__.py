"""Planes, lenses, cameras, rigs and grids."""

from stseg.geometry.camera import Camera
from stseg.geometry.grid import Grid
from stseg.geometry.lens import Lens
from stseg.geometry.rig import Rig

__all__ = ["Camera", "Grid", "Lens", "Rig"]
