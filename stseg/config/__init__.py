"""Configuration: one frozen dataclass for each section; meaning and unit of a key stand below it."""

from dataclasses import dataclass, field, fields

from stseg.config.detection import DetectionConfig as DetectionConfig
from stseg.config.detection import ErrorRateConfig as ErrorRateConfig
from stseg.config.detection import LabelConfig as LabelConfig
from stseg.config.detection import OccupancyConfig as OccupancyConfig
from stseg.config.detection import ProposalConfig as ProposalConfig
from stseg.config.foreground import BackgroundConfig as BackgroundConfig
from stseg.config.foreground import ChromaticConfig as ChromaticConfig
from stseg.config.foreground import CodebookConfig as CodebookConfig
from stseg.config.foreground import ForegroundConfig as ForegroundConfig
from stseg.config.foreground import IlluminationConfig as IlluminationConfig
from stseg.config.foreground import MixtureConfig as MixtureConfig
from stseg.config.trackers import BeliefConfig as BeliefConfig
from stseg.config.trackers import KalmanConfig as KalmanConfig
from stseg.config.trackers import ParticleConfig as ParticleConfig
from stseg.config.tracking import BodyConfig as BodyConfig
from stseg.config.tracking import LiveConfig as LiveConfig
from stseg.config.tracking import MotionConfig as MotionConfig
from stseg.config.tracking import SegmentationConfig as SegmentationConfig
from stseg.config.tracking import SegmentConfig as SegmentConfig
from stseg.config.tracking import TrackingConfig as TrackingConfig


@dataclass(frozen=True)
class Config:
    """All sections, in the order of the data."""

    body: BodyConfig = field(default_factory=BodyConfig)
    motion: MotionConfig = field(default_factory=MotionConfig)
    foreground: ForegroundConfig = field(default_factory=ForegroundConfig)
    illumination: IlluminationConfig = field(default_factory=IlluminationConfig)
    detection: DetectionConfig = field(default_factory=DetectionConfig)
    proposals: ProposalConfig = field(default_factory=ProposalConfig)
    occupancy: OccupancyConfig = field(default_factory=OccupancyConfig)
    error_rates: ErrorRateConfig = field(default_factory=ErrorRateConfig)
    segmentation: SegmentationConfig = field(default_factory=SegmentationConfig)
    tracking: TrackingConfig = field(default_factory=TrackingConfig)
    segments: SegmentConfig = field(default_factory=SegmentConfig)
    live: LiveConfig = field(default_factory=LiveConfig)
    kalman: KalmanConfig = field(default_factory=KalmanConfig)
    particles: ParticleConfig = field(default_factory=ParticleConfig)
    belief: BeliefConfig = field(default_factory=BeliefConfig)
    labels: LabelConfig = field(default_factory=LabelConfig)

    def __repr__(self) -> str:
        """The values that are not the defaults."""
        pairs = ((section.name, getattr(self, section.name)) for section in fields(self))
        given = [
            f"{name}.{key.name}={getattr(values, key.name)!r}"
            for name, values in pairs
            for key in fields(values)
            if getattr(values, key.name) != getattr(type(values)(), key.name)
        ]
        return f"Config({', '.join(given) or 'the defaults'})"
