"""Pinocchio's model with SciPy: small motions of all joint placements, without a prior, in the directions that the rows determine.

Kinematics and Jacobians are Pinocchio's. The singular vectors of the first Jacobian whose singular values are above 1 per 0.01 rad
or 5 mm, i.e. which noise as stated leaves better known than the description, are fitted by ``least_squares`` with a robust loss.
"""

import sys

import numpy as np
import pinocchio as pin
import scipy
from _kit import Model, main, noise_of
from scipy.optimize import least_squares


class PinocchioModel(Model):
    """The kit's model with frames by Pinocchio: `place` is what differs."""

    def __init__(self, task):
        super().__init__(task)
        self.model = pin.buildModelFromUrdf(str(task.urdf))
        self.ids = [self.model.getJointId(name) for name in task.said["robot"]["joints"]]
        self.q_of = [self.model.joints[k].idx_q for k in self.ids]
        self.wide = [self.model.joints[k].nq == 2 for k in self.ids]
        self.first = self.model.jointPlacements.tolist() if hasattr(self.model.jointPlacements, "tolist") else list(self.model.jointPlacements)
        self.first = [pin.SE3(it) for it in self.first]
        self.tip_frame = self.model.getFrameId(task.said["robot"]["tip"])
        base = self.model.frames[self.model.getFrameId(task.said["robot"]["base"])]
        if base.parentJoint != 0:
            sys.exit("the base is no root of the model")
        self.to_base = base.placement.inverse()

    def place(self, q, x, jacobian=True):
        for k, joint in enumerate(self.ids):
            self.model.jointPlacements[joint] = self.first[joint] * pin.SE3(self.at(x, k))
        data, neutral = self.model.createData(), pin.neutral(self.model)
        before = pin.SE3(self.base @ self.at(x, self.n)) * self.to_base
        mounts = [pin.SE3(mount @ self.at(x, self.n + 1 + s)) for s, mount in enumerate(self.mounts)]
        frames, tips = np.empty((len(q), self.n, 4, 4)), np.empty((len(q), 4, 4))
        for row, at in enumerate(q):
            for k, (index, wide) in enumerate(zip(self.q_of, self.wide)):
                if wide:
                    neutral[index : index + 2] = np.cos(at[k]), np.sin(at[k])
                else:
                    neutral[index] = at[k]
            pin.forwardKinematics(self.model, data, neutral)
            tips[row] = (before * pin.updateFramePlacement(self.model, data, self.tip_frame)).homogeneous
            for k, joint in enumerate(self.ids):
                parent = data.oMi[self.model.parents[joint]]
                frames[row, k] = (before * parent * self.first[joint]).homogeneous
        poses = np.array([tips @ mount.homogeneous for mount in mounts])
        if not jacobian:
            return poses, None
        from _kit import left_jacobian, skew

        twists = np.zeros((len(mounts), len(q), 6, self.size))
        for s, mount in enumerate(self.mounts):
            own = self.n + 1 + s
            root = np.broadcast_to(self.base, (len(q), 4, 4))
            for k, frame in [(self.n, root), (own, tips @ mount), *((k, frames[:, k]) for k in range(self.n))]:
                r, part = frame[:, :3, :3], x[6 * k : 6 * k + 6]
                turn = r @ left_jacobian(part[3:])
                twists[s, :, :3, 6 * k : 6 * k + 3] = r
                twists[s, :, :3, 6 * k + 3 : 6 * k + 6] = -skew(poses[s][:, :3, 3] - frame[:, :3, 3] - r @ part[:3]) @ turn
                twists[s, :, 3:, 6 * k + 3 : 6 * k + 6] = turn
        return poses, twists


def play(task):
    for budget in task.budgets:
        task.fill(budget)
        model = PinocchioModel(task)
        q = task.pool[task.rows]
        start = model.rigid()
        sd = model.deviations_of_prior()
        _, j = model.residuals(q, task.readings, start)
        _, values, directions = np.linalg.svd(j * sd, full_matrices=False)
        known = directions[values > 1.0]
        step = (sd[:, None] * known.T)

        def residuals(y):
            return model.residuals(q, task.readings, start + step @ y)[0]

        def jacobian(y):
            return model.residuals(q, task.readings, start + step @ y)[1] @ step

        y = least_squares(residuals, np.zeros(len(known)), jacobian, loss="soft_l1", f_scale=3.0, max_nfev=30, ftol=1e-6).x
        x = start + step @ y
        r, j = model.residuals(q, task.readings, x)
        # A direction that is fitted away by as many rows leaves no noise to see; not less than is stated then.
        scale, noise = noise_of(model, r, len(known))
        if len(r) <= len(known) + 3:
            scale, noise = 1.0, np.array([sensor["sigma_m"] for sensor in task.sensors])
        h = (j @ step).T @ (j @ step) / scale**2 + np.eye(len(known))
        model.predict(x, step @ np.linalg.inv(h) @ step.T, noise)


if __name__ == "__main__":
    main("Pinocchio with SciPy", f"{pin.__version__} with {scipy.__version__}", play)
