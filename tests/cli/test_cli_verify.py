"""`lingjing verify` and `run --sign`: lines, JSON and exit codes."""

import json
from pathlib import Path

import pytest

from lingjing.errors import ExitCode
from lingjing.testing import run_command, sea_rescue


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("whole") / "trace.mcap"
    sea_rescue.write_episode(path, ticks=3, width=32, height=18)
    return path


def test_a_good_trace_gives_one_line(whole: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["verify", str(whole)]) == ExitCode.OK
    assert capsys.readouterr().out == f"{whole}: ok: 4 boundaries, 3 pictures, budget; sealed, not signed\n"


def test_each_file_is_reported_and_the_worst_one_decides_the_exit_code(
    whole: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "no.mcap").write_text("no trace")
    (tmp_path / "empty.mcap").touch()
    broken = bytearray(whole.read_bytes())
    broken[len(broken) // 2] ^= 4
    (tmp_path / "broken.mcap").write_bytes(broken)
    files = [tmp_path / name for name in ("no.mcap", "empty.mcap", "missing.mcap")]
    assert run_command(["verify", str(whole), *map(str, files)]) == ExitCode.USAGE
    lines = capsys.readouterr().out.splitlines()
    assert [line.split(": ")[1] for line in lines] == ["ok", "unreadable", "unreadable", "unreadable"]
    assert run_command(["verify", *map(str, files), str(tmp_path / "broken.mcap")]) == ExitCode.MISSION
    assert ": wrong: " in capsys.readouterr().out


def test_json_is_a_list(whole: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["verify", "--output-format", "json", str(whole)]) == ExitCode.OK
    (entry,) = json.loads(capsys.readouterr().out)
    assert entry["state"] == "ok" and entry["path"] == str(whole) and entry["signature"] == "none"


def test_a_missing_key_file_is_refused(whole: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["verify", "--key", str(tmp_path / "k"), str(whole)]) == ExitCode.USAGE
    assert "cannot read the key file" in capsys.readouterr().err


def test_a_run_is_signed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    key, out = tmp_path / "trace.key", tmp_path / "out"
    key.write_text("0123456789abcdef0123456789abcdef\n")
    mission = Path(__file__).with_name("boats.ljs")
    call = ["run", str(mission), "--policy", "random", "--no-overview", "-o", str(out)]
    options = tmp_path / "options.json"
    options.write_text(json.dumps({"blank_pictures": True, "sign": str(key)}))
    assert run_command([*call, "--options", str(options)]) == ExitCode.OK
    capsys.readouterr()
    assert run_command(["verify", "--key", str(key), str(out / "trace.mcap")]) == ExitCode.OK
    assert "signed with this key" in capsys.readouterr().out
    key.write_text("another key, as long as it must be")
    assert run_command(["verify", "--key", str(key), str(out / "trace.mcap")]) == ExitCode.MISSION
    assert "the header: it is not signed with this key" in capsys.readouterr().out
