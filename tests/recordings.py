"""A small recording on disk, three walkers as boxes of three cameras, and how runs of it are made and compared."""

import os
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
from scenes import box_frame_sets, looking, rig_of, walkers

from stseg import Boxes, Camera, Grid, Recording, Rig, Source
from stseg.commands.main import main
from stseg.io.recording.recording import CameraSource
from stseg.io.recording.rig_text import format_rig

FRAMES = 28
PLACES = {"west": (-3.5, -3.5, 2.6), "east": (3.5, -3.4, 2.6), "north": (0.0, 3.6, 2.6)}
OPTIONS = ("--set", "segments.length=1", "--set", "segments.warm_up=1", "--set", "detection.lattice_spacing=0.25")
"""Segments of six frames."""
ALONE = ("--workers", "1")
"""In this process alone."""
ENVIRONMENT = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
COMMAND = """
import signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell that runs the tests in its background has it ignored
from stseg.commands.main import main
sys.exit(main())
"""
"""The program, for a process of its own."""


def started(program: str, *arguments: object, cwd: Path | None = None, **environment: str) -> subprocess.Popen[str]:
    """A Python program in a process of its own."""
    command, given = [sys.executable, "-c", program, *map(str, arguments)], {**ENVIRONMENT, **environment}
    return subprocess.Popen(command, env=given, cwd=cwd, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def process(
    program: str, *arguments: object, cwd: Path | None = None, **environment: str
) -> subprocess.CompletedProcess[str]:
    """The same at its end."""
    with started(program, *arguments, cwd=cwd, **environment) as running:
        printed = running.communicate()
        return subprocess.CompletedProcess(running.args, running.returncode, *printed)


def blank_recording(*sources: CameraSource, size: tuple[int, int] = (16, 12), rate: float = 5.0) -> Recording:
    """Cameras cam1, cam2, ... that look straight down on a square metre."""
    cameras = tuple(Camera(f"cam{k}", size, np.eye(3), np.array([0.0, 0.0, -1.0])) for k in range(1, len(sources) + 1))
    return Recording(Path("rig.toml"), Rig("test", rate, Grid((0, 1), (0, 1)), cameras), sources)


def filmed_rig() -> Rig:
    """The room under its three cameras."""
    return rig_of([looking(name, place) for name, place in PLACES.items()])


def write_recording(folder: Path, frames: int = FRAMES, rig: Rig | None = None) -> Path:
    """The recording, in a folder that exists; its rig file."""
    rig = filmed_rig() if rig is None else rig
    lines = {camera.name: ["frame,left,top,width,height"] for camera in rig.cameras}
    for frame_set in box_frame_sets(rig, walkers(frames), 0, frames):
        for name, view in zip(lines, frame_set.views, strict=True):
            assert isinstance(view, Boxes)
            lines[name] += [f"{frame_set.frame},{','.join(map(repr, row))}" for row in view.pixel.tolist()]
    for name, text in lines.items():
        (folder / f"{name}.csv").write_text("\n".join(text) + "\n")
    streams = tuple(CameraSource(Source("boxes", folder / f"{name}.csv", 0, frames)) for name in lines)
    path = folder / "rig.toml"
    path.write_text(format_rig(Recording(path, rig, streams), path))
    return path


def run_words(rig: Path, output: Path, *more: str, options: tuple[str, ...] = OPTIONS) -> list[str]:
    """The command line of a run in short segments."""
    return ["run", str(rig), "-o", str(output), *options, *(() if "--workers" in more else ALONE), *more]


def track(rig: Path, output: Path, *more: str, options: tuple[str, ...] = OPTIONS) -> int:
    """The exit status of that run."""
    return main(run_words(rig, output, *more, options=options))


def assert_same(one: Path, other: Path) -> None:
    """Every dataset but timings and provenance, bit for bit."""
    with h5py.File(one) as a, h5py.File(other) as b:
        names, others = list[str](), list[str]()
        a.visit(names.append)
        b.visit(others.append)
        assert names == others
        for name in names:
            if name.split("/")[0] in ("timings", "provenance"):
                continue
            if isinstance(a[name], h5py.Dataset):
                assert np.asarray(a[name][()]).tobytes() == np.asarray(b[name][()]).tobytes(), name
            attributes = [
                {key: str(value) for key, value in file[name].attrs.items() if key != "REFERENCE_LIST"}
                for file in (a, b)
            ]
            assert attributes[0] == attributes[1], name
