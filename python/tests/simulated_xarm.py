"""The arm of docs/xarm.md: a simulated xArm 7 with a tag on its flange, and the pictures that a camera takes of it.

``python simulated_xarm.py DIR`` writes what its owner would have: xarm7.urdf, camera.yaml, joints.csv and pictures. The true
arm is truth.urdf, whose origins are off by up to 2 mm and 2 mrad.
``python simulated_xarm.py DIR FILE.yaml`` says how far the flange is from the truth by xarm7.urdf and by a kinematics file.
"""

from __future__ import annotations

import csv
import random
import sys
from pathlib import Path

import cv2
import numpy as np
import yaml
from export_robots import disturbed, forward, motion, turn
from rendered import Lens, render, rotation, square, tag_sheet

from body_schema.vision._place import optical_pose

ORIGINS = [
    ((0, 0, 0.267), 0.0),
    ((0, 0, 0), -1.5708),
    ((0, -0.293, 0), 1.5708),
    ((0.0525, 0, 0), 1.5708),
    ((0.0775, -0.3425, 0), 1.5708),
    ((0, 0, 0), 1.5708),
    ((0.076, 0.097, 0), -1.5708),
]
"""Origins of xArm 7 as ``xarm_description`` has them: xyz, m, and roll, rad."""
LIMITS = [(-6.28, 6.28), (-2.05, 2.09), (-6.28, 6.28), (-0.19, 3.92), (-6.28, 6.28), (-1.69, 3.14), (-6.28, 6.28)]
JOINTS = [f"joint{it + 1}" for it in range(7)]
SIZE_M, ID = 0.06, 3
LENS = Lens(size=(1280, 960), focal=(1200.0, 1200.0), centre=(639.5, 479.5), k=(-0.1, 0.02, 0.0, 0.0, 0.0))
AT, LOOKS_AT = (1.25, -0.55, 0.75), (0.42, 0.0, 0.35)
MOUNTED = (rotation([0, 0, 1], 12) @ rotation([1, 0, 0], 3), np.array([0.012, -0.008, 0.031]))


def urdf() -> str:
    links = ["link_base", *(f"link{it + 1}" for it in range(7))]
    parts = [f'<link name="{it}"/>' for it in [*links, "link_eef"]]
    for index, ((xyz, roll), (low, high)) in enumerate(zip(ORIGINS, LIMITS)):
        at = " ".join(map(str, xyz))
        parts.append(
            f'<joint name="{JOINTS[index]}" type="revolute"><parent link="{links[index]}"/><child link="{links[index + 1]}"/>'
            f'<origin xyz="{at}" rpy="{roll} 0 0"/><axis xyz="0 0 1"/>'
            f'<limit lower="{low}" upper="{high}" effort="50" velocity="3.14"/></joint>'
        )
    parts.append('<joint name="joint_eef" type="fixed"><parent link="link7"/><child link="link_eef"/></joint>')
    return '<?xml version="1.0"?>\n<robot name="xarm7">\n' + "\n".join(parts) + "\n</robot>\n"


def seen(truth: str, posture: dict[str, float]) -> tuple[np.ndarray, np.ndarray] | None:
    """The tag in the camera's optical frame, where the camera sees the whole of it at less than 60 degrees."""
    flange = forward(truth, "link_base", "link_eef", posture)
    camera_turn, camera_place = optical_pose(AT, LOOKS_AT)
    turned = camera_turn @ flange[:3, :3] @ MOUNTED[0]
    place = camera_turn @ (flange[:3, :3] @ MOUNTED[1] + flange[:3, 3]) + camera_place
    if flange[2, 3] < 0.1 or place[2] < 0.3 or -(turned[:, 2] @ place) / np.linalg.norm(place) < 0.5:
        return None
    pixels = LENS.projected(1.4 * square(SIZE_M) @ turned.T + place)
    return (turned, place) if ((pixels > 8) & (pixels < np.array(LENS.size) - 9)).all() else None


def write(folder: Path, count: int = 40, seed: int = 1) -> None:
    (folder / "pictures").mkdir(parents=True)
    truth = disturbed(urdf(), seed=seed, size=0.002)
    (folder / "xarm7.urdf").write_text(urdf())
    (folder / "truth.urdf").write_text(truth)
    camera = {
        "image_width": LENS.size[0],
        "image_height": LENS.size[1],
        "camera_name": "camera",
        "camera_matrix": {"rows": 3, "cols": 3, "data": LENS.matrix.ravel().tolist()},
        "distortion_model": "plumb_bob",
        "distortion_coefficients": {"rows": 1, "cols": 5, "data": list(LENS.k)},
    }
    (folder / "camera.yaml").write_text(yaml.safe_dump(camera, sort_keys=False))
    sheet = tag_sheet("DICT_APRILTAG_36h11", ID, SIZE_M)
    draw = random.Random(seed)
    with (folder / "joints.csv").open("w", newline="") as file:
        table = csv.writer(file)
        table.writerow(["image", *(f"{it}_deg" for it in JOINTS)])
        shots = 0
        while shots < count:
            # As the SDK's get_servo_angle reads them: degrees.
            reads = [round(float(np.degrees(draw.uniform(max(low, -1.8), min(high, 1.8)))), 3) for low, high in LIMITS]
            found = seen(truth, dict(zip(JOINTS, np.radians(reads))))
            if found is None:
                continue
            shots += 1
            name = f"{shots:02}.png"
            cv2.imwrite(str(folder / "pictures" / name), render(LENS, [sheet], *found, seed=1000 * seed + shots))
            table.writerow([name, *reads])


def apart(points: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Distances in mm, after the rigid motion that fits best: nothing tells where the base stands."""
    a, b = points - points.mean(0), truth - truth.mean(0)
    u, _, v = np.linalg.svd(a.T @ b)
    r = v.T @ np.diag([1, 1, np.linalg.det(v.T @ u.T)]) @ u.T
    return 1e3 * np.linalg.norm(a @ r.T - b, axis=1)


def judge(folder: Path, file: Path, count: int = 1000) -> None:
    rows = yaml.safe_load(file.read_text())["kinematics"]
    truth, described, calibrated = [], [], []
    before, after = (folder / "xarm7.urdf").read_text(), (folder / "truth.urdf").read_text()
    draw = random.Random(7)
    while len(truth) < count:
        posture = {name: draw.uniform(max(low, -1.8), min(high, 1.8)) for name, (low, high) in zip(JOINTS, LIMITS)}
        m = np.eye(4)
        for name in JOINTS:
            its = rows[name]
            m = m @ motion([its[key] for key in "xyz"], [its[key] for key in ("roll", "pitch", "yaw")]) @ turn((0, 0, 1), posture[name])
        truth.append(forward(after, "link_base", "link_eef", posture)[:3, 3])
        described.append(forward(before, "link_base", "link_eef", posture)[:3, 3])
        calibrated.append(m)
    at, axis = np.array([m[:3, 3] for m in calibrated]), np.array([m[:3, 2] for m in calibrated])
    for name, points in (("xarm7.urdf", np.array(described)), (file.name, at)):
        off = apart(points, np.array(truth))
        print(f"{name}: the flange is off by {off.mean():.2f} mm on average, {off.max():.2f} mm at most")
    # A tag at an unknown place does not tell where on the last axis the flange is.
    off = min((apart(at + axis * z, np.array(truth)) for z in np.arange(-3e-3, 3e-3, 2e-5)), key=np.mean)
    print(f"{file.name}: {off.mean():.2f} mm on average, {off.max():.2f} mm at most, but for where on the last axis the flange is")


if __name__ == "__main__":
    if len(sys.argv) == 2:
        write(Path(sys.argv[1]))
    else:
        judge(Path(sys.argv[1]), Path(sys.argv[2]))
