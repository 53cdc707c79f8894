"""The command: a short run, the same again, and what is refused."""

import json
import subprocess
import sys
from pathlib import Path

from benchmark import Contestant

HERE = Path(__file__).resolve().parent.parent


def run(out, *arguments):
    command = [sys.executable, str(HERE / "benchmark.py"), "--out", str(out), "--splits", "1", "--sets", "talos", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=300)


def test_a_run_writes_tables_and_goes_on_where_it_was(tmp_path):
    first = run(tmp_path, "--contestants", "nominal")
    assert first.returncode == 0, first.stderr
    records = [json.loads(line) for line in (tmp_path / "results.jsonl").read_text().splitlines()]
    assert [r["task"] for r in records] == ["8", "10", "12", "20", "40", "all"]
    assert "| nominal |" in first.stdout == (tmp_path / "table.md").read_text() + "\n"
    page = (tmp_path / "benchmark.html").read_text()
    assert "<svg" in page and "http" not in page
    again = run(tmp_path, "--contestants", "nominal")
    assert again.returncode == 0 and again.stdout == first.stdout
    assert len((tmp_path / "results.jsonl").read_text().splitlines()) == len(records)


def test_one_that_crashes_is_entered_told_and_counted(tmp_path):
    program = tmp_path / "broken.py"
    program.write_text("import sys\nif sys.argv[1:] == ['--version']:\n    print('broken 1')\nelse:\n    raise RuntimeError('no luck')\n")
    found = run(tmp_path, "--enter", str(program), "--contestants", "broken;nominal")
    assert found.returncode == 0, found.stderr
    assert "broken, talos, split 0, all: ended with code 1: RuntimeError: no luck" in found.stderr
    assert "(1 of 1 failed)" in found.stdout and "| 1/1 |" in found.stdout


def test_one_that_does_not_start_is_left_out_with_a_word(tmp_path):
    program = tmp_path / "absent.py"
    program.write_text("import a_library_that_is_not_here\n")
    found = run(tmp_path, "--enter", str(program), "--contestants", "absent;nominal")
    assert found.returncode == 0
    assert "absent: left out, it does not start: ModuleNotFoundError" in found.stderr


def test_a_library_of_its_own_has_its_own_python_beside_this_one():
    its = Contestant("other", Path("other.py"), environment="others")
    assert its.command == [str(Path(sys.prefix).parent / "others" / "bin" / "python"), "other.py"]
    assert Contestant("native", Path("native")).command == ["native"]


def test_a_contestant_that_is_not_there_is_refused(tmp_path):
    found = run(tmp_path, "--contestants", "somebody")
    assert found.returncode == 2 and "there is no contestant 'somebody'; there are ours" in found.stderr
