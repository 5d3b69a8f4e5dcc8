"""The argument parser of every verb: argparse with suggestions for unknown words."""

from __future__ import annotations

import argparse
import os
import re
import sys
from collections.abc import Iterable, Sequence
from contextlib import suppress
from typing import Any


class ArgumentParser(argparse.ArgumentParser):
    """An `argparse.ArgumentParser` that suggests the nearest known word for an unknown one.

    Parsers of verbs and actions have this class too: argparse creates them with their parent's class.
    """

    implied_word = ""
    """The action that is assumed if the first word is no action. Empty: an action must be named."""

    def parse_known_args(self, args: Sequence[str] | None = None, namespace: Any = None) -> Any:  # type: ignore[override]
        """Parse as argparse does, after inserting the implied action before a first word that is no action."""
        if self.implied_word and args is not None:
            actions = [action for action in self._actions if isinstance(action, argparse._SubParsersAction)]
            known = {"-h", "--help", *(name for action in actions for name in action.choices)}
            if not args or args[0] not in known:
                args = [self.implied_word, *args]
        return super().parse_known_args(args, namespace)

    def parse_args(self, args: Sequence[str] | None = None, namespace: Any = None) -> Any:  # type: ignore[override]
        """Parse as argparse does; the message for an unknown option suggests the nearest option of the verb."""
        namespace_of_args, unknown = self.parse_known_args(args, namespace)
        if unknown:
            known, named = _options(self, args or ()), [word for word in unknown if word.startswith("-")]
            close = next((near for word in named if (near := _nearest(word.partition("=")[0], known))), None)
            proposed = f"; did you mean {close}?" if close else ""
            self.error(f"unrecognized arguments: {' '.join(unknown)}{proposed}")
        return namespace_of_args

    def _get_formatter(self) -> argparse.HelpFormatter:
        return _HelpFormatter(prog=self.prog, width=_columns() - 2)

    def _check_value(self, action: argparse.Action, value: object) -> None:
        try:
            super()._check_value(action, value)
        except argparse.ArgumentError as error:
            close = _nearest(value, action.choices or ())
            raise argparse.ArgumentError(
                action, f"{error.message}; did you mean {close}?" if close else error.message
            ) from None


class _HelpFormatter(argparse.HelpFormatter):
    """The layout of argparse, with two differences.

    The first column is wide enough for the names of verbs: argparse measures them without their indent, so that the
    longest one would get a line of its own. Paragraphs that are indented, such as commands, keep their lines.
    """

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        parts = re.split(r"\n\n(?=  )|(?<=\S)\n\n(?=\S)", text)
        flowing = [part for part in parts if not part.startswith("  ")]
        if len(flowing) == len(parts):
            return super()._fill_text(text, width, indent)
        return "\n\n".join(
            part.rstrip() if part.startswith("  ") else super(_HelpFormatter, self)._fill_text(part, width, indent)
            for part in parts
        )

    def add_argument(self, action: argparse.Action) -> None:
        super().add_argument(action)
        if isinstance(action, argparse._SubParsersAction):
            longest = max((len(name) for name in action.choices), default=0)
            self._action_max_length = max(self._action_max_length, longest + 2 * self._indent_increment)


def _columns() -> int:
    """Return the width of the terminal in columns, as `shutil.get_terminal_size` does.

    argparse calls this once for each option, and importing `shutil` takes 2 ms of every start.
    """
    with suppress(ValueError):
        if (columns := int(os.environ.get("COLUMNS", ""))) > 0:
            return columns
    with suppress(ValueError, OSError):  # standard output is closed, or no terminal
        if sys.__stdout__ is not None:
            return os.get_terminal_size(sys.__stdout__.fileno()).columns or 80
    return 80


def _options(parser: argparse.ArgumentParser, words: Iterable[str]) -> list[str]:
    """Return the options of a parser, of the verb and of the action that the words name, sorted."""
    known = set(parser._option_string_actions)
    implied = getattr(parser, "implied_word", "")
    for word in words:
        parser = _below(parser, word) or parser
        known.update(parser._option_string_actions)
        implied = getattr(parser, "implied_word", "")
    if implied and (below := _below(parser, implied)):
        known.update(below._option_string_actions)
    return sorted(known)


def _below(parser: argparse.ArgumentParser, word: str) -> argparse.ArgumentParser | None:
    """Return the parser of the verb or action called `word` below this parser, or None."""
    actions = [action for action in parser._actions if isinstance(action, argparse._SubParsersAction)]
    return next((action.choices[word] for action in actions if word in action.choices), None)


def _nearest(word: object, choices: Iterable[object]) -> str | None:
    from lingjing.suggest import nearest

    return nearest(str(word), [str(choice) for choice in choices])
