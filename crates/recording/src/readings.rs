//! The series of readings: their residuals, and the probability that they are outliers.

use super::{
    rerun::{Color, EntityPath, EntityPathPart, SeriesLines},
    rows::Rows,
};
use body_schema_wire::{ChannelReading, Description};

/// The series of one learner, by channel.
pub(super) struct Readings {
    channels: Vec<[EntityPath; 2]>,
}

impl Readings {
    /// The series below the root of a learner.
    pub(super) fn new(root: &EntityPath, description: &Description) -> Self {
        let series = |name: &str| {
            ["residuals", "outliers"].map(|kind| {
                root.join(&EntityPath::from("readings"))
                    .join(&EntityPath::from(kind))
                    .join(&EntityPath::new(vec![EntityPathPart::new(name)]))
            })
        };
        Self { channels: description.channels.iter().map(|channel| series(&channel.name)).collect() }
    }

    /// All series.
    pub(super) fn series(&self) -> impl Iterator<Item = &EntityPath> {
        self.channels.iter().flatten()
    }

    /// Logs the look of the series: in the learner's colour, named by it, and where there are several by their channel.
    pub(super) fn begin(&self, rows: &mut Rows, name: &str, colour: [u8; 3], description: &Description) {
        for (series, channel) in self.channels.iter().zip(&description.channels) {
            let name = match description.channels.as_slice() {
                [_] => name.to_owned(),
                _ => format!("{name}: {}", channel.name),
            };
            let line = SeriesLines::new().with_colors([Color::from(colour)]).with_names([name]).with_widths([1.5]);
            series.iter().for_each(|series| rows.always(series, &[&line]));
        }
    }

    /// Logs the readings of a step; nothing for a miss.
    pub(super) fn log(&self, rows: &mut Rows, step: u64, readings: &[ChannelReading]) {
        for (reading, [residuals, outliers]) in
            readings.iter().filter_map(|it| Some((it, self.channels.get(it.channel)?)))
        {
            for (series, value) in [(residuals, reading.residual_sigmas), (outliers, reading.outlier_probability)] {
                if let Some(value) = value.filter(|value| value.is_finite()) {
                    rows.number(step, series, value);
                }
            }
        }
    }
}
