//! The readings of the shown movement, and their residuals for each learner.

use body_schema_wire::{ChannelDescription, ChannelReading};
use egui::{Label, RichText, Ui};

use super::{alarm, learners::swatch};
use crate::{colours, panel::Panel};

/// Of a reading with so many parts each is told, of others the worst.
const FEW: usize = 4;
/// A residual beyond this many standard deviations is marked: noise alone hardly does it.
const FAR: f64 = 4.0;

/// A reading in words: `marker 1.2 σ`, `tag seen by eye 0.9 σ (point 1: 0.8, …)`, `marker 41 σ: outlier, p = 0.98`.
pub fn words(channel: &ChannelDescription, reading: &ChannelReading) -> String {
    let Some(residual) = reading.residual_sigmas else { return format!("{}: not seen", channel.name) };
    let mut text = format!("{} {}", channel.name, sigmas(residual));
    let parts = channel.parts.iter().zip(&reading.parts_sigmas);
    match parts.len() {
        0 | 1 => {}
        2..=FEW => {
            let part = |sigma: &Option<f64>| sigma.map_or_else(|| "not seen".to_owned(), sigmas);
            let parts: Vec<String> = parts.map(|(name, sigma)| format!("{name} {}", part(sigma))).collect();
            text += &format!(" ({})", parts.join(", "));
        }
        _ => {
            let seen = parts.filter_map(|(name, sigma)| Some((name, (*sigma)?)));
            if let Some((name, sigma)) = seen.max_by(|one, other| one.1.total_cmp(&other.1)) {
                text += &format!(" (most at {name}: {})", sigmas(sigma));
            }
        }
    }
    match reading.outlier_probability {
        Some(probability) if reading.is_outlier() => text + &format!(": outlier, p = {probability:.2}"),
        _ => text,
    }
}

/// A number of standard deviations, short.
fn sigmas(value: f64) -> String {
    if value < 9.95 { format!("{value:.1} σ") } else { format!("{value:.0} σ") }
}

impl Panel {
    /// A line for every learner that has moved.
    pub(super) fn readings(&self, ui: &mut Ui) {
        let Some(description) = self.description() else { return };
        let slots = colours::slots(description);
        let learners = (0..description.learners.len()).map(|learner| self.history.readings(self.cursor, learner));
        if learners.clone().all(<[ChannelReading]>::is_empty) {
            return;
        }
        let tip = "How far each reading is from the estimate after it, in standard deviations σ of the sensor's noise: the root \
                   mean square over its coordinates, about 1 where only noise is left.";
        ui.add(Label::new(RichText::new(format!("What was read at step {}", self.cursor)).strong()).wrap())
            .on_hover_text(tip);
        for (readings, slot) in learners.zip(slots).filter(|(readings, _)| !readings.is_empty()) {
            ui.horizontal_wrapped(|ui| {
                swatch(ui, slot);
                for (channel, reading) in
                    readings.iter().filter_map(|reading| Some((description.channels.get(reading.channel)?, reading)))
                {
                    let text = RichText::new(words(channel, reading)).small();
                    let far = reading.is_outlier() || reading.residual_sigmas.is_some_and(|residual| residual > FAR);
                    ui.add(Label::new(if far { text.color(alarm(ui)) } else { text }).wrap()).on_hover_text(tip);
                }
            });
        }
        ui.add_space(4.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn channel(name: &str, parts: usize) -> ChannelDescription {
        let parts = (1..=parts).map(|part| format!("point {part}")).collect();
        ChannelDescription { name: name.to_owned(), equations: 3, parts, camera: None, target: None }
    }

    fn reading(residual: Option<f64>, parts: &[f64], outlier_probability: Option<f64>) -> ChannelReading {
        ChannelReading {
            channel: 0,
            residual_sigmas: residual,
            parts_sigmas: parts.iter().map(|part| Some(*part).filter(|part| part.is_finite())).collect(),
            weight: None,
            outlier_probability,
        }
    }

    #[test]
    fn readings_are_said_in_few_words() {
        let marker = channel("marker", 1);
        assert_eq!(words(&marker, &reading(Some(1.23), &[1.23], Some(0.01))), "marker 1.2 σ");
        assert_eq!(words(&marker, &reading(Some(41.3), &[41.3], Some(0.984))), "marker 41 σ: outlier, p = 0.98");
        assert_eq!(words(&marker, &reading(None, &[], None)), "marker: not seen");
        let pose = channel("pose", 2);
        assert_eq!(words(&pose, &reading(Some(1.0), &[0.8, 1.2], None)), "pose 1.0 σ (point 1 0.8 σ, point 2 1.2 σ)");
        let board = channel("board", 6);
        let far = reading(Some(1.0), &[0.8, 1.2, 0.1, 2.5, 0.3, 0.2], None);
        assert_eq!(words(&board, &far), "board 1.0 σ (most at point 4: 2.5 σ)");
        let half = reading(Some(1.0), &[f64::NAN, 1.2, f64::NAN, 2.5, f64::NAN, f64::NAN], None);
        assert_eq!(words(&board, &half), "board 1.0 σ (most at point 4: 2.5 σ)");
        let one = reading(Some(0.8), &[0.8, f64::NAN], None);
        assert_eq!(words(&pose, &one), "pose 0.8 σ (point 1 0.8 σ, point 2 not seen)");
    }
}
