"""Maps with planted faults: each is built or rejected with an error, and none causes an exception of our code."""

from collections import Counter
from pathlib import Path

import pytest

from lingjing.errors import ExitCode, UsageError
from lingjing.scene.city import City
from lingjing.scene.osm import build as building
from lingjing.scene.osm.build import Options
from lingjing.scene.osm.frame import choose
from lingjing.scene.osm.read import read
from lingjing.scene.osm.streets import streets
from lingjing.testing import run_command
from tests.scene.map_mutations import mutated


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))


@pytest.mark.parametrize("count", [150, pytest.param(2000, marks=pytest.mark.thorough)])
def test_maps_with_faults_are_built_or_refused(count: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """All steps except netconvert, a slow separate program; its input is written."""

    def unconverted(data, features):  # type: ignore[no-untyped-def]
        streets(data, features)
        return "", (), (), []

    monkeypatch.setattr(building, "_network", unconverted)
    ends: Counter[str] = Counter()
    for seed in range(count):
        path = mutated(seed, tmp_path)
        try:
            built = _assembled(path)
        except UsageError as error:
            assert str(path) in str(error) or "map" in str(error) or " km " in str(error), error
            assert error.hint, error
            ends["refused"] += 1
        except Exception as error:
            raise AssertionError(f"the map of seed {seed}") from error
        else:
            assert built.attribution
            ends["built"] += 1
        path.unlink()
    assert min(ends["refused"], ends["built"]) > count / 4, ends  # a fault common to all maps would prove nothing


def _assembled(path: Path) -> City:
    data = read(path)
    return building._assemble(path, data, choose(data, None), Options(), lambda phase: None)[1]


@pytest.mark.slow
def test_no_map_causes_a_traceback_on_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for seed in range(60):
        path = mutated(seed, tmp_path)
        code = run_command(["scene", "build", str(path), "-o", str(tmp_path / f"city-{seed}")])
        output = capsys.readouterr()
        assert code in (ExitCode.OK, ExitCode.USAGE), (seed, code, output.err)
        assert "Traceback" not in output.err
        assert (tmp_path / f"city-{seed}").exists() == (code == ExitCode.OK)
