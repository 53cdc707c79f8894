"""The report of a calibration, by key: the content of ``report.json``."""

from __future__ import annotations

from typing import Literal, TypedDict


class _CalibratedChain(TypedDict):
    #: The file, as the scenario names it.
    urdf: str
    #: The link that stands still.
    base: str
    #: The link that carries the targets; the first of several.
    tip: str


class CalibratedChain(_CalibratedChain, total=False):
    """A chain of a description."""

    #: The other tip links, where joints branch.
    tips: list[str]


class LearnedParameters(TypedDict):
    """The learned parameters, and those that could not be determined."""

    #: The number of learned parameters.
    learned: int
    #: The number of directions among them that the rows determine.
    rank: int
    #: The directions that they do not determine, in words.
    undetermined: list[str]


class CalibrationVerdict(TypedDict):
    """The answer, and why."""

    #: The answer.
    use: Literal["yes", "limited", "no"]
    #: Why, in words.
    because: str


class ErrorFigures(TypedDict):
    """Mean, root mean square and maximum of errors."""

    #: The number of readings.
    readings: int
    #: Mean distance, millimetres; None where no length was measured.
    mean_mm: float | None
    #: Root mean square, millimetres.
    rms_mm: float | None
    #: The greatest, millimetres.
    max_mm: float | None
    #: Mean angle, degrees; None where no rotation was measured.
    mean_deg: float | None
    #: Root mean square, degrees.
    rms_deg: float | None
    #: The greatest, degrees.
    max_deg: float | None
    #: Mean distance in the picture, pixels; None without pictures.
    mean_px: float | None
    #: Root mean square, pixels.
    rms_px: float | None
    #: The greatest, pixels.
    max_px: float | None


class BeforeAndAfter(TypedDict):
    """Errors before and after calibration. Before: the chain as described, with base, targets, cameras and sockets fitted to the
    same rows.
    """

    #: Errors as described.
    before: ErrorFigures
    #: Errors as calibrated.
    after: ErrorFigures


class Placement(TypedDict):
    """The pose of a frame in another."""

    #: Its origin, metres.
    xyz_m: list[float]
    #: Roll, pitch and yaw, radians: Rz(yaw) Ry(pitch) Rx(roll).
    rpy_rad: list[float]
    #: Standard deviations of the origin, metres; None where it was not learned.
    xyz_sd_m: list[float] | None
    #: Standard deviations of the rotation about x, y, z, radians.
    rotation_sd_rad: list[float] | None


class FoundTarget(TypedDict):
    """A target."""

    #: Its name.
    name: str
    #: The link in whose frame it is given; without a URDF the joint behind which it is, in the base's frame at θ = 0.
    link: str
    #: Its place there.
    xyz_m: list[float]
    #: Roll, pitch and yaw, radians; None for a point.
    rpy_rad: list[float] | None
    #: Standard deviations of its place along the axes of the base link's frame, metres; None where it was not learned.
    xyz_sd_m: list[float] | None


class Fold(TypedDict):
    """One fold."""

    #: Its number, counted from 0; its URDF lies in ``folds/`` under this number.
    fold: int
    #: The rows that it holds out, counted from 1.
    rows: list[int]
    #: Errors as described.
    before: ErrorFigures
    #: Errors as calibrated.
    after: ErrorFigures
    #: Errors of the extended model.
    full_model: ErrorFigures
    #: The pose of its base link.
    base: Placement
    #: The places of its targets.
    targets: list[FoundTarget]


class HeldOut(TypedDict):
    """Errors before and after calibration, on rows that were not learned from."""

    #: Errors as described.
    before: ErrorFigures
    #: Errors as calibrated: predictions by ``calibrated.urdf``, with folds by those in ``folds/``.
    after: ErrorFigures
    #: Errors of the extended model; equal to ``after`` where nothing was added.
    full_model: ErrorFigures
    #: The folds; empty without folds.
    folds: list[Fold]


class Coverage(TypedDict):
    """The share of readings within the 95 % intervals."""

    #: The number of held-out readings.
    readings: int
    #: The share of them within the stated 95 % intervals.
    share: float
    #: The lower end of its 95 % interval, clustered by posture.
    low: float
    #: The upper end.
    high: float
    #: The factor of lengths by which the stated intervals are wider than noise and uncertainty alone make them, from folds among the
    #: training rows; the mean over the splits.
    widened: float


class SocketDistance(TypedDict):
    """The distance between the two sockets of one place. It shows how large the robot is, which a scatter alone does not."""

    #: The place.
    place: str
    #: The distance that the calibrated model predicts, millimetres.
    predicted_mm: float
    #: The known distance, millimetres.
    known_mm: float | None


class ExtraTrial(TypedDict):
    """A trial of extra corrections."""

    #: The corrections that were added.
    extras: list[Literal["ratios", "eccentricity", "compliance"]]
    #: The number of parameters that they add.
    parameters: int
    #: The corrections without a parameter of their own, because they cannot be told from others, in words.
    merged: list[str]
    #: Mean error over the folds among the training rows without it, in the unit of the report.
    inner_without: float | None
    #: Mean error over the folds among the training rows with it, in the unit of the report.
    inner: float | None
    #: The standard error of the difference of the two.
    standard_error: float | None
    #: Held-out figures with it, for information; they decide nothing.
    held_out: ErrorFigures | None
    #: The change that it makes to predictions where the robot is asked about, root mean square, millimetres; None where the folds do
    #: not support it.
    change_mm: float | None
    #: The standard deviation that it adds to predictions there, millimetres.
    change_sd_mm: float | None
    #: Whether it is dropped although the folds support it, because the postures that are asked about lie outside those of the rows.
    is_beyond: bool
    #: Whether it is kept.
    kept: bool


class JointCompliance(TypedDict):
    """The compliance of a joint to a load."""

    #: Its name.
    joint: str
    #: ``target`` or ``elbow``.
    load: str
    #: Degrees per N·m of 1 kg; above 0 where it gives way downwards.
    deg_per_nm: float
    #: Its standard deviation.
    sd_deg_per_nm: float
    #: The angle by which it gives way in the posture of its greatest load among the rows, degrees.
    greatest_deg: float


class FoundCompliance(TypedDict):
    """The compliance of joints to gravity, per N·m with which it pulls at 1 kg, at the target or at the elbow, of the robot as
    described.
    """

    #: The upward direction, in the base link's frame.
    up: list[float]
    #: The joint at whose origin the elbow is.
    elbow: str
    #: The compliance by joint and load.
    terms: list[JointCompliance]


class _OutlierRow(TypedDict):
    #: The row, counted from 1.
    row: int
    #: The line of the file.
    line: int
    #: The probability that the row is an outlier.
    probability: float


class OutlierRow(_OutlierRow, total=False):
    """A row that is likelier an outlier than not."""

    #: The file, where rows come from more than one.
    file: str | None


class _FoundNoise(TypedDict):

    #: The source of the readings.
    sensor: str
    #: Its unit: m, rad or px.
    unit: str
    #: Nominal standard deviation.
    sigma: float
    #: Squared residuals in nominal standard deviations, outliers not counted.
    chi2: float
    #: Their degrees of freedom: equations less those that parameters absorb.
    degrees: float
    #: The standard deviation that explains them.
    explaining_sigma: float | None


class FoundNoise(_FoundNoise, total=False):
    """One kind of noise."""

    #: How many times larger variances are than independent equations would make them, since several targets of one link err together; so many
    #: equations count as one. Only where it is above 1.
    shared: float


class Corrected(TypedDict):
    """A number with its standard deviation."""

    #: Degrees or millimetres.
    value: float
    #: Its standard deviation.
    sd: float


class CorrectedJoint(TypedDict):
    """The correction of a joint."""

    #: Its name.
    name: str
    #: ``revolute`` or ``prismatic``.
    kind: str
    #: Whether its axis was learned.
    learned: bool
    #: The shift of its axis across itself, in the base link's frame at θ = 0, millimetres; zero for a prismatic joint.
    shift_mm: list[float]
    #: Standard deviations of the shift, millimetres.
    shift_sd_mm: list[float]
    #: The turn of its axis, a rotation vector in the base link's frame at θ = 0, degrees.
    turn_deg: list[float]
    #: Standard deviations of the turn, degrees.
    turn_sd_deg: list[float]
    #: The offset added to its reading, degrees or millimetres; None where it was not learned.
    offset: Corrected | None


class LensCoefficient(TypedDict):
    """A learned number of a camera's intrinsics, or of the distortion of its lens."""

    #: The camera.
    camera: str
    #: The number, as OpenCV names it: ``fx``, ``cy``, ``k1``, ``p1``, …
    name: str
    #: Its value, px of intrinsics, without a unit of a distortion.
    value: float
    #: Its standard deviation.
    sd: float


class CorrelatedParameters(TypedDict):
    """Two parameters that the rows hardly tell apart."""

    #: The first parameter.
    first: str
    #: The second parameter.
    second: str
    #: The correlation, between −1 and 1.
    correlation: float


class MoreRows(TypedDict):
    """The error to expect after more rows of the same kind: e² = m² + p²(N) after N rows instead of n, where p falls as far as the
    rows tell.
    """

    #: n, the number of rows.
    rows: int
    #: e, the error of a prediction where the robot is asked about (held-out rows, otherwise the table's postures, with sockets places
    #: anywhere in reach), by the model itself and by held-out rows, millimetres.
    expected_mm: float | None
    #: p, the part of it that more rows make smaller, millimetres.
    from_parameters_mm: float | None
    #: m, the model error, which no parameter explains, millimetres.
    model_error_mm: float
    #: The part of p that no number of rows like these makes smaller, millimetres.
    untold_mm: float
    #: The error of held-out rows without their own noise, root mean square, millimetres; None where no length was held out.
    held_out_mm: float | None
    #: The accuracy that the scenario wants, millimetres.
    wanted_mm: float
    #: The total number of rows that reach it; None if no number does.
    rows_needed: int | None
    #: The total number of rows that reach it if m is noise of the sensor; None where repeats decide that, or where it makes no
    #: difference.
    rows_needed_if_noise: int | None
    #: A sentence on these figures.
    said: str


class ChosenRows(TypedDict):
    """The choice of rows."""

    #: The criterion: A, D, E or I.
    criterion: str
    #: Its start.
    start: str
    #: The chosen rows in their order, counted from 1.
    rows: list[int]


class ActivePoint(TypedDict):
    """The held-out error after a number of rows."""

    #: The number of rows learned from.
    rows: int
    #: The mean held-out error with chosen rows, millimetres; None without chosen rows.
    active_mm: float | None
    #: The median of the mean held-out error over random orders, millimetres.
    random_median_mm: float | None
    #: The lower quartile over random orders, millimetres.
    random_q25_mm: float | None
    #: The upper quartile over random orders, millimetres.
    random_q75_mm: float | None


class _Residual(TypedDict):
    #: The row, counted from 1.
    row: int
    #: The line of the file.
    line: int
    #: The source of the reading.
    sensor: str
    #: Whether the row was held out of the model that predicts it.
    held_out: bool
    #: The fold that held it out.
    fold: int | None
    #: Its place among the chosen rows, counted from 1.
    chosen: int | None
    #: The prediction, in the sensor's own numbers: metres, a rotation vector in radians, pixels.
    predicted: list[float]
    #: The measurement, in the sensor's own numbers; NaN, in JSON None, for points that are not seen.
    measured: list[float | None]
    #: The residual, millimetres.
    residual_mm: float | None
    #: The residual, degrees.
    residual_deg: float | None
    #: The residual, pixels.
    residual_px: float | None
    #: The probability that the row is an outlier, by the model learned from it; None where none learned from it.
    outlier_probability: float | None


class Residual(_Residual, total=False):
    """A reading with its prediction."""

    #: The file, where rows come from more than one.
    file: str | None


class _CalibrationReport(TypedDict):
    #: The scenario's name.
    scenario: str
    #: One line about it.
    title: str
    #: The version of this program.
    version: str
    #: The chain of the URDF that is calibrated; None where joints are given one by one.
    chain: CalibratedChain | None
    #: The number of rows of the table.
    rows: int
    #: The number of rows that the calibrated model was learned from.
    training_rows: int
    #: How rows are held out, in words.
    held_out_by: str
    #: The doubts about the table, the weightiest first.
    doubts: list[str]
    #: The learned parameters.
    parameters: LearnedParameters
    #: Whether the result should be used.
    verdict: CalibrationVerdict
    #: The unit in which errors are compared; also that of ``active`` and ``learning``, whatever their names say.
    unit: Literal["mm", "px", "deg"]
    #: Errors on the rows that were learned from.
    training: BeforeAndAfter
    #: Errors on rows that were not; None where none are held out.
    held_out: HeldOut | None
    #: The coverage of held-out readings by their stated intervals; None where too few are held out, and for sockets.
    coverage: Coverage | None
    #: The factor of lengths by which what is stated of predictions, noise and uncertainty together, is to be widened so that it holds for 95 %
    #: of readings: from folds among the rows that were learned from, and 1 where these are enough or fewer than ten postures.
    widened: float
    #: With sockets: the distance between the two of every place that was not learned from; empty otherwise.
    sockets: list[SocketDistance]
    #: With sockets: the standard deviation of a span of 1 m of the calibrated robot, millimetres, which a scatter does not show; None
    #: otherwise.
    span_1m_sd_mm: float | None
    #: The trials of extra corrections.
    extras: list[ExtraTrial]
    #: The compliance of the joints in the extended model; None where that is not kept.
    compliance: FoundCompliance | None
    #: Rows that are likelier outliers than not.
    outliers: list[OutlierRow]
    #: The noise that the residuals show.
    noise: list[FoundNoise]
    #: The pose of the base link in the frame of the measurements.
    base: Placement
    #: The places of the targets.
    targets: list[FoundTarget]
    #: The learned correction of every joint.
    joints: list[CorrectedJoint]
    #: Pairs of parameters that the rows hardly tell apart: correlations above 0.9, the greatest first.
    correlations: list[CorrelatedParameters]
    #: The error to expect after more rows.
    more_rows: MoreRows
    #: How rows were chosen; None if none were.
    selection: ChosenRows | None
    #: Held-out error by number of rows, chosen and in random order.
    active: list[ActivePoint]
    #: Held-out error by number of rows, in random order alone, if no rows were chosen.
    learning: list[ActivePoint]
    #: Every reading.
    residuals: list[Residual]


class CalibrationReport(_CalibrationReport, total=False):
    """The whole report."""

    #: The learned standard deviation of each joint's readings, rad or m; empty if it was not learned.
    reading_sigmas: list[float]
    #: The places of the cameras, on the links that carry them or, of those that stand, in the frame of the base: of the frame that looks along
    #: its z, with x to the right of the picture and y down.
    cameras: list[FoundTarget]
    #: The learned focal lengths and centres of cameras, pixels: ``fx``, ``fy``, ``cx``, ``cy``.
    intrinsics: list[LensCoefficient]
    #: The learned coefficients of lenses.
    distortion: list[LensCoefficient]
