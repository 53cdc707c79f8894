//! The arrangement of views that a viewer shows when it opens a recording.

use std::sync::atomic::{AtomicU64, Ordering};

use serde::{Deserialize, Serialize};

use super::{
    RecordingError,
    charts::{BEST_DESIGN, CHARTS, CHARTS_WITHOUT_TRUTH, TRACE},
    eye::{self, EYE},
    layout::{Container, Part, Time, View},
    partition,
    rerun::{
        EntityPath, LogMsg, Range2D, StoreId, StoreKind,
        blueprint::{
            archetypes::{
                Background, EntityBehavior, EyeControls3D, LineGrid3D, PlotLegend, ScalarAxis, VisualBounds2D as Bounds,
            },
            components::{BackgroundKind, Corner2D, VisualBounds2D},
        },
    },
    solid::single,
    stage::{GROUNDS, Stage, TALL_BELOW},
};
use body_schema_calibration::Unit;
use body_schema_wire::{CameraDescription, Description, LearnerDescription};

/// The part of the width or height that views of cameras on links have, the most that stand beside each other, and the margin around a
/// picture as a part of its side.
const EYES: f64 = 0.25;
const MOST_EYES: usize = 4;
const MARGIN: f64 = 0.04;

/// Labels in colours for light ground, for dark ground, and for files.
const ON_LIGHT: &[&str] = &[
    "name",
    "marker/error",
    "marker/missed",
    "body/obstacles/names",
    "sockets/names",
    "arm/broken/name",
    "arm/ghost/name",
];
const ON_DARK: &[&str] =
    &["on_dark/**", "body/obstacles/on_dark", "sockets/on_dark", "arm/broken/on_dark", "arm/ghost/on_dark"];
const IN_FILES: &[&str] =
    &["in_files/**", "body/obstacles/in_files", "sockets/in_files", "arm/broken/in_files", "arm/ghost/in_files"];

/// The colours around a scene.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(rename_all = "lowercase")]
pub enum Theme {
    /// Dark on a light background.
    #[default]
    Light,
    /// Light on a dark background.
    Dark,
}

/// The shape of the view in which a scene is shown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(rename_all = "lowercase")]
pub enum Shape {
    /// Wider than high: the learners stand side by side.
    #[default]
    Wide,
    /// Higher than wide: the learners stand one behind the other, seen from above.
    Tall,
}

impl Shape {
    /// The width of the view in heights.
    pub fn aspect(self) -> f64 {
        match self {
            Self::Wide => 1.4,
            Self::Tall => 0.7,
        }
    }
}

impl Theme {
    /// The background.
    fn background(self) -> [u8; 3] {
        match self {
            Self::Light => [0xF4, 0xF5, 0xF7],
            Self::Dark => [0x1B, 0x1C, 0x1F],
        }
    }

    /// The lines of the ground.
    pub(super) fn lines(self) -> [u8; 3] {
        match self {
            Self::Light => [0xC6, 0xCA, 0xD2],
            Self::Dark => [0x3E, 0x42, 0x4A],
        }
    }
}

/// The arranger of the views of one recording.
pub(super) struct Arranger {
    pub(super) description: Description,
    /// The root entities of the learners.
    pub(super) roots: Vec<EntityPath>,
    pub(super) stage: Stage,
    /// The cameras that links carry, by their numbers: there is a view of what each sees.
    pub(super) cameras: Vec<usize>,
    /// The recording.
    pub(super) recording: StoreId,
    /// How often it was arranged: viewers take up only what they have not met.
    pub(super) arranged: AtomicU64,
}

impl Arranger {
    /// The arrangement for a file: the scene above; below, the curves, DIRECT's partition and the note.
    pub(super) fn whole(&self) -> Result<Vec<LogMsg>, RecordingError> {
        let scene = self.stage(Theme::default(), Shape::default().aspect(), None, true);
        let mut below = self.charts();
        let note = View::new("TextDocument", "Note", &EntityPath::from("note")).into();
        let tabs = self.partitions().into_iter().chain(self.limits()).chain(self.readings()).chain([note]);
        below.push(Container::tabs(tabs).into());
        let root = Container::vertical([scene, Container::horizontal(below).into()], [3.0, 1.0]);
        root.messages(self.store(), Time::Shown)
    }

    /// The arrangement for a page with controls and curves of its own: the scene alone, to look at and to turn, with one learner in it or
    /// all.
    pub(super) fn scene(&self, theme: Theme, aspect: f64, alone: Option<usize>) -> Result<Vec<LogMsg>, RecordingError> {
        let scene: Part = self.stage(theme, aspect, alone, false);
        Container::tabs([scene]).messages(self.store(), Time::Led)
    }

    /// The scene, and where links carry cameras what they see: to the right of it, or below in a tall view.
    fn stage(&self, theme: Theme, aspect: f64, alone: Option<usize>, details: bool) -> Part {
        let eyes = self.eyes(theme, alone, details);
        if eyes.is_empty() {
            return self.view(theme, aspect, alone, details).into();
        }
        let is_tall = aspect < TALL_BELOW;
        let many = eyes.len() > MOST_EYES;
        let eyes = match (is_tall, many) {
            (_, true) => Container::tabs(eyes),
            (true, false) => Container::horizontal(eyes),
            (false, false) => Container::column(eyes),
        };
        let share = 1.0 - EYES;
        let shares = [share as f32, EYES as f32];
        let scene = self.view(theme, if is_tall { aspect / share } else { aspect * share }, alone, details).into();
        match is_tall {
            true => Container::vertical([scene, eyes.into()], shares).into(),
            false => Container::beside([scene, eyes.into()], shares).into(),
        }
    }

    /// What cameras on links see, learner by learner.
    fn eyes(&self, theme: Theme, alone: Option<usize>, details: bool) -> Vec<Part> {
        let cameras = self.cameras.iter().filter_map(|camera| self.description.cameras.get(*camera));
        let learners = || self.shown(alone);
        let pairs = cameras.flat_map(|camera| learners().map(move |(root, learner)| (camera, root, &learner.name)));
        let view = |(camera, root, learner): (&CameraDescription, &EntityPath, &String)| {
            let entity = eye::entity(root, camera);
            let range = |side: f64| [-MARGIN * side, (1.0 + MARGIN) * side];
            let [x_range, y_range] = camera.size_px.map(|side| range(side).into());
            let view = View::new("2D", &format!("{}, {learner}", camera.name), &entity)
                .with(&Bounds::new(VisualBounds2D(Range2D { x_range, y_range })))
                .with(&Background::new(BackgroundKind::SolidColor).with_color(theme.background()));
            match details {
                true => view.into(),
                false => view.with_behavior(&entity, &EntityBehavior::new().with_interactive(false)).into(),
            }
        };
        pairs.map(view).collect()
    }

    /// The learners that are shown, with their root entities.
    fn shown(&self, alone: Option<usize>) -> impl Iterator<Item = (&EntityPath, &LearnerDescription)> {
        let all = self.roots.iter().zip(&self.description.learners).enumerate();
        all.filter(move |(place, _)| alone.is_none_or(|alone| alone == *place)).map(|(_, learner)| learner)
    }

    /// The store of one more arrangement.
    fn store(&self) -> StoreId {
        arrangement(&self.recording, self.arranged.fetch_add(1, Ordering::Relaxed))
    }

    /// One view of one learner, or of all. With `details` hovering names entities, there is a key to the colours, and the arms at θ
    /// = 0 can be switched on.
    fn view(&self, theme: Theme, aspect: f64, alone: Option<usize>, details: bool) -> View {
        let [target, eye] = self.stage.camera(aspect, alone).map(|point| single(point.coords.into()));
        // A page knows its theme; the viewer of a file lays whatever its own is behind labels.
        let (ground, labels) = match theme {
            _ if details => (GROUNDS[0], [ON_LIGHT, ON_DARK]),
            Theme::Light => (GROUNDS[0], [ON_DARK, IN_FILES]),
            Theme::Dark => (GROUNDS[1], [ON_LIGHT, IN_FILES]),
        };
        let mut contents = vec![format!("+ /{ground}")];
        for (root, _) in self.shown(alone) {
            contents.push(format!("+ {root}/**"));
            let hidden = ["direct/**", "metrics/**", "readings/**", "failure/**"];
            contents
                .extend(hidden.iter().chain(labels.into_iter().flatten()).map(|hidden| format!("- {root}/{hidden}")));
            contents.extend((!details).then(|| format!("- {root}/zero/**")));
            contents.extend((!self.cameras.is_empty()).then(|| format!("- {root}/{EYE}/**")));
        }
        contents.extend(details.then(|| "+ /key".to_owned()));
        let mut view = View::new("3D", "Scene", &EntityPath::root())
            .with_contents(contents)
            .with(&EyeControls3D::new().with_position(eye).with_look_target(target).with_eye_up([0.0, 0.0, 1.0]))
            .with(&Background::new(BackgroundKind::SolidColor).with_color(theme.background()))
            // The lines of the ground are an entity: the viewer's own grid costs a tenth of a frame where software draws.
            .with(&LineGrid3D::new().with_visible(false));
        if !details {
            let ground = EntityPath::from(ground);
            view = view.with_behavior(&ground, &EntityBehavior::new().with_interactive(false));
        }
        for (root, _) in self.shown(alone) {
            if details {
                let zero = root.join(&EntityPath::from("zero"));
                view = view.with_behavior(&zero, &EntityBehavior::new().with_visible(false));
            } else {
                view = view.with_behavior(root, &EntityBehavior::new().with_interactive(false));
            }
        }
        view
    }

    /// The curves of all learners, metric by metric.
    fn charts(&self) -> Vec<Part> {
        let charts: &[(&str, &str)] = if self.description.truth.is_some() { &CHARTS } else { &CHARTS_WITHOUT_TRUTH };
        let views = charts.iter().map(|(title, metric)| {
            chart(title, self.roots.iter().map(|root| format!("+ {root}/metrics/{metric}")), None)
        });
        views.collect()
    }

    /// The traces of all learners beside their limits, where the truth is known.
    fn limits(&self) -> Option<Part> {
        self.description.truth.as_ref()?;
        let of_learner = |root: &EntityPath| TRACE.1.map(|metric| format!("+ {root}/metrics/{metric}"));
        Some(chart(TRACE.0, self.roots.iter().flat_map(of_learner).chain([format!("+ /{BEST_DESIGN}")]), None))
    }

    /// The residuals of readings, and for a learner that weighs them the probability that they are outliers.
    fn readings(&self) -> Vec<Part> {
        let series = |kind: &'static str| self.roots.iter().map(move |root| format!("+ {root}/readings/{kind}/**"));
        let mut views = vec![chart("Residual per reading (σ)", series("residuals"), None)];
        if self.description.learners.iter().any(|learner| learner.robust) {
            views.push(chart("Probability of an outlier", series("outliers"), Some([-0.05, 1.05])));
        }
        views
    }

    /// The partitions of the learners that have one: DIRECT divides the joint box, while recorded movements are tried one
    /// by one.
    fn partitions(&self) -> Vec<Part> {
        let is_box = self.description.movements_available.is_none();
        let divides = |learner: &LearnerDescription| is_box && learner.policy.starts_with("active");
        let views = self.roots.iter().zip(&self.description.learners).filter(|(_, learner)| divides(learner));
        let views = views.map(|(root, LearnerDescription { name, .. })| {
            let bounds = Range2D { x_range: [-0.08, 1.08].into(), y_range: partition::WITH_LABELS.into() };
            View::new("2D", &format!("DIRECT, {name}"), &root.join(&EntityPath::from("direct")))
                .with(&Bounds::new(VisualBounds2D(bounds)))
                .into()
        });
        views.collect()
    }
}

/// The store of an arrangement of a recording.
fn arrangement(recording: &StoreId, number: u64) -> StoreId {
    let name = format!("{}-arrangement-{number}", recording.recording_id().as_str());
    StoreId::new(StoreKind::Blueprint, recording.application_id().clone(), name)
}

/// For a calibration: the robot beside the report, the residuals of all rows below.
pub(super) fn calibration(stage: &Stage, recording: &StoreId, unit: Unit) -> Result<Vec<LogMsg>, RecordingError> {
    let [target, eye] = stage.camera(Shape::default().aspect(), None).map(|point| single(point.coords.into()));
    let contents = ["robot/**", "body/**", GROUNDS[0], "key"].map(|entity| format!("+ /{entity}"));
    let scene = View::new("3D", "The calibrated robot, row by row", &EntityPath::root())
        .with_contents(contents)
        .with(&EyeControls3D::new().with_position(eye).with_look_target(target).with_eye_up([0.0, 0.0, 1.0]))
        .with(&Background::new(BackgroundKind::SolidColor).with_color(Theme::Light.background()))
        .with(&LineGrid3D::new().with_visible(false));
    let report = View::new("TextDocument", "Report", &EntityPath::from("report"));
    let title = format!("Distance from what was measured, by row ({unit})");
    let residuals = chart(&title, ["+ /residuals/**".to_owned()], None);
    let outliers = chart("Probability of an outlier, by row", ["+ /outliers".to_owned()], Some([-0.05, 1.05]));
    let above = Container::horizontal([scene.into(), report.into()]);
    let below = Container::horizontal([residuals, outliers]);
    Container::vertical([above.into(), below.into()], [2.0, 1.0]).messages(arrangement(recording, 0), Time::Shown)
}

/// A chart of curves; the vertical axis shows `range`, or fits the data.
fn chart(title: &str, contents: impl IntoIterator<Item = String>, range: Option<[f64; 2]>) -> Part {
    let view = View::new("TimeSeries", title, &EntityPath::root())
        .with_contents(contents)
        .with(&PlotLegend::new().with_corner(Corner2D::RightTop));
    match range {
        Some(range) => view.with(&ScalarAxis::new().with_range(range)).into(),
        None => view.into(),
    }
}
