//! A channel of one's own: a gauge that reads how high a target is above the table, and nothing else.
//!
//! ```sh
//! cargo run --release --example own_channel
//! ```

use body_schema::{
    estimation::{Belief, Estimator, Rls},
    kinematics::{Joint, Line},
    model::{KinematicData, Layout, Links, State},
    sensing::{Channel, MeasurementModel, NoiseModel, Observation, Part, Sensor, Subject, check_channel},
};
use nalgebra::{DMatrix, Point3, Vector3};

/// `y = z(θ) + v`: one equation.
#[derive(Clone, Copy, Debug)]
struct Height {
    target: usize,
}

impl Channel for Height {
    fn subject(&self) -> Subject {
        Subject { target: Some(self.target), parts: vec![Part::Lengths(1)], ..Subject::default() }
    }

    fn predict(&self, links: &Links<'_>, reading: &mut [f64]) -> bool {
        reading[0] = links.target(self.target).z;
        true
    }

    fn rows(&self, data: &KinematicData<'_>, reading: &mut [f64], rows: &mut [f64]) -> bool {
        reading[0] = data.target(self.target).z;
        // Of every parameter the velocity of the target, of which the gauge sees what points upwards.
        data.point_columns(self.target, |coordinate, velocity| rows[coordinate] = velocity.z);
        true
    }
}

/// An axis along y at this height, metres.
fn axis(x: f64, z: f64) -> Joint {
    Joint::Revolute(Line { point: Point3::new(x, 0.0, z), direction: Vector3::y_axis() })
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let marker = Point3::new(0.7, 0.0, 0.4);
    let truth = State::arm(vec![axis(0.0, 0.4), axis(0.4, 0.41)], marker);
    let guess = State::arm(vec![axis(0.0, 0.4), axis(0.38, 0.4)], marker);
    let layout = Layout::of_arm(&guess, &[false, true], false);
    let gauge = Height { target: 0 };

    // The law of channels, in a line: rows are the derivative of the prediction, and so on.
    check_channel(&gauge, &guess, &layout, &[0.3, -0.5])?;

    let prior = DMatrix::from_diagonal_element(layout.dimension(), layout.dimension(), 0.01);
    // Its noise goes around it: v ~ N(0, σ²), with σ in metres.
    let measurement_model = MeasurementModel::new(vec![Sensor::new(gauge, NoiseModel::sigma(5e-4))?]);
    let mut rls = Rls::new(Belief::new(guess, layout.into(), measurement_model.into()), prior, None);
    for movement in 0..40 {
        let positions = [0.8 * (0.4 * f64::from(movement)).sin(), 1.2 * (0.3 * f64::from(movement)).cos()];
        rls.update(&positions, &Observation::of([truth.marker_at(&positions).z]))?;
    }
    let elbow = rls.belief().state.joints[1].line().ok_or("it turns")?;
    let off_mm = 1e3 * elbow.distance_to(&Point3::new(0.4, 0.0, 0.41));
    println!("by heights alone the elbow's axis is known to {off_mm:.2} mm; the guess was 22 mm off");
    Ok(())
}
