"""`stseg run --follow`: what is followed ends as what is run afterwards; signals, kills and breaks lose nothing."""

import re
import signal
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest
import recordings
from arrivals import FRAMES, StandIn, arrive, films, meanwhile, write_pieces
from checks import Captured, Command, compiled_only, in_ci, refused
from films import write_at_rate
from recordings import COMMAND, PLACES, assert_same, filmed_rig, run_words, started
from run_files import table_of, trajectory_of
from scenes import walkers

import stseg.engine.live.following
from stseg import evaluate, read_run, read_tracks_csv
from stseg.arrays import Bytes, Rows
from stseg.engine.live.following import last_frame
from stseg.engine.offline.frame_range import FrameRange
from stseg.errors import ConfigError
from stseg.io.live.followed_cameras import FollowedCameras
from stseg.io.live.live_tables import CorrectionTable
from stseg.io.runfile.unfinished.work_folder import WorkFolder
from stseg.records.tables import CORRECTION, TRAJECTORY
from stseg.tracking.windows.windows import ENDLESS
from stseg.trajectories.live_ids import LiveCorrections, LiveIds, corrected_ids

pytestmark = compiled_only
CONSTANTS = (
    "segments.length=1.5 segments.warm_up=0.5 segments.background_period=2 segments.background_samples=4 "
    "tracking.context=0 detection.lattice_spacing=0.25 live.file_quiet_time=0.3 live.background_time=1 "
    "live.reconnect_wait=0.1 live.stream_timeout=1"
)
OPTIONS = tuple(word for constant in CONSTANTS.split() for word in ("--set", constant))
"""Segments of twelve frames; backgrounds that hold for sixteen; tracks that are final with their window."""


track = partial(recordings.track, options=OPTIONS)


def process(rig: Path, output: Path, *more: str) -> subprocess.Popen[str]:
    return started(COMMAND, "run", rig, "-o", output, "--follow", *OPTIONS, *more)


def lines(output: Path) -> list[str]:
    path = output.with_name(f"{output.name}.live.csv")
    return path.read_text().splitlines() if path.exists() else []


def wait_for_frame(output: Path, frame: int, running: subprocess.Popen[str]) -> None:
    """Until a track was written in that frame or a later one."""
    deadline = time.monotonic() + 90
    while running.poll() is None and max([-1, *(int(line.split(",")[0]) for line in lines(output)[1:])]) < frame:
        assert time.monotonic() < deadline
        time.sleep(0.1)


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Nothing has arrived yet."""
    return write_pieces(tmp_path_factory.mktemp("arriving"), empty=True)


@pytest.fixture(scope="module")
def live(rig: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What following the files made, while they arrived."""
    output = tmp_path_factory.mktemp("live") / "run.h5"
    coming = meanwhile(partial(arrive, rig.parent, 1, 2, 3, 4, pause=0.5))
    assert track(rig, output, "--follow", "--frames", f"0:{FRAMES}") == 0
    coming.join()
    return output


@pytest.fixture(scope="module")
def afterwards(rig: Path, live: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What a run of all files made, once they were there."""
    assert live.exists()
    output = tmp_path_factory.mktemp("afterwards") / "run.h5"
    assert track(rig, output) == 0
    return output


def test_what_is_followed_ends_as_a_run_and_keeps_its_lines(live: Path, afterwards: Path) -> None:
    assert_same(live, afterwards)
    scores = evaluate(walkers(FRAMES), read_run(live).trajectory)
    assert (scores.tracks, scores.switches, scores.false_alarms) == (3, 0, 0)
    assert sorted(path.name for path in live.parent.iterdir()) == ["run.h5", "run.h5.live.csv"]
    messages = read_tracks_csv(live.with_name("run.h5.live.csv"))
    assert np.unique(messages["frame"]).tolist() == list(range(FRAMES))
    assert (np.diff(messages["frame"]) >= 0).all()
    scores = evaluate(walkers(FRAMES), messages)
    assert (scores.tracks, scores.switches, scores.false_alarms) == (3, 0, 0)
    # By frame and place, so that final ids are found for what was written under provisional ones.
    written, kept = read_tracks_csv(live.with_name("run.h5.live.csv")), read_run(live).committed
    assert len(written) == len(kept) > 0
    written, kept = (rows[np.lexsort((rows["x"], rows["frame"]))] for rows in (written, kept))
    for name in ("frame", "x", "y"):
        np.testing.assert_allclose(written[name], kept[name], atol=6e-4, rtol=0)


def test_corrected_ids_are_written(rig: Path, live: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As if two had been exchanged from frame 4 on, which is decided with some frame after 20."""
    assert live.exists()
    decided = list[int]()

    def exchange(_: LiveCorrections, rows: Rows, appearance: Rows, fresh: Callable[[], int]) -> Rows:
        assert len(appearance) >= 0 and callable(fresh)
        last = int(rows["frame"].max())
        if decided or last < 20:
            return np.zeros(0, CORRECTION)
        decided.append(last)
        return np.array([(last, 4, last, 1, 2), (last, 4, last, 2, 1)], CORRECTION)

    monkeypatch.setattr(LiveCorrections, "decide", exchange)
    output = tmp_path / "run.h5"
    assert track(rig, output, "--follow", "--frames", f"0:{FRAMES}") == 0
    messages = read_tracks_csv(output.with_name("run.h5.live.csv"))
    assert evaluate(walkers(FRAMES), messages).switches == 2
    corrections = CorrectionTable(output.with_name("run.h5.live_corrections.csv"), FRAMES).rows
    assert corrections["decision_frame"].tolist() == decided * 2
    late = corrected_ids(messages, corrections)
    assert evaluate(walkers(FRAMES), late[late["frame"] >= 4]).switches == 0
    assert_same(output, live)


@pytest.mark.parametrize("number", in_ci(signal.SIGINT, signal.SIGTERM))
def test_a_signal_finishes_the_run_file(tmp_path: Path, number: signal.Signals) -> None:
    rig, output = write_pieces(tmp_path, empty=True), tmp_path / "run.h5"
    arrive(tmp_path, 1, 2)
    running = process(rig, output)
    wait_for_frame(output, 9, running)
    running.send_signal(number)
    reported, messages = running.communicate(timeout=60)
    assert running.returncode == 0, messages
    assert messages.splitlines()[-1] == "stseg: finishing; once more to stop at once"
    assert re.search(r"run.h5: 3 tracks in frames 0 to \d+, published \d+.\d s after arrival", reported)
    stop = int(read_run(output).frames[-1]) + 1
    assert stop > 9 and track(rig, tmp_path / "afterwards.h5", "--frames", f"0:{stop}") == 0
    assert_same(output, tmp_path / "afterwards.h5")
    assert len({line.split(",")[0] for line in lines(output)[1:]}) == stop


def test_a_run_to_which_nothing_came_leaves_nothing(tmp_path: Path) -> None:
    rig, output = write_pieces(tmp_path, empty=True), tmp_path / "out" / "run.h5"
    output.parent.mkdir()
    running = process(rig, output)
    while running.poll() is None and not lines(output):
        time.sleep(0.05)
    time.sleep(0.5)
    running.terminate()
    reported, messages = running.communicate(timeout=60)
    assert (running.returncode, messages) == (0, "stseg: finishing; once more to stop at once\n")
    assert reported == f"{output}: not written, since nothing came\n" and list(output.parent.iterdir()) == []


@pytest.mark.slow
def test_a_second_signal_ends_it_at_once(tmp_path: Path) -> None:
    rig, output = write_pieces(tmp_path, empty=True), tmp_path / "run.h5"
    arrive(tmp_path, 1, 2)
    running = process(rig, output)
    wait_for_frame(output, 3, running)
    running.terminate()
    running.terminate()
    running.send_signal(signal.SIGINT)
    _, messages = running.communicate(timeout=60)
    assert running.returncode in (130, 143)
    assert "Traceback" not in messages
    assert not output.exists()


@pytest.mark.slow
def test_a_run_that_was_killed_goes_on(rig: Path, live: Path, afterwards: Path, tmp_path: Path) -> None:
    assert live.exists()
    output = tmp_path / "run.h5"
    running = process(rig, output)
    wait_for_frame(output, 24, running)
    running.kill()
    running.communicate()
    assert 0 < len(list((tmp_path / "run.h5.segments").glob("segment-*-*.h5"))) < 3
    assert track(rig, output, "--follow", "--frames", f"0:{FRAMES}") == 0
    assert_same(output, afterwards)
    messages = read_tracks_csv(output.with_name("run.h5.live.csv"))
    assert (np.diff(messages["frame"]) >= 0).all()
    assert (evaluate(walkers(FRAMES), messages).switches, len(messages)) == (0, 3 * FRAMES)


def test_a_kill_at_the_end_is_mended(rig: Path, live: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    words = (rig, tmp_path / "run.h5", "--follow", "--frames", f"0:{FRAMES}")
    with monkeypatch.context() as patch:
        patch.setattr(WorkFolder, "remove", Mock(side_effect=OSError(5, "killed")))
        assert track(*words) == 2
    assert track(*words) == 0
    assert_same(tmp_path / "run.h5", live)
    assert not (tmp_path / "run.h5.segments").exists()


@pytest.mark.slow
def test_without_an_empty_scene_no_frame_is_lost(tmp_path: Path, capsys: Captured) -> None:
    rig, output = write_pieces(tmp_path, empty=False), tmp_path / "run.h5"
    arrive(tmp_path, 1, 2, 3, 4)
    assert track(rig, output, "--follow", "--frames", f":{FRAMES}", "--set", "live.background_time=5") == 0
    said = "no empty scene that fits west, east, north: learning from 5 s before the run begins"
    assert said in capsys.readouterr().err
    run = read_run(output)
    assert run.frames.tolist() == list(range(FRAMES))
    assert evaluate(walkers(FRAMES), run.trajectory).misses < 0.1 * 3 * FRAMES


def _tiled_wall(size: tuple[int, int]) -> Bytes:
    v, u = np.indices(size[::-1]) / 2
    return np.repeat((170 + 20 * np.sin(u) * np.cos(v)).astype(np.uint8)[..., None], 3, -1)


def test_an_empty_scene_takes_the_light_of_now(
    tmp_path: Path, capsys: Captured, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("arrivals.empty_scene", _tiled_wall)
    rig, output = write_pieces(tmp_path, empty=True), tmp_path / "run.h5"
    for camera in filmed_rig().cameras:
        dim = _tiled_wall(camera.size)
        dim[:, : camera.size[0] // 2] //= 2
        write_at_rate(tmp_path / f"{camera.name}_empty.avi", [dim] * 4)
    arrive(tmp_path, 1, 2, 3, 4)
    more = ("--set", "live.background_time=5", "--set", "segments.background_samples=20")
    assert track(rig, output, "--follow", "--frames", f":{FRAMES}", *more) == 0
    assert "no empty scene that fits west, east, north: learning" in capsys.readouterr().err
    scores = evaluate(walkers(FRAMES), read_run(output).trajectory)
    assert (scores.tracks, scores.switches, scores.false_alarms) == (3, 0, 0)


@pytest.fixture(scope="module")
def cameras_rig(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three live cameras of the room and their empty scenes."""
    path = write_pieces(tmp_path_factory.mktemp("cameras"), empty=True)
    return _as_live(path, path.with_name("live.toml"), {name: f"rtsp://there/{name}" for name in PLACES})


def _as_live(rig: Path, path: Path, addresses: dict[str, str]) -> Path:
    text = rig.read_text()
    for name, address in addresses.items():
        text = re.sub(rf'path = "[^"]*in/{name}_[^"]*"', f'path = "{address}"', text)
    path.write_text(text)
    return path


def test_a_camera_that_breaks_is_blind_and_the_run_says_so(
    cameras_rig: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured
) -> None:
    begun = time.monotonic()
    own = {f"camera {camera.name}": StandIn(film * 9, 0.125, begun=begun)
           for camera, film in zip(filmed_rig().cameras, films(filmed_rig()), strict=True)}  # fmt: skip
    own["camera east"].breaks, own["camera east"].refused = [20], 2
    opening = partial(FollowedCameras, connect=lambda *asked: own[threading.current_thread().name].open(*asked))
    monkeypatch.setattr(stseg.engine.live.following, "FollowedCameras", opening)
    assert track(cameras_rig, tmp_path / "run.h5", "--follow", "--frames", "0:40", "--set", "segments.length=2") == 0
    run, messages = read_run(tmp_path / "run.h5"), capsys.readouterr().err
    assert messages.count("camera east: no pictures from rtsp://there/east") == 1
    assert messages.count("camera east: the stream is back") == 1
    assert run.frames.tolist() == list(range(40))
    # A busy machine may be late for the other cameras, too.
    blind = [bytes(e["reason"]) for e in run.events if e["kind"] == b"blind" and b"camera east" in e["reason"]]
    assert len(blind) >= 1
    assert all(re.fullmatch(rb"camera east showed nothing in \d+ of \d+ frames", reason) for reason in blind)
    assert len(run.tracks) >= 3


def test_files_beside_live_cameras_are_refused(cameras_rig: Path, tmp_path: Path, refusal: Command) -> None:
    rig, output = cameras_rig.with_name("rig.toml"), tmp_path / "run.h5"
    mixed = _as_live(rig, cameras_rig.with_name("mixed.toml"), {"east": "rtsp://there/east"})
    said = "camera west: found files beside live streams"
    assert said in refusal(*run_words(mixed, output, "--follow", options=OPTIONS))
    assert "stseg run --follow" in refusal(*run_words(cameras_rig, output, options=OPTIONS))
    assert list(tmp_path.iterdir()) == []


@pytest.fixture(scope="module")
def server(cameras_rig: Path) -> Iterator[dict[str, str]]:
    """Addresses of a real RTSP server that shows ten seconds of the recording, again and again."""
    folder = cameras_rig.parent
    streams = []
    for camera, film in zip(filmed_rig().cameras, films(filmed_rig()), strict=True):
        write_at_rate(folder / f"{camera.name}.avi", film * 2)
        streams.append(f"{camera.name}={folder / camera.name}.avi")
    command = ["/usr/bin/python3", str(Path(__file__).parents[1].joinpath("rtsp_server.py")), "0", *streams]
    try:
        serving = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    except OSError:
        pytest.skip("no /usr/bin/python3, which has GStreamer's RTSP server where that is installed")
    try:
        assert serving.stdout is not None
        state, *rest = serving.stdout.readline().split(maxsplit=1)
        if state != "ready":
            pytest.skip(" ".join([state, *rest]).strip() or "the RTSP server does not start")
        yield {name: f"rtsp://127.0.0.1:{rest[0].strip()}/{name}" for name in PLACES}
    finally:
        serving.kill()
        serving.communicate()


@pytest.mark.slow
def test_an_rtsp_server_that_ends_is_followed(cameras_rig: Path, server: dict[str, str], tmp_path: Path) -> None:
    rig = _as_live(cameras_rig.with_name("rig.toml"), cameras_rig.with_name("served.toml"), server)
    running = process(rig, tmp_path / "run.h5", "--set", "segments.length=5", "--set", "live.stream_timeout=3")
    wait_for_frame(tmp_path / "run.h5", 100, running)
    running.terminate()
    reported, messages = running.communicate(timeout=60)
    assert running.returncode == 0, messages
    assert "tracks in frames 0 to" in reported
    back, lost = messages.count("the stream is back"), messages.count("no pictures from")
    assert 3 <= back <= lost <= back + 3
    run = read_run(tmp_path / "run.h5")
    assert run.frames.tolist() == list(range(run.frames[-1] + 1)) and len(run.tracks) >= 3


def test_where_it_ends_by_itself() -> None:
    assert (last_frame(None), *(last_frame(FrameRange.parse(text)) for text in ("0:7", ":7"))) == (ENDLESS, 7, 7)
    for wrong in ("5:7", "7", "0:", "0:0", "0:x"):
        refused(ConfigError, "--frames", lambda text: last_frame(FrameRange.parse(text)), wrong)


@pytest.mark.parametrize("more", [("--workers", "2"), ("--scheduler", "tcp://there:1")])
def test_what_does_not_go_with_it(tmp_path: Path, more: tuple[str, ...], refusal: Command) -> None:
    words = run_words(write_pieces(tmp_path, empty=True), tmp_path / "run.h5", "--follow", *more, options=OPTIONS)
    assert f"{more[0]}: found that beside --follow" in refusal(*words)


def places(track: int, frames: range, x: float) -> Rows:
    return table_of(TRAJECTORY, frame=frames, id=track, x=x)


def test_names_last_over_segments() -> None:
    nothing = np.zeros(0, CORRECTION)
    names = LiveIds(trajectory_of(), nothing, 20)
    first = names.begin(trajectory_of())
    messages = names.named(np.concatenate([places(4, range(10), 0.0), places(7, range(10), 3.0)]), first)
    assert messages["id"].tolist() == [1] * 10 + [2] * 10
    second = names.begin(np.concatenate([places(1, range(5, 10), 3.1), places(2, range(5, 10), 9.0)]))
    later = np.concatenate([places(k, range(10, 12), 0.0) for k in (1, 2, 3)])
    assert names.named(later, second)["id"].tolist() == [2, 2, 3, 3, 4, 4]
    again = LiveIds(messages, nothing, 20)  # a run that goes on from what it has told
    assert again.named(later, again.begin(places(1, range(5, 10), 0.1)))["id"].tolist() == [1, 1, 3, 3, 4, 4]
    corrections = np.array([(9, 0, 9, 2, 1), (9, 0, 9, 1, 7)], CORRECTION)
    again = LiveIds(messages, corrections, 20)
    assert again.named(later, again.begin(places(1, range(5, 10), 0.1)))["id"].tolist() == [7, 7, 8, 8, 9, 9]
