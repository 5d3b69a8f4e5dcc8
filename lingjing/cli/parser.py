"""The argument parser of every verb: argparse, with the nearest word where one is not known."""

from __future__ import annotations

import argparse
from collections.abc import Iterable


class ArgumentParser(argparse.ArgumentParser):
    """An `ArgumentParser` whose complaint about a word that is no choice says which one may be meant.

    Parsers of verbs and actions are of this class too: argparse makes them of their parent's.
    """

    def _check_value(self, action: argparse.Action, value: object) -> None:
        try:
            super()._check_value(action, value)
        except argparse.ArgumentError as error:
            close = _nearest(value, action.choices or ())
            raise argparse.ArgumentError(
                action, f"{error.message}; did you mean {close}?" if close else error.message
            ) from None


def _nearest(word: object, choices: Iterable[object]) -> str | None:
    from lingjing.dsl.source.suggest import nearest

    return nearest(str(word), [str(choice) for choice in choices])
