"""`lingjing completion SHELL`: print a script that completes verbs, options, missions, policies and files in a shell.

The script holds the names of the missions, policies, suites, models and error codes that are installed when it is
printed, so that a completion starts no interpreter. Print it again after an installation of plug-ins.

  cd ~/.local/share/bash-completion/completions && lingjing completion bash > lingjing
  cd ~/.zfunc && lingjing completion zsh > _lingjing    # fpath+=~/.zfunc in ~/.zshrc
  cd ~/.config/fish/completions && lingjing completion fish > lingjing.fish
"""

from __future__ import annotations

import argparse
import re
import shlex
from collections.abc import Iterator
from typing import NamedTuple

from lingjing.errors import ExitCode

SHELLS = ("bash", "zsh", "fish")
"""The shells for which a script is written; the tests run each."""

FILES = frozenset(
    {"CITY", "FILE", "FILE.py", "FILE.py:FUNCTION", "KEYFILE", "MAP", "PATH", "PLACE", "RESULTS", "TRACE"}
)
"""Names of arguments for which files are completed. Outputs (`OUT`) are files too."""


class _WordList(NamedTuple):
    """Words that complete an argument, with files beside them."""

    name: str
    """Kind of the words, in the plural. It is a part of the names of the shells' functions."""
    words: tuple[str, ...]
    """The words, sorted."""
    suffix: str = ""
    """Files with this ending, and folders, are completed as well; "" for none."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("shell", choices=SHELLS, metavar="SHELL", help="bash, zsh or fish")


def handler(args: argparse.Namespace) -> int:
    """Print the script."""
    print(completion_script(args.shell))
    return ExitCode.OK


def completion_script(shell: str) -> str:
    """Return the completion script of one of `SHELLS`, a text without a final line break."""
    import shtab

    from lingjing.cli.main import complete_parser

    parser = complete_parser()
    lists = _word_lists()
    _add_implied_words(parser, lists)
    for action in _arguments_of(parser):
        completed = _completion_of(action, lists)
        if completed is not None:
            action.complete = completed  # type: ignore[attr-defined] # shtab reads this attribute
        if isinstance(
            action.metavar, str
        ):  # shtab 1.13 leaves a colon in it unescaped, which zsh's _arguments splits at
            action.metavar = re.sub(r"[^\w ./-]+", " ", action.metavar)
    return str(shtab.complete(parser, shell=shell))


def _word_lists() -> dict[str, _WordList]:
    """Return the lists of words by the name of an argument in the help, such as `MISSION`."""
    from lingjing.bench.suite import shipped_suites
    from lingjing.dsl.diagnostics.codes import CODES
    from lingjing.dsl.loading.shipped import shipped_missions
    from lingjing.mission.vocabulary import MODES
    from lingjing.plugins.host import PluginHost

    host = PluginHost()
    missions = _WordList("missions", shipped_missions(), ".ljs")
    policies = _WordList("policies", tuple(sorted(host.policies)), ".py")
    return {
        "MISSION": missions,
        "DIR|MISSION": missions,
        "SUITE": _WordList("suites", shipped_suites(), ".toml"),
        "NAME|FILE.py:CLASS": policies,
        "FILE.py:CLASS": policies,
        "MODE": _WordList("modes", tuple(sorted(MODES))),
        "CODE": _WordList("codes", tuple(sorted(CODES))),
        "--policy": policies,
        "--missions": missions,
        "--evaluator": _WordList("evaluators", tuple(sorted(host.evaluators))),
        "--models": _WordList("models", tuple(sorted(host.models))),
    }


def _add_implied_words(parser: argparse.ArgumentParser, lists: dict[str, _WordList]) -> None:
    """Add the words that stand in the place of an action: `lingjing bench main` means `lingjing bench play main`."""
    for action in list(parser._actions):
        if not isinstance(action, argparse._SubParsersAction):
            continue
        implied = action.choices.get(getattr(parser, "implied_word", ""))
        if implied is not None:
            first, *_ = implied._get_positional_actions()
            for word in lists[str(first.metavar)].words:
                added = action.add_parser(word, help=f"{implied.prog.split()[-1]} {word}")
                for option in implied._get_optional_actions()[1:]:  # the first is --help
                    added._add_action(option)
        for below in {id(below): below for below in action.choices.values()}.values():
            _add_implied_words(below, lists)


def _arguments_of(parser: argparse.ArgumentParser) -> Iterator[argparse.Action]:
    """Yield the arguments of a parser and of all parsers below it that take a value and declare no choices."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for below in action.choices.values():
                yield from _arguments_of(below)
        elif action.nargs != 0 and action.choices is None and action.help != argparse.SUPPRESS:
            yield action


def _completion_of(action: argparse.Action, lists: dict[str, _WordList]) -> dict[str, object] | None:
    """Return the completion of an argument in the form of shtab, or None for free text and numbers."""
    import shtab

    metavar = str(action.metavar or "")
    for key in (metavar, *action.option_strings):
        if key in lists:
            return _functions(lists[key])
    if re.fullmatch(r"[a-z]+(\|[a-z]+)+", metavar):  # such as record|replay|live
        return _functions(_WordList(metavar.replace("|", "_"), tuple(metavar.split("|"))))
    if metavar == "DIR":
        return dict(shtab.DIRECTORY)
    if metavar in FILES or metavar.startswith("OUT"):
        return dict(shtab.FILE)
    return None


def _functions(words: _WordList) -> dict[str, object]:
    """Return a function for each shell that completes the words and the files of a list, in the form of shtab."""
    name, quoted = f"_lingjing_{words.name}", shlex.join(words.words)
    bash, zsh, fish = [f"compgen -W {shlex.quote(' '.join(words.words))} -- $1"], f"'w:{words.name}:({quoted})'", ""
    if words.suffix:
        bash += [f"compgen -f -X '!*{words.suffix}' -- $1", "compgen -d -S / -- $1"]
        zsh += f" 'f:file:_files -g \"*{words.suffix}\"'"
        fish = f"; __fish_complete_suffix {words.suffix}"
    preambles = {
        "bash": f"{name}() {{\n  {'; '.join(bash)}\n}}",
        "zsh": f"{name}() {{\n  _alternative {zsh}\n}}",
        "fish": f"function {name}\n  printf '%s\\n' {quoted}{fish}\nend",
    }
    return {"bash": name, "zsh": name, "fish": f"({name})", "preamble": preambles}
