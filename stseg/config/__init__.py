"""One frozen dataclass per stage. What each value means physically stands below it, in the stage's module."""

from __future__ import annotations

from dataclasses import dataclass, field

from stseg.config.foreground import (
    BackgroundConfig,
    ChromaticConfig,
    CodebookConfig,
    ForegroundConfig,
    LightConfig,
    MixtureConfig,
)
from stseg.config.people import DetectionConfig, GhostConfig, LabelConfig, LevelConfig, OccupancyConfig
from stseg.config.trackers import BeliefConfig, KalmanConfig, ParticleConfig
from stseg.config.tracks import IdentityConfig, LiveConfig, SegmentationConfig, SegmentConfig

__all__ = [
    "BackgroundConfig",
    "BeliefConfig",
    "ChromaticConfig",
    "CodebookConfig",
    "Config",
    "DetectionConfig",
    "ForegroundConfig",
    "GhostConfig",
    "IdentityConfig",
    "KalmanConfig",
    "LabelConfig",
    "LevelConfig",
    "LightConfig",
    "LiveConfig",
    "MixtureConfig",
    "OccupancyConfig",
    "ParticleConfig",
    "SegmentConfig",
    "SegmentationConfig",
]


@dataclass(frozen=True)
class Config:
    """All stages."""

    foreground: ForegroundConfig = field(default_factory=ForegroundConfig)
    light: LightConfig = field(default_factory=LightConfig)
    occupancy: OccupancyConfig = field(default_factory=OccupancyConfig)
    level: LevelConfig = field(default_factory=LevelConfig)
    segmentation: SegmentationConfig = field(default_factory=SegmentationConfig)
    identity: IdentityConfig = field(default_factory=IdentityConfig)
    ghosts: GhostConfig = field(default_factory=GhostConfig)
    detection: DetectionConfig = field(default_factory=DetectionConfig)
    segments: SegmentConfig = field(default_factory=SegmentConfig)
    live: LiveConfig = field(default_factory=LiveConfig)
    kalman: KalmanConfig = field(default_factory=KalmanConfig)
    particles: ParticleConfig = field(default_factory=ParticleConfig)
    labels: LabelConfig = field(default_factory=LabelConfig)
    belief: BeliefConfig = field(default_factory=BeliefConfig)
