"""Attention maps from arrays as `transformers` returns them, by token and layer: (batch, heads, queries, keys)."""

from pathlib import Path

import numpy as np
import pytest

from lingjing.analysis.attention import box_iou, read_attention
from lingjing.analysis.attention_extraction import attention_map, picture_runs, write_attention

PICTURE = 99
PROMPT = [1, 5, *[PICTURE] * 12, 6, 5, *[PICTURE] * 4, 6, 7]
"""Two pictures, of 3 by 4 and of 2 by 2 tokens."""


def attention(queries: list[list[float]], keys: np.ndarray) -> np.ndarray:
    """Return softmax attention of queries to keys, with one batch and two heads. The second head is uniform."""
    scores = np.exp(np.array(queries) @ keys.T)
    weights = scores / scores.sum(axis=1, keepdims=True)
    return np.stack([weights, np.full_like(weights, 1 / weights.shape[1])])[None]


def test_each_run_of_placeholder_tokens_is_a_picture() -> None:
    assert picture_runs(PROMPT, PICTURE) == [range(2, 14), range(16, 20)]
    assert picture_runs([1, 2, 3], PICTURE) == []


def test_attention_to_one_patch_is_a_peak_of_the_map(tmp_path: Path) -> None:
    """The keys are one-hot. The last token of the prompt and the next one query row 1, column 2 of picture 1."""
    first, second = picture_runs(PROMPT, PICTURE)
    keys = np.eye(len(PROMPT) + 1)
    query = 6.0 * keys[first[1 * 4 + 2]]
    prompt = attention([[0.0] * len(query)] * (len(PROMPT) - 1) + [list(query)], keys[: len(PROMPT)])
    steps = [[prompt, prompt], [attention([list(query)], keys)] * 2]
    peaked = attention_map(steps, first, (3, 4))
    assert peaked.shape == (3, 4)
    assert np.unravel_index(peaked.argmax(), peaked.shape) == (1, 2)
    assert box_iou(peaked, (2 / 4, 1 / 3, 3 / 4, 2 / 3)) == pytest.approx(1.0)
    even = attention_map(steps, second, (2, 2))
    assert np.ptp(even) == pytest.approx(0.0, abs=1e-12)
    write_attention(tmp_path / "maps.npz", {"frame-1": peaked, "file": even})
    read = read_attention(tmp_path / "maps.npz")
    assert list(read) == ["frame-1", "file"]
    assert read["frame-1"] == pytest.approx(peaked)


def test_the_map_is_the_mean_over_tokens_layers_and_heads_for_the_last_query() -> None:
    """Two tokens, two layers, two heads; a picture of one row of two. By hand: (1 + 3 + 5 + 7) / 4 and twice that."""

    def layer(value: float, queries: int) -> np.ndarray:
        made = np.zeros((1, 2, queries, 4), np.float32)
        made[0, :, -1, 1:3] = [[value - 1, 2 * value], [value + 1, 2 * value]]
        return made

    steps = [[layer(1.0, 3), layer(3.0, 3)], [layer(5.0, 1), layer(7.0, 1)]]
    assert attention_map(steps, range(1, 3), (1, 2)).tolist() == [[4.0, 8.0]]
    assert attention_map(steps, range(1, 3), (1, 2), layers=[-1]).tolist() == [[5.0, 10.0]]


@pytest.mark.parametrize(
    ("steps", "picture", "grid", "words"),
    [
        ([[np.ones((1, 1, 1, 9))]], range(2, 8), (2, 4), "6 tokens and not 2 rows of 4"),
        ([[np.ones((1, 1, 1, 5))]], range(2, 8), (2, 3), "ends at token 8, and attention goes to 5"),
        ([[np.ones((1, 1, 9))]], range(2, 8), (2, 3), "batch, heads, queries and keys"),
        ([], range(2, 8), (2, 3), "output_attentions=True"),
        ([[]], range(2, 8), (2, 3), "output_attentions=True"),
    ],
)
def test_arrays_of_other_shapes_are_rejected(steps: list, picture: range, grid: tuple[int, int], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        attention_map(steps, picture, grid)
