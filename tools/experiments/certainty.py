"""How far the volume's probabilities can be believed: of cells said to be occupied with 0.8, are 80 % occupied?

    python tools/experiment.py certainty SCENE=RIG... [--frames A:B] [-o docs/figures/reliability.svg]

Scenes are those of `stseg simulate`: truth.csv stands beside each rig file. A cell is occupied where the pillar of
somebody of the truth covers it. Each frame is explained once, by the first guesses and without what tracks foretell,
and fused three times:

    constants   by the first guesses of all rates, every view a look of its own
    learned     by the rates learned from the frames before, as the cut is given it: pi is one half beside people
    without     the same with the share of those cells that bodies fill, as it was learned, in place of one half

Cells count that are in doubt: within reach of a person whom the pass found, or of stated odds below 400 to 1 for any
of the three. ECE is the expected calibration error: the mean over these cells of |stated - occupied| of their bin; the
logarithmic score is the mean of -log of the probability stated of what is true, nats.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from scipy.special import expit, logit

from stseg.arrays import Flags, Floats, Rows
from stseg.config import Config
from stseg.detection.detector import Detector
from stseg.engine.backgrounds import make_foregrounds
from stseg.geometry import Grid
from stseg.geometry.nearest_person import nearest_person
from stseg.io.recording.frames import open_frames
from stseg.io.recording.rigs import read_rig
from stseg.io.recording.stream_index import index_streams
from stseg.occupancy.rate_calibration import inside_bodies
from stseg.occupancy.volume import Occupancy

BINS = 10
DOUBT = 6.0
"""Cells whose log-odds are farther from 0 are sure, nats."""
FORMS = ("constants", "learned", "without")


class Tally:
    """Stated and occupied cells by bins of the stated probability."""

    def __init__(self) -> None:
        self.cells, self.stated, self.occupied = np.zeros((3, BINS))
        self.score = 0.0

    def add(self, log_odds: Floats, truth: Flags) -> None:
        """Count cells (n,)."""
        stated = expit(log_odds)
        row = np.minimum((stated * BINS).astype(int), BINS - 1)
        self.cells += np.bincount(row, minlength=BINS)
        self.stated += np.bincount(row, stated, BINS)
        self.occupied += np.bincount(row, truth, BINS)
        self.score += float(np.logaddexp(0.0, np.where(truth, -log_odds, log_odds)).sum())

    def table(self) -> Floats:
        """Mean stated probability, and the share that is occupied, of each bin, float64 (2, bin); nan where empty."""
        count = np.where(self.cells > 0, self.cells, np.nan)
        return np.stack([self.stated, self.occupied]) / count

    def error(self) -> float:
        """Expected calibration error."""
        return float(np.abs(self.stated - self.occupied).sum() / self.cells.sum())


def occupied_cells(grid: Grid, truth: Rows) -> Flags:
    """Cells that anybody's pillar covers, bool (plane, y, x)."""
    covered = np.zeros(grid.shape, bool)
    for ground, height in zip(np.column_stack([truth["x"], truth["y"]]), truth["height"], strict=True):
        near = nearest_person(grid.ground, ground[None], 1.0)
        covered |= inside_bodies(grid, near, ground[None], np.array([height]))
    return covered


def measure(rig: Path, frames: slice) -> dict[str, Tally]:
    """The three forms on one scene."""
    config, recording = Config(), read_rig(rig)
    still = replace(config, occupancy=replace(config.occupancy, effective_observations=1.0))
    truth = np.genfromtxt(rig.with_name("truth.csv"), delimiter=",", names=True)
    kinds = ["boxes" if s.source.kind in ("boxes", "instances") else "pixels" for s in recording.sources]
    constant = Occupancy(recording.rig, kinds, still.occupancy, still.detection, still.body, still.error_rates)
    learned = Occupancy(recording.rig, kinds, config.occupancy, config.detection, config.body, config.error_rates)
    rates = learned.new_calibration()
    tallies = {form: Tally() for form in FORMS}
    for frame, seen, explanation in _explained(rig, kinds, frames, config):
        near = nearest_person(recording.rig.grid.ground, explanation.people.ground, config.occupancy.person_radius) >= 0
        share = float(logit(rates.filled_share))
        forms = {
            "constants": constant.fuse(seen, explanation).dense(),
            "learned": learned.fuse_and_learn(rates, seen, explanation).dense(),
        }
        forms["without"] = forms["learned"] + np.where(near, share, 0.0)
        doubt = np.min([np.abs(u) for u in forms.values()], axis=0) < DOUBT
        doubt = (doubt | near) & (learned.views > 0)
        occupied = occupied_cells(recording.rig.grid, truth[truth["frame"] == frame])
        for form, log_odds in forms.items():
            tallies[form].add(log_odds[doubt].astype(float), occupied[doubt])
    return tallies


def _explained(rig: Path, kinds: list[str], frames: slice, config: Config) -> Iterator[tuple]:  # type: ignore[type-arg]
    recording = read_rig(rig)
    streams = index_streams(recording)
    first, stop, _ = frames.indices(streams.length)
    sights = make_foregrounds(recording, config, first, stop, streams=streams)
    frame_pass = Detector(recording.rig, kinds, config.detection, config.body)
    with open_frames(recording, first, stop, streams) as moments:
        for moment in moments:
            seen = [sight.evidence(view) for sight, view in zip(sights, moment.views, strict=True)]
            yield moment.frame, seen, frame_pass.explain(seen, None)


def show(scene: str, tallies: Mapping[str, Tally]) -> None:
    """Print one scene's rows."""
    for form, tally in tallies.items():
        shares = " ".join("   -" if np.isnan(share) else f"{share:4.2f}" for share in tally.table()[1])
        cells = tally.cells.sum()
        print(f"{scene:12} {form:10} ECE {tally.error():5.3f}  score {tally.score / cells:5.3f}  {shares}", flush=True)


def draw(scenes: Mapping[str, Mapping[str, Tally]], path: Path) -> None:
    """One small diagram a scene."""
    plt.rcParams.update({"svg.hashsalt": "reliability", "svg.fonttype": "none"})
    figure, axes = plt.subplots(1, len(scenes), figsize=(2.6 * len(scenes), 2.7), sharey=True, squeeze=False)
    for axis, (scene, tallies) in zip(axes[0], scenes.items(), strict=True):
        axis.plot([0, 1], [0, 1], color="0.7", linewidth=0.8)
        for (form, tally), colour in zip(tallies.items(), ("tab:gray", "tab:orange", "tab:blue"), strict=True):
            axis.plot(*tally.table(), ".-", color=colour, linewidth=1.2, markersize=4, label=form)
        axis.set(title=scene, xlabel="stated probability", xlim=(0, 1), ylim=(0, 1), aspect="equal")
    axes[0, 0].set_ylabel("share occupied")
    axes[0, 0].legend(frameon=False, fontsize=7)
    figure.tight_layout()
    figure.savefig(path, metadata={"Date": None} if path.suffix == ".svg" else None)


def main() -> None:
    """Measure, print and draw."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="+", metavar="SCENE=RIG")
    parser.add_argument("--frames", default=":", metavar="A:B")
    parser.add_argument("-o", "--output", type=Path)
    asked = parser.parse_args()
    head, _, tail = asked.frames.partition(":")
    frames = slice(int(head) if head else None, int(tail) if tail else None)
    print(f"{'share occupied, by tenths of the stated probability':>100}")
    scenes = {}
    for name, _, rig in (scene.partition("=") for scene in asked.scenes):
        scenes[name] = measure(Path(rig), frames)
        show(name, scenes[name])
    if asked.output:
        draw(scenes, asked.output)
