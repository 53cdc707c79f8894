//! What cameras on links see: in the picture of each the known points of its targets, as measured, as predicted and as they truly are.

use body_schema_palette::TRUTH_COLOR;

use super::{
    movement::{ERROR, MEASURED},
    rerun::{Color, EntityPath, EntityPathPart, LineStrips2D, Points2D, Radius},
    rows::Rows,
    values::{Cell, Values},
};
use body_schema_wire::{CameraDescription, Description, ModelReport, Picture};

/// The colour of the frame of a picture.
const FRAME: [u8; 3] = [0x88, 0x8C, 0x94];
/// The entity below a learner's that holds its pictures.
pub(super) const EYE: &str = "eye";

/// The cameras that links carry, by their numbers.
pub(super) fn carried(description: &Description, estimate: &ModelReport) -> Vec<usize> {
    let cameras = estimate.cameras.iter().zip(&description.cameras).enumerate();
    cameras.filter(|(_, (place, _))| place.link.is_some()).map(|(number, _)| number).collect()
}

/// The entity of a camera's pictures below the root of a learner.
pub(super) fn entity(root: &EntityPath, camera: &CameraDescription) -> EntityPath {
    root.join(&EntityPath::from(EYE)).join(&EntityPath::new(vec![EntityPathPart::new(camera.name.as_str())]))
}

/// The pictures of one camera of a learner.
pub(super) struct Eye {
    camera: usize,
    size_px: [f64; 2],
    frame: EntityPath,
    truth: EntityPath,
    predicted: EntityPath,
    measured: EntityPath,
    error: EntityPath,
}

impl Eye {
    /// Those of a camera, by its number.
    pub(super) fn of(root: &EntityPath, description: &Description, camera: usize) -> Option<Self> {
        let described = description.cameras.get(camera)?;
        let root = entity(root, described);
        let [frame, truth, predicted, measured, error] =
            ["frame", "truth", "predicted", "measured", "error"].map(|path| root.join(&EntityPath::from(path)));
        Some(Self { camera, size_px: described.size_px, frame, truth, predicted, measured, error })
    }

    /// Logs what does not change: the frame of the picture.
    pub(super) fn begin(&self, rows: &mut Rows) {
        let [width, height] = self.size_px.map(|side| side as f32);
        let frame = [[0.0, 0.0], [width, 0.0], [width, height], [0.0, height], [0.0, 0.0]];
        let frame = LineStrips2D::new([frame])
            .with_colors([Color::from(FRAME)])
            .with_radii([Radius::new_ui_points(0.75)])
            .with_draw_order(1.0);
        rows.always(&self.frame, &[&frame]);
    }

    /// Logs the pictures of a step; nothing is in them before the first movement, and of a learner that has stopped.
    pub(super) fn log(&self, rows: &mut Rows, step: u64, pictures: &[Picture], colour: [u8; 3]) {
        let own: Vec<&Picture> = pictures.iter().filter(|picture| picture.camera == self.camera).collect();
        let all = |of: fn(&Picture) -> &Option<Vec<[f64; 2]>>| -> Vec<[f32; 2]> {
            let points = own.iter().filter_map(|picture| of(picture).as_ref()).flatten();
            points.filter(|point| is_finite(point)).map(single).collect()
        };
        let clouds = [
            (&self.truth, all(|picture| &picture.true_px), TRUTH_COLOR, 4.5, 10.0),
            (&self.measured, all(|picture| &picture.measured_px), MEASURED, 4.0, 20.0),
            (&self.predicted, all(|picture| &picture.predicted_px), colour, 3.0, 30.0),
        ];
        for (entity, points, colour, radius, order) in clouds {
            let look = || {
                Points2D::update_fields()
                    .with_colors([Color::from(colour)])
                    .with_radii([Radius::new_ui_points(radius)])
                    .with_draw_order(order)
            };
            rows.drawn(step, entity, vec![(Points2D::descriptor_positions(), Values::Pairs(points))], (0, look));
        }
        let ends = own.iter().filter_map(|picture| picture.predicted_px.as_ref().zip(picture.measured_px.as_ref()));
        let ends = ends.flat_map(|(predicted, measured)| predicted.iter().zip(measured));
        let ends: Vec<[[f32; 2]; 2]> = ends
            .filter(|(from, to)| is_finite(from) && is_finite(to))
            .map(|(from, to)| [single(from), single(to)])
            .collect();
        let look = || {
            LineStrips2D::update_fields()
                .with_colors([Color::from(ERROR)])
                .with_radii([Radius::new_ui_points(1.0)])
                .with_draw_order(15.0)
        };
        rows.drawn(step, &self.error, strips(&ends), (0, look));
    }

    /// Logs that nothing is seen of the next movement yet, at `ticks` after a step.
    pub(super) fn clear(&self, rows: &mut Rows, step: u64, ticks: u64) {
        let nothing = Points2D::update_fields().with_positions([[0.0_f32; 2]; 0]);
        for entity in [&self.truth, &self.predicted, &self.measured] {
            rows.after(step, ticks, entity, &[&nothing]);
        }
        rows.after_plain(step, ticks, &self.error, strips(&[]));
    }
}

/// Lines of two ends.
fn strips(ends: &[[[f32; 2]; 2]]) -> Vec<Cell> {
    let lines = Values::Lists(vec![2; ends.len()], Box::new(Values::Pairs(ends.concat())));
    vec![(LineStrips2D::descriptor_strips(), lines)]
}

fn single(point: &[f64; 2]) -> [f32; 2] {
    point.map(|x| x as f32)
}

fn is_finite(point: &[f64; 2]) -> bool {
    point.iter().all(|x| x.is_finite())
}
