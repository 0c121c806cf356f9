"""Tracks of people on the ground from several fixed, overlapping cameras.

The names below are the public ones; each is imported when it is first asked for, so that `import stseg` costs nothing.

    import stseg
    run = stseg.track("rig.toml", "run.h5")    # as `stseg run rig.toml -o run.h5`
    run.trajectory["x"], run.trajectory["y"]   # a structured array
    run.data_frame("trajectory")               # the same for pandas
    run.volume.log_odds[100]                   # one frame, read when it is asked for

Frames in memory: `stseg.Tracker(rig).add([boxes, image, None])`. See docs/python.md.
"""

import sys

from stseg.import_path import leave_out_current_folder

if sys.argv[:1] == ["-m"] and not {"stseg", "-mstseg"}.isdisjoint(sys.orig_argv):
    leave_out_current_folder()  # `python -m stseg`: what is imported below comes from Python itself

from importlib import import_module
from typing import TYPE_CHECKING, Any

from stseg.version import __version__ as __version__

if TYPE_CHECKING:
    from stseg.arrays import Boxes as Boxes
    from stseg.config import Config as Config
    from stseg.engine.committed_frames import CommittedFrames as CommittedFrames
    from stseg.engine.track import track as track
    from stseg.engine.tracker import Tracker as Tracker
    from stseg.errors import InputError as InputError
    from stseg.errors import StsegError as StsegError
    from stseg.evaluation import Scores as Scores
    from stseg.evaluation import evaluate as evaluate
    from stseg.geometry import Camera as Camera
    from stseg.geometry import Grid as Grid
    from stseg.geometry import Lens as Lens
    from stseg.geometry import Rig as Rig
    from stseg.io.config_file import read_config as read_config
    from stseg.io.recording.frames import FrameSet as FrameSet
    from stseg.io.recording.recording import Recording as Recording
    from stseg.io.recording.recording import Source as Source
    from stseg.io.recording.rigs import read_recording as read_recording
    from stseg.io.recording.rigs import write_rig as write_rig
    from stseg.io.runfile.runs import Run as Run
    from stseg.io.runfile.runs import read_run as read_run
    from stseg.io.track_csv import read_tracks_csv as read_tracks_csv
    from stseg.tasks.calibration.alignment import align_rig as align_rig
    from stseg.tasks.calibration.automatic import calibrate_auto as calibrate_auto
    from stseg.tasks.calibration.check import check_rig as check_rig
    from stseg.tasks.calibration.points import calibrate_points as calibrate_points
    from stseg.tasks.correction import correct as correct
    from stseg.tasks.detection import detect as detect
    from stseg.tasks.forecast import plan as plan
    from stseg.tasks.measures import measure as measure
    from stseg.tasks.pixel_labels import label_images as label_images
    from stseg.tasks.report import report as report
    from stseg.tasks.simulation import simulate as simulate

_HOMES = {
    "stseg.arrays": ("Boxes",),
    "stseg.config": ("Config",),
    "stseg.engine.committed_frames": ("CommittedFrames",),
    "stseg.engine.track": ("track",),
    "stseg.engine.tracker": ("Tracker",),
    "stseg.errors": ("InputError", "StsegError"),
    "stseg.evaluation": ("Scores", "evaluate"),
    "stseg.geometry": ("Camera", "Grid", "Lens", "Rig"),
    "stseg.io.config_file": ("read_config",),
    "stseg.io.recording.frames": ("FrameSet",),
    "stseg.io.recording.recording": ("Recording", "Source"),
    "stseg.io.recording.rigs": ("read_recording", "write_rig"),
    "stseg.io.runfile.runs": ("Run", "read_run"),
    "stseg.io.track_csv": ("read_tracks_csv",),
    "stseg.tasks.calibration.alignment": ("align_rig",),
    "stseg.tasks.calibration.automatic": ("calibrate_auto",),
    "stseg.tasks.calibration.check": ("check_rig",),
    "stseg.tasks.calibration.points": ("calibrate_points",),
    "stseg.tasks.correction": ("correct",),
    "stseg.tasks.detection": ("detect",),
    "stseg.tasks.forecast": ("plan",),
    "stseg.tasks.measures": ("measure",),
    "stseg.tasks.pixel_labels": ("label_images",),
    "stseg.tasks.report": ("report",),
    "stseg.tasks.simulation": ("simulate",),
}
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names}
__all__ = sorted(_HOME_OF)


def __getattr__(name: str) -> Any:
    if name not in _HOME_OF:
        raise AttributeError(f"module 'stseg' has no attribute {name!r}")
    return getattr(import_module(_HOME_OF[name]), name)


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
