"""`to_ljs`: a mission as formatted `.ljs` text, which compiles to an equal mission.

One table lists the parts of a mission; `unprintable_paths` names the parts that the table lacks. Types and records
become `use` lines (`lingjing.dsl.printing.imports`); expressions are written by `lingjing.dsl.printing.phrases`.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from typing import Any

import msgspec

from lingjing.dsl.formatting.formatter import format_text
from lingjing.dsl.printing.imports import Imports, find_imports
from lingjing.dsl.printing.phrases import Phrases, long_text, number_text, quoted
from lingjing.errors import MissionError
from lingjing.mission import expression as ex
from lingjing.mission import model
from lingjing.mission.appearance import MEASURES
from lingjing.mission.expression_text import RANGE, SUM, LocalNames
from lingjing.mission.units import BY_NAME

_LOW = re.compile(r"(.+)_low(_[a-z0-9]+)?")
"""Name of the lower bound of a range."""
_DIRECTED = re.compile(r"(.+)_mps")
"""Name of a speed with a direction."""


def to_ljs(mission: model.Mission) -> str:
    """Return the mission's text. Raises `MissionError` if it has none, such as for a name that is no word."""
    text = Printer(mission).file()
    outcome = format_text(text)
    if outcome.text is None:
        first = outcome.diagnostics[0]
        place = text.splitlines()[first.span.line - 1].strip()
        raise MissionError(
            f"the mission `{mission.name}` cannot be written as .ljs: {first.message} in `{place}`",
            hint="names must be words of letters, digits and _; mission.json keeps everything",
        )
    return outcome.text


def unprintable_paths(mission: model.Mission) -> tuple[str, ...]:
    """JSON paths of the mission's parts that `.ljs` text cannot express; empty if the text is complete."""
    paths = [f"$.{name}" for name in mission.__struct_fields__ if name not in _KNOWN and getattr(mission, name)]
    paths.extend(f"$.parameters[{i}].doc" for i, parameter in enumerate(mission.parameters) if parameter.doc)
    for i, group in enumerate(mission.groups):
        paths.extend(f"$.groups[{i}].verbs[{j}].doc" for j, verb in enumerate(group.verbs) if verb.doc)
    if mission.origin.document:
        paths.append("$.origin.document")
    return tuple(paths)


def canonical(mission: model.Mission) -> model.Mission:
    """The mission without the parts that a text does not preserve: its origin, and the order of inherited
    properties."""
    groups = tuple(
        msgspec.structs.replace(group, properties=tuple(sorted(group.properties, key=lambda prop: prop.inherited)))
        for group in mission.groups
    )
    return msgspec.structs.replace(mission, groups=groups, origin=model.Origin())


def round_trip_losses(mission: model.Mission, text: str) -> tuple[str, ...]:
    """JSON paths of the parts that differ after compiling the text. Raises `MissionError` if it does not compile."""
    from lingjing.dsl.compilation import compile_text

    again = compile_text(text, path=f"{mission.name}.ljs")
    if again.mission is None:
        fault = again.diagnostics[0]
        raise MissionError(
            f"the mission `{mission.name}` cannot be written as .ljs: {fault.message} (line {fault.span.line})",
            hint="mission.json keeps everything",
        )
    before, after = canonical(mission), canonical(again.mission)
    paths = [f"$.{name}" for name in before.__struct_fields__ if getattr(before, name) != getattr(after, name)]
    return tuple(dict.fromkeys((*unprintable_paths(mission), *paths)))


class Printer:
    """Writes one mission. Each method yields the lines of one statement or of one family of statements."""

    def __init__(self, mission: model.Mission) -> None:
        self.mission = mission
        self.phrases = Phrases(mission)
        self.imports: Imports = find_imports(mission)

    def file(self) -> str:
        """The whole file, unformatted."""
        uses = [f"use {path} {{ {', '.join(names)} }}" for path, names in self.imports.uses.items()]
        types = [self._type(local) for local in self.imports.types]
        records = [self._record(kind) for kind in self.imports.records]
        head = "\n".join(["ljs 1", *uses])
        paragraphs = [lines for part in _PARTS if (lines := "\n".join(part(self)))]
        mission = f"mission {self.mission.name} {quoted(self.mission.title)} {{\n" + "\n\n".join(paragraphs) + "\n}"
        return "\n\n".join([head, *types, *records, mission]) + "\n"

    # -- before the mission

    def _type(self, local: model.Group) -> str:
        lines = [f"engine = {local.engine}"]
        lines.extend(self.properties(local.properties))
        lines.extend(self.verb(verb) for verb in local.verbs)
        lines.extend(_block(f"interaction {act.name}", self.interaction(act)) for act in local.interactions)
        lines.extend(_block(f"mount {mount.view}", _mount(mount)) for mount in local.mounts)
        lines.extend(_block(f"part {part.name} : {part.shape}", _part(part)) for part in local.parts)
        head = " : ".join([f"{local.role} {local.type}", *local.bases[:1]])
        return _block(head, lines, spread=True)

    def interaction(self, interaction: model.Interaction) -> Iterator[str]:
        """The lines of `interaction name { … }` of a type."""
        yield f"by = {interaction.by}"
        for key, value in (
            ("within", interaction.within),
            ("lasting", interaction.lasting),
            ("aboard", interaction.aboard),
        ):
            if value is not None:
                yield f"{key} = {self.text(value)}"
        moves = {
            "takes": interaction.takes,
            "from": interaction.source,
            "gives": interaction.gives,
            "up_to": interaction.up_to,
        }
        for key, word in {**moves, "status": interaction.status, "told": interaction.told}.items():
            if word:
                yield f"{key} = {word}"

    def verb(self, verb: model.Verb) -> str:
        """`verb name(…)` of a type."""
        return f"verb {verb.name}({', '.join(map(self._argument, verb.arguments))})"

    def _argument(self, argument: model.Argument) -> str:
        named = next((name for name, known in BY_NAME.items() if known.unit == argument.dimension), "number")
        words = [f"{argument.name}: {'name' if argument.dimension == 'name' else named}"]
        if argument.minimum is not None and argument.maximum is not None:
            words.append(f"in {self.text(argument.minimum, SUM)}..{self.text(argument.maximum, SUM)}")
        return " ".join([*words, "optional"] if argument.optional else words)

    def _record(self, kind: model.MessageKind) -> str:
        return _block(f"record {kind.type} : {kind.category}", map(self._field, kind.fields), spread=True)

    def _field(self, declared: model.Field) -> str:
        named = next(
            (name for name, known in BY_NAME.items() if declared.unit and known.unit == declared.unit), declared.type
        )
        words = [f"{declared.name}: {named}"]
        if declared.minimum is not None and declared.maximum is not None:
            low, high = (number_text(bound, declared.unit) for bound in (declared.minimum, declared.maximum))
            words.append(f"in {low}..{high}")
        return " ".join([*words, "optional"] if declared.optional else words)

    # -- settings

    def settings(self) -> Iterable[str]:
        """Goal, scene, clock, budget, weather."""
        mission = self.mission
        yield f"goal {long_text(mission.goal, 4)}\n"
        options = self.properties(mission.scene.options)
        yield _block(f"scene {mission.scene.kind}", options) if options else f"scene {mission.scene.kind}"
        yield _block("clock", self._fields(mission.clock, "="))
        yield _block("budget", self._fields(mission.budget, "<="))
        if mission.weather:
            yield _block("weather", self.properties(mission.weather))

    def parameters(self) -> Iterable[str]:
        """Parameters and modes."""
        for parameter in self.mission.parameters:
            bounds = f" in {self.text(parameter.bounds, RANGE)}" if parameter.bounds is not None else ""
            yield f"param {parameter.name} = {self.text(parameter.default, RANGE)}{bounds}"
        modes = self.mission.modes
        if modes.allowed == (modes.default,) and modes.default not in ("star", "broadcast"):
            yield f"mode {modes.default}"
        else:
            yield f"mode {modes.default} in {{ {', '.join(modes.allowed)} }}"

    def places(self) -> Iterable[str]:
        """Regions and grids."""
        for region in self.mission.regions:
            yield f"region {region.name} = {self.text(region.shape)}"
        for grid in self.mission.grids:
            lines = [f"shape = {self.text(grid.rows, SUM)} by {self.text(grid.columns, SUM)}"]
            if grid.overlap != ex.Number(0.0):
                lines.append(f"overlap = {self.text(grid.overlap)}")
            yield _block(f"grid {grid.name} over {grid.region}", lines)

    # -- entities and agents

    def groups(self) -> Iterable[str]:
        """Targets and assets, in the mission's order."""
        for group in self.mission.groups:
            own = self.properties([prop for prop in group.properties if not prop.inherited])
            if group.labels:
                labels = ", ".join(map(quoted, group.labels))
                own.append(f"label = {labels}" if group.count is None else f"labels = [{labels}]")
            equipment = [self.camera(camera) for camera in group.cameras]
            if group.verbs != self.imports.verbs[group.type]:
                equipment.append(self._actions(group))
            head = f"{group.role} {group.name}{self._count(group)} : {group.type}{self._when(group.when)}"
            yield _block(head, [*own, *equipment], spread=bool(equipment)) if own or equipment else head

    def _count(self, declared: model.Group | model.Agent) -> str:
        if declared.count is None:
            return ""
        index = "" if declared.index == "i" and isinstance(declared, model.Group) else f"{declared.index} in "
        return f"[{index}1..{self.text(declared.count, SUM)}]"

    def camera(self, camera: model.Camera) -> str:
        """`camera name { … }`."""
        lines = [] if camera.view == camera.name else [f"view = {camera.view}"]
        lines.append(f"size = {self.text(camera.width, SUM)} by {self.text(camera.height, SUM)}")
        lines.append(f"hfov = {self.text(camera.hfov)}")
        lines.append(f"channels = [{', '.join(camera.channels)}]")
        if camera.capture != "on_request":
            lines.append(f"capture = {camera.capture}")
        return _block(f"camera {camera.name}", lines)

    def _actions(self, group: model.Group) -> str:
        due = {verb.name: verb for verb in self.imports.verbs[group.type]}
        lines = [f"{verb.name}{self._bound(verb, due.get(verb.name))}" for verb in group.verbs]
        return f"actions {{ {', '.join(lines)} }}" if lines else "actions {}"

    def _bound(self, verb: model.Verb, due: model.Verb | None) -> str:
        """` <= 50 m`, ` in 5 m..25 m`, ` = 10 m in 5 m..25 m`: the difference of the first argument from the type's."""
        if verb == due or not verb.arguments:
            return ""
        first, typed = verb.arguments[0], due.arguments[0] if due and due.arguments else None
        low, high = first.minimum, first.maximum
        same = typed is not None and (low, high) == (typed.minimum, typed.maximum)
        if first.default is None and high is not None and (low is None or (typed is not None and low == typed.minimum)):
            return f" <= {self.text(high)}"
        bounds = "" if low is None or high is None else f" in {self.text(low, SUM)}..{self.text(high, SUM)}"
        if first.default is None:
            return bounds
        return f" = {self.text(first.default, RANGE)}{'' if same else bounds}"

    def agents(self) -> Iterable[str]:
        """Agents and authority."""
        for agent in self.mission.agents:
            controls = f" controls {', '.join(map(self.text, agent.controls))}" if agent.controls else ""
            head = f"agent {agent.name}{self._count(agent)} as {agent.role}{controls}{self._when(agent.when)}"
            lines = [f"observes {', '.join(map(self.channel, agent.observes))}"] if agent.observes else []
            if agent.prompt:
                lines.append(f"prompt {long_text(agent.prompt, 6)}")
            if agent.budget is not None:
                lines.append(_block("budget", self._fields(agent.budget, "<=")))
            yield _block(head, lines, spread=len(lines) > 1) if lines else head
        for authority in self.mission.authorities:
            yield f"authority {authority.role} may command {self.text(authority.resource)}{self._when(authority.when)}"

    def channel(self, channel: model.Channel) -> str:
        """One observed channel, as `observes` lists it."""
        source = self.text(channel.source)
        if channel.fields != ("*",):
            return ", ".join(f"{source}.{self.phrases.field(channel.source, name, {})}" for name in channel.fields)
        return source if isinstance(channel.source, ex.Symbol) else f"{source}.*"

    def messages(self) -> Iterable[str]:
        """Message kinds, then the bus."""
        for kind in self.mission.messages:
            senders, recipients = ", ".join(kind.senders), ", ".join(kind.recipients)
            yield f"message {kind.name} : {kind.type} from {senders} to {recipients}{self._when(kind.when)}"
        yield from self.bus()

    def bus(self) -> Iterable[str]:
        """The settings of the message bus."""
        comms = self.mission.comms
        star = "star" in self.mission.modes.allowed
        lines = [f"hub = {comms.hub}{' when mode == star' if star else ''}"] if comms.hub else []
        for name in comms.__struct_fields__:
            value = getattr(comms, name)
            if name == "hub" or value is None or value == getattr(_DEFAULT_COMMS, name):
                continue
            relation = "<=" if name in _BOUNDS_OF_COMMS else "="
            lines.append(f"{name} {relation} {value if isinstance(value, str) else self.text(value)}")
        if lines:
            yield _block("comms", lines)

    # -- rules

    def rules(self) -> Iterable[str]:
        """Adjudication rules and unlocks."""
        for rule in self.mission.rules:
            names = {parameter.name: parameter.domain for parameter in rule.parameters}
            condition = f"when {self.text(rule.condition, 0, names)}"
            yield _block(f"adjudicate {rule.name}({_parameters(rule.parameters)})", [condition])
        for unlock in self.mission.unlocks:
            names = {parameter.name: parameter.domain for parameter in unlock.parameters}
            head = f"unlock {unlock.interaction}({_parameters(unlock.parameters)})"
            yield f"{head} when {self.text(unlock.condition, 0, names)}"

    def limits(self) -> Iterable[str]:
        """Counted budgets, permits, constraints, inspections."""
        yield from map(self._limit, self.mission.limits)
        for permit in self.mission.permits:
            verb = permit.verb or "*"
            yield f"permit {self.text(permit.resource)}.{verb} when {self.text(permit.condition)}"
        for constraint in self.mission.constraints:
            lines = [f"always {self.text(constraint.condition, 0, _bound(constraint))}"]
            if constraint.penalty is not None:
                lines.append(f"penalty = {self.text(constraint.penalty)}")
            yield _block(
                f"constraint {constraint.kind} {constraint.name}{_per(constraint)}{self._when(constraint.when)}", lines
            )
        for way in self.mission.inspections:
            lines = [f"within = {self.text(way.within)}"]
            lines.extend([f"order = {way.order}"] if way.order != "strict" else [])
            lines.extend([f"replan = {way.replan}"] if way.replan else [])
            lines.extend([] if way.destination is None else [f"destination = {self.text(way.destination)}"])
            head = f"inspection {way.name} of {self.text(way.asset)} by {', '.join(map(self.text, way.by))}"
            yield _block(f"{head}{self._when(way.when)}", lines)

    def _limit(self, limit: model.Limit) -> str:
        counted = ", ".join(
            counted_item.name
            if counted_item.resource is None
            else f"{self.text(counted_item.resource)}.{counted_item.name or '*'}"
            for counted_item in limit.counts
        )
        return f"limit {limit.name} <= {self.text(limit.most, RANGE)} counts {counted}{self._when(limit.when)}"

    def stages(self) -> Iterable[str]:
        """Stages."""
        for stage in self.mission.stages:
            lines = [f"done when {self.text(stage.condition, 0, _bound(stage))}"]
            for name, value in (("ticks <=", stage.ticks), ("weight =", stage.weight)):
                if value is not None:
                    lines.append(f"{name} {self.text(value)}")
            lines.extend(map(self._limit, stage.limits))
            yield _block(f"stage {stage.name}{_per(stage)}", lines)

    def relations(self) -> Iterable[str]:
        """Relations and reveals."""
        for relation in self.mission.relations:
            words = [
                f"relation {relation.kind} {relation.source} {'<->' if relation.mutual else '->'} {relation.target}"
            ]
            clauses = (
                ("carries", relation.carries),
                ("over", relation.over),
                ("by", relation.by),
                ("per", relation.per),
            )
            words.extend(f"{keyword} {name}" for keyword, name in clauses if name)
            yield " ".join(words) + self._when(relation.when)
        for reveal in self.mission.reveals:
            yield f"reveal {reveal.what}({self.text(reveal.entity)}) to {reveal.role}"

    def events(self) -> Iterable[str]:
        """Events."""
        for event in self.mission.events:
            at = f"{'~ ' if isinstance(event.at, ex.Draw) else ''}{self.text(event.at, RANGE)}"
            lines = [line for change in event.changes for line in self._change(change)]
            yield _block(f"event {event.name} at {at}{self._when(event.when)}", lines, spread=len(lines) > 1)

    def sweeps(self) -> Iterable[str]:
        """Sweeps."""
        for sweep in self.mission.sweeps:
            axes = ", ".join(
                f"{name} in [{', '.join(map(self.text, values))}]"
                for name, values in zip(sweep.parameters, sweep.values, strict=True)
            )
            yield f"sweep {sweep.name} over {axes}{self._when(sweep.when)}"

    def _change(self, change: model.Change) -> Iterable[str]:
        if change.entity is None:
            yield _block("weather", self.properties(change.weather))
        else:
            yield f"{change.kind} {self.text(change.entity)}"

    def outcomes(self) -> Iterable[str]:
        """Success and failure."""
        yield f"success when {self.text(self.mission.success)}"
        if self.mission.failure is not None:
            yield f"failure when {self.text(self.mission.failure)}"

    # -- shared

    def tidy(self, lines: Iterable[str]) -> str:
        """Statements of a mission laid out by the formatter, without a newline at the end."""
        inside = format_text("mission m {\n" + "\n".join(lines) + "\n}").text or ""
        return "\n".join(line.removeprefix("  ") for line in inside.splitlines()[1:-1])

    def text(self, node: ex.Expr, rank: int = 0, names: LocalNames | None = None) -> str:
        """An expression."""
        return self.phrases.text(node, rank, names)

    def properties(self, properties: Iterable[model.Property]) -> list[str]:
        """The lines of lowered properties. Ranges and directed speeds become one line."""
        known = {prop.name: prop for prop in properties}
        lines, done = [], set()
        for prop in known.values():
            if prop.name in done:
                continue
            name, value, partner = self._joined(prop, known)
            done.add(partner.name if partner else "")
            drawn = prop.relation == "~" or (partner is not None and partner.relation == "~")
            marks = ("hidden ",) * prop.hidden + ("state ",) * prop.state
            lines.append(f"{''.join(marks)}{name} {'~' if drawn else prop.relation} {value}")
        return lines

    def _joined(self, prop: model.Property, known: dict[str, model.Property]) -> tuple[str, str, model.Property | None]:
        directed = _DIRECTED.fullmatch(prop.name)
        for word in ("from", "to") if directed else ():
            angle = known.get(f"{directed[1]}_{word}_deg") if directed else None
            if directed and angle is not None:
                return directed[1], f"{self.text(prop.value, SUM)} {word} {self.text(angle.value, SUM)}", angle
        low = _LOW.fullmatch(prop.name)
        high = known.get(f"{low[1]}_high{low[2] or ''}") if low else None
        if low and high is not None:
            return low[1], f"{self.text(prop.value, SUM)}..{self.text(high.value, SUM)}", high
        rows = prop.name.removesuffix("_rows")
        columns = known.get(f"{rows}_columns") if rows != prop.name else None
        if columns is not None:
            return rows, f"{self.text(prop.value, SUM)} by {self.text(columns.value, SUM)}", columns
        if prop.name == "datum_m":
            return "datum", f"sea level at {self.text(prop.value, SUM)}", None
        return prop.plain, self.text(prop.value), None

    def _fields(self, part: msgspec.Struct, relation: str) -> list[str]:
        """`name relation value` for every expression of a plain struct."""
        values = ((name, getattr(part, name)) for name in part.__struct_fields__)
        return [f"{name} {relation} {self.text(value)}" for name, value in values if value is not None]

    def _when(self, guard: model.Guard | None) -> str:
        return f" when {self.text(guard.condition)}" if guard else ""


_PARTS: tuple[Callable[[Printer], Iterable[str]], ...] = (
    Printer.settings,
    Printer.parameters,
    Printer.places,
    Printer.groups,
    Printer.agents,
    Printer.messages,
    Printer.rules,
    Printer.limits,
    Printer.stages,
    Printer.relations,
    Printer.events,
    Printer.sweeps,
    Printer.outcomes,
)
"""The paragraphs of a mission, in order."""

_KNOWN = frozenset(
    (
        "format", "name", "title", "goal", "scene", "clock", "budget", "weather", "parameters", "modes", "regions",
        "grids", "groups", "agents", "authorities", "messages", "comms", "rules", "unlocks", "stages", "relations",
        "reveals", "success", "failure", "origin", "limits", "permits", "constraints", "inspections", "events",
        "sweeps",
    )
)  # fmt: skip
"""The fields of a mission that the paragraphs write. `origin` is included, because a text does not express it."""

_BOUNDS_OF_COMMS = frozenset(("payload", "range"))
_DEFAULT_COMMS = model.Comms()


def _parameters(parameters: Iterable[model.RuleParameter]) -> str:
    return ", ".join(f"{parameter.name}: {parameter.domain}" for parameter in parameters)


def _bound(quantified: Any) -> dict[str, str]:
    return {quantified.variable: quantified.domain} if quantified.variable and quantified.domain else {}


def _per(quantified: Any) -> str:
    return f" per {quantified.variable} in {quantified.domain}" if quantified.variable else ""


def _mount(mount: model.CameraMount) -> Iterator[str]:
    yield from (f"{name} = {number_text(getattr(mount, f'{name}_m'), 'm')}" for name in ("ahead", "above"))
    yield f"tilt = {number_text(mount.tilt_deg, 'deg')}"
    if not mount.gimbal:
        yield "gimbal = false"


def _part(part: model.BodyPart) -> Iterator[str]:
    for name in (*MEASURES, "ahead", "right", "above"):
        metres = getattr(part, f"{name}_m")
        if metres or name in MEASURES:
            yield f"{name} = {number_text(metres, 'm')}"
    if part.heading_deg:
        yield f"heading = {number_text(part.heading_deg, 'deg')}"
    yield f"colour = {part.colour}"


def _block(head: str, lines: Iterable[str], *, spread: bool = False) -> str:
    items = list(lines)
    if not items:
        return f"{head} {{}}"
    if spread or any("\n" in item for item in items):
        return f"{head} {{\n" + "\n".join(items) + "\n}"
    return f"{head} {{ {', '.join(items)} }}"
