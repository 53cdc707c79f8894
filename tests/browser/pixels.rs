//! What a screenshot shows.

use std::io::Cursor;

use body_schema::recording::{learner_color, learner_slots};

/// The learners that the page compares unless told otherwise.
const LEARNERS: usize = 3;
const NAMES: [&str; LEARNERS] = ["active", "random", "global"];
/// How far a pixel's hue may be from its learner's, degrees: bodies are shaded, and clouds lie over them.
const HUE: f64 = 15.0;
/// What is less colourful than this is a cloud, a label or grey.
const COLOURFUL: f64 = 0.5;
/// How far a channel must have moved for a pixel to be another: edges are smoothed.
const TOLERANCE: u8 = 40;
/// So many pixels are an arm, not a label.
const ARM: usize = 150;

/// The part of a screenshot in which the scene is.
pub struct Picture(Vec<[u8; 3]>);

impl Picture {
    /// The scene that begins so many pixels from the left and the upper edge, and the legend at its lower edge, which is
    /// so high, left out.
    pub fn of_scene(png: &[u8], [left, top]: [usize; 2], legend: usize) -> Self {
        let mut decoder = png::Decoder::new(Cursor::new(png));
        decoder.set_transformations(png::Transformations::normalize_to_color8());
        let mut reader = decoder.read_info().expect("a picture");
        let mut bytes = vec![0; reader.output_buffer_size().expect("a size")];
        let info = reader.next_frame(&mut bytes).expect("a frame");
        let (width, height) = (info.width as usize, info.height as usize);
        let samples = info.color_type.samples();
        let rows = bytes.chunks(info.line_size).take(height - legend).skip(top);
        let pixels = rows.flat_map(|row| row.chunks(samples).take(width).skip(left));
        Self(pixels.map(|pixel| [pixel[0], pixel[1], pixel[2]]).collect())
    }

    /// How many pixels have each learner's colour.
    pub fn counts(&self) -> [usize; LEARNERS] {
        let slots = learner_slots(NAMES);
        std::array::from_fn(|learner| {
            let (hue, _) = hue_and_saturation(learner_color(slots[learner]));
            let is_near = |pixel: &&[u8; 3]| {
                let (other, saturation) = hue_and_saturation(**pixel);
                let apart = (other - hue).rem_euclid(360.0);
                saturation >= COLOURFUL && apart.min(360.0 - apart) <= HUE
            };
            self.0.iter().filter(is_near).count()
        })
    }

    pub fn shows_all_learners(&self) -> bool {
        self.counts().iter().all(|count| *count >= ARM)
    }

    /// Whether the arm of a learner is drawn.
    pub fn shows(&self, learner: &str) -> bool {
        NAMES.iter().position(|name| *name == learner).is_some_and(|index| self.counts()[index] >= ARM)
    }

    /// Whether something as large as an arm has changed.
    pub fn differs_from(&self, other: &Self) -> bool {
        let apart = |(a, b): (&[u8; 3], &[u8; 3])| a.iter().zip(b).any(|(a, b)| a.abs_diff(*b) > TOLERANCE);
        self.0.iter().zip(&other.0).filter(|pair| apart(*pair)).count() >= ARM
    }
}

/// A colour's hue, degrees, and its saturation in 0..=1.
fn hue_and_saturation(colour: [u8; 3]) -> (f64, f64) {
    let [red, green, blue] = colour.map(f64::from);
    let most = red.max(green).max(blue);
    let range = most - red.min(green).min(blue);
    if range == 0.0 {
        return (0.0, 0.0);
    }
    let hue = if most == red {
        (green - blue) / range
    } else if most == green {
        2.0 + (blue - red) / range
    } else {
        4.0 + (red - green) / range
    };
    (60.0 * hue, range / most)
}
