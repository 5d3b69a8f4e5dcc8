"""Suite files: their meaning, and every error with its path."""

from __future__ import annotations

from pathlib import Path

import jsonschema
import msgspec
import pytest

from lingjing.bench.planning import SuitePlan, options_of_cell
from lingjing.bench.suite import Suite, find_suite, json_schema, read_document, shipped_suites
from lingjing.errors import ExitCode, UsageError
from lingjing.play.policy_processes.barrier import LOAD_VARIABLE
from lingjing.plugins.chat_model import ModelPlugin
from lingjing.plugins.hookspecs import hookimpl
from lingjing.processes.descendants import children
from lingjing.testing import PluginHost, run_command
from tests.bench.suite_kit import SMALL, read_plan


class Models:
    """A plug-in with one model of the policy `scripted`."""

    @hookimpl
    def lingjing_models(self):
        return (ModelPlugin("large-1", "scripted", {"script": "x.json"}, "commercial", 1.0, 2.0),)


@pytest.fixture(scope="module")
def host() -> PluginHost:
    return PluginHost(extra=(Models(),))


def planned(text: str, folder: Path, host: PluginHost, **how: object) -> SuitePlan:
    file = folder / "suite.toml"
    file.write_text(text)
    return read_plan(file, host, **how)  # type: ignore[arg-type]


def faults(text: str, folder: Path, host: PluginHost) -> list[str]:
    with pytest.raises(UsageError) as error:
        planned(text, folder, host)
    lines = str(error.value).splitlines()
    assert all(line.startswith(f"{folder / 'suite.toml'}: ") for line in lines)
    return [line.removeprefix(f"{folder / 'suite.toml'}: ") for line in lines]


def test_the_cells_of_a_suite_are_its_entrants_times_its_columns(tmp_path: Path, host: PluginHost) -> None:
    plan = planned(SMALL, tmp_path, host)
    assert [(cell.player.name, cell.column.name) for cell in plan.cells] == [
        ("oracle", "bi-single-tier1"), ("random", "bi-single-tier1"), ("oracle", "cd-star-tier1"),
        ("random", "cd-star-tier1"), ("oracle", "cd-broadcast-tier1"), ("random", "cd-broadcast-tier1"),
    ]  # fmt: skip
    assert plan.suite.seeds == (0, 1)


def test_a_suite_may_name_its_columns(tmp_path: Path, host: PluginHost) -> None:
    plan = planned(SMALL.replace("seeds = 2", 'seeds = 2\ncolumns = ["cd-star"]'), tmp_path, host)
    assert [(cell.player.name, cell.column.name) for cell in plan.cells] == [
        ("oracle", "cd-star-tier1"), ("random", "cd-star-tier1")
    ]  # fmt: skip
    (line,) = faults(SMALL.replace("seeds = 2", 'seeds = 2\ncolumns = ["cd-star", "bi-star"]'), tmp_path, host)
    assert line.startswith("columns[1]: no mission of the suite has the column `bi-star`; did you mean `cd-star`?")


def test_a_suite_plays_tier_1_where_a_mission_has_it_and_another_tier_on_request(
    tmp_path: Path, host: PluginHost
) -> None:
    mixed = SMALL.replace('"cd"]', '"queue"]')
    usual = planned(mixed, tmp_path, host)
    assert {cell.column.mission: cell.column.tier for cell in usual.cells} == {"bi": 1, "queue": 0}
    assert {options_of_cell(cell, 0, 0, ("mission",)).tier for cell in usual.cells} == {0, 1}
    for plan in (planned(mixed.replace("seeds = 2", "seeds = 2\ntier = 0"), tmp_path, host),
                 planned(mixed, tmp_path, host, tier=0)):  # fmt: skip
        assert {cell.column.name for cell in plan.cells} == {"bi-single", "queue-broadcast", "queue-star"}
        assert {options_of_cell(cell, 0, 0, ("mission",)).tier for cell in plan.cells} == {0}


@pytest.mark.parametrize(
    ("line", "fault"),
    [
        ("tier = 1", "tier: `queue` declares no tier 1; its tiers: 0; leave `tier` out to play each mission at its"),
        ("tier = 2", "tier: `bi` declares no tier 2; its tiers: 0, 1; leave"),
        ("tier = 9", "tier: is 9, at most 3 is due"),
    ],
)
def test_a_tier_that_a_mission_lacks_is_an_error(tmp_path: Path, host: PluginHost, line: str, fault: str) -> None:
    lines = faults(SMALL.replace('"cd"]', '"queue"]').replace("seeds = 2", f"seeds = 2\n{line}"), tmp_path, host)
    assert any(each.startswith(fault) for each in lines), lines


def test_five_errors_are_reported_on_five_lines_with_their_paths(tmp_path: Path, host: PluginHost) -> None:
    text = SMALL.replace('"cd"]', '"cdd"]').replace("seeds = 2", 'seeds = "5-2"').replace('"random"', '"randam"')
    text = text.replace('"modes"]', '"mode"]') + '\n[[conditions]]\nname = "x"\nmodes = ["broadcats"]\n'
    lines = faults(text, tmp_path, host)
    assert sorted(line.partition(":")[0] for line in lines) == [
        "conditions[0].modes[0]", "entrants[1].policy", "missions[1]", "seeds", "tables[1]",
    ]  # fmt: skip
    assert "entrants[1].policy: no policy is called `randam`; did you mean `random`?" in lines
    assert "missions[1]: there is no mission `cdd`; did you mean `cd`?" in lines


def test_an_error_does_not_hide_other_errors(tmp_path: Path, host: PluginHost) -> None:
    """No seeds, an entrant that plays nowhere, a condition without entrants, one in no mode and two without
    a name: the errors of their options are reported too."""
    text = (
        SMALL.replace("seeds = 2\n", "args = { skript = 1 }\n")
        + """
[[entrants]]
name = "s"
policy = "scripted"
args = { script = 3 }
[[conditions]]
name = "a"
entrants = ["orakle"]
args = { memory = 3 }
[[conditions]]
name = "b"
modes = ["broadcats"]
args = { script = true }
[[conditions]]
name = "c"
missions = ["cd"]
settings = { points = 99 }
args = { scrip = "" }
[[conditions]]
missions = ["cd"]
settings = { point = 5, points = "6 kg", vans = 99 }
[[conditions]]
baseline = 3
args = { memory = 4 }
"""
    )
    assert sorted(line.partition(":")[0] for line in faults(text, tmp_path, host)) == [
        "args.skript", "conditions[0].args.memory", "conditions[0].entrants[0]", "conditions[1].args.script",
        "conditions[1].modes[0]", "conditions[2].args.scrip", "conditions[2].settings.points",
        "conditions[3].name", "conditions[3].settings.point", "conditions[3].settings.points",
        "conditions[3].settings.vans", "conditions[4].args.memory", "conditions[4].baseline",
        "conditions[4].name",
        "entrants[2].args.script", "seeds",
    ]  # fmt: skip


def test_an_invalid_suite_name_is_reported_with_the_valid_pattern(tmp_path: Path, host: PluginHost) -> None:
    (line,) = faults(SMALL.replace('name = "small"', 'name = "../Small"'), tmp_path, host)
    assert line == "name: is '../Small', a text that matches ^[a-z0-9][a-z0-9-]{0,39}$ is due"


def test_an_option_is_not_reported_as_unknown_if_an_entrant_is_unknown(tmp_path: Path, host: PluginHost) -> None:
    text = SMALL.replace('"random"', '"randam"').replace("seeds = 2\n", "seeds = 2\nargs = { script = 1 }\n")
    assert [line.partition(":")[0] for line in faults(text, tmp_path, host)] == ["entrants[1].policy"]


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ('[[entrants]]\nmodel = "large-2"', "entrants[2].model: there is no model `large-2`; did you mean `large-1`?"),
        ('[[entrants]]\nmodel = "large-1"\npolicy = "oracle"', "entrants[2]: is a model or a policy"),
        ('[[entrants]]\npolicy = "oracle"', "entrants[2].name: `oracle` is listed twice; give each a different name"),
        ('[[entrants]]\npolcy = "x"', "entrants[2].polcy: is not known; did you mean `policy`?"),
        (
            '[[entrants]]\nname = "s"\npolicy = "scripted"\nargs = { script = "a.json", skript = 3 }',
            "entrants[2].args.skript: is not known; did you mean `script`?",
        ),
        (
            '[[conditions]]\nname = "c"\nmissions = ["ssr"]',
            "conditions[0].missions[0]: `ssr` is not a mission of the suite; known missions: bi, cd",
        ),
        (
            '[[conditions]]\nname = "c"\nmissions = ["bi"]\nmodes = ["star"]',
            "conditions[0].modes[0]: none of bi is played in mode `star`; they have: single",
        ),
        (
            '[[conditions]]\nname = "c"\nmissions = ["cd"]\nsettings = { point = 5 }',
            "conditions[0].settings.point: mission 'cd' has no parameter 'point'; did you mean 'points'?",
        ),
        (
            '[[conditions]]\nname = "c"\nmissions = ["bi"]\nsettings = { altitude = "60 kg" }',
            "conditions[0].settings.altitude: mass where length is due",
        ),
        (
            '[[conditions]]\nname = "c"\nmissions = ["cd"]\nsettings = { points = "6 kg" }',
            "conditions[0].settings.points: mass where number is due",
        ),
        (
            '[[conditions]]\nname = "c"\nmissions = ["cd"]\nsettings = { points = 99 }',
            "conditions[0].settings.points: points = 99 is outside of its range 1..40",
        ),
        (
            '[[conditions]]\nname = "c"\nentrants = ["orakle"]',
            "conditions[0].entrants[0]: there is no entrant `orakle`; did you mean `oracle`?",
        ),
        ('[[conditions]]\nname = "c"\nargs = { memory = 3 }', "conditions[0].args.memory: is not known"),
        (
            '[[conditions]]\nname = "c"\n[[conditions]]\nname = "c"\nmissions = ["bi"]',
            "conditions[1].name: `c` is the name of another condition in bi, single",
        ),
    ],
)
def test_an_error_in_an_entrant_or_a_condition_is_one_line_with_its_path(
    wrong: str, message: str, tmp_path: Path, host: PluginHost
) -> None:
    lines = faults(f"{SMALL}\n{wrong}\n", tmp_path, host)
    assert len(lines) == 1
    assert lines[0].startswith(message)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("suite = 1", "suite = 2", "suite: is 2; this version of lingjing reads suites of form 1"),
        ("suite = 1", "", "suite: is missing"),
        ('name = "small"', 'name = "../x"', "name: "),
        ("seeds = 2", "seeds = 0", "seeds: is 0, which is neither a number of seeds"),
        ("seeds = 2", "seeds = true", "seeds: is yes, which is neither a number of seeds"),
        ("seeds = 2", "seeds = [1, -1]", "seeds: is a list, which is neither a number of seeds"),
        ("seeds = 2", 'seeds = "0"', "seeds: is '0', which is neither a number of seeds"),
        ("seeds = 2", 'seeds = "100001"', "seeds: is '100001', which is neither a number of seeds"),
        ("seeds = 2", 'seeds = "0-100000"', "seeds: is '0-100000', which is neither a number of seeds"),
        ("seeds = 2", 'seeds = "1-2-3"', "seeds: is '1-2-3', which is neither a number of seeds"),
        ("seeds = 2", f'seeds = "{"9" * 5000}"', "seeds: is a long text, which is neither a number of seeds"),
        ("seeds = 2", 'seeds = 2\nmodes = ["star"]\nevaluators = ["mision"]', "evaluators[0]: there is no evaluator"),
        ('["bi", "cd"]', '["bi"]\nmodes = ["star"]', "modes[0]: none of bi is played in mode `star`"),
        ('["bi", "cd"]', '["bi", "bi"]', "missions[1]: `bi` is listed twice"),
    ],
)
def test_an_error_in_the_head_of_a_suite_is_one_line_with_its_path(
    old: str, new: str, message: str, tmp_path: Path, host: PluginHost
) -> None:
    lines = faults(SMALL.replace(old, new), tmp_path, host)
    assert len(lines) == 1
    assert lines[0].startswith(message)


def test_an_unsupported_form_number_does_not_hide_other_errors(tmp_path: Path, host: PluginHost) -> None:
    text = SMALL.replace("suite = 1", "suite = 2").replace("seeds = 2", "seeds = 0").replace('"random"', '"randam"')
    lines = faults(text.replace('["bi", "cd"]', '["bi", "cdd"]'), tmp_path, host)
    assert [line.partition(":")[0] for line in lines] == ["suite", "seeds", "missions[1]", "entrants[1].policy"]
    assert "did you mean `random`?" in lines[3]


@pytest.mark.parametrize(("written", "seeds"), [('" 3 "', (0, 1, 2)), ('"3 - 4"', (3, 4)), ("[4, 4, 1]", (4, 1))])
def test_seeds_are_a_number_a_range_or_a_list(
    written: str, seeds: tuple[int, ...], tmp_path: Path, host: PluginHost
) -> None:
    assert planned(SMALL.replace("seeds = 2", f"seeds = {written}"), tmp_path, host).suite.seeds == seeds


def test_invalid_toml_and_unknown_suites_are_usage_errors(tmp_path: Path, host: PluginHost) -> None:
    with pytest.raises(UsageError, match=r"is not TOML: .*line 1"):
        planned("suite = = 1", tmp_path, host)
    with pytest.raises(UsageError, match="there is no suite `smal`"):
        find_suite("smal")


def test_a_mission_and_a_policy_file_are_read_from_the_folder_of_the_suite(tmp_path: Path, host: PluginHost) -> None:
    (tmp_path / "mine.ljs").write_text("ljs 1\nmission mine {\n")
    (tmp_path / "mine.py").write_text(
        "class Mine:\n    async def reset(self, b): ...\n    async def act(self, o, i): ...\n"
    )
    lines = faults(SMALL.replace('"bi"', '"mine.ljs"'), tmp_path, host)
    assert len(lines) == 1 and lines[0].startswith("missions[0]: `mine.ljs` does not compile: ")
    plan = planned(SMALL.replace('"random"', '"./mine.py:Mine"'), tmp_path, host)
    assert plan.players[1].policy == f"{tmp_path}/mine.py:Mine"
    assert plan.players[1].declared.name == "mine.py:Mine"


def test_arguments_reach_the_policies_that_accept_them_and_conditions_override_entrants(
    tmp_path: Path, host: PluginHost
) -> None:
    text = SMALL + (
        '\n[[entrants]]\nmodel = "large-1"\n[[conditions]]\nname = "a"\nargs = { script = "y.json" }\n'
        '[[conditions]]\nname = "b"\nbaseline = true\nentrants = ["large-1"]\nmissions = ["cd"]\nmodes = ["star"]\n'
        "settings = { points = 5 }\n"
    )
    cells = planned(text, tmp_path, host).cells
    last = next(cell for cell in cells if cell.condition == "b")
    assert (last.player.name, last.player.group, last.args) == ("large-1", "Commercial models", {"script": "x.json"})
    assert len([cell for cell in cells if cell.condition == "b"]) == 1
    first = next(cell for cell in cells if cell.condition == "a" and cell.player.name == "large-1")
    assert first.args == {"script": "y.json"}
    assert all(cell.args == {} for cell in cells if cell.player.name == "oracle")
    options = options_of_cell(last, 7, 11, ("mission",))
    assert (options.policy, options.seed, options.policy_seed, options.settings) == ("scripted", 7, 11, {"points": 5.0})


def test_policies_of_the_command_replace_the_entrants_of_a_suite(tmp_path: Path, host: PluginHost) -> None:
    text = (
        SMALL.replace('policy = "random"', 'model = "nobody-has-this"') + "\n[[conditions]]\nname = 'a'\nargs = {x = 1}"
    )
    plan = planned(text, tmp_path, host, policies=["random"])
    assert [player.name for player in plan.players] == ["random"]


def test_sweeps_give_one_condition_for_each_declared_value(tmp_path: Path, host: PluginHost) -> None:
    plan = planned(SMALL.replace("seeds = 2", "seeds = 2\nsweeps = true"), tmp_path, host)
    assert [cell.condition for cell in plan.cells if cell.player.name == "oracle"] == [
        "points=5", "points=10", "points=15", "points=20",
    ]  # fmt: skip


def test_the_committed_schema_is_current_and_accepts_every_shipped_suite() -> None:
    committed = Path(__file__).parents[2].joinpath("schemas", "suite.schema.json").read_bytes()
    assert committed == json_schema(), "run `python -m lingjing.bench.suite`"
    validator = jsonschema.Draft202012Validator(msgspec.json.decode(committed))
    jsonschema.Draft202012Validator.check_schema(validator.schema)
    for name in shipped_suites():
        validator.validate(read_document(find_suite(name)))
    assert [error.validator for error in validator.iter_errors({**read_document(find_suite("reference")), "x": 1})] == [
        "additionalProperties"
    ]


@pytest.mark.parametrize("name", shipped_suites())
def test_every_shipped_suite_is_valid_and_named_like_its_file(name: str) -> None:
    plan = read_plan(find_suite(name), PluginHost())
    assert plan.suite.name == name
    assert plan.suite.title and plan.suite.about
    assert isinstance(plan.suite, Suite) and len(plan.cells) > 0


DECLARES = """
from pydantic import field_validator
from lingjing.plugins.options import PluginOptions

class Speeds(PluginOptions):
    speed: float = 3.0

    @field_validator("speed")
    @classmethod
    def check(cls, speed):
        import os
        if speed == 13.0:
            os._exit(5)
        return speed

class {name}:
    options = Speeds

    def __init__(self, options): ...
    async def reset(self, brief): ...
    async def act(self, observation, inbox): ...
"""

HARMFUL = {
    "endless": (
        "import time; time.sleep(3600)",
        "policy `{file}` was not loaded within 2 s; correct what its file or its class",
    ),
    "exits": ("import os; os._exit(0)", "policy `{file}` could not be loaded: its process ended (exit code 0)"),
    "closes": ("import os; os.closerange(0, 4096)", "policy `{file}` could not be loaded: its process "),
    "raises": ("raise RuntimeError('on\\npurpose')", "{file}:1: RuntimeError: on"),
    "leaves": ("import sys; sys.exit(0)", "{file}:1: SystemExit: 0"),
    "changes": ("import os; os.chdir('/')\nimport lingjing.bench.planning as p\np.read_plan = None", "does not hold"),
}


def test_a_policy_file_that_harms_its_process_is_reported_as_an_error_of_its_entrant(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each file damages its own process; the suite is read to its end, and no process is left."""
    monkeypatch.setenv(LOAD_VARIABLE, "2")
    monkeypatch.chdir(tmp_path)
    suite = SMALL
    for name, (text, _) in HARMFUL.items():
        (tmp_path / f"{name}.py").write_text(text)
        suite += f'\n[[entrants]]\npolicy = "{name}.py"\n'
    (tmp_path / "last.py").write_text(DECLARES.format(name="Last"))
    for number, speed in enumerate(("13", '"x"', "4")):
        suite += f'\n[[entrants]]\nname = "last {number}"\npolicy = "last.py"\nargs = {{ speed = {speed} }}\n'
    (tmp_path / "suite.toml").write_text(suite)
    known = set(children())
    assert run_command(["bench", "suite.toml", "--check"]) == ExitCode.USAGE
    assert set(children()) == known and Path.cwd() == tmp_path
    lines = capsys.readouterr().err.removeprefix("error: ").splitlines()
    for at, (name, (_, message)) in enumerate(HARMFUL.items(), 2):
        (line,) = [line for line in lines if line.startswith(f"suite.toml: entrants[{at}].policy: ")]
        assert message.format(file=tmp_path / f"{name}.py") in line
    first = 2 + len(HARMFUL)
    assert any(
        line.startswith(f"suite.toml: entrants[{first}]: the check of the options of policy")
        and "could not be finished: its process ended (exit code 5)" in line
        for line in lines
    )
    assert f"suite.toml: entrants[{first + 1}].args.speed: is 'x', a number is due" in lines
    assert not any(f"entrants[{first + 2}]" in line for line in lines)
    assert len(lines) == len(HARMFUL) + 2 + 1  # and a hint


def test_options_of_a_policy_file_are_passed_and_checked_like_others(tmp_path: Path, host: PluginHost) -> None:
    (tmp_path / "mine.py").write_text(DECLARES.format(name="Mine"))
    text = SMALL + '\n[[entrants]]\npolicy = "mine.py"\n[[conditions]]\nname = "fast"\nargs = { speed = 9.0 }\n'
    cells = planned(text, tmp_path, host).cells
    assert {cell.player.name: dict(cell.args) for cell in cells} == {
        "oracle": {}, "random": {}, "mine.py:Mine": {"speed": 9.0},
    }  # fmt: skip
    lines = faults(text.replace("speed = 9.0", "sped = 9.0"), tmp_path, host)
    assert lines == ["conditions[0].args.sped: is not known; did you mean `speed`?"]
