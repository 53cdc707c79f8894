//! How a viewer arranges a recording when it opens it.

use rerun::{
    AsComponents, RecordingStreamBuilder, Timeline,
    blueprint::{
        Blueprint, BlueprintActivation, BlueprintPanel, ContainerLike, Grid, Horizontal, SelectionPanel, Spatial2DView,
        Spatial3DView, Tabs, TextDocumentView, TimePanel, TimeSeriesView, Vertical,
        components::{BackgroundKind, Corner2D, PanelState, PlayState, VisualBounds2D},
    },
    datatypes::Range2D,
    external::{
        re_log_types::{ApplicationId, BlueprintActivationCommand, EntityPath, LogMsg},
        re_sdk_types::blueprint::archetypes::{
            Background, EyeControls3D, LineGrid3D, PlotLegend, VisualBounds2D as Bounds,
        },
    },
    log::{Chunk, RowId},
};

use super::{RecordingError, model::single, recorder::BEST_DESIGN, scene::Scene};
use crate::experiment::Description;

/// Where the camera stands, as seen from the scene's centre, in sizes of the arm: aside, a little ahead and above.
const CAMERA: [f64; 3] = [0.6, -2.0, 1.05];

/// The ground of the arms, the same in light and dark viewers: colours must stand out from it.
const BACKGROUND: [u8; 3] = [0x14, 0x16, 0x1A];

/// Titles and metrics of the curves.
const CHARTS: [(&str, &str); 3] = [
    ("Orientation error (deg)", "orientation_deg"),
    ("Location error (m)", "location_m"),
    ("Prediction error, mean (m)", "prediction_mean_m"),
];

/// The same where no truth is known.
const CHARTS_WITHOUT_TRUTH: [(&str, &str); 2] =
    [("Prediction error, mean (m)", "prediction_mean_m"), ("Trace of the covariance, tr(W P)", "trace")];

/// The trace beside its limits, in a tab where the truth is known.
const TRACE: (&str, [&str; 2]) = ("Trace, and the least possible", ["trace", "bound_trace"]);

/// Whether a metric has its curve in some arrangement.
pub(super) fn shows(metric: &str) -> bool {
    TRACE.1.contains(&metric) || CHARTS.iter().chain(&CHARTS_WITHOUT_TRUTH).any(|(_, shown)| *shown == metric)
}

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
    let mut properties = Properties::default();
    let arms = arms(description, learners, scene, &mut properties);
    let partitions = partitions(description, learners, &mut properties);
    let note = || -> ContainerLike { TextDocumentView::new("Note").with_origin("/note").into() };
    let root: ContainerLike = match arrangement {
        Arrangement::Whole => {
            let columns = arms.len().clamp(1, 3) as u32;
            let mut below = charts(description, learners, &mut properties);
            let limits = limits(description, learners, &mut properties);
            below.push(Tabs::new(partitions.into_iter().chain(limits).chain([note()])).into());
            let above = Grid::new(arms).with_grid_columns(columns);
            Vertical::new([above.into(), Horizontal::new(below).into()]).with_row_shares(vec![3.0, 2.0]).into()
        }
        Arrangement::Scene => {
            // Two stand one above the other: an arm is rather wide than high, and so is a view of half the height.
            let columns = if arms.len() > 2 { 2 } else { 1 };
            let mut views = arms;
            if !views.len().is_multiple_of(columns) {
                views.push(Tabs::new(partitions.into_iter().chain([note()])).into());
            }
            Grid::new(views).with_grid_columns(columns as u32).into()
        }
    };
    let blueprint = Blueprint::new(root)
        .with_auto_views(false)
        .with_auto_layout(false)
        .with_blueprint_panel(BlueprintPanel::from_state(PanelState::Hidden))
        .with_selection_panel(SelectionPanel::from_state(PanelState::Hidden))
        .with_time_panel(
            TimePanel::new()
                .with_state(PanelState::Collapsed)
                .with_timeline(super::TIMELINE)
                .with_play_state(PlayState::Following),
        );
    encode(&blueprint, properties, application)
}

/// A view of each learner's estimate beside the truth.
fn arms(
    description: &Description,
    learners: &[&EntityPath],
    scene: &Scene,
    properties: &mut Properties,
) -> Vec<ContainerLike> {
    let views = learners.iter().zip(&description.learners).map(|(root, learner)| {
        let name = format!("{} ({} × {})", learner.name, learner.estimator, learner.policy);
        let view = Spatial3DView::new(name).with_origin("/").with_contents([
            "+ /world/truth/**".to_owned(),
            "+ /world/head/**".to_owned(),
            format!("+ {root}/**"),
            format!("- {root}/direct/**"),
            format!("- {root}/metrics/**"),
        ]);
        let eye = EyeControls3D::new()
            .with_position(single(std::array::from_fn(|i| scene.centre_m[i] + CAMERA[i] * scene.size_m)))
            .with_look_target(single(scene.centre_m));
        let view = properties.of(view.into(), "EyeControls3D", &eye);
        let view =
            properties.of(view, "Background", &Background::new(BackgroundKind::SolidColor).with_color(BACKGROUND));
        properties.of(view, "LineGrid3D", &LineGrid3D::new().with_visible(false))
    });
    views.collect()
}

/// The curves of all learners, metric by metric.
fn charts(description: &Description, learners: &[&EntityPath], properties: &mut Properties) -> Vec<ContainerLike> {
    let charts: &[(&str, &str)] = if description.truth.is_some() { &CHARTS } else { &CHARTS_WITHOUT_TRUTH };
    let views = charts.iter().map(|(title, metric)| {
        let contents = learners.iter().map(|root| format!("+ {root}/metrics/{metric}"));
        let view = TimeSeriesView::new(*title).with_origin("/").with_contents(contents);
        properties.of(view.into(), "PlotLegend", &PlotLegend::new().with_corner(Corner2D::RightTop))
    });
    views.collect()
}

/// The traces of all learners beside their limits, where the truth is known.
fn limits(description: &Description, learners: &[&EntityPath], properties: &mut Properties) -> Option<ContainerLike> {
    description.truth.as_ref()?;
    let of_learner = |root: &&EntityPath| TRACE.1.map(|metric| format!("+ {root}/metrics/{metric}"));
    let contents = learners.iter().flat_map(of_learner).chain([format!("+ /{BEST_DESIGN}")]);
    let view = TimeSeriesView::new(TRACE.0).with_origin("/").with_contents(contents);
    Some(properties.of(view.into(), "PlotLegend", &PlotLegend::new().with_corner(Corner2D::RightTop)))
}

/// The partitions of those who have any: a box is divided by DIRECT, recorded movements are tried one by one.
fn partitions(description: &Description, learners: &[&EntityPath], properties: &mut Properties) -> Vec<ContainerLike> {
    let divides = |policy: &str| policy.starts_with("active") && description.movements_available.is_none();
    let views = learners.iter().zip(&description.learners).filter(|(_, learner)| divides(&learner.policy));
    let views = views.map(|(root, _)| {
        let name = root.last().map(|part| part.ui_string()).unwrap_or_default();
        let view = Spatial2DView::new(format!("DIRECT, {name}")).with_origin(root.join(&EntityPath::from("direct")));
        let bounds = Range2D { x_range: [-0.08, 1.08].into(), y_range: [-0.16, 1.16].into() };
        properties.of(view.into(), "VisualBounds2D", &Bounds::new(VisualBounds2D(bounds)))
    });
    views.collect()
}

/// Properties of views for which Rerun's Rust builders have no method; they are logged beside what the builders log.
#[derive(Default)]
struct Properties(Vec<(EntityPath, Vec<rerun::SerializedComponentBatch>)>);

impl Properties {
    /// Gives `view` a property and returns it.
    fn of(&mut self, view: ContainerLike, name: &str, property: &dyn AsComponents) -> ContainerLike {
        if let ContainerLike::View(view) = &view {
            let path = view.blueprint_path().join(&EntityPath::from(name));
            self.0.push((path, property.as_serialized_batches()));
        }
        view
    }
}

fn encode(
    blueprint: &Blueprint,
    properties: Properties,
    application: ApplicationId,
) -> Result<Vec<LogMsg>, RecordingError> {
    let failed = |error: rerun::RecordingStreamError| RecordingError::Encode(error.to_string());
    // The builders write to a stream of Rerun's: one in memory, whose own recording is left out.
    let (stream, storage) = RecordingStreamBuilder::new(application).memory().map_err(failed)?;
    blueprint.send(&stream, BlueprintActivation::default()).map_err(failed)?;
    let mut messages: Vec<LogMsg> =
        storage.take().into_iter().filter(|message| message.store_id().is_blueprint()).collect();
    let Some(store) = messages.first().map(|message| message.store_id().clone()) else {
        return Err(RecordingError::Encode("Rerun gave no blueprint".to_owned()));
    };
    // The activation comes last.
    messages.retain(|message| !matches!(message, LogMsg::BlueprintActivationCommand(_)));
    for (path, components) in properties.0 {
        let chunk = Chunk::builder(path)
            .with_serialized_batches(RowId::new(), [(Timeline::new_sequence("blueprint"), 0)], components)
            .build()?;
        messages.push(LogMsg::ArrowMsg(store.clone(), chunk.to_arrow_msg()?));
    }
    messages.push(BlueprintActivationCommand { blueprint_id: store, make_active: true, make_default: true }.into());
    Ok(messages)
}
