//! Errors of predictions, row by row and in figures.

use std::{
    collections::{BTreeMap, BTreeSet},
    fmt,
};

use nalgebra::Point3;
use serde::{Deserialize, Serialize};

use super::{Case, Fit, Reading, fit::mean};
use body_schema_engine::{
    model::Links,
    sensing::{Occasion, ResidualNorms},
};

/// The residual of a reading.
#[derive(Clone, Debug, PartialEq)]
pub struct Residual {
    /// The row.
    pub row: usize,
    /// What was sensed.
    pub sensor: Sensed,
    /// The prediction, in the channel's own units.
    pub predicted: Vec<f64>,
    /// The measurement.
    pub measured: Vec<f64>,
    /// The difference, in physical units.
    pub norms: ResidualNorms,
}

/// The source of a reading.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Sensed {
    /// A channel of the measurement model, by its number.
    Channel(usize),
    /// A socket that held a target, by its number.
    Socket(usize),
}

/// Mean, root mean square and maximum of errors.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Figures {
    /// The number of readings.
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
    /// The figures of some residuals.
    pub fn of<'a>(residuals: impl IntoIterator<Item = &'a Residual>) -> Self {
        let residuals: Vec<&Residual> = residuals.into_iter().collect();
        let figures = |of: &dyn Fn(&ResidualNorms) -> Option<f64>| {
            let errors: Vec<f64> = residuals.iter().filter_map(|residual| of(&residual.norms)).collect();
            let count = errors.len() as f64;
            (!errors.is_empty()).then(|| {
                let mean = errors.iter().sum::<f64>() / count;
                let rms = (errors.iter().map(|error| error * error).sum::<f64>() / count).sqrt();
                (mean, rms, errors.iter().copied().fold(0.0, f64::max))
            })
        };
        let mm = figures(&|norms| Unit::Millimetres.of(norms));
        let deg = figures(&|norms| Unit::Degrees.of(norms));
        let px = figures(&|norms| Unit::Pixels.of(norms));
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

    /// The mean by which fits are compared, in their [`unit`](Self::unit).
    pub fn mean(&self) -> Option<f64> {
        self.told(self.unit())[0]
    }

    /// The unit in which they are reported.
    pub fn unit(&self) -> Unit {
        match (self.mean_mm, self.mean_px) {
            (Some(_), _) => Unit::Millimetres,
            (None, Some(_)) => Unit::Pixels,
            (None, None) => Unit::Degrees,
        }
    }

    /// Mean, root mean square and maximum in a unit.
    pub fn told(&self, unit: Unit) -> [Option<f64>; 3] {
        match unit {
            Unit::Millimetres => [self.mean_mm, self.rms_mm, self.max_mm],
            Unit::Pixels => [self.mean_px, self.rms_px, self.max_px],
            Unit::Degrees => [self.mean_deg, self.rms_deg, self.max_deg],
        }
    }
}

/// The one unit in which the errors of a table are compared: that of lengths where any was measured, otherwise of pictures,
/// otherwise of rotations. Readings without it do not count.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Unit {
    /// Millimetres.
    #[serde(rename = "mm")]
    Millimetres,
    /// Pixels.
    #[serde(rename = "px")]
    Pixels,
    /// Degrees.
    #[serde(rename = "deg")]
    Degrees,
}

impl Unit {
    /// A residual in this unit.
    pub fn of(self, norms: &ResidualNorms) -> Option<f64> {
        match self {
            Self::Millimetres => norms.length_m.map(|metres| metres * 1e3),
            Self::Pixels => norms.pixels,
            Self::Degrees => norms.angle_rad.map(f64::to_degrees),
        }
    }

    /// A reported reading's residual in this unit.
    pub fn of_reading(self, reading: &Reading) -> Option<f64> {
        match self {
            Self::Millimetres => reading.residual_mm,
            Self::Pixels => reading.residual_px,
            Self::Degrees => reading.residual_deg,
        }
    }
}

impl fmt::Display for Unit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Millimetres => "mm",
            Self::Pixels => "px",
            Self::Degrees => "deg",
        })
    }
}

impl Case<'_> {
    /// The residuals of `rows` under a fit, whether it learned from them or not.
    ///
    /// A target that was held in a socket is compared with the socket's fitted position; if no row was learned from that
    /// socket, with its own mean over `rows` there.
    pub fn residuals(&self, fit: &Fit, rows: &[usize]) -> Vec<Residual> {
        let state = fit.state();
        let sockets = self.sockets(fit, rows);
        let (mut links, mut residuals) = (Links::new(state), Vec::new());
        for &index in rows {
            let row = &self.rows[index];
            links.at(&row.positions);
            for (channel, (sensor, reading)) in
                self.measurement_model.sensors().iter().zip(&row.observation.readings).enumerate()
            {
                let (Some(measured), Occasion::Always) = (reading, sensor.subject().occasion) else { continue };
                let mut predicted = vec![0.0; measured.len()];
                if sensor.channel().extended(&links, &mut predicted) {
                    let (sensor, norms) =
                        (Sensed::Channel(channel), sensor.subject().residual_norms(measured, &predicted));
                    residuals.push(Residual { row: index, sensor, predicted, measured: measured.clone(), norms });
                }
            }
            let Some((socket, target)) = self.held(row) else { continue };
            let Some(place) = sockets.get(&socket) else { continue };
            let predicted = Point3::from(links.target(target));
            residuals.push(Residual {
                row: index,
                sensor: Sensed::Socket(socket),
                predicted: predicted.coords.as_slice().to_vec(),
                measured: place.coords.as_slice().to_vec(),
                norms: ResidualNorms { length_m: Some((predicted - place).norm()), ..ResidualNorms::default() },
            });
        }
        residuals
    }

    /// The positions of the sockets of `rows`, by number.
    fn sockets(&self, fit: &Fit, rows: &[usize]) -> BTreeMap<usize, Point3<f64>> {
        let of = |row: &usize| self.held(&self.rows[*row]);
        let learned: BTreeSet<usize> = fit.rows.iter().filter_map(of).map(|(socket, _)| socket).collect();
        let held: BTreeSet<(usize, usize)> = rows.iter().filter_map(of).collect();
        let place = |(socket, target): (usize, usize)| {
            if let (true, Some(place)) = (learned.contains(&socket), fit.state().sockets.get(socket)) {
                return Some((socket, *place));
            }
            let there = rows.iter().map(|row| &self.rows[*row]).filter(|row| row.socket == Some(socket));
            Some((socket, mean(there.map(|row| fit.state().target_at(target, &row.positions)))?))
        };
        held.into_iter().filter_map(place).collect()
    }
}

impl Case<'_> {
    /// The predicted distance between the two sockets of every place that `rows` name.
    pub fn distances(&self, fit: &Fit, rows: &[usize]) -> Vec<SocketDistance> {
        let place = |number: usize| self.scenario.robot.all_sockets().nth(number)?.place.clone();
        let mut by_place: BTreeMap<String, Vec<Point3<f64>>> = BTreeMap::new();
        for (number, point) in self.sockets(fit, rows) {
            by_place.entry(place(number).unwrap_or_default()).or_default().push(point);
        }
        let known_m = self.known.and_then(|known| known.readings.iter().flatten().flatten().next().copied());
        let distance = |(place, points): (String, Vec<Point3<f64>>)| match points[..] {
            [one, other] => Some(SocketDistance {
                place,
                predicted_mm: (one - other).norm() * 1e3,
                known_mm: known_m.map(|m| m * 1e3),
            }),
            _ => None,
        };
        by_place.into_iter().filter_map(distance).collect()
    }
}

/// The distance between the two sockets of one place. It shows how large the robot is, which a scatter alone does not.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SocketDistance {
    /// The place.
    pub place: String,
    /// The distance that the calibrated model predicts, millimetres.
    pub predicted_mm: f64,
    /// The known distance, millimetres.
    pub known_mm: Option<f64>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_worked_by_hand() {
        let residual = |mm: f64, deg: Option<f64>| Residual {
            row: 0,
            sensor: Sensed::Channel(0),
            predicted: vec![],
            measured: vec![],
            norms: ResidualNorms { length_m: Some(mm / 1e3), angle_rad: deg.map(f64::to_radians), pixels: None },
        };
        let figures = Figures::of(&[residual(3.0, Some(1.0)), residual(4.0, None)]);
        let near = |found: Option<f64>, wanted: f64| (found.expect("measured") - wanted).abs() < 1e-12;
        assert!(near(figures.mean_mm, 3.5) && near(figures.rms_mm, 12.5_f64.sqrt()) && near(figures.max_mm, 4.0));
        assert!(near(figures.mean_deg, 1.0) && near(figures.mean(), 3.5));
        assert_eq!((figures.readings, figures.mean_px, figures.unit()), (2, None, Unit::Millimetres));
        assert_eq!(Figures::of(&[]), Figures::default());
    }

    /// A tracker and a camera: millimetres and pixels are never one list.
    #[test]
    fn readings_of_other_units_do_not_count() {
        let length = ResidualNorms { length_m: Some(0.002), ..ResidualNorms::default() };
        let picture = ResidualNorms { pixels: Some(40.0), ..ResidualNorms::default() };
        let residual = |norms: &ResidualNorms| Residual {
            row: 0,
            sensor: Sensed::Channel(0),
            predicted: vec![],
            measured: vec![],
            norms: *norms,
        };
        let figures = Figures::of(&[residual(&length), residual(&picture)]);
        let unit = figures.unit();
        assert_eq!((unit, unit.of(&length), unit.of(&picture)), (Unit::Millimetres, Some(2.0), None));
        assert_eq!((figures.mean(), figures.told(Unit::Pixels)[0]), (Some(2.0), Some(40.0)));
    }
}
