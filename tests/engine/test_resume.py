"""Nothing is lost: runs that are killed, stopped, starved or tampered with go on and end as if nothing had happened."""

import io
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from checks import Captured, Command, cases, compiled_only, drawn, in_ci
from hypothesis import example
from hypothesis.strategies import integers, sampled_from
from recordings import COMMAND, FRAMES, PLACES, assert_same, process, run_words, started, track
from scenes import walkers

from stseg import Config, evaluate, read_run
from stseg.io.config_file import as_toml
from stseg.io.runfile.unfinished.work_files import checksum

SLOW_DISK = """
import time
from stseg.engine.offline.segment_writer import SegmentWriter
keep = SegmentWriter.keep
SegmentWriter.keep = lambda writer: (time.sleep(0.2), keep(writer))[1]
"""
"""What makes the disk of a run slow, that it is still at work when a signal reaches it on a machine of any speed."""
pytestmark = compiled_only


@pytest.fixture
def night(tmp_path: Path) -> Path:
    return tmp_path / "night.h5"


def run_until(rig: Path, output: Path, segments: int) -> subprocess.Popen[str]:
    """A run that has made so many segments."""
    running = started(SLOW_DISK + COMMAND, *run_words(rig, output))
    while len(segments_of(output)) < segments and running.poll() is None:
        time.sleep(0.005)
    return running


def segments_of(output: Path) -> list[Path]:
    return sorted(output.with_name(f"{output.name}.segments").glob("segment-*-*.h5"))


def test_a_run_in_segments_follows_everybody(undisturbed: Path) -> None:
    run = read_run(undisturbed)
    scores = evaluate(walkers(FRAMES), run.trajectory)
    assert (scores.tracks, scores.switches, scores.false_alarms, scores.misses) == (3, 0, 0, 0)
    assert (run.kept, run.frames.tolist()) == ("all", list(range(FRAMES)))
    assert sorted(path.name for path in undisturbed.parent.iterdir()) == ["run.h5"]
    labels = {int(i) for frame in run.frames.tolist() for i in np.unique(run.read_frame(frame)[1])}
    assert labels == {0, *run.tracks["id"].tolist()}


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
def test_twenty_kills_lose_nothing(rig_path: Path, undisturbed: Path, night: Path) -> None:
    """Processes that have everything imported are forked and killed at random moments, until one comes to its end."""
    driver = f"""
import os, random, signal, sys, time
from stseg.commands.main import main
import stseg.commands.run
chance, kills = random.Random(7), 0
while True:
    child = os.fork()
    if child == 0:
        os._exit(main(sys.argv[1:]))
    limit = chance.uniform(0.0, 1.2) if kills < 20 else 600.0
    start = time.monotonic()
    while (done := os.waitpid(child, os.WNOHANG))[0] == 0 and time.monotonic() - start < limit:
        time.sleep(0.002)
    if done[0] == 0:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        kills += 1
    elif kills == 20:
        assert done[1] == 0, done
        break
    else:  # it was quicker than its killer
        os.remove({str(night)!r})
print(kills)
"""
    done = process(driver, *run_words(rig_path, night))
    assert done.stdout.strip().endswith("20"), done.stderr
    assert_same(night, undisturbed)
    assert [path.name for path in night.parent.iterdir()] == [night.name]


@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), *in_ci((signal.SIGTERM, 143))])
def test_signals_end_a_run(rig_path: Path, undisturbed: Path, night: Path, number: signal.Signals, status: int) -> None:
    running = run_until(rig_path, night, 2)
    running.send_signal(number)
    _, messages = running.communicate(timeout=60)
    assert running.returncode == status
    assert "the same command goes on from there" in messages and "Traceback" not in messages
    kept = segments_of(night)
    assert kept and not list(kept[0].parent.glob("*.part"))
    assert track(rig_path, night) == 0
    assert_same(night, undisturbed)


@pytest.fixture(scope="module")
def killed(rig_path: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An output of which some segments are done, and no run is at work."""
    output = tmp_path_factory.mktemp("killed") / "night.h5"
    running = run_until(rig_path, output, 3)
    running.kill()
    running.communicate()
    assert len(segments_of(output)) >= 3
    return output


@pytest.fixture
def halfway(killed: Path, night: Path) -> Path:
    """A copy of it."""
    shutil.copytree(f"{killed}.segments", f"{night}.segments")
    return night


@pytest.mark.slow
def test_a_flipped_byte_is_noticed_and_its_segment_made_anew(
    rig_path: Path, undisturbed: Path, halfway: Path, capsys: Captured
) -> None:
    first, second, *_ = segments_of(halfway)
    content = bytearray(second.read_bytes())
    content[len(content) // 2] ^= 4
    second.write_bytes(content)
    assert track(rig_path, halfway) == 0
    messages = capsys.readouterr().err
    assert second.name in messages and first.name not in messages
    assert_same(halfway, undisturbed)


def test_a_clock_set_back_before_a_resume_changes_nothing(rig_path: Path, undisturbed: Path, halfway: Path) -> None:
    for path in segments_of(halfway)[0].parent.iterdir():
        os.utime(path, (time.time() + 3e7,) * 2)
    assert track(rig_path, halfway) == 0
    assert_same(halfway, undisturbed)
    assert not list(halfway.parent.glob("night.h5.*"))


def test_a_half_written_segment_is_nothing(rig_path: Path, undisturbed: Path, halfway: Path) -> None:
    folder = segments_of(halfway)[0].parent
    (folder / "segment-00003.h5").write_bytes(b"half")
    (folder / "segment-00003.h5.part").write_bytes(b"half")
    assert track(rig_path, halfway) == 0
    assert_same(halfway, undisturbed)


@cases()
def test_another_run_is_refused_and_the_difference_named(
    rig_path: Path, halfway: Path, refusal: Command, more: tuple[str, ...], reported: str
) -> None:
    kept = [path.name for path in segments_of(halfway)]
    said = refusal(*run_words(rig_path, halfway, *more))
    assert re.search(rf"{reported}.*delete the folder night\.h5\.segments", said), said
    assert [path.name for path in segments_of(halfway)] == kept


def cameras_reordered(folder: Path, chance: random.Random) -> tuple[str, ...]:
    text = (folder / "rig.toml").read_text()
    head, *cameras = text.split("[[camera]]")
    chance.shuffle(cameras)
    (folder / "rig.toml").write_text("[[camera]]".join([head, *cameras]))
    return ()


def rig_changed(folder: Path, chance: random.Random) -> tuple[str, ...]:
    """Another last digit of some number: one bit of it, or a thousandfold."""
    text = (folder / "rig.toml").read_text()
    place = chance.choice(list(re.finditer(r"\d\b(?!:)", text))).start()
    (folder / "rig.toml").write_text(f"{text[:place]}{(int(text[place]) + 1) % 10}{text[place + 1 :]}")
    return ()


def source_changed(folder: Path, chance: random.Random) -> tuple[str, ...]:
    """One digit of a file, whose size and time stay."""
    path = folder / f"{chance.choice(list(PLACES))}.csv"
    content, state = bytearray(path.read_bytes()), path.stat()
    place = chance.choice([k for k, byte in enumerate(content) if byte in b"123456789"])
    content[place] = b"0123456789"[int(chr(content[place])) - 1]
    path.write_bytes(content)
    os.utime(path, ns=(state.st_atime_ns, state.st_mtime_ns))
    return ()


def sources_exchanged(folder: Path, chance: random.Random) -> tuple[str, ...]:
    one, other = (folder / f"{name}.csv" for name in chance.sample(list(PLACES), 2))
    one.rename(folder / "away")
    other.rename(one)
    (folder / "away").rename(other)
    return ()


def configuration_changed(_folder: Path, chance: random.Random) -> tuple[str, ...]:
    numbers = [line.split(" ") for line in as_toml(Config()).splitlines() if re.match(r"\[|\w+ = \d+\.\d", line)]
    section, keys = "", []
    for words in numbers:
        section = words[0].strip("[]") if words[0].startswith("[") else section
        keys += [f"{section}.{words[0]}={float(words[2]) * chance.choice((0.97, 1.03))!r}"] if len(words) > 2 else []
    return ("--set", chance.choice(keys))


CHANGES = (cameras_reordered, rig_changed, source_changed, sources_exchanged, configuration_changed)


@drawn(20, change=sampled_from(CHANGES), seed=integers(0, 10**6))
@example(change=cameras_reordered, seed=1)
def test_a_resumed_run_is_the_run_or_is_refused(
    rig_path: Path, killed: Path, change: Callable[[Path, random.Random], tuple[str, ...]], seed: int
) -> None:
    """A random change between kill and resume: one line, or the bits of an undisturbed run of the new request."""
    with TemporaryDirectory() as name, pytest.MonkeyPatch.context() as patch:
        folder, printed = Path(name), io.StringIO()
        for path in rig_path.parent.glob("*.*"):
            shutil.copy2(path, folder)
        shutil.copytree(f"{killed}.segments", folder / "run.h5.segments")
        more = change(folder, random.Random(seed))
        patch.setattr(sys, "stderr", printed)
        if track(folder / "rig.toml", folder / "run.h5", *more):
            assert printed.getvalue().count("\n") == 1, printed.getvalue()
            assert not re.search(r"found (.*), where .* has \1, expected", printed.getvalue()), printed.getvalue()
            assert len(segments_of(folder / "run.h5")) == len(segments_of(killed))
        else:
            assert track(folder / "rig.toml", folder / "undisturbed.h5", *more) == 0
            assert_same(folder / "run.h5", folder / "undisturbed.h5")


def test_a_rig_in_other_words_goes_on(rig_path: Path, undisturbed: Path, halfway: Path) -> None:
    for path in rig_path.parent.glob("*.csv"):
        shutil.copy2(path, halfway.parent)
    rig = halfway.with_name("rig.toml")
    rig.write_text(rig_path.read_text().replace("# its frame", "# another comment"))
    assert track(rig, halfway) == 0
    assert_same(halfway, undisturbed)


def test_other_versions_are_refused(
    rig_path: Path, halfway: Path, refusal: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("stseg.io.runfile.provenance.__version__", "0.0")
    assert "version.stseg: found 0.0" in refusal(*run_words(rig_path, halfway))


def test_changed_sources_are_refused(rig_path: Path, halfway: Path, refusal: Command) -> None:
    source = rig_path.parent / "east.csv"
    before, state = source.read_text(), source.stat()
    try:
        source.write_text(before + f"{FRAMES - 1},1,1,2,2\n")
        assert "source.east, frames: found" in refusal(*run_words(rig_path, halfway))
    finally:
        source.write_text(before)
        os.utime(source, ns=(state.st_atime_ns, state.st_mtime_ns))
    assert track(rig_path, halfway) == 0


def test_a_vanished_source_loses_no_segment(rig_path: Path, undisturbed: Path, halfway: Path, refusal: Command) -> None:
    source, away = rig_path.parent / "east.csv", rig_path.parent / "away.csv"
    source.rename(away)
    try:
        assert "east.csv" in refusal(*run_words(rig_path, halfway))
    finally:
        away.rename(source)
    assert len(segments_of(halfway)) >= 3 and track(rig_path, halfway) == 0
    assert_same(halfway, undisturbed)


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="needs the locks of POSIX systems")
def test_two_runs_keep_off_one_output(rig_path: Path, night: Path, refusal: Command) -> None:
    running = run_until(rig_path, night, 1)
    running.send_signal(signal.SIGSTOP)
    try:
        assert "another run" in refusal(*run_words(rig_path, night))
    finally:
        running.send_signal(signal.SIGCONT)
        running.communicate()
    assert running.returncode == 0


@pytest.mark.slow
def test_a_full_disk_loses_no_segment(rig_path: Path, undisturbed: Path, tmp_path: Path, capsys: Captured) -> None:
    disk = tmp_path / "disk"
    disk.mkdir()
    if not _mount(disk, "280k"):
        pytest.skip("needs leave to mount a small disk")
    try:
        assert track(rig_path, disk / "night.h5") == 2
        assert "No space left on device" in capsys.readouterr().err
        kept = segments_of(disk / "night.h5")
        assert kept and all(checksum(path) in path.name for path in kept)
        assert _mount(disk, "40m,remount") and track(rig_path, disk / "night.h5") == 0
        assert_same(disk / "night.h5", undisturbed)
    finally:
        subprocess.run(["umount", str(disk)], check=False)


def _mount(folder: Path, size: str) -> bool:
    if os.name == "nt" or os.geteuid() != 0 or shutil.which("mount") is None:
        return False
    done = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", f"size={size}", "none", str(folder)], check=False, capture_output=True
    )
    return done.returncode == 0


@pytest.mark.parametrize(("volume", "least", "most"), [("none", 1.0, 1.0), *in_ci(("tracks", 0.1, 0.99))])
def test_the_volume_is_kept_where_it_is_asked_for(
    rig_path: Path, undisturbed: Path, night: Path, volume: str, least: float, most: float
) -> None:
    assert track(rig_path, night, "--volume", volume) == 0
    run, whole = read_run(night), read_run(undisturbed)
    assert run.kept == volume and run.trajectory.tobytes() == whole.trajectory.tobytes()
    missing = 0.0
    for frame in run.frames.tolist():
        log_odds, label = run.read_frame(frame)
        everything, named = whole.read_frame(frame)
        here = ~np.isnan(log_odds)
        np.testing.assert_array_equal(log_odds[here], everything[here])
        np.testing.assert_array_equal(label, np.zeros_like(named) if volume == "none" else named)
        assert not np.isnan(log_odds[label > 0]).any()
        missing += (~here & ~np.isnan(everything)).sum() / (~np.isnan(everything)).sum() / len(run.frames)
    assert least - 1e-9 <= missing <= most + 1e-9
