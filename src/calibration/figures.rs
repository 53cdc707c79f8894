//! Errors of predictions, row by row and in figures.

use nalgebra::{Point3, Vector3};
use serde::{Deserialize, Serialize};

use super::{Case, Fit};
use crate::{
    model::State,
    sensing::{Apart, Occasion},
};

/// A reading beside what was predicted for it.
#[derive(Clone, Debug, PartialEq)]
pub struct Residual {
    /// The row.
    pub row: usize,
    /// The channel.
    pub channel: usize,
    /// What was predicted, in the channel's own units.
    pub predicted: Vec<f64>,
    /// What was measured.
    pub measured: Vec<f64>,
    /// How far they are apart.
    pub apart: Apart,
}

/// Mean, root mean square and maximum of errors.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Figures {
    /// How many readings.
    pub readings: usize,
    /// Mean distance, millimetres; null where no length was measured.
    pub mean_mm: Option<f64>,
    /// Root mean square, millimetres.
    pub rms_mm: Option<f64>,
    /// The greatest, millimetres.
    pub max_mm: Option<f64>,
    /// Mean angle, degrees; null where no rotation was measured.
    pub mean_deg: Option<f64>,
    /// Root mean square, degrees.
    pub rms_deg: Option<f64>,
    /// The greatest, degrees.
    pub max_deg: Option<f64>,
    /// Mean distance in the picture, pixels; null without pictures.
    pub mean_px: Option<f64>,
    /// Root mean square, pixels.
    pub rms_px: Option<f64>,
    /// The greatest, pixels.
    pub max_px: Option<f64>,
}

impl Figures {
    /// Of some residuals.
    pub fn of<'a>(residuals: impl IntoIterator<Item = &'a Residual>) -> Self {
        let residuals: Vec<&Residual> = residuals.into_iter().collect();
        let figures = |of: &dyn Fn(&Apart) -> Option<f64>| {
            let errors: Vec<f64> = residuals.iter().filter_map(|residual| of(&residual.apart)).collect();
            let count = errors.len() as f64;
            (!errors.is_empty()).then(|| {
                let mean = errors.iter().sum::<f64>() / count;
                let rms = (errors.iter().map(|error| error * error).sum::<f64>() / count).sqrt();
                (mean, rms, errors.iter().copied().fold(0.0, f64::max))
            })
        };
        let mm = figures(&|apart| apart.metres.map(|metres| metres * 1e3));
        let deg = figures(&|apart| apart.radians.map(f64::to_degrees));
        let px = figures(&|apart| apart.pixels);
        Self {
            readings: residuals.len(),
            mean_mm: mm.map(|it| it.0),
            rms_mm: mm.map(|it| it.1),
            max_mm: mm.map(|it| it.2),
            mean_deg: deg.map(|it| it.0),
            rms_deg: deg.map(|it| it.1),
            max_deg: deg.map(|it| it.2),
            mean_px: px.map(|it| it.0),
            rms_px: px.map(|it| it.1),
            max_px: px.map(|it| it.2),
        }
    }

    /// The mean by which fits are compared: of lengths, where any were measured, else of what there is.
    pub fn mean(&self) -> Option<f64> {
        self.mean_mm.or(self.mean_px).or(self.mean_deg)
    }

    /// The unit of [`mean`](Self::mean).
    pub fn unit(&self) -> &'static str {
        match (self.mean_mm, self.mean_px) {
            (Some(_), _) => "mm",
            (None, Some(_)) => "px",
            (None, None) => "deg",
        }
    }
}

impl Case<'_> {
    /// The residuals of `rows` by what was learned from others, or from them. A target that was held in a socket which no
    /// row was learned from is compared with its mean over the rows there: where the socket is nobody knows.
    pub fn residuals(&self, fit: &Fit, rows: &[usize]) -> Vec<Residual> {
        let state = &self.with_unseen_sockets(fit, rows);
        let mut residuals = Vec::new();
        for &index in rows {
            let row = &self.rows[index];
            for (channel, (sensor, reading)) in self.rig.channels().iter().zip(&row.observation.readings).enumerate() {
                let Some(measured) = reading else { continue };
                let mut predicted = vec![0.0; measured.len()];
                if sensor.predict(state, &row.positions, &mut predicted) {
                    let apart = sensor.apart(measured, &predicted);
                    residuals.push(Residual { row: index, channel, predicted, measured: measured.clone(), apart });
                }
            }
        }
        residuals
    }

    fn with_unseen_sockets(&self, fit: &Fit, rows: &[usize]) -> State {
        let mut state = fit.state().clone();
        for (channel, sensor) in self.rig.channels().iter().enumerate() {
            let Occasion::Held { socket, target } = sensor.occasion() else { continue };
            let has_reading = |row: &&usize| self.rows[**row].observation.readings[channel].is_some();
            if fit.rows.iter().any(|row| has_reading(&row)) {
                continue;
            }
            let held = rows.iter().filter(has_reading);
            if let Some(mean) = mean(held.map(|row| state.target_at(target, &self.rows[*row].positions))) {
                state.sockets[socket] = mean;
            }
        }
        state
    }
}

/// The mean of points; `None` of none.
pub fn mean(points: impl Iterator<Item = Point3<f64>>) -> Option<Point3<f64>> {
    let (sum, count) = points.fold((Vector3::zeros(), 0.0), |(sum, count), point| (sum + point.coords, count + 1.0));
    (count > 0.0).then(|| Point3::from(sum / count))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_worked_by_hand() {
        let residual = |mm: f64, deg: Option<f64>| Residual {
            row: 0,
            channel: 0,
            predicted: vec![],
            measured: vec![],
            apart: Apart { metres: Some(mm / 1e3), radians: deg.map(f64::to_radians), pixels: None },
        };
        let figures = Figures::of(&[residual(3.0, Some(1.0)), residual(4.0, None)]);
        let near = |found: Option<f64>, wanted: f64| (found.expect("measured") - wanted).abs() < 1e-12;
        assert!(near(figures.mean_mm, 3.5) && near(figures.rms_mm, 12.5_f64.sqrt()) && near(figures.max_mm, 4.0));
        assert!(near(figures.mean_deg, 1.0) && near(figures.mean(), 3.5));
        assert_eq!((figures.readings, figures.mean_px, figures.unit()), (2, None, "mm"));
        assert_eq!(Figures::of(&[]), Figures::default());
    }
}
