"""`token_bound`: the number of tokens that no tokenizer in use passes for a text of a request.

Models split the same text differently, and a tokenizer that is installed here and not there must not change what a
model is sent. So requests are budgeted with a bound that needs no tokenizer. Letters divided by a constant are no
bound: the states are full of numbers, and most tokenizers make one token of each digit. `benchmarks/token_bounds.py`
compares the bound with real tokenizers over recorded requests.
"""

from __future__ import annotations

import re
from functools import lru_cache

_RUNS = re.compile(r"\d|[^\W\d_]+|[^\w\s]+|_+|\s+")
"""A digit, or a run of letters, of punctuation, of underscores or of white space."""

LETTERS = 6
"""Letters of a token of a word of ASCII letters, rounded up for each word. Measured by `benchmarks/token_bounds.py`."""

SIGNS = 2
"""Characters of a token of a run of punctuation, rounded up for each run. Measured in the same way."""

MESSAGE_TOKENS = 16
"""Tokens of a message beside its text: the chat template's, and what short texts pass the bound by. Chosen."""


@lru_cache(maxsize=512)
def token_bound(text: str) -> int:
    """Return at least as many tokens as the text has for each tokenizer that was tried, without its message's frame.

    Counts are kept, because every request repeats the system text and the turns of the one before.
    """
    return sum(_run_tokens(run.group()) for run in _RUNS.finditer(text))


def message_bound(text: str) -> int:
    """Return the bound for a message: its text and its frame in the chat template."""
    return token_bound(text) + MESSAGE_TOKENS


def _run_tokens(run: str) -> int:
    first = run[0]
    if first.isspace():
        return int(run != " ")  # a single space belongs to the next word
    if first.isdigit():
        return 1
    if first.isalpha():
        return -(-len(run) // LETTERS) if run.isascii() else len(run)
    return -(-len(run) // SIGNS)
