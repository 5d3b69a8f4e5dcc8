"""Attention maps from models of the `transformers` library: the real classes, small, with random weights."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lingjing.analysis.attention import read_attention
from lingjing.analysis.attention_extraction import attention_map, picture_runs, write_attention

torch: Any = pytest.importorskip("torch", reason="needs torch, which no extra installs")
transformers: Any = pytest.importorskip("transformers", reason="needs transformers, which no extra installs")

PICTURE = 390
"""The placeholder token of a picture."""


@pytest.fixture(scope="module")
def qwen() -> Any:
    """A Qwen2.5-VL with three layers of four heads. It merges patches 2 by 2."""
    torch.manual_seed(1)
    text = {
        "vocab_size": 400,
        "hidden_size": 32,
        "intermediate_size": 64,
        "num_hidden_layers": 3,
        "num_attention_heads": 4,
        "num_key_value_heads": 2,
        "rope_scaling": {"type": "mrope", "mrope_section": [1, 1, 2]},
        "bos_token_id": 1,
        "eos_token_id": 2,
        "pad_token_id": 0,
    }
    vision = {
        "depth": 2,
        "hidden_size": 32,
        "intermediate_size": 64,
        "num_heads": 4,
        "out_hidden_size": 32,
        "patch_size": 14,
    }
    config = transformers.Qwen2_5_VLConfig(text_config=text, vision_config=vision, image_token_id=PICTURE)
    model = transformers.Qwen2_5_VLForConditionalGeneration._from_config(config, attn_implementation="eager")
    return model.eval()


@pytest.mark.parametrize("use_cache", [True, False])
def test_the_maps_of_two_pictures_are_the_mean_attention_of_the_last_query(
    qwen: Any, use_cache: bool, tmp_path: Path
) -> None:
    """Pictures of 6 by 8 and 4 by 4 patches. The reference is computed from torch's arrays, element by element."""
    grid = torch.tensor([[1, 6, 8], [1, 4, 4]])
    tokens = torch.tensor([[1, 5, *[PICTURE] * 12, 6, *[PICTURE] * 4, 7]])
    generated = qwen.generate(
        input_ids=tokens,
        attention_mask=torch.ones_like(tokens),
        mm_token_type_ids=(tokens == PICTURE).int(),
        pixel_values=torch.randn(6 * 8 + 4 * 4, 3 * 2 * 14 * 14),
        image_grid_thw=grid,
        max_new_tokens=4,
        do_sample=False,
        use_cache=use_cache,
        output_attentions=True,
        return_dict_in_generate=True,
    )
    steps = [[layer[:1].float().cpu().numpy() for layer in step] for step in generated.attentions]
    runs = picture_runs(tokens[0].tolist(), qwen.config.image_token_id)
    grids = [(rows // 2, columns // 2) for _, rows, columns in grid.tolist()]
    maps = {frame: attention_map(steps, run, size) for frame, run, size in zip(("a", "b"), runs, grids, strict=True)}
    write_attention(tmp_path / "attention.npz", maps)
    read = read_attention(tmp_path / "attention.npz")
    assert {name: array.shape for name, array in read.items()} == {"a": (3, 4), "b": (2, 2)}
    layers = [layer for step in generated.attentions for layer in step]
    expected = [[float(sum(layer[0, head, -1, 2 + k] for head in range(4))) / 4 for k in range(12)] for layer in layers]
    assert read["a"].ravel() == pytest.approx(np.mean(expected, axis=0), rel=1e-5)


def test_the_error_for_a_model_without_attention_names_the_options() -> None:
    """LLaVA; with `sdpa` the library returns empty steps."""
    small = {"hidden_size": 32, "intermediate_size": 64, "num_hidden_layers": 2, "num_attention_heads": 4}
    config = transformers.LlavaConfig(
        text_config=dict(model_type="llama", vocab_size=400, **small),
        vision_config=dict(model_type="clip_vision_model", image_size=56, patch_size=14, projection_dim=32, **small),
        image_token_index=PICTURE,
    )
    tokens = torch.tensor([[1, 5, *[PICTURE] * 16, 6]])

    def map_with(implementation: str) -> Any:
        model = transformers.LlavaForConditionalGeneration._from_config(
            config, attn_implementation=implementation
        ).eval()
        generated = model.generate(
            input_ids=tokens,
            pixel_values=torch.randn(1, 3, 56, 56),
            max_new_tokens=2,
            do_sample=False,
            output_attentions=True,
            return_dict_in_generate=True,
        )
        steps = [[layer[:1].float().numpy() for layer in step] for step in generated.attentions]
        return attention_map(steps, picture_runs(tokens[0].tolist(), PICTURE)[0], (4, 4))

    assert map_with("eager").shape == (4, 4)
    with pytest.raises(ValueError, match="eager"):
        map_with("sdpa")
