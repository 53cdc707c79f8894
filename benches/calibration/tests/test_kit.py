"""The kit: its kinematics against another library's where there is one, its Jacobian against differences."""

import json
import shutil
from pathlib import Path

import kinematics
import numpy as np
import pytest
from harness import protocol, sets, splits

HERE = Path(__file__).resolve().parent.parent


def test_rotations_there_and_back():
    random = np.random.default_rng(5)
    vectors = random.normal(0, 1.2, (200, 3))
    vectors *= np.minimum(1, 3.0 / np.linalg.norm(vectors, axis=1))[:, None]
    matrices = kinematics.rotation(vectors)
    assert np.abs(kinematics.rotation_vector(matrices) - vectors).max() < 1e-9
    assert np.abs(kinematics.of_quaternion(kinematics.quaternion(matrices)) - matrices).max() < 1e-12
    assert np.abs(matrices @ np.swapaxes(matrices, 1, 2) - np.eye(3)).max() < 1e-12


@pytest.mark.parametrize("name", ["tiago", "fr3", "panda-sockets"])
def test_the_jacobian_is_that_of_differences(tmp_path, monkeypatch, name):
    kit = pytest.importorskip("_kit")
    of = sets.load(HERE / "sets" / f"{name}.json")
    split = splits.split(of, 0)
    (tmp_path / "task.json").write_text(json.dumps(protocol.task_of(of, split)))
    shutil.copy(of.urdf, tmp_path / "robot.urdf")
    task = kit.Task(str(tmp_path))
    task.rows, task.readings = list(range(9)), split.pool.readings[:9]
    model = kit.Model(task)
    start = model.rigid()
    # Near what is measured, where the rotation's residual is small.
    x = start + 1e-3 * np.random.default_rng(2).normal(size=model.size)
    q = task.pool[task.rows]
    _, j = model.residuals(q, task.readings, x)
    step = 1e-6 * np.eye(model.size)
    by = [(model.residuals(q, task.readings, x + d)[0] - model.residuals(q, task.readings, x - d)[0]) / 2e-6 for d in step]
    assert np.abs(np.array(by).T - j).max() < 0.02 * np.abs(j).max()
