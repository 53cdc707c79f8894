"""What docs/benchmark.md shows: its contestant plays, and the tables find their place."""

import re
import sys
from pathlib import Path

import pytest
from harness import protocol, sets, splits, table

HERE = Path(__file__).resolve().parent.parent
DOCUMENT = HERE.parent.parent / "docs" / "benchmark.md"


def test_the_contestant_of_the_document_beats_the_description(tmp_path):
    program = tmp_path / "ridge.py"
    program.write_text(re.search(r"```python\n(.*?)```", DOCUMENT.read_text(), re.S).group(1))
    of = sets.load(HERE / "sets" / "talos.json")
    split = splits.split(of, 0)
    ridge, nominal = (protocol.run([sys.executable, str(file)], of, split, 120.0)[-1] for file in (program, HERE / "contestants" / "nominal.py"))
    assert ridge.error is None, ridge.error
    assert ridge.scores.mean_mm < 0.5 * nominal.scores.mean_mm


def test_tables_go_between_the_marks(tmp_path):
    page = tmp_path / "page.md"
    page.write_text(f"before\n{table.BEGIN}\nold\n{table.END}\nafter\n")
    table.into(page, "| new |")
    assert page.read_text() == f"before\n{table.BEGIN}\n\n| new |\n{table.END}\nafter\n"
    page.write_text("no marks")
    with pytest.raises(ValueError, match="no place for the tables"):
        table.into(page, "")


def test_what_is_bold_in_the_tables_is_so_on_the_page():
    told = table.page("one is **bold** & told\n| set | ratio |\n| --- | ---: |\n| a | **1.040** |\n| b | 0.900 |", [], [], [], {})
    assert "<p>one is <b>bold</b> &amp; told</p>" in told
    assert "<td><b>1.040</b></td>" in told and "<td>0.900</td>" in told and "**" not in told
