//! Visibility: which channels read at a posture of a robot in a given state. Designs, bounds, gauges, worlds and judges all ask here,
//! so that no reading counts that cannot be seen.
//!
//! ```text
//! channel c reads at θ   ⟺   min(clearance_c(x, θ), clearance_head(p(x, θ))) ≥ 0
//! ```
//!
//! A choice, which knows the state by its belief alone, makes chances of the same clearances.

use std::ops::Range;

use nalgebra::DMatrix;

use super::{Head, MeasurementModel, Observation};
use crate::model::{Layout, Links, State};

/// How visibility is judged at a state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum InView<'a> {
    /// Not at all: the state is a guess, and cameras stand elsewhere. Everything may be seen.
    Unknown,
    /// The state is the truth, of which a head, if one watches, and the sensors see a part.
    By(Option<&'a Head>),
}

impl InView<'_> {
    /// Whether each channel of `measurement_model` reads at `positions`.
    pub fn visible(self, measurement_model: &MeasurementModel, state: &State, positions: &[f64]) -> Vec<bool> {
        match self {
            Self::Unknown => vec![true; measurement_model.sensors().len()],
            Self::By(head) => measurement_model.visible(head, state, positions),
        }
    }

    /// Whether some postures may be out of view.
    pub fn is_limited(self, measurement_model: &MeasurementModel) -> bool {
        matches!(self, Self::By(head) if measurement_model.is_watched(head))
    }
}

impl MeasurementModel {
    /// Writes for every channel how far its target is inside what it can see, and the marker inside what `head` can see,
    /// radians; infinite where everything is seen.
    pub fn clearances(&self, head: Option<&Head>, links: &Links<'_>, clearances: &mut [f64]) {
        let of_head = head.map_or(f64::INFINITY, |head| head.clearance(&links.marker()));
        for (sensor, clearance) in self.sensors().iter().zip(clearances) {
            *clearance = sensor.channel().clearance(links).unwrap_or(f64::INFINITY).min(of_head);
        }
    }

    /// Whether each channel reads at `positions` of a robot that is as `state` says; where `head` watches, none reads unless it sees
    /// the marker. The [occasion](super::Occasion) is not considered.
    pub fn visible(&self, head: Option<&Head>, state: &State, positions: &[f64]) -> Vec<bool> {
        if !self.is_watched(head) {
            return vec![true; self.sensors().len()];
        }
        self.visible_where(head, &Links::of(state, positions))
    }

    /// [`visible`](Self::visible) where the robot's links are.
    pub(super) fn visible_where(&self, head: Option<&Head>, links: &Links<'_>) -> Vec<bool> {
        let mut clearances = vec![0.0; self.sensors().len()];
        self.clearances(head, links, &mut clearances);
        clearances.into_iter().map(|clearance| clearance >= 0.0).collect()
    }

    /// The ranges of equations of points that a robot would not show where its links are, of those channels that read
    /// there all the same (see [`Channel::unseen`](super::Channel::unseen)). None of a channel that does not read: that is a matter of
    /// [`visible`](Self::visible).
    pub fn unseen(&self, links: &Links<'_>) -> Vec<Range<usize>> {
        let (mut unseen, mut start) = (Vec::new(), 0);
        for sensor in self.sensors() {
            let (channel, equations) = (sensor.channel(), sensor.equations());
            if sensor.subject().least_points.is_some()
                && channel.clearance(links).is_some_and(|clearance| clearance >= 0.0)
            {
                let absent = channel.unseen(links).into_iter();
                unseen.extend(absent.map(|absent| start + absent.start..start + absent.end));
            }
            start += equations;
        }
        unseen
    }

    /// Whether some postures may be out of view.
    pub fn is_watched(&self, head: Option<&Head>) -> bool {
        head.is_some() || self.has_view()
    }

    /// Hᵀ (m × d), whitened, of a movement as it is seen: zero where a channel does not read, or a point is not seen; `None` where none
    /// reads.
    pub fn visible_jacobian(
        &self,
        head: Option<&Head>,
        state: &State,
        layout: &Layout,
        positions: &[f64],
    ) -> Option<DMatrix<f64>> {
        let visible = self.visible(head, state, positions);
        visible.contains(&true).then(|| {
            let mut rows = self.jacobian(state, layout, positions);
            self.hide(&visible, rows.as_mut_slice());
            rows
        })
    }

    /// Hᵀ (m × d), whitened, of a movement as a robot that is as `state` says would be seen: zero where a channel would not read. Where
    /// none would, the rows of all channels: a belief in such a state is uncertain.
    pub fn believed_jacobian(&self, state: &State, layout: &Layout, positions: &[f64]) -> DMatrix<f64> {
        let seen = self.visible_jacobian(None, state, layout, positions);
        seen.unwrap_or_else(|| self.jacobian(state, layout, positions))
    }

    /// Zeroes the rows (d columns of m numbers) of all channels that are not `visible`.
    pub fn hide(&self, visible: &[bool], rows: &mut [f64]) {
        let m = rows.len() / self.equations().max(1);
        let mut start = 0;
        for (sensor, visible) in self.sensors().iter().zip(visible) {
            let end = start + sensor.equations() * m;
            if !visible {
                rows[start..end].fill(0.0);
            }
            start = end;
        }
    }

    /// The measurement model of the sensors that are `visible`.
    pub fn limited_to(&self, visible: &[bool]) -> Self {
        let seen = self.sensors().iter().zip(visible).filter(|(_, visible)| **visible);
        Self::new(seen.map(|(sensor, _)| sensor.clone()).collect())
    }

    /// Simulates the observation after a movement that holds a target in `socket`, or in none, where `head` may watch;
    /// see [`observe_in`](Self::observe_in).
    pub fn observe_watched(
        &self,
        head: Option<&Head>,
        socket: Option<usize>,
        state: &State,
        positions: &[f64],
        v: &[f64],
    ) -> Observation {
        let mut observation = self.observe_in(socket, state, positions, v);
        let visible = self.visible(head, state, positions);
        let hidden = observation.readings.iter_mut().zip(&visible).filter(|(_, visible)| !**visible);
        hidden.for_each(|(reading, _)| *reading = None);
        observation
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::{Point3, UnitVector3, Vector3};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::{
        model::{
            Block, Device, Frame,
            random::{random_arm, random_pose},
        },
        sensing::{Facing, Pixels, Position, Sensor},
    };

    /// Pictures, facings and a head, each by its own geometry: a tag is seen whole, in front, inside the picture and from where it faces.
    #[test]
    fn what_is_visible_is_what_geometry_says() {
        let mut rng = ChaCha8Rng::seed_from_u64(1001);
        let mut seen = [0; 2];
        for _ in 0..3000 {
            let mut state = random_arm(&mut rng, 3);
            let intrinsics = Some([400.0, 420.0, 300.0, 250.0]);
            state.devices = (0..2)
                .map(|_| Device { link: None, pose: random_pose(&mut rng), intrinsics, distortion: None })
                .collect();
            let facing = Facing { direction: UnitVector3::new_normalize(Vector3::new(0.1, 0.2, 1.0)), within: 1.2 };
            let points: Arc<[Point3<f64>]> = [Point3::new(0.05, 0.0, 0.0), Point3::new(0.0, -0.05, 0.02)].into();
            state.targets[0].place = crate::model::Place::Pose(random_pose(&mut rng));
            let view = |camera| Pixels {
                camera,
                target: 0,
                points: points.clone(),
                size_px: [640.0, 480.0],
                facing: Some(facing),
                partly_seen: None,
            };
            let tracker = Sensor::even(Position { target: 0 }, 0.01);
            let measurement_model =
                MeasurementModel::new(vec![Sensor::even(view(0), 1.0), tracker, Sensor::even(view(1), 1.0)]);
            let theta: Vec<f64> = (0..3).map(|_| rng.random_range(-2.0..2.0)).collect();
            let found = measurement_model.visible(None, &state, &theta);
            let body = state.frame_at(Frame::Target(0), &theta);
            let wanted = |camera: usize| {
                let eye = state.devices[camera].pose;
                let inside = points.iter().all(|point| {
                    let at = eye.inverse() * (body * point);
                    let (u, v) = (400.0 * at.x / at.z + 300.0, 420.0 * at.y / at.z + 250.0);
                    at.z > 0.0 && (0.0..=640.0).contains(&u) && (0.0..=480.0).contains(&v)
                });
                let towards = eye.translation.vector - body.translation.vector;
                inside && (body.rotation * facing.direction.into_inner()).angle(&towards) <= facing.within
            };
            assert_eq!(found, [wanted(0), true, wanted(1)]);
            seen[0] += usize::from(found[0]);
            // A head that sees the marker hides nothing, and one that does not hides everything.
            let look = UnitVector3::new_normalize(state.marker_at(&theta).coords - Vector3::new(0.0, 0.0, 0.1));
            let head = |look| Head {
                position: Point3::new(0.0, 0.0, 0.1),
                look,
                pan_limit: 0.1,
                tilt_limit: 0.1,
                lens_half_angle: 0.2,
                baseline: None,
            };
            assert_eq!(measurement_model.visible(Some(&head(look)), &state, &theta), found);
            let none = measurement_model.visible(Some(&head(-look)), &state, &theta);
            assert_eq!(none, [false; 3]);
            let noise = vec![0.0; measurement_model.equations()];
            assert!(measurement_model.observe_watched(Some(&head(-look)), None, &state, &theta, &noise).is_miss());
            let layout = Layout::new(&state, [Block::Base, Block::Target(0)]);
            assert_eq!(measurement_model.visible_jacobian(Some(&head(-look)), &state, &layout, &theta), None);
            let rows =
                measurement_model.visible_jacobian(None, &state, &layout, &theta).expect("a tracker sees everything");
            for (columns, is_seen) in [(0..4, found[0]), (4..7, true), (7..11, found[2])] {
                let length = rows.columns(columns.start, columns.len()).norm();
                assert_eq!(length > 0.0, is_seen);
            }
            let read = measurement_model.observe_watched(None, None, &state, &theta, &noise).readings;
            assert_eq!(read.iter().map(Option::is_some).collect::<Vec<_>>(), found);
            seen[1] += usize::from(found[2]);
        }
        assert!(seen.iter().all(|count| *count > 20), "{seen:?}");
    }
}
