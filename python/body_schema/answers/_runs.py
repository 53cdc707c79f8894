"""What runs of scenarios give, by key."""

from __future__ import annotations

from typing import Any, TypedDict

from ._sessions import Model, Thresholds


class BestDesign(TypedDict):
    """The best design of so many movements."""

    #: The step of a run after which a learner has made them.
    step: int
    #: Its movements: since the start, or since the change of the body.
    movements: int
    #: tr(W M⁻¹), what these data allow, in the units of the criterion: beside ``bound_trace`` of an experiment's metrics.
    best_design_trace: float
    #: By how much that may exceed the optimum, as a fraction of it: the gap of the equivalence theorem.
    gap: float
    #: How many parameters it is for: who learns fewer cannot be compared with it.
    parameters: int


class OutlierReading(TypedDict):
    """A reading that had nothing to do with the robot."""

    #: The movement, counted from 1.
    movement: int
    #: The channel, counted from 0.
    channel: int


class JointMetrics(TypedDict):
    """One joint against the truth; None where no truth is known, and for a joint that is not learned."""

    #: Angle between estimated and true direction, signed, degrees.
    axis_deg: float | None
    #: Distance of the true axis point to the estimated line, metres; None for a prismatic joint.
    location_m: float | None
    #: How far this joint's error shows above the noise: with the true arm but for this one joint, which is as estimated, the root mean
    #: square displacement of the marker over the first 50 configurations of the evaluation set, divided by the standard deviation σ of
    #: the sensor per coordinate. At 1 the error is as large as the noise of one measurement. None if the sensor has no noise.
    signal_to_noise: float | None


class _Errors(TypedDict):
    #: Mean over pairs i<j of learned revolute joints of |∠(ŵᵢ, ŵⱼ) − ∠(wᵢ, wⱼ)|, degrees: the paper's measure.
    orientation_deg: float | None
    #: Mean angle between estimated and true direction, signed, degrees.
    axis_deg: float | None
    #: Mean distance of each true axis point to the estimated line, learned revolute joints, metres.
    location_m: float | None
    #: Root mean square of the distance between predicted and true (or held-out measured) marker, metres.
    prediction_m: float | None
    #: Mean of that distance, metres.
    prediction_mean_m: float | None
    #: With sockets: mean distance of the predicted target from its mean over the postures that hold it in the same socket, over
    #: sockets that were not trained on, metres; None where there are none.
    scatter_m: float | None
    #: tr(W P), in the units of the criterion.
    trace: float | None
    #: tr(W F⁻¹), what prior and data collected so far allow, linearised at the truth; since the change of the body, if it changed.
    bound_trace: float | None


class _Metrics(_Errors):
    #: The prediction error that the learner itself expects over its workspace: mean of √(tr(H P Hᵀ) + e²), e the model error, metres.
    expected_prediction_m: float | None
    #: Normalised innovation squared of the last update.
    nis: float | None
    #: Its degrees of freedom.
    nis_dof: int | None
    #: Normalised estimation error squared, eᵀP⁻¹e in tangent coordinates, in the subspace that measurements determine.
    nees: float | None
    #: Its degrees of freedom.
    nees_dof: int | None
    #: Movements made so far.
    movements: int
    #: Movements after which the marker was not seen.
    misses: int
    #: The learner's own verdict: its expected prediction error has been below the scenario's target for 5 steps.
    settled: bool
    #: How often the learner noticed a change of the body.
    changes_noticed: int
    #: Every joint of the chain by itself, base first.
    joints: list[JointMetrics]


class Metrics(_Metrics, total=False):
    """The metrics of one learner after one step. What needs the truth is None where none is known."""

    #: Mean angle between predicted and measured rotations of held-out poses, degrees; None where none were measured.
    prediction_mean_deg: float | None
    #: Mean distance between predicted and measured points of held-out pictures, pixels; None where there are none.
    prediction_mean_px: float | None
    #: By how much predictions are off that no parameter explains, root mean square, metres; None for a learner that takes the noise
    #: for known.
    model_error_m: float | None


class ReadingReport(TypedDict):
    """What an estimator makes of one reading, by its belief."""

    #: The movement, counted from 1; 0 for what was known before the first.
    movement: int
    #: The channel, counted from 0.
    channel: int
    #: Its equations.
    equations: int
    #: How far it is from what the belief predicts, in standard deviations of its noise.
    residual_sigmas: float
    #: The weight of its equations; 1 for least squares.
    weight: float
    #: The probability that it is an outlier; None for a loss that knows of none.
    outlier_probability: float | None


class NoiseReport(TypedDict):
    """The learned scale of one kind of noise."""

    #: The channel, counted from 0.
    channel: int
    #: The first of its equations that this noise is of.
    first: int
    #: Its standard deviation in nominal ones.
    scale: float


class _LearnerResult(TypedDict):
    #: Its name.
    name: str
    #: Its estimator.
    estimator: str
    #: Its policy.
    policy: str
    #: First movement of the final stretch within the thresholds, confirmed by 20 more; None if there is none.
    converged_at: int | None
    #: After a change of the body: the first movement, counted from the change, of the final stretch within the thresholds, confirmed
    #: by 20 more; None if there is none or no change. ``converged_at`` is judged up to the change.
    recovered_at: int | None
    #: The movement, counted from the change, at which the learner itself noticed it; None for a learner that does not look for
    #: changes.
    change_detected_at: int | None
    #: How often the learner noticed a change of the body before there was one.
    false_alarms: int
    #: First movement at which the learner called itself settled; None if it did not.
    settled_at: int | None
    #: Why the learner stopped learning, if it did.
    failure: str | None
    #: The A-efficiency of the data collected: the trace of the last of ``best_designs`` as a fraction of ``bound_trace`` at the end;
    #: None without one of them.
    efficiency: float | None
    #: How many parameters it learns.
    parameters: int
    #: The metrics at the end.
    metrics: Metrics
    #: The learned model.
    model: Model


class LearnerResult(_LearnerResult, total=False):
    """The outcome of one learner."""

    #: What it makes of every reading, for a learner with a robust loss.
    readings: list[ReadingReport]
    #: The scales of noise that it learned.
    noise: list[NoiseReport]
    #: How far the joints' readings are off as it learned it: one standard deviation for each joint, rad or m.
    reading_sigmas: list[float]
    #: What is to be said of it in words: what no movement can tell, noise other than promised, outliers, alarms.
    remarks: list[str]


class _RunResult(TypedDict):
    #: Name of the scenario.
    scenario: str
    #: Seed of all random streams.
    seed: int
    #: Version of body-schema that computed this.
    version: str
    #: Steps made.
    steps: int
    #: The thresholds of ``converged_at``.
    thresholds: Thresholds
    #: Movements after which there are as many equations as can be determined.
    movements_by_counting: int
    #: The best designs of several lengths up to this run's, by step; empty unless they were asked for, and where no truth is known.
    best_designs: list[BestDesign]
    #: The learners.
    learners: list[LearnerResult]


class RunResult(_RunResult, total=False):
    """The outcome of one run: ``result.json``."""

    #: What is other than in the scenario's file, as ``KEY=VALUE``; empty for the scenario as it is.
    set: list[str]
    #: The readings that had nothing to do with the robot, where the world is simulated and has such.
    outliers: list[OutlierReading]


class RunSummary(_Errors):
    """The errors of one run at its end."""


class SeedRun(TypedDict):
    """One run of one learner."""

    #: Its seed.
    seed: int
    #: First movement of the final stretch within the thresholds, confirmed by 20 more; None if there is none.
    converged_at: int | None
    #: The same after a change of the body, counted from it; None if there is none or no change.
    recovered_at: int | None
    #: Movements made.
    movements: int
    #: Movements after which the marker was not seen.
    misses: int
    #: The errors at the end.
    final: RunSummary


class ConvergenceSummary(TypedDict):
    """When the runs of a learner converged. A run that did not counts as infinitely late: a quantile that falls on one is None.
    Quantiles are nearest-rank, but the median of an even number is the mean of its two middle runs.
    """

    #: How many runs.
    runs: int
    #: How many converged.
    converged: int
    #: The median run.
    median_converged_at: float | None
    #: The run at the 90th percentile.
    p90_converged_at: float | None
    #: The last run; None unless all converged.
    max_converged_at: float | None


class Quantiles(TypedDict):
    """One error over the runs in which it is a finite number."""

    #: Arithmetic mean.
    mean: float
    #: Median.
    median: float
    #: Lower quartile.
    q25: float
    #: Upper quartile.
    q75: float


class ErrorCurve(TypedDict):
    """The errors after so many movements, over the runs."""

    #: Movements made.
    movements: int
    orientation_deg: Quantiles | None
    axis_deg: Quantiles | None
    location_m: Quantiles | None
    prediction_m: Quantiles | None
    prediction_mean_m: Quantiles | None
    scatter_m: Quantiles | None
    trace: Quantiles | None
    bound_trace: Quantiles | None
    #: Every joint by itself, base first: medians over the runs.
    joints: list[JointMetrics]


class SelectionTime(TypedDict):
    """Wall time of choosing one movement."""

    #: Median over all movements of all runs, milliseconds.
    median: float | None
    #: 95th percentile, milliseconds.
    p95: float | None


class LearnerComparison(TypedDict):
    """One learner over many seeds."""

    #: Its name.
    name: str
    #: Its runs, in the order of the seeds.
    runs: list[SeedRun]
    #: When they converged.
    summary: ConvergenceSummary
    #: The errors by number of movements, over the runs.
    curve: list[ErrorCurve]
    #: How long choosing one movement took, milliseconds.
    selection_ms: SelectionTime
    #: The A-efficiency of the data collected: the trace of the last of ``best_designs`` as a fraction of the median ``bound_trace`` at
    #: the end; None without one of them.
    efficiency: float | None
    #: How many parameters it learns.
    parameters: int


class _Comparison(TypedDict):
    #: Name of the scenario.
    scenario: str
    #: Steps of every run.
    steps: int
    #: Movements after which there are as many equations as can be determined.
    movements_by_counting: int
    #: The best designs of several lengths up to these runs', by step; empty unless they were asked for, and where no truth is known.
    best_designs: list[BestDesign]
    #: The learners.
    learners: list[LearnerComparison]


class Comparison(_Comparison, total=False):
    """Many runs of the same learners, one per seed: ``compare --json``."""

    #: What is other than in the scenario's file, as ``KEY=VALUE``; empty for the scenario as it is.
    set: list[str]


class Simulation(TypedDict):
    """What ``simulate`` gives."""

    #: What ``body-schema run --json`` writes.
    result: RunResult
    #: A row per learner and step: ``step``, ``learner``, and the metrics that are numbers.
    curve: list[dict[str, Any]]
