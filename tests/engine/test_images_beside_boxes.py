"""Colours of people whom a detector finds, by the frames that a rig names beside its boxes."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import stseg
from stseg.commands.simulate import simulate
from stseg.config import Config, TrackingConfig
from stseg.errors import SourceError

CAMERAS, FRAMES = 3, 12
NOTHING = Config(tracking=TrackingConfig(appearance="none"))


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("scene") / "room"
    simulate(folder, scene="demo", people=3, cameras=CAMERAS, seconds=FRAMES / 10, frame_rate=10.0)
    text = (folder / "rig_boxes.toml").read_text()
    images = r'\1\nimages = { kind = "video", path = "\2.avi" }'
    beside = re.sub(r'^(source = .*"(cam\d)_boxes.*)$', images, text, flags=re.MULTILINE)
    assert beside.count("images =") == CAMERAS
    (folder / "beside.toml").write_text(beside)
    return folder


def test_a_run_keeps_the_colours_of_people(scene: Path, tmp_path: Path) -> None:
    run = stseg.track(scene / "beside.toml", tmp_path / "run.h5", volume="none")
    colours = run.appearance["colours"]
    assert len(colours) > 2 * FRAMES
    assert np.isfinite(colours).all()
    assert {"images"} <= {name.decode() for name in run.provenance.sources["role"]}


def test_frames_that_nobody_wants_are_not_read(scene: Path, tmp_path: Path) -> None:
    gone = tmp_path / "gone.toml"
    text = (scene / "beside.toml").read_text().replace('path = "cam', f'path = "{scene}/cam')
    gone.write_text(re.sub(r'images = .*"', f'images = {{ kind = "video", path = "{tmp_path}/none.avi"', text))
    run = stseg.track(gone, tmp_path / "run.h5", config=NOTHING, volume="none")
    assert not len(run.appearance)
    with pytest.raises(SourceError, match=r"none\.avi"):
        stseg.track(gone, tmp_path / "other.h5", volume="none")
