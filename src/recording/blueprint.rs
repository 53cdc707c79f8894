//! How a viewer arranges a recording when it opens it.

use rerun::{
    blueprint::components::{BackgroundKind, Corner2D, VisualBounds2D},
    datatypes::Range2D,
    external::{
        re_log_types::{ApplicationId, EntityPath, LogMsg},
        re_sdk_types::blueprint::archetypes::{
            Background, EyeControls3D, LineGrid3D, PlotLegend, VisualBounds2D as Bounds,
        },
    },
};

use super::{
    RecordingError,
    charts::{BEST_DESIGN, CHARTS, CHARTS_WITHOUT_TRUTH, TRACE},
    layout::{Container, Part, View},
    model::single,
    scene::Scene,
};
use crate::experiment::Description;

/// Where the camera stands, as seen from the scene's centre, in sizes of the arm: aside, a little ahead and above.
const CAMERA: [f64; 3] = [0.6, -2.0, 1.05];

/// The ground of the arms, the same in light and dark viewers: colours must stand out from it.
const BACKGROUND: [u8; 3] = [0x14, 0x16, 0x1A];

/// What is arranged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Arrangement {
    /// The learners side by side above; below, the curves, DIRECT's partition and the note.
    Whole,
    /// The learners alone, for a page that has curves of its own. DIRECT's partition and the note fill a gap.
    Scene,
}

/// An arrangement as messages.
pub(super) fn messages(
    description: &Description,
    learners: &[&EntityPath],
    scene: &Scene,
    arrangement: Arrangement,
    application: ApplicationId,
) -> Result<Vec<LogMsg>, RecordingError> {
    let arms = arms(description, learners, scene);
    let partitions = partitions(description, learners);
    let note = View::new("TextDocument", "Note", &EntityPath::from("note")).into();
    let root = match arrangement {
        Arrangement::Whole => {
            let columns = arms.len().clamp(1, 3) as u32;
            let mut below = charts(description, learners);
            let limits = limits(description, learners);
            below.push(Container::tabs(partitions.into_iter().chain(limits).chain([note])).into());
            Container::vertical(
                [Container::grid(arms, columns).into(), Container::horizontal(below).into()],
                [3.0, 2.0],
            )
        }
        Arrangement::Scene => {
            // Two stand one above the other: an arm is rather wide than high, and so is a view of half the height.
            let columns = if arms.len() > 2 { 2 } else { 1 };
            let mut views = arms;
            if !views.len().is_multiple_of(columns) {
                views.push(Container::tabs(partitions.into_iter().chain([note])).into());
            }
            Container::grid(views, columns as u32)
        }
    };
    root.messages(application)
}

/// A view of each learner's estimate beside the truth.
fn arms(description: &Description, learners: &[&EntityPath], scene: &Scene) -> Vec<Part> {
    let eye = EyeControls3D::new()
        .with_position(single(std::array::from_fn(|i| scene.centre_m[i] + CAMERA[i] * scene.size_m)))
        .with_look_target(single(scene.centre_m));
    let views = learners.iter().zip(&description.learners).map(|(root, learner)| {
        let title = format!("{} ({} × {})", learner.name, learner.estimator, learner.policy);
        let contents = [
            "+ /world/truth/**".to_owned(),
            "+ /world/head/**".to_owned(),
            format!("+ {root}/**"),
            format!("- {root}/direct/**"),
            format!("- {root}/metrics/**"),
        ];
        View::new("3D", &title, &EntityPath::root())
            .with_contents(contents)
            .with(&eye)
            .with(&Background::new(BackgroundKind::SolidColor).with_color(BACKGROUND))
            .with(&LineGrid3D::new().with_visible(false))
            .into()
    });
    views.collect()
}

/// The curves of all learners, metric by metric.
fn charts(description: &Description, learners: &[&EntityPath]) -> Vec<Part> {
    let charts: &[(&str, &str)] = if description.truth.is_some() { &CHARTS } else { &CHARTS_WITHOUT_TRUTH };
    let views = charts
        .iter()
        .map(|(title, metric)| chart(title, learners.iter().map(|root| format!("+ {root}/metrics/{metric}"))));
    views.collect()
}

/// The traces of all learners beside their limits, where the truth is known.
fn limits(description: &Description, learners: &[&EntityPath]) -> Option<Part> {
    description.truth.as_ref()?;
    let of_learner = |root: &&EntityPath| TRACE.1.map(|metric| format!("+ {root}/metrics/{metric}"));
    Some(chart(TRACE.0, learners.iter().flat_map(of_learner).chain([format!("+ /{BEST_DESIGN}")])))
}

fn chart(title: &str, contents: impl IntoIterator<Item = String>) -> Part {
    View::new("TimeSeries", title, &EntityPath::root())
        .with_contents(contents)
        .with(&PlotLegend::new().with_corner(Corner2D::RightTop))
        .into()
}

/// The partitions of those who have any: the joint box is divided by DIRECT, recorded movements are tried one by one.
fn partitions(description: &Description, learners: &[&EntityPath]) -> Vec<Part> {
    let divides = |policy: &str| policy.starts_with("active") && description.movements_available.is_none();
    let views = learners.iter().zip(&description.learners).filter(|(_, learner)| divides(&learner.policy));
    let views = views.map(|(root, _)| {
        let name = root.last().map(|part| part.ui_string()).unwrap_or_default();
        let bounds = Range2D { x_range: [-0.08, 1.08].into(), y_range: [-0.16, 1.16].into() };
        View::new("2D", &format!("DIRECT, {name}"), &root.join(&EntityPath::from("direct")))
            .with(&Bounds::new(VisualBounds2D(bounds)))
            .into()
    });
    views.collect()
}
