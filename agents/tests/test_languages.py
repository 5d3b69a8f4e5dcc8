"""The texts of requests in the languages of missions: complete, with the same names and numbers, in one contract."""

import ast
import json
import re
from collections import Counter
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path
from string import Formatter

import msgspec
import pytest
from lingjing_agents.react.facts import goal_text, interface, rules
from lingjing_agents.react.prompt_files import prompt_text, shipped
from lingjing_agents.react.step import StepFormat

import lingjing
from agents.tests.agent_kit import observe, react
from agents.tests.chat_server import Reply, serve
from agents.tests.test_react_request import COLUMNS, briefs_of
from lingjing import testing
from lingjing.plugins.decisions import prompt_schema
from lingjing.plugins.languages import Phrases
from lingjing.plugins.policy import Brief, Inbox
from lingjing.testing import mission_file

LANGUAGES = ("zh",)
CHINESE = re.compile(r"[\u4e00-\u9fff]")
PACKAGES = ("lingjing.kernel", "lingjing.mission", "lingjing.plugins", "lingjing_agents.react")
HOLE = re.compile(r"\{[^{}]*\}")
_NUMBER = re.compile(r"(?<![A-Za-z0-9_.])-?\d+(?:\.\d+)?")


def briefs(column: str, language: str, tier: int) -> Iterator[Brief]:
    """Yield the brief of each agent of a column."""
    name, _, mode = column.partition("-")
    mission = lingjing.compile(mission_file(name))
    instance = testing.instantiate(mission, seed=1, mode=mode, tier=tier, language=language)
    return briefs_of(instance)


def catalogue(package: str, language: str) -> dict[str, str]:
    texts: dict[str, str] = json.loads((files(package) / f"phrases.{language}.json").read_text(encoding="utf-8"))
    return texts


@pytest.mark.parametrize("column", sorted({column.partition("-")[0] for column in COLUMNS}))
def test_goals_and_prompts_have_the_same_placeholders_and_numbers_in_all_languages(column: str) -> None:
    mission = lingjing.compile(mission_file(column))
    assert tuple(mission.goals) == LANGUAGES
    texts = [(mission.goal, mission.goals), *((agent.prompt, agent.prompts) for agent in mission.agents)]
    for english, others in texts:
        assert tuple(others) == LANGUAGES
        for text in others.values():
            assert CHINESE.search(text)
            assert Counter(HOLE.findall(text)) == Counter(HOLE.findall(english))
            plain, original = HOLE.sub("", text), HOLE.sub("", english)
            assert Counter(_NUMBER.findall(plain)) == Counter(_NUMBER.findall(original))
            assert set(re.findall(r"`[^`]+`", plain)) == set(re.findall(r"`[^`]+`", original)), "names stay as they are"


@pytest.mark.parametrize("tier", [0, 1])
@pytest.mark.parametrize("column", COLUMNS)
def test_requests_in_another_language_are_complete_with_the_same_numbers_and_schema(
    column: str, tier: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    absent: set[str] = set()
    read = Phrases.text

    def noted(self: Phrases, english: str) -> str:
        if self.language != "en" and english not in self._catalogue:  # a missing entry is invisible otherwise
            absent.add(english)
        return read(self, english)

    monkeypatch.setattr(Phrases, "text", noted)
    for language in LANGUAGES:
        for english, other in zip(briefs(column, "en", tier), briefs(column, language, tier), strict=True):
            assert (other.language, other.rules) == (language, english.rules), "programs read English rules"
            assert len(other.local_rules) == len(english.rules) and len(other.local_failures) == len(english.failures)
            for mine, theirs in zip(other.local_rules, english.rules, strict=True):
                assert CHINESE.search(mine)
                assert Counter(_NUMBER.findall(mine)) == Counter(_NUMBER.findall(theirs)), theirs
                assert set(re.findall(r"`[^`]+`", mine)) == set(re.findall(r"`[^`]+`", theirs)), theirs
            for text in (goal_text, rules, interface):
                assert Counter(_NUMBER.findall(text(other))) == Counter(_NUMBER.findall(text(english)))
            assert schema_of(other) == schema_of(english), "answers stay in one contract"
    assert absent == set()


def schema_of(brief: Brief) -> object:
    return prompt_schema(StepFormat(brief, memory=True, crops=False).schema)


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("package", PACKAGES)
def test_a_catalogue_has_the_placeholders_of_the_english_texts(package: str, language: str) -> None:
    for english, text in catalogue(package, language).items():
        due, present = (
            sorted((name or "", spec or "") for _, name, spec, _ in Formatter().parse(each) if name is not None)
            for each in (english, text)
        )
        assert present == due, english


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("package", PACKAGES)
def test_every_text_that_a_package_writes_is_in_its_catalogue(package: str, language: str) -> None:
    modules = [Path(str(file)) for file in files(package).iterdir() if file.name.endswith(".py")]
    written = {text for file in sorted(modules) for text in _written(file)}
    assert written or package == "lingjing.mission", "the texts are found by the name of the function"
    assert sorted(written - catalogue(package, language).keys()) == []


def _written(file: Path) -> Iterator[str]:
    """Yield the literal texts that a module passes to a function called `say`."""
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Call) and node.args and re.search(r"\b_?say(\.text)?$", ast.unparse(node.func)):
            first = node.args[0]
            for part in (first.body, first.orelse) if isinstance(first, ast.IfExp) else (first,):
                if isinstance(part, ast.Constant) and isinstance(part.value, str):
                    yield part.value


@pytest.mark.parametrize("language", LANGUAGES)
def test_shipped_prompts_have_the_same_holes_and_names_in_all_languages(language: str) -> None:
    assert shipped() == ("P0", "P1")
    for name in shipped():
        english, other = prompt_text(name).text, prompt_text(name, language).text
        holes = re.compile(r"\$\w+")
        assert Counter(holes.findall(other)) == Counter(holes.findall(english))
        assert set(re.findall(r"`[^`$]+`", other)) == set(re.findall(r"`[^`$]+`", english))
        assert set(re.findall(r'"\w+"', other)) == set(re.findall(r'"\w+"', english))


async def test_a_chinese_request_has_chinese_texts_and_a_chinese_answer_is_read() -> None:
    (brief,) = briefs("bi-single", "zh", 1)
    answer = json.dumps({"thought": "先看桥面", "command": None, "messages": []}, ensure_ascii=False)
    with serve([Reply(answer)]) as server:
        policy = react(model="stub", base_url=server.url, encoding="paper")
        await policy.reset(brief)
        decision = await policy.act(observe(brief.agent, 0), Inbox())
    assert decision.thought == "先看桥面"
    system = server.requests[0]["messages"][0]["content"]
    assert "沿桥从陆地" in system and "你可以下达的指令" in system and "Find every" not in system


def test_the_request_only_player_rejects_a_language_that_it_cannot_read() -> None:
    with pytest.raises(lingjing.LingjingError, match="reads requests in `en` alone"):
        lingjing.run("bi", policy="reader", language="zh", seed=1, overview=False)


def test_a_language_that_a_mission_lacks_is_reported_in_one_message() -> None:
    with pytest.raises(lingjing.UsageError, match="mission 'queue' has no texts in 'zh'") as failed:
        testing.instantiate(lingjing.compile(mission_file("queue")), seed=1, language="zh")
    assert "`goal zh" in failed.value.faults[0].hint
    mission = lingjing.compile(mission_file("ssr"))
    agents = tuple(msgspec.structs.replace(agent, prompts={"fr": "Cherche."}) for agent in mission.agents)
    french = msgspec.structs.replace(mission, goals={"fr": "Trouver chaque personne."}, agents=agents)
    for each in (mission, french):  # texts of a mission do not help where the program writes none
        with pytest.raises(lingjing.UsageError, match="written in en and zh alone") as failed:
            testing.instantiate(each, seed=1, language="fr")
        assert failed.value.faults[0].hint == "play in en or zh"


@pytest.mark.parametrize("code", ["ZH", "zh-CN", "zh_CN.UTF-8", " zh"])
def test_other_spellings_of_a_language_code_suggest_the_code(code: str) -> None:
    with pytest.raises(lingjing.UsageError) as failed:
        testing.instantiate(lingjing.compile(mission_file("ssr")), seed=1, language=code)
    assert failed.value.faults[0].hint == "did you mean `zh`?"


@pytest.mark.parametrize("line", [["bench", "main-lite", "--check"], ["models", "check", "gpt-5.4"]])
def test_an_unsupported_language_is_rejected_once_for_all_missions(
    line: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert testing.run_command([*line, "--language", "fr"]) == 2
    assert capsys.readouterr().err.count("written in en and zh alone") == 1


@pytest.mark.parametrize("column", COLUMNS)
def test_the_prompts_request_each_report_that_the_rules_read(column: str) -> None:
    read: set[str] = set()
    requested: set[str] = set()
    for brief in briefs(column, "en", 1):
        for message in brief.messages:
            if message.category == "report" and any(f"{message.kind} `" in rule for rule in brief.rules):
                read.add(message.kind)
                if message.is_sent_by(brief.role) and re.search(r"\breports?\b", brief.prompt, re.IGNORECASE):
                    requested.add(message.kind)
    assert requested == read
