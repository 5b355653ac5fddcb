"""The tutorial runs from its first cell to its last, and shows what it says."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
RUN = """
import nbformat
from nbclient import NotebookClient
notebook = nbformat.read("examples/tutorial.ipynb", as_version=4)
NotebookClient(notebook, timeout=240, resources={"metadata": {"path": "examples"}}).execute()
for cell in notebook.cells:
    for output in cell.get("outputs", []):
        print(output.get("text", ""), *output.get("data", {}).values())
"""


def test_the_tutorial_runs() -> None:
    done = subprocess.run([sys.executable, "-c", RUN], capture_output=True, text=True, check=False, cwd=ROOT)
    assert done.returncode == 0, done.stderr
    assert "overflow is missing" in done.stdout
    assert "data:image/png;base64," in done.stdout
    assert "identified ('overflow',)" in done.stdout
