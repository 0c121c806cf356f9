"""The report as one HTML page: pictures, charts, style and script are inside, and nothing is loaded."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape

import numpy as np

from stseg.arrays import Floats, Rows
from stseg.records.ghost_reasons import REASONS, GhostReasons
from stseg.records.tables import event_word
from stseg.reporting.charts import people_chart, track_chart
from stseg.reporting.figures import Figure
from stseg.reporting.page.html import MOST_ROWS, bars, chart, figure, figures, note, page, section, swatch, table, when
from stseg.reporting.run_statistics import DOUBT_LIMIT, BusyTime, Span, doubtful_stretches, mean_certainty


@dataclass(frozen=True)
class ViewSummary:
    """Summary of one view."""

    name: str
    ground: float
    """Share of the ground in its view, 0..1."""
    denied: int
    """Number of ghosts that it has evidence against."""
    nats: float
    """Median evidence for people in its view, nats; nan without people."""


@dataclass(frozen=True)
class Contents:
    """Contents of the page."""

    title: str
    facts: Sequence[tuple[str, str]]
    """Names and values, at the top."""
    answers: Sequence[tuple[str, str]]
    """Questions and answers (HTML), below."""
    warnings: Sequence[str]
    span: Span
    """The frames of the run."""
    trajectory: Rows
    """TRAJECTORY (n,)."""
    probability: Floats
    """float64 (n,): probability of a person at each point, 0..1."""
    tracks: Rows
    """TRACK (m,)."""
    exchange_chances: Floats
    """float64 (m,): chance that each shows another person, 0..1."""
    events: Rows
    """EVENT (k,)."""
    candidates: int
    """Number of candidates."""
    ghosts: GhostReasons
    """Rejected candidates."""
    truth: Rows | None
    """(t,) with frame, or None."""
    kept: str
    """Kept part of the volume: all, tracks or none."""
    data: str
    """JSON for the script, see `embedded`."""
    plan: Figure
    thread: Figure
    dwell_places: Sequence[Figure]
    ghost_map: Figure
    blind_map: Figure
    """Figures; the thread is shown where no script runs."""
    view_summaries: Sequence[ViewSummary]
    """A row for each view."""
    stages: Sequence[tuple[str, float]]
    """Seconds by stage."""
    slices: Sequence[Figure]
    cameras: Sequence[Figure]
    """Figures of these sections; a section without figures is left out."""
    cell_probability: Sequence[tuple[float, float]]
    """Log-odds, nats, and the share of cells of these that people fill; empty where no volume was kept."""
    has_images: bool
    """Whether the cameras' figures show camera images, of which the page warns."""
    names: Mapping[int, str]
    """Names of tracks by id."""
    busy: Sequence[Figure]
    hours: Sequence[BusyTime]
    """Plans of the busiest minutes, and people by the hour; empty of a short run."""

    @property
    def still(self) -> list[Figure]:
        """The figures of the ground."""
        return [self.plan, self.thread, *self.dwell_places, self.ghost_map, self.blind_map]


def report_page(contents: Contents) -> str:
    """The page's text. The same contents give the same text."""
    body = _BODY.format(
        title=escape(contents.title),
        facts="".join(f"<div><dt>{escape(name)}</dt><dd>{escape(value)}</dd></div>" for name, value in contents.facts),
        sections="\n".join(filter(None, _sections(contents))),
    )
    return page(contents.title, body, contents.data, ("zone_drawing.js", "page.js"))


def _sections(contents: Contents) -> list[str]:
    span, tracks = contents.span, contents.tracks
    doubtful = doubtful_stretches(contents.trajectory, contents.probability)
    answers = "".join(f"<h3>{escape(question)}</h3><p>{answer}</p>" for question, answer in contents.answers)
    view_heads = "".join(f"<th>{escape(summary.name)}</th>" for summary in contents.view_summaries)
    counted = "people in each frame" + ("" if contents.truth is None else "; dashed: the truth")
    return [
        section("In short", answers, *(note(escape(words), "warn") for words in contents.warnings)),
        section("On the ground, and in time", _pair(figure(contents.plan), _thread(contents.thread))),
        section("Moment by moment", _MOMENT.format(grey=_GREY[contents.kept], views=view_heads)),
        section(
            "People over time",
            chart(people_chart(span, contents.trajectory, contents.truth), counted),
            _hours(span, contents.hours),
            figures(contents.busy, "sheets"),
        ),
        section("Where people are", figures(contents.dwell_places, "pair")),
        section("Ghosts removed", _GHOSTS, _pair(figure(contents.ghost_map), _reasons(contents))),
        section("Where the rig is blind", _pair(figure(contents.blind_map), _view_summaries(contents.view_summaries))),
        section(
            "Tracks",
            chart(
                track_chart(span, tracks, doubtful, contents.names),
                f"from first frame to last; pale where a person is less than {100 * DOUBT_LIMIT:.0f} % certain",
            ),
            _track_table(contents),
            _CERTAINTY,
        ),
        section("Events", _event_summary(contents), _event_table(span, contents.events)),
        section("Occupancy", _cells(contents.cell_probability), figures(contents.slices, "sheets")),
        section("Cameras", _IMAGES[contents.has_images], figures(contents.cameras, "pair")) if contents.cameras else "",
        section("Time to compute", bars(contents.stages, sum(part for _, part in contents.stages), "{:,.1f} s")),
    ]


_BODY = """<header>
<h1>{title}</h1>
<dl>{facts}</dl>
</header>
<main>
{sections}
</main>
<div id="time"><button id="play">Play</button><input id="slider" type="range" min="0" step="1" value="0"
 aria-label="moment"><output id="clock"></output></div>"""

_MOMENT = """<p class="note">The slider at the foot of the page chooses the moment. Left: people with their paths of
the last 5 seconds; crosses are candidates that were dropped as ghosts. Red ground is seen by no view, orange by one.
Right: the evidence for a person in each cell, blue against, orange for; grey cells
{grey}.</p>
<div class="pair live"><figure><canvas id="plan"></canvas><figcaption>the plan: draw a
<button id="draw-zone">zone</button> or a <button id="draw-line">line</button> called
<input id="area-name" size="12" maxlength="90" aria-label="its name"> <button id="undo-area" hidden>Undo</button>
<a id="save-areas" download="areas.geojson" hidden>save areas.geojson</a> <output id="drawing"></output>
</figcaption></figure>
<figure><canvas id="slice"></canvas><figcaption>occupancy, <select id="plane" aria-label="plane">
<option value="greatest">the greatest of all planes</option></select></figcaption></figure></div>
<div class="scroll live"><table><thead><tr><th>candidate</th><th>x, y, m</th><th>evidence, nats</th>{views}
<th>why it was dropped</th></tr></thead><tbody id="weighed"></tbody></table></div>
<p class="note">Each view answers whether it sees a person at the place: <b>yes</b>, <b>no</b>, or <b>?</b> where it is
hidden from it or out of sight. Of very many candidates the 120
with most evidence are listed. Evidence is in nats: +3 is 20 to 1 for, -3 is 20 to 1 against.</p>"""

_GREY = {
    "all": "are not seen",
    "tracks": "are not seen, or farther from all tracks than a metre, which this run did not keep (--volume tracks)",
    "none": "are not known, since this run kept no volume (--volume none)",
}

_GHOSTS = note(
    "A ghost is a place where views seem to agree on a person who is not there, such as where lines of sight to two "
    "people cross. Every frame is explained by the most probable set of people; candidates outside it are dropped."
)

_IMAGES = (
    note("Drawn from the tracks alone: this page holds no image from a camera."),
    note("This page shows images from the cameras. Share it with care.", "note warn"),
)
_CERTAINTY = note(
    "A person: how certain its points are people, on average. Exchanged: the chance that the track shows another "
    "person for a second or more. Expected calibration errors: up to 0.04 of the former; 0.03 of the latter on the "
    "recordings it was fitted to, about 0.1 on others."
)
_SIGHTS = note(
    "The evidence is the median over the people in the view. Where it is near 0 or below, the others find people that "
    "this view does not confirm: look at its calibration, and whether it has moved."
)


def _pair(left: str, right: str) -> str:
    return f'<div class="pair">{left}{right}</div>'


def _hours(span: Span, hours: Sequence[BusyTime]) -> str:
    """People by the hour, of a run of more than one."""
    if len(hours) < 2:
        return ""
    rows = [(when(span, one.first), f"{one.mean:.1f}", str(one.most), str(one.come)) for one in hours]
    return table(("hour from", "people at a time", "at most", "tracks begin"), rows, len(rows))


def _thread(fallback: Figure) -> str:
    """The picture that can be turned, and the still one where no script runs."""
    return (
        '<div><figure class="live"><canvas id="thread"></canvas><figcaption>The ground below, time upwards; pale is '
        'still to come. Drag to turn. Shown: <select id="span" aria-label="span of time"><option value="0">the whole '
        'run</option></select> <select id="whose" aria-label="track"><option value="-1">of all tracks</option></select>'
        f"</figcaption></figure><noscript>{figure(fallback)}</noscript></div>"
    )


def _reasons(contents: Contents) -> str:
    """Number of ghosts removed for each reason, the commonest first, and of those that each view denies."""
    counts, count = contents.ghosts.counts(), len(contents.ghosts.ghosts)
    ranked = [k for k in np.argsort(-np.array(counts), kind="stable").tolist() if counts[k]]
    reasons = [(REASONS[k], float(counts[k])) for k in ranked]
    denied = [(f"{summary.name} sees nobody there", float(summary.denied)) for summary in contents.view_summaries]
    parts = [note(f"ghosts removed <b>{count}</b> of {contents.candidates} candidates")]
    if count:
        parts.append(bars(reasons, count, "{:,.0f}"))
        parts.append(note("Views that deny them; several may deny the same ghost:"))
        parts.append(bars(denied, count, "{:,.0f}"))
    return f"<div>{''.join(parts)}</div>"


def _view_summaries(view_summaries: Sequence[ViewSummary]) -> str:
    rows = [
        (
            escape(summary.name),
            f"{100 * summary.ground:.0f} %",
            "sees none" if np.isnan(summary.nats) else f"{summary.nats:+.1f}",
        )
        for summary in view_summaries
    ]
    names = ("view", "of the ground it sees", "evidence for people, nats")
    return f"<div>{table(names, rows, len(rows))}{_SIGHTS}</div>"


def _track_table(contents: Contents) -> str:
    span, tracks, names = contents.span, contents.tracks, contents.names
    certainty = mean_certainty(contents.trajectory, contents.probability, tracks)
    rows = [
        (
            swatch(int(row["id"]), names.get(int(row["id"]), "")),
            when(span, int(row["first"])),
            when(span, int(row["last"])),
            f"{row['frames']}",
            f"{row['height']:.2f}" if np.isfinite(row["height"]) else "not measured",
            f"{100 * sure:.1f}",
            f"{100 * exchange:.0f}",
        )
        for row, sure, exchange in zip(
            tracks[:MOST_ROWS], certainty.tolist(), contents.exchange_chances.tolist(), strict=False
        )
    ]
    names_of_columns = ("track", "first", "last", "frames", "height, m", "a person, %", "exchanged, %")
    return table(names_of_columns, rows, len(tracks))


def _cells(cell_probability: Sequence[tuple[float, float]]) -> str:
    """Reliability of the log-odds of cells; nothing where no volume was kept."""
    if not cell_probability:
        return ""
    cells = [(f"{nats:+g}", f"{100 * probability:.0f} %") for nats, probability in cell_probability]
    words = note("Log-odds are evidence on single cells. The share of them that people fill, by this run's tracks:")
    return f"<div>{words}{table(('log-odds, nats', 'cells that people fill'), cells, len(cells))}</div>"


def _event_summary(contents: Contents) -> str:
    """Counts of events by kind; a split is the end of an encounter."""
    kinds, counts = np.unique(_without_splits(contents.events)["kind"], return_counts=True)
    named = zip((escape(event_word(kind.decode())) for kind in kinds), counts.tolist(), strict=True)
    words = [f"{kind} <b>{count}</b>" for kind, count in named]
    return note(" &middot; ".join(words) or "none")


def _without_splits(events: Rows) -> Rows:
    """Events without splits: an encounter's row holds its duration."""
    return np.asarray(events[events["kind"] != b"split"])


def _event_table(span: Span, events: Rows) -> str:
    events = _without_splits(events)
    if not len(events):
        return ""
    rows = [
        (
            when(span, int(row["frame"])),
            escape(event_word(row["kind"].decode())),
            swatch(int(row["id"])),
            swatch(int(row["other"])) if row["other"] else "",
            escape(row["reason"].decode(errors="replace")),
        )
        for row in events[np.argsort(events["frame"], kind="stable")][:MOST_ROWS]
    ]
    return table(("frame", "event", "track", "other", "reason"), rows, len(events))
