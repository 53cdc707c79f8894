"""What a run needs of an arm: four methods. The real one, through the package ``lerobot``, and a recorded one."""

from __future__ import annotations

import importlib
import json
import math
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Protocol

import cv2
import numpy as np

from .._errors import Error, MissingExtraError, wrong
from ..exports._lerobot import MOTORS, NUMBERS, read_json
from ..live import Unreachable
from ._setup import Setup, of_dict


class Arm(Protocol):
    """An arm with a camera that looks at it."""

    def move_to(self, configuration: Mapping[str, float]) -> None:
        """Go to joint positions by motor, rad. Raises ``Unreachable`` where it cannot."""

    def read_joints(self) -> Mapping[str, float]:
        """What the motors read now, rad by motor."""

    def grab(self) -> Any:
        """A picture of now, as OpenCV has them."""

    def close(self) -> None:
        """Leave the arm in a safe state."""


class Over(Exception):
    """Raised by a recorded arm that has no more to show."""


READINGS, SETUP = "readings.jsonl", "recording.json"


class Recorder:
    """Keeps readings and pictures of a run in a folder, each as soon as it is there."""

    def __init__(self, folder: Path, setup: Setup, truth: dict[str, Any] | None) -> None:
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise wrong("--record", f"{folder} is there, and is not empty", "name a new folder")
        folder.mkdir(parents=True, exist_ok=True)
        self._folder, self._count = folder, 0
        told = {"setup": setup.to_dict(), "truth": truth}
        (folder / SETUP).write_text(json.dumps(told, indent=1), encoding="utf-8")

    def keep(self, reading: Mapping[str, float], picture: Any) -> None:
        """Keep what was read (rad) and seen."""
        self._count += 1
        name = f"{self._count:03d}.png"
        good, coded = cv2.imencode(".png", picture)
        if not good:
            raise Error(f"--record: {self._folder / name} cannot be encoded; give pictures of bytes")
        (self._folder / name).write_bytes(coded.tobytes())
        with open(self._folder / READINGS, "a", encoding="utf-8") as file:
            file.write(json.dumps({"image": name, "joints_rad": dict(reading)}) + "\n")


class RecordedArm:
    """An arm that shows again what a ``Recorder`` kept, stop by stop, wherever it is told to go."""

    def __init__(self, folder: Path) -> None:
        told = read_json(folder / SETUP, "--recording", "name a folder that --record wrote")
        if not isinstance(told, dict) or not isinstance(told.get("setup"), dict):
            raise wrong("--recording", f"{folder / SETUP} has no setup", "name a folder that --record wrote")
        self.setup = of_dict(told["setup"], str(folder / SETUP))
        self.truth: dict[str, Any] | None = told.get("truth")
        self._folder, self._rows, self._at, self._shown = folder, [], 0, False
        try:
            lines = (folder / READINGS).read_text(encoding="utf-8").splitlines()
        except FileNotFoundError:
            lines = []
        for number, line in enumerate(lines, 1):
            try:
                row = json.loads(line)
                self._rows.append((str(row["image"]), {name: float(row["joints_rad"][name]) for name in MOTORS}))
            except (ValueError, KeyError, TypeError) as error:
                if number == len(lines):
                    break  # It was cut off while this line was written.
                raise wrong("--recording", f"{folder / READINGS}, line {number} is no reading ({error})", "remove the line") from None
        if not self._rows:
            raise wrong("--recording", f"{folder} holds no reading", "record again")

    def move_to(self, configuration: Mapping[str, float]) -> None:
        """The next stop, once this one has been looked at."""
        if self._shown:
            self._at, self._shown = self._at + 1, False
        if self._at >= len(self._rows):
            raise Over(f"the recording holds {len(self._rows)} stops")

    def read_joints(self) -> dict[str, float]:
        """What was read at this stop, rad."""
        return dict(self._rows[min(self._at, len(self._rows) - 1)][1])

    def grab(self) -> Any:
        """The picture of this stop."""
        self._shown = True
        path = self._folder / self._rows[self._at][0]
        try:
            picture = cv2.imdecode(np.frombuffer(path.read_bytes(), np.uint8), cv2.IMREAD_COLOR)
        except (OSError, cv2.error):
            picture = None
        if picture is None:
            raise wrong("--recording", f"{path} is no picture", "copy the whole folder that --record wrote")
        return picture

    def close(self) -> None:
        """Nothing is held."""


def _opened(camera: str) -> cv2.VideoCapture:
    """A webcam by its number or device."""
    video = cv2.VideoCapture(int(camera) if camera.isdigit() else camera)
    if not video.isOpened():
        raise wrong("--camera", f"{camera} cannot be opened", "name its number (0, 1, …) or its device")
    return video


def picture_size(camera: str) -> tuple[int, int]:
    """Width and height of the pictures that a webcam (its number or device) gives by itself."""
    video = _opened(camera)
    try:
        good, picture = video.read()
    finally:
        video.release()
    if not good:
        raise Error(NO_PICTURE)
    return (picture.shape[1], picture.shape[0])


NO_PICTURE = "--camera: it gives no picture; plug it in, and close other programs that use it"


class RealArm:
    """An SO-100 or SO-101 follower through LeRobot, and a webcam through OpenCV.

    Movements are straight in joint space and no faster than ``speed_deg_s``. ``close`` takes the arm back to where it was found, and
    lets go of it there.
    """

    RATE_HZ = 30.0

    def __init__(
        self,
        setup: Setup,
        calibration: Path,
        port: str,
        camera: str,
        *,
        speed_deg_s: float = 20.0,
        say: Callable[[str], None] = print,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        try:
            package = importlib.import_module("lerobot.robots.so_follower")
        except ImportError as error:
            what = f"the package `lerobot` cannot be imported ({error})"
            raise MissingExtraError(f"--robot so101: {what}; pip install 'lerobot[feetech]', or try --robot simulated") from None
        self._setup, self._speed, self._say, self._sleep = setup, speed_deg_s, say, sleep
        self._tree = setup.tree()
        self._video = _opened(camera)
        width, height = setup.camera.size_px
        self._video.set(cv2.CAP_PROP_FRAME_WIDTH, width)
        self._video.set(cv2.CAP_PROP_FRAME_HEIGHT, height)
        try:
            self.grab()
            config = package.SO101FollowerConfig(
                port=port, id=calibration.stem, calibration_dir=calibration.resolve().parent, use_degrees=True, cameras={}
            )
            self._robot = package.SO101Follower(config)
            self._connect(calibration)
        except BaseException:
            self._video.release()
            raise
        self._found = self._degrees()

    def _connect(self, calibration: Path) -> None:
        for name, its in self._setup.calibration.motors.items():
            read = self._robot.calibration.get(name)
            if read is None or any(getattr(read, key) != its[key] for key in NUMBERS):
                raise wrong("--calibration", f"LeRobot does not read {name} as {calibration} has it", "name LeRobot's own file of this arm")
        try:
            self._robot.connect(calibrate=False)
        except Exception as error:
            text = " ".join(str(error).split()) or type(error).__name__
            mend = "name the port that lerobot-find-port tells, and switch the arm on"
            raise Error(f"--port: LeRobot cannot connect ({text}); {mend}") from None
        if not self._robot.is_calibrated:
            self._robot.disconnect()
            what = "the motors hold another calibration than the file"
            raise wrong("--calibration", what, "run lerobot-calibrate, and press Enter to write the file to the motors")

    def _degrees(self) -> dict[str, float]:
        seen = self._robot.get_observation()
        return {name: float(seen[f"{name}.pos"]) for name in MOTORS}

    def read_joints(self) -> dict[str, float]:
        """What the motors read, rad."""
        return {name: math.radians(it) for name, it in self._degrees().items()}

    def move_to(self, configuration: Mapping[str, float]) -> None:
        """Go there in a straight line of joint angles, no faster than the speed."""
        start = self._degrees()
        self._go(start, {name: math.degrees(configuration[name]) for name in MOTORS})

    def _go(self, start: Mapping[str, float], end: Mapping[str, float], *, checked: bool = True) -> None:
        farthest = max(abs(end[name] - start[name]) for name in MOTORS)
        steps = max(1, math.ceil(farthest / self._speed * self.RATE_HZ))
        way = [{name: start[name] + (end[name] - start[name]) * k / steps for name in MOTORS} for k in range(1, steps + 1)]
        if checked:
            # It may begin low, as a folded arm does, but never sinks below both ends and the height.
            heights = [self.lowest_m(it) for it in (start, *way[:: max(1, len(way) // 40)], end)]
            if min(heights) < min(self._setup.minimum_height, heights[0], heights[-1]) - 0.005:
                raise Unreachable(f"the way there comes down to {min(heights) * 1e3:.0f} mm")
        for it in way:
            self._robot.send_action({f"{name}.pos": it[name] for name in MOTORS})
            self._sleep(1.0 / self.RATE_HZ)

    def lowest_m(self, degrees: Mapping[str, float]) -> float:
        """The height of the lowest of joints behind the second, and of the tag, above the base plane."""
        setup = self._setup
        angles = {name: math.radians(it) for name, it in degrees.items()}
        joints = [joint for joint in self._tree.path(setup.tip, setup.base) if joint.moves][2:]
        poses = [self._tree.pose(joint.child, setup.base, angles) for joint in joints]
        tip = poses[-1]
        tag = sum(a * b for a, b in zip(tip.rotation[2], setup.tag_at)) + tip.at[2]
        return min(tag, *(it.at[2] for it in poses))

    def grab(self) -> Any:
        """A picture of now: frames that the camera had kept are read away."""
        for _ in range(5):
            good, picture = self._video.read()
            if not good:
                raise Error(NO_PICTURE)
        height, width = picture.shape[:2]
        if (width, height) != tuple(self._setup.camera.size_px):
            expected = " x ".join(map(str, self._setup.camera.size_px))
            what = f"pictures are {width} x {height}, and the intrinsics are of {expected}"
            raise wrong("--intrinsics", what, "calibrate the camera at the size that it gives")
        return picture

    def close(self) -> None:
        """Back to where the arm was found, slowly, and let go of it."""
        try:
            self._say("going back to where the arm was found; then the motors let go")
            # By the upright posture, from which the first movement began.
            upright = dict.fromkeys(MOTORS, 0.0)
            self._go(self._degrees(), upright, checked=False)
            self._go(upright, self._found, checked=False)
            self._robot.disconnect()
        except KeyboardInterrupt:
            # Motors that let go here would drop the arm.
            self._robot.config.disable_torque_on_disconnect = False
            self._robot.disconnect()
            self._say("stopped: the motors hold the arm; hold it yourself before you switch it off")
        finally:
            self._video.release()
