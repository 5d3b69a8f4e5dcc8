"""The checked standard library, read from the file `std.tables` beside this module.

To parse and check the libraries of one mission took a sixth of a cold `lingjing validate`, and they seldom change.
`tools/library_tables.py` writes the file; a test compares it with what checking gives. A library counts only while its
text, and that of each library that it uses, is the one that was checked; otherwise it is checked again. So it is if the
file is damaged or was written by a version with other classes, such as after an upgrade that was interrupted.

The file is msgpack. A value without parts stands for itself. Another one is a list that begins with its kind: `_TUPLE`,
`_DICT`, `_FILE` for the path of a file of the library, or from `_FIRST` on the number of a *shape*: a class and the
names of those of its fields that do not have their default.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from typing import Any

import msgspec

from lingjing.decoding import from_msgpack
from lingjing.digests import sha256
from lingjing.dsl.checking.library import shipped_folder
from lingjing.dsl.checking.scope import Declaration, Library
from lingjing.dsl.checking.values import UNKNOWN

# ruff: noqa: PTH118, PTH119, PTH120, PTH123 - pathlib is not imported cold

FILE = os.path.join(os.path.dirname(__file__), "std.tables")
"""Path of the tables."""

_TUPLE, _DICT, _FILE, _FIRST = range(4)


def kept_library(file: str) -> Library | None:
    """The checked library of a file; None if it is none of the standard library, or no longer the one that was
    checked."""
    folder, name = os.path.split(file)
    if folder != shipped_folder("std"):
        return None
    shapes, libraries = _tables()
    kept = libraries.get(name)
    if kept is None:
        return None
    digest, needs, declared = kept
    try:
        if digest != _digest(folder, (name, *needs)):
            return None
    except OSError:
        return None
    uses = tuple(os.path.join(folder, need) for need in needs)
    return Library(file, _Declarations(declared, _Reader(shapes, folder)), uses)


def tables(libraries: Iterable[tuple[Library, tuple[str, ...]]]) -> bytes:
    """The content of the file for checked libraries of one folder, each with the names of the files that it uses."""
    writer = _Writer()
    kept: dict[str, Any] = {}
    for library, needs in libraries:
        folder, name = os.path.split(library.path)
        declared = {word: writer.value(decl, folder) for word, decl in library.declared.items()}
        kept[name] = (_digest(folder, (name, *needs)), needs, declared)
    return msgspec.msgpack.encode((list(writer.shapes), kept))


# -- private


_Shape = tuple[type[msgspec.Struct], tuple[str, ...]]
"""A class, and the names of some of its fields."""
_Written = tuple[str, tuple[str, ...], dict[str, Any]]
"""A library as it is written: its digest, the files that it uses, and its declarations."""


@cache
def _tables() -> tuple[tuple[_Shape, ...], dict[str, _Written]]:
    """The shapes, and the libraries by file; none if the file is missing, damaged or of other classes."""
    try:
        with open(FILE, "rb") as file:
            shapes, libraries = from_msgpack(file.read(), tuple[list[tuple[str, ...]], dict[str, _Written]])
        return tuple(_shape(*shape) for shape in shapes), libraries
    except (OSError, msgspec.DecodeError, LookupError, AttributeError, TypeError):
        return (), {}


def _digest(folder: str, names: Iterable[str]) -> str:
    digest = sha256()
    for name in names:
        with open(os.path.join(folder, name), "rb") as file:
            text = file.read()
        digest.update(b"%d\0" % len(text) + text)
    return digest.hexdigest()


def _shape(module: str, name: str, *fields: str) -> _Shape:
    """The shape with these names. Raises `LookupError` or `AttributeError` without the class, and `TypeError` if the
    class has no such field, or further ones without a default."""
    made: type[msgspec.Struct] = getattr(sys.modules[module], name)
    own, defaults = made.__struct_fields__, made.__struct_defaults__
    optional = {field for field, default in zip(reversed(own), reversed(defaults), strict=False)
                if default is not msgspec.NODEFAULT}  # fmt: skip
    if not set(own) - optional <= set(fields) <= set(own):
        raise TypeError(f"{name} has other fields")
    return made, fields


class _Declarations(Mapping[str, Declaration]):
    """The declarations of a library by name, each made at its first use: a mission uses a fifth of them."""

    def __init__(self, written: dict[str, Any], reader: _Reader) -> None:
        self._written = written
        self._reader = reader
        self._made: dict[str, Declaration] = {}

    def __getitem__(self, name: str) -> Declaration:
        made = self._made.get(name)
        if made is None:
            made = self._made.setdefault(name, self._reader.value(self._written[name]))
        return made

    def __iter__(self) -> Iterator[str]:
        return iter(self._written)

    def __len__(self) -> int:
        return len(self._written)


class _Reader:
    """Values from their written form. `folder`: that of the library's files."""

    def __init__(self, shapes: tuple[_Shape, ...], folder: str) -> None:
        self.shapes = shapes
        self.folder = folder

    def value(self, written: Any) -> Any:
        if type(written) is not list:
            return written
        kind = written[0]
        parts = [part if type(part) is not list else self.value(part) for part in written[1:]]
        if kind >= _FIRST:
            made, fields = self.shapes[kind - _FIRST]
            return made(**dict(zip(fields, parts, strict=True)))
        if kind == _TUPLE:
            return tuple(parts)
        if kind == _DICT:
            return dict(zip(parts[::2], parts[1::2], strict=True))
        return os.path.join(self.folder, parts[0])


class _Writer:
    """The written form of values, and the shapes in it."""

    def __init__(self) -> None:
        self.shapes: dict[tuple[str, ...], int] = {}

    def value(self, value: Any, folder: str) -> Any:
        """Raises `TypeError` for a value of another kind."""
        if isinstance(value, str) and os.path.dirname(value) == folder:
            return [_FILE, os.path.basename(value)]
        if value is None or type(value) in (str, int, float, bool):
            return value
        if type(value) is tuple:
            return [_TUPLE, *(self.value(part, folder) for part in value)]
        if type(value) is dict:
            return [_DICT, *(self.value(part, folder) for pair in value.items() for part in pair)]
        if not isinstance(value, msgspec.Struct) or value is UNKNOWN:
            raise TypeError(f"no form for {value!r}")
        fields = [field for field in msgspec.structs.fields(type(value)) if not _has_default(value, field)]
        shape = (type(value).__module__, type(value).__qualname__, *(field.name for field in fields))
        number = self.shapes.setdefault(shape, len(self.shapes))
        return [_FIRST + number, *(self.value(getattr(value, field.name), folder) for field in fields)]


def _has_default(value: msgspec.Struct, field: msgspec.structs.FieldInfo) -> bool:
    own = getattr(value, field.name)
    default = field.default_factory() if callable(field.default_factory) else field.default
    return type(own) is type(default) and bool(own == default)
