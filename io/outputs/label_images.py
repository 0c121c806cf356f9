"""Label images: the track id of every pixel of a camera, 0 for background.

FOLDER/CAMERA/000123.png    one image a frame, numbered as the recording's frames

Ids below 256 make indexed PNGs of 8 bits, whose palette holds the colours of the tracks; larger ones grey PNGs of 16
bits. All images of a folder are of one kind, and either may be the `instances` of a rig file.
"""

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from stseg.arrays import Bytes, Ints
from stseg.errors import OutputError
from stseg.io.outputs.whole_files import (
    NO_INPUTS,
    Inputs,
    clear_frames,
    marked_png,
    output_errors,
    require_empty,
    require_own_frames,
    write_quickly,
)
from stseg.io.recording.pictures import encode_indexed
from stseg.io.untrusted.values import EXPECTED, abbreviated, is_name

_BYTE, _WORD = 255, 65535


def require_label_folder(folder: Path, cameras: Sequence[str], overwrite: bool, inputs: Inputs) -> None:
    """Refuse a folder that holds something that may not be replaced, before any work is done; raises OutputError."""
    require_empty(folder, overwrite)
    with output_errors(folder):
        for camera in cameras:
            require_own_frames(folder / camera, inputs)


class LabelImages:
    """A folder of label images, made if it does not exist, with one folder a camera in it.

    `largest` is the largest id, `palette` uint8 (256, 3) the red, green, blue of each id. With `overwrite` the folder
    need not be empty; older label images of these cameras are deleted. OutputError where the folder holds something
    already, cannot be written to, or an id is too large.
    """

    def __init__(
        self,
        folder: Path,
        cameras: Sequence[str],
        largest: int,
        palette: Bytes,
        overwrite: bool,
        inputs: Inputs = NO_INPUTS,
    ) -> None:
        if largest > _WORD:
            raise OutputError(folder, "", f"a track with the id {largest}", f"ids up to {_WORD}, the most in a PNG")
        self._folder, self._indexed, self._palette = folder, largest <= _BYTE, palette
        folders = [self._folder_of(camera) for camera in cameras]
        require_label_folder(folder, cameras, overwrite, inputs)
        with output_errors(folder):
            for one in folders:
                clear_frames(one, inputs)

    def write(self, camera: str, frame: int, ids: Ints) -> None:
        """Write one image, int64 (v, u); raises OutputError."""
        path = self._folder_of(camera) / f"{frame:06d}.png"
        with output_errors(path):
            write_quickly(path, marked_png(self._encoded(ids)))

    def _encoded(self, ids: Ints) -> bytes:
        if self._indexed:
            return encode_indexed(ids.astype(np.uint8), self._palette)
        return bytes(cv2.imencode(".png", ids.astype(np.uint16))[1])

    def _folder_of(self, camera: str) -> Path:
        if not is_name(camera):
            raise OutputError(self._folder, "camera", abbreviated(camera), EXPECTED)
        return self._folder / camera
