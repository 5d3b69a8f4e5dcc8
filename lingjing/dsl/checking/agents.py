"""Checkers of agents: their bodies and observations, authority over commands, messages and relations between roles."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import msgspec

from lingjing.dsl.checking.blocks import BlockReader, DeclarationChecker
from lingjing.dsl.checking.entities import EntityChecker
from lingjing.dsl.checking.properties import suffix_of
from lingjing.dsl.checking.scope import GroupInfo
from lingjing.dsl.checking.settings import SettingsChecker
from lingjing.dsl.checking.typenames import with_article
from lingjing.dsl.checking.unseen_pictures import PlacedChannel, warn_of_unseen
from lingjing.dsl.checking.values import STATIC, UNKNOWN, Environment, TypedExpression
from lingjing.dsl.checking.wording import WordingChecker
from lingjing.dsl.syntax import tree as s
from lingjing.dsl.syntax.foreign import NAMES
from lingjing.dsl.syntax.statements import RELATIONS
from lingjing.mission import expression as ex
from lingjing.mission import model
from lingjing.mission.diagnostics import Related
from lingjing.mission.functions import GNSS, IMU, NUMBER, OBSERVED_FIELDS, STATE_FIELDS
from lingjing.mission.vocabulary import EVERYONE

_SENSORS = {GNSS: ("receiver", "m8"), IMU: ("inertial unit", "bmi088")}
"""The device that shows each field of a sensor, and a model of it."""


class AgentChecker(DeclarationChecker):
    """Checks agents, messages and reveals. A method for each returns its part of the graph, or None if it is faulty."""

    def __init__(self, blocks: BlockReader, settings: SettingsChecker, entities: EntityChecker) -> None:
        super().__init__(blocks)
        self.settings = settings
        self.entities = entities
        self.wording = WordingChecker(blocks)
        self.controlled: dict[str, s.Expression] = {}

    def head(self, node: s.AgentBlock) -> None:
        """Register the agent's name and role."""
        self.report.once(self.scope.agents, node.name, "the agent")
        self.scope.agent_heads.setdefault(node.name.text, node)
        self.scope.roles.setdefault(node.role.text, self.report.span(node.role.start, node.role.end))

    def agent(self, node: s.AgentBlock) -> model.Agent:
        """Check the statement `agent name[i in 1..n] as role controls … { observes … }`."""
        count, index = self.entities.count(node.index)
        environment = STATIC.binding(index, NUMBER) if node.index is not None else STATIC
        controls = tuple(self._controlled(part, environment) for part in node.controls)
        channels: list[PlacedChannel] = []
        prompt, original = "", None  # type: str, s.TextLine | None
        translated: list[s.TextLine] = []
        budget: model.AllowanceDeclaration | None = None
        for item in node.block.items if node.block else ():
            if isinstance(item, s.Observes):
                guard = self.settings.guard(item.guard, environment)
                for channel in item.channels:
                    checked = self._channel(channel, environment)
                    if checked is not None:
                        channels.append(PlacedChannel(channel, msgspec.structs.replace(checked, when=guard)))
            elif isinstance(item, s.TextLine) and item.keyword == "prompt":
                if item.language is None:
                    original, prompt = item, self.wording.text(item, environment)
                else:
                    translated.append(item)
            elif isinstance(item, s.SettingsBlock) and item.keyword == "budget":
                budget = self.settings.allowance(item)
            elif not isinstance(item, s.Faulty):
                self.blocks.misplaced(item, f"the agent `{node.name.text}`", ("observes", "prompt", "budget"))
        embodied = tuple(value.ir for value in controls if value is not None)
        warn_of_unseen(channels, embodied, self.scope.mounted, node.name.text, self.report)
        return model.Agent(
            name=node.name.text,
            role=node.role.text,
            count=count,
            index=index,
            controls=embodied,
            observes=tuple(dict.fromkeys(placed.channel for placed in channels)),
            prompt=prompt,
            prompts=self.wording.translations(original, translated, environment),
            when=self.settings.guard(node.guard),
            budget=budget,
        )

    def check_languages(self, nodes: Iterable[s.AgentBlock], goals: Mapping[str, str]) -> None:
        """Report prompts that lack a language of the goal, or have one that the goal lacks."""
        for node in nodes:
            texts = [item for item in node.block.items if isinstance(item, s.TextLine)] if node.block else []
            own = {item.language.text: item for item in texts if item.language is not None}
            for language, item in own.items():
                if language not in goals:
                    hint = f'add `goal {language} "…"`, or remove this text'
                    self.report.at("LJ0127", item.language or item, f"the goal has no text in `{language}`", hint)
            for language in goals:
                if language not in own and any(item.language is None for item in texts):
                    message = f"the prompt of `{node.name.text}` has no text in `{language}`, which the goal has"
                    self.report.at("LJ0127", node.name, message, f'add `prompt {language} "…"`')

    def authority(self, node: s.AuthorityLine) -> tuple[model.Authority, ...]:
        """`authority role, role may command resource`: one authority of the graph for each role."""
        for role in node.roles:
            self.role(role)
        resource = self.asset(node.resource, "for a command")
        guard = self.settings.guard(node.guard)
        if resource is None:
            return ()
        return tuple(model.Authority(role=role.text, resource=resource.ir, when=guard) for role in node.roles)

    def message_head(self, node: s.MessageLine) -> None:
        """Register the message kind."""
        record = self.scope.records.get(node.type.text)
        if record is None:
            self.of.unknown_name(node.type, list(self.scope.records), "no message record")
        known = self.scope.messages.get(node.name.text)
        if known is not None:
            self.report.declared_twice(node.name, f"the message `{node.name.text}`", known[1])
            return
        self.scope.messages[node.name.text] = (record, self.report.span(node.name.start, node.name.end))

    def message(self, node: s.MessageLine) -> model.MessageKind | None:
        """Check the statement `message kind : record from roles to roles`."""
        for name in node.senders:
            self.role(name)
        everyone = any(name.text == EVERYONE for name in node.recipients)
        for name in node.recipients:
            if name.text != EVERYONE:
                self.role(name)
        guard = self.settings.guard(node.guard)
        record = self.scope.records.get(node.type.text)
        if record is None:
            return None
        return model.MessageKind(
            name=node.name.text,
            type=record.name,
            category=record.category,
            fields=record.fields,
            senders=tuple(name.text for name in node.senders),
            recipients=(EVERYONE,) if everyone else tuple(name.text for name in node.recipients),
            when=guard,
        )

    def reveal(self, node: s.RevealLine) -> model.Reveal | None:
        """Check the statement `reveal image(target) to role when …`."""
        guard = self.settings.guard(node.guard)
        if node.what.text != "image":
            self.report.at("LJ0109", node.what, f"`{node.what.text}` cannot be revealed", "only an `image` can")
            return None
        value = self.of.value(node.entity, STATIC)
        if value.type.kind not in ("entity", "group", "any"):
            self.report.at("LJ0201", node.entity, f"a target is due here, this is {with_article(value.type)}")
            return None
        self.role(node.role)
        if value.type.kind == "group":
            self.blocks.leak(self.scope.groups[value.type.of].count_taint, node.entity, "the number of pictures")
        return (
            None if value is UNKNOWN else model.Reveal(what="image", entity=value.ir, role=node.role.text, when=guard)
        )

    def relation(self, node: s.RelationLine) -> model.Relation | None:
        """One of the paper's five relations."""
        kind = node.kind
        if kind.text not in RELATIONS:
            self.report.unknown("LJ0109", kind, f"no relation is called `{kind.text}`", RELATIONS)
            return None
        for end in (node.source, node.target):
            if kind.text == "dependency":
                self._stage(end)
            else:
                self.role(end)
        clauses = {clause.keyword: self._clause(clause, node) for clause in self._once(node)}
        return model.Relation(
            kind=kind.text,  # type: ignore[arg-type]
            source=node.source.text,
            target=node.target.text,
            mutual=node.mutual,
            carries=clauses.get("carries"),
            over=clauses.get("over"),
            by=clauses.get("by"),
            per=clauses.get("per"),
            when=self.settings.guard(node.guard),
        )

    def role(self, name: s.Name) -> None:
        """Report a role without an agent."""
        if name.text not in self.scope.roles:
            everyone = NAMES.get(name.text) == EVERYONE
            hint = f"write `{EVERYONE}`" if everyone else ""
            replace = EVERYONE if everyone else None
            self.of.unknown_name(name, list(self.scope.roles), "no role", hint, replace, safe=everyone)

    # -- private

    def _controlled(self, node: s.Expression, environment: Environment) -> TypedExpression | None:
        value = self.asset(node, "for `controls`", environment)
        if value is None:
            return None
        constant = isinstance(value.ir, ex.Ref) or (
            isinstance(value.ir, ex.Index) and isinstance(value.ir.index, ex.Number)
        )
        text = self.report.source.text[node.start : node.end]
        first = self.controlled.setdefault(text, node)
        if first is not node and constant:
            self.report.at(
                "LJ0115",
                node,
                f"`{text}` is controlled by two agents",
                "use `authority … may command …`",
                related=(Related(self.report.span(first.start, first.end), "first controlled here"),),
            )
        return value

    def _channel(self, node: s.ObservedChannel, environment: Environment) -> model.Channel | None:
        source = node.source
        field: s.Name | None = None
        if isinstance(source, s.FieldExpr) and not node.everything:
            field = source.name
            source = source.base
        if isinstance(source, s.Name) and source.text in ("events", "peers") and source.text not in self.scope.symbols:
            return self._built_in(source, field)
        value = self.of.value(source, environment)
        kind = value.type.kind
        if value is UNKNOWN:
            return None
        self.blocks.leak(value.taint, node, f"the observation `{self._text(node)}`")
        if kind == "grid":
            return self._grid_channel(value, field)
        if kind not in ("entity", "group"):
            self.report.at(
                "LJ0116",
                node,
                f"{with_article(value.type)} cannot be observed",
                "observe an entity, a grid, `peers` or `events`",
            )
            return None
        if field is None:
            return model.Channel(source=value.ir)
        return self._entity_channel(node, value, field)

    def _built_in(self, source: s.Name, field: s.Name | None) -> model.Channel | None:
        if field is None:
            return model.Channel(source=ex.Symbol(source.text))
        known = OBSERVED_FIELDS if source.text == "peers" else ()
        if field.text not in known:
            self.report.unknown("LJ0102", field, f"`{source.text}` has no field `{field.text}`", known)
            return None
        return model.Channel(source=ex.Symbol(source.text), fields=(_lowered_field(field.text),))

    def _grid_channel(self, value: TypedExpression, field: s.Name | None) -> model.Channel | None:
        if field is not None:
            self.report.at("LJ0102", field, f"a grid's cells have no field `{field.text}`", "observe the grid whole")
            return None
        return model.Channel(source=ex.Symbol(value.type.of))

    def _entity_channel(self, node: s.ObservedChannel, value: TypedExpression, field: s.Name) -> model.Channel | None:
        info = self.scope.groups[value.type.of]
        attribute = info.attributes.get("position" if field.text in _SENSORS else field.text)
        if attribute is not None and attribute.taint:
            taint = (*attribute.taint, self.of.step(f"`{self._text(node)}`", node))
            self.blocks.leak(taint, node, "an observation")
            return None
        if attribute is not None and attribute.state and field.text not in _SENSORS:
            return model.Channel(source=value.ir, fields=(field.text + suffix_of(attribute.type.dimension),))
        known = [*OBSERVED_FIELDS, *(name for name, known in info.attributes.items() if known.state)]
        if field.text in self._cameras(info.name):
            return model.Channel(source=value.ir, fields=(field.text,))
        if field.text not in OBSERVED_FIELDS:
            known += self._cameras(info.name)
            self.report.unknown("LJ0102", field, f"`{info.name}` shows no `{field.text}`", known)
            return None
        if field.text in _SENSORS and not _carries(info, field.text):
            device, example = _SENSORS[field.text]
            message = f"`{info.name}` carries no {device}, so it shows no `{field.text}`"
            hint = f"declare it: `asset {info.name} … {{ {field.text} = {example} }}`"
            self.report.at("LJ0102", field, message, hint)
            return None
        return model.Channel(source=value.ir, fields=(_lowered_field(field.text),))

    def _cameras(self, group: str) -> list[str]:
        return self.scope.mounted.get(group, [])

    def _text(self, node: s.SyntaxNode) -> str:
        return self.report.source.text[node.start : node.end]

    def _stage(self, name: s.Name) -> None:
        if name.text not in self.scope.stages:
            self.of.unknown_name(name, list(self.scope.stages), "no stage")

    def _once(self, node: s.RelationLine) -> Iterable[s.Clause]:
        seen: dict[str, s.Clause] = {}
        for clause in node.clauses:
            if clause.keyword in seen:
                self.report.at("LJ0103", clause, f"`{clause.keyword}` is given twice")
            else:
                seen[clause.keyword] = clause
        return seen.values()

    def _clause(self, clause: s.Clause, node: s.RelationLine) -> str:
        name = clause.name
        if clause.keyword in ("carries", "by") and name.text not in self.scope.messages:
            self.of.unknown_name(name, list(self.scope.messages), "no message kind")
        elif clause.keyword == "over" and name.text not in self.scope.symbols:
            self.of.unknown_name(name, list(self.scope.symbols), "no entity, region or grid")
        elif clause.keyword == "per":
            self._per(name, node)
        return name.text

    def _per(self, name: s.Name, node: s.RelationLine) -> None:
        known = [self.scope.stages[end.text][0] for end in (node.source, node.target) if end.text in self.scope.stages]
        if node.kind.text != "dependency" or name.text not in known:
            variables = [variable for variable in known if variable]
            self.of.unknown_name(name, variables, "no variable of these stages")


def _carries(info: GroupInfo, sensor: str) -> bool:
    """Return whether the entity or its type declares a sensor."""
    inherited = info.type.properties if info.type is not None else ()
    return sensor in info.lines or any(prop.name == sensor for prop in inherited)


def _lowered_field(name: str) -> str:
    return STATE_FIELDS[name][0] if name in STATE_FIELDS else name
