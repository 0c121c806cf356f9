"""Damaged videos: lost frames are named, the view is blind there, and time goes on rightly after them; twins."""

from pathlib import Path

import numpy as np
import pytest
from checks import refused
from films import regular, write_at_rate, write_stamped
from recordings import blank_recording
from run_files import small_recording, write_small_run

from stseg.arrays import Bytes
from stseg.errors import SourceError
from stseg.io.recording.aligned_stream import index_streams, require_own_sources
from stseg.io.recording.frames import open_frames, read_camera
from stseg.io.recording.recording import CameraSource, Recording, Source
from stseg.io.recording.time_alignment import with_alignment
from stseg.io.recording.video.avi_index import lost_frames
from stseg.io.runfile.runs import read_run
from stseg.tasks.sources import summarise_sources

FRAMES, SIZE = 600, (48, 32)
NOISE = np.random.default_rng(1).integers(0, 40, (SIZE[1], SIZE[0], 3))


def pictures() -> list[Bytes]:
    """Noise that grows brighter by a third of a level a frame."""
    return [(NOISE + frame / 3).astype(np.uint8) for frame in range(FRAMES)]


def damaged(folder: Path, suffix: str, size: int = 9000) -> Recording:
    """A whole camera, and one whose file lost some bytes in its middle."""
    paths = [folder / f"cam{k}{suffix}" for k in (1, 2)]
    for path in paths:
        if suffix == ".mkv":
            write_stamped(path, pictures(), regular(FRAMES).tolist())
        else:
            write_at_rate(path, pictures(), codec="mp4v" if suffix == ".mp4" else "MJPG")
    data = bytearray(paths[1].read_bytes())
    data[len(data) // 2 : len(data) // 2 + size] = bytes(size)
    paths[1].write_bytes(data)
    return blank_recording(*(CameraSource(Source("video", path)) for path in paths), size=SIZE, rate=8.0)


@pytest.mark.parametrize("suffix", [".avi", ".mkv", ".mp4"])
def test_lost_frames_are_named_and_time_goes_on(suffix: str, tmp_path: Path) -> None:
    recording = damaged(tmp_path, suffix, 1500 if suffix == ".mp4" else 9000)
    streams = index_streams(recording)
    assert streams.length == FRAMES
    shown = streams.frame_at_tick[1]
    assert shown is not None and streams.frame_at_tick[0] is None
    lost = np.flatnonzero(shown < 0)
    assert 1 <= len(lost) <= 60 and (np.diff(lost) == 1).all()
    place = f"{lost[0]} to {lost[-1]}" if len(lost) > 1 else f"{lost[0]}"
    assert any(f"frames {place}" in note and note.startswith("cam2") for note in streams.notes)
    with open_frames(recording, streams=streams) as frame_sets:
        for frame_set in frame_sets:
            whole, other = frame_set.views
            assert isinstance(whole, np.ndarray)
            assert (other is None) == (frame_set.frame in lost)
            cut = frame_set.frame in (lost[0] - 1, lost[-1] + 1)  # what is left of a picture may be shown
            if isinstance(other, np.ndarray) and not cut and suffix != ".mp4":
                assert np.abs(whole.astype(int) - other).max() <= 3
    (late,) = read_camera(recording, 1, [FRAMES - 5], streams)
    (whole,) = read_camera(recording, 0, [FRAMES - 5], streams)
    assert isinstance(late, np.ndarray) and isinstance(whole, np.ndarray)
    assert np.abs(whole.astype(int) - late).mean() < 2


def test_a_run_warns_of_lost_frames_and_refuses_one_file_twice(tmp_path: Path) -> None:
    shown = np.array([0, 1, -1, 3, -1, -1, -1, 7])
    recording = with_alignment(small_recording(tmp_path), [shown, None])
    run = read_run(write_small_run(tmp_path / "run.h5", recording=recording))
    assert [one for one in run.warnings if "image" in one] == ["left: no image of frames 4 to 6: lost or damaged?"]
    video = CameraSource(Source("video", write_at_rate(tmp_path / "a.avi", pictures()[:3])))
    twins = blank_recording(video, video, size=SIZE)
    for look in (index_streams, summarise_sources):
        refused(SourceError, "a.avi: camera cam2: found the source of camera cam1 too", look, twins)
    coco = [CameraSource(Source("boxes", tmp_path / "a.json", select=name)) for name in ("", "", "cam3/*")]
    match = "camera cam2: found .* or its part by select or view"
    refused(SourceError, match, require_own_sources, blank_recording(*coco))
    require_own_sources(blank_recording(*coco[1:]))


def test_an_index_that_does_not_place_the_loss(tmp_path: Path) -> None:
    recording = damaged(tmp_path, ".avi")
    path = recording.sources[1].source.path
    lost = lost_frames(path, len(index_streams(recording).times[1][0]))
    assert lost is not None and len(lost)
    assert lost_frames(path, FRAMES - len(lost) - 1) is None
    whole = recording.sources[0].source.path
    film = whole.read_bytes()
    first = film.rindex(b"idx1") + 8
    repeating = film[: first + 12] + bytes(4) + film[first + 16 :]
    for data in (film[:-100], film[:300], b"RIFF", b"", film + bytes(100), repeating):
        path.write_bytes(data)
        assert lost_frames(path, 5) is not None
