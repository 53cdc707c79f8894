"""The robot as it is described: base and targets are fitted, the chain is left alone."""

import numpy as np
from _kit import Model, main, noise_of


def play(task):
    for budget in task.budgets:
        task.fill(budget)
        model = Model(task)
        x = model.rigid()
        r, j = model.residuals(task.pool[task.rows], task.readings, x)
        free = np.arange(model.joints.stop, model.size)
        prior = 1.0 / model.deviations_of_prior()[free] ** 2
        scale, noise = noise_of(model, r, len(free))
        covariance = np.zeros((model.size, model.size))
        covariance[np.ix_(free, free)] = np.linalg.inv(j[:, free].T @ j[:, free] / scale**2 + np.diag(prior))
        model.predict(x, covariance, noise)


if __name__ == "__main__":
    main("nominal", "1", play)
