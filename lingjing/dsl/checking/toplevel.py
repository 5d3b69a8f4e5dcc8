"""The top of a file: its version, the libraries that it uses, and its types, records and presets."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping
from functools import lru_cache

from lingjing.dsl.checking import library
from lingjing.dsl.checking.blocks import BlockReader
from lingjing.dsl.checking.elaborate import Elaborator
from lingjing.dsl.checking.entities import EntityChecker
from lingjing.dsl.checking.interactions import InteractionChecker
from lingjing.dsl.checking.kept_libraries import kept_library
from lingjing.dsl.checking.scope import Declaration, Library, MissionDecl, SymbolTables, TypeDecl
from lingjing.dsl.checking.settings import SettingsChecker
from lingjing.dsl.checking.types import TypeChecker
from lingjing.dsl.source.reporter import Reporter
from lingjing.dsl.source.text import SourceText, read_source
from lingjing.dsl.syntax import tree as s
from lingjing.dsl.syntax.parser import parse
from lingjing.dsl.syntax.statements import LANGUAGE_VERSION
from lingjing.mission.diagnostics import Diagnostic, Related
from lingjing.suggest import did_you_mean, nearest

LONGEST_CHAIN = 32
"""Most files that use each other in a row (chosen): each takes a few Python frames, and real chains have two or
three."""

Loaded = tuple[Library, tuple[Diagnostic, ...]]
"""The declarations of a library file, and its diagnostics."""
_Stamp = tuple[int, int]
"""Time of a file's last change in nanoseconds, and its size in bytes."""


class Files:
    """The files that one compilation reads. Each is checked once, however many paths lead to it."""

    __slots__ = ("_stamps", "bases", "libraries")

    def __init__(self) -> None:
        self.libraries: dict[str, Loaded] = {}
        """Checked libraries by file."""
        self.bases: dict[str, tuple[Diagnostic, ...] | None] = {}
        """Errors of missions that others extend, by file; None while the mission is being checked."""
        self._stamps: dict[str, _Stamp] = {}

    def stamp(self, file: str) -> _Stamp:
        """The version of a file at the first call, which comes before the file is read. Raises `OSError`."""
        known = self._stamps.get(file)
        if known is None:
            stat = os.stat(file)  # noqa: PTH116 - pathlib is not imported cold
            known = self._stamps[file] = stat.st_mtime_ns, stat.st_size
        return known


def check_library(source: SourceText, chain: tuple[str, ...], files: Files) -> Loaded:
    """Check the top of a file that another file uses. Its mission is only registered; a mission that extends it checks
    it.
    """
    report = Reporter(source)
    tree = parse(report)
    file = FileChecker(report, chain, files)
    file.declarations(tree)
    file.of.names.report_all()
    own = dict(file.own)
    for item in tree.items:
        if isinstance(item, s.MissionBlock):
            span = report.span(item.name.start, item.name.end)
            own.setdefault(item.name.text, MissionDecl(item.name.text, source.path, span))
    return Library(source.path, own, tuple(sorted(file.used))), tuple(report.diagnostics)


def load_library(file: str, chain: tuple[str, ...] = (), files: Files | None = None) -> Loaded:
    """Return the declarations of a library file and its diagnostics.

    `chain`: files that led here. `files`: files that the compilation has read. A library without errors is cached
    across compilations while it and the files that it uses are unchanged: it cannot lead back to a file of `chain`, or
    it would lead to itself. Errors may depend on `chain`, so they are not cached.
    """
    files = files or Files()
    known = files.libraries.get(file)
    if known is None:
        good = _good(file, *files.stamp(file))
        known = next((loaded for loaded, used in good if _is_current(used, files)), None)
        if known is None:
            known = _kept(file) or check_library(read_source(file), chain, files)
            if not known[1]:
                good[:] = [(known, {used: files.stamp(used) for used in known[0].uses})]
        files.libraries[file] = known
    return known


def _kept(file: str) -> Loaded | None:
    library = kept_library(file)
    return None if library is None else (library, ())


@lru_cache(maxsize=128)
def _good(_file: str, _modified: int, _size: int) -> list[tuple[Loaded, dict[str, _Stamp]]]:
    """The cache entry of a library file in this version: a list with the library and the versions of the files that it
    uses, once it was read without errors."""
    return []


def _is_current(used: Mapping[str, _Stamp], files: Files) -> bool:
    try:
        return all(files.stamp(file) == stamp for file, stamp in used.items())
    except OSError:
        return False


class FileChecker:
    """Checks the top of a file and fills a scope. `chain`: files that led here through `use`. `files`: files read."""

    def __init__(self, report: Reporter, chain: tuple[str, ...] = (), files: Files | None = None) -> None:
        self.report = report
        self.files = files or Files()
        self.chain = (*chain, os.path.realpath(report.source.path))
        self.scope = SymbolTables()
        self.of = Elaborator(report, self.scope)
        self.blocks = BlockReader(self.of)
        self.settings = SettingsChecker(self.blocks)
        self.entities = EntityChecker(self.blocks, self.settings)
        self.types = TypeChecker(self.blocks)
        self.interactions = InteractionChecker(self.blocks)
        self.own: dict[str, Declaration] = {}
        self.used: set[str] = set()
        """The library files that it uses, directly or through others."""

    def declarations(self, tree: s.File, path: str | None = None) -> None:
        """Check everything except the mission. `path`: the file of the tree, if it is not the reporter's."""
        self.scope.poisoned.update(names_in_faults(tree.items))
        self.scope.incomplete = self.scope.incomplete or any(isinstance(item, s.Faulty) for item in tree.items)
        self._version(tree)
        for item in tree.items:
            if isinstance(item, s.UseLine):
                self._use(item, self.report.source.path if path is None else path)
        for item in tree.items:
            if isinstance(item, s.EntityBlock):
                self._enter(item.name, self.types.type(item))
            elif isinstance(item, s.RecordBlock):
                self._enter(item.name, self.types.record(item))
            elif isinstance(item, s.CameraBlock):
                self._enter(item.name, self.types.camera(item))
            elif isinstance(item, s.SettingsBlock) and item.keyword == "weather":
                self._enter(item.preset, self.types.weather(item))
            elif not isinstance(item, s.UseLine | s.Version | s.MissionBlock | s.Faulty):
                self.blocks.misplaced(item, "a file outside of its mission")
        self._interactions(tree)

    # -- private

    def _interactions(self, tree: s.File) -> None:
        """Check interactions after all types: an interaction may name the engine of a type that is declared further
        down.
        """
        roles = tuple(_roles(tree))
        for item in tree.items:
            decl = self.own.get(item.name.text) if isinstance(item, s.EntityBlock) else None
            if isinstance(item, s.EntityBlock) and isinstance(decl, TypeDecl):
                nodes = [
                    part for part in (item.block.items if item.block else ()) if isinstance(part, s.InteractionBlock)
                ]
                self.interactions.type(decl, nodes, roles)

    def _version(self, tree: s.File) -> None:
        first = tree.items[0] if tree.items else None
        if not isinstance(first, s.Version):
            if first is not None and not isinstance(first, s.Faulty):
                at, edits = first.start, ((0, 0, f"ljs {LANGUAGE_VERSION}\n"),)
                hint = f"begin with `ljs {LANGUAGE_VERSION}`"
                message = "the file lacks its version"
                self.report("LJ0106", at, at + 1, message, hint, edits=edits, safe=True)
            return
        number = first.number
        if isinstance(number, s.NumberLiteral) and number.value not in range(1, LANGUAGE_VERSION + 1):
            self.report.at(
                "LJ0117",
                number,
                f"the file is in version {number.value:g} of the language; versions 1 to {LANGUAGE_VERSION} are known",
                "install a newer lingjing-sim"
                if number.value > LANGUAGE_VERSION
                else f"write `ljs {LANGUAGE_VERSION}`",
            )
        for item in tree.items[1:]:
            if isinstance(item, s.Version):
                self.report.at("LJ0103", item, "the version is given twice")

    def _use(self, node: s.UseLine, path: str) -> None:
        words = tuple(word.text for word in node.path)
        shown = ("." if node.relative else "") + ".".join(words)
        start, end = node.path[0].start, node.path[-1].end
        folder = library.folder_of(path) if node.relative else None
        file = library.find_file(words, folder) if folder is not None or not node.relative else None
        if file is None:
            self._not_found(node, shown, words, folder)
            return
        if os.path.realpath(file) in self.chain:
            way = [*self.chain[self.chain.index(os.path.realpath(file)) :], os.path.realpath(file)]
            names = " → ".join(os.path.basename(part) for part in way)  # noqa: PTH119 - pathlib is not imported cold
            self.report("LJ0120", start, end, f"`{shown}` uses itself: {names}", "move what both need to a third file")
            return
        if len(self.chain) >= LONGEST_CHAIN:
            message = f"`{shown}` is the end of more than {LONGEST_CHAIN} files in a row"
            self.report("LJ0120", start, end, message, "let fewer files use each other")
            return
        used, faults = load_library(file, self.chain, self.files)
        self.used.update((file, *used.uses))
        first = next((fault for fault in faults if fault.severity == "error"), None)
        if first is not None:
            self.report(
                "LJ0119",
                start,
                end,
                f"the library `{shown}` has errors",
                f"run `lingjing validate {file}`",
                related=(Related(first.span, first.message),),
            )
        self._import(node, used, shown)

    def _not_found(self, node: s.UseLine, shown: str, words: tuple[str, ...], folder: str | None) -> None:
        self.scope.incomplete = True
        known = library.known_paths(words[0], folder) if folder or not node.relative else []
        hint = did_you_mean(shown, known)
        if not known and words[0] in dict(library.installed_types()):
            hint = f"the installed types `{words[0]}` hold no .ljs file"
        if node.relative and folder is None:
            hint = "`use .NAME` needs a mission in a file"
        close = nearest(shown, known)
        outer = f"std.{shown}" if not node.relative and f"std.{shown}" in known else ""
        close = outer or close
        hint = f"did you mean `{outer}`?" if outer else hint
        inner = library.find_file(words[:-1], folder) if len(words) > 2 and node.names is None else None
        if inner is not None and words[-1] in load_library(inner, self.chain, self.files)[0].declared:
            close = f"{shown.rpartition('.')[0]} {{ {words[-1]} }}"
            hint = f"write `use {close}`"
        self.report(
            "LJ0118",
            node.path[0].start,
            node.path[-1].end,
            f"there is no library `{shown}`",
            hint,
            replace=close.removeprefix(".") if close and node.relative else close,
        )
        if node.names is not None:
            self.scope.poisoned.update(item.name.text for item in node.names.items if isinstance(item, s.Bare))
        else:
            self.scope.poisoned.update(re.findall(r"[^\W\d]\w*", self.report.source.text))

    def _import(self, node: s.UseLine, used: Library, shown: str) -> None:
        declared = used.declared
        wanted = list(declared)
        if node.names is not None:
            wanted = []
            for item in node.names.items:
                if not isinstance(item, s.Bare):
                    if not isinstance(item, s.Faulty):
                        self.blocks.misplaced(item, "`use`")
                    wanted = list(declared)  # a name was intended here: import all, to avoid errors at its uses
                    break
                if item.name.text in declared:
                    wanted.append(item.name.text)
                    continue
                name = item.name
                self.report.unknown("LJ0101", name, f"`{shown}` declares no `{name.text}`", declared)
                self.scope.poisoned.add(name.text)
                close = nearest(name.text, declared)
                if close is not None:
                    wanted.append(close)
                else:
                    self.scope.incomplete = True
        self.scope.not_imported.update({name: shown for name in declared if name not in wanted})
        for word in wanted:
            self.scope.enter(declared[word])

    def _enter(self, name: s.Name | None, decl: Declaration | None) -> None:
        if name is None:
            return
        first = self.scope.declared(name.text)
        if first is not None:
            self.report.declared_twice(name, f"the type `{name.text}`", first.span)
            return
        if decl is None:
            self.scope.poisoned.add(name.text)
            return
        self.own[name.text] = decl
        self.scope.enter(decl)


def names_in_faults(items: tuple[s.Statement, ...]) -> set[str]:
    """Every word in faulty statements, including those inside blocks: any of them may have been a declaration."""
    words: set[str] = set()
    waiting = list(items)
    while waiting:
        item = waiting.pop()
        if isinstance(item, s.Faulty):
            words.update(item.names)
            inside = item.block.items if item.block else ()
            words.update(each.name.text for each in inside if isinstance(each, s.Bare))
        block = getattr(item, "block", None)
        if isinstance(block, s.BracedBlock):
            waiting.extend(block.items)
    return words


def _roles(tree: s.File) -> Iterator[str]:
    """Yield the roles of the agents in the file's missions."""
    for mission in tree.items:
        for item in mission.block.items if isinstance(mission, s.MissionBlock) else ():
            inner = item.item if isinstance(item, s.Override) else item
            if isinstance(inner, s.AgentBlock):
                yield inner.role.text
