"""The card of the language and the pages of libraries hold what the compiler knows, and the card is short."""

from __future__ import annotations

import importlib.util
import re
from collections.abc import Callable
from pathlib import Path

import pytest

from lingjing.errors import ExitCode
from lingjing.testing import compile_text, run_command

ROOT = Path(__file__).parents[2]
LIBRARIES = sorted(f"std.{file.stem}" for file in (ROOT / "scenarios" / "std").glob("*.ljs"))
MOST_TOKENS = 3000


@pytest.fixture
def card(capsys: pytest.CaptureFixture[str]) -> str:
    assert run_command(["docs", "--card"]) == ExitCode.OK
    return capsys.readouterr().out


@pytest.fixture
def page(capsys: pytest.CaptureFixture[str]) -> Callable[[str], str]:
    def print_page(path: str) -> str:
        assert run_command(["docs", path]) == ExitCode.OK
        return capsys.readouterr().out

    return print_page


def test_the_example_of_the_card_compiles(card: str) -> None:
    example = re.search(r"```ljs\n(.*?)```", card, re.DOTALL)
    assert example is not None and compile_text(example[1]).diagnostics == ()


def test_the_card_names_every_statement_unit_and_library(card: str) -> None:
    words = set(re.findall(r"[\w%°]+", card))
    statements = (ROOT / "docs" / "statements.md").read_text(encoding="utf-8")
    assert set(re.findall(r"^### `(\w+)`$", statements, re.MULTILINE)) <= words
    language = (ROOT / "docs" / "language.md").read_text(encoding="utf-8")
    units = re.search(r"^\*\*Units\*\*: (.*?); compounds", language, re.MULTILINE)
    assert units is not None and set(re.findall(r"[^\W\d_]+|[%°]", units[1])) <= words
    rivals = "std.rivals"  # objects that resemble targets are for authors of benchmarks, and the card is short
    assert [path for path in LIBRARIES if f"`{path}`" not in card] == [rivals]
    assert "‹" not in card


def test_the_card_is_short_in_the_tokens_of_two_models(card: str, monkeypatch: pytest.MonkeyPatch) -> None:
    spec = importlib.util.find_spec("litellm")
    if spec is None or spec.origin is None:
        pytest.skip("litellm, which brings vocabularies of models, is not installed")
    tiktoken, tokenizers = pytest.importorskip("tiktoken"), pytest.importorskip("tokenizers")
    folder = Path(spec.origin).parent / "litellm_core_utils" / "tokenizers"
    if not (folder / "anthropic_tokenizer.json").is_file():
        pytest.skip("this litellm brings no vocabularies")
    monkeypatch.setenv("TIKTOKEN_CACHE_DIR", str(folder))
    assert len(tiktoken.get_encoding("cl100k_base").encode(card)) <= MOST_TOKENS
    assert len(tokenizers.Tokenizer.from_file(str(folder / "anthropic_tokenizer.json")).encode(card).ids) <= MOST_TOKENS


def test_the_card_is_short_in_characters(card: str) -> None:
    """Three characters a token is less than any vocabulary gives for such a text."""
    assert len(card) <= 3 * MOST_TOKENS


@pytest.mark.parametrize("path", LIBRARIES)
def test_every_standard_library_has_a_page(page: Callable[[str], str], path: str) -> None:
    text = page(path)
    assert text.startswith(f"# `{path}`\n") and "\n### `" in text


def test_a_page_shows_verbs_states_words_and_interactions(page: Callable[[str], str]) -> None:
    air, fire, logistics = page("std.air"), page("std.fire"), page("std.logistics")
    assert "- verb `takeoff(altitude: length in 1 m..500 m optional)`: climbs" in air
    assert "`band = 0 m..120 m`" in air and "`dead`, `drifting`, `grounded`, `hovering`, `moving`" in air
    assert "- states: `heat = 100 %`\n- status words: `burning`, `dormant`, `out`\n" in fire
    assert "- interaction `extinguish`: by `road`, within 30 m, its event is visible to all" in fire
    assert "takes `demand` from the actor's `load`" in logistics
    assert "`load: mass optional`" in page("std.messages")
    assert "`size = 1920 by 1080`" in page("std.sensors")
    assert "`wind = 2 m/s from 220 deg`" in page("std.weather")


def test_a_page_is_written_to_a_file(page: Callable[[str], str], tmp_path: Path) -> None:
    assert run_command(["docs", "std.sea", "-o", str(tmp_path / "sea.md")]) == ExitCode.OK
    assert (tmp_path / "sea.md").read_text(encoding="utf-8") == page("std.sea")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["docs"], "a mission or a library is missing"),
        (["docs", "--card", "ssr"], "`--card` is about the language alone"),
        (["docs", "std.aer"], "there is no library `std.aer`"),
        (["docs", "std.air", "--results", "x"], "a library has no traces and no results"),
    ],
)
def test_a_wrong_argument_gives_a_message(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_command(arguments) == ExitCode.USAGE
    assert message in capsys.readouterr().err
