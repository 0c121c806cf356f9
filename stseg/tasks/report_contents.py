"""Contents of the report's page, gathered from a run file."""

from collections.abc import Sequence

import numpy as np

from stseg.arrays import Rows
from stseg.evaluation import evaluate
from stseg.geometry import Camera, Grid
from stseg.io.runfile.runs import Run
from stseg.measures.motion import flow_field
from stseg.records.ghost_reasons import GhostReasons, ghost_reasons, has_evidence
from stseg.records.point_probability import point_probability
from stseg.reporting.charts import clock_time
from stseg.reporting.figures import Figure, Instant, camera_figures, ground_figures, slice_figures
from stseg.reporting.page.answers import answers
from stseg.reporting.page.embedded import embedded_json, thin_sheets
from stseg.reporting.page.page import Contents, ViewSummary
from stseg.reporting.pictures.maps import Bins, DwellPlace, blind_map, density, dwell, dwell_places, flow_map, heat_map
from stseg.reporting.pictures.plan import plan_view
from stseg.reporting.run_statistics import Span, busiest_minutes, exchange_chances, ground_by_views, people_by_hour
from stseg.tasks.overview import seconds_by_stage

_FLOW = 0.5
"""Side of a square of the map of flow, metres."""
_LOG_ODDS = (-6.0, -3.0, 0.0, 3.0, 6.0, 9.0)
"""At which the page gives the probability of cells, nats."""
_SHEETS = 8_000_000  # bytes of all slices, a third more as text


def page_contents(
    run: Run, truth: Rows | None, instants: Sequence[Instant], has_slices: bool, has_images: bool
) -> Contents:
    """Gather the contents of the page.

    Parameters
    ----------
    truth : (m,) with frame, id, x, y, or None
    instants
        The frames that the cameras show.
    has_slices
        Whether all planes of these frames are shown too.
    has_images
        Whether the instants hold camera images.
    """
    rig, trajectory = run.recording.rig, run.trajectory
    first, stop = (int(run.frames[0]), int(run.frames[-1]) + 1) if len(run.frames) else (0, 1)
    span, ghosts, bins = Span(first, stop, run.frame_rate), ghost_reasons(run.ghosts), Bins.of(rig.grid)
    places, shares = dwell_places(trajectory, bins), ground_by_views(run.views, rig.grid.inside(), len(run.cameras))
    frames_shown = np.array([instant.frame for instant in instants], np.int64)
    sheets = thin_sheets(run.frames, rig.grid, run.read_frame, _SHEETS, frames_shown)
    removed = density(bins, ghosts.ghosts, len(run.frames))
    ghost_map = heat_map(rig, bins, removed, "Where ghosts were removed", "ghosts a frame and square metre")
    plan, thread = ground_figures(rig, run.views, trajectory, truth, run.names)
    counts = (len(run.frames), trajectory, run.tracks, run.events, len(run.ghosts))
    return Contents(
        title=run.scene,
        facts=[*_facts(run, span), *_scores(trajectory, truth)],
        answers=answers(span, *counts, ghosts, places, shares),
        warnings=run.warnings,
        span=span,
        trajectory=trajectory,
        probability=point_probability(trajectory, [one.source.kind for one in run.recording.sources]),
        tracks=run.tracks,
        exchange_chances=exchange_chances(trajectory, run.tracks, run.frame_rate, np.array([rig.grid.x, rig.grid.y]).T),
        events=run.events,
        candidates=len(run.ghosts),
        ghosts=ghosts,
        truth=truth,
        kept=run.kept,
        data=embedded_json(rig, run.views, trajectory, run.ghosts, sheets, run.names),
        plan=plan,
        thread=thread,
        dwell_places=_haunt_figures(run, bins, places),
        ghost_map=Figure("ghosts", ghost_map, f"Ghosts removed, {bins.side:g} m squares."),
        blind_map=Figure("blind", blind_map(rig, run.views), "Red is seen by no view, orange by one alone."),
        view_summaries=_view_summaries(run, ghosts),
        stages=list(seconds_by_stage(run).items()),
        slices=[figure for instant in instants for figure in slice_figures(rig, instant)] if has_slices else [],
        cell_probability=_cell_probability(run),
        cameras=[figure for instant in instants for figure in camera_figures(rig, trajectory, instant)],
        has_images=has_images,
        names=run.names,
        busy=_busy_figures(run, span),
        hours=people_by_hour(span, trajectory),
    )


def _cell_probability(run: Run) -> list[tuple[float, float]]:
    """Log-odds and the calibrated probability of cells; empty where the run kept none."""
    if run.kept == "none" or not len(run.frames):
        return []
    probability = run.cell_reliability.of_cells(np.array(_LOG_ODDS, np.float32))
    return list(zip(_LOG_ODDS, probability.tolist(), strict=True))


def _facts(run: Run, span: Span) -> list[tuple[str, str]]:
    grid = run.recording.rig.grid
    computed = float(run.timings["seconds"].sum())
    return [
        ("tracks", str(len(run.tracks))),
        ("cameras", str(len(run.cameras))),
        ("frames", f"{span.first} to {span.stop - 1}"),
        ("length", clock_time((span.stop - span.first) / span.frame_rate)),
        ("frames per second", f"{span.frame_rate:g}"),
        ("ground", f"{grid.x[1] - grid.x[0]:g} m x {grid.y[1] - grid.y[0]:g} m"),
        ("cells", f"{grid.cell:g} m, {grid.planes} planes"),
        *([("time of all stages", clock_time(computed))] if computed > 0 else []),
    ]


def _scores(trajectory: Rows, truth: Rows | None) -> list[tuple[str, str]]:
    """Scores of the run against the truth, within half a metre."""
    if truth is None or not len(truth):
        return []
    scores = evaluate(truth, trajectory)
    named = (("MOTA", scores.mota, " %"), ("IDF1", scores.idf1, " %"), ("HOTA", scores.hota, " %"))
    facts = [(name, f"{value:.1f}{unit}") for name, value, unit in named if value is not None]
    return facts if scores.location_mean is None else [*facts, ("mean error", f"{scores.location_mean:.3f} m")]


def _haunt_figures(run: Run, bins: Bins, places: Sequence[DwellPlace]) -> list[Figure]:
    rig, square = run.recording.rig, f"squares of {bins.side:g} m"
    people = density(bins, run.trajectory, len(run.frames))
    stays = dwell(bins, run.trajectory, run.frame_rate)
    flow = flow_field(run.trajectory, run.frames, run.frame_rate, rig.grid.x, rig.grid.y, _FLOW)
    return [
        Figure(
            "density",
            heat_map(rig, bins, people, "How many people, on average", "people a square metre", places),
            f"Density, {square}. A, B, C: where most time is spent.",
        ),
        Figure(
            "dwell",
            heat_map(rig, bins, stays, "How long somebody stays", "seconds a stay", places),
            f"Dwell time: the mean time from entering a square to leaving it, {square}.",
        ),
        Figure(
            "flow",
            flow_map(rig, flow, (), ()),
            f"Flow: arrows are the mean way that people take, squares of {_FLOW:g} m.",
        ),
    ]


def _busy_figures(run: Run, span: Span) -> list[Figure]:
    """Small plans of the busiest minutes of a long run."""
    rig, trajectory, figures = run.recording.rig, run.trajectory, []
    for number, minute in enumerate(busiest_minutes(span, trajectory), 1):
        rows_of_minute = trajectory[(trajectory["frame"] >= minute.first) & (trajectory["frame"] < minute.stop)]
        since = clock_time(minute.first / span.frame_rate)
        picture = plan_view(rig, rows_of_minute, title=f"from {since}", width=640, height=680, names=run.names)
        words = f"The minute from {since}: {minute.mean:.1f} people at a time, at most {minute.most}."
        figures.append(Figure(f"busy{number}", picture, words))
    return figures


def _view_summaries(run: Run, ghosts: GhostReasons) -> list[ViewSummary]:
    rig, parts = run.recording.rig, np.nan_to_num(run.detections["parts"])
    view_summaries = []
    for view, camera in enumerate(rig.cameras):
        evidence = parts[:, view][has_evidence(parts[:, view])]
        nats = float(np.median(evidence)) if len(evidence) else float("nan")
        denied = int(ghosts.denies[:, view].sum())
        view_summaries.append(ViewSummary(camera.name, _ground_seen(camera, rig.grid), denied, nats))
    return view_summaries


def _ground_seen(camera: Camera, grid: Grid) -> float:
    """Share of the ground that counts over which the camera sees some plane."""
    ground = grid.ground[grid.inside()]
    visible = np.any([camera.sees(ground, height) for height in grid.heights.tolist()], axis=0)
    return float(visible.mean()) if len(visible) else 0.0
