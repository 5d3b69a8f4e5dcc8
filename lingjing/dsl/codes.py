"""The stable codes of diagnostics and what each means in a line. A code is never reused for another meaning."""

from __future__ import annotations

CODES: dict[str, str] = {
    # reading
    "LJ0001": "a character that has no meaning, or that hides the text's order",
    "LJ0002": "a text in quotes is never closed",
    "LJ0003": "a bracket is never closed",
    "LJ0004": "a bracket closes nothing",
    "LJ0005": "nested too deeply, or too long an expression",
    "LJ0006": "neither a number nor a name",
    "LJ0007": "the file is empty",
    "LJ0008": "more errors than are shown",
    "LJ0009": "a JSON document that is no mission",
    "LJ0010": "the statement goes on in a way the grammar does not know",
    "LJ0011": "no statement begins with this word",
    "LJ0012": "a named argument outside of a call",
    # names and structure
    "LJ0101": "nothing has this name",
    "LJ0102": "there is no such field",
    "LJ0103": "given twice",
    "LJ0104": "declared twice",
    "LJ0105": "what a quantifier ranges over cannot be inferred",
    "LJ0106": "something required is missing",
    "LJ0107": "a statement stands where it does not belong",
    "LJ0108": "a block does not know this key",
    "LJ0109": "not one of the words allowed here",
    "LJ0110": "a declaration has a part it cannot have here",
    "LJ0111": "members are counted 1..n",
    "LJ0112": "a target type for an asset, or the other way round",
    "LJ0113": "the type has no such verb",
    "LJ0114": "a target cannot be commanded",
    "LJ0115": "one resource is controlled by two agents",
    "LJ0116": "this cannot be observed",
    "LJ0117": "a version of the language that is not known",
    "LJ0118": "there is no such library",
    "LJ0119": "a library has errors of its own",
    # types and dimensions
    "LJ0201": "a value of another kind is due",
    "LJ0202": "a unit is missing",
    "LJ0203": "a quantity of another dimension is due",
    "LJ0204": "no unit has this name",
    "LJ0205": "a phrase (`by`, `from`, `to`, `at`) that is not understood here",
    "LJ0206": "a number outside of its bounds, or an empty range",
    "LJ0207": "division by zero",
    "LJ0208": "an outline that encloses no area or crosses itself",
    # expressions
    "LJ0301": "a distribution is due",
    "LJ0302": "a draw where no draw can be",
    "LJ0303": "the wrong one of `=`, `~`, `<=`, `>=`",
    "LJ0304": "known only while the mission runs, or only before",
    "LJ0306": "wrong arguments",
    "LJ0307": "a condition that is not possible here",
    "LJ0308": "a rule refers to itself",
    # hidden values
    "LJ0401": "a hidden value becomes visible",
    "LJ0402": "this cannot be hidden",
    # the mission as a whole
    "LJ0501": "tick and sync do not fit",
    "LJ0502": "star mode without a hub",
}
"""Code → meaning."""
