"""The graph as a self-contained SVG document, laid out by Graphviz, for light and dark pages.

The program is `graphviz-pure`, a port of Graphviz with its own fonts that writes the same bytes on every machine. If it
is not installed, the system's `dot` is used.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

from lingjing.errors import InfrastructureError
from lingjing.mission.draw.dot import dot
from lingjing.mission.draw.styles import dark_colours
from lingjing.mission.graph.types import MissionGraph

_SECONDS_MOST = 120.0
"""The time limit of one layout, seconds (chosen)."""


def svg(graph: MissionGraph) -> str:
    """The document's text, the same for the same graph. Raises `InfrastructureError` if no Graphviz can be run."""
    command = [_program(), "-Tsvg"]
    try:
        run = subprocess.run(command, input=dot(graph).encode(), capture_output=True, check=True, timeout=_SECONDS_MOST)
    except (OSError, subprocess.SubprocessError) as error:
        output = getattr(error, "stderr", b"") or str(error).encode()
        raise InfrastructureError(f"{command[0]} drew no graph: {output.decode(errors='replace').strip()}") from error
    document = re.sub(r"\A.*?(?=<svg)|<!--.*?-->\n?", "", run.stdout.decode(), flags=re.DOTALL)
    return document.replace('<g id="graph0"', f"<style>{_dark_style()}</style>\n" + '<g id="graph0"', 1)


# -- private


def _program() -> str:
    beside = Path(sys.executable).parent
    program = shutil.which("graphviz-pure", path=str(beside)) or shutil.which("graphviz-pure") or shutil.which("dot")
    if program is None:
        hint = "install it with: pip install graphviz-pure; or write the graph as .mmd or .dot"
        raise InfrastructureError("Graphviz, which lays out graphs, is not installed", hint=hint)
    return program


def _dark_style() -> str:
    """CSS rules that replace each colour of a light page if the reader's page is dark."""
    rules = [f'[{what}="{light}"]{{{what}:{dark}}}' for what, light, dark in dark_colours()]
    return "@media (prefers-color-scheme: dark) {" + "".join(("text:not([fill]){fill:#e6edf3}", *rules)) + "}"
