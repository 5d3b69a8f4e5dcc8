"""The statements of the language: one table that lexer, grammar, completion, hover, printer and pages read (ADR 0035).

A new statement is a row here, a node in `lingjing.dsl.syntax.tree`, a check in `lingjing.dsl.checking.checker` and a
field of `lingjing.mission.model.Mission`. `python tools/statements.py` then writes what is derived and committed: the
alternatives in `ljs.lark`, its tables, the grammar for editors and the reference page.
"""

from __future__ import annotations

from lingjing.dsl.syntax import tree as s
from lingjing.dsl.syntax.keys import PropertyKey, keyed
from lingjing.dsl.syntax.statement_kinds import FILE, TYPE, Form, Layout, NamePlace, StatementKind
from lingjing.mission.appearance import COLOURS, LEAST_M, MEASURES, MOST_M, SHAPES
from lingjing.mission.functions import ANY, DEGREES, ENTITY, FLAG, METRES, MPS, NUMBER, REGION, SECONDS, Type
from lingjing.mission.units import DATA, MONEY, TICKS, TOKENS
from lingjing.mission.vocabulary import BEHAVIOURS, EVERYONE, MODES

LANGUAGE_VERSION = 2
"""The newest version of the language. Version 2 added `declassify`; texts of version 1 compile."""

DRAWN = ("=", "~")
"""Relations of a property that may be drawn."""

RELATIONS = ("information_handoff", "cooperation", "competition", "guidance", "dependency")
"""The paper's relations between roles."""
CAPABILITIES = ("localization", "navigation", "planning", "perception", "coordination")
"""The paper's tags L, N, P, V and C of tasks."""
CONSTRAINT_KINDS = ("hard", "soft")
"""Kinds of constraints."""
ORDERS = ("strict", "any")
"""Orders in which an inspection may visit its waypoints."""
CATEGORIES = ("report", "assignment", "target_status", "other")
"""Categories of message records."""
CHANNELS = ("rgb", "depth", "semantic", "instance")
"""Channels of a camera."""
VIEWS = ("nadir", "front", "oblique")
"""Views of a camera."""
CAPTURES = ("on_request", "each_tick")
"""Times of a camera's pictures."""
RECEIPTS = ("own", "all", "none")
"""Words for the receipts that an agent receives."""
_DAY_S = 86_400.0
"""Longest deadline of a barrier, seconds (chosen: one day; timers of the system need a limit)."""
_MOUNTED_M = 100.0
"""Greatest distance of a camera from its body's position, ahead or above, metres (chosen)."""

_FASTEST_MPS = 50.0
"""Greatest speed of a target's behaviour, m/s (chosen: bodies turn and halt at once)."""

_SYMBOL = NamePlace(declares="symbol")
_WORD = NamePlace(spaces=())
_ROLE = NamePlace(spaces=("role",))
_VARIABLE = NamePlace(binds=True)
_DOMAIN = NamePlace(offers="domain")
_PER = "[per variable:NAME in domain:NAME]"
_WHEN = "[ when {when}]"

STATEMENTS = (
    StatementKind(
        "ljs", s.Version, (Form("number:NUMBER", "version"),), (FILE,),
        example="ljs 2", doc="the version of the language",
    ),
    StatementKind(
        "use", s.UseLine, (Form("[relative:.] path [names:block]"),), (FILE,),
        example="use std.air { quadrotor }", doc="types, records and presets from a library or another file",
        names={"path": _WORD},
    ),
    StatementKind(
        "mission", s.MissionBlock, (Form("name:NAME [extends base:NAME] [title:STRING] block"),), (FILE,),
        example='mission rescue "A small rescue" { }', doc="the mission of the file",
        names={"name": NamePlace(declares="mission", referable=False)},
    ),
    StatementKind(
        "goal", s.TextLine, (Form("[language:NAME] text:STRING", "text_line", built=True),), ("mission",),
        example='goal "Find the person in the water."',
        doc="the text that all agents receive; `goal zh \"…\"` is the same in another language",
        names={"language": _WORD}, part="goal", paragraph="settings",
    ),
    StatementKind(
        "capabilities", s.CapabilityLine, (Form("names:names"),), ("mission",),
        example="capabilities navigation, perception", doc="the abilities that the task requires",
        names={"names": NamePlace(spaces=(), choices=CAPABILITIES)}, part="capabilities", paragraph="settings",
    ),
    StatementKind(
        "scene", s.SceneBlock, (Form("kind:NAME [block]"),), ("mission",),
        example="scene bay { datum = sea level at -3.5 m }", doc="the place of the mission",
        names={"kind": _WORD}, part="scene", paragraph="settings",
    ),
    StatementKind(
        "clock", s.SettingsBlock, (Form("block", "section"),), ("mission",),
        example="clock { tick = 10 s, sync = 500 ms }", doc="the decision interval and the engines' common step",
        keys=keyed(
            PropertyKey("tick", SECONDS, above=0, required=True),
            PropertyKey("sync", SECONDS, above=0, required=True),
        ),
        part="clock", paragraph="settings",
    ),
    StatementKind(
        "budget", s.SettingsBlock, (Form("block", "section"),), ("mission", "agent"),
        example="budget { ticks <= 60, policy <= 90 s }", doc="limits of the episode, or of one agent",
        keys=keyed(
            PropertyKey("ticks", NUMBER, ("<=",), low=1, required=True, whole=True),
            PropertyKey("policy", SECONDS, ("<=",), above=0, high=_DAY_S, default="90 s"),
            PropertyKey("engine", SECONDS, ("<=",), above=0, high=_DAY_S, default="30 s"),
            PropertyKey("capture", SECONDS, ("<=",), above=0, high=_DAY_S, default="10 s"),
            PropertyKey("tokens", Type("quantity", TOKENS), ("<=",), above=0, whole=True),
            PropertyKey("money", Type("quantity", MONEY), ("<=",), above=0),
            PropertyKey("messages", NUMBER, ("<=",), low=0, whole=True),
        ),
        part="budget", paragraph="settings",
    ),
    # Limits of weather on Earth: gusts of 113 m/s, tidal currents of 11 m/s and single waves of 26 m were measured.
    # Engine models do not cover more.
    StatementKind(
        "weather", s.SettingsBlock,
        (Form("block", "section"), Form("preset:NAME [block]", "preset", built=True)), (FILE, "mission", "event"),
        example="weather { wind = 4 m/s from 220 deg }", doc="the weather, or at the top of a file a preset of it",
        keys=keyed(
            PropertyKey("wind", Type("directed", of="from"), DRAWN, low=0, high=120, default="0 m/s from 0 deg"),
            PropertyKey("current", Type("directed", of="to"), DRAWN, low=0, high=15, default="0 m/s to 0 deg"),
            PropertyKey("turbulence", NUMBER, DRAWN, low=0, high=1, default="0"),
            PropertyKey("visibility", METRES, DRAWN, above=0, default="10 km"),
            PropertyKey("wave_height", METRES, DRAWN, low=0, high=30, default="0 m"),
            PropertyKey("wave_period", SECONDS, DRAWN, above=0, high=60, default="5 s"),
            PropertyKey("cloud", NUMBER, DRAWN, low=0, high=1, default="20 %"),
            PropertyKey("rain", NUMBER, DRAWN, low=0, high=1, default="0"),
            PropertyKey("sun_azimuth", DEGREES, DRAWN, default="150 deg"),
            PropertyKey("sun_elevation", DEGREES, DRAWN, low=-90, high=90, default="45 deg"),
            PropertyKey("ice", NUMBER, DRAWN, low=0, high=1, default="0"),
            PropertyKey("effects", FLAG, default="false"),
        ),
        part="weather", paragraph="settings",
    ),
    StatementKind(
        "message", s.MessageLine,
        (Form("name:NAME : type:NAME from senders:names to recipients:names [guard]"),), ("mission",),
        example="message detection : report from searcher to all", doc="a message kind, its senders and recipients",
        names={
            "type": NamePlace(spaces=("record",), offers="record"), "senders": _ROLE,
            "recipients": NamePlace(spaces=("role",), choices=(EVERYONE,)),
        },
        part="messages", paragraph="messages",
        layout=Layout("message {name} : {type} from {senders} to {recipients}" + _WHEN),
    ),
    StatementKind(
        "comms", s.SettingsBlock, (Form("block", "section"),), ("mission", "event"),
        example="comms { hub = base when mode == star, delay = 1 tick, payload <= 4 kB }", doc="the message bus",
        keys=keyed(
            PropertyKey("hub", Type("name"), guarded=True),
            PropertyKey("delay", Type("quantity", TICKS), low=1, whole=True, default="1 tick"),
            PropertyKey("payload", Type("quantity", DATA), ("<=",), above=0, default="4 kB"),
            PropertyKey("range", METRES, ("<=",), above=0),
            PropertyKey("loss", NUMBER, low=0, high=1, default="0"),
            PropertyKey("receipts", Type("name"), choices=RECEIPTS, default="own"),
        ),
        part="comms", paragraph="messages",
    ),
    StatementKind(
        "actions", s.SettingsBlock, (Form("block", "section"),), ("asset",),
        example="actions { takeoff, forward <= 50 m }",
        doc="the type's verbs that may be commanded, with bounds of their first arguments",
    ),
    StatementKind(
        "param", s.Param, (Form("name:NAME = value"), Form("[hidden:hidden] name:NAME drawn:~ value", "drawn_param")),
        ("mission",),
        example="param uavs = 3 in 1..10", doc="a value that a run may set, within bounds",
        names={"name": _SYMBOL}, part="parameters", paragraph="parameters",
        layout=Layout(
            "param {name} = {default:range}[ in {bounds:range}]",
            instead=("is_drawn", "param {hidden:mark}{name} ~ {default}"),
        ),
    ),
    StatementKind(
        "require", s.RequireLine, (Form("condition:value because reason:STRING"),), ("mission",),
        example='require distance_xy(victim[1], victim[2]) >= 100 m because "the victims are apart"',
        doc="a condition that the draws of a seed must meet; they are drawn anew until they do",
        part="requirements", paragraph="groups",
        layout=Layout("require {condition} because {reason:quoted}"),
    ),
    StatementKind(
        "mode", s.ModeLine, (Form("default:NAME [in allowed:set]", built=True),), ("mission",),
        example="mode broadcast in { star, broadcast }", doc="the default mode of communication and the permitted ones",
        names={"default": NamePlace(spaces=(), choices=MODES), "allowed": NamePlace(spaces=(), choices=MODES)},
        part="modes", paragraph="parameters",
    ),
    StatementKind(
        "region", s.RegionLine, (Form("name:NAME = shape:value"),), ("mission",),
        example="region search = box((0 m, 0 m), (90 m, 60 m))", doc="a named area",
        names={"name": _SYMBOL}, part="regions", paragraph="places", layout=Layout("region {name} = {shape}"),
    ),
    StatementKind(
        "grid", s.GridBlock, (Form("name:NAME over region:NAME block"),), ("mission",),
        example="grid cells over search { shape = 3 by 3, overlap = 20 % }", doc="the cells of a region",
        names={"name": _SYMBOL, "region": NamePlace(offers="region")},
        keys=keyed(
            PropertyKey("shape", Type("size"), required=True),
            PropertyKey("overlap", NUMBER, low=0, high=0.9, default="0"),
            PropertyKey("seen", FLAG, default="false"),
        ),
        part="grids", paragraph="places",
        layout=Layout(
            "grid {name} over {region}",
            ("shape = {rows:sum} by {columns:sum}", "[overlap = {overlap:nonzero}]", "[seen = {seen}]"),
        ),
    ),
    StatementKind(
        "target", s.EntityBlock, (Form("name:NAME [index] [: type:NAME] [guard] [block]", "entity"),),
        (FILE, "mission"),
        example="target victim[1..3] : person_in_water { hidden position ~ sites(search) }",
        doc="a subject of the mission, or at the top of a file a type of them",
        names={"name": _SYMBOL, "type": NamePlace(spaces=("type",), offers="type")},
        part="groups", paragraph="groups",
    ),
    StatementKind(
        "asset", s.EntityBlock, (Form("name:NAME [index] [: type:NAME] [guard] [block]", "entity"),),
        (FILE, "mission"),
        example="asset uav[1..3] : quadrotor { position = (0 m, 0 m) }",
        doc="an entity that agents command, or at the top of a file a type of them",
        names={"name": _SYMBOL, "type": NamePlace(spaces=("type",), offers="type")},
        part="groups", paragraph="groups",
    ),
    StatementKind(
        "camera", s.CameraBlock, (Form("name:NAME [: type:NAME] [block]"),), (FILE, "asset"),
        example="camera nadir { size = 1920 by 1080, hfov = 84 deg, channels = [rgb] }",
        doc="a camera of an asset, or at the top of a file a preset",
        names={"name": NamePlace(declares="preset"), "type": NamePlace(spaces=("preset",), offers="preset")},
        keys=keyed(
            PropertyKey("view", Type("name"), choices=VIEWS),
            PropertyKey("size", Type("size"), required=True),
            PropertyKey("hfov", DEGREES, required=True, above=0, high=179),
            PropertyKey("channels", Type("list", item="name"), choices=CHANNELS, required=True),
            PropertyKey("capture", Type("name"), choices=CAPTURES, default="on_request"),
        ),
    ),
    StatementKind(
        "agent", s.AgentBlock,
        (Form("name:NAME [index] as role:NAME [controls controls:values] [guard] [block]"),), ("mission",),
        example="agent scout[i in 1..3] as searcher controls uav[i] { observes uav[i].*, events }",
        doc="a deciding policy and its body",
        names={"role": NamePlace(declares="role")}, part="agents", paragraph="agents",
    ),
    StatementKind(
        "authority", s.AuthorityLine, (Form("roles:names may command resource:value [guard]"),), ("mission",),
        example="authority searcher may command boat when mode == broadcast", doc="command without embodiment",
        names={"roles": _ROLE}, part="authorities", paragraph="agents",
        layout=Layout("authority {role} may command {resource}" + _WHEN),
    ),
    StatementKind(
        "adjudicate", s.RuleBlock, (Form("name:NAME parameters:params [guard] block"),), ("mission",),
        example="adjudicate matched(v: victim, r: detection) { when r.class == person_in_water }",
        doc="a rule: an event, once it is true",
        names={"name": NamePlace(declares="rule")}, part="rules", paragraph="rules",
        layout=Layout("adjudicate {name}({parameters})" + _WHEN, ("when {condition}",)),
    ),
    StatementKind(
        "unlock", s.UnlockLine, (Form("name:NAME parameters:params condition:guard"),), ("mission",),
        example="unlock rescue(v: victim) when exists r: matched(v, r)",
        doc="the condition that permits an interaction",
        names={"name": NamePlace(spaces=("interaction",), offers="interaction")}, part="unlocks", paragraph="rules",
        layout=Layout("unlock {interaction}({parameters}) when {condition}"),
    ),
    StatementKind(
        "stage", s.StageBlock, (Form(f"name:NAME {_PER} [guard] block"),), ("mission",),
        example="stage detect per v in victim { done when exists r: matched(v, r) }",
        doc="a step of the mission, or of it for each member of a group",
        names={"variable": _VARIABLE, "domain": _DOMAIN},
        keys=keyed(
            PropertyKey("ticks", NUMBER, ("<=",), low=1, whole=True),
            PropertyKey("weight", NUMBER, above=0, default="1"),
            PropertyKey("deadline", SECONDS, public=False, above=0),
        ),
        part="stages", paragraph="stages",
        layout=Layout(
            "stage {name}[ per {variable} in {domain}]" + _WHEN,
            (
                "done when {condition}", "[ticks <= {ticks}]", "[deadline = {deadline}]", "[weight = {weight}]",
                "*limits",
            ),
        ),
    ),
    StatementKind(
        "relation", s.RelationLine,
        (
            Form("kind:NAME source:NAME -> target:NAME [clauses] [guard]"),
            Form("kind:NAME source:NAME mutual:<-> target:NAME [clauses] [guard]", "mutual_relation"),
        ),
        ("mission",),
        example="relation cooperation searcher <-> searcher over cells",
        doc="a relation between roles, or stages for a dependency",
        names={
            "kind": NamePlace(spaces=(), choices=RELATIONS),
            "source": NamePlace(spaces=("role",), dependency=("stage",)),
            "target": NamePlace(spaces=("role",), dependency=("stage",)),
            "carries": NamePlace(spaces=("message",)), "by": NamePlace(spaces=("message",)),
            "over": NamePlace(spaces=("symbol",)),
        },
        part="relations", paragraph="relations",
        layout=Layout(
            "relation {kind} {source} {mutual:arrow} {target}"
            "[ carries {carries}][ over {over}][ by {by}][ per {per}]" + _WHEN,
            instead=("serial", "serial {source}, {target}"),
        ),
    ),
    StatementKind(
        "serial", s.OrderLine, (Form("stages:names", "order"),), ("mission",),
        example="serial detect, execute", doc="stages of which each counts only after the one before",
        names={"stages": NamePlace(spaces=("stage",))},
    ),
    StatementKind(
        "parallel", s.OrderLine, (Form("stages:names", "order"),), ("mission",),
        example="parallel scan, guard", doc="stages that begin together, and for which the same stages wait",
        names={"stages": NamePlace(spaces=("stage",))},
    ),
    StatementKind(
        "success", s.OutcomeLine, (Form("when condition:value", "outcome"),), ("mission",),
        example="success when rescued(victim)", doc="the mission is won",
        part="success", paragraph="outcomes",
    ),
    StatementKind(
        "failure", s.OutcomeLine, (Form("when condition:value", "outcome"),), ("mission",),
        example="failure when now > 500 s", doc="the mission is lost", part="failure", paragraph="outcomes",
    ),
    StatementKind(
        "when", s.Condition, (Form("condition:value", "bare_condition"),), ("adjudicate",),
        example="when distance_xy(boat, v) <= 50 m", doc="only if the condition holds",
    ),
    StatementKind(
        "done", s.Condition, (Form("when condition:value", "condition"),), ("stage",),
        example="done when rescued(victim)", doc="the stage is over",
    ),
    StatementKind(
        "observes", s.Observes, (Form("channels [guard]"),), ("agent",),
        example="observes uav[i].*, cells, peers.position", doc="the channels that the agent observes each tick",
    ),
    StatementKind(
        "verb", s.VerbLine, (Form("name:NAME parameters:params"),), (TYPE,),
        example="verb forward(distance: length in 0 m..500 m)", doc="a command of an asset type",
    ),
    StatementKind(
        "interaction", s.InteractionBlock, (Form("name:NAME block"),), (TYPE,),
        example="interaction rescue { by = vessel, within = 50 m }", doc="an action on a target",
        # `takes = demand, from = load` lowers the target's `demand` by what the actor's `load` permits;
        # `gives = load, up_to = payload` raises the actor's `load` to its `payload`.
        keys=keyed(
            PropertyKey("by", Type("name")),
            PropertyKey("within", METRES, above=0),
            PropertyKey("lasting", SECONDS, low=0),
            PropertyKey("status", Type("name")),
            PropertyKey("aboard", FLAG),
            PropertyKey("takes", Type("name")),
            PropertyKey("from", Type("name")),
            PropertyKey("gives", Type("name")),
            PropertyKey("up_to", Type("name")),
            PropertyKey("told", Type("name"), choices=("all", "actor", "none")),
        ),
    ),
    StatementKind(
        "behaviour", s.BehaviourBlock, (Form("kind:NAME block"),), ("target",),
        example="behaviour flee { from = uav, speed = 2 m/s, within = 60 m }", doc="the motion of a target by itself",
        names={"kind": NamePlace(spaces=(), choices=tuple(BEHAVIOURS))},
        keys=keyed(
            PropertyKey("speed", MPS, above=0, high=_FASTEST_MPS, public=False),
            PropertyKey("from", ANY, public=False),
            PropertyKey("within", METRES, above=0, public=False),
            PropertyKey("in", REGION, public=False),
            PropertyKey("of", ANY, public=False),
            PropertyKey("distance", METRES, low=0, public=False),
        ),
    ),
    StatementKind(
        "mount", s.MountBlock, (Form("view:NAME block"),), (TYPE,),
        example="mount front { ahead = 0.3 m, above = 0 m, tilt = 10 deg }",
        doc="the place of a type's cameras of one view",
        names={"view": NamePlace(spaces=(), choices=VIEWS)},
        keys=keyed(
            PropertyKey("ahead", METRES, required=True, low=-_MOUNTED_M, high=_MOUNTED_M),
            PropertyKey("above", METRES, required=True, low=-_MOUNTED_M, high=_MOUNTED_M),
            PropertyKey("tilt", DEGREES, required=True, low=-90, high=90),
            PropertyKey("gimbal", FLAG, default="true"),
        ),
    ),
    StatementKind(
        "part", s.PartBlock, (Form("name:NAME : shape:NAME block"),), (TYPE,),
        example="part hull : box { length = 2 m, width = 1 m, height = 1 m }",
        doc="a visible solid of a type's bodies",
        names={"name": _WORD, "shape": NamePlace(spaces=(), choices=SHAPES)},
        keys=keyed(
            *(PropertyKey(name, METRES, required=True, low=LEAST_M, high=MOST_M) for name in MEASURES),
            *(PropertyKey(name, METRES, low=-MOST_M, high=MOST_M) for name in ("ahead", "right", "above")),
            PropertyKey("heading", DEGREES),
            PropertyKey("colour", Type("name"), choices=tuple(COLOURS)),
            PropertyKey("glow", NUMBER, low=0, high=1),
        ),
    ),
    StatementKind(
        "record", s.RecordBlock, (Form("name:NAME : category:NAME block"),), (FILE,),
        example="record beacon : other { place: position optional }", doc="the fields of a message",
        names={"category": NamePlace(spaces=(), choices=CATEGORIES)},
    ),
    StatementKind(
        "reveal", s.RevealLine, (Form("what:NAME ( entity:value ) to role:NAME [guard]"),), ("mission",),
        example="reveal image(victim) to searcher", doc="the audited exception from `hidden`",
        names={"what": NamePlace(spaces=(), choices=("image",)), "role": _ROLE},
        part="reveals", paragraph="relations", layout=Layout("reveal {what}({entity}) to {role}" + _WHEN),
    ),
    StatementKind(
        "declassify", s.DeclassifyLine, (Form("what:channels because reason:STRING"),), ("mission",),
        example='declassify end because "the end of an episode tells that all are rescued"',
        doc="agents may infer hidden values from the end, a permit, a constraint, a stage, a limit or an event",
        part="declassified", paragraph="relations", layout=Layout("declassify {what} because {reason:quoted}"),
    ),
    StatementKind(
        "prompt", s.TextLine, (Form("[language:NAME] text:STRING", "text_line", built=True),), ("agent",),
        example='prompt "Fly low."',
        doc="an additional text for this agent; `prompt zh \"…\"` is the same in another language",
        names={"language": _WORD},
    ),
    StatementKind(
        "hidden", None, (), ("asset", "target", TYPE),
        example="hidden position ~ sites(search)",
        doc="agents observe the property through sensors only; values computed from it are hidden too",
    ),
    StatementKind(
        "state", None, (), ("asset", "target", TYPE),
        example="state load = 0 kg", doc="a number that changes during the episode",
    ),
    StatementKind(
        "override", s.Override, (Form("item"),), ("mission",),
        example="override weather { visibility = 2 km }", doc="replaces a declaration of the base mission",
    ),
    StatementKind(
        "sweep", s.SweepLine, (Form("name:NAME over axes [guard]"),), ("mission",),
        example="sweep fleet over uavs in [1, 2, 3]", doc="a matched study",
        names={"name": NamePlace(declares="sweep", referable=False)}, part="sweeps", paragraph="sweeps",
    ),
    StatementKind(
        "tier", s.TierBlock, (Form("level:NUMBER block"),), ("mission",),
        example="tier 1 { claims, victims = 4 }",
        doc="values of params that make a harder form of the mission; tier 0 is the mission without them",
        part="tiers", paragraph="parameters",
    ),
    StatementKind(
        "limit", s.LimitLine, (Form("name:NAME <= most:value counts counts:channels [guard]"),), ("mission", "stage"),
        example="limit moves <= 50 counts dog.forward", doc="a counted budget",
        part="limits", paragraph="limits",
        layout=Layout("limit {name} <= {most:range} counts {counts}" + _WHEN),
    ),
    StatementKind(
        "permit", s.PermitLine, (Form("resource:channel condition:guard"),), ("mission",),
        example="permit van.setDestination when inspected(check)",
        doc="rejects the command unless the condition holds",
        part="permits", paragraph="limits", layout=Layout("permit {resource}.{verb:all} when {condition}"),
    ),
    StatementKind(
        "constraint", s.ConstraintBlock, (Form(f"kind:NAME name:NAME {_PER} [guard] block"),), ("mission",),
        example="constraint hard fence per u in uav { always u in area }",
        doc="a condition that must hold at every step of the engines",
        names={"kind": NamePlace(spaces=(), choices=CONSTRAINT_KINDS), "variable": _VARIABLE, "domain": _DOMAIN},
        keys=keyed(PropertyKey("penalty", NUMBER, low=0, high=1)),
        part="constraints", paragraph="limits",
        layout=Layout(
            "constraint {kind} {name}[ per {variable} in {domain}]" + _WHEN,
            ("always {condition}", "[penalty = {penalty}]"),
        ),
    ),
    StatementKind(
        "always", s.Condition, (Form("condition:value", "bare_condition"),), ("constraint",),
        example="always u.position.elevation >= 40 m", doc="a condition that must hold at every step",
    ),
    StatementKind(
        "event", s.EventBlock,
        (
            Form("name:NAME at [drawn:~] at:value [guard] [until until:value] [repeat every pause:value] block"),
            Form("name:NAME when condition:value [until until:value] [repeat every pause:value] block", "triggered"),
        ),
        ("mission",),
        example="event squall at 12 tick { weather { visibility = 1 km } }",
        doc="changes at a time or when a condition holds; `until` undoes them, `repeat` lets them occur again",
        part="events", paragraph="events",
    ),
    StatementKind(
        "appear", s.ChangeLine, (Form("entity:value", "change"),), ("event",),
        example="appear jam[2]", doc="the entity exists from now on",
    ),
    StatementKind(
        "vanish", s.ChangeLine, (Form("entity:value", "change"),), ("event",),
        example="vanish jam[1]", doc="the entity no longer exists from now on",
    ),
    StatementKind(
        "change", s.StateLine, (Form("target:operand to value:value", "changed_state"),), ("event",),
        example="change fire.heat to 0.8", doc="a state or the status of a target gets another value",
    ),
    StatementKind(
        "close", s.RoadLine, (Form("region:value", "roads"),), ("event",),
        example="close bridge", doc="no vehicle drives onto the roads in the region from now on",
    ),
    StatementKind(
        "reopen", s.RoadLine, (Form("region:value", "roads"),), ("event",),
        example="reopen bridge", doc="the roads in the region are open again",
    ),
    StatementKind(
        "jam", s.JamBlock, (Form("region:NAME block"),), ("event",),
        example="jam harbour { loss = 80 %, range <= 50 m }", doc="worse radio for senders and recipients in a region",
        names={"region": NamePlace(offers="region")},
        keys=keyed(
            PropertyKey("range", METRES, ("<=",), above=0),
            PropertyKey("loss", NUMBER, low=0, high=1),
        ),
    ),
    StatementKind(
        "inspection", s.InspectionBlock, (Form("name:NAME of asset:operand by by:values [guard] block"),),
        ("mission",),
        example="inspection checked of van by uav { within = 25 m }",
        doc="waypoints that must be visited, in order or in any order",
        keys=keyed(
            PropertyKey("within", METRES, above=0, required=True),
            PropertyKey("destination", ENTITY),
            PropertyKey("order", Type("name"), choices=ORDERS, default="strict"),
            PropertyKey("replan", Type("name")),
            PropertyKey("pictured", FLAG, default="false"),
        ),
        part="inspections", paragraph="limits",
        layout=Layout(
            "inspection {name} of {asset} by {by}" + _WHEN,
            (
                "within = {within}", "[order = {order}]", "[replan = {replan}]", "[destination = {destination}]",
                "[pictured = {pictured}]",
            ),
        ),
    ),
    StatementKind(
        "expect", s.ExpectBlock, (Form("block"),), ("mission",),
        example="expect { oracle wins within 40 ticks, idle loses, infeasible when boats == 0, "
        "draws spread over search }",
        doc="the mission's own tests, which `lingjing test` runs",
        part="expectations", paragraph="expectations",
    ),
    StatementKind(
        "wins", s.PolicyLine, (Form("[terms]", "policy_line", subject="policy:policy"),), ("expect",),
        example="oracle wins at least 4 of 5 within 40 ticks with mode = star",
        doc="episodes of the policy succeed: all of them, or the given share", has_own_words=True,
    ),
    StatementKind(
        "loses", s.PolicyLine, (Form("[terms]", "policy_line", subject="policy:policy"),), ("expect",),
        example="random loses for seeds 0..2", doc="episodes of the policy do not succeed", has_own_words=True,
    ),
    StatementKind(
        "infeasible", s.InfeasibleLine, (Form("condition:guard"),), ("expect",),
        example="infeasible when boats == 0",
        doc="with settings for which the condition holds, the mission is proved to be impossible or is refused",
    ),
    StatementKind(
        "draws", s.DrawsLine, (Form("spread over region:NAME [terms]"),), ("expect",),
        example="draws spread over search", doc="the positions that the seeds draw cover the region",
        has_own_words=True, names={"region": NamePlace(offers="region")},
    ),
)  # fmt: skip
"""Every statement that begins with a word of the language."""

PARAGRAPHS = (
    "settings", "parameters", "places", "groups", "agents", "messages", "rules", "limits", "stages", "relations",
    "events", "sweeps", "outcomes", "expectations",
)  # fmt: skip
"""The groups of statements that are printed together, in the order of a printed mission."""

KINDS: dict[str, StatementKind] = {kind.keyword: kind for kind in STATEMENTS}
"""Statements by keyword."""

_KEYWORD_OF: dict[type, str] = {kind.node: kind.keyword for kind in reversed(STATEMENTS) if kind.node is not None}


def keyword_of(node: s.Statement) -> str | None:
    """The keyword of a statement; None for one without, such as `name = value`."""
    keyword = _KEYWORD_OF.get(type(node))
    return getattr(node, "keyword", keyword) if keyword is not None else None


def kind_of(node: s.SyntaxNode) -> StatementKind | None:
    """The row of a statement; None for another node, and for a statement without a keyword."""
    keyword = keyword_of(node) if isinstance(node, s.Statement) else None
    return None if keyword is None else KINDS[keyword]


def declared_spaces() -> tuple[str, ...]:
    """The spaces of the names that statements declare and others may refer to."""
    places = [
        kind.place(label)
        for kind in STATEMENTS
        for label in (kind.node.__struct_fields__ if kind.node is not None else ())
    ]
    return tuple(dict.fromkeys(place.declares for place in places if place.declares and place.referable))
