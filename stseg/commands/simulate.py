"""`stseg simulate`: render a scene with ground truth."""

from __future__ import annotations

import difflib
from dataclasses import replace
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from rich.console import Console
from rich.progress import Progress

from stseg.errors import ConfigError
from stseg.io.outputs.simulated_scene import rig_name, write_scene
from stseg.io.recording.recording import BodyPrior
from stseg.io.toml.text import shown
from stseg.io.untrusted import limits
from stseg.io.untrusted.numbers import parse_whole
from stseg.simulation import NAMED, Film, SceneSpec, Spoil, SpoiledFilm
from stseg.simulation.spoiling.spoil import STRENGTHS


def simulate(
    folder: Path,
    /,
    *,
    scene: str = "easy",
    people: int | None = None,
    cameras: int | None = None,
    seconds: float | None = None,
    frame_rate: float | None = None,
    size: Annotated[str | None, Parameter(metavar="W,H")] = None,
    noise: float | None = None,
    shadows: float | None = None,
    light_drift: float | None = None,
    alike: int | None = None,
    seed: int | None = None,
    spoil: Annotated[tuple[str, ...], Parameter(metavar="KIND[:STRENGTH]", negative="")] = (),
    instances: Annotated[bool, Parameter(negative="")] = False,
    overwrite: Annotated[bool, Parameter(negative="")] = False,
) -> None:
    """Render a simulated scene: videos of every camera, exact masks, a detector's boxes, rig files and truth.

    Example: stseg simulate crowd/ --scene dense --cameras 4 --seconds 10

    Then: stseg run crowd/rig.toml -o crowd.h5, and stseg evaluate crowd.h5 crowd/truth.csv

    Parameters
    ----------
    folder
        Where to write; it must be empty or not there yet.
    scene
        easy (5 people, 4 cameras), dense (14 people on 6 m x 6 m, 8 cameras), dense4 (the same crowd, 4 of those
        cameras), similar (4 people, 3 of them dressed alike, 3 cameras), plaza (7 upright cylinders on 20 m x 20 m, 7
        cameras), large_plaza (10 on 40 m x 40 m, 8 cameras), school (adults and children), animals (0.6 m high and 1.1
        m long), demo (small images, 8 s), tiny (a second of very small images), long (boxes alone of 10 people in a
        closed room for half an hour), return (small images of 6 people who come and go for 10 minutes), or small images
        of scripted routes: crossing, meeting, meeting_heights (the same, 8 cm apart in height), border (encounters,
        entries and exits where windows meet). The other options change it.
    people
        Number of people in the area; of all who come and go in the scene return.
    cameras
        Number of cameras around the area.
    seconds
        Length of the recording.
    frame_rate
        Frames per second.
    size
        Width and height of the images, pixels.
    noise
        Standard deviation of the sensors' noise, grey levels.
    shadows
        Darkening of the ground by the people's shadows, 0..1.
    light_drift
        Relative amplitude of slow changes of the light, 0..1.
    alike
        Number of people in clothes of similar colours.
    seed
        Seed of people, paths and cameras.
    spoil
        Errors of the masks and boxes, which are exact and good without it: dilation, erosion (share of a body's
        width), holes (share of the silhouettes), legs (share of the height that is missing), shadows (length, share
        of the height), flicker (share of the time that a person is missing), staying (blobs that stay), rain (small
        blobs a frame), jpeg (1 - quality / 100); jitter of boxes (share of their size), missed, doubled (share of the
        boxes). Without a strength a middle one; the option may be repeated.
    instances
        Write images of person ids, too.
    overwrite
        Write into a folder that is not empty.
    """
    _require_bounded(seconds, frame_rate)
    changes = {
        "people": people,
        "cameras": cameras,
        "seconds": seconds,
        "frame_rate": frame_rate,
        "size": None if size is None else _size(size),
        "noise": noise,
        "shadows": shadows,
        "light_drift": light_drift,
        "alike": alike,
        "seed": seed,
    }
    given = {key: value for key, value in changes.items() if value is not None}
    errors = [_spoil(text) for text in spoil]
    film = Film(replace(_named(scene), **given))  # type: ignore[arg-type]  # each value has its field's type
    console = Console(stderr=True)
    with Progress(console=console, disable=not console.is_terminal, transient=True) as bar:
        task = bar.add_task("filming", total=film.frames)
        write_scene(
            folder,
            SpoiledFilm(film, errors) if errors else film,
            body=_body(film.spec),
            instances=instances,
            overwrite=overwrite,
            progress=lambda done, _: bar.update(task, completed=done),
        )
    rig = folder / rig_name(film.kinds[0])
    print(f"{rig}: {film.frames} frames of {len(film.rig.cameras)} cameras; truth in truth.csv")


def _named(name: str) -> SceneSpec:
    if name in NAMED:
        return NAMED[name]
    near = difflib.get_close_matches(name, NAMED, n=1)
    suggestion = f"; did you mean {near[0]}?" if near else ""
    raise ConfigError("command line", "--scene", repr(name), f"one of {', '.join(NAMED)}{suggestion}")


def _body(spec: SceneSpec) -> BodyPrior:
    """What a rig says of a scene's bodies: nothing of people."""
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
        raise ConfigError("command line", "--spoil", shown(text), "KIND or KIND:STRENGTH, a number") from error


def _require_bounded(seconds: float | None, frame_rate: float | None) -> None:
    for option, value, low, high in (
        ("--seconds", seconds, 0.0, 86_400.0),
        ("--frame-rate", frame_rate, *limits.FRAME_RATE),
    ):
        if value is not None and not low <= value <= high:
            raise ConfigError("command line", option, repr(value), f"a number from {low:g} to {high:g}")


def _size(text: str) -> tuple[int, int]:
    sides = [parse_whole(part, 1, limits.SIDE) for part in text.split(",")]
    if len(sides) != 2 or sides[0] is None or sides[1] is None or sides[0] * sides[1] > limits.PIXELS:
        expected = f"width,height in whole pixels, at most {limits.PIXELS:.0e} in all"
        raise ConfigError("command line", "--size", shown(text), expected)
    return sides[0], sides[1]
