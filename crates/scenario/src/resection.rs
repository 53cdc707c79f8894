//! Where a body with known points stands before a camera, from one picture: the resection of its pose, or perspective-n-point.
//!
//! The pose T of the body in the camera's frame minimises the χ² of its pictured points, `Σ ‖y − h(T)‖² / σ²`, by damped Gauss–Newton
//! steps from the 24 ways of turning a body's axes into those of the camera, at the distance at which it is as large as it is seen. A flat body
//! that is small in the picture often has a second pose that explains it as well, tilted to the other side: it is told, and its rotation
//! then says nothing.

use std::cmp::Ordering;

use nalgebra::{Isometry3, Matrix3, Quaternion, Rotation3, Translation3, UnitQuaternion, Vector3};

use body_schema_engine::{
    model::{Block, Device, Layout, Links, Place, State, Target},
    sensing::{MeasurementModel, Observation, Sensor},
};

/// The starts from which a pose is searched: those that explain the picture best as they are.
const STARTS: usize = 6;
/// The most Gauss–Newton steps of a search.
const STEPS: usize = 20;
/// The fall of χ², as a share, below which a search has converged.
const CONVERGED: f64 = 1e-6;
/// The distance at which a body's turns are compared, metres: far, so that all of it is in front of the camera.
const FAR_M: f64 = 10.0;
/// Poses whose rotations differ by less are one, radians.
const SAME: f64 = 0.1;
/// The χ² by which a second pose must be worse so that the picture decides.
const DECIDED: f64 = 12.0;
/// The angle by which a body must be turned beyond what can be seen of it to be seen from behind, radians.
const BEHIND: f64 = 0.2;

/// The pose of a body in a camera's frame.
#[derive(Clone, Copy, Debug)]
pub struct Resected {
    pub pose: Isometry3<f64>,
    /// The standard deviation of its place per coordinate, metres, and of its rotation per axis, radians.
    pub sd: (f64, f64),
    /// Whether no other rotation explains the picture as well.
    pub is_decided: bool,
    /// Whether the body would be seen from where it is said not to be: its points run the other way round.
    pub is_from_behind: bool,
    /// What is left of its points, root mean square per coordinate: in σ, and as a share of how large it is in the picture.
    pub left: (f64, f64),
}

/// A camera and a body, each where it is not known.
pub struct Resection {
    state: State,
    layout: Layout,
    measurement_model: MeasurementModel,
    target: usize,
    still: Vec<f64>,
    intrinsics: [f64; 4],
}

impl Resection {
    /// `None` of a sensor that is no camera.
    pub fn new(state: &State, sensor: &Sensor) -> Option<Self> {
        let (camera, target) = sensor.subject().sight()?;
        let intrinsics = state.devices[camera].intrinsics?;
        let mut state = State { base: Isometry3::identity(), ..state.clone() };
        state.devices[camera] = Device { link: None, pose: Isometry3::identity(), ..state.devices[camera].clone() };
        state.targets[target] = Target { link: 0, place: Place::Pose(Isometry3::identity()) };
        let layout = Layout::new(&state, [Block::Target(target)]);
        let still = vec![0.0; state.joints.len()];
        Some(Self {
            layout,
            measurement_model: MeasurementModel::new(vec![sensor.clone()]),
            target,
            still,
            intrinsics,
            state,
        })
    }

    /// A picture in a mirror: v the other way round.
    pub fn mirrored(&self, reading: &[f64]) -> Vec<f64> {
        let middle = self.intrinsics[3];
        reading.iter().enumerate().map(|(k, x)| if k % 2 == 1 { 2.0 * middle - x } else { *x }).collect()
    }

    /// The pose that explains a picture best; `None` where fewer than four points are in it, or nothing explains it.
    pub fn pose(&self, reading: &[f64]) -> Option<Resected> {
        if reading.iter().filter(|x| !x.is_nan()).count() < 8 {
            return None;
        }
        let observation = Observation { readings: vec![Some(reading.to_vec())] };
        let mut starts: Vec<(f64, Isometry3<f64>)> =
            turns().filter_map(|turn| self.start(turn, reading)).map(|at| (self.chi2(&at, &observation), at)).collect();
        starts.sort_by(likelier);
        let mut found: Vec<(f64, Isometry3<f64>)> =
            starts.iter().take(STARTS).filter_map(|(_, start)| self.refined(*start, &observation)).collect();
        found.sort_by(likelier);
        let best = found.first()?.1;
        // A flat body's other pose: its normal on the other side of the line of sight.
        let sight = best.translation.vector.try_normalize(1e-9)?;
        for axis in [Vector3::x(), Vector3::y(), Vector3::z()] {
            let normal = best.rotation * axis;
            let turn = half_turn(sight * (2.0 * normal.dot(&sight)) - normal) * half_turn(sight);
            found.extend(self.refined(Isometry3::from_parts(best.translation, turn * best.rotation), &observation));
        }
        found.sort_by(likelier);
        let (least, pose) = *found.first()?;
        let other = found.iter().find(|(_, other)| other.rotation.angle_to(&pose.rotation) > SAME);
        let equations = self.equations(&pose, &observation)?;
        let covariance = (&equations.rows * equations.rows.transpose()).cholesky()?.inverse();
        let sd = |first: usize| (covariance.view((first, first), (3, 3)).trace() / 3.0).sqrt();
        let rms = (least / equations.residual.len() as f64).sqrt();
        let per_equation = (least / (equations.residual.len() as f64 - 6.0).max(1.0)).max(1.0);
        let channel = self.measurement_model.sensors()[0].channel();
        // In the middle of the picture it is whether it faces the camera that counts.
        let middle = half_turn((sight + Vector3::z()).normalize()) * pose;
        let clearance = channel.clearance(Links::new(&self.at(&middle)).at(&self.still));
        Some(Resected {
            pose,
            sd: (sd(0), sd(3)),
            is_decided: other.is_none_or(|(other, _)| other - least > DECIDED * per_equation),
            is_from_behind: clearance.is_some_and(|clearance| clearance < -BEHIND),
            left: (rms, rms * self.measurement_model.sensors()[0].sigma() / middle_and_size(reading).2),
        })
    }

    fn at(&self, pose: &Isometry3<f64>) -> State {
        let mut state = self.state.clone();
        state.targets[self.target].place = Place::Pose(*pose);
        state
    }

    fn equations(
        &self,
        pose: &Isometry3<f64>,
        observation: &Observation,
    ) -> Option<body_schema_engine::sensing::Equations> {
        let found = self.measurement_model.equations_of(&self.at(pose), &self.layout, &self.still, observation);
        (found.residual.len() >= 8).then_some(found)
    }

    fn chi2(&self, pose: &Isometry3<f64>, observation: &Observation) -> f64 {
        self.equations(pose, observation).map_or(f64::INFINITY, |found| found.residual.norm_squared())
    }

    /// The place at which a body that is turned so has the size and the middle of its picture.
    fn start(&self, turn: UnitQuaternion<f64>, reading: &[f64]) -> Option<Isometry3<f64>> {
        let place = |x: f64, y: f64, z: f64| Isometry3::from_parts(Translation3::new(x, y, z), turn);
        let far = place(0.0, 0.0, FAR_M);
        let mut pictured = vec![0.0; reading.len()];
        if !self.measurement_model.sensors()[0]
            .channel()
            .extended(Links::new(&self.at(&far)).at(&self.still), &mut pictured)
        {
            return None;
        }
        pictured.iter_mut().zip(reading).filter(|(_, seen)| seen.is_nan()).for_each(|(x, _)| *x = f64::NAN);
        let (seen, there) = (middle_and_size(reading), middle_and_size(&pictured));
        let [fx, fy, cx, cy] = self.intrinsics;
        let z = FAR_M * there.2 / seen.2;
        let start = place((seen.0 - cx) / fx * z, (seen.1 - cy) / fy * z, z);
        (z.is_finite() && z > 0.0).then_some(start)
    }

    /// Refines a pose: its χ², and itself.
    fn refined(&self, start: Isometry3<f64>, observation: &Observation) -> Option<(f64, Isometry3<f64>)> {
        let (mut pose, mut damping) = (start, 1e-3);
        let mut equations = self.equations(&pose, observation)?;
        for _ in 0..STEPS {
            let mut information = &equations.rows * equations.rows.transpose();
            let gradient = &equations.rows * &equations.residual;
            for k in 0..information.nrows() {
                information[(k, k)] *= 1.0 + damping;
            }
            let Some(step) = information.cholesky().map(|factor| factor.solve(&gradient)) else { break };
            let moved = self.at(&pose).retract(&self.layout, &step);
            let Place::Pose(there) = moved.targets[self.target].place else { break };
            let before = equations.residual.norm_squared();
            match self.equations(&there, observation).filter(|it| it.residual.norm_squared() < before) {
                Some(found) => {
                    let fell = before - found.residual.norm_squared();
                    (pose, equations, damping) = (there, found, damping * 0.2);
                    if fell < CONVERGED * before {
                        break;
                    }
                }
                None if damping > 1e6 => break,
                None => damping *= 10.0,
            }
        }
        Some((equations.residual.norm_squared(), pose))
    }
}

fn half_turn(about: Vector3<f64>) -> UnitQuaternion<f64> {
    UnitQuaternion::new_unchecked(Quaternion::new(0.0, about.x, about.y, about.z))
}

/// Orders poses by their χ².
fn likelier(a: &(f64, Isometry3<f64>), b: &(f64, Isometry3<f64>)) -> Ordering {
    a.0.total_cmp(&b.0)
}

/// The middle of points in a picture, and the root mean square of their distances from it, of those that are there.
fn middle_and_size(reading: &[f64]) -> (f64, f64, f64) {
    let points: Vec<&[f64]> = reading.chunks_exact(2).filter(|point| !point[0].is_nan()).collect();
    let count = points.len() as f64;
    let mean = |k: usize| points.iter().map(|point| point[k]).sum::<f64>() / count;
    let (u, v) = (mean(0), mean(1));
    let size = points.iter().map(|point| (point[0] - u).powi(2) + (point[1] - v).powi(2)).sum::<f64>() / count;
    (u, v, size.sqrt())
}

/// The 24 rotations that take a body's axes to those of the camera.
fn turns() -> impl Iterator<Item = UnitQuaternion<f64>> {
    let axes = [Vector3::x(), -Vector3::x(), Vector3::y(), -Vector3::y(), Vector3::z(), -Vector3::z()];
    axes.into_iter().flat_map(move |x| axes.into_iter().filter(move |y| x.dot(y) == 0.0).map(move |y| (x, y))).map(
        |(x, y)| {
            let matrix = Matrix3::from_columns(&[x, y, x.cross(&y)]);
            UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(matrix))
        },
    )
}
