"""`lingjing lsp`: run the language server over standard input and output."""

from __future__ import annotations

import argparse
import sys
from importlib.util import find_spec

from lingjing.errors import ExitCode, UsageError


def add_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "--stdio",
        action="store_true",
        help="accepted for editors that pass it; the server always uses standard streams",
    )


def handler(_args: argparse.Namespace) -> int:
    """Serve until the client leaves. Raises `UsageError` if the packages are missing or standard input is a
    terminal.
    """
    if find_spec("pygls") is None or find_spec("lsprotocol") is None:
        from lingjing.installation import install_line

        raise UsageError("the language server needs pygls", hint=f"install it: {install_line('lsp')}")
    if sys.stdin.isatty():
        raise UsageError(
            "the language server is started by an editor, not in a terminal",
            hint="editors/vscode has an extension; see its README",
        )
    from lingjing.lsp.server import serve

    serve()
    return ExitCode.OK
