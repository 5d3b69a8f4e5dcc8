"""`check_playability`: errors of instantiating and building a mission as diagnostics at the declarations concerned.

It runs over a mission without errors, so that a mission that passes validation runs. A declaration in a base mission is
reported at the base's name.
"""

from __future__ import annotations

import re

from lingjing.dsl.source.reporter import Reporter
from lingjing.dsl.source.text import SourceText
from lingjing.dsl.syntax import tree as s
from lingjing.dsl.syntax.parser import parse
from lingjing.mission.model import Mission
from lingjing.mission.trial import trial

_Place = tuple[int, int]
_TOO_MANY_PLACES = "LJ0611"
"""Code of a proof that more places are required than fit into a region."""


def check_playability(mission: Mission, tree: s.File, report: Reporter) -> None:
    """Report every error that prevents all instances of the mission from being played."""
    node = next((item for item in tree.items if isinstance(item, s.MissionBlock)), None)
    if node is None:
        return
    crowded = any(item.code == _TOO_MANY_PLACES for item in report.diagnostics)
    for refusal in trial(mission):
        if crowded and refusal.code == "LJ0507":
            continue  # the proof covers every seed and gives the numbers
        start, end = _place(node, refusal.path)
        report(refusal.code, start, end, refusal.message, refusal.hint)


def declaration(source: SourceText, message: str) -> tuple[int, int] | None:
    """The place of the mission's declaration that a message names first in backquotes; None without one."""
    tree = parse(Reporter(source))
    node = next((item for item in tree.items if isinstance(item, s.MissionBlock)), None)
    if node is None:
        return None
    for name in re.findall(r"`([^`]+)`", message):
        for item in node.block.items:
            head = _head(item.item if isinstance(item, s.Override) else item, name.partition("[")[0])
            if head is not None:
                return head
    head_name = node.base or node.name
    return head_name.start, head_name.end


def _place(node: s.MissionBlock, path: str) -> _Place:
    """The place of a path's declaration, as precise as the text permits."""
    _, _, rest = path.partition("/")
    owner, _, name = rest.partition("/")
    owner = owner.partition("[")[0]
    required = [item for item in node.block.items if isinstance(item, s.RequireLine)]
    if owner == "require" and name.isdigit() and int(name) <= len(required):
        condition = required[int(name) - 1].condition
        return condition.start, condition.end
    for item in node.block.items:
        inner = item.item if isinstance(item, s.Override) else item
        head = _head(inner, owner)
        if head is not None:
            return _property(inner, name) or head
    head_name = node.base or node.name
    return head_name.start, head_name.end


def _head(item: s.Statement, owner: str) -> _Place | None:
    if isinstance(item, s.SettingsBlock):
        return (item.start, item.start + len(item.keyword)) if item.keyword == owner else None
    if isinstance(item, s.SceneBlock):
        return (item.kind.start, item.kind.end) if owner == "scene" else None
    if isinstance(item, s.OutcomeLine):
        return (item.start, item.start + len(item.keyword)) if item.keyword == owner else None
    name = getattr(item, "name", None)
    return (name.start, name.end) if isinstance(name, s.Name) and name.text == owner else None


def _property(item: s.Statement, name: str) -> _Place | None:
    """The line of a block from which a property of the graph comes: `height` for `height_low_m`."""
    block = getattr(item, "block", None)
    items = block.items if isinstance(block, s.BracedBlock) else ()
    lines = [line for line in items if isinstance(line, s.PropertyLine | s.CameraBlock)]
    matches = [line for line in lines if name == line.name.text or name.startswith(f"{line.name.text}_")]
    return (matches[0].name.start, matches[0].name.end) if matches else None
