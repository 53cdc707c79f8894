"""figaroh's ``BaseCalibration``, as its examples use it: all placements (``full_params``), base and markers unknown.

Variants: its estimation methods, ``map_cv`` (priors whose width five folds choose; the default here) or ``structural`` (what QR
leaves, its own default). Deviations are J C Jᵀ + σ² with the covariance C of its ``calc_stddev`` and σ of its residuals.
"""

import csv
import sys
from importlib.metadata import version

import numpy as np
import pinocchio as pin
import yaml
from _kit import main, of_quaternion, quaternion
from figaroh.calibration.base_calibration import BaseCalibration
from figaroh.calibration.calibration_tools import calc_updated_fkm, measurement_jacobian

DOF = ("x", "y", "z", "phix", "phiy", "phiz")


class Robot:
    def __init__(self, urdf):
        self.model = pin.buildModelFromUrdf(str(urdf))
        self.data = self.model.createData()
        self.q0 = pin.neutral(self.model)


class Calibration(BaseCalibration):
    """Residuals weighted by the sensors' deviations, the only thing that the class leaves to its user."""

    weights = (1.0, 1.0)

    def cost_function(self, var):
        found = calc_updated_fkm(self.model, self.data, var, self.q_measured, self.calib_config)
        off = self._compute_logmap_residuals(self.PEE_measured, found, position_frame="world")
        return self.apply_measurement_weighting(off, *self.weights)


def rpy(numbers):
    return pin.rpy.matrixToRpy(of_quaternion(np.array(numbers)))


def calibrated(task, method):
    measured = 6 if task.kind == "pose" else 3
    names, sensors = task.said["robot"]["joints"], task.sensors
    with (task.folder / "rows.csv").open("w", newline="") as file:
        table = csv.writer(file)
        table.writerow([*names, *(f"{dof}{k + 1}" for k in range(len(sensors)) for dof in DOF[:measured])])
        for row, channels in zip(task.rows, task.readings):
            numbers = [[*c[:3], *(rpy(c[3:]) if measured == 6 else ())] for c in channels]
            table.writerow([*task.pool[row], *(x for channel in numbers for x in channel)])
    markers = [{"name": s["target"], "measurable_dof": [k < measured for k in range(6)]} for s in sensors]
    config = {
        "robot": {"name": task.said["set"]},
        "tasks": {
            "calibration": {
                "enabled": True,
                "type": "kinematic_calibration",
                "joints": {"active_joints": list(names)},
                "kinematics": {"base_frame": "universe", "tool_frame": task.said["robot"]["tip"]},
                "parameters": {"calibration_level": "full_params", "outlier_threshold": 0.05, "estimation": {
                    "method": method, "priors": {"translation": 0.005, "rotation": 0.01, "joint_offset": 0.01, "prismatic_offset": 0.005},
                }},
                "measurements": {"markers": markers, "poses": {"base_pose": None, "tool_pose": None}},
                "data": {"source_file": str(task.folder / "rows.csv"), "number_of_samples": len(task.rows)},
            }
        },
    }
    path = task.folder / "config.yaml"
    path.write_text(yaml.safe_dump(config))
    made = Calibration(Robot(task.urdf), str(path))
    made.weights = (1.0, sensors[0]["sigma_m"] / sensors[0].get("sigma_rad", 1.0))
    made.calib_config.update(known_baseframe=False, known_tipframe=False)
    made.initialize()
    result, _ = made.solve_optimisation()
    made.calc_stddev(result)
    return made, result


def play(task, method="map_cv"):
    if task.kind == "socket":
        sys.exit("figaroh has no sockets")
    measured = 6 if task.kind == "pose" else 3
    for budget in task.budgets:
        task.fill(budget)
        made, result = calibrated(task, method)
        config = made.calib_config
        r = result.fun[: len(made.PEE_measured)].reshape(len(task.sensors), measured, -1)
        degrees = max(made.residual_dof, 0.1 * r.size) / r.size
        sigma = np.sqrt((r[:, :3] ** 2).mean((1, 2)) / degrees)
        q = np.tile(made.robot.q0, (len(task.test), 1))
        q[:, config["config_idx"]] = task.test
        config["NbSample"] = len(q)
        found = calc_updated_fkm(made.model, made.data, result.x, q, config).reshape(len(task.sensors), measured, len(q))
        mean = np.moveaxis(found, 2, 0)
        if measured == 6:
            turned = quaternion(np.array([[pin.rpy.rpyToMatrix(m[3:]) for m in row] for row in mean]))
            mean = np.concatenate([mean[..., :3], turned], -1)
        spread = np.zeros((len(q), len(task.sensors), 3))
        if made._C_param is not None:
            j = measurement_jacobian(made.model, made.data, result.x, q, config)
            by = np.einsum("ip,pq,iq->i", j, made._C_param, j).clip(0)
            spread = np.moveaxis(by.reshape(len(task.sensors), measured, len(q)), 2, 0)[..., :3]
        task.predict(mean, np.sqrt(spread + (sigma**2)[None, :, None]))


if __name__ == "__main__":
    main("figaroh", version("figaroh"), play)
