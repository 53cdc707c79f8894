"""A table that grows while recordings are put into a folder: no row twice, none lost, none in part."""

from __future__ import annotations

import contextlib
import io
import json
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

np = pytest.importorskip("numpy", reason="needs numpy: pip install 'body-schema[ros]'")
pytest.importorskip("rosbags", reason="needs rosbags: pip install 'body-schema[ros]'")

import mornings  # noqa: E402
from body_schema import Error  # noqa: E402
from body_schema.__main__ import main  # noqa: E402
from body_schema.recordings.following import Growing, Unfinished, date, recordings_of  # noqa: E402
from recorded import BASE, TIP, URDF, Run, bag  # noqa: E402

ROBOT = ["--urdf", str(URDF), "--base", BASE, "--tip", TIP]
SENSOR = ["--sensor", "tag=/mocap/tag", "--mounted", "beside", "--offset", "0.4", "--max-offset", "1"]
MARKER = ["--sensor", "marker=observation.marker", "--offset", "-0.12", "--max-offset", "1", "--unit", "deg"]
TITLES = ["recording", "time", "a", "b"]


@pytest.fixture(scope="module")
def bags(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three mornings."""
    folder = tmp_path_factory.mktemp("mornings")
    for day in (1, 2, 3):
        mornings.morning(folder, day, movements=1)
    return folder


def followed(folder: Path, out: Path, *words: str, sensor: list[str] = SENSOR, code: int = 0) -> str:
    """Take what is there, once."""
    said = io.StringIO()
    with contextlib.redirect_stdout(said):
        ended = main(["import", "--follow", str(folder), *ROBOT, *sensor, "--once", "--settle", "0", "--out", str(out), *words])
    assert ended == code, said.getvalue()
    return said.getvalue()


def refused(capsys: pytest.CaptureFixture[str], *words: object) -> str:
    assert main(["import", *map(str, words)]) == 2
    told = capsys.readouterr().err
    assert told.startswith("error: ") and told.count("\n") == 1, told
    return told


@pytest.fixture(scope="module")
def whole(bags: Path, tmp_path_factory: pytest.TempPathFactory) -> str:
    """The table of all three."""
    out = tmp_path_factory.mktemp("whole") / "mornings.csv"
    followed(bags, out)
    return out.read_text(encoding="utf-8")


def test_recordings_are_added_as_they_come_and_none_twice(bags: Path, whole: str, tmp_path: Path) -> None:
    lines = whole.splitlines()
    assert lines[0].startswith("recording,time,shoulder_pan_joint,") and len(lines) == 1 + 3 * 2
    assert [line.split(",")[:2] for line in lines[1::2]] == [[mornings.name_of(day), f"{mornings.name_of(day)}T08:00:00.100Z"] for day in (1, 2, 3)]
    folder, out = tmp_path / "mornings", tmp_path / "table.csv"
    (folder / "sent").mkdir(parents=True)
    shutil.copytree(bags / mornings.name_of(1), folder / mornings.name_of(1))
    assert f"{mornings.name_of(1)}: 2 rows" in followed(folder, out)
    assert out.read_text(encoding="utf-8") == "".join(line + "\n" for line in lines[:3])
    assert "0 rows added" in followed(folder, out) and ": 2 rows" not in followed(folder, out, "--dry-run")
    shutil.copytree(bags / mornings.name_of(2), folder / mornings.name_of(2))
    # A file alone, at any depth.
    shutil.copy(next((bags / mornings.name_of(3)).glob("*.mcap")), folder / "sent" / "third.mcap")
    dry = followed(folder, out, "--dry-run")
    assert "nothing is written" in dry and "sent/third.mcap: 2 rows" in dry
    assert "4 rows added" in followed(folder, out)
    assert out.read_text(encoding="utf-8") == whole.replace(f"{mornings.name_of(3)},", "sent/third.mcap,")
    assert "0 rows added" in followed(folder, out)


def test_what_is_not_whole_is_left_until_it_is(bags: Path, whole: str, tmp_path: Path) -> None:
    folder, out = tmp_path / "mornings", tmp_path / "table.csv"
    for day in (1, 2, 3):
        shutil.copytree(bags / mornings.name_of(day), folder / mornings.name_of(day))
    first, second, third = (folder / mornings.name_of(day) for day in (1, 2, 3))
    metadata = (first / "metadata.yaml").read_bytes()
    (first / "metadata.yaml").unlink()
    part = next(second.glob("*.mcap"))
    data = part.read_bytes()
    part.write_bytes(data[: len(data) // 2])
    # Files that have just changed are being written.
    said = followed(folder, out, "--settle", "1000", code=0)
    assert said.count("it is left for later") == 2 and "has no metadata.yaml" in said and out.read_text() == ""
    said = followed(folder, out, code=1)
    assert f"{second.name}: left out: " in said and "cannot be read" in said and f"{third.name}: 2 rows" in said
    (first / "metadata.yaml").write_bytes(metadata)
    part.write_bytes(data)
    assert "4 rows added" in followed(folder, out)
    assert sorted(out.read_text(encoding="utf-8").splitlines()) == sorted(whole.splitlines())


def test_a_table_that_was_cut_off_anywhere_is_completed(bags: Path, whole: str, tmp_path: Path) -> None:
    rows = [["b1", "t", "0.5", "1"], ["b1", "t", "0.25", "2"], ['o"dd, name', "t", "3", "4"]]
    path = tmp_path / "table.csv"

    def taken() -> None:
        table = Growing(path)
        table.append(TITLES, rows[:2])
        table.append(TITLES, rows[2:])
        table.close()

    taken()
    full = path.read_bytes()
    for cut in range(len(full)):
        path.write_bytes(full[:cut])
        taken()
        assert path.read_bytes() == full, cut
    out = tmp_path / "mornings.csv"
    # In the last line, of a table that had begun with it, too.
    title, *lines = whole.splitlines(keepends=True)
    for begun, wanted in ((whole[: len(whole) // 2], [title, *lines]), (title + "".join(lines[4:])[:-30], [title, *lines[4:], *lines[:4]])):
        out.write_text(begun, encoding="utf-8")
        followed(bags, out)
        assert out.read_text(encoding="utf-8") == "".join(wanted)


def test_somebody_elses_lines_are_kept(bags: Path, whole: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "table.csv"
    path.write_text("recording,time,a,b\n,2026-06-01,1,2\n,2026-06-0", encoding="utf-8")
    table = Growing(path)
    with pytest.raises(Unfinished, match="is not ended"):
        table.append(TITLES, [["b1", "t", "3", "4"]])
    with path.open("a") as file:
        file.write("2,5,6\n")
    assert table.append(TITLES, [["b1", "t", "3", "4"]]) == 1 and table.append(TITLES, [["b1", "u", "3", "4"]]) == 0
    # What was taken with other options is not taken again.
    assert table.append(TITLES, [["b1", "t", "9", "9"], ["b1", "t", "8", "8"]]) == 0
    assert path.read_text() == "recording,time,a,b\n,2026-06-01,1,2\n,2026-06-02,5,6\nb1,t,3,4\n"
    assert table.recordings() == ["b1"]
    with pytest.raises(Error, match="has the columns recording, time, a, b"):
        table.append([*TITLES, "c"], [["b2", "t", "3", "4", "5"]])
    if sys.platform != "win32":
        with pytest.raises(Error, match="another program follows"):
            Growing(path)
    # The file that has the name counts.
    path.rename(tmp_path / "old.csv")
    assert table.append(TITLES, [["b2", "t", "3", "4"]]) == 1 and path.read_text() == "recording,time,a,b\nb2,t,3,4\n"
    table.close()
    # An unfinished line holds a recording up until it is ended, and nothing of it is lost.
    out = tmp_path / "mornings.csv"
    out.write_text(whole.splitlines()[0] + "\n,x", encoding="utf-8")
    assert "is not ended" in followed(bags, out, code=1)
    assert out.read_text(encoding="utf-8").endswith("\n,x")
    out.write_text("a,b\n1,2\n")
    assert "does not begin with the columns" in refused(capsys, bags, "--follow", "--once", *ROBOT, *SENSOR, "--out", out)


def test_what_is_wrong_is_said(bags: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["--follow", *ROBOT, "--once", "--settle", "0"]
    assert "--out mornings.csv" in refused(capsys, bags, *words)
    out = ["--out", tmp_path / "table.csv"]
    assert "it has no meaning with --follow" in refused(capsys, bags, *words, *out, "--list")
    assert "is no folder" in refused(capsys, tmp_path / "none", *words, *out)
    assert "is one bag" in refused(capsys, bags / mornings.name_of(1), *words, *out)
    assert "is a folder" in refused(capsys, bags, *words, "--out", tmp_path)
    assert "without --follow" in refused(capsys, bags, "--once")
    assert main(["import", str(bags), *map(str, [*words, *out]), "--sensor", "tag=/mocap/tag", "--offset", "0.4"]) == 1
    told = capsys.readouterr().out
    assert told.count("say --mounted hand or --mounted beside") == 3 and (tmp_path / "table.csv").read_text() == ""
    assert date(1_780_272_000.1) == "2026-06-01T00:00:00.100Z"


def test_recordings_of_nearly_nothing_do_not_hold_up_the_others(tmp_path: Path) -> None:
    for number, (joints, readings) in enumerate([(0, 5), (1, 1), (3, 2), (30, 0), (300, 40)]):
        run = mornings.Morning(1075, 1, {})
        read, seen = run.joint_messages()[:joints], run.readings(0.4)[:readings]
        run.joint_messages, run.readings = (lambda *_, it=read, **__: it), (lambda *_, it=seen, **__: it)  # type: ignore[method-assign]
        bag(tmp_path / "bags" / str(number), "mcap", run)
    said = followed(tmp_path / "bags", tmp_path / "table.csv", code=1)
    assert said.count("left out: ") == 4 and "4: 1 rows" in said and "fault" not in said
    assert len(lines_of(tmp_path / "table.csv")) == 2


def test_episodes_of_a_data_set(tmp_path: Path) -> None:
    pytest.importorskip("pyarrow", reason="needs pyarrow: pip install 'body-schema[lerobot]'")
    from test_import_lerobot import data_set

    runs = [Run(seed, movements=2) for seed in (1072, 1073, 1074)]
    for run in runs[1:]:
        run.arm = runs[0].arm
    out = tmp_path / "table.csv"
    for count in (2, 3):
        shutil.rmtree(tmp_path / "set", ignore_errors=True)
        data_set(tmp_path / "set", "v3.0", runs)
        info = tmp_path / "set" / "meta" / "info.json"
        # An episode that is not counted yet is being written.
        info.write_text(json.dumps({**json.loads(info.read_text()), "total_episodes": count}))
        said = followed(tmp_path / "set", out, sensor=MARKER)
        assert said.count(": 3 rows") == (2 if count == 2 else 1), said
    rows = [line.split(",") for line in out.read_text(encoding="utf-8").splitlines()]
    assert [row[0] for row in rows[1:]] == ["set#0"] * 3 + ["set#1"] * 3 + ["set#2"] * 3
    for row, posture in zip(rows[1:], [posture for run in runs for posture in run.postures]):
        assert np.abs(np.array(row[2:8], dtype=float) - posture).max() < 2e-4
    assert "0 rows added" in followed(tmp_path / "set", out, sensor=MARKER)


def lines_of(path: Path) -> list[str]:
    return path.read_text(encoding="utf-8").splitlines() if path.exists() else []


def until(what: Any, seconds: float = 300.0) -> None:
    ends = time.monotonic() + seconds
    while not what():
        assert time.monotonic() < ends
        time.sleep(0.1)


def heeding_interrupts() -> None:
    """What is started in the background by a shell would not."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
def test_a_cell_that_is_watched(binary: Path, tmp_path: Path) -> None:
    """Beside `watch --follow`; the one that follows is killed, and begun again."""
    first = mornings.first(tmp_path)
    assert main(["import", str(first), *ROBOT, "--sensor", "tag=/mocap/tag", "--max-offset", "1", "--out", str(tmp_path / "arm")]) == 0
    folder, out, log = tmp_path / "mornings", tmp_path / "mornings.csv", tmp_path / "alarms.jsonl"
    folder.mkdir()
    own = [sys.executable, "-m", "body_schema", "import", "--follow", str(folder), *ROBOT, *SENSOR, "--settle", "0.5", "--out", str(out)]
    following = subprocess.Popen(own, stdout=subprocess.PIPE, text=True, preexec_fn=heeding_interrupts)
    until(out.exists)
    watch = [str(binary), "watch", str(tmp_path / "arm" / "first.toml"), "--table", str(out), "--follow", "--log", str(log)]
    watching = subprocess.Popen(watch, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    try:
        for day in (1, 2, 8):
            mornings.morning(folder, day)
            if day == 2:
                following.kill()
                following.wait()
                following = subprocess.Popen(own, stdout=subprocess.PIPE, text=True, preexec_fn=heeding_interrupts)
            until(lambda: any(line.startswith(mornings.name_of(day)) for line in lines_of(out)))
        until(lambda: any('"alarm"' in line for line in lines_of(log)))
    finally:
        following.send_signal(signal.SIGINT)
        watching.send_signal(signal.SIGINT)
        said, seen = following.communicate(timeout=120)[0], watching.communicate(timeout=120)[0]
    assert following.returncode == 0 and f"{mornings.name_of(8)}: 4 rows" in said, said
    assert watching.returncode == 1 and f"the zero of {mornings.JOINT} has moved by -1.0" in seen, seen
    names = [line.split(",")[0] for line in lines_of(out)[1:]]
    assert names == [mornings.name_of(day) for day in (1, 2, 8) for _ in range(4)] == [it for it in names if it]
    assert recordings_of(out) == [mornings.name_of(day) for day in (1, 2, 8)]
