"""The syntax tree: the author's text as frozen nodes, with their offsets.

`start` and `end` of a node are character offsets into its source. Statements are the members of blocks; expressions are
their parts. Names are unresolved text, and numbers keep the author's unit.
"""

from __future__ import annotations

import msgspec


class SyntaxNode(msgspec.Struct, frozen=True, gc=False):
    """Base of all nodes."""

    start: int
    end: int


# -- expressions


class Broken(SyntaxNode, frozen=True, gc=False):
    """An expression with an error that is already reported. Later phases skip it."""


class Name(SyntaxNode, frozen=True, gc=False):
    """A bare word."""

    text: str


class NumberLiteral(SyntaxNode, frozen=True, gc=False):
    """A number."""

    value: float
    """The number as written, before its unit is applied."""
    unit: str = ""
    """The unit; empty for a bare number."""


class TextLiteral(SyntaxNode, frozen=True, gc=False):
    """A quoted text, unescaped."""

    value: str


class FlagLiteral(SyntaxNode, frozen=True, gc=False):
    """`true` or `false`."""

    value: bool


class ForClause(SyntaxNode, frozen=True, gc=False):
    """`for o in order` after the argument of an aggregate."""

    variable: Name
    domain: Name


class CallArgument(SyntaxNode, frozen=True, gc=False):
    """An argument of a call."""

    name: Name | None
    """Name of a named argument; None for a positional one."""
    value: Expression
    over: ForClause | None = None
    """The domain of an aggregate."""


class CompositeExpr(SyntaxNode, frozen=True, gc=False):
    """An expression made of others."""

    depth: int
    """Levels below this node; the builder limits them."""


class Tuple(CompositeExpr, frozen=True, gc=False):
    """`(a, b)`: a point."""

    items: tuple[Expression, ...]


class List(CompositeExpr, frozen=True, gc=False):
    """`[a, b]`."""

    items: tuple[Expression, ...]


class NameSet(SyntaxNode, frozen=True, gc=False):
    """`{ a, b }` after `in`."""

    names: tuple[Name, ...]


class CallExpr(CompositeExpr, frozen=True, gc=False):
    """`function(…)`."""

    function: Name
    arguments: tuple[CallArgument, ...]


class Subscript(CompositeExpr, frozen=True, gc=False):
    """`base[index]`."""

    base: Expression
    index: Expression


class FieldExpr(CompositeExpr, frozen=True, gc=False):
    """`base.name`."""

    base: Expression
    name: Name


class UnaryExpr(CompositeExpr, frozen=True, gc=False):
    """`-x`, `not x`."""

    operator: str
    operand: Expression


class BinaryExpr(CompositeExpr, frozen=True, gc=False):
    """`left operator right`. Operators are those of arithmetic and logic, and `..`, `by`, `from`, `to`, `at`."""

    operator: str
    left: Expression
    right: Expression


class QuantifiedExpr(CompositeExpr, frozen=True, gc=False):
    """`exists r: body`, `forall v in victim: body`."""

    quantifier: str
    variable: Name
    domain: Name | None
    """The group over which the variable runs; None if the compiler infers it."""
    body: Expression


Expression = (
    Broken
    | Name
    | NumberLiteral
    | TextLiteral
    | FlagLiteral
    | Tuple
    | List
    | NameSet
    | CallExpr
    | Subscript
    | FieldExpr
    | UnaryExpr
    | BinaryExpr
    | QuantifiedExpr
)


# -- statements


class Statement(SyntaxNode, frozen=True, gc=False):
    """Base of all statements."""


class BracedBlock(SyntaxNode, frozen=True, gc=False):
    """`{ … }`."""

    items: tuple[Statement, ...]


class Version(Statement, frozen=True, gc=False):
    """`ljs 2`."""

    number: NumberLiteral | Broken


class UseLine(Statement, frozen=True, gc=False):
    """`use std.air { quadrotor }`. Without names it means all declarations of the file. `use .boats` is a file beside
    this one.
    """

    path: tuple[Name, ...]
    names: BracedBlock | None
    relative: bool = False


class MissionBlock(Statement, frozen=True, gc=False):
    """`mission name extends base "title" { … }`."""

    name: Name
    title: TextLiteral | None
    block: BracedBlock
    base: Name | None = None


class Override(Statement, frozen=True, gc=False):
    """`override …`: a declaration that replaces one of the base mission."""

    item: Statement


class TextLine(Statement, frozen=True, gc=False):
    """`goal "…"`, `prompt zh "…"`."""

    keyword: str
    language: Name | None
    """The code of the text's language; None for English."""
    text: TextLiteral


class SceneBlock(Statement, frozen=True, gc=False):
    """`scene bay { … }`."""

    kind: Name
    block: BracedBlock | None


class SettingsBlock(Statement, frozen=True, gc=False):
    """`clock { … }` and the other unnamed blocks: budget, weather, comms, actions."""

    keyword: str
    block: BracedBlock
    preset: Name | None = None
    """Name after `weather`: the preset that it begins with or, at the top of a file, its own name."""


class Param(Statement, frozen=True, gc=False):
    """`param name = default in low..high`, `param hidden name ~ integer(2, 5)`. The value contains the bounds as the
    right side of `in`."""

    name: Name
    value: Expression
    hidden: bool
    drawn: bool
    """True if the value follows a `~`."""


class RequireLine(Statement, frozen=True, gc=False):
    """`require condition because "…"`."""

    condition: Expression
    reason: TextLiteral


class ModeLine(Statement, frozen=True, gc=False):
    """`mode default in { … }`; `mode single` permits only that mode."""

    default: Name
    allowed: NameSet


class RegionLine(Statement, frozen=True, gc=False):
    """`region name = shape`."""

    name: Name
    shape: Expression


class GridBlock(Statement, frozen=True, gc=False):
    """`grid name over region { … }`."""

    name: Name
    region: Name
    block: BracedBlock


class EntityBlock(Statement, frozen=True, gc=False):
    """`asset` or `target`: an entity or group in a mission, a type at the top of a file."""

    keyword: str
    name: Name
    index: Expression | None
    type: Name | None
    guard: Expression | None
    block: BracedBlock | None


class CameraBlock(Statement, frozen=True, gc=False):
    """`camera name : preset { … }`. At the top of a file, without a type, it declares the preset itself."""

    name: Name
    block: BracedBlock | None
    type: Name | None = None


class AgentBlock(Statement, frozen=True, gc=False):
    """`agent name[i in 1..n] as role controls uav[i] { … }`."""

    name: Name
    index: Expression | None
    role: Name
    controls: tuple[Expression, ...]
    guard: Expression | None
    block: BracedBlock | None


class AuthorityLine(Statement, frozen=True, gc=False):
    """`authority role, role may command resource when …`."""

    roles: tuple[Name, ...]
    resource: Expression
    guard: Expression | None


class MessageLine(Statement, frozen=True, gc=False):
    """`message kind : record from roles to roles when …`."""

    name: Name
    type: Name
    senders: tuple[Name, ...]
    recipients: tuple[Name, ...]
    guard: Expression | None


class Typed(SyntaxNode, frozen=True, gc=False):
    """`name: type in low..high optional`: a parameter of a rule or a verb, a field of a record."""

    name: Name
    type: Name
    bounds: Expression | None
    optional: bool


class RuleBlock(Statement, frozen=True, gc=False):
    """`adjudicate name(…) { when … }`."""

    name: Name
    parameters: tuple[Typed, ...]
    guard: Expression | None
    block: BracedBlock


class UnlockLine(Statement, frozen=True, gc=False):
    """`unlock interaction(…) when …`."""

    name: Name
    parameters: tuple[Typed, ...]
    condition: Expression


class StageBlock(Statement, frozen=True, gc=False):
    """`stage name per v in group { done when … }`."""

    name: Name
    variable: Name | None
    domain: Name | None
    guard: Expression | None
    block: BracedBlock


class Clause(SyntaxNode, frozen=True, gc=False):
    """`carries x`, `over x`, `by x`, `per x` of a relation."""

    keyword: str
    name: Name


class RelationLine(Statement, frozen=True, gc=False):
    """`relation kind source -> target clauses when …`."""

    kind: Name
    source: Name
    target: Name
    mutual: bool
    clauses: tuple[Clause, ...]
    guard: Expression | None


class OrderLine(Statement, frozen=True, gc=False):
    """`serial find, save`, `parallel scan, guard`."""

    keyword: str
    stages: tuple[Name, ...]


class CapabilityLine(Statement, frozen=True, gc=False):
    """`capabilities navigation, perception`."""

    keyword: str
    names: tuple[Name, ...]


class OutcomeLine(Statement, frozen=True, gc=False):
    """`success when …`, `failure when …`."""

    keyword: str
    condition: Expression


class Condition(Statement, frozen=True, gc=False):
    """`done when …` (keyword `done`), `when …` or `always …`."""

    keyword: str
    condition: Expression


class ObservedChannel(SyntaxNode, frozen=True, gc=False):
    """One observed channel."""

    source: Expression
    everything: bool
    """True for `x.*`."""


class Observes(Statement, frozen=True, gc=False):
    """`observes a.*, b, c.position when …`."""

    channels: tuple[ObservedChannel, ...]
    guard: Expression | None


class LimitLine(Statement, frozen=True, gc=False):
    """`limit name <= most counts dog.forward, guide when …`."""

    name: Name
    most: Expression
    counts: tuple[ObservedChannel, ...]
    guard: Expression | None


class PermitLine(Statement, frozen=True, gc=False):
    """`permit van.setDestination when …`."""

    resource: ObservedChannel
    condition: Expression


class ConstraintBlock(Statement, frozen=True, gc=False):
    """`constraint hard name per v in group { always … }`."""

    kind: Name
    name: Name
    variable: Name | None
    domain: Name | None
    guard: Expression | None
    block: BracedBlock


class InspectionBlock(Statement, frozen=True, gc=False):
    """`inspection name of asset by inspectors { … }`."""

    name: Name
    asset: Expression
    by: tuple[Expression, ...]
    guard: Expression | None
    block: BracedBlock


class EventBlock(Statement, frozen=True, gc=False):
    """`event name at 12 tick { … }`, `event name when condition until other repeat every 60 s { … }`."""

    name: Name
    at: Expression | None
    """Its time; None for an event that a condition triggers."""
    drawn: bool
    """True if the time follows a `~`."""
    guard: Expression | None
    condition: Expression | None
    """The condition that triggers it; None for an event at a time."""
    until: Expression | None
    """The condition that undoes it."""
    pause: Expression | None
    """The time after which it may occur again."""
    block: BracedBlock


class ChangeLine(Statement, frozen=True, gc=False):
    """`appear jam[2]`, `vanish jam[1]`."""

    keyword: str
    entity: Expression


class StateLine(Statement, frozen=True, gc=False):
    """`change fire.heat to 0.8`."""

    target: Expression
    value: Expression


class RoadLine(Statement, frozen=True, gc=False):
    """`close bridge`, `reopen bridge`."""

    keyword: str
    region: Expression


class JamBlock(Statement, frozen=True, gc=False):
    """`jam harbour { loss = 80 % }`."""

    region: Name
    block: BracedBlock


class Axis(SyntaxNode, frozen=True, gc=False):
    """`uavs in [1, 2, 3]` of a sweep."""

    name: Name
    values: Expression


class SweepLine(Statement, frozen=True, gc=False):
    """`sweep name over uavs in [1, 2, 3] when …`."""

    name: Name
    axes: tuple[Axis, ...]
    guard: Expression | None


class ShareTerm(SyntaxNode, frozen=True, gc=False):
    """`all`, `some`, `none`: the share of an expectation's seeds."""

    word: str


class LeastTerm(SyntaxNode, frozen=True, gc=False):
    """`at least 3 of 5`."""

    least: NumberLiteral | Broken
    of: NumberLiteral | Broken


class WithinTerm(SyntaxNode, frozen=True, gc=False):
    """`within 40 ticks`, `within 400 s`."""

    limit: Expression


class SeedsTerm(SyntaxNode, frozen=True, gc=False):
    """`for seeds 0..4`, `for seeds 7`."""

    first: NumberLiteral | Broken
    last: NumberLiteral | Broken | None


class SettingsTerm(SyntaxNode, frozen=True, gc=False):
    """`with victims = 2, mode = star`."""

    settings: tuple[Axis, ...]


Term = ShareTerm | LeastTerm | WithinTerm | SeedsTerm | SettingsTerm
"""A part of an expectation."""


class TierBlock(Statement, frozen=True, gc=False):
    """`tier 1 { claims, victims = 4 }`."""

    level: NumberLiteral | Broken
    block: BracedBlock


class ExpectBlock(Statement, frozen=True, gc=False):
    """`expect { … }`."""

    block: BracedBlock


class PolicyLine(Statement, frozen=True, gc=False):
    """`oracle wins within 40 ticks for seeds 0..4`, `random loses`."""

    policy: Name | TextLiteral
    keyword: str
    terms: tuple[Term, ...]


class InfeasibleLine(Statement, frozen=True, gc=False):
    """`infeasible when victims > 8`."""

    condition: Expression


class DrawsLine(Statement, frozen=True, gc=False):
    """`draws spread over search`."""

    region: Name
    terms: tuple[Term, ...]


class VerbLine(Statement, frozen=True, gc=False):
    """`verb name(…)`."""

    name: Name
    parameters: tuple[Typed, ...]


class InteractionBlock(Statement, frozen=True, gc=False):
    """`interaction name { … }`."""

    name: Name
    block: BracedBlock


class BehaviourBlock(Statement, frozen=True, gc=False):
    """`behaviour kind { … }` of a target."""

    kind: Name
    block: BracedBlock


class MountBlock(Statement, frozen=True, gc=False):
    """`mount view { … }`."""

    view: Name
    block: BracedBlock


class PartBlock(Statement, frozen=True, gc=False):
    """`part name : shape { … }`."""

    name: Name
    shape: Name
    block: BracedBlock


class RecordBlock(Statement, frozen=True, gc=False):
    """`record name : category { … }`."""

    name: Name
    category: Name
    block: BracedBlock


class RevealLine(Statement, frozen=True, gc=False):
    """`reveal image(target) to role when …`."""

    what: Name
    entity: Expression
    role: Name
    guard: Expression | None = None


class DeclassifyLine(Statement, frozen=True, gc=False):
    """`declassify end, dog.forward because "…"`."""

    what: tuple[ObservedChannel, ...]
    reason: TextLiteral


class PropertyLine(Statement, frozen=True, gc=False):
    """`name = value`, `name ~ draw`, `name <= bound`, `name in low..high`, optionally `hidden`, `state` or with a
    guard.
    """

    name: Name
    relation: str
    value: Expression
    hidden: bool
    guard: Expression | None
    state: bool


class FieldLine(Statement, frozen=True, gc=False):
    """A field of a record."""

    typed: Typed


class Bare(Statement, frozen=True, gc=False):
    """A name alone: a verb in `actions`, a name in `use`."""

    name: Name


class UnknownBlock(Statement, frozen=True, gc=False):
    """`word { … }` with a word that is no statement."""

    name: Name
    block: BracedBlock


class Faulty(Statement, frozen=True, gc=False):
    """A statement that the parser could not read."""

    names: tuple[str, ...]
    """The words in it, any of which may be a declared name."""
    block: BracedBlock | None
    """The readable part of its block."""


class File(SyntaxNode, frozen=True, gc=False):
    """A whole file."""

    items: tuple[Statement, ...]
