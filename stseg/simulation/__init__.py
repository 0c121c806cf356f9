"""Scenes with truth: a crowd that walks about a room, seen by cameras through their lenses."""

from stseg.simulation.crowd.routes import Route
from stseg.simulation.film import Film, SimulatedFrame
from stseg.simulation.named_scenes import NAMED
from stseg.simulation.rendering.illumination import Lamp
from stseg.simulation.rendering.render import RenderedView
from stseg.simulation.scene import SceneSpec
from stseg.simulation.spoiling.spoil import Spoil, SpoiledFilm

__all__ = ["NAMED", "Film", "Lamp", "RenderedView", "Route", "SceneSpec", "SimulatedFrame", "Spoil", "SpoiledFilm"]
