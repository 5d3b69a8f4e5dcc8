"""The description of one kind of statement: grammar, names, properties, place, documentation and printed layout.

A *pattern* is the grammar of a statement after its keyword, such as `name:NAME of asset:operand by by:values [guard]`.
Its elements are separated by blanks:

- `label:SYMBOL` fills the field `label` of the syntax node with a token (`NAME`, `STRING`, `~`) or with a rule of
  `ljs.lark` (`value`, `values`, `names`, `channels`, …). A rule alone (`block`, `guard`) fills the field of its name.
- A word or a sign (`by`, `=`) stands for itself. `[…]` is optional.

A statement may have a *subject* before its keyword: `oracle wins`. Its subject is a pattern of one element (ADR 0043).

A *layout* is the text of a printed statement. `{field}` or `{field:form}` stands for a field of the mission's part, and
`[…]` is left out if all its fields are empty or have their default. `lingjing.dsl.printing.layouts` reads it.
"""

from __future__ import annotations

import re
from functools import cache

import msgspec

from lingjing.dsl.syntax import tree as s
from lingjing.dsl.syntax.keys import PropertyKeys

FILE = "file"
"""Place of a statement: the top of a file, outside of the mission."""
TYPE = "type"
"""Place of a statement: the block of an asset or target type, at the top of a file."""

RULES = frozenset(
    "axes block channel channels clauses guard index item names operand params path policy set terms value values".split()  # noqa: SIM905, E501 - one word each
)
"""Rules of `ljs.lark` that patterns use."""
LISTS = frozenset(("axes", "channels", "names", "values"))
"""Rules with items that a comma separates."""
SIGNS: dict[str, str] = {
    "=": "EQUAL", ":": "COLON", "<=": "LE", "~": "TILDE", "->": "ARROW", "<->": "BOTH", "(": "LPAR", ")": "RPAR",
    ".": "DOT",
}  # fmt: skip
"""Signs of patterns → token types."""
_RULE_WORDS = {
    "guard": ("when",),
    "clauses": ("carries", "over", "by", "per"),
    "terms": ("all", "some", "none", "at", "least", "within", "for", "seeds", "with"),
}
"""Rules that begin with a word → the words."""
_PIECE = re.compile(r"\[|\]|\s+|(?:[a-z_]+:)?[^\s\[\]]+")


class PatternElement(msgspec.Struct, frozen=True):
    """One symbol of a pattern."""

    symbol: str
    """Token type or rule."""
    label: str = ""
    """Field of the node that it fills; empty for a word or sign."""
    word: str = ""
    """The word of the language that it stands for; empty for others."""
    group: int = 0
    """Number of its optional group, from 1; 0 if it is required."""

    def words(self) -> tuple[str, ...]:
        """The words with which it can begin; empty if it begins with a name or value."""
        return (self.word,) if self.word else _RULE_WORDS.get(self.symbol, ())


class Form(msgspec.Struct, frozen=True):
    """One way to write a statement after its keyword."""

    pattern: str
    """The grammar of the rest; see the module's docstring."""
    alias: str = ""
    """Name of the reduction in `ljs.lark`; empty for the keyword. Statements with one alias share a node."""
    subject: str = ""
    """The pattern before the keyword, `policy:policy`; empty for a statement that begins with its keyword."""
    built: bool = False
    """True if a method of `lingjing.dsl.syntax.builder.Builder` builds the node, because it computes a field."""

    def elements(self) -> tuple[PatternElement, ...]:
        """The symbols after the keyword, in order."""
        return _elements(self.pattern)

    def subject_elements(self) -> tuple[PatternElement, ...]:
        """The symbols before the keyword; empty without a subject."""
        return _elements(self.subject)


@cache
def _elements(pattern: str) -> tuple[PatternElement, ...]:
    elements: list[PatternElement] = []
    group = groups = 0
    for piece in _PIECE.findall(pattern):
        if piece == "[":
            groups += 1
            group = groups
        elif piece == "]":
            group = 0
        elif piece.strip():
            elements.append(_element(piece, group))
    return tuple(elements)


def _element(piece: str, group: int) -> PatternElement:
    label, _, symbol = piece.partition(":") if piece != ":" else ("", "", ":")
    if not symbol:
        label, symbol = (label, label) if label in RULES else ("", label)
    symbol = SIGNS.get(symbol, symbol)
    if symbol in RULES or symbol.isupper():
        return PatternElement(symbol, label, group=group)
    return PatternElement(symbol.upper(), label, symbol, group)


class NamePlace(msgspec.Struct, frozen=True):
    """The meaning of the names in one field of a statement."""

    declares: str = ""
    """The space into which the name is declared; empty for a use. A *space* is a set of names that must differ."""
    referable: bool = True
    """False if no statement refers to a name that is declared here."""
    binds: bool = False
    """True if the name is known only inside the statement."""
    spaces: tuple[str, ...] | None = None
    """The spaces in which a used name is looked up; None for all, `()` for a word of the language."""
    dependency: tuple[str, ...] | None = None
    """The spaces instead of `spaces` in a statement of the kind `dependency`."""
    choices: tuple[str, ...] = ()
    """Words of the language that may stand here."""
    offers: str = ""
    """The declarations that completion proposes, where these are other than all names of `spaces`."""


class Layout(msgspec.Struct, frozen=True):
    """The text of a printed statement."""

    head: str
    """Template of its first line."""
    lines: tuple[str, ...] = ()
    """Templates of the lines of its block; `*field` prints the statements of a field. Empty for one without a block."""
    instead: tuple[str, str] = ("", "")
    """A field and the template of items in which the field is true; ("", "") if all items have one template."""


class StatementKind(msgspec.Struct, frozen=True):
    """One kind of statement, by its keyword."""

    keyword: str
    """First word of the statement."""
    node: type[s.Statement] | None
    """Node of the syntax tree; None for a word before another statement."""
    forms: tuple[Form, ...]
    """The ways to write it."""
    within: tuple[str, ...]
    """The places where it may stand: keywords of blocks, `FILE` or `TYPE`."""
    example: str
    """A statement that parses, for documentation."""
    doc: str
    """Its meaning in one clause, without a full stop."""
    names: dict[str, NamePlace] = {}
    """Field, or word of a clause → the meaning of the names in it. A field `name` without an entry declares a name in
    the space of the keyword."""
    has_own_words: bool = False
    """True if the words of its patterns, other than those of other statements, are names everywhere else."""
    keys: PropertyKeys = {}
    """The properties of its block. Those of scenes, assets, targets and types depend on more."""
    part: str = ""
    """Field of `lingjing.mission.model.Mission` that holds what it declares; empty if it is a part of another
    statement."""
    paragraph: str = ""
    """The group of statements with which it is printed; one of `lingjing.dsl.syntax.statements.PARAGRAPHS`."""
    layout: Layout | None = None
    """Its printed text; None if `lingjing.dsl.printing.printer` writes it."""

    @property
    def token(self) -> str:
        """Its token type."""
        return self.keyword.upper()

    @property
    def opens_block(self) -> bool:
        """True if it may have a block of statements."""
        return any(element.symbol == "block" for form in self.forms for element in form.elements())

    @property
    def has_subject(self) -> bool:
        """True if its keyword is its second word."""
        return any(form.subject for form in self.forms)

    @property
    def is_section(self) -> bool:
        """True if its keyword and a block are a whole statement."""
        return any(form.pattern == "block" for form in self.forms)

    @property
    def is_text(self) -> bool:
        """True if its keyword and a text are the whole statement."""
        return any(form.pattern == "text:STRING" for form in self.forms)

    @property
    def holds_list(self) -> bool:
        """True if a comma may continue the statement."""
        return any(element.symbol in LISTS for form in self.forms for element in form.elements())

    def place(self, label: str) -> NamePlace:
        """The meaning of the names in a field."""
        return self.names.get(label) or (NamePlace(declares=self.keyword) if label == "name" else NamePlace())
