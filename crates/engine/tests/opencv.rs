//! Lenses against OpenCV: `opencv/table.csv` was written by `opencv/table.py`.

#![allow(missing_docs)]

use body_schema_engine::model::{Distortion, DistortionModel};
use nalgebra::Vector3;

/// As in the script.
const FOCAL: [f64; 2] = [512.3, 498.7];
const CENTRE: [f64; 2] = [321.9, 237.4];

#[test]
fn lenses_show_points_where_opencv_does() {
    let mut count = 0;
    for line in include_str!("opencv/table.csv").lines().filter(|line| !line.starts_with('#')) {
        let (model, numbers) = line.split_once(',').expect("a model");
        let numbers: Vec<f64> = numbers.split(',').map(|x| x.parse().expect("a number")).collect();
        let (model, known) = match model {
            "fisheye" => (DistortionModel::Equidistant, 4),
            _ => (DistortionModel::BrownConrady, 8),
        };
        let distortion = Distortion::new(model, &numbers[..known]).expect("a lens");
        let at = Vector3::from_column_slice(&numbers[8..11]);
        assert!(distortion.holds(&at), "{line}");
        let place = distortion.image(&at).at;
        for axis in 0..2 {
            let (found, wanted) = (FOCAL[axis] * place[axis] + CENTRE[axis], numbers[11 + axis]);
            assert!((found - wanted).abs() < 1e-9, "{line}: {found}");
        }
        count += 1;
    }
    assert_eq!(count, 9 * 12);
}
