"""`to_ljs`: a mission as formatted `.ljs` text, which compiles to an equal mission.

`lingjing.dsl.syntax.statements` lists the parts of a mission, and the layouts of most; `unprintable_paths` names the
parts that it lacks. Types and records become `use` lines (`lingjing.dsl.printing.imports`); expressions are written by
`lingjing.dsl.printing.phrases`.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable, Iterable, Iterator

import msgspec

from lingjing.dsl.formatting.formatter import format_text
from lingjing.dsl.printing.imports import Imports, find_imports
from lingjing.dsl.printing.layouts import block, has_layout, lay_out
from lingjing.dsl.printing.phrases import Phrases, long_text, number_text, quoted
from lingjing.dsl.syntax.statements import KINDS, LANGUAGE_VERSION, PARAGRAPHS, STATEMENTS
from lingjing.dsl.syntax.tokens import INNER
from lingjing.dsl.syntax.tokens import STATEMENTS as STATEMENTS_BY_WORD
from lingjing.errors import MissionError
from lingjing.mission import expression as ex
from lingjing.mission import model
from lingjing.mission.appearance import MEASURES
from lingjing.mission.conditions.leaks import declared_as_before
from lingjing.mission.expression_text import RANGE, SUM, LocalNames
from lingjing.mission.units import BY_NAME
from lingjing.mission.vocabulary import BEHAVIOURS

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
        msgspec.structs.replace(
            group,
            properties=tuple(sorted(group.properties, key=lambda prop: (prop.inherited, prop.inherited and prop.name))),
        )
        for group in mission.groups
    )
    return msgspec.structs.replace(declared_as_before(mission), groups=groups, origin=model.Origin())


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
        self.mission = mission = declared_as_before(mission)
        self.phrases = Phrases(mission)
        self.imports: Imports = find_imports(mission)

    def file(self) -> str:
        """The whole file, unformatted."""
        uses = [f"use {path} {{ {', '.join(names)} }}" for path, names in self.imports.uses.items()]
        types = [self._type(local) for local in self.imports.types]
        records = [self._record(kind) for kind in self.imports.records]
        head = "\n".join([f"ljs {LANGUAGE_VERSION}", *uses])
        paragraphs = [lines for name in PARAGRAPHS if (lines := "\n".join(self.paragraph(name)))]
        mission = f"mission {self.mission.name} {quoted(self.mission.title)} {{\n" + "\n\n".join(paragraphs) + "\n}"
        return "\n\n".join([head, *types, *records, mission]) + "\n"

    def paragraph(self, name: str) -> Iterator[str]:
        """The statements of one of `PARAGRAPHS`."""
        for part in dict.fromkeys(kind.part for kind in STATEMENTS if kind.paragraph == name):
            if has_layout(part):
                yield from (lay_out(part, item, self.text) for item in getattr(self.mission, part))
            else:
                yield from _WRITERS[part](self)

    # -- before the mission

    def _type(self, local: model.Group) -> str:
        lines = [f"engine = {local.engine}"]
        lines.extend(self.properties(local.properties))
        lines.extend(self.verb(verb) for verb in local.verbs)
        lines.extend(block(f"interaction {act.name}", self.interaction(act)) for act in local.interactions)
        lines.extend(block(f"mount {mount.view}", _mount(mount)) for mount in local.mounts)
        lines.extend(block(f"part {part.name} : {part.shape}", _part(part)) for part in local.parts)
        head = " : ".join([f"{local.role} {local.type}", *local.bases[:1]])
        return block(head, lines, spread=True)

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
        return block(f"record {kind.type} : {kind.category}", map(self._field, kind.fields), spread=True)

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

    def goal(self) -> Iterable[str]:
        """Yield the lines of the goal."""
        texts = [long_text(self.mission.goal, 4)]
        texts += [f"{language} {long_text(text, 4)}" for language, text in self.mission.goals.items()]
        yield "\n".join(f"goal {text}" for text in texts) + "\n"

    def capabilities(self) -> Iterable[str]:
        """The abilities that the task requires."""
        if self.mission.capabilities:
            yield f"capabilities {', '.join(self.mission.capabilities)}"

    def scene(self) -> Iterable[str]:
        """The scene with its options."""
        scene = self.mission.scene
        options = [*self.properties(scene.options), *self.alternatives(scene.alternatives)]
        yield block(f"scene {scene.kind}", options) if options else f"scene {scene.kind}"

    def clock(self) -> Iterable[str]:
        """Yield the lines of the clock."""
        yield block("clock", self._fields(self.mission.clock, "="))

    def budget(self) -> Iterable[str]:
        """The budget of the episode."""
        yield block("budget", self._fields(self.mission.budget, "<="))

    def weather(self) -> Iterable[str]:
        """Yield the lines of the weather."""
        lines = [*self.properties(self.mission.weather), *self.alternatives(self.mission.weather_alternatives)]
        if lines:
            yield block("weather", lines)

    def mode(self) -> Iterable[str]:
        """Yield the line of the modes."""
        modes = self.mission.modes
        if modes.allowed == (modes.default,) and modes.default not in ("star", "broadcast"):
            yield f"mode {modes.default}"
        else:
            yield f"mode {modes.default} in {{ {', '.join(modes.allowed)} }}"

    # -- entities and agents

    def groups(self) -> Iterable[str]:
        """Targets and assets, in the mission's order."""
        for group in self.mission.groups:
            own = self.properties([prop for prop in group.properties if not prop.inherited])
            own.extend(self.alternatives(group.alternatives))
            if group.labels:
                labels = ", ".join(map(quoted, group.labels))
                own.append(f"label = {labels}" if group.count is None else f"labels = [{labels}]")
            if group.behaviour is not None:
                own.append(block(f"behaviour {group.behaviour.kind}", self.behaviour(group.behaviour)))
            equipment = [self.camera(camera) for camera in group.cameras]
            if group.verbs != self.imports.verbs[group.type]:
                equipment.append(self._actions(group))
            head = f"{group.role} {group.name}{self._count(group)} : {group.type}{self._when(group.when)}"
            yield block(head, [*own, *equipment], spread=bool(equipment)) if own or equipment else head

    def _count(self, declared: model.Group | model.Agent) -> str:
        if declared.count is None:
            return ""
        index = "" if declared.index == "i" and isinstance(declared, model.Group) else f"{declared.index} in "
        return f"[{index}1..{self.text(declared.count, SUM)}]"

    def behaviour(self, behaviour: model.Behaviour) -> Iterator[str]:
        """The lines of `behaviour kind { … }`."""
        values = {"speed": behaviour.speed, **dict.fromkeys(("from", "of"), behaviour.of)}
        values |= dict.fromkeys(("within", "distance"), behaviour.distance)
        for name in BEHAVIOURS[behaviour.kind]:
            value = values.get(name)
            if name == "in":
                yield f"in = {behaviour.region}"
            elif value is not None:
                yield f"{name} = {self.text(value)}"

    def camera(self, camera: model.Camera) -> str:
        """Return the text of `camera name { … }`."""
        lines = [] if camera.view == camera.name else [f"view = {camera.view}"]
        lines.append(f"size = {self.text(camera.width, SUM)} by {self.text(camera.height, SUM)}")
        lines.append(f"hfov = {self.text(camera.hfov)}")
        lines.append(_channels(camera.channels))
        lines.extend(self.channels(other) for other in camera.alternatives)
        if camera.capture != "on_request":
            lines.append(f"capture = {camera.capture}")
        return block(f"camera {camera.name}", lines)

    def channels(self, other: model.OtherChannels) -> str:
        """Return the text of `channels = [rgb] when …`."""
        return _channels(other.channels) + self._when(other.when)

    def _actions(self, group: model.Group) -> str:
        due = {verb.name: verb for verb in self.imports.verbs[group.type]}
        lines = [f"{verb.name}{self._bound(verb, due.get(verb.name))}" for verb in group.verbs]
        return f"actions {{ {', '.join(lines)} }}" if lines else "actions {}"

    def _bound(self, verb: model.Verb, due: model.Verb | None) -> str:
        """Return the bound of a verb's first argument, such as ` <= 50 m`; "" if it equals the bound of the type."""
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
        """Yield the lines of the agents."""
        for agent in self.mission.agents:
            controls = f" controls {', '.join(map(self.text, agent.controls))}" if agent.controls else ""
            head = f"agent {agent.name}{self._count(agent)} as {agent.role}{controls}{self._when(agent.when)}"
            lines = [
                f"observes {', '.join(map(self.channel, channels))}{self._when(when)}"
                for when, channels in itertools.groupby(agent.observes, key=lambda channel: channel.when)
            ]
            if agent.prompt:
                lines.append(f"prompt {long_text(agent.prompt, 6)}")
            lines += [f"prompt {language} {long_text(text, 6)}" for language, text in agent.prompts.items()]
            if agent.budget is not None:
                lines.append(block("budget", self._fields(agent.budget, "<=")))
            yield block(head, lines, spread=len(lines) > 1) if lines else head

    def channel(self, channel: model.Channel) -> str:
        """One observed channel, as `observes` lists it."""
        source = self.text(channel.source)
        if channel.fields != ("*",):
            return ", ".join(f"{source}.{self.phrases.field(channel.source, name, {})}" for name in channel.fields)
        return source if isinstance(channel.source, ex.Symbol) else f"{source}.*"

    def bus(self) -> Iterable[str]:
        """The settings of the message bus."""
        comms = self.mission.comms
        star = "star" in self.mission.modes.allowed
        lines = [f"hub = {comms.hub}{' when mode == star' if star else ''}"] if comms.hub else []
        for name in comms.__struct_fields__:
            value = getattr(comms, name)
            if name == "hub" or value is None or value == getattr(_DEFAULT_COMMS, name):
                continue
            relation = KINDS["comms"].keys[name].relations[0]
            lines.append(f"{name} {relation} {value if isinstance(value, str) else self.text(value)}")
        if lines:
            yield block("comms", lines)

    # -- the course of the episode

    def events(self) -> Iterable[str]:
        """Yield the lines of the events."""
        for event in self.mission.events:
            lines = [line for change in event.changes for line in self._change(change)]
            yield block(f"event {event.name}{self._event_head(event)}", lines, spread=len(lines) > 1)

    def _event_head(self, event: model.EventDeclaration) -> str:
        head = f" when {self.text(event.condition)}" if event.condition is not None else ""
        if event.at is not None:
            drawn = "~ " if isinstance(event.at, ex.Draw) else ""
            head = f" at {drawn}{self.text(event.at, RANGE)}{self._when(event.when)}"
        head += f" until {self.text(event.until)}" if event.until is not None else ""
        return head + (f" repeat every {self.text(event.pause)}" if event.pause is not None else "")

    def tiers(self) -> Iterable[str]:
        """Tiers. A switch that is turned on stands alone."""
        for tier in self.mission.tiers:
            lines = [
                each.name if each.value == ex.Flag(True) else f"{each.name} = {self.text(each.value, SUM)}"
                for each in tier.settings
            ]
            yield block(f"tier {tier.level}", lines)

    def sweeps(self) -> Iterable[str]:
        """Yield the lines of the sweeps."""
        for sweep in self.mission.sweeps:
            axes = ", ".join(
                f"{name} in [{', '.join(map(self.text, values))}]"
                for name, values in zip(sweep.parameters, sweep.values, strict=True)
            )
            yield f"sweep {sweep.name} over {axes}{self._when(sweep.when)}"

    def _change(self, change: model.Change) -> Iterable[str]:
        if change.kind in ("close", "reopen"):
            yield f"{change.kind} {change.region}"
        elif change.kind in ("comms", "jam"):
            lines = [f"loss = {self.text(change.loss)}"] if change.loss is not None else []
            lines += [f"range <= {self.text(change.range)}"] if change.range is not None else []
            yield block(f"jam {change.region}" if change.region else "comms", lines)
        elif change.entity is None:
            yield block("weather", self.properties(change.weather))
        elif change.value is not None:
            yield f"change {self.text(ex.Attr(change.entity, change.field))} to {self.text(change.value)}"
        else:
            yield f"{change.kind} {self.text(change.entity)}"

    def success(self) -> Iterable[str]:
        """The condition of success."""
        yield f"success when {self.text(self.mission.success)}"

    def failure(self) -> Iterable[str]:
        """The condition of failure."""
        if self.mission.failure is not None:
            yield f"failure when {self.text(self.mission.failure)}"

    def expectations(self) -> Iterable[str]:
        """The block of expectations."""
        lines = [self.expectation(expectation) for expectation in self.mission.expectations]
        if lines:
            yield block("expect", lines, spread=True)

    def expectation(self, expectation: model.Expectation) -> str:
        """One line of the block of expectations."""
        match expectation:
            case model.InfeasibleExpectation():
                return f"infeasible when {self.text(expectation.condition)}"
            case model.SpreadExpectation():
                terms = self._terms(expectation.episodes, _SPREAD)
                return " ".join([f"draws spread over {expectation.region}", *terms])
        words = [_subject(expectation.policy), expectation.outcome]
        seeds, default = len(expectation.episodes.seeds), _EPISODES
        if expectation.share == "at_least":
            words.append(f"at least {expectation.least} of {seeds}")
            default = model.ExpectedEpisodes(last_seed=seeds - 1)
        words += [expectation.share] if expectation.share in ("some", "none") else []
        words += [f"within {self.text(expectation.within)}"] if expectation.within is not None else []
        return " ".join([*words, *self._terms(expectation.episodes, default)])

    def _terms(self, episodes: model.ExpectedEpisodes, default: model.ExpectedEpisodes) -> Iterator[str]:
        first, last = episodes.first_seed, episodes.last_seed
        if (first, last) != (default.first_seed, default.last_seed):
            yield f"for seeds {first}" if first == last else f"for seeds {first}..{last}"
        settings = [f"{setting.name} = {self.text(setting.value, SUM)}" for setting in episodes.settings]
        settings += [f"mode = {episodes.mode}"] if episodes.mode else []
        settings += [f"tier = {episodes.tier}"] if episodes.tier else []
        if settings:
            yield f"with {', '.join(settings)}"

    # -- shared

    def tidy(self, lines: Iterable[str]) -> str:
        """Statements of a mission laid out by the formatter, without a newline at the end."""
        inside = format_text("mission m {\n" + "\n".join(lines) + "\n}").text or ""
        return "\n".join(line.removeprefix("  ") for line in inside.splitlines()[1:-1])

    def text(self, node: ex.Expr, rank: int = 0, names: LocalNames | None = None) -> str:
        """Return the text of an expression."""
        return self.phrases.text(node, rank, names)

    def alternatives(self, alternatives: Iterable[model.Alternative]) -> list[str]:
        """The lines of a block that have a condition."""
        return [line + self._when(each.when) for each in alternatives for line in self.properties(each.properties)]

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


_WRITERS: dict[str, Callable[[Printer], Iterable[str]]] = {
    "goal": Printer.goal,
    "capabilities": Printer.capabilities,
    "scene": Printer.scene,
    "clock": Printer.clock,
    "budget": Printer.budget,
    "weather": Printer.weather,
    "modes": Printer.mode,
    "groups": Printer.groups,
    "agents": Printer.agents,
    "comms": Printer.bus,
    "events": Printer.events,
    "sweeps": Printer.sweeps,
    "tiers": Printer.tiers,
    "success": Printer.success,
    "failure": Printer.failure,
    "expectations": Printer.expectations,
}
"""Fields of a mission with statements that need more than a layout."""

_KNOWN = frozenset(
    (
        "format",
        "name",
        "title",
        "origin",
        "weather_alternatives",
        "goals",
        *(part for kind in STATEMENTS if (part := kind.part)),
    )
)
"""The fields of a mission that the text has. `origin` is included, because a text does not express it."""

_DEFAULT_COMMS = model.Comms()
_EPISODES = model.PolicyExpectation(policy="", outcome="wins").episodes
_SPREAD = model.SpreadExpectation(region="").episodes


def _subject(policy: str) -> str:
    """The policy of an expectation: a word, or else a quoted text."""
    plain = policy.isidentifier() and policy not in STATEMENTS_BY_WORD and policy not in INNER
    return policy if plain else quoted(policy)


def _channels(names: Iterable[str]) -> str:
    return f"channels = [{', '.join(names)}]"


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
    if part.glow:
        yield f"glow = {number_text(part.glow, '')}"
