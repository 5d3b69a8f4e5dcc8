"""`use`: the standard library, plug-ins' types, files that use each other, faulty libraries."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from lingjing.errors import PluginError
from lingjing.testing import compile_file, compile_text


@pytest.fixture
def acme(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An installed distribution `acme` that declares types through the entry-point group `lingjing.std`."""
    package = tmp_path / "acme_types"
    package.mkdir()
    (package / "__init__.py").write_text("")
    info = tmp_path / "acme-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: acme\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[lingjing.std]\nacme = acme_types\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "acme_types", raising=False)
    return package


def test_a_mission_can_use_the_types_of_a_plugin(acme: Path, small: str) -> None:
    (acme / "boats.ljs").write_text(
        "ljs 1\nasset catamaran {\n  engine = vessel\n  speed = 9 m/s\n  sail = 12 m^2\n"
        "  verb moveTo(x: length, y: length)\n}\n"
    )
    text = small.replace("use std.air", "use acme.boats { catamaran }\nuse std.air").replace(
        ": lifeboat {", ": catamaran {"
    )
    compilation = compile_text(text)
    assert compilation.diagnostics == ()
    assert compilation.mission is not None
    boat = next(group for group in compilation.mission.groups if group.name == "boat")
    assert {prop.name: prop.inherited for prop in boat.properties}["sail_m2"]


def test_a_faulty_library_is_reported_where_it_is_used(acme: Path, small: str) -> None:
    (acme / "boats.ljs").write_text("ljs 1\nasset catamaran {\n  engine = vessel\n  speed = 9 m/\n}\n")
    (diagnostic,) = compile_text(small.replace("use std.air", "use acme.boats\nuse std.air")).diagnostics
    assert (diagnostic.code, diagnostic.span.line) == ("LJ0119", 2)
    assert diagnostic.related[0].span.path.endswith("boats.ljs")


def test_libraries_that_use_each_other_are_an_error(acme: Path, small: str) -> None:
    (acme / "one.ljs").write_text("ljs 1\nuse acme.two\n")
    (acme / "two.ljs").write_text("ljs 1\nuse acme.one\n")
    (diagnostic,) = compile_text(small.replace("use std.air", "use acme.one\nuse std.air")).diagnostics
    assert diagnostic.code == "LJ0119"


def test_a_change_of_a_library_reaches_those_that_use_it_through_another(tmp_path: Path) -> None:
    (tmp_path / "one.ljs").write_text("ljs 2\nuse std.air { quadrotor }\nasset small : quadrotor { }\n")
    (tmp_path / "two.ljs").write_text("ljs 2\nuse .one { small }\nasset tiny : small { }\n")
    mission = tmp_path / "three.ljs"
    mission.write_text("ljs 2\nuse .two { tiny }\nasset own : tiny { }\n")
    assert compile_file(str(mission)).diagnostics == ()
    (tmp_path / "one.ljs").write_text("ljs 2\nuse std.air { quadrotor }\nasset other : quadrotor { }\n")
    assert [each.code for each in compile_file(str(mission)).diagnostics] == ["LJ0119"]
    (tmp_path / "one.ljs").unlink()
    assert [each.code for each in compile_file(str(mission)).diagnostics] == ["LJ0119"]


def test_a_type_that_is_not_imported_is_named(small: str) -> None:
    (diagnostic,) = compile_text(small.replace("use std.sea { lifeboat, person", "use std.sea { person")).diagnostics
    assert diagnostic.hint == "add it: `use std.sea { lifeboat }`"


def test_a_missing_library_causes_no_further_errors(small: str) -> None:
    diagnostics = compile_text(small.replace("use std.sea {", "use nowhere.sea {")).diagnostics
    assert [(item.code, item.span.line) for item in diagnostics] == [("LJ0118", 3)]


def test_two_packages_with_one_name_are_an_error(acme: Path, small: str) -> None:
    other = acme.parent / "other-1.0.dist-info"
    other.mkdir()
    (other / "METADATA").write_text("Metadata-Version: 2.1\nName: other\nVersion: 1.0\n")
    (other / "entry_points.txt").write_text("[lingjing.std]\nacme = other_types\n")
    with pytest.raises(PluginError, match="`acme_types` and `other_types`"):
        compile_text(small.replace("use std.air", "use acme.boats\nuse std.air"))


def test_no_path_leads_out_of_the_library() -> None:
    for path in ("std...ssr", "..ssr", "...ssr"):
        diagnostics = compile_text(f"ljs 1\nuse {path}\nrecord a : other {{ }}\n").diagnostics
        assert "LJ0010" in {item.code for item in diagnostics}
