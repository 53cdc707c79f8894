"""What sessions answer, by key: those of the server's description, /v1/openapi.json."""

from __future__ import annotations

from typing import Any, Literal, TypedDict


class Enough(TypedDict):
    """The wanted accuracy is reached: the agent's expected error of predictions has been below it for five movements."""

    #: The expected mean error of predictions over the workspace now, millimetres.
    expected_error_mm: float
    #: The number of observations behind it, excluded ones not counted.
    observations: int
    #: The wanted accuracy, millimetres.
    wanted_mm: float


class _Suggestion(TypedDict):
    #: The chance that anything is seen, 0 to 1.
    chance_seen: float
    #: The positions to move to, by joint name, in the units of the URDF (rad, m).
    configuration: dict[str, float]
    #: Its id, counted from 1 over all clients.
    id: int
    #: The number of events that the session had when it was chosen.
    revision: int
    #: Its state.
    state: Literal["pending", "observed", "not_seen", "infeasible", "abandoned", "superseded", "expired"]


class Suggestion(_Suggestion, total=False):
    """A suggested movement. Positions in the order of ``joints``: ``[it["configuration"][name] for name in it["joints"]]``."""

    #: The client that it is for; None if the client gave no name.
    client: str | None
    #: The expected mean error of predictions over the workspace after it and all that were pending before it,
    #: millimetres; None for an estimator without a covariance.
    expected_error_mm_after: float | None
    #: The expected fall of the criterion, in its own units; None for a policy without one, and for a movement that was
    #: given in advance, such as the first into a socket.
    expected_gain: float | None
    #: The time of its expiry, seconds since 1970; None if it does not expire.
    expires_at_s: float | None
    #: The names of the joints, base first: the order in which lists of positions are written.
    joints: list[str]
    #: The socket that the target is to be held in, such as ``PLACE/NAME``; None without sockets.
    socket: str | None
    #: The distance that the joint with the longest way moves, from where the robot will stand then, rad (or m); None
    #: if that is unknown.
    travel_rad: float | None


class _Suggestions(TypedDict):
    #: The suggestions, in the order in which they were chosen.
    suggestions: list[Suggestion]


class Suggestions(_Suggestions, total=False):
    """A client's pending suggestions."""

    enough: Enough | None


class _Observed(TypedDict):
    #: Whether the body seems to have changed: what was learned before is dropped then, and pending suggestions are
    #: superseded.
    body_seems_changed: bool
    #: Its number, counted from 1, by which it can be excluded.
    observation: int
    #: Whether any channel had a reading.
    seen: bool


class Observed(_Observed, total=False):
    """The answer to an observation."""

    #: The expected mean error of predictions over the workspace now, millimetres; None without a covariance.
    expected_error_mm: float | None
    #: The distance from what was expected, root mean square over its equations in standard deviations of the
    #: innovation, ``√(eᵀ S⁻¹ e / d)``: about 1 where all is well. None where nothing was seen, and without a
    #: covariance.
    innovation_sigmas: float | None
    #: The probability that it is an outlier after it was absorbed, the greatest of its channels'. None where nothing
    #: was seen, and for an estimator without outliers.
    outlier_probability: float | None


class _Status(TypedDict):
    #: The number of times that the body seemed to have changed.
    changes_noticed: int
    #: The excluded observations, by number.
    excluded: list[int]
    #: The number of counting observations that saw nothing.
    not_seen: int
    #: The number of observations received, excluded ones included.
    observations: int
    #: The counting observations that are likelier outliers than not under the present belief, by number.
    outliers: list[int]
    #: The number of pending suggestions of all clients.
    pending: int
    #: The number of events.
    revision: int
    #: The wanted accuracy, millimetres.
    wanted_mm: float


class Status(_Status, total=False):
    """The status of a session."""

    enough: Enough | None
    #: The expected mean error of predictions over the workspace now, millimetres; None without a covariance.
    expected_error_mm: float | None
    #: Why nothing is learned any more; None as long as something is.
    failure: str | None
    #: Whether that is after the rigid motion that fits best: nothing tells where the whole stands, and its place is a convention.
    up_to_motion: bool
    #: The part of it that no parameter explains, millimetres; None where the noise is known.
    model_error_mm: float | None
    #: The estimated number of further movements until then, if they teach as those so far did: the error other than
    #: the model's falls with the root of their number. None before there are half as many again as could determine the
    #: robot, and where the model's own error is more than is wanted, so that no number will do.
    movements_left: int | None


class _Told(TypedDict):
    #: The positions of the joints by name, in the units of the URDF (rad, m).
    configuration: dict[str, float]


class Told(_Told, total=False):
    """A movement as it was executed, with what was seen after it."""

    #: The readings by channel, in the shape of its kind (see the module); None where it saw nothing.
    measurements: dict[str, Any]
    #: The suggestion that it carries out, if any.
    suggestion_id: int | None


class ToldObservation(TypedDict):
    """An observation that was told."""

    #: The answer that was given then.
    answer: Observed
    #: Whether it counts for nothing.
    excluded: bool
    #: Its number, counted from 1.
    number: int
    #: As it was told.
    told: Told


class CameraDescription(TypedDict):
    """A camera, as the scenario describes it."""

    #: Its name.
    name: str
    #: Width and height of its picture, pixels.
    size_px: list[float]


class _ChannelDescription(TypedDict):
    #: Its equations.
    equations: int
    #: What it is called.
    name: str
    #: The parts of a reading, equal in equations: the points of a target in a picture, the position and the rotation
    #: of a pose. One part is the whole.
    parts: list[str]


class ChannelDescription(_ChannelDescription, total=False):
    """What is read after every movement."""

    #: The camera, by its number; None for what is read without one.
    camera: int | None
    #: What the camera sees, by the number of the target; None without a camera.
    target: int | None


class _HeadDescription(TypedDict):
    #: Half-angle of the cone that an eye sees, radians.
    lens_half_angle_rad: float
    #: Unit look direction at rest.
    look: list[float]
    #: Limit of pan to either side, radians.
    pan_limit_rad: float
    #: Where it is, metres.
    position_m: list[float]
    #: Limit of tilt up and down, radians.
    tilt_limit_rad: float
    #: Unit direction that is upright for the head at rest.
    up: list[float]


class HeadDescription(_HeadDescription, total=False):
    """A camera head with pan and tilt."""

    #: Distance between two eyes, metres; None for one eye.
    eye_baseline_m: float | None


class JointDescription(TypedDict):
    """A joint as the scenario describes it."""

    #: Revolute or prismatic.
    kind: Literal["revolute", "prismatic"]
    #: Whether its axis is learned, or known and held fixed.
    learned: bool
    #: Its limits, rad (revolute) or m (prismatic).
    limits: list[float]
    #: Its name.
    name: str


class _LearnerDescription(TypedDict):
    #: Its estimator: ``rls``, ``gradient``, ``smoother``, …
    estimator: str
    #: Its name in the scenario.
    name: str
    #: Its policy: ``active``, ``active-planned``, ``random``, …
    policy: str


class LearnerDescription(_LearnerDescription, total=False):
    """A learner of the comparison."""

    #: Whether its loss knows of outliers, and tells for each reading how likely it is one.
    robust: bool
    #: Whether stabilising noise, added to its covariance step by step, keeps that larger than its data allow.
    stabilised: bool


class _SocketDescription(TypedDict):
    #: Whether it is held out: nobody learns from it, and the scatter of the predicted target there is judged.
    held_out: bool
    #: Its name, among those of one place.
    name: str


class SocketDescription(_SocketDescription, total=False):
    """A socket as the scenario describes it."""

    #: Where it truly is, metres; None where no truth is known.
    at_m: list[float] | None
    #: The place where it stands, with others; None if there is but one place.
    place: str | None


class TargetDescription(TypedDict):
    """A target, as the scenario describes it."""

    #: Its name.
    name: str
    #: Its known points in its own frame, metres; the origin alone for a point.
    points_m: list[list[float]]


class Thresholds(TypedDict):
    """The thresholds of a scenario."""

    #: Largest ``location_m``, metres.
    location_m: float
    #: Largest ``orientation_deg``, degrees.
    orientation_deg: float


class _PlaceReport(TypedDict):
    #: Its origin, metres.
    position_m: list[float]
    #: Its rotation as a unit quaternion x, y, z, w.
    quaternion: list[float]


class PlaceReport(_PlaceReport, total=False):
    """Where a camera or a target is at θ = 0: its frame, of a camera x to the right of the picture, y down and z ahead."""

    #: Of a camera whose lens bends light, the coefficients of its distortion in OpenCV's order; four are those of a
    #: fisheye if ``is_fisheye``.
    distortion: list[float] | None
    #: Of a camera, focal lengths and principal point (fx, fy, cx, cy), pixels.
    intrinsics_px: list[float] | None
    #: Whether the distortion is that of an equidistant fisheye.
    is_fisheye: bool
    #: What carries it: 0 is the robot's base, i what moves with the i-th joint. None for what stands beside the robot.
    link: int | None


class _CorrectionReport(TypedDict):
    #: Rad or m.
    cosine: float
    #: Rad or m.
    offset: float
    #: Without a unit.
    ratio: float
    #: Rad or m.
    sine: float


class CorrectionReport(_CorrectionReport, total=False):
    """What makes a joint's position θ of its reading q: ``θ = offset + ratio q + sine sin q + cosine cos q +
    compliance·τ``.
    """

    #: How much the joint gives way to the loads at the target and at the elbow, rad per N·m with which gravity pulls
    #: at 1 kg.
    compliance: list[float]


class _JointReport(TypedDict):
    #: Unit direction of the axis.
    axis: list[float]


class JointReport(_JointReport, total=False):
    """The axis of one joint at θ = 0."""

    #: The covariance that its prior and its data allow of that point, linearised at the truth: m², row by row, as
    #: ``bound_trace`` among the metrics. None where no truth is known, or the learner keeps no covariance to compare.
    allowed_point_covariance_m2: list[list[float]] | None
    correction: CorrectionReport | None
    #: Covariance of the direction, rad², row by row: rank 2, flat along the axis.
    direction_covariance_rad2: list[list[float]] | None
    #: Covariance of that point, m², row by row: rank 2, flat along the axis.
    point_covariance_m2: list[list[float]] | None
    #: A point on the axis, metres: of an estimate the one nearest to the true axis point, so that drawings compare
    #: like with like, or the pivot of its chart where no truth is known; None for a prismatic joint.
    point_m: list[float] | None


class _AxisReport(TypedDict):
    #: Its unit direction.
    axis: list[float]


class AxisReport(_AxisReport, total=False):
    """An axis."""

    #: A point on it, metres; None for a prismatic joint.
    point_m: list[float] | None


class MassReport(TypedDict):
    """A mass."""

    #: The link that carries it: 0 is the base, i what moves with the i-th joint.
    link: int
    #: Its place, metres.
    position_m: list[float]


class LoadsReport(TypedDict):
    """The robot as it is described, by whose postures gravity pulls, and the masses of 1 kg at which it does. The torque
    about joint i is −9.81 ∂h/∂qᵢ with h the height of a mass along ``up``; all in the frame of the robot's base at θ
    = 0.
    """

    #: The axes, base first.
    axes: list[AxisReport]
    #: The masses at the target and at the elbow.
    masses: list[MassReport]
    #: Away from the ground.
    up: list[float]


class _Estimate(TypedDict):
    #: The joints, base first.
    joints: list[JointReport]
    #: The marker at θ = 0, metres.
    marker_m: list[float]


class Estimate(_Estimate, total=False):
    """A chain at θ = 0, with its uncertainty if it is an estimate that keeps one."""

    base: PlaceReport | None
    #: The cameras.
    cameras: list[PlaceReport]
    loads: LoadsReport | None
    #: Covariance of the marker, m², row by row; None if it is known or no covariance is kept.
    marker_covariance_m2: list[list[float]] | None
    #: What carries the marker of a robot that branches: 0 is its base, i what moves with the i-th joint. None for an
    #: arm, whose last link carries it.
    marker_link: int | None
    #: The joint that carries each joint, counted from 0, None for one on the base; empty for an arm, whose every joint
    #: is carried by the one before it.
    parents: list[int | None]
    #: The sockets in which targets are held, metres, in the order of the description; those that are held out are none
    #: of them.
    sockets_m: list[list[float]]
    #: What can be looked at; empty where that is a marker alone, and a point.
    targets: list[PlaceReport]


class _Description(TypedDict):
    #: The joints, base first.
    joints: list[JointDescription]
    #: The learners, in the order of every report.
    learners: list[LearnerDescription]
    #: Movements after which there are as many independent equations as can be determined: a yardstick to draw beside
    #: curves, not a bound.
    movements_by_counting: int
    #: Number of learned parameters in tangent coordinates.
    parameters: int
    #: Name of the scenario.
    scenario: str
    #: Seed of all random streams.
    seed: int
    #: The thresholds of ``converged_at``.
    thresholds: Thresholds
    #: One line about the scenario.
    title: str
    #: Version of body-schema.
    version: str


class Description(_Description, total=False):
    """What stays the same from step to step."""

    #: Whether the place of the robot's base in the frame of the measurements is learned.
    base_learned: bool
    body: Literal["humanoid"] | None
    #: The cameras.
    cameras: list[CameraDescription]
    #: The number of movements after which the body changes; None if it does not. ``truth`` is the one before.
    change_at: int | None
    #: What is read after every movement.
    channels: list[ChannelDescription]
    head: HeadDescription | None
    #: How many movements there are at most (a recorded data set ends); None without an end.
    movements_available: int | None
    #: What is other than in the scenario's file, as ``KEY=VALUE``; empty for the scenario as it is.
    set: list[str]
    #: The sockets in which a target is held; those that learners may use first, in the order of their numbers.
    sockets: list[SocketDescription]
    #: What can be looked at, the marker first.
    targets: list[TargetDescription]
    truth: Estimate | None
    #: The unit of the uncertainty, the trace of the weighted covariance: ``rad²``, where lengths count as angles by a
    #: characteristic length, or ``prior variances``.
    uncertainty_unit: str


class _JointModel(TypedDict):
    #: Unit direction of the axis.
    axis: list[float]
    #: The chart's basis: two unit vectors ⟂ axis along which point (m) and direction (rad) move.
    basis: list[list[float]]
    #: Indices of this joint's coordinates in the covariance: two of the point (revolute only), two of the direction.
    coordinates: list[int]
    #: Revolute or prismatic.
    kind: Literal["revolute", "prismatic"]
    #: Whether it was learned, or known and held fixed.
    learned: bool
    #: Its name.
    name: str


class JointModel(_JointModel, total=False):
    """A learned joint."""

    #: What is added to its readings, rad or m; 0 unless it is learned.
    offset: float
    #: A point on the axis, metres; None for a prismatic joint.
    point_m: list[float] | None
    #: What its readings are multiplied by; 1 unless it is learned.
    ratio: float


class _MarkerModel(TypedDict):
    #: Indices of its coordinates in the covariance: x, y, z (m).
    coordinates: list[int]
    #: Whether it was learned.
    learned: bool
    #: Its position at θ = 0, metres.
    position_m: list[float]


class MarkerModel(_MarkerModel, total=False):
    """The marker on the hand."""

    #: What carries it on a robot that branches: 0 is its base, i what moves with the i-th joint. None for an arm,
    #: whose last link carries it.
    link: int | None


class OtherModel(TypedDict):
    """Something learned besides axes and marker."""

    #: Indices of its coordinates in the covariance.
    coordinates: list[int]
    #: What it is, by its name in the engine and its number from 0: ``Base``, ``Ratio(3)``.
    what: str


class _Model(TypedDict):
    #: The joints, base first.
    joints: list[JointModel]
    #: The marker on the hand.
    marker: MarkerModel


class Model(_Model, total=False):
    """A learned chain with its covariance, at θ = 0, in the frame of the measurements."""

    #: Covariance of all learned parameters in tangent coordinates, row by row; None if the estimator keeps none. Every
    #: part of the model lists its own under ``coordinates``.
    covariance: list[list[float]] | None
    #: What else is learned: base, ratios, offsets, other targets, cameras.
    others: list[OtherModel]
    #: The joint that carries each joint, counted from 0, None for one on the base; empty for an arm, whose every joint
    #: is carried by the one before it.
    parents: list[int | None]


class _Channel(TypedDict):
    #: Its key among the measurements.
    name: str
    #: What a reading of it is; see ``observe``.
    channel: Literal["position", "pose", "pixels", "distance", "depth", "sockets"]


class Channel(_Channel, total=False):
    """A channel's name, and the shape of its readings."""

    #: Of pixels, the number of pairs.
    points: int
    #: Of pixels, the least number of points of a reading, where some may be absent.
    least_points: int | None
    #: Of sockets, the allowed values.
    sockets: list[str]
