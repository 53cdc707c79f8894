"""An MJCF with calibrated bodies stands, in MuJoCo itself, where the calibrated URDF does."""

from __future__ import annotations

import math
import re

import pytest

np = pytest.importorskip("numpy")
mujoco = pytest.importorskip("mujoco")

from export_robots import SCENARIOS, disturbed, forward, off, postures  # noqa: E402

from body_schema import FieldError  # noqa: E402
from body_schema.exports import mjcf, parse_urdf  # noqa: E402


def placed(
    model: str, bodies: list[str], joints: list[str], readings: dict[str, float], relative: str | None = None
) -> list[np.ndarray]:
    """Where MuJoCo has bodies at readings, 4 × 4, in the world or in the frame of a body."""
    compiled = mujoco.MjModel.from_xml_string(model)
    data = mujoco.MjData(compiled)
    for name in joints:
        data.joint(name).qpos[0] = readings[name]
    mujoco.mj_kinematics(compiled, data)

    def pose(name: str) -> np.ndarray:
        m = np.eye(4)
        m[:3, :3], m[:3, 3] = data.body(name).xmat.reshape(3, 3), data.body(name).xpos
        return m

    start = np.eye(4) if relative is None else np.linalg.inv(pose(relative))
    return [start @ pose(name) for name in bodies]


ARM = """<robot name="arm">
  <link name="base"/><link name="upper"/><link name="lower"/><link name="slider"/><link name="hand"/><link name="tip"/>
  <joint name="j1" type="revolute"><parent link="base"/><child link="upper"/>
    <origin xyz="0 0 0.3" rpy="0 0 0.5"/><axis xyz="0 0 1"/></joint>
  <joint name="j2" type="revolute"><parent link="upper"/><child link="lower"/>
    <origin xyz="0.1 0 0.2" rpy="0 1.5707963267948966 0"/><axis xyz="0 1 0"/></joint>
  <joint name="j3" type="prismatic"><parent link="lower"/><child link="slider"/>
    <origin xyz="0 0 0.4" rpy="0.3 -0.2 0.1"/><axis xyz="1 0 0"/></joint>
  <joint name="j4" type="continuous"><parent link="slider"/><child link="hand"/>
    <origin xyz="0 0 0.1" rpy="0.7 0.4 -2"/><axis xyz="0 0 -1"/></joint>
  <joint name="jt" type="fixed"><parent link="hand"/><child link="tip"/><origin xyz="0 0 0.05" rpy="0 0 1"/></joint>
</robot>"""


def written(word: str, rpy: tuple[float, float, float], compiler: str) -> str:
    """A rotation in the words of an MJCF, by MuJoCo's own conversions where it has them."""
    quat, new = np.zeros(4), np.zeros(4)
    mujoco.mju_euler2Quat(quat, np.array(rpy, float), "XYZ")
    matrix = np.zeros(9)
    mujoco.mju_quat2Mat(matrix, quat)
    m = matrix.reshape(3, 3)
    scale = 1.0 if "radian" in compiler else 180 / math.pi
    if word == "quat":
        return f'quat="{" ".join(map(repr, quat.tolist()))}"'
    if word == "xyaxes":
        return f'xyaxes="{" ".join(map(repr, [*m[:, 0].tolist(), *m[:, 1].tolist()]))}"'
    if word == "axisangle":
        mujoco.mju_quat2Vel(velocity := np.zeros(3), quat, 1.0)
        angle = float(np.linalg.norm(velocity))
        axis = velocity / angle if angle else np.array([0.0, 0.0, 1.0])
        return f'axisangle="{" ".join(map(repr, [*axis.tolist(), angle * scale]))}"'
    sequence = found[1] if (found := re.search(r'eulerseq="(\w+)"', compiler)) else "xyz"
    # The angles of any sequence, by least squares.
    angles = np.array([0.1, 0.2, 0.3])
    for _ in range(200):
        columns = []
        mujoco.mju_euler2Quat(new, angles, sequence)
        rest = np.zeros(3)
        mujoco.mju_subQuat(rest, quat, new)
        for k in range(3):
            step = angles.copy()
            step[k] += 1e-6
            mujoco.mju_euler2Quat(moved := np.zeros(4), step, sequence)
            change = np.zeros(3)
            mujoco.mju_subQuat(change, moved, new)
            columns.append(change / 1e-6)
        angles = angles + np.linalg.lstsq(np.array(columns).T, rest, rcond=1e-9)[0]
    return f'euler="{" ".join(map(repr, (angles * scale).tolist()))}"'


def arm(word: str, compiler: str) -> str:
    """The arm as somebody writes it: classes, a frame, a joint with `ref`, its own names, a base that stands elsewhere."""
    turns = [written(word, it, compiler) for it in [(0, 0, 0.5), (0, math.pi / 2, 0), (0.3, -0.2, 0.1), (0.7, 0.4, -2.0)]]
    degrees = 1.0 if "radian" in compiler else 180 / math.pi
    # The second body is written as it stands at 0.25 rad.
    second = written(word, (0, math.pi / 2 + 0.25, 0), compiler)
    return f"""<mujoco model="arm">  <!-- “mine” -->
  <compiler {compiler} autolimits="false"/>
  <default>
    <joint axis="0 1 0"/>
    <default class="turn"><joint axis="0 0 1" damping="1"/></default>
    <default class="slide"><joint type="slide" axis="1 0 0"/></default>
  </default>
  <worldbody>
    <light pos="0 0 3"/>
    <body name="base" pos="1 2 3" {turns[2]}>
      <geom size="0.1"/>
      <body name="upper" pos="0 0 0.3" {turns[0]} childclass="turn">
        <joint name="j1"/><geom size="0.05"/>
        <body name='second' pos='0.1 0 0.2' {second} childclass="main"><joint name="j2" ref="{0.25 * degrees!r}"/><geom size="0.05"/>
          <frame pos="0 0 0.1">
            <body name="slider" pos="0 0 0.3" {turns[2]}><joint name="j3" class="slide" ref="0.01"/><geom size="0.05"/>
              <body name="hand" pos="0 0 0.1" {turns[3]}><joint name="j4" axis="0 0 -1"/><geom size="0.05"/></body>
            </body>
          </frame>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


COMPILERS = [
    'angle="radian"',
    'angle="degree"',
    'angle="radian" eulerseq="zyx"',
    'eulerseq="XYZ"',
    'angle="radian" eulerseq="zxz"',
    'angle="radian" eulerseq="YxZ"',
]
BODIES, LINKS, JOINTS = ["upper", "second", "slider", "hand"], ["upper", "lower", "slider", "hand"], ["j1", "j2", "j3", "j4"]


@pytest.mark.parametrize("word", ["quat", "euler", "axisangle", "xyaxes"])
@pytest.mark.parametrize("compiler", COMPILERS)
def test_an_arm_by_hand_stands_where_the_urdf_does(word: str, compiler: str) -> None:
    urdf, before = disturbed(ARM), arm(word, compiler)
    after, _ = mjcf(parse_urdf(urdf), before, bodies={"lower": "second"})
    worst = 0.0
    for readings in postures(JOINTS):
        for body, link in zip(placed(after, BODIES, JOINTS, readings, "base"), LINKS):
            worst = max(worst, off(body, forward(urdf, "base", link, readings)))
    assert worst < 1e-9
    assert off(placed(before, BODIES, JOINTS, readings, "base")[-1], forward(urdf, "base", "hand", readings)) > 1e-3
    # All else stays, and words stay words.
    values = r"(?<=pos=[\"'])[^\"']*|(?<=quat=\")[^\"]*|(?<=euler=\")[^\"]*|(?<=axisangle=\")[^\"]*|(?<=xyaxes=\")[^\"]*"
    assert re.sub(values, "", before) == re.sub(values, "", after)


def test_a_robot_that_mujoco_converted() -> None:
    urdf = re.sub(r"<(visual|collision)>.*?</\1>", "", (SCENARIOS / "ur10.urdf").read_text(), flags=re.S)
    spec = mujoco.MjSpec.from_string(urdf)
    spec.compile()
    model = spec.to_xml()
    joints = ["shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_1_joint", "wrist_2_joint", "wrist_3_joint"]
    links = ["shoulder_link", "upper_arm_link", "forearm_link", "wrist_1_link", "wrist_2_link", "wrist_3_link"]
    calibrated = disturbed(urdf)
    after, _ = mjcf(parse_urdf(calibrated), model)
    worst = 0.0
    for readings in postures(joints):
        for body, link in zip(placed(after, links, joints, readings), links):
            worst = max(worst, off(body, forward(calibrated, "world", link, readings)))
    assert worst < 1e-9
    print(f"UR10 as MuJoCo converts it: {worst:.1e} m at most")


def test_frames_that_are_others_need_the_original() -> None:
    """Bodies whose frames sit elsewhere on the links, as in files that were modelled by hand."""
    model = """<mujoco><compiler angle="radian"/><worldbody>
      <body name="upper" pos="0 0 0.3"><joint name="j1" axis="0 0 1"/><geom size="0.1"/>
        <body name="lower" pos="0.1 0 0.2">
          <joint name="j2" axis="0 1 0"/><geom size="0.1"/></body>
      </body></worldbody></mujoco>"""
    # The arm stands in the world turned by 0.5 rad less than on its base.
    links = ARM.replace('rpy="0 1.5707963267948966 0"', 'rpy="0 0 0"')
    urdf = disturbed(links)
    with pytest.raises(FieldError, match="--original"):
        mjcf(parse_urdf(urdf), model)
    after, said = mjcf(parse_urdf(urdf), model, before=parse_urdf(links))
    assert any("j3" in it for it in said)
    for readings in postures(["j1", "j2"]):
        upper, lower = placed(after, ["upper", "lower"], ["j1", "j2"], readings)
        was = [forward(links, "base", it, readings) for it in ("upper", "lower")]
        now = [forward(urdf, "base", it, readings) for it in ("upper", "lower")]
        old = placed(model, ["upper", "lower"], ["j1", "j2"], readings)
        # The robot moves in the frame of the base as its description does, and bodies keep their place on their links.
        world = old[0] @ np.linalg.inv(was[0])
        assert off(world, old[1] @ np.linalg.inv(was[1])) < 1e-9
        assert off(upper, world @ now[0]) < 1e-9 and off(lower, world @ now[1]) < 1e-9


@pytest.mark.parametrize(
    "change, bodies, wanted",
    [
        (("<mujoco", "<robot"), {}, "no XML"),
        (('name="upper"', 'name="hand"'), {"lower": "second"}, "two bodies"),
        (('axis="0 0 -1"', 'axis="0 0 1"'), {"lower": "second"}, "180.0 degrees"),
        (('<joint name="j4" axis="0 0 -1"/>', ""), {"lower": "second"}, "0 joints"),
        (('name="j3" class="slide"', 'name="j3" class="slid"'), {"lower": "second"}, "no class `slid`"),
        (('name="j3" class="slide"', 'name="j3"'), {"lower": "second"}, "hinge"),
        (("0 0 0.3", "0 0 zero"), {"lower": "second"}, "'0 0 zero' is not 3 numbers"),
        (("0 0 0.3", "0 0 0.9"), {"lower": "second"}, "600 mm"),
        (("", ""), {"lower": "third"}, "no body `third`"),
        (("", ""), {"leg": "second"}, "no link `leg`"),
        (("", ""), {}, "it moves, and has no link"),
        (('eulerseq="zyx"', 'eulerseq="zzz"'), {"lower": "second"}, "axes"),
    ],
)
def test_what_does_not_fit_is_refused(change: tuple[str, str], bodies: dict[str, str], wanted: str) -> None:
    model = arm("quat", 'angle="radian" eulerseq="zyx"').replace(*change, 1)
    with pytest.raises(FieldError, match=re.escape(wanted)):
        mjcf(parse_urdf(ARM), model, bodies=bodies)
