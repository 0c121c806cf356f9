"""Scenes with truth: a crowd that walks about a room, seen by cameras through their lenses."""

from stseg.simulate.film import Film, Moment
from stseg.simulate.lamps import Lamp
from stseg.simulate.named import NAMED
from stseg.simulate.render import View
from stseg.simulate.routes import Route
from stseg.simulate.scene import SceneSpec

__all__ = ["NAMED", "Film", "Lamp", "Moment", "Route", "SceneSpec", "View"]
