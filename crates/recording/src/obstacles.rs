//! The obstacles of a robot: the boxes that it keeps out of, and the height below which nothing of it may be.

use nalgebra::{Isometry3, Point3, Vector3};

use super::{
    Appearance,
    body::Figure,
    colours::labelled,
    rerun::{Boxes3D, Color, EntityPath, FillMode, Points3D},
    rows::Rows,
    solid::{single, transform},
};

/// The colour of boxes, which no learner has, and that of the least height: both translucent.
const BOX: [u8; 4] = [0xA8, 0x97, 0x7C, 90];
const LEAST_HEIGHT: [u8; 4] = [0xA8, 0x97, 0x7C, 40];
/// Half the side of the square that shows the least height, and half its thickness, in lengths of the arm.
const SQUARE: [f64; 2] = [0.6, 0.002];

/// The obstacles as they are drawn, in the frame of the nominal base.
pub(super) struct Obstacles {
    boxes: Vec<Drawn>,
}

struct Drawn {
    label: String,
    centre: Point3<f64>,
    half_sizes: Vector3<f64>,
    colour: [u8; 4],
}

impl Obstacles {
    /// The obstacles of a scenario, around a robot of this figure whose base stands at `base`.
    pub(super) fn of(appearance: &Appearance, figure: &Figure, base: &Isometry3<f64>) -> Self {
        let mut boxes: Vec<Drawn> = (appearance.obstacles.iter())
            .map(|obstacle| Drawn {
                label: obstacle.name.clone(),
                centre: nalgebra::center(&obstacle.lower, &obstacle.upper),
                half_sizes: 0.5 * (obstacle.upper - obstacle.lower),
                colour: BOX,
            })
            .collect();
        let shoulder = base.inverse() * figure.shoulder;
        let [half, thin] = SQUARE.map(|lengths| lengths * figure.reach_m);
        boxes.extend(appearance.minimum_height_m.map(|least_m| Drawn {
            label: format!("no lower than {least_m} m"),
            centre: Point3::new(shoulder.x, shoulder.y, least_m),
            half_sizes: Vector3::new(half, half, thin),
            colour: LEAST_HEIGHT,
        }));
        Self { boxes }
    }

    /// Whether there is nothing to draw.
    pub(super) fn is_empty(&self) -> bool {
        self.boxes.is_empty()
    }

    /// Logs them for all times, for a robot whose base stands at `base`.
    pub(super) fn log(&self, rows: &mut Rows, entity: &EntityPath, base: &Isometry3<f64>) {
        let boxes = Boxes3D::from_centers_and_half_sizes(
            self.boxes.iter().map(|drawn| single(drawn.centre.coords.into())),
            self.boxes.iter().map(|drawn| single(drawn.half_sizes.into())),
        )
        .with_colors(
            self.boxes.iter().map(|Drawn { colour: [r, g, b, a], .. }| Color::from_unmultiplied_rgba(*r, *g, *b, *a)),
        )
        .with_labels(self.boxes.iter().map(|drawn| drawn.label.as_str()))
        .with_show_labels(false)
        .with_fill_mode(FillMode::Solid);
        rows.always(entity, &[&boxes, &transform(base)]);
    }

    /// Their names, each above its box, as labels of a colour.
    pub(super) fn names(&self, colour: [u8; 3]) -> Points3D {
        let above = |drawn: &Drawn| single((drawn.centre + Vector3::z() * drawn.half_sizes.z).coords.into());
        labelled(self.boxes.iter().map(above), colour).with_labels(self.boxes.iter().map(|drawn| drawn.label.as_str()))
    }

    /// How far the same boxes must be moved along `way`, a unit vector, so that none is in itself any more, metres.
    pub(super) fn apart_m(&self, base: &Isometry3<f64>, way: &Vector3<f64>) -> f64 {
        let way = base.inverse_transform_vector(way);
        let solid = self.boxes.iter().filter(|drawn| drawn.colour == BOX);
        solid
            .map(|drawn| (0..3).map(|k| 2.0 * drawn.half_sizes[k] / way[k].abs()).fold(f64::INFINITY, f64::min))
            .fold(0.0, f64::max)
    }
}
