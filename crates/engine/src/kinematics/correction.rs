//! A joint's correction: the map from its reading to its position.
//!
//! ```text
//! θ = offset + ratio q + sine sin q + cosine cos q + compliance·τ
//! ```
//!
//! with the reading q (rad or m) and the torques τ of loads. Every one of these numbers multiplies an f(q), its [`Term`], so that it
//! moves all that is behind the joint by f(q) times the joint's twist.

use serde::{Deserialize, Serialize};

use super::{Numbers, Plain};

/// How many loads can bend a joint.
pub const LOADS: usize = 2;

/// The coefficients that turn a joint's reading q into its position θ.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Correction {
    /// The offset, rad or m.
    pub offset: f64,
    /// The factor of the reading, without a unit.
    pub ratio: f64,
    /// The factor of sin q, for an encoder that is mounted off its centre, rad.
    pub sine: f64,
    /// The factor of cos q, rad.
    pub cosine: f64,
    /// Compliance by load: how much the joint gives way, rad per N·m of 1 kg.
    pub compliance: [f64; LOADS],
}

impl Default for Correction {
    fn default() -> Self {
        Self { offset: 0.0, ratio: 1.0, sine: 0.0, cosine: 0.0, compliance: [0.0; LOADS] }
    }
}

/// A reading q with sin q and cos q; where no term needs sine and cosine, those two numbers mean nothing.
pub type Reading<N> = [<N as Numbers>::Number; 3];

/// Looks up the sine and cosine of a reading where they are needed.
#[inline(always)]
pub fn read<N: Numbers>(reading: N::Number, needs_sine: bool) -> Reading<N> {
    if !needs_sine {
        return [reading; 3];
    }
    let (sin, cos) = N::sin_cos(reading);
    [reading, sin, cos]
}

impl Correction {
    /// Whether θ depends on sin q or cos q.
    pub fn needs_sine(&self) -> bool {
        self.sine != 0.0 || self.cosine != 0.0
    }

    /// θ at a reading without load (rad or m), for any kind of numbers.
    #[inline(always)]
    pub fn unloaded<N: Numbers>(&self, numbers: N, [reading, sin, cos]: Reading<N>) -> N::Number {
        let proportional = reading * numbers.number(self.ratio) + numbers.number(self.offset);
        if !self.needs_sine() {
            return proportional;
        }
        N::sum([proportional, sin * numbers.number(self.sine), cos * numbers.number(self.cosine)])
    }

    /// ∂θ/∂q at a reading without load, for any kind of numbers.
    #[inline(always)]
    pub fn rate<N: Numbers>(&self, numbers: N, [_, sin, cos]: Reading<N>) -> N::Number {
        if !self.needs_sine() {
            return numbers.number(self.ratio);
        }
        let terms = [numbers.number(self.ratio), cos * numbers.number(self.sine), sin * numbers.number(-self.cosine)];
        N::sum(terms)
    }

    /// θ at a reading without load, rad or m.
    pub fn position(&self, reading: f64) -> f64 {
        self.unloaded(Plain, read::<Plain>(reading, self.needs_sine()))
    }

    /// θ at a reading under torques (by load, N·m per kg), rad or m.
    pub fn loaded(&self, reading: f64, torques: &[f64; LOADS]) -> f64 {
        self.position(reading) + self.given(torques)
    }

    /// How far the joint gives way to torques (by load, N·m per kg), rad or m.
    pub fn given(&self, torques: &[f64; LOADS]) -> f64 {
        self.compliance[0] * torques[0] + self.compliance[1] * torques[1]
    }

    /// ∂θ/∂q at a reading without load.
    pub fn slope(&self, reading: f64) -> f64 {
        self.rate(Plain, read::<Plain>(reading, self.needs_sine()))
    }
}

/// A coefficient of a [`Correction`], by the function that it multiplies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Term {
    /// f = 1.
    Offset,
    /// f = q.
    Ratio,
    /// f = sin q.
    Sine,
    /// f = cos q.
    Cosine,
    /// f = τ, the torque of the load of this number, N·m per kg.
    Torque(usize),
}

impl Term {
    /// Whether f depends on the sine or the cosine of the reading.
    pub fn needs_sine(self) -> bool {
        matches!(self, Self::Sine | Self::Cosine)
    }

    /// f and ∂f/∂q at a reading. For a torque (N·m per kg, as given) the derivative is left out.
    #[inline(always)]
    pub fn factor<N: Numbers>(
        self,
        numbers: N,
        [reading, sin, cos]: Reading<N>,
        torques: &[f64; LOADS],
    ) -> (N::Number, N::Number) {
        match self {
            Self::Offset => (numbers.number(1.0), numbers.number(0.0)),
            Self::Ratio => (reading, numbers.number(1.0)),
            Self::Sine => (sin, cos),
            Self::Cosine => (cos, -sin),
            Self::Torque(load) => (numbers.number(torques[load]), numbers.number(0.0)),
        }
    }
}
