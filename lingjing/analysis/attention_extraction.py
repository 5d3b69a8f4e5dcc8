"""Attention maps out of what an open vision-language model returned: where in a picture it looked as it answered.

The arrays are those of the `transformers` library: `generate(…, output_attentions=True, return_dict_in_generate=True)`
gives `attentions`, one entry for each token of the answer, each with one array for each layer, of shape (batch, heads,
queries, keys). The first entry has the whole prompt as queries, the others one token; what the last query attends to is
what the token was made of. The model must have been loaded with `attn_implementation="eager"`: the others keep no
attention. A picture is a run of equal placeholder tokens in the prompt, its patches row by row.

[docs/metrics.md](../../docs/metrics.md) has the lines that make a file of them.

Models that cut a picture into tiles with tokens between them are not read: switch tiling off. Nothing here imports a
model's library.
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
    """Where the pictures of a prompt are: the positions of each run of the placeholder token."""
    found = []
    for token, run in groupby(enumerate(tokens), key=lambda item: item[1]):
        if token == placeholder:
            places = [place for place, _ in run]
            found.append(range(places[0], places[-1] + 1))
    return found


def attention_map(
    steps: Sequence[Sequence[LayerAttention]],
    picture: range,
    grid: tuple[int, int],
    *,
    layers: Sequence[int] | None = None,
    batch: int = 0,
) -> AttentionMap:
    """What the tokens of an answer attended to in one picture: the mean over tokens, layers and heads, (rows, columns).

    `picture` are its positions in the prompt, `grid` its rows and columns of tokens, `layers` those that are taken
    (default all). Raises `ValueError` where these do not fit the arrays.
    """
    rows, columns = grid
    if len(picture) != rows * columns:
        raise ValueError(f"the picture has {len(picture)} tokens and not {rows} rows of {columns}")
    if not steps or any(not step for step in steps):
        raise ValueError(
            "there is no attention: ask the model for it (`output_attentions=True`), and load it with"
            ' `attn_implementation="eager"`'
        )
    looked = [
        _looked_at(step[layer], picture, batch)
        for step in steps
        for layer in (range(len(step)) if layers is None else layers)
    ]
    found: AttentionMap = np.mean(looked, axis=0).reshape(rows, columns)
    return found


def _looked_at(layer: LayerAttention, picture: range, batch: int) -> AttentionMap:
    """The attention of the last query to the picture's tokens, the mean over heads."""
    if layer.ndim != 4:
        raise ValueError(f"attention has the axes batch, heads, queries and keys; this has the shape {layer.shape}")
    if picture.stop > layer.shape[3]:
        raise ValueError(f"the picture ends at token {picture.stop}, and attention goes to {layer.shape[3]} only")
    found: AttentionMap = layer[batch, :, -1, picture.start : picture.stop].astype(np.float64).mean(axis=0)
    return found


def write_attention(path: str | Path, maps: Mapping[str, AttentionMap]) -> None:
    """Write the maps of pictures, by their ids, as `read_attention` reads them."""
    with ZipFile(path, "w", ZIP_DEFLATED) as archive:  # `np.savez` has names of its own among those of the arrays
        for name, one in maps.items():
            with archive.open(f"{name}.npy", "w") as file:
                np.lib.format.write_array(file, one, allow_pickle=False)


__all__ = ["LayerAttention", "attention_map", "picture_runs", "write_attention"]
