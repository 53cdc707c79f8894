//! Targets that would have been seen from behind: their points run the other way round.

use nalgebra::Point3;

use super::{Case, Fit};
use body_schema_engine::model::Frame;

impl Case<'_> {
    /// A sentence on every target that faces away from its camera in most of the rows in which it was seen, as the fit has both.
    pub(super) fn seen_from_behind(&self, fit: &Fit) -> Vec<String> {
        let (state, targets) = (fit.state(), &self.scenario.robot.equipment.targets);
        let told = self.measurement_model().sensors().iter().enumerate().filter_map(|(channel, sensor)| {
            let (target, camera) = sensor.subject().target.zip(sensor.subject().camera)?;
            let facing = targets.get(target)?.facing?;
            let rows = fit.rows.iter().map(|row| &self.rows[*row]);
            let seen = rows.filter(|row| row.observation.readings.get(channel).is_some_and(Option::is_some));
            let is_behind = seen.map(|row| {
                let [target, camera] =
                    [Frame::Target(target), Frame::Device(camera)].map(|it| state.frame_at(it, &row.positions));
                let at = target.inverse() * Point3::from(camera.translation.vector);
                facing.direction.dot(&at.coords) < 0.0
            });
            let is_behind: Vec<bool> = is_behind.collect();
            let behind = is_behind.iter().filter(|is_behind| **is_behind).count();
            (2 * behind > is_behind.len()).then(|| {
                format!(
                    "`{}` faces away from the camera in {behind} of {} rows in which it was seen: its points run the other way round, as in a \
                     mirror; tell them in the order of `points_m` as one looks at its front, or turn `facing` round",
                    targets[target].name,
                    is_behind.len()
                )
            })
        });
        told.collect()
    }
}
