"""`page`: a mission as a page of Markdown, for readers without knowledge of the language.

A table lists the sections. Each section yields its lines, and an empty section is left out. Code on the page comes from
the printer of `.ljs` (`lingjing.dsl.printing.printer`).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence

from lingjing.dsl.pages.judging import interactions
from lingjing.dsl.printing.printer import Printer
from lingjing.mission import expression as ex
from lingjing.mission import model
from lingjing.mission.condition_words import ConditionWords
from lingjing.mission.conditions.leaks import leaks
from lingjing.mission.draw.mermaid import mermaid
from lingjing.mission.graph import graph

_MANY_BLANKS = re.compile(r"\n{3,}")


PageSection = tuple[str, Sequence[str]]
"""A title and Markdown lines."""


def page(mission: model.Mission, *, lead: Sequence[PageSection] = (), graph_picture: str = "") -> str:
    """Return the whole page, ending in a newline. Equal missions give equal pages.

    `lead`: sections that come first. `graph_picture`: path of a drawing of the mission graph that replaces its Mermaid
    text.
    """
    writer = _Page(mission, graph_picture)
    parts = [f"# {mission.title}\n", f"Mission `{mission.name}`.\n", *_quote(mission.goal), ""]
    own = ((title, section(writer)) for title, section in _SECTIONS)
    for title, body in (*lead, *own):
        lines = list(body)
        if lines:
            parts.extend((f"## {title}\n", *lines, ""))
    return _MANY_BLANKS.sub("\n\n", "\n".join(parts)).rstrip() + "\n"


class _Page:
    """The sections. Each method yields Markdown lines."""

    def __init__(self, mission: model.Mission, graph_picture: str = "") -> None:
        self.mission = mission
        self.graph_picture = graph_picture
        self.printer = Printer(mission)
        self.words = ConditionWords(self.printer.phrases.text, self.printer.phrases.declared())

    def glance(self) -> Iterator[str]:
        """The mission at a glance: place, time, weather, modes, budgets."""
        mission, text = self.mission, self.printer.text
        rows = [
            ("Where", f"`{mission.scene.kind}`" + self._listed(self.printer.properties(mission.scene.options))),
            ("Time", f"a decision every {text(mission.clock.tick)}, at most {text(mission.budget.ticks)} of them"),
            ("Engines meet", f"every {text(mission.clock.sync)}"),
            ("Weather", self._listed(self.printer.properties(mission.weather)).removeprefix(": ") or "calm"),
            ("Modes", ", ".join(f"{m} (default)" if m == mission.modes.default else m for m in mission.modes.allowed)),
            ("Budgets", self._listed(self._budgets()).removeprefix(": ")),
        ]
        if mission.capabilities:
            rows.append(("Capabilities", ", ".join(mission.capabilities)))
        yield from _table(("", ""), rows)

    def parameters(self) -> Iterator[str]:
        """Parameters that a run may set."""
        rows = [
            (
                f"`{parameter.name}`",
                self.printer.text(parameter.default),
                self.printer.text(parameter.bounds) if parameter.bounds else "any",
            )
            for parameter in self.mission.parameters
        ]
        if rows:
            yield from _table(("Parameter", "Default", "Allowed"), rows)
        yield from self._code(self.printer.paragraph("sweeps"), "Matched studies:")

    def tiers(self) -> Iterator[str]:
        """The tiers, and the lines that each of their switches adds."""
        if not self.mission.tiers:
            return
        yield "Tier 0 is the mission with the defaults of its parameters. It is comparable with the paper by protocol"
        yield "and never by number, and results of different tiers are never compared.\n"
        for tier in self.mission.tiers:
            named = (f"`{setting.name} = {self.printer.text(setting.value)}`" for setting in tier.settings)
            yield f"Tier {tier.level} sets {', '.join(named)}.\n"
        rows = [
            (f"`{param.name}`", "<br>".join(f"`{line}`" for line in self._lines_of(param.name)))
            for param in self.mission.parameters
            if param.is_switch
        ]
        yield from _table(("Switch", "Lines under it"), rows)

    def _lines_of(self, switch: str) -> Iterator[str]:
        """Yield the lines of the mission with a condition or a part that reads the switch."""
        for group in self.mission.groups:
            if self._reads(group.when, switch):
                yield f"{group.name}: {group.type}"
            yield from self._alternatives(f"{group.name} ", group.alternatives, switch)
            for camera in group.cameras:
                for other in camera.alternatives:
                    if self._reads(other.when, switch):
                        yield f"{group.name} {camera.name} {self.printer.channels(other)}"
        yield from self._alternatives("scene ", self.mission.scene.alternatives, switch)
        yield from self._alternatives("weather ", self.mission.weather_alternatives, switch)
        for agent in self.mission.agents:
            for channel in agent.observes:
                if channel.when is not None and self._reads(channel.when, switch):
                    seen, condition = self.printer.channel(channel), self.printer.text(channel.when.condition)
                    yield f"{agent.name} observes {seen} when {condition}"
        for name in ("rules", "limits", "relations", "outcomes"):
            for line in self.printer.paragraph(name):
                if re.search(rf"\b{switch}\b", line):
                    yield " ".join(line.split())

    def _alternatives(self, lead: str, alternatives: Iterable[model.Alternative], switch: str) -> Iterator[str]:
        for alternative in alternatives:
            if self._reads(alternative.when, switch):
                yield from (f"{lead}{line}" for line in self.printer.alternatives((alternative,)))

    @staticmethod
    def _reads(guard: model.Guard | None, switch: str) -> bool:
        """True if a condition reads the switch."""
        return guard is not None and any(
            isinstance(part, ex.Ref) and part.name == switch for part in ex.parts(guard.condition)
        )

    def places(self) -> Iterator[str]:
        """Regions and grids."""
        yield from self._code(self.printer.paragraph("places"))

    def assets(self) -> Iterator[str]:
        """Assets: the entities that agents command."""
        for group in self.mission.groups:
            if group.role == "asset":
                yield from self._entity(group)

    def targets(self) -> Iterator[str]:
        """Targets: the entities that the mission is about."""
        for group in self.mission.groups:
            if group.role == "target":
                yield from self._entity(group)

    def agents(self) -> Iterator[str]:
        """Agents, their prompts and their authority."""
        rows = []
        for agent in self.mission.agents:
            controls = ", ".join(f"`{self.printer.text(held)}`" for held in agent.controls) or "nothing"
            sees = ", ".join(f"`{self.printer.channel(channel)}`" for channel in agent.observes) or "nothing"
            rows.append((self._named(agent), agent.role, controls, sees, self._when(agent.when)))
        yield from _table(("Agent", "Role", "Commands", "Sees", "When"), rows)
        for agent in self.mission.agents:
            if agent.prompt:
                yield f"\nPrompt of `{agent.name}`:\n"
                yield from _quote(agent.prompt)
        if self.mission.authorities:
            yield "\nAuthority without embodiment:\n"
        for authority in self.mission.authorities:
            also = self._when(authority.when)
            resource = self.printer.text(authority.resource)
            yield f"- {authority.role} may command `{resource}`{f', {also}' if also else ''}"

    def messages(self) -> Iterator[str]:
        """Message kinds with senders and recipients."""
        rows = []
        for message in self.mission.messages:
            fields = ", ".join(f"`{field.name}`{'?' if field.optional else ''}" for field in message.fields)
            to = ", ".join(message.recipients)
            rows.append(
                (
                    f"`{message.name}`",
                    message.category,
                    ", ".join(message.senders),
                    to,
                    fields,
                    self._when(message.when),
                )
            )
        if rows:
            yield from _table(("Message", "Counts as", "From", "To", "Fields", "When"), rows)
        bus = list(self.printer.bus())
        if bus:
            yield ""
            yield from self._code(bus)

    def expectations(self) -> Iterator[str]:
        """The mission's own tests."""
        yield from self._code(self.printer.paragraph("expectations"), "`lingjing test` checks:")

    def hidden(self) -> Iterator[str]:
        """Hidden values, and the audited reveals."""
        for group in self.mission.groups:
            own = [prop for prop in group.properties if prop.hidden]
            for line in self.printer.properties(own):
                yield f"- `{group.name}`: `{line.removeprefix('hidden ')}`"
        if self.mission.reveals:
            yield "\nAudited reveals:\n"
            for reveal in self.mission.reveals:
                yield f"- an {reveal.what} of `{self.printer.text(reveal.entity)}` is shown to {reveal.role}"
        elif any(prop.hidden for group in self.mission.groups for prop in group.properties):
            yield "\nNo agent receives any of these values."
        noticed = list(self._noticed())
        if noticed:
            yield "\nConsequences of hidden values, or of correct reports, that agents can notice:\n"
            yield from noticed

    def _noticed(self) -> Iterator[str]:
        """Hidden values that agents may infer from what the kernel decides, with the author's reasons."""
        reasons = {item.what: item.reason for item in self.mission.declassified}
        for leak in leaks(self.mission):
            reason = f': "{reasons[leak.what]}"' if leak.what in reasons else ""
            yield f"- {leak.notice}{reason}"

    def rules(self) -> Iterator[str]:
        """Adjudication rules, in words and in code."""
        for rule in self.mission.rules:
            over = ", ".join(f"{parameter.domain} `{parameter.name}`" for parameter in rule.parameters)
            once = " Reports are matched one to one with what each picture truly shows." if rule.matching else ""
            yield f"**{rule.name}**{f' of {over}' if over else ''}: {self.words.sentence(rule.condition)}.{once}\n"
        for unlock in self.mission.unlocks:
            yield f"**{unlock.interaction}** is allowed when {self.words.sentence(unlock.condition)}.\n"
        for group, interaction, before in interactions(self.mission):
            if not before:
                yield f"**{interaction.name}** of `{group.name}` is allowed from the start.\n"
        yield from self._code(self.printer.paragraph("rules"))

    def stages(self) -> Iterator[str]:
        """The course of the mission."""
        rows = []
        for stage in self.mission.stages:
            each = f"each {stage.domain} `{stage.variable}`" if stage.domain else "the mission"
            ticks = f"{self.printer.text(stage.ticks)} ticks" if stage.ticks is not None else ""
            weight = self.printer.text(stage.weight) if stage.weight is not None else "1"
            ticks += (
                f"{', ' if ticks else ''}by {self.printer.text(stage.deadline)}" if stage.deadline is not None else ""
            )
            rows.append((stage.name, each, self.words.sentence(stage.condition), ticks, weight))
        if rows:
            yield from _table(("Stage", "For", "Done when", "Within", "Weight"), rows)

    def limits(self) -> Iterator[str]:
        """Counted budgets, permits, constraints, inspections."""
        for constraint in self.mission.constraints:
            cost = (
                f", at a penalty of {self.printer.text(constraint.penalty)}" if constraint.penalty is not None else ""
            )
            each = f"for each {constraint.domain} `{constraint.variable}`, " if constraint.domain else ""
            condition = self.words.sentence(constraint.condition)
            yield f"- {constraint.kind} constraint **{constraint.name}**: always, {each}{condition}{cost}"
        for permit in self.mission.permits:
            what = f"`{self.printer.text(permit.resource)}.{permit.verb or '*'}`"
            yield f"- {what} is rejected until {self.words.sentence(permit.condition)}"
        lines = list(self.printer.paragraph("limits"))
        if lines:
            yield ""
            yield from self._code(lines)

    def relations(self) -> Iterator[str]:
        """Relations between roles."""
        yield from self._code(self.printer.paragraph("relations"))

    def events(self) -> Iterator[str]:
        """Scripted events."""
        yield from self._code(self.printer.paragraph("events"))

    def outcomes(self) -> Iterator[str]:
        """Success and failure."""
        yield f"Won when {self.words.sentence(self.mission.success)}.\n"
        if self.mission.failure is not None:
            yield f"Lost when {self.words.sentence(self.mission.failure)}.\n"
        yield from self._code(self.printer.paragraph("outcomes"))

    def picture(self) -> Iterator[str]:
        """The mission graph."""
        if self.graph_picture:
            yield f"![Agents, observations, messages and rules]({self.graph_picture})"
            return
        yield from ("```mermaid", mermaid(graph(self.mission)).rstrip(), "```")

    # -- parts

    def _entity(self, group: model.Group) -> Iterator[str]:
        when = self._when(group.when)
        head = f"### {self._named(group)}: {group.type}\n"
        yield head
        own = self.printer.properties([prop for prop in group.properties if not prop.inherited])
        inherited = self.printer.properties([prop for prop in group.properties if prop.inherited])
        yield f"- moved by the engine `{group.engine}`{f', {when}' if when else ''}"
        yield from (f"- `{line}`" for line in own)
        if inherited:
            yield f"- from its type: {', '.join(f'`{line}`' for line in inherited)}"
        if group.behaviour is not None:
            lines = ", ".join(self.printer.behaviour(group.behaviour))
            yield f"- moves by itself: `{group.behaviour.kind} {{ {lines} }}`"
        for interaction in group.interactions:
            yield f"- interaction: `{interaction.name} {{ {', '.join(self.printer.interaction(interaction))} }}`"
        for camera in group.cameras:
            yield f"- `{self.printer.camera(camera)}`"
        if group.verbs:
            yield f"- commands: {', '.join(f'`{self._verb(verb)}`' for verb in group.verbs)}"
        yield ""

    def _verb(self, verb: model.Verb) -> str:
        return self.printer.verb(verb).removeprefix("verb ")

    def _named(self, declared: model.Group | model.Agent) -> str:
        return (
            f"`{declared.name}`"
            if declared.count is None
            else f"`{declared.name}[1..{self.printer.text(declared.count)}]`"
        )

    def _when(self, guard: model.Guard | None) -> str:
        return f"when `{self.printer.text(guard.condition)}`" if guard is not None else ""

    def _budgets(self) -> list[str]:
        budget = self.mission.budget
        values = ((name, getattr(budget, name)) for name in budget.__struct_fields__)
        return [f"{name} <= {self.printer.text(value)}" for name, value in values if isinstance(value, ex.Number)]

    def _listed(self, lines: list[str]) -> str:
        return f": {', '.join(f'`{line}`' for line in lines)}" if lines else ""

    def _code(self, lines: Iterable[str], lead: str = "") -> Iterator[str]:
        present = [line for line in lines if line]
        if present:
            if lead:
                yield f"\n{lead}\n"
            yield from ("```ljs", self.printer.tidy(present), "```")


_SECTIONS: tuple[tuple[str, Callable[[_Page], Iterator[str]]], ...] = (
    ("At a glance", _Page.glance),
    ("Parameters", _Page.parameters),
    ("Tiers", _Page.tiers),
    ("Places", _Page.places),
    ("Assets", _Page.assets),
    ("Targets", _Page.targets),
    ("Agents", _Page.agents),
    ("Messages", _Page.messages),
    ("Hidden values", _Page.hidden),
    ("Adjudication", _Page.rules),
    ("Stages", _Page.stages),
    ("Limits", _Page.limits),
    ("Relations between roles", _Page.relations),
    ("Events", _Page.events),
    ("Outcome", _Page.outcomes),
    ("Expectations", _Page.expectations),
    ("The mission graph", _Page.picture),
)
"""The sections in their order."""


def table(heads: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> Sequence[str]:
    """A Markdown table, for the sections of `lead`."""
    return list(_table(heads, rows))


def _table(heads: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> Iterator[str]:
    """A Markdown table without empty columns."""
    listed = list(rows)
    kept = [at for at, _ in enumerate(heads) if any(row[at] for row in listed)]
    yield f"| {' | '.join(heads[at] for at in kept)} |"
    yield f"| {' | '.join('---' for _ in kept)} |"
    for row in listed:
        yield f"| {' | '.join(_cell(row[at]) for at in kept)} |"


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")


def _quote(text: str) -> Iterator[str]:
    yield from (f"> {line}".rstrip() for line in text.splitlines())
