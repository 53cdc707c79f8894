"""What movements can determine, by key: what ``body-schema observability --json`` writes."""

from __future__ import annotations

from typing import TypedDict


class ObservedParameters(TypedDict):
    """The parameters to be learned, and those that can be determined."""

    #: How many.
    learned: int
    #: The number of directions among them that some movement determines.
    rank: int
    #: The directions that no movement determines, in words.
    undetermined: list[str]


class WeakDirection(TypedDict):
    """A direction of which measurements tell little."""

    #: The deviation that is left after the best N postures, as a share of the prior's.
    left: float
    #: The direction, in words.
    said: str


class ObservabilityIndices(TypedDict):
    """Observability indices: they measure how well a set of postures conditions an identification, by the singular values σ₁ ≥ … ≥
    σₘ of its Jacobian, n postures stacked, whitened by the noise and with parameters in units of their prior standard
    deviations. Without a unit; all are better the greater they are. Collected and compared by Y. Sun and J. M. Hollerbach,
    "Observability Index Selection for Robot Calibration", ICRA 2008.
    """

    #: (σ₁ σ₂ … σₘ)^{1/m} / √n (Borm and Menq 1991): criterion D.
    o1: float
    #: σₘ / σ₁ (Driels and Pathre 1990): the inverse of the condition number.
    o2: float
    #: σₘ (Nahvi, Hollerbach and Hayward 1994): criterion E.
    o3: float
    #: σₘ² / σ₁ (Nahvi and Hollerbach 1996): the noise amplification index.
    o4: float
    #: 1 / (1/σ₁ + 1/σ₂ + … + 1/σₘ) (Sun and Hollerbach 2008): kin of criterion A.
    o5: float


class IndexTable(TypedDict):
    """Indices of the best and of random postures."""

    #: The indices of the best postures.
    best: ObservabilityIndices
    #: The medians of the indices over random postures.
    random_median: ObservabilityIndices


class ParameterDeviation(TypedDict):
    """The standard deviation of a parameter."""

    #: The parameter's name.
    parameter: str
    #: mm, deg or px; 1 for a ratio.
    unit: str
    #: Before any measurement.
    prior: float
    #: After the best N postures.
    best: float
    #: After N random ones, the median.
    random_median: float


class ExpectedError(TypedDict):
    """The expected error of predictions after so many postures."""

    #: The number of postures.
    postures: int
    #: The error after the best postures, millimetres.
    best_mm: float
    #: The median error after random postures, millimetres.
    random_median_mm: float
    #: The lower quartile of the error after random postures, millimetres.
    random_q25_mm: float
    #: The upper quartile of the error after random postures, millimetres.
    random_q75_mm: float


class AccuracyReached(TypedDict):
    """How many postures a wanted accuracy takes."""

    #: The wanted accuracy, millimetres.
    wanted_mm: float
    #: The error that no number of postures makes smaller, millimetres.
    floor_mm: float
    #: The number of best postures that reach it; None if no number does.
    best_postures: int | None
    #: The number of random postures that reach it; None if no number does.
    random_postures: int | None
    #: A sentence that says how many postures are needed.
    said: str


class PostureToMeasure(TypedDict):
    """A posture to measure."""

    #: The joint positions, degrees; millimetres for sliding joints.
    joints: list[float]
    #: The socket that holds the target at this posture.
    socket: str | None


class Observability(TypedDict):
    """What can be determined of a robot before anything is measured."""

    #: The scenario's name.
    scenario: str
    #: One line about it.
    title: str
    #: The version of this program.
    version: str
    #: The parameters to be learned, and those that can be determined.
    parameters: ObservedParameters
    #: Directions that can be determined, but of which the best postures tell little.
    weak: list[WeakDirection]
    #: N, the number of postures that were looked at.
    postures: int
    #: The criterion by which the best postures were chosen.
    criterion: str
    #: O1 … O5 after N postures.
    indices: IndexTable
    #: The standard deviation of every parameter before, and after N postures.
    deviations: list[ParameterDeviation]
    #: The error of predictions over the workspace that is to be expected, by number of postures.
    errors: list[ExpectedError]
    #: How many postures the wanted accuracy takes.
    accuracy: AccuracyReached
    #: The best postures, in the order in which they teach most.
    best: list[PostureToMeasure]
