//! What a screenshot shows.

use std::io::Cursor;

use body_schema::recording::{learner_color, learner_slots};

const LEARNERS: usize = 3;
const NAMES: [&str; LEARNERS] = ["active", "random", "gradient"];
/// Three learners' views stand in two columns and two rows; DIRECT's partition is in the last place.
const COLUMNS: usize = 2;
const ROWS: usize = 2;
/// Titles above a view and the time below all of them, pixels.
const MARGIN: usize = 40;
/// How far a channel may be from its colour: edges are smoothed and bodies shaded.
const TOLERANCE: u8 = 40;
/// So many pixels are an arm, not a label.
const ARM: usize = 150;

/// The part of a screenshot in which the learners' arms are.
pub struct Picture {
    width: usize,
    height: usize,
    pixels: Vec<[u8; 3]>,
}

impl Picture {
    /// The scenes of a viewer that begins so many pixels from the left and the upper edge.
    pub fn of_scene(png: &[u8], left: usize, top: usize) -> Self {
        let mut decoder = png::Decoder::new(Cursor::new(png));
        decoder.set_transformations(png::Transformations::normalize_to_color8());
        let mut reader = decoder.read_info().expect("a picture");
        let mut bytes = vec![0; reader.output_buffer_size().expect("a size")];
        let info = reader.next_frame(&mut bytes).expect("a frame");
        let (width, height) = (info.width as usize, info.height as usize);
        let samples = info.color_type.samples();
        let rows = bytes.chunks(info.line_size).take(height).skip(top);
        let pixels =
            rows.flat_map(|row| row.chunks(samples).take(width).skip(left)).map(|pixel| [pixel[0], pixel[1], pixel[2]]);
        Self { width: width - left, height: height - top, pixels: pixels.collect() }
    }

    /// How many pixels of its own colour each learner's view has.
    pub fn counts(&self) -> [usize; LEARNERS] {
        let slots = learner_slots(NAMES);
        std::array::from_fn(|learner| {
            let colour = learner_color(slots[learner]);
            let near = |pixel: &[u8; 3]| pixel.iter().zip(colour).all(|(a, b)| a.abs_diff(b) <= TOLERANCE);
            let in_view = |index: usize| self.learner(index) == Some(learner);
            self.pixels.iter().enumerate().filter(|(index, pixel)| in_view(*index) && near(pixel)).count()
        })
    }

    /// In whose view a pixel is.
    fn learner(&self, index: usize) -> Option<usize> {
        let (row, column) = (index / self.width, index % self.width);
        let height = self.height / ROWS;
        let view = row / height * COLUMNS + column * COLUMNS / self.width;
        let inside = (MARGIN..height.saturating_sub(MARGIN)).contains(&(row % height));
        (inside && view < LEARNERS).then_some(view)
    }

    pub fn shows_all_learners(&self) -> bool {
        self.counts().iter().all(|count| *count >= ARM)
    }

    /// Whether every learner's view has changed.
    pub fn differs_from(&self, other: &Self) -> bool {
        let mut changed = [0; LEARNERS];
        for (index, (a, b)) in self.pixels.iter().zip(&other.pixels).enumerate() {
            if a.iter().zip(b).any(|(a, b)| a.abs_diff(*b) > TOLERANCE) {
                self.learner(index).into_iter().for_each(|learner| changed[learner] += 1);
            }
        }
        changed.iter().all(|count| *count >= ARM)
    }
}
