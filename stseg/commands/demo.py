"""`stseg demo`: all steps on a small simulated scene."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from stseg.commands.evaluate import evaluate
from stseg.commands.report import report
from stseg.commands.run import run
from stseg.commands.simulate import simulate
from stseg.io.outputs.whole_files import require_empty


def demo(folder: Path = Path("stseg-demo"), /, *, overwrite: Annotated[bool, Parameter(negative="")] = False) -> None:
    """Film a small simulated scene, track its people from the colour videos, score the tracks, write the report.

    Example: stseg demo

    The scene is a room with four cameras. Its truth is exact, and hidden from the tracker. The first run on a machine
    takes longer: kernels are compiled, and kept.

    Parameters
    ----------
    folder
        Where to write; it must be empty or not there yet.
    overwrite
        Write into a folder that is not empty.
    """
    require_empty(folder, overwrite)
    scene, run_file, page = folder / "scene", folder / "run.h5", folder / "report.html"
    simulate(scene, scene="demo", overwrite=overwrite)
    run(scene / "rig.toml", output=run_file, overwrite=overwrite)
    evaluate(run_file, scene / "truth.csv")
    # People are simulated, so camera images may be shown.
    truth, pictures = scene / "truth.csv", folder / "pictures"
    report(run_file, output=page, truth=truth, pictures=pictures, camera_images=True, overwrite=overwrite)
    print(_what_to_open(folder))


def _what_to_open(folder: Path) -> str:
    contents = {
        "report.html": "everything on one page, in a browser",
        "pictures/plan.png": "the tracks from above; the truth is dashed",
        "pictures/overlay_cam1.png": "one camera with its tracks; also cam2 to cam4",
        "pictures/slices.png": "the occupancy volume, plane by plane",
        "run.h5": "volume, tracks, events, reasons, in an HDF5 viewer",
        "scene/rig.toml": "the rig file: begin your own from it",
    }
    return "\n".join(["Open", *(f"  {folder / name!s:<36}  {what}" for name, what in contents.items())])
