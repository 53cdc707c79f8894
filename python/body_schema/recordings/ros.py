"""Bags of ROS 1 and ROS 2 (SQLite and MCAP), read without ROS."""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from .._errors import Error, wrong
from .need import need
from .recording import Distortion, Recording, SensorSpec, Topic, word_of
from .tracks import Array, Camera, SensorTrack, homogeneous, quaternion

JOINTS, IMAGES, CAMERAS = ("JointState",), ("Image", "CompressedImage"), ("CameraInfo",)
POSES = ("PoseStamped", "PoseWithCovarianceStamped", "TransformStamped", "PointStamped")
TAGS, TRANSFORMS = ("AprilTagDetectionArray",), ("TFMessage", "tfMessage")
MARKERS = ("Markers", "MarkerArray")

PACKAGES = {
    "JointState": ("sensor_msgs",),
    "Image": ("sensor_msgs",),
    "CompressedImage": ("sensor_msgs",),
    "CameraInfo": ("sensor_msgs",),
    **dict.fromkeys(POSES, ("geometry_msgs",)),
    "AprilTagDetectionArray": ("apriltag_msgs", "apriltag_ros", "apriltags_ros", "apriltags2_ros"),
    "TFMessage": ("tf2_msgs", "tf"),
    "tfMessage": ("tf",),
    "Markers": ("mocap4r2_msgs", "mocap_msgs"),
    "MarkerArray": ("visualization_msgs",),
}
"""The packages of the message types that are read; others of the same name have other fields."""

DEFINITIONS = {
    "apriltag_msgs/msg/Point": "float64 x\nfloat64 y\n",
    "apriltag_msgs/msg/AprilTagDetection": (
        "string family\nint32 id\nint32 hamming\nfloat32 goodness\nfloat32 decision_margin\n"
        "apriltag_msgs/Point centre\napriltag_msgs/Point[4] corners\nfloat64[9] homography\n"
    ),
    "apriltag_msgs/msg/AprilTagDetectionArray": "std_msgs/Header header\napriltag_msgs/AprilTagDetection[] detections\n",
    "apriltag_ros/msg/AprilTagDetection": "int32[] id\nfloat64[] size\ngeometry_msgs/PoseWithCovarianceStamped pose\n",
    "apriltag_ros/msg/AprilTagDetectionArray": "std_msgs/Header header\napriltag_ros/AprilTagDetection[] detections\n",
}
"""Types that are no part of ROS itself, for bags that do not carry their definitions."""

CORNERS = ((-0.5, 0.5, 0.0), (0.5, 0.5, 0.0), (0.5, -0.5, 0.0), (-0.5, -0.5, 0.0))
"""A tag's corners in the order of the AprilTag library, in edges, in the tag's own frame: x to the right, y down, z into the tag."""
STAMPS = ("header", "received")


class Bag(Recording):
    """A bag: a folder with ``metadata.yaml``, or a file ``.mcap``, ``.db3`` or ``.bag``.

    ``stamps`` says what counts as the time of a message: ``header``, its own stamp where it has one, or ``received``, when it was
    recorded. Times are seconds after the first message.
    """

    def __init__(self, path: Path, stamps: str = "header") -> None:
        self.path = path
        self._stamps = stamps
        self._files = _files(path)
        anyreader, self._typesys = need("ros", "rosbags.highlevel", "rosbags.typesys")
        store = self._typesys.get_typestore(self._typesys.Stores.LATEST)
        for name, text in DEFINITIONS.items():
            store.register(self._typesys.get_types_from_msg(text, name))
        try:
            self._reader = anyreader.AnyReader(self._files, default_typestore=store)
            self._reader.open()
        except Exception as error:
            raise self._unreadable(error) from None
        self._default = store
        self._start_ns = self._reader.start_time if self._reader.message_count else 0

    def close(self) -> None:
        self._reader.close()

    def began(self) -> float:
        return self._start_ns * 1e-9

    def topics(self, whole: bool = True) -> list[Topic]:
        found: dict[str, Topic] = {}
        times: dict[str, list[int]] = defaultdict(list)
        names: dict[str, Counter[str]] = defaultdict(Counter)
        for connection in self._reader.connections:
            kind = _kind(connection.msgtype)
            topic = found.setdefault(connection.topic, Topic(connection.topic, connection.msgtype, _role(kind)))
            topic.count += connection.msgcount
        if not whole:
            return sorted(found.values(), key=lambda it: it.name)
        for name, _, kind, received, message in self._messages(None):
            times[name].append(received)
            if _role(kind) in ("joints", "sensor"):
                names[name].update(_parts(kind, message()))
        for name, topic in found.items():
            topic.count = len(times[name])
            stamps = np.array(sorted(times[name])) * 1e-9
            if topic.count > 1:
                topic.rate_hz = (topic.count - 1) / max(float(stamps[-1] - stamps[0]), 1e-9)
                topic.longest_gap_s = float(np.diff(stamps).max())
            topic.names = sorted(names[name])
        return sorted(found.values(), key=lambda topic: topic.name)

    def joints(self, topic: str) -> dict[str, tuple[Array, Array]]:
        times: dict[str, list[float]] = defaultdict(list)
        positions: dict[str, list[float]] = defaultdict(list)
        for _, time, _, _, message in self._messages([topic]):
            read = message()
            if not len(read.position):
                # Velocities or efforts alone.
                continue
            whole = len(read.position) == len(read.name)
            for name, position in zip(read.name, read.position if whole else [float("nan")] * len(read.name)):
                times[name].append(time(read.header))
                positions[name].append(float(position))
        return {name: (np.array(times[name]), np.array(positions[name])) for name in times}

    def sensor(self, spec: SensorSpec, links: dict[str, str]) -> SensorTrack:
        if spec.topic.startswith("tf:"):
            return self._transforms(spec, links)
        kind = self._kind(spec.topic)
        times: list[float] = []
        values: list[list[float]] = []
        frames: Counter[str] = Counter()
        shape = ""
        dropped: Counter[str] = Counter()
        parts: Counter[str] = Counter()
        rows: list[tuple[str, str, float, str, list[float]]] = []
        for _, time, _, _, message in self._messages([spec.topic]):
            read = message()
            rows += [(part, shape, time(header), frame, row) for part, shape, header, frame, row in _readings(kind, read)]
        parts.update(row[0] for row in rows)
        wanted = spec.part or (next(iter(parts)) if len(parts) == 1 else "")
        if not rows:
            raise wrong("sensor", f"{spec.topic} holds no reading", "name another topic; --list shows what there is")
        if wanted not in parts:
            there = ", ".join(f"{name} ({number})" for name, number in parts.most_common())
            what = f"{spec.topic} holds {there}" if not spec.part else f"{spec.topic} holds no {spec.part}, but {there}"
            raise wrong("sensor", what, f"name one, as {spec.topic}#{parts.most_common(1)[0][0]}")
        chosen = [row for row in rows if row[0] == wanted]
        frames.update(row[3] for row in chosen)
        frame = frames.most_common(1)[0][0]
        seen: set[float] = set()
        for _, shape, at, of, row in chosen:
            if of != frame:
                dropped[f"in frame {of}, not {frame}"] += 1
            elif at in seen and wanted and kind in TAGS:
                dropped["a second one of the same tag at one time"] += 1
            else:
                seen.add(at)
                times.append(at)
                values.append(row)
        track = SensorTrack(spec.name, shape, np.array(times), np.array(values), frame, spec.written, dropped)
        if shape == "pixels":
            track.points_m, track.facing = [list(corner) for corner in CORNERS], (0.0, 0.0, -1.0)
        return track

    def camera(self, spec: SensorSpec, topic: str | None, rectified: bool) -> tuple[Camera, Distortion]:
        there = [it.topic for it in self._reader.connections if _kind(it.msgtype) in CAMERAS]
        there = list(dict.fromkeys(there))
        if topic is None:
            # That of pictures stands beside them, and a compressed topic is below that of its pictures.
            above = spec.topic.rpartition("/")[0]
            beside = ([it for it in there if it.rpartition("/")[0] == folder] for folder in (above, above.rpartition("/")[0]))
            candidates = next((near for near in beside if near), there)
            if len(candidates) != 1:
                what = f"{len(candidates)} topics of sensor_msgs/CameraInfo: {', '.join(candidates) or 'none'}"
                raise wrong("camera-info", what, "name one with --camera-info TOPIC")
            topic = candidates[0]
        elif topic not in there:
            raise wrong("camera-info", f"{topic} is no topic of sensor_msgs/CameraInfo", f"name one of {', '.join(there) or 'none'}")
        for _, _, _, _, message in self._messages([topic]):
            read = message()
            k = np.asarray(_of(read, "k", "K"), dtype=float)
            if rectified:
                k = np.asarray(_of(read, "p", "P"), dtype=float).reshape(3, 4)[:, :3].ravel()
            d = () if rectified else tuple(float(it) for it in _of(read, "d", "D"))
            if k[0] <= 0.0 or k[4] <= 0.0 or not read.width:
                raise wrong("camera-info", f"{topic} has no calibration: a focal length is {k[0]:g}", "calibrate the camera")
            part = read.roi.width not in (0, read.width) or read.roi.height not in (0, read.height)
            if read.binning_x > 1 or read.binning_y > 1 or part:
                what = f"pictures of {topic} are binned, or of a part of the sensor: that is not supported"
                raise wrong("camera-info", what, "write intrinsics of the pictures as they are, and name them with --camera FILE")
            size = (float(read.width), float(read.height))
            camera = Camera(word_of(topic), size, (float(k[0]), float(k[4])), (float(k[2]), float(k[5])))
            return camera, Distortion(str(read.distortion_model), d)
        raise wrong("camera-info", f"{topic} holds no message", "name another topic with --camera-info")

    def images(self, spec: SensorSpec) -> Iterator[tuple[float, Any]]:
        kind = self._kind(spec.topic)
        for _, time, _, _, message in self._messages([spec.topic]):
            read = message()
            yield time(read.header), _compressed(read) if kind == "CompressedImage" else _picture(read)

    def _kind(self, topic: str) -> str:
        for connection in self._reader.connections:
            if connection.topic == topic:
                return _kind(connection.msgtype) or str(connection.msgtype)
        there = sorted({it.topic for it in self._reader.connections})
        raise wrong("topic", f"the recording has no {topic}", f"name one of {', '.join(there) or 'none'}")

    def _messages(self, topics: list[str] | None) -> Iterator[tuple[str, Any, str, int, Any]]:
        """Topic, a function of a header that gives the time (s), kind, when it was received (ns), and a function that decodes it."""
        connections = [it for it in self._reader.connections if topics is None or it.topic in topics]
        if not connections:
            return
        try:
            for connection, received, raw in self._reader.messages(connections=connections):

                def time(header: Any, received: int = received) -> float:
                    stamp = header.stamp
                    own = int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)
                    return ((own if own and self._stamps == "header" else received) - self._start_ns) * 1e-9

                def message(raw: Any = raw, kind: str = connection.msgtype) -> Any:
                    try:
                        return self._reader.deserialize(raw, kind)
                    except KeyError:
                        what = f"{self.path} carries no definition of {kind}"
                        raise wrong("recording", what, "record with a newer rosbag2, or convert it to MCAP") from None
                    except Exception as error:
                        raise self._unreadable(error) from None

                yield connection.topic, time, _kind(connection.msgtype), received, message
        except Error:
            raise
        except Exception as error:
            raise self._unreadable(error) from None

    def _unreadable(self, error: Exception) -> Error:
        mend = "name a bag of ROS, or mend it with `ros2 bag reindex` or `mcap recover`"
        text = re.sub(r"\.$", "", str(error).strip().splitlines()[0]) if str(error).strip() else type(error).__name__
        return wrong("recording", f"{self.path} cannot be read: {text}", mend)

    def _transforms(self, spec: SensorSpec, links: dict[str, str]) -> SensorTrack:
        parent, comma, child = spec.topic.removeprefix("tf:").partition(",")
        if not comma or not parent or not child:
            raise wrong("sensor", f"{spec.topic} names no two frames", "write tf:PARENT,CHILD")
        topics = {it.topic for it in self._reader.connections if _kind(it.msgtype) in TRANSFORMS}
        if not topics:
            raise wrong("sensor", "the recording holds no transforms", "name a topic; --list shows what there is")
        edges: dict[str, tuple[str, list[float], list[list[float]]]] = {}
        fixed: dict[str, bool] = {}
        for topic, time, _, _, message in self._messages(sorted(topics)):
            for it in message().transforms:
                below, above = it.child_frame_id.lstrip("/"), it.header.frame_id.lstrip("/")
                edge = edges.setdefault(below, (above, [], []))
                if edge[0] != above:
                    raise wrong("sensor", f"frame {below} hangs on {edge[0]} and on {above}", "name frames whose chain does not change")
                edge[1].append(time(it.header))
                edge[2].append(_transform(it.transform))
                fixed[below] = topic.endswith("static")
        path = _path({below: edge[0] for below, edge in edges.items()}, parent, child)
        if path is None:
            frames = sorted({*edges, *(edge[0] for edge in edges.values())})
            raise wrong("sensor", f"no chain of transforms leads from {parent} to {child}", f"name two of {', '.join(frames)}")
        for below, _ in path:
            if links.get(below) == edges[below][0]:
                what = f"{edges[below][0]} → {below} is a joint of the robot: it is computed from the URDF, not measured"
                raise wrong("sensor", what, "name the frames of what the sensor sees, as camera and tag")
        moving = [below for below, _ in path if not fixed[below]]
        if len(moving) != 1:
            what = f"{len(moving)} transforms between {parent} and {child} change: {', '.join(moving) or 'none'}"
            raise wrong("sensor", what, "name two frames between which one is measured")
        times = np.array(edges[moving[0]][1])
        total = np.broadcast_to(np.eye(4), (len(times), 4, 4))
        for below, forward in path:
            rows = np.array(edges[below][2])
            steps = homogeneous(rows if below == moving[0] else rows[-1:])
            total = total @ (steps if forward else np.linalg.inv(steps))
        values = np.array([[*place[:3, 3], *quaternion(place[:3, :3])] for place in total])
        return SensorTrack(spec.name, "pose", times, values, parent, spec.topic)


def is_bag(path: Path) -> bool:
    """Whether it looks like a bag, by its name or what it contains."""
    if path.is_dir():
        return (path / "metadata.yaml").exists() or any(path.glob("*.mcap")) or any(path.glob("*.db3"))
    return path.suffix in (".bag", ".mcap", ".db3")


def _files(path: Path) -> list[Path]:
    if path.is_dir() and not (path / "metadata.yaml").exists():
        # A recording that was cut off has no metadata; a file alone says nearly all.
        files = sorted([*path.glob("*.mcap"), *path.glob("*.db3"), *path.glob("*.bag")])
        if len(files) > 1:
            what = f"{path} has no metadata.yaml, and {len(files)} files"
            raise wrong("recording", what, "run `ros2 bag reindex`, or name one of the files")
        if not files:
            raise wrong("recording", f"{path} holds no bag", "name a folder with metadata.yaml, or a file .mcap, .db3 or .bag")
        return files
    return [path]


def _kind(msgtype: str) -> str:
    """The name of a message type that is read, without its package; nothing for others."""
    package, _, kind = msgtype.replace("/msg/", "/").partition("/")
    return kind if package in PACKAGES.get(kind, ()) else ""


def _role(kind: str) -> str:
    if kind in JOINTS:
        return "joints"
    if kind in (*POSES, *TAGS, *MARKERS, *TRANSFORMS):
        return "sensor"
    return "image" if kind in IMAGES else "camera" if kind in CAMERAS else ""


def _parts(kind: str, read: Any) -> list[str]:
    """Names of joints, of tags, of markers, or of transforms in a message."""
    if kind in JOINTS:
        return [str(name) for name in read.name]
    if kind in TRANSFORMS:
        return [f"{it.header.frame_id.lstrip('/')} → {it.child_frame_id.lstrip('/')}" for it in read.transforms]
    return [part for part, *_ in _readings(kind, read) if part]


def _readings(kind: str, read: Any) -> Iterator[tuple[str, str, Any, str, list[float]]]:
    """Part, shape, header, frame and numbers of every reading in a message."""
    if kind == "PoseStamped":
        yield "", "pose", read.header, read.header.frame_id, _pose(read.pose)
    elif kind == "PoseWithCovarianceStamped":
        yield "", "pose", read.header, read.header.frame_id, _pose(read.pose.pose)
    elif kind == "TransformStamped":
        yield "", "pose", read.header, read.header.frame_id, _transform(read.transform)
    elif kind == "PointStamped":
        yield "", "position", read.header, read.header.frame_id, _point(read.point)
    elif kind == "AprilTagDetectionArray":
        for tag in read.detections:
            if hasattr(tag, "corners"):
                corners = [float(it) for corner in tag.corners for it in (corner.x, corner.y)]
                yield str(int(tag.id)), "pixels", read.header, read.header.frame_id, corners
            else:
                ids = [int(it) for it in np.atleast_1d(tag.id)]
                posed = tag.pose.pose.pose if hasattr(tag.pose.pose, "pose") else tag.pose.pose
                # The header of the array is not always filled.
                header = tag.pose.header if tag.pose.header.stamp.sec or not read.header.stamp.sec else read.header
                yield "+".join(map(str, ids)), "pose", header, header.frame_id or read.header.frame_id, _pose(posed)
    elif kind in MARKERS:
        for marker in read.markers:
            header = getattr(marker, "header", None) or read.header
            if hasattr(marker, "translation"):
                name = str(marker.marker_name or marker.marker_index)
                yield name, "position", header, header.frame_id, _point(marker.translation)
            else:
                yield str(marker.ns or "") + str(marker.id), "position", header, header.frame_id, _point(marker.pose.position)
    elif kind in TRANSFORMS:
        raise wrong("sensor", "a topic of transforms holds many", "name one as --sensor tf:PARENT,CHILD; --list shows the frames")
    else:
        raise wrong("sensor", f"{kind} is no reading of a sensor that is known", "name another topic; --list shows what there is")


def _pose(pose: Any) -> list[float]:
    return _point(pose.position) + _rotation(pose.orientation)


def _transform(transform: Any) -> list[float]:
    return _point(transform.translation) + _rotation(transform.rotation)


def _point(point: Any) -> list[float]:
    return [float(point.x), float(point.y), float(point.z)]


def _rotation(it: Any) -> list[float]:
    """A quaternion of unit length; NaN where all is zero, as where nobody filled it in."""
    values = np.array([it.x, it.y, it.z, it.w], dtype=float)
    length = float(np.linalg.norm(values))
    return [float(value) for value in values / length] if length > 1e-3 else [float("nan")] * 4


def _path(above: dict[str, str], parent: str, child: str) -> list[tuple[str, bool]] | None:
    """The transforms between two frames, each by its lower frame, and whether it is gone down."""

    def up(frame: str) -> list[str]:
        frames = [frame]
        while frames[-1] in above and above[frames[-1]] not in frames:
            frames.append(above[frames[-1]])
        return frames

    first, second = up(parent), up(child)
    common = next((frame for frame in first if frame in second), None)
    if common is None or parent == child:
        return None
    down = second[: second.index(common)]
    return [(frame, False) for frame in first[: first.index(common)]] + [(frame, True) for frame in reversed(down)]


def _of(read: Any, *names: str) -> Any:
    """A field that ROS 1 and ROS 2 write differently."""
    return next(getattr(read, name) for name in names if hasattr(read, name))


BAYER = {"bayer_rggb8": "BG", "bayer_bggr8": "RG", "bayer_gbrg8": "GR", "bayer_grbg8": "GB"}
LUMINANCE_AT = {"yuv422": 1, "uyvy": 1, "yuv422_yuy2": 0, "yuyv": 0}
"""Of two bytes a pixel, the one that has its luminance: with colours no tag is found better."""
CHANNELS = {
    **{"mono8": 1, "8uc1": 1, "bgr8": 3, "rgb8": 3, "8uc3": 3, "bgra8": 4, "rgba8": 4},
    **dict.fromkeys(("mono16", "y16", *LUMINANCE_AT), 2),
    **dict.fromkeys(BAYER, 1),
}
"""Bytes a pixel, by encoding."""


def _picture(read: Any) -> Any:
    """A raw picture as blue, green, red."""
    encoding = str(read.encoding).lower()
    channels = CHANNELS.get(encoding)
    if channels is None:
        mend = f"name the compressed topic of the same camera, or convert the pictures to one of {', '.join(CHANNELS)}"
        raise wrong("sensor", f"pictures are encoded as {read.encoding}", mend)
    flat = np.asarray(read.data, dtype=np.uint8)[: read.height * read.step].reshape(read.height, read.step)
    if encoding in ("mono16", "y16"):
        deep = flat[:, : 2 * read.width].copy().view(">u2" if read.is_bigendian else "<u2").astype(float)
        # Few cameras fill all sixteen bits.
        return np.repeat((deep * (255.0 / max(float(deep.max()), 1.0))).astype(np.uint8)[:, :, None], 3, axis=2)
    if encoding in LUMINANCE_AT:
        return np.repeat(flat[:, LUMINANCE_AT[encoding] : 2 * read.width : 2, None], 3, axis=2)
    if encoding.startswith("bayer"):
        (cv2,) = need("vision", "cv2")
        # OpenCV calls a pattern by the second pixel of its second row.
        return cv2.cvtColor(flat[:, : read.width].copy(), getattr(cv2, f"COLOR_Bayer{BAYER[encoding]}2BGR"))
    picture = flat[:, : read.width * channels].reshape(read.height, read.width, channels)
    if channels == 1:
        return np.repeat(picture, 3, axis=2)
    picture = picture[:, :, :3]
    return picture[:, :, ::-1] if encoding.startswith("rgb") else picture


def _compressed(read: Any) -> Any:
    """A JPEG or PNG as blue, green, red."""
    (cv2,) = need("vision", "cv2")
    picture = cv2.imdecode(np.asarray(read.data, dtype=np.uint8), cv2.IMREAD_COLOR)
    if picture is None:
        raise wrong("sensor", f"a compressed picture ({read.format}) holds none", "record the raw topic")
    return picture
