"""Parts of tests of hostile input: a small rig, a short film."""

from pathlib import Path

import numpy as np
from films import write_at_rate

RIG = (Path(__file__).parent / "attacks" / "yard.toml").read_text()


def write_rig(folder: Path, old: str = "", new: str = "") -> Path:
    assert old in RIG
    (folder / "boxes.csv").write_text("frame,left,top,width,height\n0,10,10,5,20\n3,11,10,5,20\n")
    (folder / "rig.toml").write_text(RIG.replace(old, new) if old else RIG)
    return folder / "rig.toml"


def film(path: Path, plain: Path) -> None:
    """A film of three frames; OpenCV writes it under a plain name."""
    write_at_rate(plain, [np.zeros((48, 64, 3), np.uint8)] * 3).rename(path)
