"""Numbers from text, and tables of positions as CSV."""

from pathlib import Path

import numpy as np
import pytest
from checks import cases, drawn, refused
from hypothesis import strategies as st
from run_files import table_of

from stseg.errors import FormatError, OutputError
from stseg.io.track_csv import POSITION, read_tracks_csv, write_tracks_csv
from stseg.io.untrusted.values import parse_number, parse_whole
from stseg.records.tables import TRAJECTORY


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "tracks.csv"


def trajectory(rows: list[tuple[float, float]]) -> np.ndarray:
    x, y = np.array(rows, float).reshape(-1, 2).T
    covariance, frame = {"xx": 0.01, "xy": -0.0012345, "yy": 0.02}, np.arange(len(rows))
    return table_of(TRAJECTORY, frame=frame, id=4, x=x, y=y, height=1.754, score=np.inf, views=3, **covariance)


METRES = st.floats(-1e4, 1e4)


@drawn(25, rows=st.lists(st.tuples(METRES, METRES), max_size=5))
def test_positions_survive_a_table(tmp_path_factory: pytest.TempPathFactory, rows: list[tuple[float, float]]) -> None:
    path = tmp_path_factory.mktemp("csv") / "tracks.csv"
    written = trajectory(rows)
    write_tracks_csv(path, written)
    read = read_tracks_csv(path)
    assert read.dtype == POSITION
    for name in ("frame", "id"):
        assert read[name].tolist() == written[name].tolist()
    for name in ("x", "y"):
        np.testing.assert_allclose(read[name], written[name], rtol=0, atol=1e-4)


def test_lines_are_short_and_columns_in_any_order(path: Path) -> None:
    write_tracks_csv(path, trajectory([(1 / 3, -2)]))
    assert path.read_text().splitlines() == [
        "frame,id,x,y,height,score,xx,xy,yy,views",
        "0,4,0.3333,-2.0000,1.754,inf,0.01,-0.001234,0.02,3",
    ]
    path.write_text("frame,id,x,y,flag\n3,1,0.5,0.25,0\n")
    refused(OutputError, "did not make", write_tracks_csv, path, trajectory([]), overwrite=True)
    path.write_text("\ufeffnote, y ,x,id,frame\n\nhello,2,1,7,12.0\n", encoding="utf-8")
    assert read_tracks_csv(path).tolist() == [(12, 7, 1.0, 2.0, 0)]
    path.write_text("frame,id,x,y,flag\n0,1,0,0,\n0,2,0,0,3\n")
    assert read_tracks_csv(path)["flag"].tolist() == [0, 3]
    path.write_bytes(b"\x89HDF\r\n\x1a\n\xff\xfe")
    refused(FormatError, "not text", read_tracks_csv, path)
    refused(FormatError, "No such file", read_tracks_csv, path.with_name("nowhere.csv"))
    refused(FormatError, "directory", read_tracks_csv, path.parent)
    refused(OutputError, "nowhere", write_tracks_csv, path.parent / "nowhere" / "tracks.csv", trajectory([]))


@cases()
def test_ids_are_numbers_or_names(path: Path, ids: str, read: list[int]) -> None:
    one, other = ids.split()
    path.write_text(f"frame,id,x,y\n0,{one},0,0\n0,{other},1,1\n1,{one},0,0\n")
    assert read_tracks_csv(path)["id"].tolist() == [*read, read[0]]


@pytest.mark.parametrize("text", ["1_000", "٣", "inf", "nan", "1e999", "0x1", "", " ", "1" * 500, "1e", "--1"])
def test_what_is_no_number(text: str) -> None:
    assert np.isnan(parse_number(text))


@pytest.mark.parametrize("text", ["1", " -1.5 ", "+.5", "5.", "1e-3", "1E5"])
def test_numbers_are_read_as_python_reads_them(text: str) -> None:
    assert parse_number(text) == float(text)


def test_whole_numbers_are_within_their_range() -> None:
    assert parse_whole("7", 0, 9) == 7 and parse_whole("10", 0, 9) is None
    assert parse_whole("1" * 5000, 0, 9) is None
