//! The known points of a target in the picture of a calibrated camera, two equations each.
//!
//! The camera looks along its own z, x to the right of the picture and y down. A point at (x, y, z) in its frame is at
//!
//! ```text
//! u = fx x′ + cx,   v = fy y′ + cy        (pixels)
//! ```
//!
//! with (x′, y′) = (x/z, y/z) for a pinhole, and otherwise by the lens's [`Distortion`](crate::model::Distortion).
//!
//! Camera and target each stand beside the robot or are carried by a link. The twists of both are known, so hand–eye and a fixed camera
//! are one channel. Poses, intrinsics and coefficients of distortion are blocks of the model.
//!
//! *Out of view.* A target is seen whole or not at all: in front of the camera, inside its picture, and facing it. A target that is
//! [partly seen](PartlySeen) is seen point by point, and read where enough of them are; the numbers of an absent point are NaN.
//!
//! An estimate that has a point behind the camera which was seen must find its way to the front, so for searches and filters the depth goes
//! on below `z₀ = c √(x² + y² + κ² min(z, 0)²)`, c = [`WIDE`], κ = 0.01, as `z̄ = z₀²/(2 z₀ − z)`: positive everywhere, with a continuous slope,
//! and the same at every scale, so that no length is known by it. It is no prediction: there is none of a point behind the camera or beside
//! it, by more than 76 degrees off its axis, nor of one where the distortion no longer holds.

use std::{ops::Range, sync::Arc};

use nalgebra::{Isometry3, Point3, Vector3};

pub use super::lens::WIDE;
use super::{
    Channel, Equipment, Facing, KeyError, Keys, PartlySeen, Part, Sensor, Subject,
    lens::{Lens, Seen},
};
use crate::model::{Block, Frame, KinematicData, Links, State};

/// A camera's view of a target.
#[derive(Clone, Debug, PartialEq)]
pub struct Pixels {
    /// The camera, by its index among the devices.
    pub camera: usize,
    /// The index of the target.
    pub target: usize,
    /// The known points in the target's frame, metres.
    pub points: Arc<[Point3<f64>]>,
    /// Width and height of the picture, pixels.
    pub size_px: [f64; 2],
    /// The directions from which the target can be seen.
    pub facing: Option<Facing>,
    /// How it is seen point by point; `None` where it is seen whole or not at all.
    pub partly_seen: Option<PartlySeen>,
}

impl Pixels {
    pub(super) fn from_keys(keys: &Keys, equipment: &Equipment) -> Result<Sensor, KeyError> {
        keys.only(&["camera", "target", "sigma_px"])?;
        let ((camera, lens), (target, body)) = (keys.camera(equipment)?, keys.target(equipment)?);
        let (points, size_px, facing) = (body.points.clone().into(), lens.size_px, body.facing);
        let partly_seen = body.partly_seen.clone();
        Ok(Sensor::even(Self { camera, target, points, size_px, facing, partly_seen }, keys.sigma_px()?))
    }

    fn lens<'a>(&self, state: &'a State) -> Lens<'a> {
        Lens::of(&state.devices[self.camera])
    }

    /// Writes the picture, continued behind the camera, and passes to `each` which point has a prediction.
    fn project(&self, links: &Links<'_>, reading: &mut [f64], mut each: impl FnMut(&mut [f64], bool)) {
        let (lens, place) = (self.lens(links.state()), self.place(links));
        for (point, picture) in self.points.iter().zip(reading.chunks_exact_mut(2)) {
            let at = (place * point).coords;
            picture.copy_from_slice(&lens.see(&at).picture);
            each(picture, lens.predicts(&at));
        }
    }

    /// The target in the camera's frame.
    fn place(&self, links: &Links<'_>) -> Isometry3<f64> {
        links.relative(Frame::Target(self.target), Frame::Device(self.camera))
    }

    /// How far each point is inside what can be seen of it, radians: inside the picture, and within its own facing.
    fn clearances(&self, state: &State, place: Isometry3<f64>) -> impl Iterator<Item = f64> {
        let picture = self.lens(state).picture(self.size_px);
        let facings: &[Facing] = self.partly_seen.as_ref().map_or(&[], |partly| &partly.facing);
        self.points.iter().enumerate().map(move |(index, point)| {
            let at = (place * point).coords;
            let inside = picture.clearance(&at);
            facings.get(index).map_or(inside, |facing| inside.min(facing.clearance(&place, &-at)))
        })
    }

    #[cfg(test)]
    pub(super) fn example(rng: &mut rand_chacha::ChaCha8Rng, state: &State) -> Sensor {
        use rand::RngExt;
        let lenses = (0..state.devices.len()).filter(|device| state.devices[*device].intrinsics.is_some());
        let lenses: Vec<usize> = lenses.collect();
        let camera = lenses[rng.random_range(0..lenses.len())];
        let target = rng.random_range(0..state.targets.len());
        let points = (0..rng.random_range(1..=4)).map(|_| Point3::from(Vector3::from_fn(|_, _| rng.random_range(-0.2..0.2))));
        let facing = Facing { direction: Vector3::z_axis(), within: 1.4 };
        let (points, sigma_px) = (points.collect(), rng.random_range(0.3..3.0));
        let (size_px, facing) = ([640.0, 480.0], Some(facing));
        Sensor::even(Self { camera, target, points, size_px, facing, partly_seen: None }, sigma_px)
    }
}

impl Channel for Pixels {
    fn subject(&self) -> Subject {
        Subject {
            target: Some(self.target),
            camera: Some(self.camera),
            parts: vec![Part::Picture(self.points.len())],
            has_view: true,
            least_points: self.partly_seen.as_ref().map(|partly| partly.least_points.max(1)),
            ..Subject::default()
        }
    }

    fn predict(&self, links: &Links<'_>, reading: &mut [f64]) -> bool {
        let is_partly_seen = self.partly_seen.is_some();
        let (mut all, mut any) = (true, false);
        self.project(links, reading, |picture, is_predicted| {
            (all, any) = (all && is_predicted, any || is_predicted);
            if is_partly_seen && !is_predicted {
                picture.fill(f64::NAN);
            }
        });
        if is_partly_seen { any } else { all }
    }

    fn extended(&self, links: &Links<'_>, reading: &mut [f64]) -> bool {
        self.project(links, reading, |_, _| ());
        true
    }

    fn rows(&self, data: &KinematicData<'_>, reading: &mut [f64], rows: &mut [f64]) -> bool {
        let (camera, target) = (Frame::Device(self.camera), Frame::Target(self.target));
        let (eye, body) = (data.pose(camera), data.pose(target));
        let (of_eye, of_body) = (data.frame_twists(camera), data.frame_twists(target));
        let lens = self.lens(data.state());
        let [fx, fy, ..] = lens.intrinsics;
        let into_eye = eye.rotation.inverse().to_rotation_matrix();
        let own = data.layout().block(Block::Intrinsics(self.camera));
        let coefficients: Vec<(usize, usize)> = lens.distortion.map_or_else(Vec::new, |distortion| {
            let place = |index| Some((index, data.layout().block(Block::Distortion(self.camera, index))?.start));
            (0..distortion.coefficients().len()).filter_map(place).collect()
        });
        let m = of_eye.ncols();
        // Nothing may be learned: then there are no rows to cut into pieces.
        for (k, (point, picture)) in self.points.iter().zip(reading.chunks_exact_mut(2)).enumerate() {
            let rows = &mut rows[2 * m * k..2 * m * (k + 1)];
            let x = body * point;
            let from_eye = x.coords - eye.translation.vector;
            let Seen { at, slope, place, by_point, picture: found } = lens.see(&(into_eye * from_eye));
            picture.copy_from_slice(&found);
            let lever = x.coords - body.translation.vector;
            let (across, down) = rows.split_at_mut(m);
            for k in 0..m {
                let (eye, body) = (of_eye.column(k), of_body.column(k));
                let twist = |column: &nalgebra::MatrixView6x1<'_, f64>, lever: &Vector3<f64>| {
                    column.fixed_rows::<3>(0) + column.fixed_rows::<3>(3).cross(lever)
                };
                let moved = into_eye * (twist(&body.as_view(), &lever) - twist(&eye.as_view(), &from_eye));
                if let Some(by_point) = &by_point {
                    let shift = by_point * moved;
                    (across[k], down[k]) = (fx * shift.x, fy * shift.y);
                    continue;
                }
                let deeper = slope.map_or(moved.z, |slope| slope.dot(&moved));
                across[k] = fx * (moved.x - at.x / at.z * deeper) / at.z;
                down[k] = fy * (moved.y - at.y / at.z * deeper) / at.z;
            }
            if let Some(own) = &own {
                across[own.start] += place[0];
                down[own.start + 1] += place[1];
                across[own.start + 2] += 1.0;
                down[own.start + 3] += 1.0;
            }
            for (index, start) in &coefficients {
                let shift = lens.distortion.map_or_else(Default::default, |of| of.by_coefficient(*index, &at));
                across[*start] += fx * shift.x;
                down[*start] += fy * shift.y;
            }
        }
        true
    }

    /// The least clearance of a point in the picture, and that by which the target still faces the camera; of a target that is
    /// partly seen, the clearance of the point without which there would be too few.
    fn clearance(&self, links: &Links<'_>) -> Option<f64> {
        let place = self.place(links);
        let points = self.clearances(links.state(), place);
        let inside = match &self.partly_seen {
            None => points.fold(f64::INFINITY, f64::min),
            Some(PartlySeen { least_points, .. }) => {
                let mut points: Vec<f64> = points.collect();
                points.sort_unstable_by(|a, b| b.total_cmp(a));
                points.get((*least_points).max(1) - 1).copied().unwrap_or(f64::NEG_INFINITY)
            }
        };
        let towards_camera = -place.translation.vector;
        Some(self.facing.map_or(inside, |facing| inside.min(facing.clearance(&place, &towards_camera))))
    }

    fn unseen(&self, links: &Links<'_>) -> Vec<Range<usize>> {
        if self.partly_seen.is_none() {
            return Vec::new();
        }
        let clearances = self.clearances(links.state(), self.place(links)).enumerate();
        clearances.filter(|(_, clearance)| *clearance < 0.0).map(|(point, _)| 2 * point..2 * point + 2).collect()
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Translation3, UnitQuaternion};

    use super::*;
    use crate::model::{Device, Place, Target, random::random_arm};

    /// A camera at the origin that looks along z, and a tag of two points 0.1 m apart that is carried by nothing.
    fn tag(at: Isometry3<f64>) -> (State, Pixels) {
        use rand::SeedableRng;
        let mut state = random_arm(&mut rand_chacha::ChaCha8Rng::seed_from_u64(1), 1);
        state.targets.push(Target { link: 0, place: Place::Pose(at) });
        let intrinsics = Some([500.0, 500.0, 320.0, 240.0]);
        state.devices.push(Device { link: None, pose: Isometry3::identity(), intrinsics, distortion: None });
        let points = [Point3::new(0.05, 0.0, 0.0), Point3::new(-0.05, 0.0, 0.0)].into();
        let facing = Some(Facing { direction: -Vector3::z_axis(), within: 80_f64.to_radians() });
        (state, Pixels { camera: 0, target: 1, points, size_px: [640.0, 480.0], facing, partly_seen: None })
    }

    #[test]
    fn a_picture_worked_by_hand() {
        let (state, view) = tag(Translation3::new(0.1, -0.2, 0.5).into());
        let mut picture = [0.0; 4];
        assert!(view.predict(Links::new(&state).at(&[0.0]), &mut picture));
        // 500 · 0.15/0.5 + 320, 500 · −0.2/0.5 + 240.
        let expected = [470.0, 40.0, 370.0, 40.0];
        assert!(picture.iter().zip(expected).all(|(found, wanted)| (found - wanted).abs() < 1e-9), "{picture:?}");
        assert!(view.clearance(Links::new(&state).at(&[0.0])).expect("a view") > 0.0);
    }

    #[test]
    fn a_tag_is_seen_whole_in_front_inside_and_facing_or_not_at_all() {
        let clearance = |pose: Isometry3<f64>| {
            let (state, view) = tag(pose);
            view.clearance(Links::new(&state).at(&[0.0])).expect("a view")
        };
        let at = |x, y, z| Translation3::new(x, y, z).into();
        // The half picture is 320/500 of the depth wide: at 0.5 m one of two points leaves at 0.27 m.
        assert!(clearance(at(0.26, 0.0, 0.5)) > 0.0 && clearance(at(0.28, 0.0, 0.5)) < 0.0);
        assert!(clearance(at(0.0, 0.23, 0.5)) > 0.0 && clearance(at(0.0, -0.25, 0.5)) < 0.0);
        assert!(clearance(at(0.0, 0.0, -0.5)) < 0.0, "behind the camera");
        let turned = |degrees: f64| {
            let turn = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), degrees.to_radians());
            clearance(Isometry3::from_parts(Translation3::new(0.0, 0.0, 0.5), turn))
        };
        assert!(turned(79.0) > 0.0 && turned(81.0) < 0.0 && turned(180.0) < 0.0);
    }

    /// There is no picture of what is behind a camera, wholly or in part, though a search is led to the front.
    #[test]
    fn behind_the_camera_there_is_no_prediction() {
        for (turn, z, is_predicted) in [(0.0, 0.5, true), (0.0, -0.5, false), (90_f64, 0.04, false), (90.0, 0.051, true)] {
            let turn = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), turn.to_radians());
            let (state, view) = tag(Isometry3::from_parts(Translation3::new(0.0, 0.0, z), turn));
            let mut picture = [0.0; 4];
            assert_eq!(view.predict(Links::new(&state).at(&[0.0]), &mut picture), is_predicted, "{z}");
            assert!(view.extended(Links::new(&state).at(&[0.0]), &mut picture) && picture.iter().all(|x| x.is_finite()));
            let measurement_model = crate::sensing::MeasurementModel::new(vec![Sensor::even(view, 1.0)]);
            let observation = crate::sensing::Observation::of([300.0, 200.0, 310.0, 220.0]);
            assert_eq!(measurement_model.residual(&state, &[0.0], &observation).len(), 4, "an estimate that is wrong is told so");
        }
    }

    /// Behind the camera the projection goes on without a break, and its slope leads to the front.
    #[test]
    fn the_projection_is_continued_behind_the_camera() {
        let lens = Lens { intrinsics: [500.0, 500.0, 320.0, 240.0], distortion: None };
        for x in [1e-3, 0.1, 2.0] {
            let across = |z: f64| lens.see(&Vector3::new(x, 0.0, z)).picture[0];
            let slope = |z: f64| (across(z + 1e-7 * x) - across(z - 1e-7 * x)) / (2e-7 * x);
            for border in [WIDE * x, 0.0] {
                assert!((across(border + 1e-9 * x) - across(border - 1e-9 * x)).abs() < 1e-3);
                assert!((slope(border + 1e-6 * x) / slope(border - 1e-6 * x) - 1.0).abs() < 1e-3);
            }
            assert!((-40..40).all(|z| slope(0.5 * x * f64::from(z)) < 0.0));
        }
        assert!(lens.see(&Vector3::zeros()).picture.iter().all(|x| x.is_finite()));
    }

    /// Of a picture that is wider than what a pinhole has a picture of, no more is seen than that.
    #[test]
    fn a_wide_picture_ends_where_predictions_do() {
        let lens = |focal: f64| Lens { intrinsics: [focal, focal, 320.0, 240.0], distortion: None };
        for (focal, most) in [(500.0, 32.6), (60.0, 75.96)] {
            for angle in [10.0_f64, 32.0, 33.0, 60.0, 75.0, 77.0, 79.0, 85.0, 120.0, 179.0] {
                let (sine, cosine) = angle.to_radians().sin_cos();
                let at = Vector3::new(sine, 0.0, cosine) * 0.01;
                let is_inside = lens(focal).picture([640.0, 480.0]).clearance(&at) >= 0.0;
                assert_eq!(is_inside, angle < most, "{focal} {angle}");
                assert!(!is_inside || lens(focal).predicts(&at), "{focal} {angle}");
            }
        }
    }

    /// However small everything is, what is in front is where a pinhole has it, and what is beyond is the same in proportion.
    #[test]
    fn no_length_is_known_by_a_picture() {
        let lens = Lens { intrinsics: [500.0, 500.0, 320.0, 240.0], distortion: None };
        for [x, y, z] in [[0.3, -0.2, 0.4], [0.3, -0.2, 0.1], [0.3, -0.2, 0.01], [0.3, -0.2, -0.4], [0.01, 0.0, -0.9]] {
            let at = Vector3::new(x, y, z);
            let [u, v] = lens.see(&at).picture;
            for scale in [1e-3, 0.1, 30.0] {
                let scaled = lens.see(&(at * scale)).picture;
                assert!((scaled[0] / u - 1.0).abs() < 1e-9 && (scaled[1] / v - 1.0).abs() < 1e-9, "{at} {scale}");
            }
            if z > 0.05 {
                assert!((u - 500.0 * x / z - 320.0).abs() < 1e-9 && lens.predicts(&at), "{at}");
            }
        }
    }
}
