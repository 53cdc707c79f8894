//! A weighted set of modes of the posterior: a Gaussian mixture.
//!
//! Each mode's evidence is that of its Laplace approximation, `−E − ½ ln det Λ`. Modes are searched again from where
//! they are after every measurement; new ones are searched from draws of the prior and from the modes there are, with
//! some joints drawn anew. Modes that meet are merged, and those without a share of the evidence are dropped.

use rand::{Rng, RngExt};

use super::{
    mode::{Mode, NoMode, StoppingCriteria},
    posterior::Posterior,
};
use crate::{
    elementary::exp,
    kinematics::{Joint, Line},
    model::{Block, Layout, State},
    parallel::mapped,
};

/// How many modes are kept, and how hard new ones are searched for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HypothesisSettings {
    /// The most modes that are kept.
    pub kept: usize,
    /// The searches that begin after every measurement while the belief may be ambiguous.
    pub spawned: usize,
}

impl Default for HypothesisSettings {
    fn default() -> Self {
        Self { kept: 16, spawned: 16 }
    }
}

/// The modes, the heaviest first.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct Hypotheses {
    pub modes: Vec<Mode>,
    /// Stable steps: how many in a row found no new mode of any weight.
    pub stable_steps: usize,
    /// Why the last mode was lost, where none is left.
    pub lost: Option<NoMode>,
}

/// The squared distance, in standard deviations, below which two modes are one.
const MERGED: f64 = 0.3;
/// The share of the evidence below which a mode is dropped.
const NEGLIGIBLE: f64 = 1e-5;
/// The logarithm of the evidence ratio beyond which another mode does not count.
const HOPELESS: f64 = 40.0;

const WARM: StoppingCriteria<'_> = StoppingCriteria { steps: 30, tolerance: 1e-8, hopeless: f64::INFINITY, known: &[] };
/// The effort for rivals of the estimate, of which only the share of the evidence counts.
const RIVAL: StoppingCriteria<'_> = StoppingCriteria { tolerance: 1e-3, ..WARM };
/// The effort for new modes, which are followed after the next measurement: until then their share of the evidence is
/// known to a hundredth.
const COLD: StoppingCriteria<'_> = StoppingCriteria { steps: 40, tolerance: 1e-2, hopeless: f64::INFINITY, known: &[] };

impl Hypotheses {
    /// Searches every mode again after the posterior has changed.
    pub fn follow(&mut self, posterior: &Posterior, layout: &Layout) {
        let best = self.modes.iter().map(|mode| mode.log_evidence).fold(f64::NEG_INFINITY, f64::max);
        let found = mapped(&self.modes, |mode| {
            let effort = if mode.log_evidence < best { RIVAL } else { WARM };
            posterior.mode(&mode.state, layout, effort)
        });
        self.lost = found.iter().find_map(|mode| mode.as_ref().err().copied());
        self.modes = found.into_iter().flatten().collect();
    }

    /// Searches new modes, half of them from the prior, half of them from the modes there are. Where readings may be outliers,
    /// half of these suspect some of the readings: they begin where all others are explained.
    pub fn spawn(&mut self, count: usize, posterior: &Posterior, layout: &Layout, rng: &mut impl Rng) {
        let best = self.modes.iter().map(|mode| mode.cost).fold(f64::INFINITY, f64::min);
        let effort = StoppingCriteria { hopeless: best + 2.0 * HOPELESS, known: &self.modes, ..COLD };
        let before = self.modes.len();
        // All that is drawn is drawn before the first search, so that these may be in any order.
        let searches: Vec<(Option<Posterior>, State)> = (0..count)
            .map(|index| {
                if posterior.loss.is_robust() && index % 4 == 1 && before > 0 {
                    let start = self.modes[rng.random_range(0..before)].state.clone();
                    return (Some(posterior.suspecting(rng)), start);
                }
                let drawn = posterior.prior.draw(layout, rng);
                if index % 2 == 0 || before == 0 {
                    return (None, drawn);
                }
                (None, mutated(&self.modes[rng.random_range(0..before)].state, &drawn, layout, rng))
            })
            .collect();
        let found = mapped(&searches, |(others, start)| match others {
            Some(others) => posterior.mode_through(others, start, layout, effort),
            None => posterior.mode_from_afar(start, layout, effort),
        });
        self.modes.extend(found.into_iter().flatten());
    }

    /// Why there is no mode.
    pub fn why(&self) -> &'static str {
        self.lost.map_or("no hypothesis explains the measurements", NoMode::why)
    }

    /// Merges, weighs, sorts and prunes the modes.
    pub fn condense(&mut self, kept: usize, layout: &Layout) {
        // Evidence is finite: what has none is no mode.
        self.modes.sort_by(|a, b| b.log_evidence.total_cmp(&a.log_evidence));
        let best = self.modes.first().map_or(0.0, |mode| mode.log_evidence);
        let mut distinct: Vec<Mode> = Vec::new();
        for mode in self.modes.drain(..) {
            if mode.log_evidence < best - HOPELESS || distinct.len() >= kept {
                break;
            }
            let apart = |other: &Mode| other.distance(layout, &mode.state).is_none_or(|squared| squared > MERGED);
            let is_new = distinct.iter().all(apart);
            if is_new {
                distinct.push(mode);
            }
        }
        let total: f64 = distinct.iter().map(|mode| exp(mode.log_evidence - best)).sum();
        distinct.iter_mut().for_each(|mode| mode.weight = exp(mode.log_evidence - best) / total);
        distinct.retain(|mode| mode.weight >= NEGLIGIBLE);
        self.modes = distinct;
    }
}

/// `state` with one to three of its learned axes drawn anew or turned round; of other blocks, where no axis is learned.
fn mutated(state: &State, drawn: &State, layout: &Layout, rng: &mut impl Rng) -> State {
    let mut mutated = state.clone();
    let learned: Vec<Block> = layout.blocks().map(|(block, _)| block).collect();
    let axes: Vec<Block> = learned.iter().copied().filter(|block| matches!(block, Block::Axis(_))).collect();
    let places = if axes.is_empty() { learned } else { axes };
    if places.is_empty() {
        return mutated;
    }
    for _ in 0..rng.random_range(1..=3) {
        let block = places[rng.random_range(0..places.len())];
        let turns_round = rng.random_range(0..4) == 0;
        match block {
            Block::Axis(index) => {
                mutated.joints[index] = match mutated.joints[index] {
                    Joint::Revolute(line) if turns_round => {
                        Joint::Revolute(Line { direction: -line.direction, ..line })
                    }
                    _ => drawn.joints[index],
                };
            }
            _ => block.put(&mut mutated, block.of(drawn)),
        }
    }
    mutated
}

#[cfg(test)]
mod tests {
    use std::{f64::consts::PI, sync::Arc};

    use fearless_simd::Level;
    use nalgebra::{DMatrix, DVector, Point3, UnitVector3, Vector3};
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::{
        super::{normal::Normal, posterior::Measurement},
        *,
    };
    use crate::{
        model::{Prior, random::random_arm},
        sensing::{MeasurementModel, Observation},
    };

    /// A state, its layout, and the deviation of every parameter that its modes have here.
    fn chain() -> (State, Layout, f64) {
        let state = random_arm(&mut ChaCha8Rng::seed_from_u64(3), 3);
        let layout = Layout::of_arm(&state, &[], false);
        (state, layout, 0.01)
    }

    /// A mode `away` standard deviations from the chain along one parameter, with this evidence.
    fn mode(away: f64, log_evidence: f64) -> Mode {
        let (state, layout, deviation) = chain();
        let m = layout.dimension();
        let mut delta = DVector::zeros(m);
        delta[0] = away * deviation;
        let information = DMatrix::identity(m, m) / (deviation * deviation);
        let normal = Normal { cost: -log_evidence, information, negative_gradient: DVector::zeros(m) };
        let mut mode = Mode::at(Level::new(), state.retract(&layout, &delta), normal).expect("positive");
        mode.log_evidence = log_evidence;
        mode
    }

    fn condensed(modes: &[(f64, f64)], kept: usize) -> Vec<Mode> {
        let modes = modes.iter().map(|(away, log_evidence)| mode(*away, *log_evidence)).collect();
        let mut hypotheses = Hypotheses { modes, ..Hypotheses::default() };
        hypotheses.condense(kept, &chain().1);
        hypotheses.modes
    }

    fn evidence(modes: &[Mode]) -> Vec<f64> {
        modes.iter().map(|mode| mode.log_evidence).collect()
    }

    #[test]
    fn condensed_modes_are_distinct_and_weighted_by_their_evidence() {
        // In no order; of two that are one the better stays, wherever it stood.
        let modes = condensed(&[(5.0, -2.0), (0.1, -0.5), (0.0, 0.0), (5.2, -3.0), (10.0, 1.0)], 16);
        assert_eq!(evidence(&modes), [1.0, 0.0, -2.0]);
        let weights: Vec<f64> = modes.iter().map(|mode| mode.weight).collect();
        assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-12, "{weights:?}");
        assert!((weights[0] / weights[1] - 1_f64.exp()).abs() < 1e-9, "{weights:?}");
        assert!((weights[1] / weights[2] - 2_f64.exp()).abs() < 1e-9, "{weights:?}");
        // What counts are differences of evidence, however small the evidence is.
        let modes = condensed(&[(5.0, -1002.0), (0.0, -1000.0)], 16);
        assert!((modes[0].weight / modes[1].weight - 2_f64.exp()).abs() < 1e-9);
        assert!(condensed(&[], 16).is_empty());
    }

    #[test]
    fn modes_without_a_share_are_dropped() {
        // e⁻¹¹ is 1.7·10⁻⁵, e⁻¹² is 6·10⁻⁶, and a share of 10⁻⁵ counts.
        let modes = condensed(&[(0.0, 0.0), (5.0, -11.0), (10.0, -12.0), (15.0, -100.0)], 16);
        assert_eq!(evidence(&modes), [0.0, -11.0]);
        assert!((modes.iter().map(|mode| mode.weight).sum::<f64>() - 1.0).abs() < 1e-5);
        let many: Vec<(f64, f64)> = (0..20).map(|k| (5.0 * f64::from(k), 0.1 * f64::from(k))).collect();
        assert_eq!(evidence(&condensed(&many, 4)), [19, 18, 17, 16].map(|k| 0.1 * f64::from(k)));
    }

    /// A joint of which nothing is known, behind one that is known: seen after half turns alone, which are those about its
    /// axis turned round.
    fn half_turns() -> (State, Layout, Posterior) {
        let joint = |direction: Vector3<f64>, x: f64| {
            let direction = UnitVector3::new_normalize(direction);
            Joint::Revolute(Line { point: Point3::new(x, 0.0, 0.0), direction })
        };
        let joints = vec![joint(Vector3::new(0.2, -0.3, 1.0), 0.1), joint(Vector3::y(), 0.5)];
        let truth = State::arm(joints, Point3::new(0.8, 0.0, 0.1));
        let layout = Layout::of_arm(&truth, &[true, false], false);
        let m = layout.dimension();
        let within = |_| Some(1.0);
        let prior = Prior::new(truth.clone(), &layout, DMatrix::identity(m, m), within).expect("a prior");
        let mut posterior = Posterior::new(prior, Arc::new(MeasurementModel::tracker(0.01)));
        for known in [-0.8, 0.2, 1.1] {
            see(&mut posterior, &truth, &[PI, known]);
        }
        (truth, layout, posterior)
    }

    fn see(posterior: &mut Posterior, truth: &State, positions: &[f64]) {
        let observation = Observation::seen(truth.marker_at(positions));
        posterior.measurements.push(Measurement { positions: positions.to_vec(), observation, movement: 0 });
    }

    #[test]
    fn the_axis_turned_round_is_found_and_later_ruled_out() {
        let (truth, layout, mut posterior) = half_turns();
        let axis = truth.joints[0].direction();
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut hypotheses = Hypotheses::default();
        hypotheses.modes.extend(posterior.mode(&truth, &layout, WARM));
        hypotheses.spawn(0, &posterior, &layout, &mut rng);
        assert_eq!(hypotheses.modes.len(), 1, "none is searched for");
        hypotheses.spawn(16, &posterior, &layout, &mut rng);
        hypotheses.condense(16, &layout);
        assert_eq!(hypotheses.modes.len(), 2, "found over and over, they are two");
        let along = |mode: &Mode| mode.state.joints[0].direction().dot(&axis);
        let (one, other) = (&hypotheses.modes[0], &hypotheses.modes[1]);
        assert!((along(one) + along(other)).abs() < 1e-2 && along(one).abs() > 0.999);
        for mode in [one, other] {
            assert!(posterior.misfit(&mode.state, &layout) < 0.5, "it explains what was seen");
            assert!((mode.weight - 0.5).abs() < 0.01, "{}", mode.weight);
        }
        // A quarter turn tells them apart. Modes are searched anew given it.
        see(&mut posterior, &truth, &[0.5 * PI, 0.0]);
        hypotheses.follow(&posterior, &layout);
        for mode in &hypotheses.modes {
            let normal = posterior.normal(&mode.state, &layout).expect("in the chart");
            assert!((normal.cost - mode.cost).abs() < 1e-9 * mode.cost.max(1.0), "of all measurements");
            let step = mode.covariance() * &normal.negative_gradient;
            assert!(step.dot(&normal.negative_gradient) < 1e-3, "at rest");
        }
        hypotheses.condense(16, &layout);
        assert_eq!(hypotheses.modes.len(), 1);
        assert!(along(&hypotheses.modes[0]) > 0.999 && hypotheses.modes[0].weight == 1.0);
    }

    #[test]
    fn without_any_mode_the_prior_is_searched() {
        let (_, layout, posterior) = half_turns();
        let mut hypotheses = Hypotheses::default();
        hypotheses.spawn(8, &posterior, &layout, &mut ChaCha8Rng::seed_from_u64(1));
        hypotheses.condense(16, &layout);
        assert!(posterior.misfit(&hypotheses.modes[0].state, &layout) < 0.5);
    }
}
