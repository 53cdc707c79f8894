"""The offset of a sensor's clock is found, or it is said that it cannot be told."""

from __future__ import annotations

from collections import Counter

import pytest

np = pytest.importorskip("numpy", reason="needs numpy: pip install 'body-schema[ros]'")

from body_schema.recordings import clock  # noqa: E402
from body_schema.recordings.chain import Description  # noqa: E402
from body_schema.recordings.tracks import JointTrack, SensorTrack, joint_track  # noqa: E402
from recorded import BASE, TIP, URDF, Run, joints, rotation, seen, sensor  # noqa: E402

DESCRIPTION = Description(URDF)
CHAIN = DESCRIPTION.chain(BASE, TIP)


def found(run: Run, track: SensorTrack, description: Description = DESCRIPTION, most_s: float = 10.0) -> clock.Offset:
    return clock.estimate(joints(run), track, description, description.chain(BASE, TIP), most_s)


@pytest.mark.parametrize(
    ("seed", "offset_s", "kind"),
    [(1001, 0.4, "pose"), (1002, -0.4, "position"), (1003, 3.9, "position"), (1004, -3.9, "pose"), (1005, 0.0, "position")],
)
def test_the_offset_is_found_to_ten_milliseconds(seed: int, offset_s: float, kind: str) -> None:
    run = Run(seed)
    offset = found(run, seen(run, offset_s, kind))
    assert offset.told and not offset.on_hand, offset
    assert abs(offset.seconds - offset_s) < 0.01 and offset.deviation_s < 0.005, offset
    # What is stated is no smaller than it is.
    assert abs(offset.seconds - offset_s) < 5.0 * offset.deviation_s + 0.001, offset
    assert offset.explained > 0.9


def test_a_description_that_is_far_off_does_not_matter() -> None:
    """Axes 4 degrees and 2 cm off, a joint that turns the other way, and another whose zero is off by half a radian."""
    run = Run(1006)
    run.arm = type(run.arm)(1006, wrong=7.0)
    text = DESCRIPTION.text
    where = text.index('<axis', text.index('name="wrist_1_joint"'))
    wrong = text[:where] + text[where:].replace('xyz="0 1 0"', 'xyz="0 -1 0"', 1)
    assert wrong != text
    track = joints(run)
    track.positions[:, 2] += 0.5
    offset = clock.estimate(track, seen(run, 0.4, "position"), Description(wrong), Description(wrong).chain(BASE, TIP), 10.0)
    assert offset.told and abs(offset.seconds - 0.4) < 0.01, offset


def test_a_sensor_on_the_hand_is_told_from_one_beside_the_robot() -> None:
    run = Run(1007)
    times, values = [], []
    for index in range(int(run.end_s * 30)):
        r, p = run.arm.hand(run.at(index / 30))
        times.append(index / 30 + 0.7)
        values.append(r.T @ (np.array([0.8, 0.1, 0.0]) - p) + run.random.normal(0.0, 5e-4, 3))
    offset = found(run, sensor("position", times, values))
    assert offset.told and offset.on_hand and abs(offset.seconds + 0.7) < 0.01, offset


def test_pixels_tell_too() -> None:
    run = Run(1008)
    times, values = [], []
    view = rotation([1, 0, 0], -1.57) @ rotation([0, 0, 1], 0.3)
    for index in range(int(run.end_s * 30)):
        r, p = run.arm.hand(run.at(index / 30))
        x, y, z = view @ (p + r @ [0.05, 0.0, 0.08]) + [0.0, 0.0, 3.0]
        times.append(index / 30 - 1.3)
        values.append(np.array([600 * x / z, 600 * y / z]) + run.random.normal(0.0, 0.3, 2))
    offset = found(run, sensor("pixels", times, values))
    assert offset.told and abs(offset.seconds - 1.3) < 0.01, offset


def test_movements_that_repeat_themselves_leave_rivals() -> None:
    run = Run(1009, repeats=True)
    offset = found(run, seen(run, 0.4, "position"))
    # Forth is as good as back: both are half a period apart.
    period = 1.5 + run.dwell_s
    assert not offset.told and "repeat" in offset.why, offset
    for other in [*offset.rivals, offset.seconds]:
        assert abs((other - 0.4) / period - round((other - 0.4) / period)) < 0.02, offset
    # A shorter search has one answer.
    assert abs(found(run, seen(run, 0.4, "position"), most_s=2.0).seconds - 0.4) < 0.01


def test_what_cannot_be_told_is_said() -> None:
    run = Run(1010, movements=10)
    track = joints(run)
    still = JointTrack(track.names, track.times, track.positions * 0.0 + run.random.normal(0.0, 5e-5, track.positions.shape))
    readings = seen(run, 0.4, "position")
    assert "joints hardly move" in clock.estimate(still, readings, DESCRIPTION, CHAIN, 10.0).why
    readings.values = readings.values * 0.0 + run.random.normal(0.0, 5e-4, readings.values.shape)
    assert "readings hardly move" in clock.estimate(track, readings, DESCRIPTION, CHAIN, 10.0).why
    # A sensor that sees something else.
    other = Run(1011, movements=10)
    offset = clock.estimate(track, seen(other, 0.0, "position"), DESCRIPTION, CHAIN, 10.0)
    assert not offset.told and "at no offset" in offset.why, offset
    far = seen(run, 0.4, "position")
    far.times = far.times + 1e6
    assert "never recorded at the same time" in clock.estimate(track, far, DESCRIPTION, CHAIN, 10.0).why
    edge = clock.estimate(track, seen(run, 3.0, "position"), DESCRIPTION, CHAIN, 3.0)
    assert not edge.told and "--max-offset" in edge.why, edge


def test_readings_only_while_the_robot_stands_tell_as_well_as_it_stands() -> None:
    run = Run(1012)
    track = seen(run, 0.4, "pose", moving=False)
    offset = found(run, track)
    assert offset.told and abs(offset.seconds - 0.4) < max(0.05, 4.0 * offset.deviation_s) < 0.3, offset


def test_one_reading_a_posture_leaves_a_range() -> None:
    """Read 0.6 s after it came to rest, 0.4 s before it leaves: anything between fits as well, whatever the stamps are off by."""
    run = Run(1061)
    times = [leave - 0.4 for leave in run.leaves]
    offset = found(run, sensor("position", [it - 2.0 for it in times], [run.arm.tag_at(run.at(it))[1] for it in times]))
    assert offset.told and 0.2 < offset.deviation_s < 0.5, offset
    assert abs(offset.seconds - 1.9) < 0.1, offset


def test_a_clock_that_drifts_or_jumps_is_told() -> None:
    run = Run(1069)
    drifting = seen(run, 0.4, "pose")
    drifting.times = drifting.times * (1.0 + 5e-4)
    offset = found(run, drifting)
    assert offset.told and len(offset.quarters_s) == 4 and offset.quarters_s == sorted(offset.quarters_s, reverse=True), offset
    assert abs(offset.quarters_s[0] - offset.quarters_s[3] - 0.75 * 5e-4 * run.end_s) < 0.006, offset
    jumping = seen(run, 0.4, "pose")
    jumping.times = np.where(jumping.times > 0.6 * run.end_s, jumping.times + 0.1, jumping.times)
    offset = found(run, jumping)
    assert abs(offset.quarters_s[0] - 0.4) < 0.005 and abs(offset.quarters_s[3] - 0.3) < 0.02 < offset.deviation_s, offset


def test_few_movements_are_not_told_wrongly() -> None:
    for seed in (1066, 1067, 1068):
        run = Run(seed, movements=4)
        offset = found(run, seen(run, 0.4, "pose"))
        assert not offset.told or abs(offset.seconds - 0.4) < 0.01, offset


def test_the_hand_is_where_the_engine_has_it() -> None:
    """A chain with a joint that slides, one that mimics, and fixed ones that are turned: against the engine's own kinematics."""
    text = (
        '<robot name="r">' + "".join(f'<link name="{it}"/>' for it in "abcdef")
        + '<joint name="lift" type="prismatic"><origin xyz="0 0 0.3" rpy="0.1 -0.2 0.3"/><parent link="a"/><child link="b"/>'
        '<axis xyz="0 1 2"/><limit lower="-0.5" upper="0.5" effort="1" velocity="1"/></joint>'
        '<joint name="mount" type="fixed"><origin xyz="0.1 0.2 0" rpy="1 2 3"/><parent link="b"/><child link="c"/></joint>'
        '<joint name="turn" type="revolute"><origin xyz="0.2 0 0"/><parent link="c"/><child link="d"/><axis xyz="0 0 -1"/>'
        '<limit lower="-2" upper="2" effort="1" velocity="1"/></joint>'
        '<joint name="bend" type="revolute"><origin xyz="0.2 0 0.1" rpy="0 0.4 0"/><parent link="d"/><child link="e"/><axis xyz="1 1 0"/>'
        '<limit lower="-2" upper="2" effort="1" velocity="1"/></joint>'
        '<joint name="flange" type="fixed"><origin xyz="0 0 0.1" rpy="0 0.5 0"/><parent link="e"/><child link="f"/></joint></robot>'
    )
    import body_schema

    place = {"at_m": [0, 0, 0], "rpy_deg": [0, 0, 0]}
    target = [{"name": "tip", "link": "f", "at_m": [0.0, 0.0, 0.0], "known": {"to_m": 0.01}}]
    session = body_schema.Session.from_urdf(text, "a", "f", base_=place, target=target)
    random = np.random.default_rng(1013)
    positions = random.uniform([-0.5, -2, -2], [0.5, 2, 2], (20, 3))
    description = Description(text)
    chain = description.chain("a", "f")
    assert description.reads(chain) == session.joints == ["lift", "turn", "bend"]
    _, hand = description.hand(chain, positions)
    assert np.abs(hand - np.array(session.predict(positions.tolist(), joints=session.joints))).max() < 1e-9
    # The same with a joint that follows another.
    mimics = text.replace('<axis xyz="1 1 0"/>', '<axis xyz="1 1 0"/><mimic joint="turn" multiplier="-0.5" offset="0.2"/>')
    description = Description(mimics)
    chain = description.chain("a", "f")
    assert description.reads(chain) == ["lift", "turn"]
    positions[:, 2] = 0.2 - 0.5 * positions[:, 1]
    _, hand = description.hand(chain, positions[:, :2])
    assert np.abs(hand - np.array(session.predict(positions.tolist(), joints=session.joints))).max() < 1e-9


@pytest.mark.parametrize(("share", "apart_s"), [(0.1, 1e-6), (1.0, 1e-6), (0.1, 1e-4), (1.0, 2e-4)])
def test_readings_that_come_nearly_at_once_are_one(share: float, apart_s: float) -> None:
    """As from two publishers: between them noise is no movement."""
    run = Run(1011)
    random = np.random.default_rng(1011)
    track = joints(run)
    again = random.random(len(track.times)) < share
    times = np.concatenate([track.times, track.times[again] + apart_s])
    dropped: Counter[str] = Counter()
    series = {}
    for index, name in enumerate(track.names):
        column = np.concatenate([track.positions[:, index], track.positions[again, index]])
        series[name] = (times, column + random.normal(0.0, 2e-5, len(times)))
    both = joint_track(track.names, series, set(), dropped)
    assert len(both.times) == len(track.times)
    assert dropped["stands for several at once"] == int(again.sum()) * len(track.names)
    between = (track.times[:-1] + track.times[1:]) / 2
    assert np.nanmax(np.abs(both.at(between)[0] - track.at(between)[0])) < 5e-4
    offset = clock.estimate(both, seen(run, 0.4, "position"), DESCRIPTION, CHAIN, 10.0)
    assert offset.told and abs(offset.seconds - 0.4) < 5.0 * offset.deviation_s + 0.001 and offset.deviation_s < 0.003, offset
