//! The recording of a calibration holds what its report says.

use std::fs;

use body_schema::{
    calibration::{Calibration, Case, Options, Silent, calibrate},
    recording, report,
    scenario::builtin,
};

use super::{path, reading::Reading};

fn recorded(name: &str, folds: Option<usize>) -> (Reading, Calibration, usize) {
    let scenario = builtin(name).unwrap();
    let case = Case::new(&scenario).unwrap();
    let found = calibrate(&case, &Options { folds, active: None }, &Silent).unwrap();
    let file = path(&format!("{name}-calibration.rrd"));
    let look = recording::CalibrationLook::default();
    recording::calibration(&file, &found, &case, &report::markdown(&found, &case), &look).unwrap();
    (Reading::of(&fs::read(file).unwrap()), found, case.rows.len())
}

/// In how many rows an entity has something; beside them stands how a series looks, at all times.
fn rows_with(reading: &Reading, entity: &str) -> usize {
    reading.steps(entity).into_iter().filter(|step| *step > 0).count()
}

/// Row by row, of positions whose base and marker nobody knew.
#[test]
fn every_row_stands_with_its_error() {
    let (reading, found, rows) = recorded("tiago-mocap", Some(5));
    assert_eq!(reading.steps("/robot/arm").len(), rows);
    assert_eq!(reading.steps("/robot/described").len(), rows);
    assert_eq!(rows_with(&reading, "/residuals/learned_from"), 0, "every row is held out once");
    let mut ratio = None;
    for said in &found.report.residuals {
        let step = said.row as u64;
        let residual = reading.numbers("/residuals/held_out", "Scalars:scalars", Some(step)).unwrap()[0];
        assert!((residual - said.residual_mm.unwrap()).abs() < 1e-9, "row {step}");
        // From where it was measured towards what was predicted, so many times as long.
        let line = reading.strip("/robot/errors/calibrated", Some(step));
        let length: f64 = (0..3).map(|axis| (line[3 + axis] - line[axis]).powi(2)).sum::<f64>().sqrt();
        let times = length * 1e3 / residual;
        let first = *ratio.get_or_insert(times.round());
        assert!((times / first - 1.0).abs() < 1e-3 && [5.0, 10.0, 20.0, 50.0].contains(&first), "row {step}: {times}");
        assert!((0..3).all(|axis| (line[axis] - said.measured[axis]).abs() < 1e-5), "row {step}");
    }
    assert_eq!(rows_with(&reading, "/residuals/described"), rows);
    assert!(reading.entities().contains(&"/report".to_owned()));
}

/// What was learned from and what was held out are told apart; lines end at the socket.
#[test]
fn rows_in_sockets_are_held_out_or_not() {
    let (reading, found, rows) = recorded("panda-sockets", None);
    let held_out = found.report.residuals.iter().filter(|reading| reading.held_out).count();
    assert_eq!(rows_with(&reading, "/residuals/held_out"), held_out);
    assert_eq!(rows_with(&reading, "/residuals/learned_from"), rows - held_out);
    assert_eq!(rows_with(&reading, "/outliers"), rows - held_out, "of rows that were learned from");
}
