//! What can be determined of a robot before anything is measured, as it is told: millimetres, degrees and sentences.

use serde::{Deserialize, Serialize};

use body_schema_engine::{
    design::observability::{self, Needed, Observability, Prospect},
    kinematics::{Joint, JointKind},
    model::{Names, Quantity, listed},
    selection::{Movement, Optimality},
};

/// What can be determined of a robot before anything is measured.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ObservabilityReport {
    /// The scenario's name.
    pub scenario: String,
    /// One line about it.
    pub title: String,
    /// The version of this program.
    pub version: String,
    /// The parameters to be learned, and those that can be determined.
    pub parameters: ObservedParameters,
    /// Directions that can be determined, but of which the best postures tell little.
    pub weak: Vec<WeakDirection>,
    /// N, the number of postures that were looked at.
    pub postures: usize,
    /// The criterion by which the best postures were chosen.
    pub criterion: String,
    /// O1 … O5 after N postures.
    pub indices: IndexTable,
    /// The standard deviation of every parameter before, and after N postures.
    pub deviations: Vec<ParameterDeviation>,
    /// The error of predictions over the workspace that is to be expected, by number of postures.
    pub errors: Vec<ExpectedError>,
    /// How many postures the wanted accuracy takes.
    pub accuracy: AccuracyReached,
    /// The best postures, in the order in which they teach most.
    pub best: Vec<PostureToMeasure>,
}

/// The parameters to be learned, and those that can be determined.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ObservedParameters {
    /// How many.
    pub learned: usize,
    /// The number of directions among them that some movement determines.
    pub rank: usize,
    /// The directions that no movement determines, in words.
    pub undetermined: Vec<String>,
}

/// A direction of which measurements tell little.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct WeakDirection {
    /// The deviation that is left after the best N postures, as a share of the prior's.
    pub left: f64,
    /// The direction, in words.
    pub said: String,
}

/// Observability indices, without a unit; all are better the greater they are.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ObservabilityIndices {
    /// (σ₁ σ₂ … σₘ)^{1/m} / √n.
    pub o1: f64,
    /// σₘ / σ₁.
    pub o2: f64,
    /// σₘ.
    pub o3: f64,
    /// σₘ² / σ₁.
    pub o4: f64,
    /// 1 / (1/σ₁ + 1/σ₂ + … + 1/σₘ).
    pub o5: f64,
}

/// Indices of the best and of random postures.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct IndexTable {
    /// The indices of the best postures.
    pub best: ObservabilityIndices,
    /// The medians of the indices over random postures.
    pub random_median: ObservabilityIndices,
}

/// The standard deviation of a parameter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ParameterDeviation {
    /// The parameter's name.
    pub parameter: String,
    /// mm, deg or px; 1 for a ratio.
    pub unit: String,
    /// Before any measurement.
    pub prior: f64,
    /// After the best N postures.
    pub best: f64,
    /// After N random ones, the median.
    pub random_median: f64,
}

/// The expected error of predictions after so many postures.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ExpectedError {
    /// The number of postures.
    pub postures: usize,
    /// The error after the best postures, millimetres.
    pub best_mm: f64,
    /// The median error after random postures, millimetres.
    pub random_median_mm: f64,
    /// The lower quartile of the error after random postures, millimetres.
    pub random_q25_mm: f64,
    /// The upper quartile of the error after random postures, millimetres.
    pub random_q75_mm: f64,
}

/// How many postures a wanted accuracy takes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AccuracyReached {
    /// The wanted accuracy, millimetres.
    pub wanted_mm: f64,
    /// The error that no number of postures makes smaller, millimetres.
    pub floor_mm: f64,
    /// The number of best postures that reach it; null if no number does.
    pub best_postures: Option<u64>,
    /// The number of random postures that reach it; null if no number does.
    pub random_postures: Option<u64>,
    /// A sentence that says how many postures are needed.
    pub said: String,
}

/// A posture to measure.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PostureToMeasure {
    /// The joint positions, degrees; millimetres for sliding joints.
    pub joints: Vec<f64>,
    /// The socket that holds the target at this posture.
    pub socket: Option<String>,
}

impl ObservabilityReport {
    /// Of what was found of a prospect, whose parts have these names, in a scenario of this name and title.
    pub fn of(found: &Observability, prospect: &Prospect, names: &Names, scenario: &str, title: &str) -> Self {
        Self {
            scenario: scenario.to_owned(),
            title: title.to_owned(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            parameters: ObservedParameters {
                learned: prospect.layout.dimension(),
                rank: found.rank,
                undetermined: names.undetermined(
                    &prospect.state,
                    &prospect.layout,
                    &found.undetermined,
                    "any movement",
                ),
            },
            weak: found.weak.iter().map(|weak| WeakDirection::of(weak, names, found.best.len())).collect(),
            postures: found.best.len(),
            criterion: match prospect.planning.optimality {
                Optimality::A => "A: the mean squared error of the parameters",
                Optimality::D => "D: the volume of what is not known of the parameters",
                Optimality::E => "E: the error of the parameters that are known worst",
                Optimality::I => "I: the mean squared error of predictions over the joint limits",
            }
            .to_owned(),
            indices: IndexTable { best: found.indices.best.into(), random_median: found.indices.random_median.into() },
            deviations: deviations(found, prospect, names),
            errors: found.errors.iter().enumerate().map(|(index, point)| ExpectedError::of(index + 1, point)).collect(),
            accuracy: AccuracyReached::of(&found.accuracy),
            best: found.best.iter().map(|movement| PostureToMeasure::of(movement, prospect, names)).collect(),
        }
    }
}

fn deviations(found: &Observability, prospect: &Prospect, names: &Names) -> Vec<ParameterDeviation> {
    let parameters = names.coordinates(&prospect.layout, &prospect.state);
    let quantities = prospect.layout.quantities();
    let of = |((parameter, quantity), deviation): ((String, &Quantity), &observability::Deviation)| {
        let (unit, factor) = match quantity {
            Quantity::Length => ("mm", 1e3),
            Quantity::Angle => ("deg", 1_f64.to_degrees()),
            Quantity::Pixels => ("px", 1.0),
            Quantity::Ratio => ("1", 1.0),
            Quantity::Compliance => ("deg/(N·m)", 1_f64.to_degrees()),
        };
        ParameterDeviation {
            parameter,
            unit: unit.to_owned(),
            prior: factor * deviation.prior,
            best: factor * deviation.best,
            random_median: factor * deviation.random_median,
        }
    };
    parameters.into_iter().zip(quantities).zip(&found.deviations).map(of).collect()
}

impl WeakDirection {
    fn of(weak: &observability::Weak, names: &Names, postures: usize) -> Self {
        let names = listed(weak.blocks.iter().map(|block| names.block(*block)).collect());
        let said = format!(
            "little is told of one direction among {names}: {postures} chosen postures leave {:.0} % of its deviation",
            100.0 * weak.left
        );
        Self { left: weak.left, said }
    }
}

impl From<observability::Indices> for ObservabilityIndices {
    fn from(indices: observability::Indices) -> Self {
        let observability::Indices { o1, o2, o3, o4, o5 } = indices;
        Self { o1, o2, o3, o4, o5 }
    }
}

impl ExpectedError {
    fn of(postures: usize, point: &observability::ErrorPoint) -> Self {
        Self {
            postures,
            best_mm: point.best_m * 1e3,
            random_median_mm: point.random_median_m * 1e3,
            random_q25_mm: point.random_q25_m * 1e3,
            random_q75_mm: point.random_q75_m * 1e3,
        }
    }
}

impl AccuracyReached {
    fn of(accuracy: &observability::Accuracy) -> Self {
        let (wanted_mm, floor_mm) = (accuracy.wanted_m * 1e3, accuracy.floor_m * 1e3);
        let number = |needed: Needed| match needed {
            Needed::Within(postures) => postures.to_string(),
            Needed::About(postures) => format!("about {postures}"),
            Needed::Never => "no number of".to_owned(),
        };
        let (best, random) = (accuracy.best, accuracy.random);
        let said = match best {
            Needed::Never => format!(
                "no number of postures reaches {wanted_mm:.2} mm: {floor_mm:.2} mm are left of what no movement tells"
            ),
            _ => format!("{wanted_mm:.2} mm take {} chosen postures, or {} random ones", number(best), number(random)),
        };
        Self { wanted_mm, floor_mm, best_postures: best.postures(), random_postures: random.postures(), said }
    }
}

impl PostureToMeasure {
    fn of(movement: &Movement, prospect: &Prospect, names: &Names) -> Self {
        let position = |(joint, position): (&Joint, &f64)| match joint.kind() {
            JointKind::Revolute => position.to_degrees(),
            JointKind::Prismatic => position * 1e3,
        };
        Self {
            joints: prospect.state.joints.iter().zip(&movement.configuration).map(position).collect(),
            socket: movement.socket.and_then(|socket| names.sockets.get(socket).cloned()),
        }
    }
}
