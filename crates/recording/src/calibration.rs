//! A calibration as a recording: for each row the calibrated robot with its residuals, beside the robot as described.
//!
//! On the timeline `step`: step k is row k of the table, counted from 1. Positions are in metres (f32), below `/robot` in the frame of the
//! measurements, which stands so that the calibrated base is at the origin.
//!
//! | entity | archetype | content |
//! |---|---|---|
//! | `/robot` | Transform3D, static | from the frame of the measurements into that of the calibrated base |
//! | `/robot/arm` | Capsules3D, Boxes3D, Cylinders3D, Ellipsoids3D | the calibrated arm in the posture of the row, its differences from the description enlarged: the shapes of its URDF, and capsules for links without any |
//! | `/robot/arm/mesh-{i}` | Asset3D, InstancePoses3D, static; Transform3D | its meshes that were found |
//! | `/robot/described` | Capsules3D | the robot as described, slim and grey, on the calibrated base |
//! | `/robot/uncertainty` | Ellipsoids3D | covariances of the axis points, 1σ, enlarged likewise |
//! | `/robot/measured` | Points3D | where targets were measured, or the sockets that held them |
//! | `/robot/errors/described`, `…/calibrated` | LineStrips3D | from there towards what is predicted, enlarged likewise |
//! | `/residuals/described`, `…/learned_from`, `…/held_out` | Scalars, SeriesPoints | how far each prediction is from what was measured, mean over the readings of the row, in mm (px or deg where no length was measured) |
//! | `/outliers` | Scalars, SeriesPoints | the probability that a row is an outlier, of rows that were learned from |
//! | `/report` | TextDocument, static | the report |
//!
//! One factor enlarges all: 10, or less where errors are large, unless another is asked for. The key in the scene says it.
//!
//! As described is the chain of the URDF with base, targets, cameras and sockets fitted to all rows that are learned from. Of more than
//! [`MOST_ROWS`] rows so many are recorded, spread evenly.

use body_schema_palette::learner_color;
use std::{collections::BTreeMap, path::Path};

use nalgebra::{Isometry3, Point3};

use super::{
    Appearance, EllipsoidSize, RecordingError, TRUTH_COLOR,
    arm::{Arm, Drawing, log_meshes},
    blueprint::calibration as arrangement,
    body::Figure,
    colours::{label_in_file, label_on_light, labelled},
    enlarged::enlarged as enlarge,
    file::{RrdFile, encoder},
    links::Links,
    message,
    movement::MEASURED,
    posture::{ArmLook, Posture},
    rerun::{
        ApplicationId, Color, EntityPath, LineStrips3D, LogMsg, MediaType, Points3D, Radius, RecordingInfo,
        SeriesPoints, StoreId, TextDocument, Transform3D, ViewCoordinates,
    },
    room::Room,
    rows::Rows,
    scenery::{DESCRIBED, TRUE_ARM},
    solid::{drum, quaternion, single, solid},
    stage::{GROUNDS, Stage},
    uncertainty::{Uncertainty, drawn},
};
use body_schema_calibration::{Calibration, Case, Reading, Residual, Unit};
use body_schema_engine::model::State;
use body_schema_wire::ModelReport;

/// The most rows that are recorded.
pub const MOST_ROWS: usize = 2000;
/// The factor by which errors are enlarged, so that one sees large ones from small ones, …
const USUAL: f64 = 10.0;
/// … and the most that a typical error of the description is enlarged to, as a part of the arm's reach.
const ERROR: f64 = 0.15;
/// Radii of a measured point and of the line of an error, as parts of the arm's reach.
const POINT: f64 = 0.022;
const LINE: f64 = 0.009;
/// The opacity of the ellipsoids.
const CLOUD: u8 = 70;

/// How a calibration is drawn.
#[derive(Clone, Debug, Default)]
pub struct CalibrationLook {
    /// How the robot looks.
    pub appearance: Appearance,
    /// The factor by which errors are enlarged; by default 10, or less where errors are large.
    pub enlarged: Option<f64>,
}

/// Writes a calibration to a file, by convention `.rrd`; `report` in Markdown goes with it.
///
/// # Errors
///
/// [`RecordingError::Create`] or [`RecordingError::Write`] if the file cannot be written, [`RecordingError::Encode`] if
/// the data cannot be encoded.
pub fn calibration(
    path: &Path,
    found: &Calibration,
    case: &Case<'_>,
    report: &str,
    look: &CalibrationLook,
) -> Result<(), RecordingError> {
    let id = format!("{}-calibration", found.report.scenario);
    let messages = messages(found, case, report, look, &id)?;
    let mut file = RrdFile::create(path)?;
    file.append(&messages)?;
    file.finish()
}

/// The bytes of a file such as [`calibration`] writes. A viewer takes recordings with different ids for different ones.
///
/// # Errors
///
/// [`RecordingError::Encode`] if the data cannot be encoded.
pub fn calibration_bytes(
    found: &Calibration,
    case: &Case<'_>,
    report: &str,
    look: &CalibrationLook,
    id: &str,
) -> Result<Vec<u8>, RecordingError> {
    let mut encoder = encoder(Vec::new())?;
    for message in messages(found, case, report, look, id)? {
        encoder.append(&message)?;
    }
    encoder.finish()?;
    Ok(encoder.into_inner()?)
}

/// All that the recording consists of.
fn messages(
    found: &Calibration,
    case: &Case<'_>,
    report: &str,
    look: &CalibrationLook,
    id: &str,
) -> Result<Vec<LogMsg>, RecordingError> {
    let name = &found.report.scenario;
    let application = ApplicationId::new_or_unknown(format!("body-schema-calibration-{name}"));
    let store = StoreId::recording(application, id);
    let scene = Scene::of(found, case, look);
    let mut rows = Rows::of(&store);
    let title = RecordingInfo::new().with_name(format!("{name}, calibration"));
    rows.always(&EntityPath::properties(), &[&title]);
    rows.always(&EntityPath::root(), &[&ViewCoordinates::RIGHT_HAND_Z_UP()]);
    let document = TextDocument::new(report).with_media_type(MediaType::markdown());
    rows.always(&EntityPath::from("report"), &[&document]);
    scene.begin(&mut rows);
    series(&mut rows);
    let mut described: BTreeMap<usize, Vec<Residual>> = BTreeMap::new();
    let all: Vec<usize> = (0..case.rows.len()).collect();
    for residual in case.residuals(&found.nominal, &all) {
        described.entry(residual.row).or_default().push(residual);
    }
    let mut readings: BTreeMap<usize, Vec<&Reading>> = BTreeMap::new();
    for reading in &found.report.residuals {
        readings.entry(reading.row - 1).or_default().push(reading);
    }
    let mut uncertainty = Uncertainty::new(case.names.joints.len(), EllipsoidSize::OneSigma).magnified(scene.times);
    let kept = all.len().clamp(1, MOST_ROWS);
    for row in (0..kept).map(|index| index * all.len() / kept).filter(|row| *row < all.len()) {
        let described = described.get(&row).map_or(&[][..], Vec::as_slice);
        let readings = readings.get(&row).map_or(&[][..], Vec::as_slice);
        scene.log(&mut rows, row, case, &mut uncertainty, (described, readings));
        log_residuals(&mut rows, row, found.report.unit, described, readings);
    }
    let mut messages = vec![message::store_info(&store)];
    messages.extend(arrangement(&scene.stage, &store, found.report.unit)?);
    for chunk in &rows.steps(|_| true)? {
        messages.push(message::data(&store, chunk)?);
    }
    Ok(messages)
}

/// The three clouds of points in the chart of residuals, and that of outliers.
const SERIES: [(&str, &str, [u8; 3]); 4] = [
    ("residuals/described", "nominal", TRUTH_COLOR),
    ("residuals/learned_from", "calibrated, row learned from", [0x56, 0xB4, 0xE9]),
    ("residuals/held_out", "calibrated, row held out", [0xD5, 0x5E, 0x00]),
    ("outliers", "probability that the row is an outlier", [0xD6, 0x3B, 0x3B]),
];

fn series(rows: &mut Rows) {
    for (path, name, colour) in SERIES {
        let look = SeriesPoints::new().with_colors([Color::from(colour)]).with_names([name]).with_marker_sizes([3.0]);
        rows.always(&EntityPath::from(path), &[&look]);
    }
}

/// A row's residuals, and whether it is an outlier.
fn log_residuals(rows: &mut Rows, row: usize, unit: Unit, described: &[Residual], readings: &[&Reading]) {
    let step = row as u64 + 1;
    let mean = |values: Vec<f64>| (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64);
    let of = |held_out: bool| {
        let wanted = readings.iter().filter(|reading| reading.held_out == held_out);
        mean(wanted.filter_map(|reading| unit.of_reading(reading)).collect())
    };
    let outlier = readings.iter().filter_map(|reading| reading.outlier_probability).reduce(f64::max);
    let values = [
        mean(described.iter().filter_map(|residual| unit.of(&residual.norms)).collect()),
        of(false),
        of(true),
        outlier,
    ];
    for ((path, ..), value) in SERIES.iter().zip(values) {
        if let Some(value) = value {
            rows.number(step, &EntityPath::from(*path), value);
        }
    }
}

/// The robot that is drawn.
struct Scene {
    /// The calibrated robot, as it is drawn, and the frames of its links at θ = 0.
    arm: State,
    frames: Vec<Isometry3<f64>>,
    /// The robot as described, on the calibrated base.
    described: State,
    model: ModelReport,
    /// Where its base is, in the frame of the measurements.
    base: Isometry3<f64>,
    stage: Stage,
    /// The shapes of the robot's links, if it has any.
    links: Option<Links>,
    /// The factor by which errors are enlarged.
    times: f64,
    /// Whether places were measured.
    is_place: bool,
}

impl Scene {
    fn of(found: &Calibration, case: &Case<'_>, CalibrationLook { appearance, enlarged }: &CalibrationLook) -> Self {
        let state = found.fit.state();
        let at_origin = State { base: Isometry3::identity(), ..state.clone() };
        let links = Links::of(appearance);
        let origin = Isometry3::identity();
        let has_base = links.as_ref().is_some_and(Links::has_base);
        let below = appearance.described.as_ref().map(|_| (&origin, has_base));
        let figure = Figure::below(&case.scenario.robot.joint_descriptions(), &at_origin, below);
        let postures = case.rows.iter().step_by(case.rows.len().div_ceil(200).max(1));
        let postures = postures.map(|row| Posture::of(&at_origin, &row.positions).points()).collect();
        let stage = Stage::new(figure.clone(), Room::of_postures(&figure, postures), 1);
        let usual = found.report.training.before.rms_mm.filter(|rms| *rms > 0.0);
        let is_place = found.report.residuals.iter().any(|reading| place(&reading.measured).is_some());
        let most = usual.map_or(USUAL, |rms_mm| round_number(ERROR * stage.figure.reach_m / (rms_mm * 1e-3)));
        let times = enlarged.unwrap_or(most.min(USUAL));
        let nominal = ModelReport::of_state(found.nominal.state());
        let model = enlarge(&ModelReport::of_belief(&found.fit.belief, None), &nominal, times);
        let arm = model.state().unwrap_or_else(|| state.clone());
        let described = State { base: state.base, ..found.nominal.state().clone() }.measured().into_owned();
        let frames = links.as_ref().map(|links| links.frames(&arm, &state.base)).unwrap_or_default();
        Self { arm, frames, described, model, base: state.base, stage, links, times, is_place }
    }

    /// Logs what is the same in every row.
    fn begin(&self, rows: &mut Rows) {
        let place = self.base.inverse();
        let transform = Transform3D::from_translation(single(place.translation.vector.into()))
            .with_quaternion(quaternion(&place.rotation));
        rows.always(&EntityPath::from("robot"), &[&transform]);
        rows.always(&EntityPath::from("body"), &[&solid(&self.stage.figure.fixed)]);
        if let Some(base) = &self.stage.figure.base {
            rows.always(&EntityPath::from("body/base"), &[&drum(base)]);
        }
        if !self.stage.figure.trunk.is_empty() {
            rows.always(&EntityPath::from("body/trunk"), &[&solid(&self.stage.figure.trunk)]);
        }
        if !self.stage.figure.head.is_empty() {
            rows.always(&EntityPath::from("body/head"), &[&solid(&self.stage.figure.head)]);
        }
        if let Some(links) = &self.links {
            log_meshes(rows, &EntityPath::from("robot/arm"), links, look());
        }
        let ground = super::Theme::Light.lines();
        rows.always(&EntityPath::from(GROUNDS[0]), &[&self.stage.ground(ground)]);
        let key = format!("errors × {}: grey nominal, blue calibrated  ·  yellow: measured", self.times);
        let label =
            labelled([single(self.stage.figure.name.coords.into())], label_in_file(TRUTH_COLOR)).with_labels([key]);
        rows.always(&EntityPath::from("key"), &[&label]);
    }

    /// Logs the robot in the posture of a row, and the residuals there.
    fn log(
        &self,
        rows: &mut Rows,
        row: usize,
        case: &Case<'_>,
        uncertainty: &mut Uncertainty,
        (described, readings): (&[Residual], &[&Reading]),
    ) {
        let (step, reach_m) = (row as u64 + 1, self.stage.figure.reach_m);
        let entity = |path: &str| EntityPath::from("robot").join(&EntityPath::from(path));
        let posture = Posture::of(&self.arm, &case.rows[row].positions);
        let drawing = Drawing { links: self.links.as_ref(), reach_m };
        let arm = Arm { frames: &self.frames, posture: &posture, look: look() };
        arm.log(rows, step, &entity("arm"), drawing);
        let nominal = Posture::of(&self.described, &case.rows[row].positions);
        let arm = Arm { frames: &[], posture: &nominal, look: DESCRIBED };
        arm.log(rows, step, &entity("described"), Drawing { links: None, ..drawing });
        let joints = case.scenario.robot.joint_descriptions();
        let clouds = uncertainty.of_points(&self.model).unwrap_or_default();
        let clouds_look = uncertainty.look(&clouds, &joints, ("", true), (learner_color(0), CLOUD));
        rows.drawn(step, &entity("uncertainty"), drawn(&clouds, &posture.links), clouds_look);
        let measured: Vec<Point3<f64>> = readings.iter().filter_map(|reading| place(&reading.measured)).collect();
        let points = Points3D::new(measured.iter().map(|point| single(point.coords.into())))
            .with_colors([Color::from(MEASURED)])
            .with_radii([Radius::new_scene_units((POINT * reach_m) as f32)]);
        rows.at(step, &entity("measured"), &[&points]);
        if !self.is_place {
            return;
        }
        let times = self.times;
        let lines = |ends: Vec<[Point3<f64>; 2]>, colour: [u8; 3]| {
            let strips =
                ends.iter().map(|[from, to]| [*from, from + (to - from) * times].map(|it| single(it.coords.into())));
            LineStrips3D::new(strips)
                .with_colors([Color::from(colour)])
                .with_radii([Radius::new_scene_units((LINE * reach_m) as f32)])
        };
        let before = described.iter().filter_map(|it| Some([place(&it.measured)?, place(&it.predicted)?])).collect();
        let after = readings.iter().filter_map(|it| Some([place(&it.measured)?, place(&it.predicted)?])).collect();
        rows.at(step, &entity("errors/described"), &[&lines(before, label_on_light(TRUTH_COLOR))]);
        rows.at(step, &entity("errors/calibrated"), &[&lines(after, label_on_light(learner_color(0)))]);
    }
}

fn look() -> ArmLook {
    let [red, green, blue] = learner_color(0);
    ArmLook { links: [red, green, blue, 150], pins: [red, green, blue, 255], girth: TRUE_ARM.girth }
}

/// The place in a reading, for a position or a pose.
fn place(reading: &[f64]) -> Option<Point3<f64>> {
    matches!(reading.len(), 3 | 6).then(|| Point3::from_slice(&reading[..3]))
}

/// The largest of 1, 2, 5, 10, 20, … that is not above `x`; at least 1.
fn round_number(x: f64) -> f64 {
    let power = 10_f64.powf(x.max(1.0).log10().floor());
    [5.0, 2.0, 1.0].into_iter().map(|digit| digit * power).find(|round| *round <= x.max(1.0)).unwrap_or(1.0)
}

#[cfg(test)]
mod tests {
    #[test]
    fn errors_are_drawn_so_many_times_as_long_as_one_can_say() {
        for (x, round) in [(0.3, 1.0), (1.0, 1.0), (3.9, 2.0), (5.0, 5.0), (99.0, 50.0), (100.0, 100.0)] {
            assert_eq!(super::round_number(x), round, "{x}");
        }
    }
}
