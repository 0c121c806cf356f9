"""Summary of a run file, for `stseg inspect` and the report."""

from dataclasses import dataclass

import numpy as np

from stseg.io.runfile.runs import Run
from stseg.records.ghost_reasons import REASONS, ghost_reasons
from stseg.records.tables import ERROR_RATES
from stseg.reporting.run_statistics import ground_by_views, people_per_minute


@dataclass(frozen=True)
class Overview:
    """The essentials of a run; seconds, metres, bytes, shares 0..1, and frames with both ends included."""

    file: str
    scene: str
    cameras: tuple[str, ...]
    created: str
    x: tuple[float, float]
    y: tuple[float, float]
    top: float
    cell: float
    planes: int
    ground_by_views: list[float]
    """Share of the ground that 0, 1, 2, ... views see."""
    frame_rate: float
    frames: int
    first_frame: int | None
    last_frame: int | None
    seconds: float
    people_mean: float
    people_most: int
    people_per_minute: list[float]
    tracks: list[dict[str, float]]
    """Rows of /tracks, the longest first."""
    track_seconds: dict[str, float]
    """Shortest, median and longest."""
    filled_points: float
    """Share of the points of tracks that are predicted in a gap, 0..1."""
    events: dict[str, int]
    candidates_per_frame: float
    ghosts_per_frame: float
    ghost_reasons: dict[str, int]
    ghosts_denied_by: dict[str, int]
    """For each view, the number of ghosts that it denies; several may deny one."""
    windows: int
    frames_per_window: float
    rates: dict[str, dict[str, float]]
    """Error rates of each view at the end of the run: `miss`, `clutter`, `person_clutter` of /rates, 0..1."""
    seconds_by_stage: dict[str, float]
    bytes_per_frame: float
    bytes: int
    warnings: list[str]


def summarise_run(run: Run) -> Overview:
    """Summarise a run."""
    count, size, grid = len(run.frames), run.path.stat().st_size, run.recording.rig.grid
    people = np.unique(run.trajectory["frame"], return_counts=True)[1]
    ghosts, reasons = run.ghosts["status"] == 0, ghost_reasons(run.ghosts)
    solved = run.windows["solve_stop"] - run.windows["solve_first"]
    kinds, counts = np.unique(run.events["kind"], return_counts=True)
    rows = run.tracks[np.lexsort((run.tracks["id"], -run.tracks["frames"]))]
    last_rates = run.rates[run.rates["frame"] == run.rates["frame"].max(initial=-1)]
    return Overview(
        file=str(run.path),
        scene=run.scene,
        cameras=run.cameras,
        created=run.provenance.created,
        x=grid.x,
        y=grid.y,
        top=grid.top,
        cell=grid.cell,
        planes=grid.planes,
        ground_by_views=ground_by_views(run.views, grid.inside(), len(run.cameras)).tolist(),
        frame_rate=run.frame_rate,
        frames=count,
        first_frame=int(run.frames[0]) if count else None,
        last_frame=int(run.frames[-1]) if count else None,
        seconds=count / run.frame_rate,
        people_mean=per(people.sum(), count),
        people_most=int(people.max(initial=0)),
        people_per_minute=people_per_minute(run.frames, run.trajectory, run.frame_rate).tolist(),
        tracks=[dict(zip(rows.dtype.names or (), row.tolist(), strict=True)) for row in rows],
        track_seconds=_track_seconds(run),
        filled_points=per(np.isnan(run.trajectory["raw_x"]).sum(), len(run.trajectory)),
        events={name.decode(): int(number) for name, number in zip(kinds.tolist(), counts, strict=True)},
        candidates_per_frame=per(len(ghosts), count),
        ghosts_per_frame=per(ghosts.sum(), count),
        ghost_reasons=dict(zip(REASONS, reasons.counts(), strict=True)),
        ghosts_denied_by=dict(zip(run.cameras, reasons.denies.sum(axis=0).tolist(), strict=True)),
        windows=len(solved),
        frames_per_window=per(solved.sum(), len(solved)),
        rates={run.cameras[row["view"]]: {name: float(row[name]) for name in ERROR_RATES} for row in last_rates},
        seconds_by_stage=seconds_by_stage(run),
        bytes_per_frame=per(size, count),
        bytes=size,
        warnings=run.warnings,
    )


def per(total: float, count: int) -> float:
    """A mean, 0 of nothing."""
    return float(total) / count if count else 0.0


def seconds_by_stage(run: Run) -> dict[str, float]:
    """The slowest stage first."""
    names, stage = np.unique(run.timings["stage"], return_inverse=True)
    seconds = np.bincount(stage, run.timings["seconds"], len(names))
    return {names[index].decode(): float(seconds[index]) for index in np.argsort(-seconds, kind="stable")}


def _track_seconds(run: Run) -> dict[str, float]:
    if not len(run.tracks):
        return {}
    lengths = (run.tracks["last"] - run.tracks["first"] + 1) / run.frame_rate
    points = zip(("shortest", "median", "longest"), np.quantile(lengths, (0, 0.5, 1)).tolist(), strict=True)
    return dict(points)
