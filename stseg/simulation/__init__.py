"""Scenes with truth: a crowd that walks about a room, seen by cameras through their lenses."""

from stseg.simulation.crowd.routes import Route
from stseg.simulation.film import RenderedFrame, SceneFilm
from stseg.simulation.named_scenes import NAMED
from stseg.simulation.rendering.illumination import Lamp
from stseg.simulation.rendering.render import RenderedView
from stseg.simulation.scene import SceneSpec
from stseg.simulation.spoiling.spoil import Spoil

__all__ = ["NAMED", "Lamp", "RenderedFrame", "RenderedView", "Route", "SceneFilm", "SceneSpec", "Spoil"]
