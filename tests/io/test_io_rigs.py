import dataclasses
from pathlib import Path

import numpy as np
import pytest
from checks import cases, drawn, refused
from hypothesis import strategies as st
from strategies import recordings

from stseg.errors import InputError, OutputError, RigError
from stseg.io.recording.recording import CameraSource, Recording, Source
from stseg.io.recording.rigs import parse_rig, read_recording, write_rig

RIG = (Path(__file__).parent / "room.toml").read_text()
FILE = Path("shop/rig.toml")
ONE, TWO = "camera[0] (cam1).", "camera[1] (cam2)."


def plain(value: object) -> object:
    """A recording as nested tuples, so that == compares the numbers in its arrays to the last bit."""
    if dataclasses.is_dataclass(value):
        return (type(value), *(plain(getattr(value, field.name)) for field in dataclasses.fields(value)))
    if isinstance(value, np.ndarray):
        return value.dtype, value.shape, value.tolist()
    return tuple(map(plain, value)) if isinstance(value, tuple) else value


def changed(old: str, new: str) -> str:
    assert RIG.count(old) >= 1, f"{old!r} is not in the rig"
    return RIG.replace(old, new, 1)


def refusal(text: str, kind: type[InputError] = RigError) -> InputError:
    with pytest.raises(kind) as caught:
        parse_rig(text, FILE)
    assert caught.value.place == str(FILE)
    return caught.value


class TestRead:
    def test_everything_that_the_file_says(self, tmp_path: Path) -> None:
        recording = parse_rig(RIG, FILE)
        rig, grid = recording.rig, recording.rig.grid
        assert (rig.name, rig.frame_rate) == ("room", 5.0)
        assert (grid.x, grid.y, grid.cell, grid.top, grid.planes) == ((-2.5, 2.5), (-4.5, 1.5), 0.1, 1.8, 10)
        assert grid.polygon is not None and grid.polygon.tolist() == [[-2.5, -4.5], [2.5, -4.5], [2.5, 1.5]]
        first, second = rig.cameras
        assert (first.name, first.size) == ("cam1", (644, 486))
        assert first.lens is not None and first.lens.distortion.tolist() == [-0.1, 0.01, 0, 0, 0]
        assert second.lens is None
        np.testing.assert_array_equal(first.projection, second.projection)
        assert recording.sources == (
            CameraSource(Source("video", Path("shop/cam1.avi")), Source("video", Path("shop/empty.avi")), -2, "error"),
            CameraSource(Source("boxes", Path("shop/../boxes/cam2.txt"), 1, 263), None, 0, "blind"),
        )
        file = tmp_path / "rig.toml"
        file.write_bytes(b"\xef\xbb\xbf" + RIG.replace("\n", "\r\n").encode())
        assert read_recording(file).rig.name == "room"

    @pytest.mark.parametrize("content", [b"\xff\xfe", b"format = ", b"a = " + b"[" * 5000, b"a = " + b"9" * 5000])
    def test_what_is_no_toml(self, tmp_path: Path, content: bytes) -> None:
        file = tmp_path / "rig.toml"
        refused(RigError, "rig.toml: found No such file or directory, expected a rig file", read_recording, file)
        file.write_bytes(content)
        refused(RigError, r"rig.toml: found .* expected .*TOML", read_recording, file)


class TestRefuse:
    @cases(
        ("[scene]", f"[scene]\ndoors = [{'[0, 0, 1, 1], ' * 1001}]", "scene.doors", "1001 doors", "at most 1000"),
        ("top = 1.80", f"top = 1{'0' * 400}", "grid.top", "1000", "a number"),
        ("[[camera]]", "[[camera]]\n" * 256, "camera", "257", "at most 256"),
    )
    def test_names_key_found_and_expected(self, old: str, new: str, key: str, found: str, expected: str) -> None:
        error = refusal(changed(old, new), InputError)
        assert error.key == key and found in error.found
        assert expected in error.expected

    def test_no_cameras(self) -> None:
        text = RIG[: RIG.index("[[camera]]")]
        assert refusal(text).key == "camera"
        for value in ("[]", "5", "[5]"):
            assert refusal(f"camera = {value}\n{text}").expected == "one [[camera]] or more"


class TestWrite:
    @drawn(50, st.data())
    def test_reads_back_to_the_last_bit(self, tmp_path_factory: pytest.TempPathFactory, data: st.DataObject) -> None:
        path = tmp_path_factory.mktemp("rig") / "rig.toml"
        recording = data.draw(recordings(path))
        write_rig(path, recording)
        assert plain(read_recording(path)) == plain(recording)
        assert [file.name for file in path.parent.iterdir()] == ["rig.toml"]

    def test_what_is_read_is_written_the_same(self, tmp_path: Path) -> None:
        path = tmp_path / "rig.toml"
        path.write_text(RIG)
        recording = read_recording(path)
        refused(OutputError, "a file that exists", write_rig, path, recording)
        refused(OutputError, "did not make", write_rig, path, recording, overwrite=True)
        path.unlink()
        write_rig(path, recording)
        first = path.read_text()
        write_rig(path, read_recording(path), overwrite=True)
        assert path.read_text() == first and 'path = "../boxes/cam2.txt"' in first

    def test_paths_are_relative_and_numbers_plain_in_the_file(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.chdir(tmp_path)
        Path("rigs").mkdir()
        write_rig("rigs/rig.toml", parse_rig(RIG, Path("rig.toml")))
        text = Path("rigs/rig.toml").read_text()
        assert 'path = "../cam1.avi"' in text and 'path = "../../boxes/cam2.txt"' in text
        recording = parse_rig(RIG, FILE)
        grid = dataclasses.replace(recording.rig.grid, cell=np.float64(0.1), planes=int(np.int64(4)))
        rig = dataclasses.replace(recording.rig, grid=grid, frame_rate=5)
        write_rig(tmp_path / "rig.toml", Recording(FILE, rig, recording.sources))
        assert read_recording(tmp_path / "rig.toml").rig.grid.cell == 0.1

    def test_what_or_where_nothing_can_be_read_is_not_written(self, tmp_path: Path) -> None:
        recording = parse_rig(RIG, FILE)
        path = tmp_path / "rig.toml"
        twins = dataclasses.replace(recording.rig, cameras=(recording.rig.cameras[0],) * 2)
        other = Recording(path, twins, recording.sources)
        refused(RigError, r"rig.toml: camera\[1\].name: found 'cam1'", write_rig, path, other)
        assert not path.exists()
        place = tmp_path / "nowhere/rig.toml"
        refused(OutputError, r"nowhere/rig.toml: found no such folder", write_rig, place, parse_rig(RIG, FILE))
