//! What is told of an experiment to everything outside: one [`Description`] at the start, one [`StepReport`] after each step, a
//! [`RunResult`] at the end.
//!
//! Everything that shows or stores (recordings, tables, HTTP, the page, Python) reads these and nothing else, and this is how they are
//! written as JSON. They are made of an [`Experiment`](body_schema_experiment::Experiment) by whoever wants them, when they are
//! wanted; the experiment knows nothing of them. Lengths are in metres, angles in radians unless a name says otherwise, all positions
//! in the frame of the measurements.

mod choice;
mod comparison;
mod description;
pub mod design;
mod head;
mod loads;
mod metrics;
mod model;
mod observability;
mod place;
mod result;
mod step;

pub use choice::{AppraisalReport, BoxReport, Choice, ChosenReport, IterationReport, SearchedJoint, ShapeReport};
pub use comparison::{
    Comparison, Curve, LearnerComparison, Quantiles, RunSummary, SeedRun, SelectionTime, Summary, Trace,
};
pub use description::{
    Body, CameraDescription, ChannelDescription, Description, JointDescription, JointKind, LearnerDescription,
    SocketDescription, TargetDescription, Thresholds,
};
pub use design::BestDesign;
pub use head::{GazeReport, HeadDescription};
pub use loads::{AxisReport, LoadsReport, MassReport};
pub use metrics::{JointMetrics, Metrics};
pub use model::{JointReport, ModelReport};
pub use observability::{
    AccuracyReached, ExpectedError, IndexTable, ObservabilityIndices, ObservabilityReport, ObservedParameters,
    ParameterDeviation, PostureToMeasure, WeakDirection,
};
pub use place::{CorrectionReport, PlaceReport};
pub use result::{
    JointModel, LearnerResult, MarkerModel, Model, NoiseReport, OtherModel, OutlierReading, ReadingReport, RunResult,
};
pub use step::{ChannelReading, LearnerReport, MovementReport, Picture, StepReport};

use nalgebra::{Matrix3, Point3, Vector3};

fn array(v: &Vector3<f64>) -> [f64; 3] {
    [v.x, v.y, v.z]
}

fn arrays(points: &[Point3<f64>]) -> Vec<[f64; 3]> {
    points.iter().map(|point| array(&point.coords)).collect()
}

fn rows(matrix: &Matrix3<f64>) -> [[f64; 3]; 3] {
    matrix.transpose().into()
}
