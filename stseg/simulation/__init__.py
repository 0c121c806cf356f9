"""Scenes with truth: a crowd that walks about a room, seen by cameras through their lenses."""

from stseg.simulation.crowd.routes import Route as Route
from stseg.simulation.film import SceneFilm as SceneFilm
from stseg.simulation.named_scenes import NAMED as NAMED
from stseg.simulation.rendering.illumination import Lamp as Lamp
from stseg.simulation.scene import SceneSpec as SceneSpec
from stseg.simulation.spoiling.spoil import Spoil as Spoil
