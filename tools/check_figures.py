"""Does `stseg calibrate check` name the camera that was spoilt?

    python tools/check_figures.py RIG.toml... [--frames N]

Every camera of every rig is spoilt in five ways, one at a time: its calibration moved by 0.30 m along x, raised by
0.20 m, turned by 6 degrees about the middle of the area, its image shifted by 5 % of its width, rolled by 5 degrees
about the middle of the image. Printed are, for each rig and way, how often that camera was named first, how often
nobody was (most of the small turns move people by less than a cell), and how often another was.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from stseg.arrays import Floats
from stseg.calibration.blunders import Shown, all_bystanders
from stseg.calibration.box_correspondence import tables_of
from stseg.calibration.isolated_boxes import sightings
from stseg.calibration.rig_check import spread
from stseg.calibration.verdict import Verdict, judge
from stseg.engine.backgrounds import make_foregrounds
from stseg.geometry import Camera, Rig
from stseg.io.config_file import read_config
from stseg.io.recording.frames import open_frames
from stseg.io.recording.rigs import read_rig

WAYS = ("moved 0.30 m", "raised 0.20 m", "turned 6 deg", "shifted 5 %", "rolled 5 deg")


def read(path: Path, frames: int) -> tuple[Rig, Shown]:
    """The rig and the boxes of its first frames."""
    recording = read_rig(path)
    sights = make_foregrounds(recording, read_config(None, ()), 0, frames)
    shown: dict[int, list[Floats]] = {}
    with open_frames(recording, 0, None) as moments:
        for moment in moments:
            seen = [sight.evidence(view) for sight, view in zip(sights, moment.views, strict=True)]
            sizes = [camera.size for camera in recording.rig.cameras]
            shown[moment.frame] = [sightings(one, size) for one, size in zip(seen, sizes, strict=True)]
            if len(shown) == frames:
                break
    return recording.rig, shown


def spoilt(rig: Rig, view: int, way: str) -> Rig:
    """The rig with one camera's calibration spoilt."""
    camera = rig.cameras[view]
    before, after = np.eye(4), np.eye(3)
    centre = np.array([(camera.size[0] - 1) / 2, (camera.size[1] - 1) / 2])
    match way:
        case "moved 0.30 m":
            before[0, 3] = 0.3
        case "raised 0.20 m":
            before[2, 3] = 0.2
        case "turned 6 deg":
            middle = np.array([np.mean(rig.grid.x), np.mean(rig.grid.y)])
            before[:2, :2] = _turn(6.0)
            before[:2, 3] = middle - _turn(6.0) @ middle
        case "shifted 5 %":
            after[0, 2] = 0.05 * camera.size[0]
        case _:
            after[:2, :2] = _turn(5.0)
            after[:2, 2] = centre - _turn(5.0) @ centre
    wrong = Camera.from_projection(camera.name, camera.size, after @ camera.projection @ before, camera.lens)
    return replace(rig, cameras=tuple(wrong if k == view else one for k, one in enumerate(rig.cameras)))


def verdict_of(rig: Rig, shown: Shown) -> Verdict:
    """What the views say of the rig."""
    tables = tables_of(rig)
    return judge(rig, tables, all_bystanders(rig, tables, shown, spread(sorted(shown))))


def main(paths: list[Path], frames: int) -> None:
    """Print a row for each rig."""
    print("| rig | as it is | " + " | ".join(WAYS) + " |\n" + "| --- " * (len(WAYS) + 2) + "|")
    for path in paths:
        rig, shown = read(path, frames)
        sound = verdict_of(rig, shown)
        worst = max((one.off for one in sound.views if one is not None), default=np.nan)
        cells = [f"{len(sound.named)} named, worst {100 * worst:.0f} cm"]
        for way in WAYS:
            first = [verdict_of(spoilt(rig, view, way), shown).named[:1] for view in range(len(rig.cameras))]
            right = sum(bool(named) and named[0].view == view for view, named in enumerate(first))
            nobody = sum(not named for named in first)
            cells.append(f"{right} / {nobody} / {len(first) - right - nobody}")
        print(f"| {path.stem} | {' | '.join(cells)} |", flush=True)


def _turn(degrees: float) -> Floats:
    angle = np.radians(degrees)
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


if __name__ == "__main__":
    words = sys.argv[1:]
    count = int(words.pop(words.index("--frames") + 1)) if "--frames" in words else 200
    files = [Path(word) for word in words if word != "--frames"]
    if not files:
        sys.exit(__doc__)
    main(files, count)
