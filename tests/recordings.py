"""A small recording on disk, three walkers as boxes of three cameras, and how runs of it are made and compared."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
from scenes import box_frame_sets, looking, rig_of, walkers

from stseg.arrays import Boxes
from stseg.commands.main import main
from stseg.geometry import Camera, Grid, Rig
from stseg.io.recording.recording import CameraSource, Recording, Source
from stseg.io.recording.rig_text import format_rig
from stseg.kernels.accelerate import COMPILED

FRAMES = 40
OPTIONS = ("--set", "segments.length=1", "--set", "segments.warm_up=1", "--set", "detection.lattice_spacing=0.25")
"""Segments of six frames."""
ALONE = ("--workers", "1")
"""In this process alone."""
compiled_only = pytest.mark.skipif(not COMPILED, reason="too slow without a compiler")
ENVIRONMENT = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
COMMAND = "import sys; from stseg.commands.main import main; sys.exit(main())"
"""The program, for a process of its own."""


def process(
    program: str, *arguments: object, cwd: Path | None = None, **environment: str
) -> subprocess.CompletedProcess[str]:
    """A Python program in a process of its own, at its end."""
    command = [sys.executable, "-c", program, *map(str, arguments)]
    given = {**ENVIRONMENT, **environment}
    return subprocess.run(command, env=given, cwd=cwd, capture_output=True, text=True, check=False)


def data_path(name: str) -> Path:
    """A data set, or a file of one; the test is skipped where it is not here."""
    path = Path(os.environ.get("STSEG_DATA", Path(__file__).parents[1] / "../shared/data")) / name
    if not path.exists():
        pytest.skip(f"{name} is not here: set STSEG_DATA to the folder of the data sets")
    return path


def blank_recording(*sources: CameraSource, size: tuple[int, int] = (16, 12), rate: float = 5.0) -> Recording:
    """Cameras cam1, cam2, ... that look straight down on a square metre."""
    cameras = tuple(Camera(f"cam{k}", size, np.eye(3), np.array([0.0, 0.0, -1.0])) for k in range(1, len(sources) + 1))
    return Recording(Path("rig.toml"), Rig("test", rate, Grid((0, 1), (0, 1)), cameras), sources)


def write_recording(folder: Path) -> Path:
    """The recording, in a folder that exists; its rig file."""
    places = {"west": (-3.5, -3.5, 2.6), "east": (3.5, -3.4, 2.6), "north": (0.0, 3.6, 2.6)}
    rig = rig_of([looking(name, place) for name, place in places.items()])
    lines = {name: ["frame,left,top,width,height"] for name in places}
    for moment in box_frame_sets(rig, walkers(FRAMES), 0, FRAMES):
        for name, view in zip(places, moment.views, strict=True):
            assert isinstance(view, Boxes)
            lines[name] += [f"{moment.frame},{','.join(map(repr, row))}" for row in view.pixel.tolist()]
    for name, text in lines.items():
        (folder / f"{name}.csv").write_text("\n".join(text) + "\n")
    streams = tuple(CameraSource(Source("boxes", folder / f"{name}.csv", 0, FRAMES)) for name in places)
    path = folder / "rig.toml"
    path.write_text(format_rig(Recording(path, rig, streams), path))
    return path


def track(rig: Path, output: Path, *more: str) -> int:
    """The exit status of a run in short segments."""
    return main(["run", str(rig), "-o", str(output), *OPTIONS, *(more if "--workers" in more else (*ALONE, *more))])


def assert_same(one: Path, other: Path) -> None:
    """Every dataset but timings and provenance, bit for bit."""
    with h5py.File(one) as a, h5py.File(other) as b:
        names: list[str] = []
        a.visit(names.append)
        for name in names:
            if name.split("/")[0] in ("timings", "provenance"):
                continue
            assert name in b
            if isinstance(a[name], h5py.Dataset):
                assert np.asarray(a[name][()]).tobytes() == np.asarray(b[name][()]).tobytes(), name
            assert a[name].attrs.keys() == b[name].attrs.keys()
