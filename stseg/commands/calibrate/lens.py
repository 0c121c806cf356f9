"""`stseg calibrate lens`: camera matrix and lens from a video of a checkerboard."""

from contextlib import closing
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter

from stseg.calibration.points.checkerboard import find_corners, fit_lens
from stseg.commands.options import Overwrite
from stseg.errors import ConfigError
from stseg.io.calibrations.xml_files import write_opencv_lens
from stseg.io.outputs.whole_files import Inputs, require_output
from stseg.io.recording.recording import Source
from stseg.io.recording.streams import open_stream
from stseg.io.untrusted.values import abbreviated, parse_pair
from stseg.tasks.calibration.automatic import uncalibrated_camera

_MOST_CORNERS = 1000
"""Inner corners along a side of the board."""
_WORTH = 0.02
"""Mean movement of the corners that makes a view a new one, in image widths."""


def calibrate_lens(
    video: Path,
    /,
    *,
    board: Annotated[str, Parameter(metavar="COLUMNS,ROWS")],
    output: Annotated[Path, Parameter(name=["--output", "-o"], metavar="LENS.xml")],
    every: int = 5,
    overwrite: Overwrite = False,
) -> None:
    """Find a camera's matrix and lens from a video of a checkerboard that is moved before it.

    Example: stseg calibrate lens cam1_board.mp4 --board 9,6 -o cam1.xml

    Then: stseg calibrate points points.csv --lens '{name}.xml' ... Show the whole board, tilted, near and far, all over
    the image and into its corners.

    Parameters
    ----------
    video
        The video.
    board
        Columns and rows of the board's inner corners (one less than squares).
    output
        OpenCV XML with camera_matrix and distortion_coefficients.
    every
        Frames from one that is looked at to the next.
    """
    require_output(output, overwrite, Inputs([video]))
    sides = parse_pair(board, 3, _MOST_CORNERS)
    if sides is None or every < 1:
        expected = f"columns,rows of inner corners, 3 or more and at most {_MOST_CORNERS}; 1 or more"
        raise ConfigError("--board, --every", "", f"{abbreviated(board)}, {every}", expected)
    camera = uncalibrated_camera(video.stem, video)
    stream, size = open_stream(Source("video", video), camera), camera.size
    found: list[np.ndarray[tuple[int, ...], np.dtype[np.float64]]] = []
    with closing(stream):
        while isinstance(view := stream.read(), np.ndarray):
            corners = find_corners(np.asarray(view, np.uint8), sides)
            if corners is not None and all(np.abs(corners - one).mean() > _WORTH * size[0] for one in found):
                found.append(corners)
            stream.skip(every - 1)
    fit = fit_lens(str(video), found, sides, size)
    write_opencv_lens(output, fit.lens, overwrite)
    focal, (u, v) = fit.lens.matrix[0, 0], fit.lens.matrix[:2, 2]
    print(
        f"{output}: focal length {focal:.1f} ± {fit.focal_deviation:.1f} px, axis at ({u:.1f}, {v:.1f}), "
        f"{fit.views} views off by {fit.error:.2f} px"
    )
