//! What a reading is about: its target, its camera, when it is read, and of which parts it consists.

use std::ops::Range;

use nalgebra::{Point3, UnitQuaternion, Vector3};

use crate::{elementary::hypot, model::Hand};

/// What a reading of a channel is about. Everything that names, groups or compares readings goes by it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Subject {
    /// The target that is measured, if one is.
    pub target: Option<usize>,
    /// The camera in whose picture the target is measured, if it is in one.
    pub camera: Option<usize>,
    /// The part of the robot in whose frame, or from which, the target is measured; `None` for the frame of the measurements, and for a
    /// picture.
    pub seen_from: Option<Hand>,
    /// When there is a reading.
    pub occasion: Occasion,
    /// The parts of a reading, in its order.
    pub parts: Vec<Part>,
    /// Whether some postures are out of view: [`Channel::clearance`](super::Channel::clearance) then returns a number.
    pub has_view: bool,
    /// The least number of points of a reading, where some may be absent: their numbers are then NaN. `None` where a reading is whole.
    pub least_points: Option<usize>,
}

/// A part of a reading: a quantity of one unit. Its equations have a noise of their own, whose scale can be learned.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// The position of the target's origin in the frame in which it is measured: three coordinates, metres.
    Position,
    /// The rotation of the target in the frame in which it is measured: a rotation vector, three numbers, radians.
    Rotation,
    /// So many lengths, metres.
    Lengths(usize),
    /// The norm of a vector x, metres, such as a distance: one equation. Its rows are those of half its square, xᵀ ∂x/∂δ, and are divided
    /// by the norm when they are divided by σ: that rounds once.
    Norm,
    /// So many known points of the target in the camera's picture: u, v of each, pixels.
    Picture(usize),
    /// Another quantity.
    Other {
        /// The number of its equations.
        equations: usize,
        /// Its unit.
        unit: &'static str,
    },
}

/// When a channel has a reading.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Occasion {
    /// After every movement at which it sees its target.
    #[default]
    Always,
    /// After a movement that holds a target in a socket.
    Held {
        /// The socket.
        socket: usize,
        /// The target.
        target: usize,
    },
    /// Once, before any movement: what is known of the equipment.
    Beforehand,
}

/// The residual between two readings of a channel, in physical units. It is `None` for a quantity that the channel does not
/// measure.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ResidualNorms {
    /// The distance of places or the difference of lengths, metres.
    pub length_m: Option<f64>,
    /// The angle between rotations, radians.
    pub angle_rad: Option<f64>,
    /// The distance in the picture, pixels, mean over the points that are seen.
    pub pixels: Option<f64>,
}

impl Part {
    /// The number of its equations.
    pub fn equations(self) -> usize {
        match self {
            Self::Position | Self::Rotation => 3,
            Self::Norm => 1,
            Self::Lengths(count) => count,
            Self::Picture(points) => 2 * points,
            Self::Other { equations, .. } => equations,
        }
    }

    /// The unit of its numbers.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Position | Self::Norm | Self::Lengths(_) => "m",
            Self::Rotation => "rad",
            Self::Picture(_) => "px",
            Self::Other { unit, .. } => unit,
        }
    }
}

impl Subject {
    /// d, the number of equations of a reading: as many as it has numbers.
    pub fn equations(&self) -> usize {
        self.parts.iter().map(|part| part.equations()).sum()
    }

    /// The parts, each with the place of its equations.
    pub(super) fn places(&self) -> impl Iterator<Item = (&Part, Range<usize>)> {
        self.parts.iter().scan(0, |end, part| {
            let start = *end;
            *end += part.equations();
            Some((part, start..*end))
        })
    }

    /// Whether a reading is the position and the rotation of a target.
    pub fn is_pose(&self) -> bool {
        self.parts == [Part::Position, Part::Rotation]
    }

    /// The target, if a reading is the three coordinates of its origin in the frame of the measurements and nothing else.
    pub fn point(&self) -> Option<usize> {
        self.target.filter(|_| self.seen_from.is_none() && self.parts == [Part::Position])
    }

    /// The camera and the target whose known points it pictures, if it does.
    pub fn sight(&self) -> Option<(usize, usize)> {
        self.camera.zip(self.target)
    }

    /// Where a reading says that a target is in the frame of the measurements, if it says so: the target and its origin, metres.
    pub fn position(&self, reading: &[f64]) -> Option<(usize, Point3<f64>)> {
        let is_measured_there = self.seen_from.is_none() && self.parts.first() == Some(&Part::Position);
        let target = self.target.filter(|_| is_measured_there)?;
        Some((target, Point3::from_slice(reading.get(..3)?)))
    }

    /// Divides the rows of norms (d columns of m numbers) by the norms themselves, which are in the predicted reading.
    pub(super) fn divide_norms(&self, reading: &[f64], rows: &mut [f64]) {
        let m = rows.len() / reading.len().max(1);
        for (_, Range { start, end }) in self.places().filter(|(part, _)| **part == Part::Norm) {
            rows[start * m..end * m].iter_mut().for_each(|x| *x /= reading[start]);
        }
    }

    /// The residual between two readings in physical units, for reports. Contacts, and what is known beforehand, have none.
    pub fn residual_norms(&self, y: &[f64], h: &[f64]) -> ResidualNorms {
        let mut apart = ResidualNorms::default();
        if self.occasion != Occasion::Always {
            return apart;
        }
        for (part, place) in self.places() {
            let (y, h) = (&y[place.clone()], &h[place]);
            match part {
                Part::Position | Part::Norm | Part::Lengths(_) => {
                    let squares: f64 = y.iter().zip(h).map(|(y, h)| (y - h) * (y - h)).sum();
                    apart.length_m = Some(apart.length_m.map_or(squares.sqrt(), |other| hypot(other, squares.sqrt())));
                }
                Part::Rotation => {
                    let [y, h] = [y, h].map(|it| UnitQuaternion::from_scaled_axis(Vector3::from_column_slice(it)));
                    apart.angle_rad = Some(y.angle_to(&h));
                }
                Part::Picture(points) => {
                    let pairs = y.chunks_exact(2).zip(h.chunks_exact(2));
                    let seen = pairs.filter(|(y, h)| y.iter().chain(*h).all(|x| !x.is_nan()));
                    let (total, count) = seen.fold((0.0, 0_usize), |(total, count), (y, h)| {
                        (total + hypot(y[0] - h[0], y[1] - h[1]), count + 1)
                    });
                    apart.pixels = (count > 0 || *points == 0).then(|| total / count.max(1) as f64);
                }
                Part::Other { .. } => {}
            }
        }
        apart
    }
}
