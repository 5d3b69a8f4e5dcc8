"""Did-you-mean: the nearest of some known words, if one is near enough to be meant."""

from __future__ import annotations

from collections.abc import Collection, Iterable

MANY = 500
"""Beyond so many known words not all of them are compared."""

LISTED = 24
"""So many known words are listed in a hint: those of a type with a body and a state are about 20."""


def nearest(word: str, known: Iterable[str]) -> str | None:
    """The known word at the smallest edit distance, at most a third of its length (two of six letters)."""
    best, best_distance = None, 0.0
    folded = word.lower()
    letters = frozenset(folded)
    for candidate in _worth_a_look(word, known):
        limit = max(1, (max(len(word), len(candidate)) + 1) // 3)
        if abs(len(candidate) - len(word)) > limit or candidate == word:
            continue
        other = candidate.lower()
        if len(letters.difference(other)) > limit:  # each of them takes an edit of its own
            continue
        distance = _distance(folded, other, limit)
        if distance <= limit and (best is None or distance < best_distance):
            best, best_distance = candidate, distance
    if best is None or (len(word) <= 2 and word[:1] != best[:1] and folded != best.lower()):
        return None
    return best


def is_certain(word: str, known: Iterable[str]) -> bool:
    """Whether exactly one known word is a single slip away, so that nothing else can have been meant."""
    folded = word.lower()
    near = {
        candidate
        for candidate in _worth_a_look(word, known)
        if candidate != word and abs(len(candidate) - len(word)) <= 1 and _distance(folded, candidate.lower(), 1) <= 1
    }
    return len(near) == 1 and len(word) > 2


def did_you_mean(word: str, known: Iterable[str], what: str = "") -> str:
    """A hint: the nearest word, else the list of all there are if it is short, else nothing."""
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
    """A hint: the nearest known word, or `otherwise` if none is near."""
    close = nearest(word, known)
    return f"did you mean `{close}`?" if close else otherwise


def _worth_a_look(word: str, known: Iterable[str]) -> Iterable[str]:
    """Of very many words only those that begin alike: a slip is seldom in the first letter, and time is short."""
    words = known if isinstance(known, Collection) else tuple(known)
    if len(words) <= MANY:
        return words
    first = word[:1].lower()
    return [candidate for candidate in words if candidate[:1].lower() == first]


def _distance(a: str, b: str, limit: int) -> int:
    """Damerau–Levenshtein with adjacent swaps (optimal string alignment); gives up above `limit`."""
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
