//! What a screenshot shows.

use std::io::Cursor;

use body_schema::recording::learner_color;

const LEARNERS: usize = 3;
/// Learners' views stand side by side above the curves, which have the same colours; this is their share of the height.
const SCENES: f64 = 0.5;
/// How far a channel may be from its colour: edges are smoothed and bodies shaded.
const TOLERANCE: u8 = 40;
/// So many pixels are an arm, not a label.
const ARM: usize = 150;

/// The part of a screenshot in which the learners' arms are.
pub struct Picture {
    width: usize,
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
        let below = top + 30;
        let scenes = below..top + ((height - top) as f64 * SCENES) as usize;
        let rows = bytes.chunks(info.line_size).enumerate().filter(|(row, _)| scenes.contains(row));
        let pixels = rows
            .flat_map(|(_, row)| row.chunks(samples).take(width).skip(left))
            .map(|pixel| [pixel[0], pixel[1], pixel[2]]);
        Self { width: width - left, pixels: pixels.collect() }
    }

    /// How many pixels of its own colour each learner's view has.
    pub fn counts(&self) -> [usize; LEARNERS] {
        std::array::from_fn(|learner| {
            let colour = learner_color(learner);
            let near = |pixel: &[u8; 3]| pixel.iter().zip(colour).all(|(a, b)| a.abs_diff(b) <= TOLERANCE);
            let in_view = |index: usize| index % self.width * LEARNERS / self.width == learner;
            self.pixels.iter().enumerate().filter(|(index, pixel)| in_view(*index) && near(pixel)).count()
        })
    }

    pub fn shows_all_learners(&self) -> bool {
        self.counts().iter().all(|count| *count >= ARM)
    }

    /// Whether every learner's view has changed.
    pub fn differs_from(&self, other: &Self) -> bool {
        let mut changed = [0; LEARNERS];
        for (index, (a, b)) in self.pixels.iter().zip(&other.pixels).enumerate() {
            if a.iter().zip(b).any(|(a, b)| a.abs_diff(*b) > TOLERANCE) {
                changed[index % self.width * LEARNERS / self.width] += 1;
            }
        }
        changed.iter().all(|count| *count >= ARM)
    }
}
