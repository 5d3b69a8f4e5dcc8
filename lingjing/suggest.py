"""Spelling suggestions: the nearest of some known words."""

from __future__ import annotations

from collections.abc import Collection, Iterable

MANY = 500
"""Number of known words above which not all are compared. Chosen."""

LISTED = 24
"""Largest number of known words in a hint. Chosen: a type with a body and a state has about 20."""


def nearest(word: str, known: Iterable[str]) -> str | None:
    """Return the known word with the smallest edit distance, at most a third of its length (two of six letters), or
    None.
    """
    best, best_distance = None, 0.0
    folded = word.lower()
    letters = frozenset(folded)
    for candidate in _worth_a_look(word, known):
        limit = max(1, (max(len(word), len(candidate)) + 1) // 3)
        if abs(len(candidate) - len(word)) > limit or candidate == word:
            continue
        other = candidate.lower()
        if len(letters.difference(other)) > limit:  # each missing letter needs an edit of its own
            continue
        distance = _distance(folded, other, limit)
        if distance <= limit and (best is None or distance < best_distance):
            best, best_distance = candidate, distance
    if best is None or (len(word) <= 2 and word[:1] != best[:1] and folded != best.lower()):
        return None
    return best


def is_certain(word: str, known: Collection[str]) -> bool:
    """Return whether exactly one known word is a single edit away, so that no other can be intended.

    A word that differs in capitals alone is certain.
    """
    folded = word.lower()
    if sum(candidate.lower() == folded for candidate in known if candidate != word) == 1:
        return True
    near = {
        candidate
        for candidate in _worth_a_look(word, known)
        if candidate != word and abs(len(candidate) - len(word)) <= 1 and _distance(folded, candidate.lower(), 1) <= 1
    }
    return len(near) == 1 and len(word) > 2


def did_you_mean(word: str, known: Iterable[str], what: str = "") -> str:
    """Return a hint: the nearest word, else the list of all known words if it is short, else ""."""
    words = sorted(set(known))
    close = nearest(word, words)
    if close:
        return f"did you mean `{close}`?"
    if not words:
        return f"there is no {what}" if what else ""
    if len(words) <= LISTED:
        return f"known{' ' + what if what else ''}: {', '.join(words)}"
    return ""


def nearest_or(word: str, known: Iterable[str], otherwise: str) -> str:
    """Return a hint: the nearest known word, or `otherwise`."""
    close = nearest(word, known)
    return f"did you mean `{close}`?" if close else otherwise


def _worth_a_look(word: str, known: Iterable[str]) -> Iterable[str]:
    """Return the words to compare: of very many words only those with the same first letter, to save time."""
    words = known if isinstance(known, Collection) else tuple(known)
    if len(words) <= MANY:
        return words
    first = word[:1].lower()
    return [candidate for candidate in words if candidate[:1].lower() == first]


def _distance(a: str, b: str, limit: int) -> int:
    """Return the Damerau–Levenshtein distance with adjacent swaps (optimal string alignment), or `limit + 1` above
    `limit`.
    """
    before: list[int] = []
    previous = list(range(len(b) + 1))
    for i, x in enumerate(a, 1):
        row = [i]
        for j, y in enumerate(b, 1):
            cost = min(previous[j] + 1, row[j - 1] + 1, previous[j - 1] + (x != y))
            if i > 1 and j > 1 and x == b[j - 2] and a[i - 2] == y:
                cost = min(cost, before[j - 2] + 1)
            row.append(cost)
        if min(row) > limit:
            return limit + 1
        before, previous = previous, row
    return previous[-1]
