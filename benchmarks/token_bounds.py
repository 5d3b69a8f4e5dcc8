"""The bound on the tokens of a request beside real tokenizers, over recorded model calls.

`python -m benchmarks.token_bounds RUN… --tokenizer NAME=tokenizer.json --tiktoken NAME=FILE:PATTERN`

RUN is a folder with `calls.sqlite`. A tokenizer is a `tokenizer.json` (read by the package `tokenizers`) or a file of
ranks (read by `tiktoken`) with the pattern that splits a text: o200k, qwen or a regular expression. Printed for each
tokenizer and each kind of text: the least and the largest share of the bound, and the same for letters divided by
three. A share above 1 is a text that passes the bound; the exit code is then 1.
"""

from __future__ import annotations

import argparse
import base64
import json
import sqlite3
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

from lingjing_agents.react.token_bound import message_bound

PATTERNS = {
    "o200k": r"[^\r\n\p{L}\p{N}]?[\p{Lu}\p{Lt}\p{Lm}\p{Lo}\p{M}]*[\p{Ll}\p{Lm}\p{Lo}\p{M}]+"
    r"|[^\r\n\p{L}\p{N}]?[\p{Lu}\p{Lt}\p{Lm}\p{Lo}\p{M}]+[\p{Ll}\p{Lm}\p{Lo}\p{M}]*"
    r"|\p{N}{1,3}| ?[^\s\p{L}\p{N}]+[\r\n/]*|\s*[\r\n]+|\s+(?!\S)|\s+",
    "qwen": r"[^\r\n\p{L}\p{N}]?\p{L}+|\p{N}| ?[^\s\p{L}\p{N}]+[\r\n]*|\s*[\r\n]+|\s+(?!\S)|\s+",
}
"""The patterns by which tokenizers split a text before they merge bytes. Contractions are left out: few are in our
texts."""

Counter = Callable[[str], int]


def main() -> int:
    """Print the table. Returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("runs", nargs="+", type=Path)
    parser.add_argument("--tokenizer", action="append", default=[], metavar="NAME=FILE")
    parser.add_argument("--tiktoken", action="append", default=[], metavar="NAME=FILE:PATTERN")
    args = parser.parse_args()
    counters = {**dict(map(_trained, args.tokenizer)), **dict(map(_ranked, args.tiktoken))}
    counters["letters / 3"] = lambda text: -(-len(text) // 3)
    texts: dict[str, set[str]] = {}
    for run in args.runs:
        for kind, text in messages(run / "calls.sqlite"):
            texts.setdefault(kind, set()).add(text)
    passed = False
    for kind, group in texts.items():
        print(f"{kind}: {len(group)} texts")
        for name, count in counters.items():
            shares = [count(text) / message_bound(text) for text in group]
            print(f"  {name:16} {min(shares):.3f} to {max(shares):.3f} of the bound")
            passed |= max(shares) > 1.0 and name != "letters / 3"
    return int(passed)


def messages(path: Path) -> Iterator[tuple[str, str]]:
    """Yield the kind and the text of each recorded message."""
    with sqlite3.connect(path) as record:
        for (data,) in record.execute("SELECT data FROM content"):
            try:
                message = json.loads(data)
            except (ValueError, UnicodeDecodeError):  # a picture
                continue
            if isinstance(message, dict) and "role" in message:
                content = message["content"]
                yield message["role"], content if isinstance(content, str) else content[0]["text"]


def _trained(option: str) -> tuple[str, Counter]:
    from tokenizers import Tokenizer

    name, _, file = option.partition("=")
    trained = Tokenizer.from_file(file)
    return name, lambda text: len(trained.encode(text, add_special_tokens=False).ids)


def _ranked(option: str) -> tuple[str, Counter]:
    import tiktoken

    name, _, rest = option.partition("=")
    file, _, pattern = rest.rpartition(":")
    lines = (line.split() for line in Path(file).read_bytes().splitlines() if line)
    ranks = {base64.b64decode(token): int(rank) for token, rank in lines}
    encoding = tiktoken.Encoding(name, pat_str=PATTERNS.get(pattern, pattern), mergeable_ranks=ranks, special_tokens={})
    return name, lambda text: len(encoding.encode_ordinary(text))


if __name__ == "__main__":
    sys.exit(main())
