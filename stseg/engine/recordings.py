"""A caller's recordings, runs and configurations, each as an object, or as the path of a file."""

from collections.abc import Mapping
from pathlib import Path

from stseg.config import Config
from stseg.errors import ConfigError
from stseg.geometry import Rig
from stseg.io.config_file import read_config
from stseg.io.recording.recording import CameraSource, Recording, Source
from stseg.io.recording.rig_text import format_rig
from stseg.io.recording.rigs import parse_rig, read_recording
from stseg.io.recording.source_files import is_detection_file, is_image_source
from stseg.io.runfile.runs import Run, read_run

AnySource = Path | str | Source | CameraSource
"""A source, or its path alone: boxes, images or video by the path's form; masks and instances need a `Source`."""

_BOX_FILES = (".csv", ".txt", ".parquet")


def recording_of(rig: Path | str | Recording | Rig, sources: Mapping[str, AnySource] | None = None) -> Recording:
    """The recording of a rig file, or of a rig and the sources by the names of its cameras; checked as a rig file is.

    Raises
    ------
    InputError
        Where the rig file is none, or a camera has no source.
    """
    if isinstance(rig, Rig):
        names = [camera.name for camera in rig.cameras]
        given = {} if sources is None else dict(sources)
        if set(given) != set(names):
            raise ConfigError(
                "sources", "", ", ".join(map(repr, given)) or "none", f"one for each of {', '.join(names)}"
            )
        path = Path(f"{rig.name}.toml").absolute()
        recording = Recording(path, rig, tuple(camera_source(given[name]) for name in names))
        return parse_rig(format_rig(recording, path), path)
    if sources is not None:
        raise ConfigError("sources", "", "a recording that has its own", "a stseg.Rig with them")
    return rig if isinstance(rig, Recording) else read_recording(rig)


def run_of(run: Path | str | Run) -> Run:
    """A run, or that of a file."""
    return run if isinstance(run, Run) else read_run(Path(run))


def config_of(config: Config | Path | str | None) -> Config:
    """A configuration, or that of a file; None for the defaults."""
    return config if isinstance(config, Config) else read_config(None if config is None else Path(config))


def camera_source(source: AnySource) -> CameraSource:
    """The stream of a camera from its source, or from the path of that."""
    if isinstance(source, CameraSource):
        return source
    if isinstance(source, Source):
        return CameraSource(source)
    path = Path(source).absolute()
    if is_detection_file(path) or path.suffix.lower() in _BOX_FILES:
        return CameraSource(Source("boxes", path))
    return CameraSource(Source("images" if is_image_source(path) else "video", path))
