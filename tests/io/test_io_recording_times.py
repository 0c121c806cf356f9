"""Runs of recordings as they come: other rates, dropped frames, late and early cameras, gaps, files by the piece."""

from pathlib import Path

import numpy as np
import pytest
from checks import Captured, compiled_only
from films import TICK, Film, regular, standing, write_at_rate, write_films
from recordings import assert_same
from scenes import FRAME_RATE

from stseg import Camera, Config, Grid, Recording, Rig, Run, Source, read_run
from stseg.arrays import Floats
from stseg.commands.main import main
from stseg.config import SegmentConfig
from stseg.engine.offline.backgrounds import make_foregrounds
from stseg.io.recording.aligned_stream import index_streams
from stseg.io.recording.frames import read_camera
from stseg.io.recording.recording import CameraSource

pytestmark = compiled_only

QUICK = ("--set", "detection.lattice_spacing=0.25", "--set", "body.heights=[1.6,1.7,1.8]")
SHORT = ("--set", "segments.length=3", "--set", "segments.warm_up=1")
FRAMES = 60
CAMERAS = 3


def track(rig: Path, *more: str, workers: int = 1) -> Run:
    output = rig.with_name("run.h5")
    assert main(["run", str(rig), "-o", str(output), "--workers", str(workers), *QUICK, *more]) == 0
    return read_run(output)


def jittered(frames: int, share: float) -> Floats:
    """Frames that are early or late by up to a share of a tick."""
    seconds = regular(frames) + TICK * np.random.default_rng(7).uniform(-share, share, frames)
    seconds[0] = 0.0
    return seconds


def distances_to_truth(run: Run) -> Floats:
    """How far every row lies from the nearest person of its frame, metres."""
    rows = run.trajectory
    people = np.stack([standing(frame / FRAME_RATE) for frame in rows["frame"].tolist()])
    return np.asarray(np.hypot(people[..., 0].T - rows["x"], people[..., 1].T - rows["y"]).min(axis=0))


def presence(run: Run) -> list[tuple[int, int]]:
    """First and last frame of each track, in order."""
    return sorted((int(row["first"]), int(row["last"])) for row in run.tracks)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """One file a camera, every frame in time."""
    folder = tmp_path_factory.mktemp("whole")
    return track(write_films(folder, [Film(regular(FRAMES))] * CAMERAS), *SHORT)


@pytest.mark.slow
def test_files_of_a_piece_each_make_the_same_tracks(whole: Run, tmp_path: Path) -> None:
    """Six files a camera, with borders at other frames than segments and other cameras."""
    borders = ((10,) * 6, (5, 20, 3, 17, 14, 1), (30, 2, 7, 7, 7, 7))
    kinds = (".mkv", ".mkv", ".avi")
    films = [Film(regular(FRAMES), files, kind) for files, kind in zip(borders, kinds, strict=True)]
    parts = track(write_films(tmp_path, films), *SHORT)
    assert presence(parts) == [(0, FRAMES - 1)] * 3
    assert_same(parts.path, whole.path)


def test_rates_and_lost_frames_are_put_right(whole: Run, tmp_path: Path, capsys: Captured) -> None:
    """One camera in time, one at twice the rate, one that varies and drops frames; and for a while none sees."""
    lost = [44, 45]
    double = np.delete(np.arange(2 * FRAMES) * TICK / 2, np.s_[2 * 44 - 1 : 2 * 45 + 2])
    dropping = np.delete(jittered(FRAMES, 0.2), [9, 20, 21, 22, 23, *lost])
    films = [Film(np.delete(regular(FRAMES), lost)), Film(double).with_source(clock="stamps"), Film(dropping)]
    run = track(write_films(tmp_path, films))
    messages = capsys.readouterr().err
    assert messages.startswith("stseg: corner0, corner2: the time stamps vary; each tick shows the nearest frame")
    assert presence(run) == [(0, FRAMES - 1)] * 3
    assert np.median(distances_to_truth(run)) < 1.2 * np.median(distances_to_truth(whole)) + 0.01
    blind = {name: np.flatnonzero(ticks < 0).tolist() for name, ticks in run.provenance.frame_at_tick.items()}
    assert blind == {"corner0": lost, "corner1": lost, "corner2": [9, 20, 21, 22, 23, *lost]}
    assert run.frames.tolist() == list(range(FRAMES))


def test_late_cameras_are_blind_and_learn_where_they_see(tmp_path: Path) -> None:
    """The run is as long as two of them see: what one alone shows at the beginning is left out."""
    films = [
        Film(regular(FRAMES)).with_source(blind=True),
        Film(regular(FRAMES)[16:]).with_source(offset=16, blind=True),
        Film(regular(FRAMES)[24:-8]).with_source(offset=24, blind=True),
    ]
    run = track(write_films(tmp_path, films))
    assert run.frames.tolist() == list(range(16, FRAMES))
    assert presence(run) == [(16, FRAMES - 1)] * 3 and np.median(distances_to_truth(run)) < 0.15
    # It starts after the part of the recording from which the others learn, and so learns from its own beginning.
    pictures = [np.full((12, 16, 3), 100 + k % 3, np.uint8) for k in range(60)]
    write_at_rate(tmp_path / "a.avi", pictures)
    eye = Camera("late", (16, 12), np.eye(3), np.array([0.0, 0.0, -1.0]))
    source = CameraSource(Source("video", tmp_path / "a.avi"), None, 40, "blind")
    late = Recording(tmp_path / "rig.toml", Rig("late", FRAME_RATE, Grid((0, 1), (0, 1)), (eye,)), (source,))
    config = Config(segments=SegmentConfig(background_period=2.0))
    for streams in (None, index_streams(late)):
        (foreground,) = make_foregrounds(late, config, 0, 100, streams=streams)
        assert foreground.evidence(None) is None
        (view,) = read_camera(late, 0, [50], streams)
        likelihood = foreground.evidence(view)
        assert isinstance(likelihood, np.ndarray) and likelihood.max() < 0.5


def gaps_of(run: Run) -> list[tuple[int, str]]:
    """Frame and reason of each death at a gap."""
    found = run.events[run.events["kind"] == b"death"]
    return [(int(row["frame"]), row["reason"].decode()) for row in found if row["reason"].startswith(b"gap")]


def test_a_gap_of_all_cameras_ends_tracks(tmp_path: Path, capsys: Captured) -> None:
    """What no camera has for longer than anybody is waited for. Two tell it by stamps, one by its files' starts."""
    seconds = np.delete(regular(90), np.s_[28:64])
    started = Film(seconds, files=(28, 26), suffix=".avi", starts=(0.0, 64 * TICK))
    rig = write_films(tmp_path, [Film(seconds), Film(seconds), started])
    run = track(rig, *SHORT, workers=2)
    said = "stseg: no camera shows anything in frames 28 to 63: a gap, at which all tracks end\n"
    assert said in capsys.readouterr().err and run.frames.tolist() == [*range(28), *range(64, 90)]
    assert presence(run) == [(0, 27)] * 3 + [(64, 89)] * 3
    assert gaps_of(run) == [(27, "gap: no camera has any of the 36 frames before frame 64")] * 3
    windows = run.windows
    assert ((windows["solve_stop"] <= 28) | (windows["solve_first"] >= 64)).all()
