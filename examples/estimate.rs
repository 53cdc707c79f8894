//! An estimator alone: two axes of an arm are learned from where its marker was seen.
//!
//! ```sh
//! cargo run --release --example estimate
//! ```

use body_schema::{
    estimation::{Belief, Estimator, Rls},
    kinematics::{Joint, Line},
    model::{Layout, State},
    sensing::{MeasurementModel, Observation},
};
use nalgebra::{DMatrix, Point3, Vector3};

/// An axis along z that passes through (x, 0, 0), metres, in the frame in which the marker is measured.
fn axis(x: f64) -> Joint {
    Joint::Revolute(Line { point: Point3::new(x, 0.0, 0.0), direction: Vector3::z_axis() })
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let marker = Point3::new(0.5, 0.0, 0.0);
    let truth = State::arm(vec![axis(0.0), axis(0.31)], marker);
    let guess = State::arm(vec![axis(0.02), axis(0.28)], marker);

    // Both axes are learned, the marker is known. A reading has σ = 1 mm, the guess 10 cm and 0.1 rad.
    let layout = Layout::of_arm(&guess, &[true, true], false);
    let prior = DMatrix::from_diagonal_element(layout.dimension(), layout.dimension(), 0.01);
    let belief = Belief::new(guess, layout.into(), MeasurementModel::tracker(0.001).into());
    let mut rls = Rls::new(belief, prior, None);

    for movement in 1..=30 {
        let positions = [0.1 * f64::from(movement) - 1.5, 1.5 - 0.07 * f64::from(movement)];
        let update = rls.update(&positions, &Observation::seen(truth.marker_at(&positions)))?;
        let elbow = rls.belief().state.joints[1].line().ok_or("it turns")?;
        let off_mm = 1e3 * elbow.distance_to(&Point3::new(0.31, 0.0, 0.0));
        let (nis, degrees) = update.nis.ok_or("it was seen")?;
        println!(
            "{movement:2}: the elbow's axis is {off_mm:6.3} mm off; innovation² {nis:8.2} of {degrees} degrees of freedom"
        );
    }
    Ok(())
}
