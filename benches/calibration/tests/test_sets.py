"""Manifests, frozen splits, and robots that are simulated."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from harness import sets, splits

HERE = Path(__file__).resolve().parent.parent
ALL = sorted((HERE / "sets").glob("*.json"))


def copied(tmp_path, **changes):
    said = json.loads((HERE / "sets" / "talos.json").read_text())
    scenarios = HERE.parent.parent / "scenarios"
    for name in ("talos.urdf", "talos-contact.csv"):
        shutil.copy(scenarios / name, tmp_path / name)
    said["urdf"]["file"], said["tables"][0]["file"] = "talos.urdf", "talos-contact.csv"
    (tmp_path / "mine.json").write_text(json.dumps({**said, **changes}))
    return tmp_path / "mine.json"


def test_all_sets_are_read_and_their_splits_are_the_frozen_ones():
    found = sets.found([HERE / "sets"])
    assert [of.name for of in found] == [path.stem for path in ALL]
    splits.check(found)
    assert set(json.loads(splits.FILE.read_text())) == {of.name for of in found}


def test_another_file_under_the_same_name_is_refused(tmp_path):
    manifest = copied(tmp_path)
    sets.load(manifest)
    with (tmp_path / "talos-contact.csv").open("a") as file:
        file.write("\n")
    with pytest.raises(sets.SetError, match="another file than the manifest means"):
        sets.load(manifest)


def test_a_set_that_is_not_here_is_left_out_with_a_word(tmp_path):
    copied(tmp_path)
    (tmp_path / "talos-contact.csv").unlink()
    said = []
    assert sets.found([tmp_path], said.append) == []
    assert said == ["mine: left out, talos-contact.csv is not here"]


def test_a_manifest_without_a_key_says_which(tmp_path):
    manifest = copied(tmp_path)
    said = json.loads(manifest.read_text())
    del said["sensors"]
    manifest.write_text(json.dumps(said))
    with pytest.raises(sets.SetError, match="sensors"):
        sets.load(manifest)


def test_joints_come_from_the_columns_that_are_named(tmp_path):
    of = sets.load(copied(tmp_path))
    joint = of.chain.joints[0].name
    table = tmp_path / "talos-contact.csv"
    titles, *lines = table.read_text().splitlines()
    index = titles.split(",").index(joint)

    def rewritten(cell, joints):
        cells = [line.split(",") for line in lines]
        changed = [",".join([*it[:index], cell(it[index]), *it[index + 1 :]]) for it in cells]
        table.write_text("\n".join([titles.replace(joint, "first_deg"), *changed]) + "\n")
        said = json.loads((tmp_path / "mine.json").read_text())
        said["tables"][0]["sha256"] = sets.digest_of(table)
        (tmp_path / "mine.json").write_text(json.dumps({**said, "joints": joints}))
        return sets.load(tmp_path / "mine.json")

    def degrees(cell):
        return repr(float(cell) * 180 / np.pi)

    named = {joint: {"column": "first_deg", "scale": np.pi / 180}}
    assert np.allclose(rewritten(degrees, named).rows.postures, of.rows.postures, atol=1e-12)
    with pytest.raises(sets.SetError, match=f"no column {joint}; name that of the joint"):
        rewritten(degrees, {})
    with pytest.raises(sets.SetError, match="line 2: '' in first_deg is no position"):
        rewritten(lambda cell: "", named)


@pytest.mark.parametrize("path", ALL, ids=lambda path: path.stem)
def test_splits_keep_postures_apart_and_come_again(path):
    of = sets.load(path)
    one, again, other = splits.split(of, 0), splits.split(sets.load(path), 0), splits.split(of, 1)
    assert one.digest == again.digest != other.digest
    assert np.array_equal(one.pool.postures, again.pool.postures)
    assert one.budgets[-1] == len(one.pool.postures)
    apart = np.abs(one.pool.postures[:, None] - one.held_out.postures[None]).max(2).min()
    assert apart > splits.REPEATS
    if of.sockets:
        places = lambda rows: {row[0].split("/")[0] for row in rows.readings}
        assert len(places(one.pool)) == 1 and not places(one.pool) & places(one.held_out)


def test_splits_that_have_changed_are_refused(tmp_path, monkeypatch):
    (tmp_path / "splits.json").write_text(json.dumps({"ur10": "0"}))
    monkeypatch.setattr(splits, "FILE", tmp_path / "splits.json")
    with pytest.raises(sets.SetError, match="not the frozen ones"):
        splits.check([sets.load(HERE / "sets" / "ur10.json")])


def test_a_simulated_robot_is_measured_where_its_axes_are():
    """Turning one joint moves the marker about its true axis: distance and height along it stay, but for the noise."""
    of = sets.load(HERE / "sets" / "sim-ur10.json")
    learn, judge = sets.simulate(of, 3)
    assert len(learn.postures) == of.simulated["rows"] and judge.axes is None
    assert np.array_equal(sets.simulate(of, 3)[0].postures, learn.postures)
    # All joints but the first decide how far the marker is from the first axis; the described robot says so to some cm.
    point, direction = (np.array(it) for it in learn.axes[0])
    found = np.array([row[0] for row in learn.readings]) - point
    away = np.linalg.norm(np.cross(found, direction), axis=1)
    described = of.chain.frames(learn.postures)[1][:, :3, 3]
    assert np.abs(away - np.linalg.norm(described[:, :2], axis=1)).max() < 0.25
