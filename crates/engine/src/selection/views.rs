//! Which readings there will be: the chance of each channel, where sensors see some postures only.
//!
//! Whether a tag is in a camera's picture and faces it depends on the whole state, and not by much of a linear function. So
//! states are drawn from the belief, and a posture's chance is the share of them in which the channel sees its target:
//!
//! ```text
//! p_c(θ) = Σₖ wₖ s_c(xₖ, θ),     s_c = max(clamp(½ + clearance_c/2h, 0, 1), 10⁻³ e^{clearance_c/¼}),     xₖ = x ⊕ κ P^½ zₖ
//! ```
//!
//! The tail of s_c is too low to be chosen for, and leads a search to where there is something to see. κ = 2, as for a head: linearised at a poor estimate P is too small. *Misses teach*: a belief knows only what was seen, so a
//! draw counts the less, the surer it would have seen something where nothing was seen,
//!
//! ```text
//! wₖ ∝ Πₘ Π_c (1 − s_c(xₖ, θₘ)),     θₘ the misses
//! ```
//!
//! Of many draws those of the greatest weight are kept. The zₖ are the same for all beliefs, in pairs of opposite signs.
//!
//! With several channels the rows of each are weighed by f_c, p being the greatest of the chances and that of the movement:
//!
//! ```text
//! f_c² = r/(1 + (1 − r) g),     r = p_c/p,     g = h P hᵀ in the mean over rows h of the channel
//! ```
//!
//! so that a reading that comes with chance r lowers the variance that it tells of by r of what it would lower it if it were sure to come:
//! f² g/(1 + f² g) = r g/(1 + g). A factor of r alone would do so for readings that tell little; of sharp ones, g ≫ 1, a hundredth of the
//! information tells as much as all of it, and a choice would content itself with readings that never come. What hypotheses predict
//! differently in them is weighed alike. With one channel nothing is approximated.

use nalgebra::{Cholesky, DMatrix, DVector, DVectorView};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::visibility::CAUTION;
use crate::{
    elementary::exp,
    model::{Layout, Links, State},
    normal::StandardNormal,
    sensing::MeasurementModel,
};

/// States drawn from a belief, to see what they would see.
#[derive(Clone, Debug)]
pub(super) struct Views {
    /// wₖ and xₖ.
    states: Vec<(f64, State)>,
    /// Whether what is outside by a hair is taken for lost, and what is inside for seen.
    is_naive: bool,
}

/// Pairs of states, before misses and after.
const DRAWN: usize = 8;
const DRAWN_AFTER_MISSES: usize = 96;
/// States kept.
const KEPT: usize = 16;
/// h, radians.
const RAMP: f64 = 0.03;
/// Where nothing was seen a draw that sees something is not ruled out altogether: it stands for its neighbours too.
const DOUBT: f64 = 0.05;

impl Views {
    /// Of a belief in `state` with `covariance`, given movements (rad or m) after which nothing was seen.
    pub fn new(
        state: &State,
        layout: &Layout,
        covariance: &DMatrix<f64>,
        measurement_model: &MeasurementModel,
        misses: impl Iterator<Item = Vec<f64>>,
    ) -> Self {
        let misses: Vec<Vec<f64>> = misses.collect();
        let m = layout.dimension();
        let root = Cholesky::new(covariance * CAUTION).map_or_else(
            || DMatrix::from_diagonal(&covariance.diagonal().map(|x| (CAUTION * x).max(0.0).sqrt())),
            |cholesky| cholesky.unpack(),
        );
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        let pairs = if misses.is_empty() { DRAWN } else { DRAWN_AFTER_MISSES };
        let mut states = Vec::with_capacity(2 * pairs);
        let mut clearances = vec![0.0; measurement_model.sensors().len()];
        for _ in 0..pairs {
            let delta = &root * DVector::from_fn(m, |_, _| rng.sample::<f64, _>(StandardNormal));
            for delta in [delta.clone(), -delta] {
                let drawn = state.retract(layout, &delta);
                let mut weight = 1.0;
                for miss in &misses {
                    measurement_model.clearances(None, &Links::of(&drawn, miss), &mut clearances);
                    weight *= clearances.iter().map(|clearance| (1.0 - seen(*clearance)).max(DOUBT)).product::<f64>();
                }
                states.push((weight, drawn));
            }
        }
        states.sort_by(|a, b| b.0.total_cmp(&a.0));
        states.truncate(KEPT);
        let total: f64 = states.iter().map(|(weight, _)| weight).sum();
        let share = |weight: f64| if total > 0.0 { weight / total } else { 1.0 / KEPT as f64 };
        states.iter_mut().for_each(|(weight, _)| *weight = share(*weight));
        Self { states, is_naive: false }
    }

    /// Of an estimate that is believed blindly.
    pub fn of_estimate(state: &State) -> Self {
        Self { states: vec![(1.0, state.clone())], is_naive: true }
    }

    /// Weighs rows of a movement to `positions` by what channels will see, as a belief with `covariance` counts on them, and tells the
    /// chance that anything is seen. The rows are d columns of some numbers each, the first ones those of Hᵀ; `factors` has f of each of the
    /// d equations.
    pub fn weigh(
        &self,
        measurement_model: &MeasurementModel,
        positions: &[f64],
        covariance: &DMatrix<f64>,
        all: &mut [&mut [f64]],
        factors: &mut [f64],
    ) -> f64 {
        let mut chances = vec![0.0; measurement_model.sensors().len()];
        self.chances(measurement_model, positions, &mut chances);
        let best = chances.iter().copied().fold(0.0, f64::max);
        let mut start = 0;
        for (sensor, chance) in measurement_model.sensors().iter().zip(&chances) {
            let end = start + sensor.equations();
            if *chance < best {
                let m = covariance.nrows();
                let spread = all.first().map_or(0.0, |rows| spread(&rows[start * m..end * m], covariance));
                let share = chance / best;
                let factor = (share / (1.0 + (1.0 - share) * spread)).sqrt();
                factors[start..end].fill(factor);
                for rows in &mut *all {
                    let m = rows.len() / measurement_model.equations().max(1);
                    rows[start * m..end * m].iter_mut().for_each(|x| *x *= factor);
                }
            }
            start = end;
        }
        best
    }

    /// Writes p_c of every channel of `measurement_model` at `positions` (rad or m).
    pub fn chances(&self, measurement_model: &MeasurementModel, positions: &[f64], chances: &mut [f64]) {
        let mut clearances = vec![0.0; chances.len()];
        chances.fill(0.0);
        for (weight, state) in &self.states {
            // Each would aim by itself.
            measurement_model.clearances(
                None,
                &Links::of(state, &measurement_model.aimed_from(state, positions)),
                &mut clearances,
            );
            for (chance, clearance) in chances.iter_mut().zip(&clearances) {
                let seen = if self.is_naive { f64::from(*clearance >= 0.0) } else { seen(*clearance) };
                *chance += weight * seen;
            }
        }
    }
}

/// Rows of a channel that stand for all of them.
const SAMPLED: usize = 2;

/// h P hᵀ, in the mean over the first rows h of some that are not nothing.
fn spread(rows: &[f64], covariance: &DMatrix<f64>) -> f64 {
    let something = rows.chunks_exact(covariance.nrows().max(1)).filter(|row| row.iter().any(|x| *x != 0.0));
    let (mut sum, mut count) = (0.0, 0_usize);
    for row in something.take(SAMPLED) {
        let row = DVectorView::from_slice(row, row.len());
        sum += row.dot(&(covariance * row));
        count += 1;
    }
    sum.max(0.0) / count.max(1) as f64
}

/// s of a clearance, radians.
fn seen(clearance: f64) -> f64 {
    let tail = 1e-3 * exp(clearance.min(0.0) / 0.25);
    (0.5 + 0.5 * clearance / RAMP).clamp(tail, 1.0)
}

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, Point3, Vector3};

    use super::*;
    use crate::{
        model::{Block, Device, random::random_arm},
        sensing::{Pixels, Position, Sensor},
    };

    /// A marker on an arm and a camera that looks at where it is believed to be: seen for certain where it is known well, never
    /// from behind, and half of the time where it is believed at the border.
    #[test]
    fn the_chance_follows_the_belief() {
        let mut state = random_arm(&mut ChaCha8Rng::seed_from_u64(5), 3);
        let layout = Layout::new(&state, [Block::Target(0)]);
        let marker = state.marker();
        let towards = |turn: f64| {
            let ahead = Vector3::new(turn.sin(), 0.0, turn.cos());
            let eye = marker - ahead;
            Isometry3::from_parts(eye.coords.into(), nalgebra::UnitQuaternion::identity())
        };
        let pixels = Pixels {
            camera: 0,
            target: 0,
            points: [Point3::origin()].into(),
            size_px: [640.0, 480.0],
            facing: None,
            partly_seen: None,
        };
        let measurement_model =
            MeasurementModel::new(vec![Sensor::even(pixels, 1.0), Sensor::even(Position { target: 0 }, 0.01)]);
        let mut chance = |pose: Isometry3<f64>, sd: f64| {
            state.devices =
                vec![Device { link: None, pose, intrinsics: Some([500.0, 500.0, 320.0, 240.0]), distortion: None }];
            let mut chances = [0.0; 2];
            let covariance = DMatrix::identity(3, 3) * sd * sd;
            let views = Views::new(&state, &layout, &covariance, &measurement_model, std::iter::empty());
            views.chances(&measurement_model, &[0.0; 3], &mut chances);
            assert!((chances[1] - 1.0).abs() < 1e-12, "a tracker sees everything");
            chances[0]
        };
        assert!((chance(towards(0.0), 1e-3) - 1.0).abs() < 1e-12);
        assert!(chance(towards(std::f64::consts::PI), 1e-3) < 1e-3);
        let border = (320_f64 / 500.0).atan();
        let unsure = chance(towards(border), 0.1);
        assert!((unsure - 0.5).abs() < 0.2, "{unsure}");
    }

    /// A sharp reading that comes with some chance lowers a variance by that share of what it would lower it if it were sure to come.
    #[test]
    fn what_seldom_reads_teaches_seldom() {
        let mut state = random_arm(&mut ChaCha8Rng::seed_from_u64(5), 3);
        let layout = Layout::new(&state, [Block::Target(0)]);
        let ahead = Vector3::new((320_f64 / 500.0).atan().sin(), 0.0, (320_f64 / 500.0).atan().cos());
        let pose = Isometry3::from_parts((state.marker() - ahead).coords.into(), nalgebra::UnitQuaternion::identity());
        state.devices =
            vec![Device { link: None, pose, intrinsics: Some([500.0, 500.0, 320.0, 240.0]), distortion: None }];
        let (points, size_px) = ([Point3::origin()].into(), [640.0, 480.0]);
        let pixels = Pixels { camera: 0, target: 0, points, size_px, facing: None, partly_seen: None };
        for sigma_px in [1e3, 1.0, 1e-3] {
            let sensors = vec![Sensor::even(pixels.clone(), sigma_px), Sensor::even(Position { target: 0 }, 0.01)];
            let measurement_model = MeasurementModel::new(sensors);
            let covariance = DMatrix::identity(3, 3) * 0.01;
            let views = Views::new(&state, &layout, &covariance, &measurement_model, std::iter::empty());
            let mut chances = [0.0; 2];
            views.chances(&measurement_model, &[0.0; 3], &mut chances);
            assert!(chances[0] > 0.3 && chances[0] < 0.7 && chances[1] == 1.0, "{chances:?}");
            let whole = measurement_model.jacobian(&state, &layout, &[0.0; 3]);
            let (mut rows, mut factors) = (whole.clone(), [1.0; 5]);
            views.weigh(&measurement_model, &[0.0; 3], &covariance, &mut [rows.as_mut_slice()], &mut factors);
            assert!(factors[0] == factors[1] && factors[2..] == [1.0; 3], "{factors:?}");
            assert!((rows.columns(2, 3) - whole.columns(2, 3)).amax() == 0.0, "what is always there counts whole");
            let told = |rows: &DMatrix<f64>| {
                let spread = rows.column(0).dot(&(&covariance * rows.column(0)));
                spread / (1.0 + spread)
            };
            let share = told(&rows) / told(&whole);
            assert!((share / chances[0] - 1.0).abs() < 0.2, "{share} {}", chances[0]);
        }
    }

    /// A marker that was not seen where it might have been is where the camera does not look.
    #[test]
    fn a_miss_moves_the_belief_out_of_view() {
        let mut state = random_arm(&mut ChaCha8Rng::seed_from_u64(5), 3);
        let layout = Layout::new(&state, [Block::Target(0)]);
        let eye = state.marker() - Vector3::z();
        let pose = Isometry3::from_parts(eye.coords.into(), nalgebra::UnitQuaternion::identity());
        state.devices =
            vec![Device { link: None, pose, intrinsics: Some([500.0, 500.0, 320.0, 240.0]), distortion: None }];
        let (points, size_px) = ([Point3::origin()].into(), [640.0, 480.0]);
        let pixels = Pixels { camera: 0, target: 0, points, size_px, facing: None, partly_seen: None };
        let measurement_model = MeasurementModel::new(vec![Sensor::even(pixels, 1.0)]);
        let chance = |misses: usize| {
            let covariance = DMatrix::identity(3, 3) * 0.09;
            let missed = std::iter::repeat_n(vec![0.0; 3], misses);
            let mut chances = [0.0];
            Views::new(&state, &layout, &covariance, &measurement_model, missed).chances(
                &measurement_model,
                &[0.0; 3],
                &mut chances,
            );
            chances[0]
        };
        assert!(chance(0) > 0.4 && chance(1) < 0.2, "{} {}", chance(0), chance(1));
    }
}
