"""A video file read frame by frame. Its length is the number of frames that decode; headers are not trusted."""

from functools import cached_property

import cv2
import numpy as np

from stseg.arrays import AnyArray, Floats
from stseg.errors import SourceError
from stseg.geometry import Camera
from stseg.io.recording.pictures import picture_observation, reduced_view
from stseg.io.recording.recording import Source
from stseg.io.recording.video.avi_index import lost_frames
from stseg.io.recording.video.ffmpeg import open_video
from stseg.io.recording.video.packets import (
    PictureHeads,
    decode_reduced,
    decoder_reduction,
    deliver_packets,
    packet_times,
)

_SEQUENTIAL_FRAMES = 250
"""Frames that are decoded sequentially rather than skipped by seeking."""
_ATTEMPTS = 500
"""Failures in a row that end a video: a damaged packet fails, and those after it need not."""
_SEEK_MARGIN = 4
"""Frames before the target at which seeking aims: seeking is inexact, and the landing frame is known by its stamp."""


class VideoStream:
    """Colour frames uint8 (v, u, 3) or, where the source's kind is masks, uint8 (v, u) of a video file.

    SourceError where the file is missing, no frame of it decodes, or its frames have not the camera's size.

    Parameters
    ----------
    source, camera
        The file, and the camera whose size its frames must have.
    times : float64 (n,)
        Time stamps of all frames, milliseconds, from `times`; distant frames are then sought. Seeking is inexact: the
        landing frame is identified by its stamp. Where the stamp is ambiguous the video is decoded from its beginning.
    factor
        Whole factor by which colour frames are reduced (`stseg.io.recording.pictures.reduced_view`). Of Motion JPEG
        the decoder makes no more pixels than are asked for, as far as it can: means over squares but for rounding and
        what lies beyond their detail.
    """

    def __init__(self, source: Source, camera: Camera, times: Floats | None = None, factor: int = 1) -> None:
        self._source, self._camera, self._times = source, camera, times
        self._factor = factor if source.kind == "video" else 1
        self._scale, self._heads = decoder_reduction(self._factor), PictureHeads()
        self._by_packets = self._scale > 1
        """Whether the capture delivers packets, which are decoded here."""
        self._packet = np.zeros(0, np.uint8)
        self._frame, self._ended = -1, False
        self._open()

    def skip(self, count: int) -> int:
        """Skip up to `count` frames; return how many there were."""
        before = self._frame
        if self._times is not None and count >= len(self._times) - 1 - before:
            self._frame, self._ended = len(self._times) - 1, True
        else:
            self._go_to(before + count)
        return self._frame - before

    def times(self) -> list[Floats]:
        """Skip the rest and return the time stamp of each frame, milliseconds.

        By decoding, unless packets suffice: headers of real files are often wrong.
        """
        if self._frame < 0 and (stamps := packet_times(self._source.path)) is not None:
            self._frame, self._ended = len(stamps) - 1, True
            return [stamps]
        found = []
        while self._advance():
            found.append(self._capture.get(cv2.CAP_PROP_POS_MSEC))
        return [np.array(found, float)]

    def read(self) -> AnyArray | None:
        """The next frame; None after the last."""
        if not self._advance():
            return None
        if self._by_packets:
            reduced = decode_reduced(self._packet, self._camera.size, self._scale)
            if reduced is not None:
                return np.asarray(reduced_view(reduced, self._factor // self._scale))
            self._decode_from(self._frame)
        decoded, picture = self._capture.retrieve()
        key = f"camera {self._camera.name}, frame {self._frame}"
        if not decoded:
            raise SourceError(self._source.path, key, "a broken frame", "one that decodes")
        whole = picture_observation(picture, self._source.kind, self._camera.size, self._source.path, key)
        return np.asarray(reduced_view(whole, self._factor))

    def close(self) -> None:
        """Close the file."""
        self._capture.release()

    def _open(self) -> None:
        self._capture = open_video(self._source.path, f"camera {self._camera.name}")
        if not self._capture.isOpened():
            raise self._error("a file that does not open as a video")
        self._frame, self._ended = -1, False
        self._by_packets = self._by_packets and deliver_packets(self._capture)

    def _decode_from(self, frame: int) -> None:
        """Go on without packets, at a frame that may be read again."""
        self._by_packets = False
        self.close()
        self._open()
        self._go_to(frame)

    def _go_to(self, frame: int) -> None:
        """Go to a later frame, or to the last."""
        if self._times is not None and frame - self._frame > _SEQUENTIAL_FRAMES and self._is_whole:
            self._seek(frame, self._times)
        while self._frame < frame and self._advance():
            pass

    @cached_property
    def _is_whole(self) -> bool:
        """Whether no frame is lost: of a damaged AVI seeking and counting find different frames."""
        lost = lost_frames(self._source.path, 0 if self._times is None else len(self._times))
        return lost is not None and not len(lost)

    def _grab(self) -> bool:
        """Go to the next packet that decodes."""
        return any(self._capture.grab() for _ in range(_ATTEMPTS))

    def _seek(self, frame: int, times: Floats) -> None:
        """Go to a frame at or shortly before this one; to the beginning where the landing frame is ambiguous."""
        self._capture.set(cv2.CAP_PROP_POS_FRAMES, frame - _SEEK_MARGIN)
        if self._capture.grab():
            here = np.flatnonzero(times == self._capture.get(cv2.CAP_PROP_POS_MSEC))
            if len(here) == 1 and self._frame < here[0] <= frame:
                self._frame = int(here[0])
                return
        self.close()
        self._open()

    def _advance(self) -> bool:
        self._ended = self._ended or not self._grab()
        if self._by_packets and not self._ended and not self._keep_packet():
            self._decode_from(self._frame)  # whether this packet is a frame is for FFmpeg to say
            self._ended = not self._grab()
        if self._ended and self._frame < 0:
            raise self._error("no frame that decodes")
        self._frame += not self._ended
        return not self._ended

    def _keep_packet(self) -> bool:
        """Keep the grabbed packet; False where it is no complete picture."""
        is_valid, packet = self._capture.retrieve()
        self._packet = np.asarray(packet, np.uint8).reshape(-1) if is_valid else np.zeros(0, np.uint8)
        return self._heads.fits(self._packet)

    def _error(self, found: str) -> SourceError:
        return SourceError(self._source.path, f"camera {self._camera.name}", found, "a video that FFmpeg decodes")
