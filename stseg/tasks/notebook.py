"""A run in a notebook: its plan as a picture, and its film."""

from dataclasses import dataclass
from html import escape
from pathlib import Path

from stseg.arrays import Bytes
from stseg.engine.offline.frame_range import FrameSpan
from stseg.engine.reporter import AnyReporter
from stseg.io.runfile.runs import Run
from stseg.reporting.figures import ground_figures
from stseg.reporting.page.html import data_uri, png_bytes
from stseg.tasks.report import report


@dataclass(frozen=True)
class PlanPicture:
    """The ground from above with the tracks; notebooks show it."""

    pixels: Bytes
    """uint8 (v, u, 3): blue, green, red."""

    def __repr__(self) -> str:
        return f"PlanPicture({self.pixels.shape[1]} x {self.pixels.shape[0]} pixels)"

    def _repr_png_(self) -> bytes:
        return png_bytes(self.pixels)


@dataclass(frozen=True)
class FilmFile:
    """A film that was written; notebooks play it."""

    path: Path
    """The WebM or MP4 file."""

    def _repr_html_(self) -> str:
        kind = f"video/{self.path.suffix[1:].lower()}"
        return f'<video controls width="960" src="{data_uri(kind, self.path.read_bytes())}"></video>'


def plan_picture(run: Run) -> PlanPicture:
    """The plan of a run."""
    plan, _ = ground_figures(run.recording.rig, run.views, run.trajectory, None, run.names)
    return PlanPicture(plan.picture)


def summary_html(run: Run) -> str:
    """A line about a run, and its plan."""
    picture = data_uri("image/png", png_bytes(plan_picture(run).pixels))
    return f'<p>{escape(repr(run))}</p><img width="450" src="{picture}">'


def write_film(
    run: Run, output: Path | str, frames: FrameSpan, camera_images: bool, overwrite: bool, progress: AnyReporter
) -> FilmFile:
    """Write the film of a run, as `stseg report --video` does."""
    return FilmFile(
        *report(run, video=output, frames=frames, camera_images=camera_images, overwrite=overwrite, progress=progress)
    )
