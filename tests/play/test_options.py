"""The options of an episode: one value for the command line, Python, workers and studies; every fault is reported."""

from __future__ import annotations

from pathlib import Path

import msgspec
import pytest

import lingjing
from lingjing import PlayOptions, Session
from lingjing.errors import ExitCode, UsageError
from lingjing.play.options import Changes, checked_options, options_of, read_options
from lingjing.plugins.engine import EnginePlugin
from lingjing.plugins.hookspecs import hookimpl
from lingjing.plugins.options import PluginOptions
from lingjing.testing import PluginHost, run_command
from tests.play.test_policy_processes import write_mission

EXAMPLE = Path(__file__).parents[2] / "scenarios" / "ssr.ljs"


def test_python_takes_every_option_but_the_mission_by_name() -> None:
    assert set(Changes.__annotations__) | {"mission"} == set(PlayOptions.__struct_fields__)


def test_options_round_trip_through_json() -> None:
    whole = PlayOptions(
        mission="ssr", policy="oracle", policies_for={"rescuer": "random"}, policy_args={"k": "v"}, seed=5,
        policy_seed=6, mode="star", settings={"uavs": 2.0}, world="inline", blank_pictures=True, overview=False,
    )  # fmt: skip
    assert checked_options(read_options(msgspec.json.encode(whole), "o.json")) == whole


def test_policies_given_as_objects_have_names_in_the_options() -> None:
    def maker(number: int) -> type:
        return type("Mine", (), {"number": number, "__qualname__": "Mine"})

    first, second = maker(1), maker(2)
    options, mission, made = options_of(
        EXAMPLE, {"policy": first, "policies_for": {"rescuer": second, "searcher": first}}
    )
    assert mission.name == "ssr"
    assert {options.policy, *options.policies_for.values()} == set(made) and len(made) == 2
    assert made[options.policy].factory is made[options.policies_for["searcher"]].factory is first
    assert made[options.policies_for["rescuer"]].factory is second
    assert {plugin.name for plugin in made.values()} == {"Mine"}


@pytest.mark.parametrize("name", ["policies_for", "policy_args", "engine_args", "settings"])
def test_an_option_that_must_be_a_mapping_rejects_other_values(name: str) -> None:
    with pytest.raises(UsageError, match=f"{name}: an object is due, this is the number 3"):
        lingjing.run(EXAMPLE, **{name: 3})


class Link(PluginOptions):
    host: str


def test_an_engine_that_lacks_a_required_option_is_refused_before_the_episode(tmp_path: Path) -> None:
    class Engines:
        @hookimpl
        def lingjing_engines(self) -> list[EnginePlugin]:
            return [EnginePlugin(name="far", factory=object, options=Link, wanted=lambda instance: True)]

    due = "engine `far`: option `host` is missing"
    with Session(PluginHost(extra=[Engines()])) as session, pytest.raises(UsageError, match=due):
        session.run(EXAMPLE, out=tmp_path / "run", world="inline")
    assert not (tmp_path / "run").exists()


def test_all_faults_of_an_options_file_are_reported() -> None:
    with pytest.raises(UsageError) as caught:
        read_options(b'{"seed": -4, "polcy": "x", "world": "moon", "settings": {"uavs": "two"}}', "o.json")
    assert str(caught.value).splitlines() == [
        "o.json: seed: at least 0 is due, this is -4",
        "o.json: settings.uavs: a number is due, this is the text 'two'",
        "o.json: world: inline or process is due, this is the text 'moon'",
        "o.json: there is no field 'polcy'; did you mean 'policy'?",
    ]
    with pytest.raises(UsageError, match="an object is due, this is a list"):
        read_options(b"[]", "o.json")
    with pytest.raises(UsageError, match="is not JSON"):
        read_options(b"{", "o.json")


def test_all_faults_of_the_command_line_are_reported(capsys: pytest.CaptureFixture[str]) -> None:
    wrong = ["--policy-for", "x", "--seed", "z", "--set", "a", "--set", "b", "--jobs", "0", "--policy-seed", "-1"]
    assert run_command(["run", "ssrx", *wrong]) == ExitCode.USAGE
    errors = capsys.readouterr().err
    assert errors.startswith("error: -j 0")
    for fault in ("there is no mission `ssrx`", "--policy-for x", "--set a:", "--set b:", "`z` is not a seed"):
        assert fault in errors


def test_the_command_line_overrides_an_options_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "o.json"
    file.write_text('{"mission": "ssr", "mode": "single", "seed": 3}')
    assert run_command(["run", "--options", str(file)]) == ExitCode.USAGE
    assert "single" in capsys.readouterr().err
    assert run_command(["run", "--options", str(file), "--mode", "star", "--policy", "nobody"]) == ExitCode.USAGE
    assert "no policy is called `nobody`" in capsys.readouterr().err
    assert run_command(["run"]) == ExitCode.USAGE
    assert "no mission is named" in capsys.readouterr().err


def test_every_unknown_role_is_named() -> None:
    with pytest.raises(UsageError, match="no role or agent is called `cook` or `poet` in broadcast mode"):
        lingjing.run(EXAMPLE, policies_for={"cook": "random", "poet": "random"}, mode="broadcast", world="inline")


FIVE_LAYERS = (
    "'ssr' has no mode 'mesh'; choose one of star, broadcast",
    "uavs = 99 is outside of its range 1..10",
    "'ssr' has no parameter 'foo'",
    "engine `camera`: option `quality` is '900', at most 100 is due",
    "engines: option `camra.quality` names no installed engine and one of its options; did you mean `camera`?",
    "policy `heuristic`: option `hallo` is not known",
    "no role or agent is called `cook` in 'ssr'",
    "no evaluator is called `judge`",
)
"""The message about each option in `WRONG`, from the check that fails."""

WRONG = {
    "mode": "mesh",
    "settings": {"uavs": 99, "foo": 1},
    "engine_args": {"camera.quality": "900", "camra.quality": "3"},
    "policies_for": {"cook": "random"},
    "policy_args": {"hallo": "1"},
    "evaluators": ["judge"],
}


def test_python_reports_the_faults_of_every_layer(tmp_path: Path) -> None:
    with pytest.raises(UsageError) as caught:
        lingjing.run(EXAMPLE, out=tmp_path / "run", seed=-1, **WRONG)
    lines = str(caught.value).splitlines()
    assert len(lines) == len(FIVE_LAYERS) + 1 and lines[0] == "seed: at least 0 is due, this is -1"
    for fault in FIVE_LAYERS:
        assert any(fault in line for line in lines), fault
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("from_file", [True, False])
def test_the_command_line_reports_the_faults_of_every_layer(
    from_file: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "o.json"
    file.write_bytes(msgspec.json.encode({**WRONG, "sede": 3} if from_file else {"sede": 3}))
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "trace.mcap").touch()
    words = ["--mode", "mesh", "--set", "uavs=99", "--set", "foo=1", "--engine-arg", "camera.quality=900"]
    words += ["--engine-arg", "camra.quality=3", "--policy-for", "cook=random", "--policy-arg", "hallo=1"]
    words = [] if from_file else [*words, "--evaluator", "judge"]
    common = ["--options", str(file), "-j", "none", "--world", "moon", "-o", str(tmp_path / "full")]
    assert run_command(["run", str(EXAMPLE), *common, *words]) == ExitCode.USAGE
    errors = capsys.readouterr().err
    others = (
        "there is no field 'sede'; did you mean 'seed'?",
        "-j none: must be a whole number",
        "world: ",
        "is not empty",
    )
    for fault in (*FIVE_LAYERS, *others):
        assert fault in errors
    assert len(errors.splitlines()) == len(FIVE_LAYERS) + len(others) + 1  # the last is the one hint for all options


def test_a_faulty_mission_does_not_hide_the_faults_of_options(tmp_path: Path) -> None:
    mission = tmp_path / "m.ljs"
    mission.write_text("ljs 1\nmission m { goal 3 }\n")
    with pytest.raises(UsageError) as caught:
        lingjing.run(mission, policy="nobody", evaluators=["judge"])
    for fault in ("goal", "no policy is called `nobody`", "no evaluator is called `judge`"):
        assert fault in str(caught.value)


def test_faults_that_follow_from_another_fault_are_not_reported(tmp_path: Path) -> None:
    """The role may exist in the intended mode, and the option may belong to the intended policy."""
    with pytest.raises(UsageError) as caught:
        lingjing.run(EXAMPLE, mode="sta", policies_for={"coordinator": "random"}, policy="nobody", policy_args={"a": 1})
    lines = str(caught.value).splitlines()
    assert len(lines) == 2
    assert "no mode 'sta'" in lines[0] and "no policy is called `nobody`" in lines[1]


def test_swapped_pictures_do_not_change_the_digest(tmp_path: Path) -> None:
    """The second world plays the neighbouring seed beside it, and ends with it."""
    mission = write_mission(tmp_path, 1, 2, 600.0)
    digests = []
    for swap in (False, True):
        report = lingjing.run(
            mission, policy="idle", seed=2, swap_pictures=swap, overview=False, world="inline", out=tmp_path / f"{swap}"
        )
        digests.append((report.digest, report.ticks))
    assert digests[0] == digests[1]
