"""The indefinite article of a noun in a message."""

from __future__ import annotations


def with_article(noun: str) -> str:
    """Return a noun with its article: "a length", "an `asset` entity", "an EvaluatorPlugin". A vowel letter decides."""
    return f"{'an' if noun.lstrip('`')[:1].lower() in tuple('aeiou') else 'a'} {noun}"


__all__ = ["with_article"]
