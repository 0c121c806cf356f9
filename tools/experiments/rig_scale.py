"""How well rigs of `stseg calibrate auto` know their scale: stated and true errors with none, one and three distances.

    python tools/experiment.py rig_scale

Rigs are of `uu4_colour`, and of simulated rooms with one to three people. The scale is that of people's places.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from result_sets import SETS
from workbench import Bench, command_line, write_table

import stseg
from stseg.arrays import Flags, Floats
from stseg.geometry import Camera, Rig
from stseg.io.recording.rigs import read_recording
from stseg.io.track_csv import read_tracks_csv
from stseg.tasks.calibration.automatic import Distance

_RIGS, _PLACES, _LEAST_METRES, _MARGIN = 9, 400, 1.5, 0.1
"""Recordings; places of people; least distance, metres; least way to the border, image widths."""


def shown(camera: Camera, ground: Floats) -> tuple[Floats, Flags]:
    """Pixels of places (n, 2), and whether each lies in the image, by a tenth of its width from the border."""
    pixel, margin = camera.project(ground, 0.0)[0].round(1), _MARGIN * camera.size[0]
    return pixel, np.all((pixel > margin) & (pixel < np.array(camera.size) - margin), axis=-1)


def distances(rig: Rig, ground: Floats) -> Iterator[Distance]:
    """Distances between places (n, 2), each in one camera that shows both, camera by camera in turns."""
    for k, ends in enumerate(ground.reshape(-1, 2, 2)):
        camera, metres = rig.cameras[k % len(rig.cameras)], float(np.linalg.norm(ends[1] - ends[0]))
        pixel, is_shown = shown(camera, ends)
        if metres >= _LEAST_METRES and is_shown.all():
            (u, v), (other_u, other_v) = pixel.tolist()
            yield camera.name, u, v, other_u, other_v, metres


def scale(made: Rig, rig: Rig, ground: Floats) -> float:
    """Scale of the similarity that takes places to where the cameras of a made rig see them."""
    views = [(camera, *shown(true, ground)) for true, camera in zip(rig.cameras, made.cameras, strict=True)]
    place = np.concatenate([ground[is_shown] for _, _, is_shown in views]) @ [1, 1j]
    found = np.concatenate([camera.back_project(pixel[is_shown]) for camera, pixel, is_shown in views]) @ [1, 1j]
    place, found = place[np.isfinite(found)], found[np.isfinite(found)]
    return float(abs(np.vdot(place - place.mean(), found - found.mean())) / (place.var() * len(place)))


def prepared(bench: Bench, number: int) -> tuple[str, str, str, str]:
    """The rig file of a recording, its truth, the folder of its videos, and the pattern of those without people."""
    if number == 0:
        bench.do(SETS["uu4_colour"].prepare[0])
        truth, empty = "$DATA/uu4/reference_tracks.csv", "$DATA/uu4/{name}/background.avi"
        return "$WORK/uu4_colour.toml", truth, "$DATA/uu4_colour", empty
    room = f"$WORK/room{number}"
    bench.do(f"stseg simulate {room} --seconds 30 --people {1 + number % 3} --seed {number} --overwrite")
    return f"{room}/rig.toml", f"{room}/truth.csv", room, f"{room}/{{name}}_empty.avi"


def main() -> None:
    """Measure, rig by rig."""
    asked = command_line(__doc__).parse_args()
    bench, rows = Bench(asked.data.resolve(), asked.work.resolve()), [["rig", "distances", "error %", "stated %"]]
    for number in range(_RIGS):
        path, truth, films, empty = map(bench.path, prepared(bench, number))
        rig, output = read_recording(path).rig, bench.path("$WORK/automatic.toml")
        people = np.random.default_rng(number).choice(read_tracks_csv(truth), _PLACES)
        places = np.column_stack([people["x"], people["y"]])
        known, videos = list(distances(rig, places)), [films / f"{camera.name}.avi" for camera in rig.cameras]
        for given in (known[:0], known[:1], known[:3]):
            made = stseg.calibrate_auto(
                videos, output, frame_rate=rig.frame_rate, distances=given, background=str(empty), overwrite=True
            )
            error = 100 * scale(made.recording.rig, rig, places) - 100
            rows.append([f"{rig.name} {number}", str(len(given)), f"{error:+.1f}", f"{100 * made.scale_spread:.1f}"])
            print(*rows[-1], flush=True)
        write_table(asked.output / "rig_scale.csv", rows)
