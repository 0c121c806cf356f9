"""Tracks of people on the ground from several fixed, overlapping cameras.

The names below are the public ones; each is imported when it is first asked for, so that `import stseg` costs nothing.

    import stseg
    run = stseg.read_run("run.h5")
    run.trajectory["x"], run.trajectory["y"]   # a structured array
    run.data_frame("trajectory")               # the same for pandas
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from stseg.config import Config
    from stseg.errors import InputError, StsegError
    from stseg.evaluation import Scores, evaluate
    from stseg.geometry import Camera, Grid, Lens, Rig
    from stseg.io.config_file import read_config
    from stseg.io.recording import Recording
    from stseg.io.rigs import read_rig, write_rig
    from stseg.io.runs import Run, read_run
    from stseg.io.tracks import read_tracks_csv
    from stseg.pipeline import Pipeline

__all__ = [
    "Camera",
    "Config",
    "Grid",
    "InputError",
    "Lens",
    "Pipeline",
    "Recording",
    "Rig",
    "Run",
    "Scores",
    "StsegError",
    "evaluate",
    "read_config",
    "read_rig",
    "read_run",
    "read_tracks_csv",
    "write_rig",
]

_HOMES = {
    "stseg.config": ("Config",),
    "stseg.errors": ("InputError", "StsegError"),
    "stseg.evaluation": ("Scores", "evaluate"),
    "stseg.geometry": ("Camera", "Grid", "Lens", "Rig"),
    "stseg.io.config_file": ("read_config",),
    "stseg.io.recording": ("Recording",),
    "stseg.io.rigs": ("read_rig", "write_rig"),
    "stseg.io.runs": ("Run", "read_run"),
    "stseg.io.tracks": ("read_tracks_csv",),
    "stseg.pipeline": ("Pipeline",),
}
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names}


def __getattr__(name: str) -> Any:
    if name not in _HOME_OF:
        raise AttributeError(f"module 'stseg' has no attribute {name!r}")
    return getattr(import_module(_HOME_OF[name]), name)
