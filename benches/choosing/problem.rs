//! The problems of the benchmark, for programs in other languages.

use body_schema::{
    kinematics::{Joint, chart},
    scenario::builtin,
    selection::Criterion,
};
use serde_json::{Value, json};

use super::{CASES, Case};

/// Postures that come with their criterion, so that others can see whether theirs is the same.
const CHECKS: usize = 5;

/// Writes them as JSON.
pub fn write(file: &str) {
    let problems: Vec<Value> = CASES.iter().map(|name| problem(name)).collect();
    std::fs::write(file, Value::from(problems).to_string()).expect("written");
}

fn problem(name: &str) -> Value {
    let case = Case::new(&builtin(name).expect("built in"), super::SEED);
    let state = &case.belief.state;
    let joint = |joint: &Joint| {
        let line = joint.line().expect("revolute");
        let basis = chart::basis(&line.direction);
        json!({
            "point_m": line.point.coords.as_slice(),
            "direction": line.direction.as_slice(),
            "basis": [basis.column(0).as_slice(), basis.column(1).as_slice()],
        })
    };
    let criterion = Criterion::new(&case.belief, &case.weights).expect("a covariance");
    let postures = &case.candidates[..CHECKS];
    let checks = postures.iter().zip(criterion.evaluate(postures));
    let covariance = case.covariance();
    let unit = |index: usize| {
        let mut unit = nalgebra::DMatrix::zeros(covariance.nrows(), covariance.ncols());
        unit[(index, index)] = 1.0;
        case.weights.trace(&unit)
    };
    json!({
        "name": name,
        "joints": state.joints.iter().map(joint).collect::<Vec<_>>(),
        "marker_m": state.marker().coords.as_slice(),
        "sigma_m": case.belief.measurement_model.sigma(),
        "weights": (0..covariance.nrows()).map(unit).collect::<Vec<_>>(),
        "covariance": covariance.row_iter().map(|row| row.iter().copied().collect()).collect::<Vec<Vec<f64>>>(),
        "limits_rad": case.limits,
        "checks": checks.map(|(posture, criterion)| json!({ "posture_rad": posture, "criterion": criterion })).collect::<Vec<_>>(),
    })
}
