//! What one learner's reports become.

use rerun::{
    Scalars, TextLog,
    external::re_log_types::{EntityPath, EntityPathPart},
};

use super::{
    EllipsoidSize, charts, head, metrics,
    model::{self, Uncertainty},
    movement::Movement,
    partition::{self, Slice},
    rows::Rows,
};
use crate::{
    experiment::{Description, LearnerReport},
    optimize::Plane,
};

/// The entities of one learner, and what they carry from step to step.
pub(super) struct LearnerEntities {
    pub(super) colour: [u8; 3],
    pub(super) root: EntityPath,
    pub(super) metrics: Vec<EntityPath>,
    uncertainty: Uncertainty,
    /// What slices show: chosen at the first partition and kept, so that the picture does not jump from step to step.
    plane: Option<Plane>,
    moved: bool,
    failed: bool,
}

impl LearnerEntities {
    /// Those of a learner, in its colour.
    pub(super) fn new(colour: [u8; 3], name: &str, joints: usize, ellipsoids: EllipsoidSize) -> Self {
        let root = EntityPath::new(vec![EntityPathPart::new(name)]);
        let metrics = root.join(&EntityPath::from("metrics"));
        Self {
            colour,
            metrics: metrics::NAMES.iter().map(|name| metrics.join(&EntityPath::from(*name))).collect(),
            root,
            uncertainty: Uncertainty::new(joints, ellipsoids),
            plane: None,
            moved: false,
            failed: false,
        }
    }

    /// What no view of the arrangement shows.
    pub(super) fn hidden(&self) -> impl Iterator<Item = EntityPath> {
        let series = self.metrics.iter().zip(metrics::NAMES).filter(|(_, name)| !charts::shows(name));
        series.map(|(series, _)| series.clone()).chain([self.entity("direct/leaves")])
    }

    fn entity(&self, path: &str) -> EntityPath {
        self.root.join(&EntityPath::from(path))
    }

    /// Logs what a report says of the learner; the arrows are `arrow_m` long.
    pub(super) fn log(
        &mut self,
        rows: &mut Rows,
        step: u64,
        report: &LearnerReport,
        description: &Description,
        arrow_m: f64,
    ) {
        let (colour, joints) = (self.colour, description.joints.as_slice());
        let model = &report.estimate;
        rows.at(step, &self.entity("links"), &[&model::links(&model.skeleton_m(), colour, 2.0)]);
        rows.at(step, &self.entity("axes"), &[&model::axes(model, joints, arrow_m, colour)]);
        if let Some(points) = self.uncertainty.of_points(model, joints, colour) {
            rows.at(step, &self.entity("point_ellipsoids"), &points.parts());
        }
        if let Some(directions) = self.uncertainty.of_directions(model, joints, arrow_m, colour) {
            rows.at(step, &self.entity("direction_uncertainty"), &directions.parts());
        }
        self.log_movement(rows, step, report, description);
        for (series, value) in self.metrics.iter().zip(metrics::values(report)) {
            if let Some(value) = value {
                rows.at(step, series, &[&Scalars::new([value])]);
            }
        }
        if let (Some(failure), false) = (&report.failure, self.failed) {
            self.failed = true;
            rows.at(step, &self.entity("failure"), &[&TextLog::new(failure.as_str()).with_level("ERROR")]);
        }
    }

    fn log_movement(&mut self, rows: &mut Rows, step: u64, report: &LearnerReport, description: &Description) {
        let (has_truth, joints) = (description.truth.is_some(), description.joints.as_slice());
        let report = report.movement.as_ref();
        if report.is_none() && !self.moved {
            return;
        }
        // Once more after the last movement of a learner that has stopped, to clear it.
        self.moved = report.is_some();
        let movement = Movement::of(report, has_truth, self.colour);
        rows.at(step, &self.entity("movement/links"), &[&movement.links]);
        if let Some(truth) = &movement.truth {
            rows.at(step, &self.entity("movement/truth"), &[truth]);
        }
        rows.at(step, &self.entity("marker/predicted"), &[&movement.predicted]);
        rows.at(step, &self.entity("marker/measured"), &[&movement.measured]);
        if let Some(head) = &description.head {
            let gaze = report.and_then(|report| report.gaze.as_ref());
            rows.at(step, &self.entity("head/gaze"), &[&head::gaze(head, gaze, self.colour)]);
            rows.at(step, &self.entity("marker/missed"), &[&movement.missed]);
        }
        let Some(partition) = report.and_then(|report| report.partition.as_ref()) else { return };
        if self.plane.is_none()
            && let Some(plane) = Plane::most_divided(partition.leaves.iter().map(|leaf| leaf.levels.as_slice()))
        {
            self.plane = Some(plane);
            let [square, labels] = partition::frame(plane, joints);
            rows.always(&self.entity("direct/axes"), &[square.as_ref(), labels.as_ref()]);
            rows.always(&self.entity("direct/criterion"), &[&partition::fill_transform()]);
        }
        if let Some(slice) = self.plane.and_then(|plane| Slice::of(partition, plane)) {
            rows.at(step, &self.entity("direct/criterion"), &[&slice.fill]);
            rows.at(step, &self.entity("direct/boxes"), &[&slice.outlines]);
            rows.at(step, &self.entity("direct/centres"), &[&slice.centres]);
            rows.at(step, &self.entity("direct/chosen"), &[&slice.chosen]);
        }
        rows.at(step, &self.entity("direct/leaves"), &[&partition::data(partition)]);
    }
}
