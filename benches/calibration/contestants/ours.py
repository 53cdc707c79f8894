"""This project: ``body_schema.calibrate`` with default settings; rows chosen by a session's learner ``global``.

Variants: ``choose`` (i, d, a: the criterion; r: random rows) and ``model`` (extended: with the corrections that are kept; axes).
The default, named before anything was measured, is ``i extended``. The package has no deviations of the extended model, so that
P is that of its axes, σ what the extended model leaves of the training rows; both by Student's factor, as ``covariance(reading=True)``. Of sockets rows are random: a session
aims at sockets, and cannot be held to a list.
"""

import csv
import hashlib
import json
import math
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import body_schema
import numpy as np
import yaml
from _kit import Model, Task, main, of_rpy, pose, quaternion


def channel(sensor):
    made = {"target": sensor["target"], "channel": sensor["kind"], "sigma_m": sensor["sigma_m"]}
    if sensor["kind"] == "pose":
        made["sigma_deg"] = math.degrees(sensor["sigma_rad"])
    return made


def chooser(task: Task, criterion: str):
    """A session that chooses among the pool's postures."""
    robot = task.said["robot"]
    at = np.clip(task.pool, [joint.lower for joint in task.chain.joints], [joint.upper for joint in task.chain.joints])
    scale = np.array([1.0 if joint.slides else 180 / math.pi for joint in task.chain.joints])
    # The nearest double below or above a limit in degrees may be beyond it in radians.
    margin = 1e-9
    lower = np.array([joint.lower for joint in task.chain.joints]) * scale + margin
    upper = np.array([joint.upper for joint in task.chain.joints]) * scale - margin
    session = body_schema.Session.from_config({
        "robot": {"urdf": task.urdf.read_text(), "base": robot["base"], "tip": robot["tip"]},
        "sensor": [channel(sensor) for sensor in task.sensors],
        "selection": {"criterion": criterion},
        "constraints": {"allowed_deg": np.clip(at * scale, lower, upper).tolist()},
    })
    return session, at


def reading(sensor, numbers):
    if sensor["kind"] == "position" or numbers is None:
        return numbers
    return {"position": numbers[:3], "quaternion": numbers[3:]}


def grow(task: Task, budget: int, session, at) -> None:
    """Asks for rows one by one, each where the session wants to go."""
    names = task.said["robot"]["joints"]
    while len(task.rows) < budget:
        left = [row for row in range(len(at)) if row not in task.rows]
        wanted = session.suggest()["suggestions"][0]
        aim = np.array([wanted["configuration"][name] for name in names])
        # The nearest of the rows that are left: a posture that was proposed again has one that is nearly it, or next to it.
        row = left[int(np.argmin(np.abs(at[left] - aim).max(1)))]
        (got,) = task.ask([row])
        told = {sensor["target"]: reading(sensor, numbers) for sensor, numbers in zip(task.sensors, got)}
        session.observe(dict(zip(names, at[row].tolist())), measurements=told, suggestion_id=wanted["id"])


def titles(sensor):
    if sensor["kind"] == "socket":
        return ["place", "socket"]
    return [f"{sensor['target']}_{part}" for part in ("x", "y", "z", "qx", "qy", "qz", "qw")[: 3 if sensor["kind"] == "position" else 7]]


def calibrated(task: Task):
    """``calibrate`` of the rows that were asked for."""
    with (task.folder / "rows.csv").open("w", newline="") as file:
        table = csv.writer(file)
        table.writerow([*task.said["robot"]["joints"], *(title for sensor in task.sensors for title in titles(sensor))])
        for row, channels in zip(task.rows, task.readings):
            cells = [repr(float(q)) for q in task.pool[row]]
            for sensor, numbers in zip(task.sensors, channels):
                if sensor["kind"] == "socket":
                    cells += numbers.rsplit("/", 1)
                else:
                    cells += [""] * len(titles(sensor)) if numbers is None else [repr(x) for x in numbers]
            table.writerow(cells)
    robot = task.said["robot"]
    lines = ['name = "task"', "[robot]", 'urdf = "robot.urdf"', f'base = "{robot["base"]}"', f'tip = "{robot["tip"]}"',
             "[measurements]", 'file = "rows.csv"', "[held_out]", "rows = []"]
    if task.kind == "socket":
        sensor = task.sensors[0]
        lines += ["[sockets]", *(f"{key} = {sensor[key]}" for key in ("sigma_m", "distance_m", "sigma_distance_m"))]
    else:
        for sensor in task.sensors:
            lines += ["[[sensor]]", *(f"{key} = {json.dumps(value)}" for key, value in channel(sensor).items())]
    (task.folder / "rows.toml").write_text("\n".join(lines) + "\n")
    return body_schema.calibrate(task.folder / "rows.toml")


def extended(task: Task, found) -> Model | None:
    """The extended model of ``readings.yaml``, base and targets fitted to the rows; ``None`` if no corrections were kept."""
    if "readings.yaml" not in found.files:
        return None
    said = yaml.safe_load(found.files["readings.yaml"])
    corrections = [said["readings"][joint.name] for joint in task.chain.joints]
    if all(c["ratio"] == 1 and c["sine"] == c["cosine"] == c["offset"] == 0 and not any(c.get("compliance", ())) for c in corrections):
        return None
    origins = [pose(of_rpy(np.array([it[k] for k in ("roll", "pitch", "yaw")])), np.array([it[k] for k in "xyz"]))
               for it in (said["kinematics"][joint.name] for joint in task.chain.joints)]
    # An origin in a URDF is of one joint; ours has the fixed joints before it, too.
    origins = [fixed @ origin for fixed, origin in zip(fixed_before(task), origins)]

    def motions(q):
        pulls = torques(task, said, q) if "loads" in said else np.zeros((len(q), len(corrections), 2))
        return [joint.motion(c["offset"] + c["ratio"] * q[:, k] + c["sine"] * np.sin(q[:, k]) + c["cosine"] * np.cos(q[:, k])
                             + pulls[:, k] @ np.array(c.get("compliance", (0.0, 0.0))))
                for k, (joint, c) in enumerate(zip(task.chain.joints, corrections))]

    return Model(task, origins, motions)


def fixed_before(task: Task):
    """The fixed joints before each joint that moves."""
    tree = {joint.get("name"): joint for joint in ElementTree.parse(task.urdf).getroot().findall("joint")}
    found = []
    for joint in task.chain.joints:
        origin = tree[joint.name].find("origin")
        xyz, rpy = ((origin.get(key) if origin is not None else None) or "0 0 0" for key in ("xyz", "rpy"))
        own = pose(of_rpy(np.array([float(x) for x in rpy.split()])), np.array([float(x) for x in xyz.split()]))
        found.append(joint.origin @ np.linalg.inv(own))
    return found


def torques(task: Task, said, q):
    """τ of target and elbow at every joint, as ``readings.yaml`` defines it, of the chain as described: (rows, joints, 2)."""
    loads, chain = said["loads"], task.chain
    up, count = np.array(loads["up"]), len(chain.joints)
    zero, _ = chain.frames(np.zeros((1, count)))
    frames, _ = chain.frames(q)
    pulls = np.zeros((len(q), count, 2))
    for which, load in enumerate(("target", "elbow")):
        # The link that carries it: the last joint whose child link it is; the tip's behind all. On the base nothing bears it.
        last = carrier(task, loads[load]["link"])
        if last is None:
            continue
        behind = np.linalg.inv(zero[last][0] @ chain.joints[last].motion(np.zeros(1))[0]) @ np.append(loads[load]["at_m"], 1.0)
        place = (frames[last] @ chain.joints[last].motion(q[:, last]) @ behind)[:, :3]
        for k in range(last + 1):
            if not chain.joints[k].slides:
                axis = frames[k][:, :3, :3] @ chain.joints[k].axis
                pulls[:, k, which] = -loads["gravity"] * np.cross(axis, place - frames[k][:, :3, 3]) @ up
    return pulls


def carrier(task: Task, link: str) -> int | None:
    """The index of the joint that moves a link; ``None`` of the base."""
    by_child = {joint.find("child").get("link"): joint for joint in ElementTree.parse(task.urdf).getroot().findall("joint")}
    names = [joint.name for joint in task.chain.joints]
    while link in by_child and by_child[link].get("name") not in names:
        link = by_child[link].find("parent").get("link")
    if link not in by_child:
        return None
    return names.index(by_child[link].get("name"))


def deliver(task: Task, found, want_extended: bool) -> None:
    report = found.report
    noise = {n["sensor"]: n for n in report["noise"] if n["unit"] == "m"}
    sigma = np.array([(noise.get(s["target"]) or {}).get("explaining_sigma") or s["sigma_m"] for s in task.sensors])
    freedom = np.array([(noise.get(s["target"]) or {}).get("degrees", math.inf) for s in task.sensors])
    # So many equations count as one where targets of one link err together.
    shared = np.array([(noise.get(s["target"]) or {}).get("shared", 1.0) for s in task.sensors])
    spread = np.array([np.diag(found.covariance(q.tolist())) for q in task.test]).clip(0)
    model = extended(task, found) if want_extended else None
    axes = None
    if model:
        x = model.rigid()
        poses, _ = model.place(task.test, x, False)
        left, _ = model.place(task.pool[task.rows], x, False)
        if task.kind != "socket":
            for s in range(len(task.sensors)):
                off = [left[s, k, :3, 3] - row[s][:3] for k, row in enumerate(task.readings) if row[s] is not None]
                # Degrees of freedom: as the report has them, less the corrections.
                n = noise[task.sensors[s]["target"]]
                kept = next((trial["parameters"] for trial in report["extras"] if trial["kept"]), 0)
                freedom[s] = max(n["degrees"] - kept / len(task.sensors), 0.1 * 3 * len(off))
                sigma[s] = math.sqrt(float(np.sum(np.square(off))) / freedom[s])
    else:
        names = [None] if task.kind == "socket" else [sensor["target"] for sensor in task.sensors]
        poses = np.array([[found.fk(q.tolist(), of=name) for q in task.test] for name in names])
        if task.kind != "socket":
            axes = learned_axes(task, found)
    mean = np.moveaxis(poses[..., :3, 3], 0, 1)
    if task.kind == "pose":
        mean = np.concatenate([mean, np.moveaxis(quaternion(poses[..., :3, :3]), 0, 1)], -1)
    student = 1 + 2 / (freedom / shared + 1)
    sd = np.sqrt((spread[:, None, :] + (sigma**2)[None, :, None]) * student[None, :, None])
    task.predict(mean, sd, axes)


def learned_axes(task: Task, found):
    """Axes of ``calibrated.urdf`` with all joints at 0, in the frame of the measurements."""
    path = task.folder / "calibrated.urdf"
    path.write_text(found.files["calibrated.urdf"])
    chain = type(task.chain).of_urdf(path, task.said["robot"]["base"], task.said["robot"]["tip"])
    base = found.report["base"]
    return chain.axes(pose(of_rpy(np.array(base["rpy_rad"])), np.array(base["xyz_m"])))


def play(task: Task, choose="i", model="extended"):
    choosing = choose != "r" and task.kind != "socket"
    if choosing:
        session, at = chooser(task, choose)
    for budget in task.budgets:
        if choosing and budget < len(task.pool):
            grow(task, budget, session, at)
        else:
            task.fill(budget)
        deliver(task, calibrated(task), model == "extended")


if __name__ == "__main__":
    # Two builds of one version are two contestants.
    build = hashlib.sha256(Path(body_schema._engine.__file__).read_bytes()).hexdigest()[:8]
    main("body-schema", f"{body_schema.__version__}, build {build}", play)
