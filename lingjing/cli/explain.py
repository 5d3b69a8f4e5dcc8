"""`lingjing explain LJ0101`: print the meaning of an error code, an example and its correction."""

from __future__ import annotations

import argparse

from lingjing.errors import ExitCode, UsageError


def add_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("code", metavar="CODE", nargs="?", help="a code such as LJ0101 (default: list all codes)")


def handler(args: argparse.Namespace) -> int:
    """Print the page of a code, or the list of all codes."""
    print(listing() if args.code is None else page(args.code), end="")
    return ExitCode.OK


def listing() -> str:
    """Return one line for each code, with its meaning."""
    from lingjing.dsl.diagnostics.codes import CODES

    return "".join(f"{code}  {meaning}\n" for code, meaning in sorted(CODES.items()))


def page(code: str) -> str:
    """Return the page of a code; `lj101` and `101` are accepted. Raises `UsageError` if there is no such code."""
    from lingjing.data import data_path
    from lingjing.dsl.diagnostics.codes import CODES

    digits = code.upper().removeprefix("LJ")
    wanted = f"LJ{digits.zfill(4)}"
    if wanted not in CODES:
        from lingjing.suggest import nearest

        close = nearest(wanted, CODES)
        hint = f"did you mean {close}? " if close else ""
        raise UsageError(f"there is no error code `{code}`", hint=f"{hint}`lingjing explain` lists all codes")
    file = data_path("errors", f"{wanted}.md")
    if not file.is_file():
        return f"# {wanted}: {CODES[wanted]}\n"
    return file.read_text(encoding="utf-8")
