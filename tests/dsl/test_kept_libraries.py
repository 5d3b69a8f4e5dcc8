"""The shipped tables of the standard library equal the checked library, and a changed library is checked again."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Callable
from pathlib import Path

import msgspec
import pytest

from lingjing.testing import compile_text

ROOT = Path(__file__).parents[2]
_SPEC = importlib.util.spec_from_file_location("library_tables_tool", ROOT / "tools" / "library_tables.py")
assert _SPEC is not None and _SPEC.loader is not None
TOOL = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(TOOL)
kept_library = TOOL.kept_library
LIBRARIES = sorted(Path(TOOL.shipped_folder("std")).glob("*.ljs"))


def test_the_shipped_tables_are_those_of_the_libraries() -> None:
    assert Path(TOOL.FILE).read_bytes() == TOOL.kept(), "run: python tools/library_tables.py"


@pytest.mark.parametrize("file", LIBRARIES, ids=lambda file: file.stem)
def test_a_kept_library_equals_the_checked_one(file: Path) -> None:
    kept, (checked, _) = kept_library(str(file)), TOOL.checked(file, TOOL.Files())
    assert kept is not None and kept.path == checked.path and kept.uses == checked.uses
    assert list(kept.declared) == list(checked.declared)
    for name, declared in checked.declared.items():
        assert type(kept.declared[name]) is type(declared)
        assert kept.declared[name] == declared
        assert msgspec.json.encode(kept.declared[name]) == msgspec.json.encode(declared)  # 1 == 1.0 in Python


def test_a_changed_library_and_one_that_uses_it_are_checked_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for file in LIBRARIES:
        (tmp_path / file.name).write_bytes(file.read_bytes())
    monkeypatch.setattr("lingjing.dsl.checking.kept_libraries.shipped_folder", lambda _: str(tmp_path))
    air, errands = tmp_path / "air.ljs", tmp_path / "errands.ljs"
    kept = kept_library(str(errands))
    assert kept is not None
    assert {decl.span.path for decl in kept.declared.values()} == {str(errands)}
    air.write_text(air.read_text(encoding="utf-8").replace("12 m/s", "13 m/s"), encoding="utf-8")
    assert kept_library(str(air)) is None
    assert kept_library(str(errands)) is None
    assert kept_library(str(tmp_path / "sea.ljs")) is not None


def test_a_library_outside_of_the_standard_library_is_not_kept(tmp_path: Path) -> None:
    own = tmp_path / "air.ljs"
    own.write_bytes(LIBRARIES[0].read_bytes())
    assert kept_library(str(own)) is None


def _other_class(tables: bytes) -> bytes:
    return tables.replace(b"\xa8TypeDecl", b"\xa8TypeDeck", 1)


def _other_field(tables: bytes) -> bytes:
    return tables.replace(b"\xa6engine", b"\xa6motors", 1)


@pytest.mark.parametrize(
    "damage", [lambda _: b"", lambda tables: tables[:-100], lambda _: b"\x92\x91\x01\x80", _other_class, _other_field],
    ids=["empty", "truncated", "other form", "other class", "other field"],
)  # fmt: skip
def test_damaged_tables_and_tables_of_other_classes_are_ignored(
    damage: Callable[[bytes], bytes], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tables = Path(TOOL.FILE).read_bytes()
    assert damage(tables) != tables
    (tmp_path / "std.tables").write_bytes(damage(tables))
    module = sys.modules[kept_library.__module__]
    monkeypatch.setattr(module, "FILE", str(tmp_path / "std.tables"))
    monkeypatch.setattr(module, "_tables", module._tables.__wrapped__)
    assert kept_library(str(LIBRARIES[0])) is None


def test_a_suggestion_can_name_a_declaration_that_was_not_loaded() -> None:
    compilation = compile_text("ljs 2\nuse std.air { quadrotr }\n")
    assert "did you mean `quadrotor`?" in [item.hint for item in compilation.diagnostics]
