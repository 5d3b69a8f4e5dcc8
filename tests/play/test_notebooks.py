"""The notebooks of `examples/notebooks` run from first to last cell and show what they promise.

`make notebooks` installs what runs them; elsewhere these tests skip.
"""

from __future__ import annotations

import ast
from pathlib import Path
from typing import Any

import pytest

pytestmark = pytest.mark.slow
FOLDER = Path(__file__).parents[2] / "examples" / "notebooks"

SHOWN = {
    "write_a_mission": ["<Mission first", "<EpisodeReport first-broadcast seed 1, oracle: success", "<InlineEpisode"],
    "evaluate_a_model": ["<SuiteResults 'The sea rescue': 6 rows", "<Figure"],
    "explain_a_failure": ["<EpisodeReport", "<Trace first-broadcast seed 3: budget, 13 boundaries", "<InlineEpisode"],
}
"""The beginnings of texts that the cells of each notebook return."""


def test_each_notebook_has_a_test() -> None:
    assert {path.stem for path in FOLDER.glob("*.ipynb")} == set(SHOWN)


@pytest.mark.parametrize("name", SHOWN)
def test_a_notebook_is_stored_without_outputs(name: str) -> None:
    nbformat = pytest.importorskip("nbformat", reason="nbformat is not installed")
    book = nbformat.read(FOLDER / f"{name}.ipynb", as_version=4)
    cells = [cell for cell in book.cells if cell.cell_type == "code"]
    assert all(not cell.outputs and cell.execution_count is None for cell in cells)
    assert max(len(line) for cell in book.cells for line in cell.source.splitlines()) <= 130


@pytest.mark.parametrize("name", SHOWN)
def test_a_notebook_runs(name: str, tmp_path: Path) -> None:
    nbformat = pytest.importorskip("nbformat", reason="nbformat is not installed")
    client = pytest.importorskip("nbclient", reason="nbclient is not installed")
    pytest.importorskip("ipykernel", reason="ipykernel is not installed")
    pytest.importorskip("pandas", reason="the extra `pandas` is not installed")
    book = nbformat.read(FOLDER / f"{name}.ipynb", as_version=4)
    client.NotebookClient(book, timeout=600, resources={"metadata": {"path": str(tmp_path)}}).execute()
    outputs: list[Any] = [output for cell in book.cells for output in cell.get("outputs", ())]
    texts = [output.get("data", {}).get("text/plain", "") for output in outputs]
    for beginning in SHOWN[name]:
        assert any(text.startswith(beginning) for text in texts), (beginning, texts)
    kinds = {kind for output in outputs for kind in output.get("data", {})}
    assert {"text/html", "image/png"} <= kinds
    streamed = "".join(output.get("text", "") for output in outputs)
    assert "Traceback" not in streamed
    assert "policy-failure" not in "".join(texts)


@pytest.mark.parametrize("name", SHOWN)
def test_a_kernel_without_the_package_gets_one_message(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    nbformat = pytest.importorskip("nbformat", reason="nbformat is not installed")
    monkeypatch.setitem(__import__("sys").modules, "lingjing", None)
    book = nbformat.read(FOLDER / f"{name}.ipynb", as_version=4)
    first = next(cell.source for cell in book.cells if cell.cell_type == "code")
    ast.parse(first)
    with pytest.raises(SystemExit, match=r"has no lingjing\. Choose another kernel, or run: .* -m pip install"):
        exec(compile(first, name, "exec"), {})
