"""Whole phrases of other languages and of English, with the way to say them here.

The parser reads this table where a statement does not parse, before it tries repairs, because a repair of one token
would mislead where the whole statement is of another language. The first pattern that matches the line is reported.
"""

from __future__ import annotations

import re
from typing import NamedTuple

LONGEST = 400
"""Characters of a line that are read (chosen): phrases are short, and the patterns take quadratic time."""


class Idiom(NamedTuple):
    """A phrase of another language or of prose, and its form in this language."""

    pattern: re.Pattern[str]
    """Matches in the text of a statement, up to the end of its line."""
    message: str
    hint: str
    """The hint of the message; groups of the pattern may stand in it by name."""


def _idiom(pattern: str, message: str, hint: str) -> Idiom:
    return Idiom(re.compile(pattern), message, hint)


_NUMBER = r"[\d.]+\s*[A-Za-z/%]*"
_DURATION = r"[\d.]+\s*(?:s|ms|min|h|sec|seconds?|minutes?|hours?|ticks?)\b"

IDIOMS: tuple[Idiom, ...] = (
    _idiom(r"^<\??\w", "this is XML",
           "statements stand in braces: `stage … { done when … }`; an order is `serial a, b`"),
    _idiom(r"^-\s*\w", "a list has no dashes", "write the items in braces: `actions { takeoff, takePhoto }`"),
    _idiom(r"^\(\s*:\w+|\?\w+\s+-\s+\w+", "this is PDDL",
           "a rule is `adjudicate …(v: victim) { when … }`, a quantifier `forall v in victim: …`"),
    _idiom(r"\(\s*(?P<sign>or|and|not|=|[<>]=?)\s+[\w(]", "an operator stands between its operands",
           "write `a {sign} b`, and a call as `rescued(v)`"),
    _idiom(r"^\w+\s*=\s*new\b", "an entity is declared, not assigned",
           "write `asset boat : lifeboat { position = (… m, … m) }`"),
    _idiom(r"^(?P<word>asset|target|agent|stage|mission)\s+\w+\s*=\s*\"", "a declaration has no attributes",
           "write `{word} NAME : TYPE { … }`, as in `asset boat : lifeboat { … }`"),
    _idiom(r"^position\s*[=:]\s*\{", "a position is no record", "write `position = (10 m, -20 m)`"),
    _idiom(r"^at\s*\(", "a place is a property", "write `position = (… m, … m)`"),
    _idiom(r"^facing\b", "a direction is a property", "write `heading = 30 deg`"),
    _idiom(r"^\w+(?:\s*,\s*\w+)+\s*=(?!=)", "one property has one value", "write one `name = value` for each"),
    _idiom(r"^\w+\s*[-+*/]=", "nothing is assigned step by step", "write the whole value: `name = …`"),
    _idiom(r"^\"\"\"|^\"[^\"]*\"\s*$", "a text stands alone", "a comment begins with `#`"),
    _idiom(r"\b[a-zA-Z]\"", "a text has no letter before its quotes", "write `\"…\"`: `{{name}}` in it names a value"),
    _idiom(r"^(?P<word>success|failure)\s+until\b", "a condition follows `when`", "write `{word} when …`"),
    _idiom(r"\b(?P<word>exists|forall)\s*\(", "a quantifier has no brackets", "write `{word} v in GROUP: …`"),
    _idiom(r"^agent\s+\w+\s*(?:\[[^\]]*\]\s*)?controls\b", "an agent has a role",
           "write `agent NAME as ROLE controls …`"),
    _idiom(r"^message\s+\w+\s*:\s*\w+\s+\w+\s*->", "a message kind names its roles",
           "write `message NAME : RECORD from SENDER to RECIPIENT`"),
    _idiom(r"^param\s+\w+\s*:\s*[A-Za-z_]\w*\s*=", "a param has no type", "write `param NAME = 1 in 1..3`"),
    _idiom(r"^region\s+(?P<name>\w+)\s*\{", "a region has no block",
           "write `region {name} = box((… m, … m), (… m, … m))`"),
    _idiom(r"^\w+\s*->\s*\w+", "an order of stages is a statement",
           "write `serial a, b`, or `relation dependency a -> b`"),
    _idiom(r"^stage\s+(?P<name>\w+)\s+after\s+(?P<first>\w+)", "an order of stages is a statement of its own",
           "write `serial {first}, {name}` beside the stages"),
    _idiom(r"^(?:after|at|in)\s+(?P<time>" + _DURATION + r")\s*\{", "an event has a name",
           "write `event NAME at {time} {{ … }}`"),
    _idiom(r"\([^()]*\d[^()]*\)\s*(?P<unit>deg|m|km|s|min|kg)\b(?!\s*[/(])",
           "a unit stands behind a number alone", "give each number in the brackets its unit: `1 {unit}, 2 {unit}`"),
    _idiom(r"\b(?P<body>\w+)\.(?P<name>distance|distance_to|near|is_alive|get_\w+)\s*\(", "a body has no methods",
           "write a function of it, as in `distance_xy({body}, …)`"),
    _idiom(r"^return\b", "nothing is returned", "a rule states its condition: `when …`"),
    _idiom(r"\blambda\b", "there are no functions without a name", "write the condition itself, or a rule"),
    _idiom(r"^adjudicate\b[^{]*\w\s*=", "a parameter of a rule has no default", "write `name: group` alone"),
    _idiom(r"^require\s+always\b", "`require` is about the draws of an instance",
           "a condition at all times is `constraint hard NAME {{ always … }}`"),
    _idiom(r"^mode\b[^{]*\[", "the modes stand in braces", "write `mode broadcast in {{ star, broadcast }}`"),
    _idiom(r"^prompt\s*:?\s*[|>]|^prompt\s+or\b", "a text stands in quotes",
           "write `prompt \"\"\"…\"\"\"` for several lines"),
    _idiom(r"^weather\s*:?\s*[*&]", "a preset has no sign", "write `weather NAME`"),
    _idiom(r"^event\s+\w+\s+(?:from|between|during)\s+(?P<first>" + _NUMBER + r")\s*(?:to|and|until|\.\.)\s*"
           r"(?P<last>" + _NUMBER + r")", "an event has a beginning and an end",
           "write `at {first} until now > {last}`"),
    _idiom(r"^event\s+\w+\s+at\s+(?P<first>" + _NUMBER + r")\s+for\s+" + _NUMBER, "an event does not last by `for`",
           "write `at {first} until now > …`, with the time of its end"),
    _idiom(r"^event\s+\w+\s+on\b", "an event has a time or a condition",
           "write `at 60 s`, or `when count(…) >= 1` for what happens in the mission"),
    _idiom(r"^jam\s*\(\s*(?P<region>\w+)", "`jam` is no function",
           "write `jam {region} {{ loss = 80 %, range <= 100 m }}`"),
    _idiom(r"^(?P<word>close|reopen)\s+(?:the\s+)?(?:road|street|region|area)\s+(?P<region>\w+)",
           "a region is named alone", "write `{word} {region}`"),
    _idiom(r"^never\b", "a constraint states what always holds", "write `always not (…)`"),
    _idiom(r"(?:\(|\b(?:when|and|or|not|always)\b)\s*for_?each\s+(?P<member>\w+)\s+in\s+(?P<group>\w+)",
           "a quantifier is `forall` or `exists`", "write `forall {member} in {group}: …`"),
    _idiom(r"^event\s+\w+\s+(?:per|for)\b", "an event is about the whole mission",
           "write `when exists v in group: …` as its condition, or a rule `adjudicate …(v: group)`"),
    _idiom(r"^event\s+\w+\s+every\s+(?P<time>" + _NUMBER + r")", "an event has a first time",
           "write `at {time} repeat every {time}`"),
    _idiom(r"\bis\s+(?:at\s+least|no\s+less\s+than)\b", "`is at least` is no sign", "write `>=`"),
    _idiom(r"\bis\s+(?:at\s+most|no\s+more\s+than)\b", "`is at most` is no sign", "write `<=`"),
    _idiom(r"\bis\s+(?:more|greater|larger|higher)\s+than\b", "`is more than` is no sign", "write `>`"),
    _idiom(r"\bis\s+(?:less|smaller|lower|fewer)\s+than\b", "`is less than` is no sign", "write `<`"),
    _idiom(r"(?<!for )\b(?:each|every|all)\s+\w+\s+(?:is\s+|are\s+)?\w+", "a condition of all members is a quantifier",
           "write `forall v in victim: rescued(v)`, with your group and rule"),
    _idiom(r"\bis\s+not\b", "`is not` is no sign", "write `!=`, or `not` before the condition"),
    _idiom(r"\bis\b", "`is` is no sign", "write `==`"),
    _idiom(r"\b(?P<name>[\w.]+)\s+not\s+in\s+(?P<whole>\w+)", "`not in` is no operator",
           "write `not {name} in {whole}`"),
    _idiom(r"\bwithin\s+(?P<radius>" + _NUMBER + r")\s+of\b", "a distance is a function",
           "write `distance_xy(a, b) <= {radius}`"),
    _idiom(r"[\w)\]]\s+before\s+(?:not\s+)?[\w]", "`before` is a function", "write `before(a, b)`"),
    _idiom(r"[\w)\]]\s+within\s+(?P<time>" + _DURATION + ")", "`within` is a function of two conditions",
           "write `within(a, b, {time})`, or compare the time: `now <= {time}`"),
    _idiom(r"\bbetween\s+(?P<low>" + _NUMBER + r")\s+and\s+(?P<high>" + _NUMBER + r")", "a range has two dots",
           "write `x in {low}..{high}`"),
    _idiom(r"^(?P<word>permit|success|failure|unlock|event)\b[^{]*\bunless\b", "there is no `unless`",
           "write `{word} … when not …`"),
    _idiom(r"^permit\b[^{]*\buntil\b", "a permit has no end",
           "write the condition under which it is allowed: `when not …`"),
    _idiom(r"^(?P<word>permit|success|failure|unlock)\b[^{]*\bafter\s+(?P<time>" + _DURATION + ")",
           "`after` is no condition", "write `when now >= {time}`"),
    _idiom(r"\bfor\s+(?P<time>" + _DURATION + r")", "a condition does not last by `for`", "write `held(…, {time})`"),
    _idiom(r"\bthen\b", "conditions have no order", "write `before(a, b)`; an order of stages is `serial a, b`"),
)  # fmt: skip
"""The phrases, the most special first."""


def idiom_in(line: str) -> tuple[str, str] | None:
    """The message and the hint for the first phrase in the line of a faulty statement; None if there is none."""
    line = line[:LONGEST].split("#", 1)[0].strip()
    for idiom in IDIOMS:
        match = idiom.pattern.search(line)
        if match is not None:
            parts = {name: text.strip() for name, text in match.groupdict().items()}
            hint = idiom.hint.replace("{{", "\0").replace("}}", "\1")
            for name, text in parts.items():
                hint = hint.replace(f"{{{name}}}", text)
            return idiom.message, hint.replace("\0", "{").replace("\1", "}")
    return None
