"""`stseg.simulate`: a rendered scene with ground truth."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from stseg.engine.reporter import AnyReporter, reporter_of
from stseg.errors import ConfigError, one_of
from stseg.io.outputs.simulated_scene import rig_name, write_scene
from stseg.io.recording.recording import BodyPrior
from stseg.io.untrusted import limits
from stseg.io.untrusted.values import abbreviated, require_within
from stseg.simulation import NAMED, SceneFilm, SceneSpec, Spoil
from stseg.simulation.spoiling.spoil import STRENGTHS

_BOUNDS = {"seconds": (0.0, 86_400.0), "frame_rate": limits.FRAME_RATE, "cameras": (1, limits.CAMERAS)}


@dataclass(frozen=True)
class SimulatedRecording:
    """Files of a simulated scene.

    Attributes
    ----------
    rig_path, truth_path
        The rig file of its first kind of source, and the truth as CSV.
    frames, cameras
        Numbers of frames and cameras.
    """

    rig_path: Path
    truth_path: Path
    frames: int
    cameras: int


def simulate(
    folder: Path | str,
    scene: str = "easy",
    *,
    spoil: Sequence[str] = (),
    instances: bool = False,
    overwrite: bool = False,
    progress: AnyReporter = None,
    **changes: Any,
) -> SimulatedRecording:
    """Render a simulated scene, as `stseg simulate` does: videos, masks, boxes, rig files and truth.

    Parameters
    ----------
    folder
        Folder to write to; it must be empty or not there yet.
    scene
        Name of the scene; see `stseg simulate --help`.
    spoil
        Errors of masks and boxes, each KIND or KIND:STRENGTH.
    instances
        Write images of person ids, too.
    overwrite
        Write into a folder that is not empty.
    progress
        As of `stseg.track`.
    **changes
        Fields of `stseg.simulation.SceneSpec` other than the scene's: people, cameras, seconds, frame_rate, size
        (width, height), noise, shadows, light_drift, alike, seed. None keeps the scene's.

    Raises
    ------
    InputError
        For a scene, kind of error or number that is none.
    """
    given = {key: value for key, value in changes.items() if value is not None}
    for name in filter(given.__contains__, _BOUNDS):
        require_within(f"--{name.replace('_', '-')}", given[name], _BOUNDS[name])
    if scene not in NAMED:
        raise ConfigError("command line", "--scene", repr(scene), one_of(scene, NAMED))
    errors, folder = [_spoil(text) for text in spoil], Path(folder)
    film = SceneFilm(replace(NAMED[scene], **given), errors)
    with reporter_of(progress).progress("filming", film.spec.frames) as advance:
        write_scene(
            folder, film, body=_body(film.spec), instances=instances, overwrite=overwrite, frame_done=lambda: advance(1)
        )
    return SimulatedRecording(
        folder / rig_name(film.spec.kinds[0]), folder / "truth.csv", film.spec.frames, len(film.rig.cameras)
    )


def _body(spec: SceneSpec) -> BodyPrior:
    """Body sizes of a scene for its rig file; none for people."""
    if not spec.length:
        return BodyPrior()
    low, high = spec.heights
    width, spread = (spec.cylinder + spec.length) / 2, (spec.length - spec.cylinder) / 4
    return BodyPrior(*(round(size, 3) for size in ((low + high) / 2, (high - low) / 2, width, spread)))


def _spoil(text: str) -> Spoil:
    """A kind of error with its strength, or with the kind's middle one."""
    kind, colon, strength = text.partition(":")
    try:
        return Spoil(kind, float(strength) if colon else STRENGTHS.get(kind, (0.0, 0.0, 0.0))[1])
    except ValueError as error:
        raise ConfigError("command line", "--spoil", abbreviated(text), "KIND or KIND:STRENGTH, a number") from error
