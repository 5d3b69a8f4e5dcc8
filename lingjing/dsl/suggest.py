"""Did-you-mean: the nearest of some known words, if one is near enough to be meant."""

from __future__ import annotations

from collections.abc import Iterable


def nearest(word: str, known: Iterable[str]) -> str | None:
    """The known word at the smallest edit distance, at most a third of its length (two of six letters)."""
    best, best_distance = None, 0.0
    folded = word.lower()
    for candidate in known:
        limit = max(1, (max(len(word), len(candidate)) + 1) // 3)
        if abs(len(candidate) - len(word)) > limit or candidate == word:
            continue
        distance = _distance(folded, candidate.lower(), limit)
        if distance <= limit and (best is None or distance < best_distance):
            best, best_distance = candidate, distance
    if best is None or (len(word) <= 2 and word[:1] != best[:1] and folded != best.lower()):
        return None
    return best


def is_certain(word: str, known: Iterable[str]) -> bool:
    """Whether exactly one known word is a single slip away, so that nothing else can have been meant."""
    folded = word.lower()
    near = {candidate for candidate in known if candidate != word and _distance(folded, candidate.lower(), 1) <= 1}
    return len(near) == 1 and len(word) > 2


def did_you_mean(word: str, known: Iterable[str], what: str = "") -> str:
    """A hint: the nearest word, else the list of all there are if it is short, else nothing."""
    words = sorted(set(known))
    close = nearest(word, words)
    if close:
        return f"did you mean `{close}`?"
    if not words:
        return f"there is no {what}" if what else ""
    if len(words) <= 12:
        return f"known{' ' + what if what else ''}: {', '.join(words)}"
    return ""


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
