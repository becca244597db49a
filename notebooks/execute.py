"""Execute the notebooks and store their pictures: ``python notebooks/execute.py [NAME.ipynb ...]``, all without names.

Execution times, widget state and progress bars are not stored: the first change with every run, the others reopen
broken. Kernels keep what they compile (`altijax.keep_programs`).
"""

import os
import sys
from pathlib import Path

import nbformat
from nbclient import NotebookClient

from altijax.programs import KEPT_PROGRAMS

FOLDER = Path(__file__).parent
WIDGET = "application/vnd.jupyter.widget-view+json"


def execute(path: Path) -> nbformat.NotebookNode:
    """The notebook, run from top to bottom in its own folder; an error in a cell is raised."""
    notebook = nbformat.read(path, as_version=4)
    client = NotebookClient(notebook, timeout=600, kernel_name="python3", resources={"metadata": {"path": FOLDER}})
    client.execute(env={KEPT_PROGRAMS: "1"} | dict(os.environ) | {"TQDM_DISABLE": "1"})
    notebook.metadata.pop("widgets", None)
    for cell in notebook.cells:
        cell.metadata.pop("execution", None)
        if cell.cell_type == "code":
            cell.outputs = [output for output in cell.outputs if WIDGET not in output.get("data", {})]
    return notebook


if __name__ == "__main__":
    for path in [FOLDER / name for name in sys.argv[1:]] or sorted(FOLDER.glob("*.ipynb")):
        nbformat.write(execute(path), path)
        print(path.name)
