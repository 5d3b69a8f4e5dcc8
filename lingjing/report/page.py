"""The report as one HTML page, without scripts and without anything to load, light or dark as the browser is set."""

from __future__ import annotations

import html
import re
from collections.abc import Iterable, Iterator
from importlib.resources import files

from lingjing.analysis.played_city import credit
from lingjing.bench.dataset_card import seed_ranges
from lingjing.bench.exports import to_html
from lingjing.bench.table_cells import UNRESOLVED
from lingjing.bench.unresolved import unresolved_entrants
from lingjing.report.drawing import DARK, LIGHT, Drawing
from lingjing.report.evidence import ReportEvidence
from lingjing.report.figure import FigureKind, FigurePart
from lingjing.report.painting import inline_svg
from lingjing.terminal import visible

POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; form-action 'none'"
"""Content security policy of the page: it may load and run nothing."""


def report_page(evidence: ReportEvidence, made: Iterable[tuple[FigureKind, list[FigurePart]]], title: str) -> str:
    """Return the page of figures with their parts. Figures without parts are listed with the command to run."""
    shown, absent = list[tuple[FigureKind, list[FigurePart]]](), list[FigureKind]()
    for kind, parts in made:
        if parts:
            shown.append((kind, parts))
        else:
            absent.append(kind)
    body = [
        f"<header><h1>{_text(title)}</h1>", *_summary(evidence), "</header>", _contents(kind for kind, _ in shown),
        "<main>", *(_section(kind, parts) for kind, parts in shown), *_absent(absent), "</main>",
    ]  # fmt: skip
    lines = "\n".join(body)
    return (
        "<!doctype html>\n<html lang='en'><head><meta charset='utf-8'>\n"
        "<meta name='viewport' content='width=device-width, initial-scale=1'>\n"
        f"<meta http-equiv='Content-Security-Policy' content=\"{POLICY}\">\n"
        f"<title>{_text(title)}</title>\n<style>\n{_style()}</style></head>\n"
        f"<body>\n{lines}\n</body></html>\n"
    )


def _summary(evidence: ReportEvidence) -> Iterator[str]:
    """Yield the facts that hold for all figures: the episodes, the intervals, and the notes."""
    rows = [row for study in evidence.studies for row in study.all_rows]
    counted = [row for study in evidence.studies for row in study.rows]
    if counted:
        entrants = len({row.entrant for row in counted})
        missions = dict.fromkeys(row.mission.upper() for row in counted)
        yield (
            f"<p>{evidence.episodes} episode{'s' * (evidence.episodes != 1)} of "
            f"{entrants} entrant{'s' * (entrants > 1)} in "
            f"{_text(', '.join(missions))}; seeds {_text(seed_ranges({row.seed for row in counted}))}. Brackets and "
            "whiskers are 95 % intervals; N/A means not defined, a dash not played.</p>"
        )
    notes = list(evidence.left_out)
    for standing, words in (
        ("aborted", "infrastructure aborts were played again"),
        ("lost", "episodes are lost, and in no rate"),
    ):
        number = sum(row.standing == standing for row in rows)
        if number:
            notes.append(f"{number} {words}")
    codes = sorted({row.code[:12] for row in counted if row.code})
    if len(codes) > 1:
        notes.append(f"played by {len(codes)} versions of the code: {', '.join(codes)}")
    if any(row.privileged for row in counted):
        notes.append("† has access to the truth and is never marked as best")
    if unresolved_entrants(rows):
        notes.append(
            f"{UNRESOLVED} has episodes that are lost, or were played again after an abort that it may have caused"
        )
    notes += [words for maps in dict.fromkeys(row.report.attribution for row in counted) if (words := credit(maps))]
    if notes:
        yield f"<ul class='notes'>{''.join(f'<li>{_text(note)}</li>' for note in notes)}</ul>"


def _contents(kinds: Iterable[FigureKind]) -> str:
    links = "".join(f"<li><a href='#{kind.name}'>{_text(kind.title)}</a></li>" for kind in kinds)
    return f"<nav aria-label='Figures'><ul>{links}</ul></nav>"


def _section(kind: FigureKind, parts: Iterable[FigurePart]) -> str:
    inside = "\n".join(_part(kind, number, part) for number, part in enumerate(parts, 1))
    return (
        f"<section id='{kind.name}'><h2>{_text(kind.title)}</h2>\n"
        f"<p class='about'>{_text(kind.about)} <span class='source'>{_text(kind.source)}</span></p>\n{inside}</section>"
    )


def _part(kind: FigureKind, number: int, part: FigurePart) -> str:
    heading = f"<h3>{_text(part.heading)}</h3>" if part.heading else ""
    drawn = "".join(_drawn(drawing, f"{kind.name}-{number}-{at}") for at, drawing in enumerate(part.drawings, 1))
    notes = "".join(f"<li>{_text(note)}</li>" for note in part.notes)
    tables = "".join(
        f"<div class='scroll' tabindex='0' role='region' aria-label='{_text(table.title)}'>{to_html(table)}</div>"
        for table in part.tables
    )
    listed = f"<ul class='notes'>{notes}</ul>" if notes else ""
    return (
        f"<div class='part'>{heading}<div class='panels'>{drawn}</div>{listed}<div class='tables'>{tables}</div></div>"
    )


def _drawn(drawing: Drawing, name: str) -> str:
    kind = "wide" if drawing.wide else "panel"
    moved = " tabindex='0' role='region' aria-label='can be moved sideways'" if drawing.wide else ""
    return (
        f"<figure class='{kind}'><figcaption>{_text(drawing.title)}</figcaption>"
        f"<div class='scroll'{moved}>{inline_svg(drawing, name)}</div></figure>"
    )


def _absent(kinds: list[FigureKind]) -> Iterator[str]:
    if kinds:
        lines = "".join(f"<li><b>{_text(kind.title)}</b>: {_text(kind.needs)}</li>" for kind in kinds)
        head = "<h2>Not in this report</h2><p>The commands that play the episodes for the other figures:</p>"
        yield f"<section id='absent'>{head}<ul>{lines}</ul></section>"


def _style() -> str:
    """Return the style sheet with the tones: dark if the browser prefers it, light otherwise and in print."""
    text = files("lingjing.report").joinpath("assets", "report.css").read_text(encoding="utf-8")
    text = re.sub(r"/\*.*?\*/\s*", "", text, flags=re.DOTALL)
    light, dark = (";".join(f"--{name}:{value}" for name, value in tones.items()) for tones in (LIGHT, DARK))
    return f":root{{{light}}}\n@media screen and (prefers-color-scheme:dark){{:root{{{dark}}}}}\n{text}"


def _text(text: str) -> str:
    return html.escape(visible(text))


__all__ = ["POLICY", "report_page"]
