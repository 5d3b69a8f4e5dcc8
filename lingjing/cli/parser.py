"""The argument parser of every verb: argparse, with the nearest word where one is not known."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Iterable, Sequence
from contextlib import suppress
from typing import Any


class ArgumentParser(argparse.ArgumentParser):
    """An `ArgumentParser` whose complaint about a word that is no choice says which one may be meant.

    Parsers of verbs and actions are of this class too: argparse makes them of their parent's.
    `implied_word` is the action that is meant where the first word is none, if it is given.
    """

    implied_word = ""

    def parse_known_args(self, args: Sequence[str] | None = None, namespace: Any = None) -> Any:  # type: ignore[override]
        """Argparse's, with the implied action put before what is no action."""
        if self.implied_word and args is not None:
            actions = [one for one in self._actions if isinstance(one, argparse._SubParsersAction)]
            known = {"-h", "--help", *(name for one in actions for name in one.choices)}
            if not args or args[0] not in known:
                args = [self.implied_word, *args]
        return super().parse_known_args(args, namespace)

    def parse_args(self, args: Sequence[str] | None = None, namespace: Any = None) -> Any:  # type: ignore[override]
        """Argparse's, with the nearest option of the verb where one is not known."""
        found, unknown = self.parse_known_args(args, namespace)
        if unknown:
            known, named = _options(self, args or ()), [word for word in unknown if word.startswith("-")]
            close = next((near for word in named if (near := _nearest(word.partition("=")[0], known))), None)
            proposed = f"; did you mean {close}?" if close else ""
            self.error(f"unrecognized arguments: {' '.join(unknown)}{proposed}")
        return found

    def _get_formatter(self) -> argparse.HelpFormatter:
        return argparse.HelpFormatter(prog=self.prog, width=_columns() - 2)

    def _check_value(self, action: argparse.Action, value: object) -> None:
        try:
            super()._check_value(action, value)
        except argparse.ArgumentError as error:
            close = _nearest(value, action.choices or ())
            raise argparse.ArgumentError(
                action, f"{error.message}; did you mean {close}?" if close else error.message
            ) from None


def _columns() -> int:
    """How wide the terminal is, as `shutil.get_terminal_size` says: argparse asks for each option that it is given, and
    importing `shutil` takes 2 ms of every start."""
    with suppress(ValueError):
        if (told := int(os.environ.get("COLUMNS", ""))) > 0:
            return told
    with suppress(ValueError, OSError):  # standard output is closed, or no terminal
        if sys.__stdout__ is not None:
            return os.get_terminal_size(sys.__stdout__.fileno()).columns or 80
    return 80


def _options(parser: argparse.ArgumentParser, words: Iterable[str]) -> list[str]:
    """The options of a parser and of the verb and the action that the words name."""
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
    """The parser of a verb or an action of this one, if the word is one."""
    actions = [one for one in parser._actions if isinstance(one, argparse._SubParsersAction)]
    return next((one.choices[word] for one in actions if word in one.choices), None)


def _nearest(word: object, choices: Iterable[object]) -> str | None:
    from lingjing.suggest import nearest

    return nearest(str(word), [str(choice) for choice in choices])
