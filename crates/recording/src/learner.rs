//! The entities of one learner, logged from its reports.

use std::{cell::RefCell, collections::HashMap};

use nalgebra::{Isometry3, Point3, Translation3};

use super::{
    EllipsoidSize, TRUTH_COLOR,
    arm::{self, Arm, Drawing},
    broken, charts,
    colours::{label_in_file, label_on_dark, label_on_light, labelled},
    enlarged::enlarged,
    eye::Eye,
    head, metrics, model,
    movement::{ERROR, MEASURED, Movement, NOT_SEEN, PREDICTED, SEEN, error_look, marker_look},
    obstacles::Obstacles,
    partition::{self, Slice},
    posture::{ArmLook, Posture, bare},
    readings::Readings,
    rerun::{EntityPath, EntityPathPart, Points3D, TextLog, Transform3D},
    rows::Rows,
    scenery::{DESCRIBED, Scenery, TRUE_ARM},
    sight,
    sockets::{LEARNED, Sockets},
    solid::{drum, single, solid, transform},
    stage::Stage,
    uncertainty::{Cloud, Uncertainty, drawn},
    values::Cell,
};
use body_schema_engine::{model::State, optimize::Plane};
use body_schema_wire::{ChannelReading, Description, LearnerReport, ModelReport};

/// The colour of a posture that is tried out: amber.
const GHOST: [u8; 4] = [0xE6, 0xA1, 0x22, 110];
/// How much thicker the estimated arm is drawn than the true one, which is visible inside it, and its opacity.
const ESTIMATE: (f64, u8) = (1.22, 150);
/// Opacity of a learner's own ellipsoids, for an arm of six joints: those of longer arms lie more densely.
const CLOUD: f64 = 48.0;
/// Opacity of the ellipsoids that its data allow.
const ALLOWED: u8 = 150;

/// The entities with labels, in colours for light ground, for dark ground, and for files.
const NAMES: [&str; 3] = ["name", "on_dark/name", "in_files/name"];
pub(super) const ERRORS: [&str; 3] = ["marker/error", "on_dark/error", "in_files/error"];
pub(super) const MISSED: [&str; 3] = ["marker/missed", "on_dark/missed", "in_files/missed"];

const OBSTACLES: [&str; 3] = ["body/obstacles/names", "body/obstacles/on_dark", "body/obstacles/in_files"];
const SOCKETS: [&str; 3] = ["sockets/names", "sockets/on_dark", "sockets/in_files"];
const BROKEN: [&str; 3] = ["arm/broken/name", "arm/broken/on_dark", "arm/broken/in_files"];
const GHOSTS: [&str; 3] = ["arm/ghost/name", "arm/ghost/on_dark", "arm/ghost/in_files"];

/// The colours of these labels, for what has a colour.
fn labels(colour: [u8; 3]) -> [[u8; 3]; 3] {
    [label_on_light(colour), label_on_dark(colour), label_in_file(colour)]
}

/// What a step left visible.
pub(super) struct Shown {
    pub(super) step: u64,
    pub(super) configuration: Vec<f64>,
    /// `None` where the estimate is not finite.
    pub(super) estimate: Option<State>,
    /// The robot as described, if it is drawn.
    pub(super) described: Option<State>,
    /// The frames of the estimate's links at θ = 0.
    pub(super) frames: Vec<Isometry3<f64>>,
    pub(super) points: Option<Vec<Cloud>>,
    pub(super) allowed: Option<Vec<Cloud>>,
    /// Whether a reading is marked as an outlier.
    pub(super) has_outlier: bool,
}

/// The entities of one learner, with what they carry from step to step.
pub(super) struct LearnerEntities {
    pub(super) colour: [u8; 3],
    pub(super) root: EntityPath,
    pub(super) metrics: Vec<EntityPath>,
    /// The paths below the root that were used so far: making a path takes longer than logging a row.
    paths: RefCell<HashMap<&'static str, EntityPath>>,
    uncertainty: Uncertainty,
    readings: Readings,
    /// The pictures of cameras that links carry; known from the first report on.
    eyes: Vec<Eye>,
    /// How many times as large differences from the description are drawn, if they are.
    enlarged: Option<f64>,
    /// The robot as described, which is the first estimate; only where differences are enlarged.
    described: Option<ModelReport>,
    /// The learner's place in the row.
    index: usize,
    /// The first estimate of the robot's base, if the base is learned: bodies are drawn there.
    base: Option<Isometry3<f64>>,
    /// The motion of the base since then.
    moved: Isometry3<f64>,
    /// What slices show: chosen at the first partition and kept, so that the picture does not jump from step to step.
    plane: Option<Plane>,
    /// What the last step left visible.
    pub(super) shown: Option<Shown>,
    /// Whether a posture that was tried out is drawn.
    has_ghost: bool,
    /// The label of its name.
    label: String,
    stopped: bool,
    failed: bool,
}

impl LearnerEntities {
    /// The entities of a learner, in its colour.
    pub(super) fn new(
        (index, colour, name): (usize, [u8; 3], &str),
        description: &Description,
        (ellipsoids, enlarged): (EllipsoidSize, Option<f64>),
    ) -> Self {
        let root = EntityPath::new(vec![EntityPathPart::new(name)]);
        let metrics = root.join(&EntityPath::from("metrics"));
        Self {
            colour,
            metrics: metrics::NAMES.iter().map(|name| metrics.join(&EntityPath::from(*name))).collect(),
            readings: Readings::new(&root, description),
            root,
            paths: RefCell::default(),
            uncertainty: Uncertainty::new(description.joints.len(), ellipsoids).magnified(enlarged.unwrap_or(1.0)),
            eyes: Vec::new(),
            enlarged,
            described: None,
            index,
            base: None,
            moved: Isometry3::identity(),
            plane: None,
            shown: None,
            has_ghost: false,
            label: String::new(),
            stopped: false,
            failed: false,
        }
    }

    /// The entities that no view of the arrangement shows, and the series behind the tabs.
    pub(super) fn hidden(&self) -> impl Iterator<Item = EntityPath> {
        let series = self.metrics.iter().zip(metrics::NAMES).filter(|(_, name)| !charts::shows(name));
        let others = [
            "direct/leaves",
            "zero/links",
            "zero/axes",
            "zero/directions",
            NAMES[2],
            ERRORS[2],
            MISSED[2],
            SOCKETS[2],
            BROKEN[2],
        ];
        let readings = self.readings.series().cloned();
        series.map(|(series, _)| series.clone()).chain(others.map(|path| self.entity(path))).chain(readings)
    }

    pub(super) fn entity(&self, path: &'static str) -> EntityPath {
        let mut paths = self.paths.borrow_mut();
        paths.entry(path).or_insert_with(|| self.root.join(&EntityPath::from(path))).clone()
    }

    pub(super) fn arm_look(&self) -> ArmLook {
        let ([red, green, blue], (girth, alpha)) = (self.colour, ESTIMATE);
        ArmLook { links: [red, green, blue, alpha], pins: [red, green, blue, 255], girth }
    }

    /// Logs what does not change: the learner's place in the row, and its body. With a learned base, `base`, the place is
    /// that of the first step. `cameras` are those that links carry.
    pub(super) fn begin(
        &mut self,
        rows: &mut Rows,
        stage: &Stage,
        description: &Description,
        (base, cameras): (Option<Isometry3<f64>>, &[usize]),
    ) {
        self.base = base;
        self.eyes = cameras.iter().filter_map(|camera| Eye::of(&self.root, description, *camera)).collect();
        self.eyes.iter().for_each(|eye| eye.begin(rows));
        if base.is_none() {
            let place = Transform3D::from_translation(single(stage.place(self.index).into()));
            rows.always(&self.root, &[&place]);
        }
        rows.always(&self.entity("body"), &[&solid(&stage.figure.fixed)]);
        if let Some(base) = &stage.figure.base {
            rows.always(&self.entity("body/base"), &[&drum(base)]);
        }
        if !stage.figure.trunk.is_empty() {
            rows.always(&self.entity("body/trunk"), &[&solid(&stage.figure.trunk)]);
        }
        if !stage.figure.head.is_empty() {
            rows.always(&self.entity("body/head"), &[&solid(&stage.figure.head)]);
        }
        for (path, colour) in NAMES.into_iter().zip(labels(self.colour)) {
            let name = labelled([single(stage.figure.name.coords.into())], colour);
            rows.always(&self.entity(path), &[&name]);
        }
        let (sockets, reach_m) = (Sockets::known(&description.sockets), stage.figure.reach_m);
        if !sockets.is_empty() {
            rows.always(&self.entity("sockets"), &[&sockets.points(reach_m)]);
            for (path, colour) in SOCKETS.into_iter().zip(labels(LEARNED)).filter(|_| self.says_names()) {
                rows.always(&self.entity(path), &[&sockets.names(reach_m, colour)]);
            }
        }
        let name = description.learners.get(self.index).map_or("", |learner| learner.name.as_str());
        self.readings.begin(rows, name, self.colour, description);
        if let Some(head) = &description.head {
            rows.always(&self.entity("head/frustum"), &[&head::frustum(head)]);
        }
    }

    /// Whether what stands around every robot has its names here: they are said once, beside the first.
    fn says_names(&self) -> bool {
        self.index == 0
    }

    /// Logs what the robot keeps clear of, if there is anything, with its names beside the first learner.
    pub(super) fn log_obstacles(&self, rows: &mut Rows, obstacles: &Obstacles, base: &Isometry3<f64>) {
        if obstacles.is_empty() {
            return;
        }
        obstacles.log(rows, &self.entity("body/obstacles"), base);
        if self.says_names() {
            for (path, colour) in OBSTACLES.into_iter().zip(labels(TRUTH_COLOR)) {
                rows.always(&self.entity(path), &[&obstacles.names(colour)]);
            }
        }
    }

    /// Logs a report of the learner.
    pub(super) fn log(&mut self, rows: &mut Rows, step: u64, report: &LearnerReport, scenery: &Scenery<'_>) {
        if std::mem::take(&mut self.has_ghost) {
            rows.after(step - 1, 1, &self.entity("arm/ghost"), &[&solid(&[])]);
            self.log_ghost_name(rows, (step - 1, 1), None);
        }
        self.log_between(rows, step, report.movement.as_ref(), scenery);
        let enlarged = self.enlarged_report(report);
        let report = enlarged.as_ref().unwrap_or(report);
        self.log_base(rows, step, report, scenery);
        self.log_at_zero(rows, step, report, scenery);
        self.log_arms(rows, step, report, scenery);
        self.log_movement(rows, step, report, scenery);
        for (series, value) in self.metrics.iter().zip(metrics::values(report)) {
            if let Some(value) = value {
                rows.number(step, series, value);
            }
        }
        if let (Some(failure), false) = (&report.failure, self.failed) {
            self.failed = true;
            rows.at(step, &self.entity("failure"), &[&TextLog::new(failure.as_str()).with_level("ERROR")]);
        }
    }

    /// The report with its estimate enlarged, if estimates are. The first one is the description.
    fn enlarged_report(&mut self, report: &LearnerReport) -> Option<LearnerReport> {
        let times = self.enlarged?;
        let described = self.described.get_or_insert_with(|| report.estimate.clone());
        Some(LearnerReport { estimate: enlarged(&report.estimate, described, times), ..report.clone() })
    }

    /// The robot as described, standing where the learned base is; only where differences are enlarged.
    fn described_at(&self, base: &Isometry3<f64>) -> Option<State> {
        let described = self.described.as_ref()?;
        let carry = base * described.base_frame()?.inverse();
        Some(described.state()?.carried(&carry, |_| true))
    }

    /// Logs where the robot stands, if that is learned: the robot stays in its place in the row, and the frame of the
    /// measurements moves.
    fn log_base(&mut self, rows: &mut Rows, step: u64, report: &LearnerReport, scenery: &Scenery<'_>) {
        let Some(first) = self.base else { return };
        let Some(base) = report.estimate.base_frame() else { return };
        let moved = base * first.inverse();
        self.moved = moved;
        let place = Translation3::from(scenery.stage.place(self.index)) * moved.inverse();
        for (entity, pose) in [(self.root.clone(), place), (self.entity("body"), moved)] {
            rows.at(step, &entity, &[&transform(&pose)]);
        }
        for path in NAMES {
            rows.at(step, &self.entity(path), &[&transform(&moved)]);
        }
    }

    /// Logs the arm at θ = 0.
    fn log_at_zero(&mut self, rows: &mut Rows, step: u64, report: &LearnerReport, scenery: &Scenery<'_>) {
        let (colour, joints, arrow_m) = (self.colour, scenery.description.joints.as_slice(), scenery.arrow_m);
        let model = &report.estimate;
        let links_look = || model::links_look(colour);
        rows.drawn(step, &self.entity("zero/links"), model::links(&model.bones_m()), (0, links_look));
        let axes_look = || model::axes_look(joints, colour);
        rows.drawn(step, &self.entity("zero/axes"), model::axes(model, arrow_m), (0, axes_look));
        if let Some(directions) = self.uncertainty.of_directions(model, arrow_m) {
            let look = self.uncertainty.look(&directions, joints, ("", true), (colour, opacity(joints.len())));
            rows.drawn(step, &self.entity("zero/directions"), drawn(&directions, &[]), look);
        }
    }

    /// Logs the true and the estimated arm in the configuration of the movement, and the uncertainty of the estimate
    /// there.
    fn log_arms(&mut self, rows: &mut Rows, step: u64, report: &LearnerReport, scenery: &Scenery<'_>) {
        let (joints, reach_m) = (scenery.description.joints.as_slice(), scenery.stage.figure.reach_m);
        let model = &report.estimate;
        let configuration = match (&report.movement, &self.shown) {
            (Some(movement), _) => movement.configuration.clone(),
            (None, Some(shown)) => shown.configuration.clone(),
            // Before the first movement: as near to θ = 0 as the limits allow.
            (None, None) => joints.iter().map(|joint| 0_f64.clamp(joint.limits[0], joint.limits[1])).collect(),
        };
        let estimate = model.state();
        let links = estimate.as_ref().map(|arm| Posture::of(arm, &configuration));
        let base = model.base_frame().unwrap_or_default();
        let entity = self.entity("arm/estimate");
        let frames = estimate.as_ref().map(|arm| scenery.drawing().frames(arm, &base)).unwrap_or_default();
        match &links {
            Some(posture) => {
                let arm = Arm { frames: &frames, posture, look: self.arm_look() };
                arm.log(rows, step, &entity, scenery.drawing());
            }
            None => arm::log_none(rows, step, &entity, scenery.links),
        }
        let truth = scenery.truth.map(|truth| Posture::of(truth, &configuration));
        let described = self.described_at(&base);
        if let Some(arm) = &described {
            let posture = Posture::of(arm, &configuration);
            let drawing = Drawing { links: None, ..scenery.drawing() };
            let arm = Arm { frames: &[], posture: &posture, look: DESCRIBED };
            arm.log(rows, step, &self.entity("arm/described"), drawing);
        }
        if let Some(posture) = &truth {
            let arm = Arm { frames: scenery.true_frames, posture, look: TRUE_ARM };
            arm.log(rows, step, &self.entity("arm/truth"), scenery.drawing());
            for (entity, points) in self.broken(posture, scenery) {
                rows.at(step, &entity, &[&points]);
            }
        }
        if let Some(posture) = truth.as_ref().or(links.as_ref()) {
            self.log_trunk(rows, step, 0, posture, scenery.stage);
        }
        if sight::is_drawn(scenery) {
            let arms = [scenery.truth.zip(truth.as_ref()), estimate.as_ref().zip(links.as_ref())];
            sight::log(
                rows,
                (step, 0),
                (&|path| self.entity(path), self.colour),
                arms,
                report.movement.as_ref(),
                scenery,
            );
        }
        if scenery.truth.is_none() && !model.sockets_m.is_empty() {
            let sockets = Sockets::believed(&scenery.description.sockets, &model.sockets_m);
            rows.at(step, &self.entity("sockets"), &[&sockets.points(reach_m)]);
            for (path, colour) in SOCKETS.into_iter().zip(labels(LEARNED)).filter(|_| self.says_names()) {
                rows.at(step, &self.entity(path), &[&sockets.names(reach_m, colour)]);
            }
        }
        let links = links.map(|posture| posture.links).unwrap_or_default();
        let cloud = opacity(joints.len());
        let points = self.uncertainty.of_points(model);
        let allowed = self.uncertainty.of_allowed(model);
        // Clouds that reach into a neighbour's cell are outlines there, until they have shrunk.
        let is_solid = scenery.stage.holds(points.as_deref().unwrap_or_default(), &links, &self.moved);
        let (had_points, had_allowed) = match &self.shown {
            Some(shown) => (shown.points.is_some(), shown.allowed.is_some()),
            None => (false, false),
        };
        for (clouds, had, name, what, alpha) in [
            (&points, had_points, "point_ellipsoids", "", cloud),
            (&allowed, had_allowed, "allowed_ellipsoids", ", what data allow", ALLOWED),
        ] {
            // Those that are no more must not stay with a later arm.
            if clouds.is_some() || had {
                let clouds = clouds.as_deref().unwrap_or_default();
                let look = self.uncertainty.look(clouds, joints, (what, is_solid), (self.colour, alpha));
                rows.drawn(step, &self.entity(name), drawn(clouds, &links), look);
            }
        }
        let mut readings = report.movement.iter().flat_map(|movement| &movement.readings);
        let has_outlier = readings.any(ChannelReading::is_outlier);
        self.shown = Some(Shown { step, configuration, estimate, described, frames, points, allowed, has_outlier });
    }

    /// Logs trunk and head, if joints of the robot carry them, at `ticks` after the step.
    pub(super) fn log_trunk(&self, rows: &mut Rows, step: u64, ticks: u64, posture: &Posture, stage: &Stage) {
        let figure = &stage.figure;
        let parts = [("body/trunk", &figure.trunk, figure.carried_by), ("body/head", &figure.head, figure.head_link)];
        for (path, _, link) in parts.into_iter().filter(|(_, capsules, _)| !capsules.is_empty()) {
            let Some(link) = posture.links.get(link) else { continue };
            // Bodies stand where the base was at first, and so does what the links carry.
            let pose = transform(&(self.moved.inverse() * link * self.moved));
            if ticks == 0 {
                rows.at(step, &self.entity(path), &[&pose]);
            } else {
                rows.after(step, ticks, &self.entity(path), &[&pose]);
            }
        }
    }

    /// Logs that cameras on links have seen nothing of the movement on the way, at `ticks` after the step.
    pub(super) fn clear_eyes(&self, rows: &mut Rows, step: u64, ticks: u64) {
        self.eyes.iter().for_each(|eye| eye.clear(rows, step, ticks));
    }

    /// Draws a posture that is tried out, by its bones with that of the hand first, or nothing.
    pub(super) fn log_ghost(&mut self, rows: &mut Rows, step: u64, bones_m: Option<&[Vec<[f64; 3]>]>, reach_m: f64) {
        let capsules = bones_m.map(|bones| bare(bones, reach_m, GHOST)).unwrap_or_default();
        rows.after(step, 0, &self.entity("arm/ghost"), &[&solid(&capsules)]);
        let hand = bones_m.and_then(|bones| bones.first()?.last()).map(|hand| single(*hand));
        self.log_ghost_name(rows, (step, 0), hand);
        self.has_ghost = bones_m.is_some();
    }

    /// Logs what a posture that is tried out is called, at its hand.
    fn log_ghost_name(&self, rows: &mut Rows, (step, ticks): (u64, u64), hand: Option<[f32; 3]>) {
        let [red, green, blue, _] = GHOST;
        for (path, colour) in GHOSTS.into_iter().zip(labels([red, green, blue])) {
            let name = labelled(hand, colour).with_labels(["posture tried out"]);
            rows.after(step, ticks, &self.entity(path), &[&name]);
        }
    }

    /// The mark of the joint that has broken, and its name in each of its colours; nothing while none has.
    pub(super) fn broken(&self, posture: &Posture, scenery: &Scenery<'_>) -> Vec<(EntityPath, Points3D)> {
        let Some(joint) = scenery.broken else { return Vec::new() };
        let mark = broken::mark(posture, joint, scenery.stage.figure.reach_m);
        let names = BROKEN.into_iter().zip(labels(ERROR)).map(|(path, colour)| {
            (self.entity(path), broken::name(posture, joint, &scenery.description.joints, colour))
        });
        std::iter::once((self.entity("arm/broken"), mark)).chain(names).collect()
    }

    /// A point in the frame of the measurements, where it is beside the robot as it stood first.
    fn moved_back(&self, point: &[f64; 3]) -> Point3<f64> {
        self.moved.inverse() * Point3::from(*point)
    }

    fn log_movement(&mut self, rows: &mut Rows, step: u64, report: &LearnerReport, scenery: &Scenery<'_>) {
        let Scenery { description, stage, .. } = scenery;
        let joints = description.joints.as_slice();
        let (name, failure, report) = (&report.name, &report.failure, report.movement.as_ref());
        if self.stopped {
            return;
        }
        self.stopped = failure.is_some() && report.is_none();
        let label = if self.stopped { format!("{name} · has stopped") } else { name.clone() };
        if label != self.label {
            for path in NAMES {
                rows.at(step, &self.entity(path), &[&Points3D::update_fields().with_labels([label.as_str()])]);
            }
            self.label = label;
        }
        // Of a learner that has stopped they are cleared.
        let reach_m = stage.figure.reach_m;
        let movement = Movement::of(report, reach_m, |point| stage.is_near(&self.moved_back(point)));
        let log_marker = |rows: &mut Rows, path, marker: &[Cell], label, colour| {
            let look = || marker_look(colour, label, reach_m);
            rows.drawn(step, &self.entity(path), marker.to_vec(), (0, look));
        };
        log_marker(rows, "marker/predicted", &movement.predicted, PREDICTED, self.colour);
        log_marker(rows, "marker/measured", &movement.measured, SEEN, MEASURED);
        for (path, colour) in ERRORS.into_iter().zip(labels(ERROR)) {
            rows.drawn(step, &self.entity(path), movement.error.to_vec(), (0, || error_look(colour, reach_m)));
        }
        if let Some(outlier) = &movement.outlier {
            rows.at(step, &self.entity("marker/outlier"), &[outlier]);
        }
        self.readings.log(rows, step, report.map_or(&[], |report| report.readings.as_slice()));
        let pictures = report.map_or(&[][..], |report| report.pictures.as_slice());
        self.eyes.iter().for_each(|eye| eye.log(rows, step, pictures, self.colour));
        if let Some(head) = &description.head {
            let gaze = report.and_then(|report| report.gaze.as_ref());
            rows.at(step, &self.entity("head/gaze"), &[&head::gaze(head, gaze, self.colour)]);
            for (path, colour) in MISSED.into_iter().zip(labels(ERROR)) {
                log_marker(rows, path, &movement.missed, NOT_SEEN, colour);
            }
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
        if let Some(slice) = self.plane.and_then(|plane| Slice::of(partition, plane, joints)) {
            slice.log(rows, step, |path| self.entity(path));
        }
        rows.plain(step, &self.entity("direct/leaves"), partition::data(partition));
    }
}

/// The opacity of the ellipsoids of an arm with so many joints.
fn opacity(joints: usize) -> u8 {
    (CLOUD * (6.0 / joints.max(6) as f64).powf(0.7)) as u8
}
