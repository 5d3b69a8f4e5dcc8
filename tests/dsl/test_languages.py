"""Goals and prompts in several languages: `goal zh "…"`, `prompt zh "…"`."""

from pathlib import Path

import pytest

import lingjing
from lingjing.testing import compile_text, compiled, instantiate, run_command

AGENT = "agent skipper as rescuer controls boat { observes boat.*, events }"
GOAL = 'goal "Find everybody."'


def spoken(small: str, goal: str, prompts: str) -> str:
    agent = AGENT.replace("{ observes", f"{{\n    {prompts}\n    observes")
    return small.replace(GOAL, f"{GOAL}\n  {goal}").replace(AGENT, agent)


def test_an_episode_has_the_texts_of_its_language_with_their_holes_filled(small: str) -> None:
    text = spoken(
        small, 'goal zh "找到每一个人，共 {uavs} 架。"', 'prompt "Steer {boat}."\n    prompt zh "操控 {boat}。"'
    )
    text = text.replace("Find everybody.", "Find everybody with {uavs}.")
    mission = compile_text(text).mission
    assert mission is not None
    english, chinese = (instantiate(mission, language=language) for language in ("en", "zh"))
    assert (english.language, english.goal) == ("en", "Find everybody with 2.")
    assert (chinese.language, chinese.goal) == ("zh", "找到每一个人，共 2 架。")
    prompts = [{agent.name: agent.prompt for agent in each.agents}["skipper"] for each in (english, chinese)]
    assert prompts == ["Steer boat.", "操控 boat。"]
    assert english.entities == chinese.entities, "the language decides nothing else"


def test_a_range_in_a_prompt_has_the_words_of_its_language() -> None:
    prompts = [instantiate(compiled("upr"), language=language).agents[0].prompt for language in ("en", "zh")]
    assert ["12 to 60 m" in prompts[0], "12 至 60 m" in prompts[1]] == [True, True]
    assert "{uav.band}" not in prompts[0] + prompts[1] and " to " not in prompts[1]


@pytest.mark.parametrize(
    ("prompts", "message"),
    [
        ('prompt "Go."', "the prompt of `skipper` has no text in `zh`, which the goal has"),
        ('prompt "Go."\n    prompt zh "去。"\n    prompt zh "走。"', "the prompt in `zh` is given twice"),
        ('prompt "Go."\n    prompt zh "去。"\n    prompt fr "Va."', "the goal has no text in `fr`"),
        ('prompt zh "去。"', "there is no prompt to translate"),
    ],
)
def test_the_goal_and_every_prompt_must_have_the_same_languages(small: str, prompts: str, message: str) -> None:
    diagnostics = compile_text(spoken(small, 'goal zh "找到每一个人。"', prompts)).diagnostics
    assert [each.message for each in diagnostics if each.severity == "error"] == [message]


def test_printing_keeps_the_texts_of_other_languages(small: str, tmp_path: Path) -> None:
    source, printed = tmp_path / "source.ljs", tmp_path / "printed.ljs"
    source.write_text(spoken(small, 'goal zh "找到每一个人。"', 'prompt "Go."\n    prompt zh "去。"'), encoding="utf-8")
    assert run_command(["compile", str(source), "--emit", "ljs", "-o", str(printed)]) == 0
    again = lingjing.compile(printed)
    assert again.goals == {"zh": "找到每一个人。"}
    assert {agent.name: agent.prompts for agent in again.agents}["skipper"] == {"zh": "去。"}


def test_the_error_about_a_missing_language_lists_the_languages_of_the_mission(tmp_path: Path) -> None:
    with pytest.raises(lingjing.UsageError, match="mission 'queue' has no texts in 'zh'") as error:
        lingjing.run("queue", policy="idle", language="zh", overview=False, out=tmp_path / "run")
    assert error.value.hint and "it has en;" in error.value.hint


@pytest.mark.parametrize(
    ("inside", "languages"),
    [
        ("", ("en", "zh")),
        ('override goal "Find all."', ("en",)),
        ('override goal "Find all."\n  goal zh "全部找到。"', ("en", "zh")),
        ('override goal "Find all."\n  override goal zh "全部找到。"', ("en", "zh")),
        ('override agent skipper as rescuer controls boat {\n observes boat.*, events\n prompt "Go." }', ("en",)),
    ],
)
def test_a_derived_mission_has_only_the_languages_that_all_its_texts_have(
    inside: str, languages: tuple[str, ...], tmp_path: Path
) -> None:
    file = tmp_path / "own.ljs"
    file.write_text(
        f'ljs 2\nuse scenarios.ssr {{ ssr }}\nmission own extends ssr "Own" {{\n  {inside}\n}}\n', encoding="utf-8"
    )
    mission = lingjing.compile(file)
    if "zh" in languages:
        assert instantiate(mission, language="zh").goal == mission.goals["zh"]
        return
    with pytest.raises(lingjing.UsageError, match="no texts in 'zh'"):
        instantiate(mission, language="zh")
