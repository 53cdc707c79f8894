//! Colours that keep their meaning everywhere: one per learner, grey for the truth, a scale for the criterion.

use body_schema_palette::{contrast, mix};

use super::rerun::{Color, Points3D, Radius};

/// A colour moved towards white by `amount` in 0..=1.
pub(super) fn tint(colour: [u8; 3], amount: f64) -> [u8; 3] {
    mix(colour, [0xFF; 3], amount)
}

/// A colour darkened for labels on a light background: the viewer writes labels in their entity's colour.
pub(super) fn label_on_light(colour: [u8; 3]) -> [u8; 3] {
    /// The share of black at which even the palest colour can be read.
    const DARKER: f64 = 0.4;
    mix(colour, [0; 3], DARKER)
}

/// A colour lightened for labels on a dark background.
pub(super) fn label_on_dark(colour: [u8; 3]) -> [u8; 3] {
    /// The share of white at which even the darkest colour can be read.
    const LIGHTER: f64 = 0.6;
    tint(colour, LIGHTER)
}

/// A colour darkened for labels of files, whose scene is light, in a viewer whose theme may be dark: its veil is grey then.
pub(super) fn label_in_file(colour: [u8; 3]) -> [u8; 3] {
    /// That grey, as measured in a screenshot.
    const VEIL: [u8; 3] = [0x90, 0x90, 0x91];
    let mut darker = (0..=64).map(|step| mix(colour, [0; 3], f64::from(step) / 64.0));
    darker.find(|colour| contrast(*colour, VEIL) >= READABLE).unwrap_or([0; 3])
}

/// Points too small to be seen, whose labels are shown in a colour.
pub(super) fn labelled(places: impl IntoIterator<Item = [f32; 3]>, colour: [u8; 3]) -> Points3D {
    Points3D::new(places)
        .with_colors([Color::from(colour)])
        .with_radii([Radius::new_scene_units(1e-3)])
        .with_show_labels(true)
}

/// The contrast with which text can be read (WCAG 2.2, AA).
const READABLE: f64 = 4.5;

#[cfg(test)]
mod tests {
    use body_schema_palette::{hex, learner_color};

    use super::*;

    /// The colours behind labels, as measured in screenshots: the viewer lays a veil of its own theme between them and
    /// the scene's background.
    const LABEL_GROUNDS: [[u8; 3]; 2] = [[0xEA, 0xEA, 0xEB], [0x24, 0x24, 0x26]];

    #[test]
    fn labels_can_be_read_on_light_and_dark_ground() {
        for colour in (0..12).map(learner_color).chain([super::super::movement::ERROR]) {
            let labels = [label_on_light(colour), label_on_dark(colour)];
            for (label, ground) in labels.into_iter().zip(LABEL_GROUNDS) {
                let contrast = contrast(label, ground);
                assert!(contrast >= READABLE, "{colour:02X?} on {ground:02X?}: {contrast:.2}");
            }
        }
    }

    #[test]
    fn labels_of_files_can_be_read_in_either_theme() {
        for colour in (0..12).map(learner_color).chain([super::super::movement::ERROR, super::super::TRUTH_COLOR]) {
            let label = label_in_file(colour);
            for ground in [LABEL_GROUNDS[0], [0x90, 0x90, 0x91]] {
                assert!(contrast(label, ground) >= READABLE, "{label:02X?} on {ground:02X?}");
            }
        }
    }

    #[test]
    fn colours_are_written_in_hexadecimal() {
        assert_eq!(hex(learner_color(0)), "#0072b2");
    }
}
