"""Planes, lenses, cameras, rigs and grids."""

from stseg.geometry.camera import Camera as Camera
from stseg.geometry.grid import Grid as Grid
from stseg.geometry.lens import Lens as Lens
from stseg.geometry.rig import Rig as Rig
