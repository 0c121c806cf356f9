"""Provenance of a run: the resolved configuration, the rig, versions, and the files of every stream."""

import os
import platform
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from hashlib import blake2b
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from stseg.arrays import Ints, Rows
from stseg.errors import SourceError, printable
from stseg.io.recording.recording import Recording, Source, mask_passwords
from stseg.io.recording.rig_text import format_rig
from stseg.io.recording.source_files import source_files
from stseg.io.runfile.reading.hdf5_reading import dataset_text, read_attribute
from stseg.io.toml import parse_toml
from stseg.io.untrusted import limits
from stseg.io.untrusted.bounded_files import require_regular
from stseg.io.untrusted.safe_hdf5 import read_whole
from stseg.version import __version__

_PACKAGES = ("numpy", "scipy", "numba", "h5py", "opencv-python-headless", "PyMaxflow")
_TEXT = h5py.string_dtype()
"""UTF-8; a path may hold other bytes, which are stored as they are (PEP 383)."""
_SAMPLE, _SAMPLED_FILES = 1 << 16, 64
"""Bytes of a sample, and files of a source that are sampled."""
_VERSION = np.dtype([("name", "S32"), ("version", "S32")])
SOURCE = np.dtype(
    [
        ("camera", _TEXT),
        ("role", "S16"),  # frames, background or images
        ("kind", "S16"),
        ("path", _TEXT),
        ("files", "<i8"),  # 0 where nothing could be found
        ("size", "<i8"),  # bytes of all of them
        ("modified", "<f8"),  # the latest of them, seconds since 1970; NaN where there is none
    ]
)
"""One row per stream."""


@dataclass(frozen=True)
class Provenance:
    """Provenance of a run."""

    created: str
    """Start of the run, ISO 8601, UTC."""
    config: str
    """The resolved configuration, TOML."""
    rig: str
    """The text of the rig file at `rig_path`, TOML."""
    rig_path: Path
    versions: Mapping[str, str]
    """Versions of this package, Python and numerical libraries."""
    sources: Rows
    """SOURCE (n,)."""
    frame_at_tick: Mapping[str, Ints] = field(default_factory=dict)
    """`CameraSource.frame_at_tick` by camera, int64 (tick,), of cameras aligned in time."""


def gather_provenance(recording: Recording, config_text: str) -> Provenance:
    """The provenance of a run that begins now."""
    path = recording.path.absolute()
    return Provenance(
        datetime.now(UTC).isoformat(timespec="seconds"),
        config_text,
        mask_passwords(format_rig(recording, recording.path)),
        path,
        _versions(),
        np.array([(name, role.encode(), *_described(source)) for name, role, source in _streams(recording)], SOURCE),
        {
            camera.name: source.frame_at_tick
            for camera, source in zip(recording.rig.cameras, recording.sources, strict=True)
            if source.frame_at_tick is not None
        },
    )


def write_provenance(group: h5py.Group, provenance: Provenance) -> None:
    """Fill the group /provenance."""
    group.attrs["created"] = provenance.created
    group.attrs.create("rig_path", os.fsencode(provenance.rig_path), dtype=_TEXT)
    group["config"] = provenance.config
    group.create_dataset("rig", data=os.fsencode(provenance.rig), dtype=_TEXT)
    versions = [(name.encode(), number.encode()) for name, number in provenance.versions.items()]
    group["versions"] = np.array(versions, _VERSION)
    group.create_dataset("sources", data=provenance.sources, dtype=SOURCE)
    for number, (camera, frame_at_tick) in enumerate(provenance.frame_at_tick.items()):
        # By number: a camera's name may hold a slash.
        dataset = group.create_dataset(f"shown/{number}", data=frame_at_tick, compression="gzip", shuffle=True)
        dataset.attrs["camera"] = camera


def read_provenance(group: h5py.Group) -> Provenance:
    """Read the group /provenance; ValueError where its values cannot be."""
    frame_at_tick = {
        str(read_attribute(dataset, "camera")): read_whole(dataset) for dataset in group.get("shown", {}).values()
    }
    for camera, numbers in frame_at_tick.items():
        if numbers.ndim != 1 or numbers.dtype.kind != "i" or ((numbers < -1) | (numbers > limits.FRAMES)).any():
            raise ValueError(f"shown of camera {camera}: no frames by tick")
    return Provenance(
        printable(str(read_attribute(group, "created")))[: limits.NAME],
        dataset_text(group["config"]),
        dataset_text(group["rig"]),
        Path(str(read_attribute(group, "rig_path"))),
        {name.decode(): number.decode() for name, number in read_whole(group["versions"]).tolist()},
        _checked_sources(group["sources"]),
        frame_at_tick,
    )


def _checked_sources(dataset: h5py.Dataset) -> Rows:
    if dataset.dtype != SOURCE or dataset.ndim != 1 or len(dataset) > 3 * limits.CAMERAS:
        raise ValueError("sources of another form")
    return np.asarray(dataset[:])


def run_request(recording: Recording, provenance: Provenance) -> dict[str, Any]:
    """Everything that determines the result of a run, as texts and numbers in nested tables.

    Cameras are named with their places, because the place numbers the columns of tables. Files are known by name, size,
    time of change and samples of their bytes: a time can be set back.
    """
    rig = parse_toml(provenance.rig)
    rig["camera"] = {camera.pop("name"): {"place": k, **camera} for k, camera in enumerate(rig["camera"], start=1)}
    sources = {
        f"{os.fsdecode(row['camera'])}, {os.fsdecode(row['role'])}": _files_in_words(row) for row in provenance.sources
    }
    return {
        "config": parse_toml(provenance.config),
        "rig": rig,
        "source": sources,
        "samples of source": {
            f"{name}, {role}": sampled_checksum(source) for name, role, source in _streams(recording)
        },
        "version": dict(provenance.versions),
    }


def sampled_checksum(source: Source) -> str:
    """Checksum of all files' names, sizes and times, and of beginnings, middles and ends of some of them."""
    digest = blake2b(digest_size=16)
    try:
        files = list(source_files(source))
        for path in files:
            require_regular(path)
            state = path.stat()
            digest.update(os.fsencode(f"{path.name}/{state.st_size}/{state.st_mtime_ns}/"))
        for path in files[:: max(1, len(files) // _SAMPLED_FILES)]:
            with path.open("rb") as file:
                size = file.seek(0, os.SEEK_END)
                for place in (0, max(0, (size - _SAMPLE) // 2), max(0, size - _SAMPLE)):
                    file.seek(place)
                    digest.update(file.read(_SAMPLE))
    except (OSError, SourceError):
        return "nothing"
    return digest.hexdigest()


def _files_in_words(row: np.void) -> str:
    """Description of one stream's files."""
    name = Path(os.fsdecode(row["path"])).name
    if not row["files"]:
        return f"{name}, which does not exist"
    return f"{name}, {row['files']} files, {row['size']} bytes in all, written {_moment(float(row['modified']))}"


def _moment(seconds: float) -> str:
    """A time of change, seconds since 1970, in words; clocks and archives set any."""
    try:
        return datetime.fromtimestamp(seconds, UTC).isoformat()
    except (ValueError, OverflowError, OSError):  # before the year 1 or after 9999
        return f"{seconds:.0f} s from 1970"


def _versions() -> dict[str, str]:
    found = {"stseg": __version__, "python": platform.python_version(), "hdf5": h5py.version.hdf5_version}
    for package in _PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:  # another build of the same library, such as opencv-python
            found[package] = "unknown"
    return found


def _streams(recording: Recording) -> Iterator[tuple[str, str, Source]]:
    """Camera, role and source of every stream."""
    for camera, streams in zip(recording.rig.cameras, recording.sources, strict=True):
        roles = (("frames", streams.source), ("background", streams.background), ("images", streams.images))
        yield from ((camera.name, role, source) for role, source in roles if source is not None)


def _described(source: Source) -> tuple[bytes, bytes, int, int, float]:
    """kind, path, files, size, modified; zeros for streams that cannot be found."""
    try:
        states = [path.stat() for path in source_files(source)]
    except (OSError, SourceError):
        states = []
    modified = max((state.st_mtime for state in states), default=np.nan)
    path = os.fsencode(mask_passwords(source.address) or source.path)
    return source.kind.encode(), path, len(states), sum(state.st_size for state in states), modified
