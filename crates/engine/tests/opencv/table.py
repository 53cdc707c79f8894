"""Writes table.csv, what OpenCV makes of random points in front of cameras with lenses: python table.py > table.csv

Of `cv2.projectPoints` and `cv2.fisheye.projectPoints`, of points where the lens holds: within the radius up to which the picture grows by
a tenth to six times what a pinhole's would.
"""

import cv2
import numpy as np

LENSES = [
    ("brown", [-0.3, 0.1, 0.0, 0.0]),
    ("brown", [-0.31, 0.12, 0.0011, -0.0007]),
    ("brown", [0.18, -0.05, -0.002, 0.0015, 0.03]),
    ("brown", [-0.42, 0.21, 0.0005, 0.0003, -0.06]),
    ("brown", [0.4, -0.3, 0.0004, -0.0009, 0.02, 0.71, -0.13, 0.01]),
    ("brown", [6.1, 2.4, 0.0002, -0.0001, 0.11, 6.4, 4.3, 0.65]),
    ("fisheye", [0.0, 0.0, 0.0, 0.0]),
    ("fisheye", [-0.013, 0.02, -0.011, 0.002]),
    ("fisheye", [0.08, -0.03, 0.004, -0.0006]),
]
FOCAL, CENTRE = (512.3, 498.7), (321.9, 237.4)


def project(model, k, points):
    matrix = np.array([[FOCAL[0], 0, CENTRE[0]], [0, FOCAL[1], CENTRE[1]], [0, 0, 1.0]])
    if model == "fisheye":
        found, _ = cv2.fisheye.projectPoints(points.reshape(-1, 1, 3), np.zeros(3), np.zeros(3), matrix, np.array(k))
    else:
        found, _ = cv2.projectPoints(points.reshape(-1, 1, 3), np.zeros(3), np.zeros(3), matrix, np.array(k))
    return found.reshape(-1, 2)


def holds(model, k, tangent):
    ramp = np.stack([np.linspace(1e-4, tangent, 400), np.zeros(400), np.ones(400)], axis=1)
    radial = list(k)
    if model == "brown":
        radial[2:4] = [0.0, 0.0]
    u = project(model, radial, ramp)[:, 0] / FOCAL[0]
    across = np.arctan(ramp[:, 0]) if model == "fisheye" else ramp[:, 0]
    slope = np.diff(u) / np.diff(across)
    return bool(np.all((slope > 0.1) & (slope < 6.0)))


rng = np.random.default_rng(1001)
print(f"# OpenCV {cv2.__version__}: model,k (8, then zeros),x,y,z,u,v; focal {FOCAL}, centre {CENTRE}")
for model, k in LENSES:
    count = 0
    while count < 12:
        x, y, z = rng.uniform(-1.5, 1.5), rng.uniform(-1.5, 1.5), rng.uniform(0.2, 2.5)
        if not holds(model, k, np.hypot(x, y) / z) or np.hypot(x, y) / z > 4:
            continue
        (u, v), = project(model, k, np.array([[x, y, z]]))
        numbers = [*k, *[0.0] * (8 - len(k)), x, y, z, u, v]
        print(model, *(repr(float(n)) for n in numbers), sep=",")
        count += 1
