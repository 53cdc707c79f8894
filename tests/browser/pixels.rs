//! What a screenshot shows.

use std::{collections::HashSet, io::Cursor};

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
/// So many pixels to each side are of the arm where it is pointed at, and so many places are given.
const AROUND: usize = 2;
const SPOTS: usize = 30;

/// The part of a screenshot in which the scene is.
pub struct Picture {
    pixels: Vec<[u8; 3]>,
    /// How many of them lie side by side.
    width: usize,
}

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
        let pixels = pixels.map(|pixel| [pixel[0], pixel[1], pixel[2]]).collect();
        Self { pixels, width: width - left }
    }

    /// How many pixels have each learner's colour.
    pub fn counts(&self) -> [usize; LEARNERS] {
        NAMES.map(|learner| self.of(learner).count())
    }

    /// The places of the pixels that have a learner's colour.
    fn of(&self, learner: &str) -> impl Iterator<Item = usize> {
        let slot = NAMES.iter().position(|name| *name == learner).map(|index| learner_slots(NAMES)[index]);
        let (hue, _) = hue_and_saturation(learner_color(slot.expect("one of the usual learners")));
        let is_near = move |pixel: &[u8; 3]| {
            let (other, saturation) = hue_and_saturation(*pixel);
            let apart = (other - hue).rem_euclid(360.0);
            saturation >= COLOURFUL && apart.min(360.0 - apart) <= HUE
        };
        self.pixels.iter().enumerate().filter(move |(_, pixel)| is_near(pixel)).map(|(place, _)| place)
    }

    /// Some places within the scene, from its left and upper edge, where a learner's arm is all around.
    pub fn within(&self, learner: &str) -> Vec<[f64; 2]> {
        let all: HashSet<usize> = self.of(learner).collect();
        let around = |place: usize| {
            let rows = (0..=2 * AROUND).map(move |row| (place + row * self.width).checked_sub(AROUND * self.width));
            rows.flat_map(|middle| (0..=2 * AROUND).map(move |column| (middle? + column).checked_sub(AROUND)))
        };
        let is_within = |place: &&usize| around(**place).all(|near| near.is_some_and(|near| all.contains(&near)));
        let mut within: Vec<usize> = all.iter().filter(is_within).copied().collect();
        within.sort_unstable();
        let spread = within.iter().step_by(within.len().div_ceil(SPOTS).max(1));
        spread.map(|place| [(place % self.width) as f64, (place / self.width) as f64]).collect()
    }

    pub fn shows_all_learners(&self) -> bool {
        self.counts().iter().all(|count| *count >= ARM)
    }

    /// Whether the arm of a learner is drawn.
    pub fn shows(&self, learner: &str) -> bool {
        self.of(learner).count() >= ARM
    }

    /// Whether something as large as an arm has changed.
    pub fn differs_from(&self, other: &Self) -> bool {
        let apart = |(a, b): (&[u8; 3], &[u8; 3])| a.iter().zip(b).any(|(a, b)| a.abs_diff(*b) > TOLERANCE);
        self.pixels.iter().zip(&other.pixels).filter(|pair| apart(*pair)).count() >= ARM
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
