"""Export of tables to Markdown, LaTeX, CSV and HTML. All text is escaped, because suites and policies choose names."""

from __future__ import annotations

import csv
import html
import io
import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

from lingjing.bench.table_cells import ResultCell, ResultLine, ResultTable
from lingjing.terminal import visible

_LATEX = {
    "\\": r"\textbackslash{}", "&": r"\&", "%": r"\%", "$": r"\$", "#": r"\#", "_": r"\_", "{": r"\{", "}": r"\}",
    "~": r"\textasciitilde{}", "^": r"\textasciicircum{}", "<": r"\textless{}", ">": r"\textgreater{}", "–": "--",
    "†": r"\textsuperscript{\dag}", "‡": r"\textsuperscript{\ddag}", "\n": " ",
}  # fmt: skip
"""LaTeX escapes of special characters."""

_RAISED = re.compile(r"\^(\w)$")
"""The mode in the head of a column: `UFR^s`."""

_FORMULA = ("=", "+", "-", "@", "\t", "\r")
"""First characters that make a spreadsheet read a text as a formula."""


def to_markdown(table: ResultTable) -> str:
    """Return a table in GitHub's Markdown with its heading and notes."""
    heads = [*table.labels, *(_RAISED.sub(r" \1", head) for head in table.heads)]
    lines = [f"### {escape_markdown(table.title)}", "", _piped(map(escape_markdown, heads))]
    lines.append(_piped([*("---" for _ in table.labels), *("---:" for _ in table.heads)]))
    for group, some in _grouped(table.lines):
        if group:
            lines.append(_piped([f"*{escape_markdown(group)}*", *("" for _ in heads[1:])]))
        lines += [_piped([*map(escape_markdown, line.label), *map(_marked_markdown, line.cells)]) for line in some]
    notes = [f"- {escape_markdown(note)}" for note in table.notes]
    return "\n".join([*lines, *([""] if notes else []), *notes, ""])


def to_latex(table: ResultTable) -> str:
    """Return a `tabular` with booktabs rules: the best value bold, the second best underlined, as in the paper."""
    width = len(table.labels) + len(table.heads)
    heads = [
        *(rf"\textbf{{{_latex(head)}}}" for head in table.labels),
        *(_latex_head(head) for head in table.heads),
    ]
    lines = [
        rf"% {_latex(table.title)}",
        rf"\begin{{tabular}}{{@{{}}{'l' * len(table.labels)}{'r' * len(table.heads)}@{{}}}}",
        r"\toprule",
        f"{' & '.join(heads)} \\\\",
    ]
    for group, some in _grouped(table.lines):
        lines.append(r"\midrule")
        if group:
            lines.append(rf"\multicolumn{{{width}}}{{@{{}}l}}{{\emph{{{_latex(group)}}}}} \\")
        for line in some:
            cells = [*map(_latex, line.label), *map(_marked_latex, line.cells)]
            apart = "{}" if cells[0].startswith(("[", "*")) else ""  # else LaTeX reads them as arguments of `\\`
            lines.append(f"{apart}{' & '.join(cells)} \\\\")
    return "\n".join([*lines, r"\bottomrule", r"\end{tabular}", *(f"% {_latex(note)}" for note in table.notes), ""])


def to_csv(table: ResultTable) -> str:
    """Return comma-separated values with unformatted numbers; an undefined number is empty, and no text is a
    formula.
    """
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(["group", *map(_harmless, (*table.labels, *table.heads))])
    for line in table.lines:
        texts = [_harmless(text) for text in (line.group, *line.label)]
        writer.writerow([*texts, *(_number(cell) for cell in line.cells)])
    return out.getvalue()


def to_html(table: ResultTable) -> str:
    """Return a `<table>` with its caption and notes, without a page around it."""
    labels = "".join(f"<th class='label'>{_html(label)}</th>" for label in table.labels)
    head = labels + "".join(f"<th>{_html_head(label)}</th>" for label in table.heads)
    lines = [
        f"<table class='{table.kind}'>",
        f"<caption>{_html(table.title)}</caption>",
        f"<thead><tr>{head}</tr></thead>",
    ]
    width = len(table.labels) + len(table.heads)
    for group, some in _grouped(table.lines):
        lines.append("<tbody>")
        if group:
            lines.append(f"<tr><th colspan='{width}' scope='rowgroup'>{_html(group)}</th></tr>")
        for line in some:
            labels = "".join(f"<th scope='row'>{_html(label)}</th>" for label in line.label)
            lines.append(f"<tr>{labels}{''.join(map(_marked_html, line.cells))}</tr>")
        lines.append("</tbody>")
    notes = "".join(f"<li>{_html(note)}</li>" for note in table.notes)
    return "\n".join([*lines, "</table>", *([f"<ul class='notes'>{notes}</ul>"] if notes else []), ""])


def html_page(title: str, body: str) -> str:
    """Return a complete page in the reader's light or dark scheme. It loads no resources and runs no scripts."""
    return (
        "<!doctype html>\n<html lang='en'><head><meta charset='utf-8'>\n"
        "<meta name='viewport' content='width=device-width, initial-scale=1'>\n"
        "<meta http-equiv='Content-Security-Policy' content=\"default-src 'none'; style-src 'unsafe-inline'\">\n"
        f"<title>{_html(title)}</title>\n<style>{_STYLE}</style></head>\n<body>\n<h1>{_html(title)}</h1>\n{body}</body></html>\n"
    )


EXPORTS: Mapping[str, Callable[[ResultTable], str]] = {
    "markdown": to_markdown, "latex": to_latex, "csv": to_csv, "html": to_html,
}  # fmt: skip
"""The export functions by the name of the format."""

SUFFIXES = {"markdown": "md", "latex": "tex", "csv": "csv", "html": "html"}
"""File suffixes by the name of the format."""

_STYLE = (
    ":root{color-scheme:light dark}"
    "body{font:15px/1.5 system-ui,sans-serif;max-width:76rem;margin:2rem auto;padding:0 1rem}"
    "table{border-collapse:collapse;margin:1.5rem 0 .5rem;display:block;overflow-x:auto}"
    "caption{text-align:left;font-weight:600;margin-bottom:.4rem}"
    "th,td{padding:.2rem .6rem;text-align:right;font-variant-numeric:tabular-nums;white-space:nowrap}"
    "th[scope=row],th[scope=rowgroup],th.label{text-align:left;font-weight:400}"
    "th[scope=row]:first-child,th.label:first-child{position:sticky;left:0;background:Canvas}"
    "th[scope=rowgroup]{font-style:italic;padding-top:.6rem}"
    "thead tr{border-block:1px solid}tbody:last-of-type tr:last-child{border-bottom:1px solid}"
    "td.best{font-weight:700}td.second{text-decoration:underline}"
    ".notes{margin:.2rem 0 0;padding-left:1.2rem;opacity:.8;font-size:.9em}"
)


def _grouped(lines: Sequence[ResultLine]) -> Iterator[tuple[str, list[ResultLine]]]:
    """Yield the lines by heading, in the order of first appearance. Lines without a heading come first: below a
    heading they would seem to belong to it.
    """
    groups: dict[str, list[ResultLine]] = {"": []} if any(not line.group for line in lines) else {}
    for line in lines:
        groups.setdefault(line.group, []).append(line)
    yield from groups.items()


def _piped(cells: Iterable[str]) -> str:
    return f"| {' | '.join(cells)} |"


def escape_markdown(text: str) -> str:
    """Return text without markup: HTML and Markdown's special characters are escaped."""
    escaped = html.escape(visible(text).replace("\n", " "), quote=False)
    return re.sub(r"([\\`*_\[\]|~#])", r"\\\1", escaped)


def _marked_markdown(cell: ResultCell) -> str:
    text = escape_markdown(cell.text)
    return {"best": f"**{text}**", "second": f"<u>{text}</u>"}.get(cell.mark, text)


def _latex(text: str) -> str:
    return "".join(_LATEX.get(letter, letter) for letter in visible(text))


def _latex_head(head: str) -> str:
    mode = _RAISED.search(head)
    return f"{_latex(head[: mode.start()])}$^{{{mode[1]}}}$" if mode else _latex(head)


def _marked_latex(cell: ResultCell) -> str:
    text = _latex(cell.text)
    return {"best": rf"\textbf{{{text}}}", "second": rf"\underline{{{text}}}"}.get(cell.mark, text)


def _number(cell: ResultCell) -> str:
    """Return the number if the text is only a number; the complete text otherwise, such as an interval."""
    if math.isnan(cell.value):
        return _harmless(cell.text) if re.search(r"\d", cell.text) else ""
    return f"{cell.value:.10g}" if re.fullmatch(r"-?[\d.]+", cell.text) else _harmless(cell.text)


def _harmless(text: str) -> str:
    plain = visible(text).replace("\n", " ")
    return f"'{plain}" if plain.startswith(_FORMULA) else plain


def _html(text: str) -> str:
    return html.escape(visible(text))


def _html_head(head: str) -> str:
    mode = _RAISED.search(head)
    return f"{_html(head[: mode.start()])}<sup>{_html(mode[1])}</sup>" if mode else _html(head)


def _marked_html(cell: ResultCell) -> str:
    marked = f" class='{cell.mark}'" if cell.mark else ""
    return f"<td{marked}>{_html(cell.text)}</td>"


__all__ = ["EXPORTS", "SUFFIXES", "escape_markdown", "html_page", "to_csv", "to_html", "to_latex", "to_markdown"]
