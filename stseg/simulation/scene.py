"""Specification of a simulated scene in physical quantities, and its random streams."""

import math
from dataclasses import dataclass
from enum import IntEnum
from typing import Literal

import numpy as np

from stseg.errors import ConfigError
from stseg.simulation.crowd.routes import Route
from stseg.simulation.rendering.illumination import Lamp

Kind = Literal["video", "masks", "boxes"]
KINDS: tuple[Kind, ...] = ("video", "masks", "boxes")
"""Kinds of foreground of a scene."""


@dataclass(frozen=True, slots=True)
class SceneSpec:
    """A scene to simulate. Equal specifications make equal scenes, to the last pixel.

    Raises
    ------
    ConfigError
        Where a value is out of its range.
    """

    name: str
    """The scene's name."""
    people: int
    """Number of people in the area, where those who leave are replaced; with an absence, all who ever come."""
    area: tuple[float, float]
    """Sides of the ground rectangle along x and y, metres; its centre is the origin."""
    seconds: float
    frame_rate: float = 10.0
    """Length of the recording and frames per second."""
    cameras: int = 4
    """Number of views, evenly around the area. Half of an even number are every other one of the same cameras."""
    camera_distance: float = 6.5
    camera_height: float = 2.8
    """From the area's centre along the ground, and above it, metres; each camera is a little off."""
    field_of_view: float = 66.0
    """Angle of the ideal image along its width, degrees."""
    size: tuple[int, int] = (480, 360)
    """Width and height of the images, pixels."""
    distortion: tuple[float, ...] = (-0.22, 0.05, 0.001, -0.001)
    """k1, k2, p1, p2, k3 of OpenCV's lens model; shorter lists are filled with zeros."""
    noise: float = 3.0
    """Standard deviation of the sensor's noise, grey levels."""
    light_drift: float = 0.05
    light_period: float = 20.0
    """Relative amplitude of the light's slow change, and its period in seconds."""
    lamps: tuple[Lamp, ...] = ()
    """Sudden changes of the light; they add up."""
    shadows: float = 0.35
    """Darkening of the ground by the people's shadows, 0..1."""
    quality: int = 85
    """JPEG quality of the frames, 1..100."""
    speed: tuple[float, float] = (0.6, 1.5)
    """Slowest and fastest preferred walking speed, metres per second."""
    alike: int = 0
    """Number of people (the first ones) in clothes of similar colours."""
    stay: float = 15.0
    """Mean time that a person stays, seconds."""
    absence: float = 0.0
    """Mean time after which a person who left comes back, seconds; 0 where only new people come."""
    heights: tuple[float, ...] = ()
    """Shortest and tallest person, metres, uniformly between; empty for adults."""
    cylinder: float = 0.0
    """Width of upright cylinders that stand for bodies, metres; 0 for bodies that walk."""
    length: float = 0.0
    """Their length in the direction in which they face, metres: animals are ellipses from above; 0 for as wide."""
    routes: tuple[Route, ...] = ()
    """Scripted routes, one a person; without them people walk freely."""
    kinds: tuple[Kind, ...] = KINDS
    """Kinds of foreground that are written, of `KINDS`; without video, views have no image."""
    seed: int = 1
    """Seed of all random streams."""

    def __post_init__(self) -> None:
        width, depth = self.area
        radius = math.hypot(width, depth) / 2
        self._require("people", 0 <= self.people <= 2.5 * width * depth, self.people, "0 to 2.5 a square metre")
        self._require("area", min(self.area) >= 1, self.area, "sides of at least 1 metre")
        self._require("seconds", self.frames >= 1, self.seconds, "time for at least one frame")
        self._require("frame_rate", self.frame_rate > 0, self.frame_rate, "frames per second")
        self._require("cameras", self.cameras >= 1, self.cameras, "at least one")
        away = self.camera_distance
        self._require("camera_distance", away > radius, away, f"more than {radius:.1f} m")
        self._require("camera_height", self.camera_height > 0, self.camera_height, "metres above the ground")
        self._require("field_of_view", 0 < self.field_of_view < 150, self.field_of_view, "0 to 150 degrees")
        self._require("size", min(self.size) >= 16, self.size, "images of at least 16 pixels")
        self._require("noise", self.noise >= 0, self.noise, "grey levels, 0 or more")
        self._require("light_drift", 0 <= self.light_drift < 1, self.light_drift, "0 to 1")
        self._require("light_period", self.light_period > 0, self.light_period, "seconds")
        self._require("shadows", 0 <= self.shadows <= 1, self.shadows, "0 to 1")
        self._require("quality", 1 <= self.quality <= 100, self.quality, "1 to 100")
        self._require("speed", 0 < self.speed[0] <= self.speed[1], self.speed, "the slowest, then the fastest, m/s")
        self._require("alike", self.alike >= 0, self.alike, "a number of people")
        self._require("stay", self.stay > 0, self.stay, "seconds")
        self._require("absence", self.absence >= 0, self.absence, "0 or more seconds")
        self._require("kinds", len(self.kinds) > 0 and set(self.kinds) <= set(KINDS), self.kinds, ", ".join(KINDS))
        holds = self.heights == () or (len(self.heights) == 2 and 0 < self.heights[0] <= self.heights[1])
        self._require("heights", holds, self.heights, "none, or the shortest, then the tallest, metres")
        self._require("cylinder", 0 <= self.cylinder <= 2, self.cylinder, "0 to 2 metres")
        holds = self.length == 0 or (self.cylinder > 0 and self.length <= 3)
        self._require("length", holds, self.length, "0 to 3 metres, of cylinders")
        routes = len(self.routes)
        self._require("routes", routes in (0, self.people), routes, f"none, or {self.people}, one a person")
        self._require("seed", self.seed >= 0, self.seed, "a whole number from 0")

    def _require(self, key: str, holds: bool, found: object, expected: str) -> None:
        if not holds:
            raise ConfigError(f"scene {self.name}", key, found, expected)

    @property
    def frames(self) -> int:
        """Number of frames."""
        return round(self.seconds * self.frame_rate)

    def gain(self, frame: int, phase: float) -> float:
        """Illumination gain at a frame, 1 on average; `phase` is a camera's share of the period, 0..1."""
        turns = frame / self.frame_rate / self.light_period + phase
        return 1.0 + self.light_drift * math.sin(2 * math.pi * turns)


class Topic(IntEnum):
    """Topic of a random stream."""

    CAMERA = 1
    LIGHT = 2
    ROOM = 3
    CROWD = 4
    PERSON = 5
    CLOTHES = 6
    SENSOR = 7
    DETECTOR = 8
    SPOIL = 9
    ARRIVALS = 10


def random_stream(seed: int, topic: Topic, *which: int) -> np.random.Generator:
    """Generator of one topic and item (a camera, a person, a camera's frame), equal wherever it is made."""
    return np.random.default_rng([seed, int(topic), *which])
