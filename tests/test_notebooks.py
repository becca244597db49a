"""Every notebook runs from top to bottom, and what is stored of it is what a reader may see."""

import re
import subprocess
import sys
from pathlib import Path

import jax
import nbformat
import pytest

from notebooks.execute import FOLDER, WIDGET, execute

NOTEBOOKS = [pytest.param(path, id=path.stem) for path in sorted(FOLDER.glob("*.ipynb"))]


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS)
def test_runs_without_errors_or_complaints(path: Path) -> None:
    for cell in execute(path).cells:
        for output in cell.get("outputs", []):
            downloading = output.get("text", "").startswith("Downloading file")
            assert output.output_type != "error" and (output.get("name") != "stderr" or downloading), output


@pytest.mark.parametrize("path", NOTEBOOKS)
def test_stored_with_pictures_and_without_traces_of_a_machine(path: Path) -> None:
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    text = path.read_text()
    assert len(text) < 1_000_000
    assert WIDGET not in text and '"execution": {' not in text
    assert "widgets" not in notebook.metadata and "\\r" not in text
    code = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert [cell.execution_count for cell in code] == list(range(1, len(code) + 1))
    assert any("image/png" in output.get("data", {}) for cell in code for output in cell.outputs)
    assert "assert" in code[-1].source
    assert not [output for cell in code for output in cell.outputs if output.get("name") == "stderr"]
    drawn = [cell.source for cell in code if re.search(r"plot_", cell.source) and not re.match(r"\s*def ", cell.source)]
    assert drawn


def test_kernels_keep_programs_and_show_no_bars(tmp_path: Path) -> None:
    """A bar that a cell leaves behind would be stored with every frame it ever had."""
    code = "import altijax, jax, tqdm.auto\nlist(tqdm.auto.tqdm(range(3)))\nprint(jax.config.jax_compilation_cache_dir)"
    nbformat.write(nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(code)]), tmp_path / "bar.ipynb")
    [cell] = execute(tmp_path / "bar.ipynb").cells
    [output] = cell.outputs
    assert output.text.strip() == str(jax.config.jax_compilation_cache_dir)


def test_the_script_names_an_unknown_notebook() -> None:
    result = subprocess.run(
        [sys.executable, FOLDER / "execute.py", "no_such.ipynb"], capture_output=True, text=True, check=False
    )
    assert result.returncode != 0 and "no_such.ipynb" in result.stderr
