"""Attention maps from the output of an open vision-language model.

The arrays are those of the `transformers` library: `generate(…, output_attentions=True, return_dict_in_generate=True)`
returns `attentions`, one entry for each token of the answer. An entry has one array for each layer, of shape (batch,
heads, queries, keys). The queries of the first entry are the whole prompt, those of the others one token. The keys of
the last query are the input of the token. The model must be loaded with `attn_implementation="eager"`, because other
implementations do not keep attention. In the prompt, a picture is a run of equal placeholder tokens, row by row.

[docs/metrics.md](../../docs/metrics.md) shows how to write a file of maps.

Models that split a picture into tiles with separator tokens are not supported; switch tiling off. This module imports
no model library.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import groupby
from pathlib import Path
from zipfile import ZIP_DEFLATED, ZipFile

import numpy as np
import numpy.typing as npt

from lingjing.analysis.attention import AttentionMap

LayerAttention = npt.NDArray[np.floating]
"""The attention of one layer: (batch, heads, queries, keys)."""


def picture_runs(tokens: Iterable[int], placeholder: int) -> list[range]:
    """Return the positions of the pictures of a prompt: the runs of the placeholder token."""
    runs = []
    for token, run in groupby(enumerate(tokens), key=lambda item: item[1]):
        if token == placeholder:
            places = [place for place, _ in run]
            runs.append(range(places[0], places[-1] + 1))
    return runs


def attention_map(
    steps: Sequence[Sequence[LayerAttention]],
    picture: range,
    grid: tuple[int, int],
    *,
    layers: Sequence[int] | None = None,
    batch: int = 0,
) -> AttentionMap:
    """Return the attention of an answer to one picture: the mean over tokens, layers and heads, (rows, columns).

    `picture` is the range of its positions in the prompt, `grid` its rows and columns of tokens. `layers` selects
    layers (default: all). Raises `ValueError` if these do not match the arrays.
    """
    rows, columns = grid
    if len(picture) != rows * columns:
        raise ValueError(f"the picture has {len(picture)} tokens and not {rows} rows of {columns}")
    if not steps or any(not step for step in steps):
        raise ValueError(
            "there is no attention: call the model with `output_attentions=True`, and load it with"
            ' `attn_implementation="eager"`'
        )
    attentions = [
        _last_query(step[layer], picture, batch)
        for step in steps
        for layer in (range(len(step)) if layers is None else layers)
    ]
    attention: AttentionMap = np.mean(attentions, axis=0).reshape(rows, columns)
    return attention


def _last_query(layer: LayerAttention, picture: range, batch: int) -> AttentionMap:
    """Return the attention of the last query to the picture's tokens, the mean over heads."""
    if layer.ndim != 4:
        raise ValueError(f"attention has the axes batch, heads, queries and keys; this has the shape {layer.shape}")
    if picture.stop > layer.shape[3]:
        raise ValueError(f"the picture ends at token {picture.stop}, and attention goes to {layer.shape[3]} only")
    attention: AttentionMap = layer[batch, :, -1, picture.start : picture.stop].astype(np.float64).mean(axis=0)
    return attention


def write_attention(path: str | Path, maps: Mapping[str, AttentionMap]) -> None:
    """Write maps by picture id, in the format of `read_attention`."""
    # not `np.savez`: it takes names as keyword arguments, so an id could clash with its own parameters
    with ZipFile(path, "w", ZIP_DEFLATED) as archive:
        for name, array in maps.items():
            with archive.open(f"{name}.npy", "w") as file:
                np.lib.format.write_array(file, array, allow_pickle=False)


__all__ = ["LayerAttention", "attention_map", "picture_runs", "write_attention"]
