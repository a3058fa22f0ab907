"""The page and the notebook run, and print what they say."""

from __future__ import annotations

import ast
import contextlib
import doctest
import io
import json
import re
from pathlib import Path

import pytest

from conftest import ROOT

PAGE = ROOT / "docs" / "python.md"
NOTEBOOK = ROOT / "bindings" / "python" / "notebooks" / "rate_distortion.ipynb"


def blocks(text: str) -> list[tuple[str, str, int]]:
    """The language, the lines and the place of each block of code."""
    found = re.finditer(r"^```(\w+)\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    return [(block[1], block[2], text.count("\n", 0, block.start()) + 1) for block in found]


def test_the_page_prints_what_it_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("trimesh", reason="trimesh is not installed")
    monkeypatch.chdir(tmp_path)
    text = PAGE.read_text()
    names: dict[str, object] = {}
    printed: str | None = None
    examples = 0
    for language, lines, place in blocks(text):
        match language:
            case "python":
                out = io.StringIO()
                with contextlib.redirect_stdout(out):
                    exec(compile(lines, f"{PAGE.name}:{place}", "exec"), names)
                printed = out.getvalue()
            case "text":
                assert printed == lines
                printed = None
            case "pycon":
                test = doctest.DocTestParser().get_doctest(lines, names, PAGE.name, str(PAGE), place)
                report = io.StringIO()
                failed, attempted = doctest.DocTestRunner(verbose=False).run(test, out=report.write, clear_globs=False)
                assert failed == 0, report.getvalue()
                names.update(test.globs)
                examples += attempted
    assert examples > 40 and printed is None


def test_the_page_begins_with_five_lines_to_a_mesh() -> None:
    language, lines, _ = blocks(PAGE.read_text())[0]
    assert language == "python" and len(lines.splitlines()) == 5 and "to_trimesh()" in lines


def test_links_of_the_page_lead_somewhere() -> None:
    links = re.findall(r"\]\(([^)#]+)\)", PAGE.read_text())
    for link in links:
        assert link.startswith("https://") or (PAGE.parent / link).exists(), link


def test_the_notebook_runs_and_is_stored_without_output(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    notebook = json.loads(NOTEBOOK.read_text())
    cells = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    assert len(cells) >= 3
    for cell in cells:
        assert cell["outputs"] == [] and cell["execution_count"] is None
        ast.parse("".join(cell["source"]))
    matplotlib = pytest.importorskip("matplotlib", reason="matplotlib is not installed")
    matplotlib.use("Agg")
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    for cell in cells:
        exec(compile("".join(cell["source"]), NOTEBOOK.name, "exec"), names)
    from matplotlib import pyplot

    assert len(pyplot.get_fignums()) == 2
    pyplot.close("all")
