"""Parts of tests of hostile input: a small rig, a short film."""

from pathlib import Path

import numpy as np
from films import write_at_rate

RIG = """
format = 1
[scene]
name = "yard"
frame_rate = 10.0
x = [-2.0, 2.0]
y = [-2.0, 2.0]
[grid]
cell = 0.2
top = 1.8
planes = 4
[[camera]]
name = "cam1"
size = [64, 48]
ground = [[60.0, 32.0, 192.0], [0.0, 24.0, 324.0], [0.0, 1.0, 6.0]]
vertical = [0.0, -60.0, 0.0]
source = { kind = "boxes", path = "boxes.csv" }
"""


def write_rig(folder: Path, old: str = "", new: str = "") -> Path:
    assert old in RIG
    (folder / "boxes.csv").write_text("frame,left,top,width,height\n0,10,10,5,20\n3,11,10,5,20\n")
    (folder / "rig.toml").write_text(RIG.replace(old, new) if old else RIG)
    return folder / "rig.toml"


def film(path: Path, plain: Path) -> None:
    """A film of three frames; OpenCV writes it under a plain name."""
    write_at_rate(plain, [np.zeros((48, 64, 3), np.uint8)] * 3).rename(path)
