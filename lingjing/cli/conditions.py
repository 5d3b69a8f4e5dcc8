"""Printed conditions of a mission: tables on a terminal, lines with tabs in a pipe or a file, or JSON."""

from __future__ import annotations

import sys
from collections.abc import Iterator

from lingjing.mission.conditions.listing import ConditionList, ListedCondition
from lingjing.mission.conditions.quantities import Quantity
from lingjing.mission.conditions.reads import Leaf
from lingjing.mission.conditions.survey import Gate
from lingjing.terminal import visible

NARROWEST = 70
"""Columns of a terminal; in a narrower terminal lines are easier to read than five columns. Chosen."""

HEAD = ("part", "reads", "changed by", "bounds", "shown")
"""The columns of the leaves in the text of a condition. Leaves of the rules that it calls stand with these rules."""

_GATES = {
    "end": "the end of the episode",
    "event": "the event {}",
    "interaction": "the interaction {}",
    "command": "the command {}",
    "penalty": "a penalty",
    "stage": "the end of the stage {}",
    "count": "the limit {}",
    "world": "the mission's event {}",
}


def as_json(listed: ConditionList) -> str:
    """Return the conditions as JSON, ending in a newline."""
    import msgspec

    return msgspec.json.format(msgspec.json.encode(listed), indent=1).decode() + "\n"


def as_text(listed: ConditionList) -> str:
    """Return one block of lines for each condition; the columns of its leaves are separated by tabs."""
    blocks = []
    for condition in listed.conditions:
        rows = "\n".join("\t".join(row) for row in (HEAD, *_rows(condition)))
        blocks.append("\n".join((f"[{condition.at}]", *_facts(condition), rows)) + "\n")
    return "\n".join(blocks)


def print_conditions(listed: ConditionList) -> None:
    """Print a table for each condition on a terminal; in a pipe or a narrow terminal, the lines of `as_text`."""
    from rich import box
    from rich.table import Table
    from rich.text import Text  # values are text, not markup: a condition may hold brackets

    from lingjing.cli.console import console

    shown = console()
    if not sys.stdout.isatty() or shown.width < NARROWEST:
        print(as_text(listed), end="")
        return
    for condition in listed.conditions:
        shown.print(Text(condition.at, style="bold"))
        for line in _facts(condition):
            shown.print(Text(f"  {visible(line)}"))
        table = Table(*HEAD, box=box.SIMPLE, pad_edge=False)
        for column in table.columns:
            column.overflow = "fold"
        for row in _rows(condition):
            style = "red" if row[-1] == "hidden" else ""
            table.add_row(*(Text(visible(cell)) for cell in row), style=style)
        shown.print(table)


# -- private


def _facts(condition: ListedCondition) -> Iterator[str]:
    yield f"condition: {condition.text}"
    if condition.over:
        yield "over: " + ", ".join(f"{name} in {domain}" for name, domain in condition.over.items())
    yield "decides: " + ", ".join(map(_gate, condition.gates))
    rules = dict.fromkeys(rule for leaf in condition.leaves for rule in leaf.via)
    if rules:
        yield f"through rules: {', '.join(rules)}"
    hidden = {q.key: None for leaf in condition.leaves for q in leaf.quantities if q.hidden}
    yield f"hidden: {', '.join(hidden) or 'nothing'}"
    for what, reason in condition.declassified.items():
        yield f"declassified: {what} because {reason}"


def _gate(gate: Gate) -> str:
    return _GATES[gate.kind].format(gate.name)


def _rows(condition: ListedCondition) -> Iterator[tuple[str, ...]]:
    """Yield one row for each quantity of each leaf. The text of a leaf stands in its first row."""
    for leaf in condition.leaves:
        if leaf.via:
            continue
        part = _line(_part(leaf))
        if not leaf.quantities:
            yield (part, "", "", "", "")
        for quantity in leaf.quantities:
            yield (part, *_quantity(quantity))
            part = ""


def _part(leaf: Leaf) -> str:
    return f"not {leaf.text}" if leaf.negated else leaf.text


def _quantity(quantity: Quantity) -> tuple[str, str, str, str]:
    causes = "adjudication" if quantity.kind == "rule" else "; ".join(_causes(quantity)) or "nothing"
    return _line(quantity.key), _line(causes), _bounds(quantity), "hidden" if quantity.hidden else "public"


def _causes(quantity: Quantity) -> Iterator[str]:
    """Yield the causes; those of one kind by the same roles are one text: `verb forward, left by executor`."""
    names: dict[tuple[str, tuple[str, ...]], list[str]] = {}
    for cause in quantity.causes:
        names.setdefault((cause.kind, cause.by), []).append(cause.name)
    for (kind, by), grouped in names.items():
        actors = f" by {', '.join(by)}" if by else ""
        yield kind if kind == "time" else f"{kind} {', '.join(grouped)}{actors}"


def _bounds(quantity: Quantity) -> str:
    """Return `0..1200`, or a bound on one side, or "" for no bound."""
    match quantity.least, quantity.most:
        case None, None:
            return ""
        case least, None:
            return f">= {least:g}"
        case None, most:
            return f"<= {most:g}"
        case least, most if least == most:
            return f"{least:g}"
        case least, most:
            return f"{least:g}..{most:g}"


def _line(text: str) -> str:
    """Return the text on one line without tabs, because these separate columns."""
    return " ".join(text.split())
