"""The job of a run: recording, configuration, tracker and frames, which all its segments share."""

from dataclasses import dataclass, field
from functools import cached_property

from stseg.arrays import Rows
from stseg.config import Config
from stseg.engine.offline.segments import Segment, find_gaps, longest_absence, segments
from stseg.engine.pipeline import Pipeline, decides_by_appearance
from stseg.identities.association import NO_KNOWN_PEOPLE
from stseg.io.detections.source_detections import appearance_axes
from stseg.io.recording.aligned_stream import StreamIndex
from stseg.io.recording.recording import Recording
from stseg.io.runfile.layout import VolumeKind
from stseg.trackers import find_tracker


@dataclass(frozen=True)
class Job:
    """The input of a run."""

    recording: Recording
    config: Config
    tracker: str
    """The streams, the constants of all stages, and the tracker's name."""
    volume: VolumeKind
    """The part of the volume that is kept: all of it, the surroundings of tracks, or nothing."""
    first: int
    stop: int
    """The frames of the run, half open."""
    streams: StreamIndex
    """Lengths and frame times of the streams (`stseg.io.recording.aligned_stream`)."""
    known: Rows = field(default_factory=lambda: NO_KNOWN_PEOPLE)
    """KNOWN_PERSON (k,): people of earlier recordings."""

    @cached_property
    def read(self) -> Recording:
        """The recording with images no larger than the foreground needs, and none beside detections in vain."""
        reduced = self.recording.reduced(self.config.foreground.body_rows)
        wanted = decides_by_appearance(find_tracker(self.tracker), self.config)
        return reduced if wanted else reduced.without_images()

    def gaps(self) -> list[tuple[int, int]]:
        """Half-open ranges of frames in which no camera shows anything, longer than any track is continued unseen."""
        longest = longest_absence(self.config.tracking) * self.recording.rig.frame_rate
        return find_gaps(self.streams.filled_ranges(self.recording), self.first, self.stop, longest)

    def segments(self) -> list[Segment]:
        """The segments of the run, in the order of time."""
        return segments(self.recording.rig.frame_rate, self.config, self.first, self.stop, self.gaps())

    def pipeline(self) -> Pipeline:
        """The stages, with their tables."""
        sources = [source.source.kind for source in self.recording.sources]
        kinds = ["boxes" if kind in ("boxes", "instances") else "pixels" for kind in sources]
        return Pipeline(self.read.reduced_rig, kinds, self.config, self.tracker, appearance_axes(self.recording))
