"""The pictures of docs/viewers.md: a run file in silx view, napari and xarray, as they show it themselves.

Needs silx[full], napari[pyside6] and matplotlib, in an environment beside this package, and OpenGL; without a screen:
xvfb-run -s "-screen 0 1280x960x24" python tools/viewer_pictures.py RUN.h5 docs/figures

The run file is to be one of a simulated scene (`stseg demo` leaves one).
"""

from __future__ import annotations

import os
import sys
from pathlib import Path
from time import sleep

import cv2
import numpy as np
import xarray

from stseg.arrays import Bytes
from stseg.io.runfile.napari_reader import read_layers

_SECONDS, _HEIGHT = 3.0, 1.0
_UPRIGHT = (0.0, -10.0, -75.0)  # napari's first axis points at who looks: turn it up


def picture_silx(run: Path, picture: Path) -> None:
    """The main window of silx view as it opens the file."""
    from silx.app.view.Viewer import Viewer
    from silx.gui import qt

    application = qt.QApplication.instance() or qt.QApplication([])
    window = Viewer(None, None)
    window.resize(1000, 620)
    window.show()
    window.appendFile(run.name)
    for _ in range(60):  # it loads in a thread
        application.processEvents()
        sleep(0.05)
    window.displaySelectedData()
    for _ in range(20):
        application.processEvents()
        sleep(0.05)
    window.grab().save(str(picture))
    window.close()


def picture_napari(run: Path, picture: Path, displayed: int) -> None:
    """napari with the run file dropped on it: the window, or what it draws in three dimensions."""
    import napari

    viewer = napari.Viewer(ndisplay=displayed)
    for data, arguments, kind in read_layers(str(run)):
        getattr(viewer, f"add_{kind}")(data, **arguments)
    viewer.window.resize(1000, 640)
    viewer.dims.set_point((0, 1), (_SECONDS, _HEIGHT))
    viewer.reset_view()
    if displayed == 3:
        viewer.scene.camera.angles = _UPRIGHT
    _write(picture, viewer.screenshot(canvas_only=displayed == 3, flash=False))
    viewer.close()


def picture_xarray(run: Path, picture: Path) -> None:
    """One plane at one time, drawn by xarray."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    with xarray.open_dataset(run, group="entry/occupancy", engine="h5netcdf", phony_dims="access") as data:
        data.log_odds.sel(time=_SECONDS, plane=_HEIGHT, method="nearest").plot(size=4.0)
        pyplot.gca().set_aspect("equal")
        pyplot.savefig(picture, dpi=100)


def _write(picture: Path, image: Bytes) -> None:
    cv2.imwrite(str(picture), np.ascontiguousarray(image[..., 2::-1]))


def main(run: Path, folder: Path) -> None:
    """Make all."""
    folder = folder.resolve()
    os.chdir(run.parent)  # silx writes the file's name as it is given
    run = Path(run.name)
    picture_silx(run, folder / "viewer_silx.png")
    picture_napari(run, folder / "viewer_napari.png", 2)
    picture_napari(run, folder / "viewer_napari_3d.png", 3)
    picture_xarray(run, folder / "viewer_xarray.png")


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(Path(sys.argv[1]), Path(sys.argv[2]))
