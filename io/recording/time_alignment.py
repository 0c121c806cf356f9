"""When each camera's frames were taken, and so which of them shows which tick of the recording's clock.

Frame k of the recording is the scene k / frame_rate seconds after its start. A camera of which nothing else is known
shows it in its own frame k - offset. Where its files state times, and these are believed, it shows it in the frame that
was taken nearest to then; where there is none near, it is blind. What is believed, unless the rig says it (`clock`):

1. Stamps within half a frame of the frames' numbers: there is nothing to decide.
2. Stamps that vary come from a clock and are believed. (Those of AVI are none, see `stseg.io.recording.time_stamps`.)
3. Stamps of one constant other rate may come from a header. They are believed where another camera keeps the rig's
   rate, by 1 or 2, but not if this camera then has as many frames as that one: it is the header that is wrong.
4. All else is counted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from stseg.arrays import Flags, Floats, Ints
from stseg.errors import SourceError
from stseg.io.recording.recording import CameraSource, Recording
from stseg.io.recording.source_files import source_parts
from stseg.io.recording.time_stamps import TimeStamps, concatenate_files, have_stamps, interpret_stamps, require_starts

_JITTER = 0.5
"""How much farther than the last frame a new one may lie and be shown instead, ticks: else a camera whose frames lie
between two ticks would show one twice and skip the next whenever they are early or late by a little."""
_ALIKE = 0.01
"""How far the numbers of frames of two cameras may differ and still be the same, relative."""
_TOGETHER = 1.0
"""Cameras that go by time end together where they end within so much of each other, seconds."""


@dataclass(frozen=True)
class TimeAlignment:
    """Which frame of each camera shows which tick.

    Attributes
    ----------
    shown : int64 (tick,) or None each
        `CameraSource.shown` of each camera.
    notes
        What a user should be told, one line each.
    """

    shown: tuple[Ints | None, ...]
    notes: tuple[str, ...]


@dataclass(frozen=True)
class _Files:
    """One camera's files: whether they state times, what these say, and where the frames lie by their numbers alone."""

    name: str
    source: CameraSource
    states: bool
    stamps: TimeStamps | None
    counted: Floats

    @property
    def regular(self) -> bool:
        """Whether its stamps say no more than its frames' numbers."""
        return self.stamps is not None and self.stamps.fits(self.counted)

    @property
    def keeps_rate(self) -> bool:
        """Whether its stamps are known to be of the clock that ticks at the rig's rate."""
        return self.stamps is not None and (self.regular or not self.stamps.steady)


def align_in_time(recording: Recording, times: Sequence[Sequence[Floats]]) -> TimeAlignment:
    """Place the frames of all cameras in time.

    Parameters
    ----------
    recording
        The rig and its streams.
    times : float64 (n,) each
        Of every frame of each file of each camera, milliseconds; nan where none is stated.

    Raises
    ------
    SourceError
        Where a camera's `clock` is its stamps and it has none, or its files' `starts` are not theirs.
    """
    rate = recording.rig.frame_rate
    cameras = [
        _files(camera.name, source, own, rate)
        for camera, source, own in zip(recording.rig.cameras, recording.sources, times, strict=True)
    ]
    told: dict[str, list[str]] = {}
    shown: list[Ints | None] = []
    for camera in cameras:
        believed, note = _believed(camera, [other for other in cameras if other is not camera], rate)
        if note:
            told.setdefault(note, []).append(camera.name)
        if believed is not None:
            shown.append(nearest_frames(believed.position, believed.period))
        else:
            shown.append(nearest_frames(camera.counted, 1.0) if camera.source.source.starts else None)
    notes = tuple(f"{', '.join(names)}: {note}" for note, names in told.items())
    return TimeAlignment(_ended_together(recording, cameras, shown), notes)


def with_alignment(recording: Recording, shown: Sequence[Ints | None]) -> Recording:
    """The recording with its cameras' frames placed in time; as it was where nothing is said."""
    if not shown:
        return recording
    pairs = zip(recording.sources, shown, strict=True)
    return replace(recording, sources=tuple(replace(source, shown=own) for source, own in pairs))


def nearest_frames(position: Floats, period: float) -> Ints:
    """For each tick the frame that is shown: the nearest, none after a later one, -1 where none is near.

    Parameters
    ----------
    position : float64 (n,)
        Where each frame lies, ticks, rising.
    period
        What usually lies between two of them, ticks. A slow camera's frames stand for more than one tick.

    Returns
    -------
    int64 (tick,)
        From tick 0 to the last that the last frame stands for.
    """
    free = float(np.clip(1.0 - period / 2, 0.0, _JITTER))
    reach = (max(1.0, period) + free) / 2
    places = [*position.tolist(), np.inf, np.inf]
    shown = np.full(int(np.ceil(places[-3] + period / 2 - 1e-9)), -1, np.int64)
    last, new = -1, 0
    for tick in range(len(shown)):
        new = max(new, last + 1)
        while abs(places[new + 1] - tick) < abs(places[new] - tick):
            new += 1
        away, since = abs(places[new] - tick), abs(places[last] - tick) if last >= 0 else np.inf
        if away <= min(reach, since + free):
            shown[tick] = last = new
        elif since <= reach:
            shown[tick] = last
    return shown


def coverage(recording: Recording, counts: Sequence[int], length: int) -> Flags:
    """Which frames of the recording each camera shows, bool (camera, length).

    Parameters
    ----------
    recording
        The rig and its streams, placed in time.
    counts
        Frames of each camera.
    length
        Frames of the recording.
    """
    flags = np.zeros((len(counts), length), bool)
    for own, source, count in zip(flags, recording.sources, counts, strict=True):
        shows = np.ones(count, bool) if source.shown is None else source.shown >= 0
        shows = shows[max(0, -source.offset) :][: max(0, length - max(0, source.offset))]
        first = max(0, source.offset)
        own[first : first + len(shows)] = shows
    return flags


def _files(name: str, source: CameraSource, times: Sequence[Floats], rate: float) -> _Files:
    paths = [part.path for part in source_parts(source.source, f"camera {name}")]
    require_starts(source.source.starts, len(paths), source.source.path, f"camera {name}, source.starts")
    starts = np.array(source.source.starts, float)
    counted = concatenate_files([np.arange(float(len(own))) for own in times], 1.0, rate, paths, starts)
    return _Files(name, source, have_stamps(times, paths), interpret_stamps(times, rate, paths, starts), counted)


def _believed(camera: _Files, others: Sequence[_Files], rate: float) -> tuple[TimeStamps | None, str]:
    """The stamps by which a camera goes, None where its frames are counted, and what is to be told of it."""
    stamps, source = camera.stamps, camera.source
    if source.clock == "count":
        return None, ""
    if stamps is None:
        if source.clock == "stamps":
            found = "files without time stamps that rise"
            raise SourceError(source.source.path, f"camera {camera.name}, clock", found, 'some, or clock = "count"')
        return None, "the time stamps do not rise, or leap by a day; the frames are counted" if camera.states else ""
    if camera.regular:
        return None, ""
    if source.clock == "stamps":
        return stamps, ""
    if not stamps.steady:
        return (
            stamps,
            'the time stamps vary; each moment is shown by the frame nearest to it (clock = "count" would count)',
        )
    said = f"the time stamps say {stamps.rate * rate:.4g} frames per second, the rig {rate:.4g}"
    vouching = [other for other in others if other.keeps_rate or other.source.clock == "stamps"]
    if not vouching or _same_count(camera, stamps, vouching):
        return None, f'{said}; the frames are counted (clock = "stamps" would go by the stamps)'
    return stamps, f'{said}; each moment is shown by the frame nearest to it (clock = "count" would count)'


def _same_count(camera: _Files, stamps: TimeStamps, vouching: Sequence[_Files]) -> bool:
    """Whether a camera has as many frames as one that keeps the rig's rate, and by its stamps would not end with it."""
    count, by_time = len(camera.counted), stamps.position[-1] + stamps.period
    ends = [_end(other) for other in vouching]
    return any(abs(count - end) <= _ALIKE * end and abs(count - end) < abs(by_time - end) for end in ends)


def _end(camera: _Files) -> float:
    """Ticks that a camera which goes by its stamps is there for."""
    return float(camera.stamps.position[-1] + camera.stamps.period) if camera.stamps else float(len(camera.counted))


def _ended_together(
    recording: Recording, cameras: Sequence[_Files], shown: Sequence[Ints | None]
) -> tuple[Ints | None, ...]:
    """Cameras that must end together and go by time made to, where they nearly do.

    The end is that of the cameras which are counted, else the last of all; who has ended before is blind until then.
    """
    required = [k for k, camera in enumerate(cameras) if camera.source.on_missing == "error"]
    counted = [cameras[k].source.offset + len(cameras[k].counted) for k in required if shown[k] is None]
    timed = {k: cameras[k].source.offset + len(own) for k in required if (own := shown[k]) is not None}
    if not timed:
        return tuple(shown)
    end, made = max(counted or timed.values()), list(shown)
    for k, own_end in timed.items():
        own = shown[k]
        if own is not None and abs(own_end - end) <= _TOGETHER * recording.rig.frame_rate:
            made[k] = np.append(own, np.full(max(0, end - own_end), -1))[: len(own) + end - own_end]
    return tuple(made)
