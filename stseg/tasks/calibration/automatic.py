"""`stseg.calibrate_auto`: a rig from the videos themselves, by people who walk where several cameras see them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from stseg.arrays import Bytes, Floats
from stseg.calibration.adjusted_rig import ViewReport, cameras_of, grid_of, offsets_of, reports_of
from stseg.calibration.automatic.auto import calibrate_from_people, sharpen_by_floor, steps_of
from stseg.calibration.automatic.endpoints import Endpoints, concatenate_endpoints, upright_endpoints
from stseg.calibration.automatic.scale import KnownDistance, adjusted_to, measured, scale_spread, scaled_to
from stseg.calibration.automatic.solution import CalibrationInput, SolvedViews
from stseg.config import Config, ForegroundConfig, MixtureConfig
from stseg.engine.offline.backgrounds import make_foregrounds
from stseg.engine.offline.frame_range import FrameRange, FrameSpan
from stseg.engine.reporter import AnyReporter, Reporter, reporter_of
from stseg.errors import ConfigError
from stseg.foreground.view_foreground import ViewForeground
from stseg.geometry import Camera, Grid, Rig
from stseg.io.outputs.whole_files import Inputs, require_output
from stseg.io.recording.aligned_stream import StreamIndex, index_streams
from stseg.io.recording.frames import open_frames
from stseg.io.recording.recording import CameraSource, Recording, Source
from stseg.io.recording.rigs import write_rig
from stseg.io.recording.source_files import recording_files
from stseg.io.recording.video.ffmpeg import read_frame_rate, read_video_size
from stseg.io.untrusted import limits
from stseg.io.untrusted.values import require_within

Distance = tuple[str, float, float, float, float, float]
"""A camera's name, two of its ground pixels (u, v, u, v), and their distance in metres."""
_UNCALIBRATED = np.array([[1.0, 0, 0, 0], [0, 1.0, 0, 0], [0, 0, 1.0, 1.0]])
_DEFAULT_FRAMES = 3000
"""Frames that are read by default, at most."""
_HEIGHTS = (0.2, 2.6)
"""Mean heights of people, or animals, that known distances may lead to, metres."""
_DARKEST_SHADOW = 0.3
"""Brightness of the deepest shadow: one that lies at the feet moves them, while clothes as dark are missed in parts."""
_DELAYS = (0.0, 3600.0)
"""Greatest delays that can be looked for, seconds."""
_RATE_MARGIN = 0.1
"""Least log-ratio of two frame rates that counts as a difference."""


@dataclass(frozen=True)
class AutomaticCalibration:
    """A rig from videos.

    Attributes
    ----------
    recording
        The rig and its streams, as they were written.
    reports
        Precision of each camera, in the rig's order.
    people
        Number of people, each in one frame, by which the cameras were adjusted.
    height
        Mean height of these people, metres.
    floor_marks
        Number of marks on the floor that several views share.
    scale_spread
        Relative standard deviation of all lengths; the reports' uncertainties contain it.
    distances
        Metres that the rig gives for each known distance.
    """

    recording: Recording
    reports: tuple[ViewReport, ...]
    people: int
    height: float
    floor_marks: int
    scale_spread: float
    distances: tuple[float, ...]


def calibrate_auto(
    videos: Sequence[Path | str],
    output: Path | str,
    *,
    frame_rate: float | None = None,
    person_height: float = 1.7,
    distances: Sequence[Distance] = (),
    most_delay: float = 2.0,
    frames: FrameSpan = None,
    background: str | None = None,
    source_kind: Literal["video", "masks"] = "video",
    cell: float = Grid.cell,
    overwrite: bool = False,
    progress: AnyReporter = None,
) -> AutomaticCalibration:
    """Make a rig file from videos alone, as `stseg calibrate auto` does.

    Parameters
    ----------
    videos
        One video a camera; file names become camera names.
    output
        The rig file to write.
    frame_rate
        Frames per second of all videos; None for what their headers agree on.
    person_height
        Mean body height, metres. It sets the scale where no distance is given.
    distances
        Each (camera, u, v, u, v, metres): two ground pixels of one camera and their distance.
    most_delay
        Greatest delay of one video against another, seconds; 0 where all are synchronous.
    frames
        (first, stop), half open; None for the first 3000 frames.
    background
        Video of every camera's empty scene, `{name}` standing for the camera's name.
    source_kind
        Colour videos, or videos of masks.
    cell
        Side of a ground cell of the rig, metres.
    overwrite
        Replace the rig file if it exists.
    progress
        As of `stseg.track`.

    Raises
    ------
    InputError
        Where a video cannot be read, or too few people walk where several cameras see them.
    """
    output, paths, reporter = Path(output), [Path(video) for video in videos], reporter_of(progress)
    require_within("--person-height", person_height, limits.BODY)
    require_within("--most-delay", most_delay, _DELAYS)
    require_within("--cell", cell, limits.CELL)
    require_output(output, overwrite, Inputs(paths))  # before videos are opened, which may be none
    cameras = _uncalibrated_cameras(paths)
    if frame_rate is None:
        frame_rate = _rate_of_headers(paths)
        reporter.note(f"{frame_rate:g} frames per second by the headers of the videos (--frame-rate)")
    require_within("--frame-rate", frame_rate, limits.FRAME_RATE)
    streams = _streams(cameras, paths, output, frame_rate, background, source_kind)
    require_output(output, overwrite, Inputs(recording_files(replace(streams, path=Path()))))
    names = [camera.name for camera in streams.rig.cameras]
    known = [_known_distance(distance, streams.rig.cameras) for distance in distances]
    for note in frame_rate_notes(paths, frame_rate):
        reporter.note(note)
    views, backgrounds = people_of(streams, frames, person_height, most_delay, reporter)
    with reporter.progress("calibrating", steps_of(len(names))) as advance:
        solution = calibrate_from_people([str(path) for path in paths], views, lambda: advance(1))
    _require_plausible(solution, known)
    if known:
        solution = adjusted_to(solution, known)
        views = replace(views, person_height=float(np.median(solution.adjustment.parameters.points[:, 2])))
    floor_marks = 0
    if backgrounds:
        solution, floor_marks = sharpen_by_floor(views, solution, backgrounds)
    if known:
        solution = scaled_to(solution, known)
    recording = _recording(output, streams, solution, cell)
    write_rig(output, recording, overwrite)
    points = solution.adjustment.parameters.points
    spread = scale_spread(solution, known)
    return AutomaticCalibration(
        recording,
        tuple(reports_of(solution, spread)),
        len(points),
        float(np.median(points[:, 2])),
        floor_marks,
        spread,
        tuple(measured(solution, known).tolist()),
    )


def people_of(
    streams: Recording, frames: FrameSpan, person_height: float, most_delay: float, reporter: Reporter
) -> tuple[CalibrationInput, list[Bytes]]:
    """Feet and heads of the isolated people of a recording, and the empty scene in each view where there are images."""
    counted = index_streams(streams)
    for note in counted.notes:
        reporter.note(note)
    first, stop = _frame_range(frames, counted.length)
    config = Config(foreground=ForegroundConfig(mixture=MixtureConfig(darkest_shadow=_DARKEST_SHADOW)))
    foregrounds = make_foregrounds(streams, config, first, stop, streams=counted)
    endpoints = _endpoints(streams, counted, foregrounds, range(first, stop), reporter)
    sizes = tuple(camera.size for camera in streams.rig.cameras)
    views = CalibrationInput(endpoints, sizes, streams.rig.frame_rate, person_height, most_delay)
    return views, _background_images(foregrounds)


def camera_names(videos: Sequence[Path]) -> list[str]:
    """Names of the cameras of videos: of the files, or of their folders where those are called the same."""
    names = [path.stem for path in videos]
    return [path.absolute().parent.name for path in videos] if len(set(names)) < len(names) else names


def frame_rate_notes(videos: Sequence[Path], frame_rate: float) -> list[str]:
    """A sentence for each video whose header gives another frame rate."""
    rates = [(path, read_frame_rate(path)) for path in videos if path.is_file()]
    return [
        f"{path} has {rate:.6g} frames per second by its header, not {frame_rate:g}: give --frame-rate {rate:.6g}"
        for path, rate in rates
        if rate is not None and abs(np.log(rate / frame_rate)) > _RATE_MARGIN
    ]


def _rate_of_headers(videos: Sequence[Path]) -> float:
    """Frames per second on which the headers of all videos agree."""
    rates = {rate for path in videos if path.is_file() and (rate := read_frame_rate(path)) is not None}
    if len(rates) != 1:
        found = " and ".join(f"{rate:.6g}" for rate in sorted(rates)) or "nothing"
        raise ConfigError("command line", "--frame-rate", f"{found} by the headers of the videos", "it to be given")
    return rates.pop()


def uncalibrated_camera(name: str, video: Path) -> Camera:
    """A placeholder for the camera of a video that is read before it is calibrated."""
    return Camera.from_projection(name, read_video_size(video), _UNCALIBRATED)


def _uncalibrated_cameras(videos: Sequence[Path]) -> tuple[Camera, ...]:
    """A placeholder for each camera; ConfigError where their names do not tell two or more apart."""
    names = camera_names(videos)
    if len(videos) < 2 or len(set(names)) < len(names):
        found = ", ".join(map(str, videos)) or "none"
        raise ConfigError("calibrate auto", "VIDEO", found, "two or more, with different names")
    return tuple(uncalibrated_camera(name, path) for name, path in zip(names, videos, strict=True))


def _streams(
    cameras: tuple[Camera, ...],
    videos: Sequence[Path],
    output: Path,
    frame_rate: float,
    background: str | None,
    kind: Literal["video", "masks"],
) -> Recording:
    """The videos as a recording with placeholder cameras; streams may end at different times."""
    sources = tuple(
        CameraSource(
            Source(kind, path),
            None if background is None else Source("video", Path(background.replace("{name}", camera.name))),
            on_missing="blind",
        )
        for camera, path in zip(cameras, videos, strict=True)
    )
    return Recording(output, Rig(output.stem, frame_rate, Grid((0.0, 1.0), (0.0, 1.0)), cameras), sources)


def _known_distance(distance: Distance, cameras: Sequence[Camera]) -> KnownDistance:
    name, *numbers, metres = distance
    found, names = repr(",".join([name, *(f"{n:g}" for n in (*numbers, metres))])), [camera.name for camera in cameras]
    if name not in names:
        raise ConfigError("--distance", "", found, f"camera,u,v,u,v,metres with a camera of {', '.join(names)}")
    index, pixels = names.index(name), np.array(numbers, float).reshape(2, 2)
    width, height = cameras[index].size
    if not metres > 0 or (pixels[0] == pixels[1]).all() or not ((pixels >= 0) & (pixels <= (width, height))).all():
        expected = f"two different pixels of the image of {width}x{height}, and metres above 0"
        raise ConfigError("--distance", "", found, expected)
    return KnownDistance(index, pixels, metres)


def _require_plausible(solution: SolvedViews, known: Sequence[KnownDistance]) -> None:
    """Raise ConfigError for a distance whose pixels do not show the ground, or that makes people giants or dwarfs."""
    for number, metres in enumerate(measured(solution, known), start=1):
        if not np.isfinite(metres):
            raise ConfigError("--distance", str(number), "a pixel that shows no ground", "pixels where people walk")
    tall = float(np.median(scaled_to(solution, known).adjustment.parameters.points[:, 2])) if known else _HEIGHTS[0]
    if not _HEIGHTS[0] <= tall <= _HEIGHTS[1]:
        found, (least, most) = f"what makes people {tall:.3g} m tall", _HEIGHTS
        raise ConfigError("--distance", "", found, f"metres that make them {least:g} to {most:g} m tall")


def _frame_range(frames: FrameSpan, length: int) -> tuple[int, int]:
    given = FrameRange(*(frames or (0, min(length, _DEFAULT_FRAMES))))
    first, stop = given.first or 0, length if given.stop is None else min(given.stop, length)
    if not first < stop:
        raise ConfigError("--frames", "", f"'{given}'", f"a part of the videos' frames, 0:{length}")
    return first, stop


def _endpoints(
    streams: Recording, counted: StreamIndex, foregrounds: Sequence[ViewForeground], frames: range, reporter: Reporter
) -> tuple[Endpoints, ...]:
    """Feet and heads of isolated people, frame by frame and view by view."""
    found: list[list[tuple[int, Floats]]] = [[] for _ in foregrounds]
    with (
        open_frames(streams, frames.start, frames.stop, counted) as frame_sets,
        reporter.progress("looking for people", len(frames)) as advance,
    ):
        for frame_set in frame_sets:
            for foreground, view, endpoints in zip(foregrounds, frame_set.views, found, strict=True):
                likelihood = foreground.evidence(view)
                if isinstance(likelihood, np.ndarray):
                    endpoints.append((frame_set.frame, upright_endpoints(likelihood)))
            advance(1)
    return tuple(concatenate_endpoints(parts) for parts in found)


def _background_images(foregrounds: Sequence[ViewForeground]) -> list[Bytes]:
    """The empty scene in each view; none where the streams are masks."""
    return [
        np.clip(np.rint(foreground.background.model.background_image()), 0, 255).astype(np.uint8)
        for foreground in foregrounds
        if foreground.background is not None
    ]


def _recording(output: Path, streams: Recording, solution: SolvedViews, cell: float) -> Recording:
    names = [camera.name for camera in streams.rig.cameras]
    rig = replace(streams.rig, grid=grid_of(solution, cell), cameras=cameras_of(solution, names))
    offsets = offsets_of(solution)
    # Streams that began at different times end at different times too.
    missing: Literal["blind", "error"] = "blind" if offsets.any() else "error"
    sources = tuple(
        replace(source, offset=int(offset), on_missing=missing)
        for source, offset in zip(streams.sources, offsets, strict=True)
    )
    return Recording(output, rig, sources)
