"""What a run found: zeros, play, links, and how well the tag is predicted."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._errors import Error, FieldError
from .._session import Session
from .._transforms import Pose, dot, of_rpy, rotation_vector, times, transposed, vector
from .._urdf import Tree, parse_urdf
from ..answers import Status
from ..exports._lerobot import MOTORS
from ..vision import LENSES, Camera
from ..vision._place import Place, optical_pose, place_of
from ..vision._targets import rigid_motion
from ._loop import FEWEST, Run, Stop
from ._setup import Setup
from ._simulated import Truth

Floats = NDArray[np.float64]


LONGER = 0.01
"""Upper arm and forearm that are longer by this share, both: half a millimetre, which is what is known of each, makes less than half of it."""
OTHER_LINK = (10.0, 5.0)
"""A shift (mm) and a turn (degrees) of a link that no printed or moulded part has."""
LONG_LINKS = MOTORS[2:4]
"""The joints at the ends of upper arm and forearm."""

PIXEL, READING_DEG = 0.1, 0.05
"""Noise of a corner, px, and of a reading, deg: half a step of an encoder and a servo that does not quite stand."""


@dataclass(frozen=True)
class Value:
    """An estimate with its standard deviation."""

    value: float
    sd: float

    def to_dict(self) -> dict[str, float]:
        """For a report."""
        return {"value": self.value, "sd": self.sd}


@dataclass
class Found:
    """What a run found. ``session`` is that of all stops, with links learned, its readings without play where play is known."""

    session: Session
    zeros_deg: dict[str, Value]
    half_play_deg: dict[str, Value]
    """By motor, how far it stands to either side of what it reads: half of what the two sides differ by. Empty without such postures."""
    links: dict[str, dict[str, list[float]]]
    """By joint, by how much its origin was moved in the frame before it (``shift_mm``), and turned but for its zero (``turn_deg``, a
    rotation vector in its own frame)."""
    pairs: int
    seen: int
    expected_mm: float | None
    play_mm: float | None
    """By how much (rms over the postures) play alone moves the tag where nobody cares from which side a posture is approached."""
    doubts: list[str] = field(default_factory=list)
    camera: Camera | None = None
    """The camera's intrinsics where they were learned, ..."""
    camera_sd: dict[str, float] = field(default_factory=dict)
    """... and their standard deviations: ``fx``, ``fy``, ``cx``, ``cy`` (px) and coefficients of the lens."""


def conclude(setup: Setup, run: Run) -> Found:
    """All that the stops of a run say. Raises ``Error`` where they are too few."""
    seen = [stop for stop in run.stops if stop.seen]
    if len(seen) < FEWEST:
        what = f"the tag was seen in {len(seen)} of {len(run.stops)} movements, and {FEWEST} are needed"
        raise Error(f"{what}; look at the reasons above, turn the camera towards the gripper, and begin again")
    first = _fitted(setup, run.stops, {})
    # Where things stand is told by pixels of a pinhole; sessions learn a camera that is a guess by pixels as they are.
    straight, seen = _straightened(setup, first, seen)
    place, tree = _placed(straight, first, seen)
    half, pairs = _half_play(straight, place, tree, seen)
    # Play that is known is no noise: readings are those of the middle between both sides.
    known = {name: it.value for name, it in half.items() if it.value > 3 * it.sd}
    session = _fitted(setup, run.stops, known) if known else first
    zeros, links = _corrections(setup, session)
    status = session.status()
    play_mm = _play_mm(straight, place, tree, seen, half)
    found = Found(session, zeros, half, links, pairs, sum(stop.seen for stop in run.stops), status.get("expected_error_mm"), play_mm)
    if setup.camera.is_guess:
        found.camera, found.camera_sd = _learned_camera(setup.camera, session)
    found.doubts = _doubts(straight, place, found, status)
    return found


def _fitted(setup: Setup, stops: Sequence[Stop], half_play_deg: dict[str, float]) -> Session:
    """A session with links of all stops, their readings in the middle of the play: a joint that came from above stands above."""
    session = setup.session(links=True)
    for stop in stops:
        told = {name: it + stop.side * math.radians(half_play_deg.get(name, 0.0)) for name, it in stop.reading.items()}
        session.observe(told, suggestion_id=None, measurements=stop.measurements)
    return session


def _learned_camera(camera: Camera, session: Session) -> tuple[Camera, dict[str, float]]:
    """What a session has learned of a camera that was a guess, with standard deviations by name, those of fx, fy, cx and cy in px."""
    report = session.report()
    values = {it["name"]: it for it in (*report["intrinsics"], *report["distortion"])}
    numbers = {name: it["value"] for name, it in values.items()}
    lens = tuple(numbers.get(name, 0.0) for name in LENSES[camera.model])
    try:
        learned = Camera(
            camera.size_px, (numbers["fx"], numbers["fy"]), (numbers["cx"], numbers["cy"]), lens, camera.model, camera.name
        )
    except FieldError as error:
        mend = "calibrate it with `intrinsics`, and name the file with --intrinsics"
        raise Error(f"these movements do not tell the camera's intrinsics ({error.what}); {mend}") from None
    return learned, {name: it["sd"] for name, it in values.items()}


def _straightened(setup: Setup, session: Session, seen: Sequence[Stop]) -> tuple[Setup, list[Stop]]:
    """The setup with the camera that a session has learned, and stops whose pixels it undistorts, but for those that its lens does not describe."""
    if not setup.camera.is_guess:
        return setup, list(seen)
    camera, _ = _learned_camera(setup.camera, session)
    stops = [replace(it, detection=replace(it.detection, undistorted=camera.undistort(it.detection.pixels))) for it in seen]
    return replace(setup, camera=camera), [it for it in stops if np.isfinite(it.detection.undistorted).all()]


def _corrections(setup: Setup, session: Session) -> tuple[dict[str, Value], dict[str, dict[str, list[float]]]]:
    """Zeros by motor, and by joint what its origin was moved and turned by: the calibrated description against the given one.

    A joint's zero is the turn of its origin about its own axis; where links are learned they do not turn about it.
    """
    model = session.model()
    learned = {it["what"]: it["coordinates"] for it in model["others"]}
    # The session's agent keeps one.
    covariance = model["covariance"] or []
    before, after = setup.tree(), parse_urdf(session.to_urdf())
    zeros, links = {}, {}
    for index, name in enumerate(MOTORS):
        was, now = before.joints[name], after.joints[name]
        turn = rotation_vector(times(transposed(was.origin.rotation), now.origin.rotation))
        about_axis = dot(turn, was.axis)
        if f"Offset({index})" in learned:
            (at,) = learned[f"Offset({index})"]
            zeros[name] = Value(math.degrees(about_axis), math.degrees(math.sqrt(max(covariance[at][at], 0.0))))
        links[name] = {
            "shift_mm": [(a - b) * 1e3 for a, b in zip(now.origin.at, was.origin.at)],
            "turn_deg": [math.degrees(a - about_axis * b) for a, b in zip(turn, was.axis)],
        }
    return zeros, links


def _frames(setup: Setup, tree: Tree, reading: dict[str, float]) -> tuple[Floats, Floats]:
    pose = tree.pose(setup.tip, setup.base, reading)
    return np.array(pose.rotation), np.array(pose.at)


def _placed(setup: Setup, session: Session, seen: Sequence[Stop]) -> tuple[Place, Tree]:
    """The calibrated description, and where camera and tag stand by it."""
    tree = parse_urdf(session.to_urdf())
    frames = [_frames(setup, tree, stop.reading) for stop in seen]
    mounted = np.array(of_rpy([math.radians(it) for it in setup.tag_rpy_deg]))
    guess = (*optical_pose(setup.camera_at, setup.looks_at), mounted, np.array(setup.tag_at))
    detections = [stop.detection for stop in seen]
    turns, places = [it[0] for it in frames], [it[1] for it in frames]
    place = place_of(setup.camera, detections, turns, places, guess=guess, hold=setup.given)
    if place is None:
        raise Error("the tag's pose cannot be told in five pictures; come nearer, or print a larger tag")
    return place, tree


def _tag(setup: Setup, place: Place, tree: Tree, reading: dict[str, float]) -> Pose:
    mounted = Pose(of_rpy([math.radians(it) for it in place.target_rpy_deg]), vector(place.target_at_m))
    return tree.pose(setup.tip, setup.base, reading) @ mounted


def _place_vector(place: Place) -> Floats:
    """Camera's and tag's place: m and rad, 12 numbers."""
    angles = [math.radians(it) for it in (*place.camera_rpy_deg, *place.target_rpy_deg)]
    return np.array([*place.camera_at_m, *angles[:3], *place.target_at_m, *angles[3:]])


def _pixels_at(setup: Setup, places: Floats, tree: Tree, reading: Floats) -> Floats:
    """Where the tag's corners are predicted, px without the lens, 8 numbers; rad in the order of motors."""
    pose = tree.pose(setup.tip, setup.base, dict(zip(MOTORS, map(float, reading))))
    pose = pose @ Pose(of_rpy(list(places[9:12])), vector(list(places[6:9])))
    points = setup.target.points_m @ np.array(pose.rotation).T + np.array(pose.at) - places[:3]
    return setup.camera.pinhole().project(points @ np.array(of_rpy(list(places[3:6])))).ravel()


def _moved(reading: dict[str, float], name: str, by: float) -> dict[str, float]:
    return {**reading, name: reading[name] + by}


def _half_play(setup: Setup, place: Place, tree: Tree, seen: Sequence[Stop]) -> tuple[dict[str, Value], int]:
    """How far each motor stands to either side of the middle, deg: half of the difference between the two sides.

    With u the corners' pixels of a stop, û their prediction at its reading, J their derivative by the joints, s = ± 1 the side from which it
    was approached, c the places of camera and tag (12) and z the zeros: u - û = J (z + s h) + (∂û/∂c) δc, generalised least squares over
    all stops, whitened by noise of pixels and of readings. Postures that were approached from both sides tell h whatever c and z are.
    Deviations are those of the stops' scores (sandwich), so that play that differs from posture to posture widens them.
    """
    pairs = [stop.posture for stop in seen if stop.side > 0]
    both = len({stop.posture for stop in seen if stop.side < 0} & set(pairs))
    if both < 2:
        return {}, both
    rows, values = [], []
    for stop in seen:
        at, reading = _place_vector(place), np.array([stop.reading[name] for name in MOTORS])
        jacobian = _slope(lambda it: _pixels_at(setup, at, tree, it), reading) * (math.pi / 180)
        places = _slope(lambda it: _pixels_at(setup, it, tree, reading), at)
        places[:, [setup.given[0]] * 6 + [setup.given[1]] * 6] = 0.0
        off = stop.detection.undistorted.ravel() - _pixels_at(setup, at, tree, reading)
        noise = PIXEL**2 * np.eye(len(off)) + READING_DEG**2 * jacobian @ jacobian.T
        white = np.linalg.inv(np.linalg.cholesky(noise))
        rows.append(white @ np.hstack([stop.side * jacobian, jacobian, places]))
        values.append(white @ off)
    count = len(MOTORS)
    all_of = np.concatenate(rows)
    # Scaled columns, so that the directions that nothing tells (a turn of base and camera) are cut off by their size alone.
    scale = np.maximum(np.linalg.norm(all_of, axis=0), 1e-9)
    inverse = np.linalg.pinv(all_of / scale, rcond=1e-7) / scale[:, None]
    found = inverse @ np.concatenate(values)
    scores, start = np.zeros((count, count)), 0
    for row, value in zip(rows, values):
        part = inverse[:count, start : start + len(value)] @ (value - row @ found)
        scores += np.outer(part, part)
        start += len(value)
    freedom = len(seen) / max(len(seen) - len(found) / 4, 1.0)
    return {name: Value(float(found[k]), math.sqrt(float(scores[k, k]) * freedom)) for k, name in enumerate(MOTORS)}, both


def _slope(function: Callable[[Floats], Floats], at: Floats) -> Floats:
    """The Jacobian by central differences."""
    columns = []
    for index in range(len(at)):
        step = np.zeros(len(at))
        step[index] = 1e-5
        columns.append((function(at + step) - function(at - step)) / 2e-5)
    return np.column_stack(columns)


def _play_mm(setup: Setup, place: Place, tree: Tree, seen: Sequence[Stop], half: dict[str, Value]) -> float | None:
    if not half:
        return None
    total = 0.0
    for stop in seen:
        for name, it in half.items():
            ends = [np.array(_tag(setup, place, tree, _moved(stop.reading, name, by)).at) for by in (1e-4, -1e-4)]
            slope = float(np.linalg.norm(ends[0] - ends[1])) / 2e-4
            total += (slope * math.radians(it.value)) ** 2
    return 1e3 * math.sqrt(total / len(seen))


def _longer(setup: Setup, links: dict[str, dict[str, list[float]]]) -> float:
    """How many times as long as described upper arm and forearm came out, both of them: 1 + the mean of d·l / l·l, d by how much the origin l moved. 1 where
    they differ in that by more than a half: then one of them is other than described. Where the shoulder is, is one with where the base stands.
    """
    described = {name: setup.tree().joints[name].origin.at for name in LONG_LINKS}
    shares = [dot([it / 1e3 for it in links[name]["shift_mm"]], at) / dot(at, at) for name, at in described.items()]
    least, most = sorted(shares, key=abs)
    return 1.0 + sum(shares) / 2 if least * most > 0 and abs(least) > 0.5 * abs(most) else 1.0


def _other_links(links: dict[str, dict[str, list[float]]]) -> dict[str, tuple[float, float]]:
    """The links that came out as no part of the described arm is, with their shift (mm) and turn (degrees)."""
    found = {name: (math.hypot(*it["shift_mm"]), math.hypot(*it["turn_deg"])) for name, it in links.items()}
    return {name: it for name, it in found.items() if it[0] > OTHER_LINK[0] or it[1] > OTHER_LINK[1]}


def _doubts(setup: Setup, place: Place, found: Found, status: Status) -> list[str]:
    doubts = []
    longer, size = _longer(setup, found.links), setup.target.size_m * 1e3
    lens = "" if found.camera is not None else ", or the camera's intrinsics are wrong by as much"
    if abs(longer - 1) > LONGER:
        doubts.append(
            f"upper arm and forearm came out {longer:.3f} times as long as described: by the arm's lengths the tag's black square is {size / longer:.1f} mm, "
            f"and --tag says {size:.1f}{lens}: measure it, and begin again, since the zeros are wrong too"
        )
    elif abs(place.scale - 1) > max(0.02, 4 * place.scale_sd):
        doubts.append(
            f"the tag seems {place.scale:.3f} ± {place.scale_sd:.3f} times as large as --tag says, by the arm's lengths: measure its black square{lens}"
        )
    if other := _other_links(found.links):
        far, turned = (max(column) for column in zip(*other.values()))
        doubts.append(
            f"{', '.join(other)} came out up to {far:.0f} mm and {turned:.1f} degrees other than described, as no part of this arm is: the zeros are wrong "
            "too; see whether the description is this arm's, and --tag, --fov-deg and --camera-at are right, and begin again"
        )
    if place.rms_px > 15:
        doubts.append(
            f"pictures are missed by {place.rms_px:.0f} px: check that the description is this arm's, that the tag does not move on the "
            "gripper, and that the camera does not move"
        )
    metres, degrees = setup.camera_within
    away = math.dist(place.camera_at_m, setup.camera_at)
    ahead = np.array(setup.looks_at) - np.array(setup.camera_at)
    turn = np.array(of_rpy([math.radians(it) for it in place.camera_rpy_deg]))
    off = math.degrees(math.acos(max(-1.0, min(1.0, float(turn[:, 2] @ ahead) / float(np.linalg.norm(ahead))))))
    if away > 2 * metres + 0.01 or off > 2 * degrees + 2:
        at = " ".join(f"{it:.2f}" for it in place.camera_at_m)
        doubts.append(f"the camera seems to stand {away * 1e3:.0f} mm and {off:.0f} degrees from where it was said: try --camera-at {at}")
    if status.get("failure"):
        doubts.append(str(status["failure"]))
    # One or two are outweighed, and happen by chance.
    if len(outliers := status.get("outliers") or []) > 2:
        doubts.append(f"movements {', '.join(map(str, outliers))} do not fit the others: the tag or the camera may have been touched")
    for name, it in found.zeros_deg.items():
        if it.sd > 0.5:
            doubts.append(f"the zero of {name} is known to {it.sd:.1f} degrees only: let the camera see more postures, and measure longer")
        if abs(it.value) > 15:
            doubts.append(
                f"{name} is off by {it.value:.0f} degrees: that is no zero set by eye; check that the description's zeros are the middles of "
                "the ranges"
            )
    return doubts


def against(setup: Setup, found: Found, truth: Truth) -> dict[str, Any]:
    """How far what was found is from the truth: zeros (deg), half of the play (deg), and the tag (mm): mean and greatest over 300 postures
    within the limits, without play, up to one rigid motion.
    """
    random = np.random.default_rng(0)
    limits, tree = setup.limits_deg(), truth.tree()
    postures = [{name: math.radians(float(random.uniform(*limits[name]))) for name in MOTORS} for _ in range(300)]
    predicted = np.array(found.session.predict(postures))
    true = np.array([truth.tag(tree, it).at for it in postures])
    turn, shift, _, _ = rigid_motion(predicted, true)
    off = 1e3 * np.linalg.norm(predicted @ turn.T + shift - true, axis=1)
    return {
        "zeros_deg": {name: it.value - truth.zeros_deg[name] for name, it in found.zeros_deg.items()},
        "half_play_deg": {name: it.value - truth.play_deg[name] / 2 for name, it in found.half_play_deg.items()},
        "tag_mm": float(off.mean()),
        "tag_greatest_mm": float(off.max()),
    }
