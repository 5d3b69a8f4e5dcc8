"""`check`: a syntax tree → the `Mission`, with declarations checked in the order of their dependencies.

Names may be used before their declaration in the text. So the heads come first: types and records, mode, params,
regions and grids, the names of entities, agents, messages, stages and rules. The bodies follow. Faulty parts are
reported and left out; the rest is checked.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, TypeVar

from lingjing.digests import sha256
from lingjing.dsl.checking.agents import AgentChecker
from lingjing.dsl.checking.conduct import ConductChecker
from lingjing.dsl.checking.events import EventChecker
from lingjing.dsl.checking.expectations import ExpectationChecker
from lingjing.dsl.checking.inherit import merge_base
from lingjing.dsl.checking.orders import OrderChecker
from lingjing.dsl.checking.rules import RuleChecker
from lingjing.dsl.checking.scope import SymbolTables
from lingjing.dsl.checking.settings import NO_HUB
from lingjing.dsl.checking.studies import StudyChecker
from lingjing.dsl.checking.toplevel import FileChecker, Files, names_in_faults
from lingjing.dsl.checking.wording import is_original
from lingjing.dsl.source.reporter import Reporter
from lingjing.dsl.source.text import SourceText
from lingjing.dsl.syntax import tree as s
from lingjing.dsl.syntax.statements import CAPABILITIES, kind_of
from lingjing.mission import expression as ex
from lingjing.mission import model
from lingjing.mission.diagnostics import Related, has_errors

N = TypeVar("N", bound=s.Statement)

_REQUIRED = (
    ("goal", 'add `goal "…"`'),
    ("scene", "add `scene … { }`"),
    ("clock", "add `clock { tick = 10 s, sync = 500 ms }`"),
    ("budget", "add `budget { ticks <= … }`"),
    ("success", "add `success when …`"),
)
"""Required statements of a mission, and the hint if one is missing."""


def check(tree: s.File, report: Reporter, files: Files | None = None) -> model.Mission | None:
    """Return the mission of a file.

    None if errors were reported, or if the file holds no mission, which is an error unless it holds types. `files`:
    files that the compilation has already read.
    """
    file = FileChecker(report, files=files)
    file.declarations(tree)
    mission = check_mission(file, tree)
    file.of.names.report_all()
    return None if has_errors(tuple(report.diagnostics)) else mission


def check_mission(file: FileChecker, tree: s.File) -> model.Mission | None:
    """Check the mission of a file with a checked top. The meaning of names stays in `file.scope`.

    The result lacks faulty parts. It is None if a required part is faulty.
    """
    report = file.report
    missions = [item for item in tree.items if isinstance(item, s.MissionBlock)]
    for extra in missions[1:]:
        report.at("LJ0104", extra.name, "a file holds one mission", "move it into a file of its own")
    if missions:
        whole = merge_base(file, missions[0], check)
        return None if whole is None else _MissionChecker(file).mission(whole)
    faulty = any(isinstance(item, s.Faulty) for item in tree.items)
    if not faulty and not file.own:
        end = len(report.source.text.rstrip())
        report("LJ0106", 0, min(1, end), "the file holds no mission", 'add `mission name "title" { … }`')
    return None


class _MissionChecker:
    """Checks the content of a mission."""

    def __init__(self, file: FileChecker) -> None:
        self.report = file.report
        self.scope = file.scope
        self.blocks = file.blocks
        self.settings = file.settings
        self.entities = file.entities
        self.interactions = file.interactions
        self.agents = AgentChecker(file.blocks, file.settings, file.entities)
        self.rules = RuleChecker(file.blocks, file.settings)
        self.conduct = ConductChecker(file.blocks, file.settings, self.rules)
        self.events = EventChecker(file.blocks, file.settings)
        self.studies = StudyChecker(file.blocks, file.settings)
        self.expectations = ExpectationChecker(file.blocks, self.studies)
        self.orders = OrderChecker(file.blocks)

    def mission(self, node: s.MissionBlock) -> model.Mission | None:
        """Run all passes over a mission's block."""
        items = node.block.items
        self.scope.poisoned.update(names_in_faults(items))
        self._misplaced(items)
        modes = self._mode(items)
        self.scope.ceilings.update(_ceilings(_all(items, s.Param)))
        for param in _all(items, s.Param):
            if param.hidden:
                self.scope.hidden_params[param.name.text] = (self.entities.of.step(f"`{param.name.text}`", param.name),)
        self._heads(items)
        self._taints(items)
        declarations = _by_part(items)
        parts: dict[str, Any] = {part: self._items(part, declarations[part]) for part in _FIRST}
        self.studies.bounds = {param.name: param.bounds for param in parts["parameters"]}
        sections = self._sections(items)
        goal = self._one(items, s.TextLine, "goal")
        scene_block = self._one(items, s.SceneBlock, "scene")
        weather, comms = sections.get("weather"), sections.get("comms")
        outcomes = self._outcomes(items)
        declared = [name for name, part in (("goal", goal), ("scene", scene_block)) if part]
        self._required(node, {*declared, *sections, *outcomes})
        scene = self.settings.scene(scene_block) if scene_block else None
        clock = self.settings.clock(sections["clock"]) if "clock" in sections else None
        budget = self.settings.budget(sections["budget"]) if "budget" in sections else None
        parts |= {part: self._items(part, declarations[part]) for part in _CHECKS if part not in _FIRST}
        goals = self.agents.wording.translations(goal, [item for item in _all(items, s.TextLine) if item.language])
        if node.base is None:  # a mission that extends another one may leave out its languages
            self.agents.check_languages(_all(items, s.AgentBlock), goals)
        parts["relations"] = self.orders.relations(_all(items, s.OrderLine), parts["relations"])
        mission = partial(
            model.Mission,
            name=node.name.text,
            title=node.title.value if node.title else node.name.text,
            goal=self.agents.wording.text(goal) if goal else "",
            goals=goals,
            weather=self.settings.weather(weather) if weather else (),
            weather_alternatives=self.settings.weather_alternatives(weather) if weather else (),
            comms=self.settings.comms(comms) if comms else model.Comms(),
            failure=outcomes.get("failure"),
            base=node.base.text if node.base else "",
            capabilities=self._capabilities(items),
            **parts,
        )
        self.interactions.between(_all(items, s.EntityBlock), parts["agents"])
        self.rules.cycles(_all(items, s.RuleBlock))
        self.events.cycles(_all(items, s.EventBlock), parts["events"], parts["rules"])
        self.events.never_closed(_all(items, s.EventBlock), parts["events"])
        self.rules.unlocked_once(_all(items, s.UnlockLine))
        if budget is not None and clock is not None:
            for event in _all(items, s.EventBlock):
                self.events.after_the_end(event, budget, clock)
        self._whole(node, modes)
        success = outcomes.get("success")
        if scene is None or clock is None or budget is None or modes is None or success is None:
            return None
        return mission(
            scene=scene, clock=clock, budget=budget, modes=modes, success=success, origin=_origin(self.report.source)
        )

    # -- private

    def _items(self, part: str, items: list[s.Statement]) -> tuple[Any, ...]:
        """The correct items of a field of the mission, in the order of the text."""
        results = [_CHECKS[part](self, item) for item in items]
        lists = [result if isinstance(result, tuple) else (result,) for result in results]
        return tuple([item for several in lists for item in several if item is not None])

    def _misplaced(self, items: tuple[s.Statement, ...]) -> None:
        for item in items:
            kind = kind_of(item)
            if not isinstance(item, s.Faulty) and (kind is None or "mission" not in kind.within):
                self.blocks.misplaced(item, "a mission")

    def _mode(self, items: tuple[s.Statement, ...]) -> model.Modes | None:
        node = self._one(items, s.ModeLine, "mode")
        if node is None:
            if not names_in_faults(items):
                modes = model.Modes(default="broadcast", allowed=("broadcast",))
                self.scope.modes = modes.allowed
                self.scope.mode_line = (modes.default, 0, 0)
                return modes
            self.scope.modes = ("star", "broadcast")
            return None
        modes_or_none = self.settings.mode(node)
        self.scope.mode_line = (node.default.text, node.start, node.end)
        self.scope.modes = modes_or_none.allowed if modes_or_none else ("star", "broadcast")
        return modes_or_none

    def _heads(self, items: tuple[s.Statement, ...]) -> None:
        for item in items:
            if isinstance(item, s.EntityBlock):
                self.entities.head(item)
            elif isinstance(item, s.AgentBlock):
                self.agents.head(item)
            elif isinstance(item, s.MessageLine):
                self.agents.message_head(item)
            elif isinstance(item, s.StageBlock):
                self.rules.stage_head(item)
                for line in item.block.items:
                    if isinstance(line, s.LimitLine):
                        self.conduct.head(line)
            elif isinstance(item, s.InspectionBlock | s.LimitLine):
                self.conduct.head(item)
            elif isinstance(item, s.RuleBlock):
                self.rules.head(item)
            elif isinstance(item, s.EventBlock):
                self.events.head(item)

    def _taints(self, items: tuple[s.Statement, ...]) -> None:
        """Propagate taints until no further property or region becomes hidden. Each round hides at least one, so it
        ends.

        It runs before anything is read: a param may read a place that is computed from a hidden value further down.
        """
        nodes, regions = _all(items, s.EntityBlock), _all(items, s.RegionLine)
        before = -1
        while (now := _hidden_count(self.scope)) != before:
            before = now
            for node in nodes:
                self.entities.propagate_taints(node)
            for region in regions:
                self.entities.propagate_taint_to_region(region)

    def _capabilities(self, items: tuple[s.Statement, ...]) -> tuple[str, ...]:
        """The abilities that the task requires, each once."""
        node = self._one(items, s.CapabilityLine, "capabilities")
        for name in node.names if node else ():
            if name.text not in CAPABILITIES:
                self.report.unknown("LJ0109", name, f"`{name.text}` is no capability", CAPABILITIES)
        return tuple(dict.fromkeys(name.text for name in node.names)) if node else ()

    def _sections(self, items: tuple[s.Statement, ...]) -> dict[str, s.SettingsBlock]:
        sections: dict[str, s.SettingsBlock] = {}
        for item in _all(items, s.SettingsBlock):
            if item.keyword in sections:
                self._twice(item.keyword, item, sections[item.keyword])
            else:
                sections[item.keyword] = item
        return sections

    def _outcomes(self, items: tuple[s.Statement, ...]) -> dict[str, ex.Expr]:
        conditions: dict[str, ex.Expr] = {}
        first: dict[str, s.OutcomeLine] = {}
        for item in _all(items, s.OutcomeLine):
            if item.keyword in first:
                self._twice(item.keyword, item, first[item.keyword])
                continue
            first[item.keyword] = item
            conditions[item.keyword] = self.rules.outcome(item)
        return conditions

    def _one(self, items: tuple[s.Statement, ...], kind: type[N], keyword: str) -> N | None:
        matches = [i for i in _all(items, kind) if not isinstance(i, s.TextLine) or is_original(i, keyword)]
        for extra in matches[1:]:
            self._twice(keyword, extra, matches[0])
        return matches[0] if matches else None

    def _twice(self, keyword: str, node: s.Statement, first: s.Statement) -> None:
        self.report(
            "LJ0103",
            node.start,
            node.start + len(keyword),
            f"`{keyword}` is given twice",
            "remove one of the two",
            related=(Related(self.report.span(first.start, first.start + len(keyword)), "first given here"),),
        )

    def _required(self, node: s.MissionBlock, declared: set[str]) -> None:
        faulty = names_in_faults(node.block.items)
        text = self.report.source.text
        broken = [text[i.start : i.end].split(None, 1)[0] for i in node.block.items if isinstance(i, s.Faulty)]
        missing = [(word, hint) for word, hint in _REQUIRED if word not in declared and word not in {*broken, *faulty}]
        strays = sum(isinstance(item, s.UnknownBlock) for item in node.block.items) + broken.count("{")
        if len(missing) > strays:  # otherwise each block without its own keyword may be a missing one
            for keyword, hint in missing:
                self.report.at("LJ0106", node.name, f"the mission lacks `{keyword}`", hint)

    def _whole(self, node: s.MissionBlock, modes: model.Modes | None) -> None:
        """Report errors that only the whole mission shows."""
        items = node.block.items
        if any(isinstance(item, s.Faulty) for item in items):
            return
        if not _all(items, s.AgentBlock):
            self.report.at("LJ0106", node.name, "the mission has no agent", "add `agent … as … controls …`")
        comms = next((item for item in _all(items, s.SettingsBlock) if item.keyword == "comms"), None)
        hub_given = comms is not None and any(
            isinstance(i, s.Faulty) or (isinstance(i, s.PropertyLine) and i.name.text == "hub" and not _no_hub(i))
            for i in comms.block.items
        )
        mode = next(iter(_all(items, s.ModeLine)), None)
        self._alone(node, modes)
        if modes and "star" in modes.allowed and not hub_given and mode is not None:
            self.report(
                "LJ0502",
                mode.start,
                mode.start + len("mode"),
                "star mode has no hub",
                "add `comms { hub = … when mode == star }`, or leave `star` out of `mode`",
            )

    def _alone(self, node: s.MissionBlock, modes: model.Modes | None) -> None:
        """Report the mode `single` in a mission of several agents."""
        agents = _all(node.block.items, s.AgentBlock)
        several = len(agents) > 1 or any(agent.index for agent in agents)
        if modes is None or modes.default != "single" or not several:
            return
        second = agents[-1]
        self.report.at(
            "LJ0504",
            second.name,
            "the mode is `single`, this mission has several agents",
            "write `mode broadcast`, or `mode star` with a hub",
        )


_CHECKS: dict[str, Callable[[_MissionChecker, Any], object]] = {
    "parameters": lambda mission, node: mission.settings.param(node),
    "regions": lambda mission, node: mission.settings.region(node),
    "grids": lambda mission, node: mission.settings.grid(node),
    "agents": lambda mission, node: mission.agents.agent(node),
    "groups": lambda mission, node: mission.entities.entity(node),
    "authorities": lambda mission, node: mission.agents.authority(node),
    "messages": lambda mission, node: mission.agents.message(node),
    "rules": lambda mission, node: mission.rules.rule(node),
    "unlocks": lambda mission, node: mission.rules.unlock(node),
    "stages": lambda mission, node: mission.rules.stage(node, mission.conduct.stage_limit),
    "relations": lambda mission, node: mission.agents.relation(node),
    "reveals": lambda mission, node: mission.agents.reveal(node),
    "declassified": lambda mission, node: mission.conduct.declassified(node),
    "limits": lambda mission, node: mission.conduct.limit(node),
    "permits": lambda mission, node: mission.conduct.permit(node),
    "constraints": lambda mission, node: mission.conduct.constraint(node),
    "inspections": lambda mission, node: mission.conduct.inspection(node),
    "events": lambda mission, node: mission.events.event(node),
    "sweeps": lambda mission, node: mission.studies.sweep(node),
    "tiers": lambda mission, node: mission.studies.tier(node),
    "requirements": lambda mission, node: mission.rules.requirement(node),
    "expectations": lambda mission, node: mission.expectations.expect(node),
}
"""Field of a mission → the check of a statement that adds items to it, in the order of checking. A check returns an
item, a tuple of items, or None for a faulty statement."""

_FIRST = ("parameters", "regions", "grids")
"""Fields that are checked before all others, because settings read their names."""


def _all(items: tuple[s.Statement, ...], kind: type[N]) -> list[N]:
    return [item for item in items if isinstance(item, kind)]


def _by_part(items: tuple[s.Statement, ...]) -> dict[str, list[s.Statement]]:
    """Field of a mission → the statements that add items to it, in the order of the text."""
    statements: dict[str, list[s.Statement]] = {part: [] for part in _CHECKS}
    for item in items:
        kind = kind_of(item)
        if kind is not None and kind.part in statements:
            statements[kind.part].append(item)
    return statements


def _no_hub(line: s.PropertyLine) -> bool:
    return isinstance(line.value, s.Name) and line.value.text == NO_HUB


def _hidden_count(scope: SymbolTables) -> int:
    attributes = (attribute for info in scope.groups.values() for attribute in info.attributes.values())
    return len(scope.hidden_regions) + sum(1 for attribute in attributes if attribute.taint)


def _origin(source: SourceText) -> model.Origin:
    name = source.path.replace("\\", "/").rsplit("/", 1)[-1]
    return model.Origin(file=name, sha256=sha256(source.text.encode("utf-8", "surrogatepass")).hexdigest())


def _ceilings(nodes: list[s.Param]) -> dict[str, float]:
    """The greatest value of each param with bounds written as bare numbers."""
    ceilings: dict[str, float] = {}
    for node in nodes:
        bounds = node.value.right if isinstance(node.value, s.BinaryExpr) and node.value.operator == "in" else None
        items = bounds.items if isinstance(bounds, s.List) else ()
        if node.drawn and isinstance(node.value, s.CallExpr) and node.value.function.text == "integer":
            items = tuple(argument.value for argument in node.value.arguments[1:])
        if isinstance(bounds, s.BinaryExpr) and bounds.operator == "..":
            items = (bounds.right,)
        values = [item.value for item in items if isinstance(item, s.NumberLiteral) and not item.unit]
        if values and len(values) == len(items):
            ceilings[node.name.text] = max(values)
    return ceilings
