//! A filter with a warm start: a smoother absorbs the first measurements, then a filter takes over.
//!
//! A filter linearises every measurement once, at its estimate of that moment; from a guess that is a metre and a radian
//! off it does not converge. So the first measurements are smoothed until they determine the blocks of which nothing was
//! known. There the filter takes over, with the smoother's estimate and covariance.

use std::sync::Arc;

use nalgebra::DMatrix;

use super::{Belief, EstimationError, Estimator, Smoother, Update};
use crate::{
    model::{Block, rank},
    sensing::{MeasurementModel, Observation},
};

/// A function that starts a filter from a belief with a covariance.
pub type Begin = Arc<dyn Fn(Belief, DMatrix<f64>) -> Box<dyn Estimator> + Send + Sync>;

/// A smoother that is followed by a filter.
#[derive(Clone)]
pub struct WarmStart {
    smoother: Smoother,
    /// The blocks that the first measurements must determine.
    blocks: Vec<Block>,
    /// The movements so far: readings of the joints, and the observation.
    seen: Vec<(Vec<f64>, Observation)>,
    measurement_model: Arc<MeasurementModel>,
    begin: Begin,
    filter: Option<Box<dyn Estimator>>,
}

/// Equations wanted for each unknown; with just enough of them the fit would absorb all their noise.
const MARGIN: usize = 2;

impl WarmStart {
    /// A smoother until `blocks` are determined, then what `begin` makes of its belief, whitened by `measurement_model`.
    pub fn new(smoother: Smoother, blocks: Vec<Block>, measurement_model: Arc<MeasurementModel>, begin: Begin) -> Self {
        Self { smoother, blocks, seen: Vec::new(), measurement_model, begin, filter: None }
    }

    /// Whether the observations so far determine the blocks when everything else is held.
    fn is_determined(&self) -> bool {
        let Belief { state, layout, measurement_model, .. } = self.smoother.belief();
        let columns: Vec<usize> = self.blocks.iter().filter_map(|block| layout.block(*block)).flatten().collect();
        let count: usize = self.seen.iter().map(|(_, observation)| observation.equations()).sum();
        if count < MARGIN * columns.len() {
            return false;
        }
        let mut stacked = DMatrix::zeros(columns.len(), count);
        let mut end = 0;
        for (posture, observation) in &self.seen {
            let rows = measurement_model.equations_of(state, layout, posture, observation).rows.select_rows(&columns);
            stacked.columns_mut(end, rows.ncols()).copy_from(&rows);
            end += rows.ncols();
        }
        rank(&stacked.transpose()) == columns.len()
    }
}

impl Estimator for WarmStart {
    fn boxed(&self) -> Box<dyn Estimator> {
        Box::new(self.clone())
    }

    fn belief(&self) -> &Belief {
        self.filter.as_ref().map_or_else(|| self.smoother.belief(), |filter| filter.belief())
    }

    fn correct(&mut self, positions: &[f64], observation: &Observation) -> Result<Update, EstimationError> {
        if let Some(filter) = &mut self.filter {
            return filter.correct(positions, observation);
        }
        let update = self.smoother.correct(positions, observation)?;
        if !observation.is_miss() {
            self.seen.push((positions.to_vec(), observation.clone()));
        }
        if self.is_determined() {
            let belief = self.smoother.belief();
            let covariance = belief.covariance.clone().unwrap_or_default();
            let belief = Belief::new(belief.state.clone(), belief.layout.clone(), self.measurement_model.clone());
            self.filter = Some((self.begin)(belief, covariance));
        }
        Ok(update)
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::{
        estimation::{HypothesisSettings, Rls},
        model::{Layout, Prior, random::random_arm},
    };

    /// A second sensor that never reads brings no equation.
    #[test]
    fn readings_that_there_were_not_determine_nothing() {
        use crate::sensing::{Position, Sensor};
        let truth = random_arm(&mut ChaCha8Rng::seed_from_u64(4), 4);
        let layout = Arc::new(Layout::new(&truth, [Block::Base]));
        let prior = Prior::around(truth.clone(), &layout, DMatrix::identity(6, 6)).expect("a prior");
        let tracker = || Sensor::even(Position { target: 0 }, 0.001);
        let measurement_model = Arc::new(MeasurementModel::new(vec![tracker(), tracker()]));
        let (settings, rng) = (HypothesisSettings::default(), ChaCha8Rng::seed_from_u64(1));
        let smoother = Smoother::new(prior, layout, measurement_model.clone(), settings, rng);
        let begin: Begin = Arc::new(|belief, covariance| Box::new(Rls::new(belief, covariance, None)));
        let mut begun = WarmStart::new(smoother, vec![Block::Base], measurement_model, begin);
        for (index, theta) in
            [[0.3, -0.7, 1.0, 0.2], [-0.9, 0.4, -0.3, 1.1], [1.2, 0.8, 0.5, -0.6], [0.6, -0.2, -0.9, -1.0]]
                .iter()
                .enumerate()
        {
            assert!(begun.filter.is_none(), "after {index} readings: 12 equations are wanted");
            let marker = truth.marker_at(theta).coords.as_slice().to_vec();
            begun.update(theta, &Observation { readings: vec![Some(marker), None] }).expect("absorbed");
        }
        assert!(begun.filter.is_some());
    }

    /// A base a radian off: after four positions of a marker the filter takes over, and stands where the robot does.
    #[test]
    fn the_filter_takes_over_when_the_base_is_determined() {
        let truth = random_arm(&mut ChaCha8Rng::seed_from_u64(4), 4);
        let layout = Arc::new(Layout::new(&truth, [Block::Base]));
        let mut guess = truth.clone();
        guess.base =
            nalgebra::Isometry3::new(nalgebra::Vector3::new(0.5, -0.3, 0.2), nalgebra::Vector3::new(0.3, 0.8, -0.4));
        let covariance = DMatrix::identity(6, 6);
        let prior = Prior::around(guess, &layout, covariance).expect("a prior");
        let measurement_model = Arc::new(MeasurementModel::tracker(0.001));
        let (settings, rng) = (HypothesisSettings::default(), ChaCha8Rng::seed_from_u64(1));
        let smoother = Smoother::new(prior, layout, measurement_model.clone(), settings, rng);
        let begin: Begin = Arc::new(|belief, covariance| Box::new(Rls::new(belief, covariance, None)));
        let mut begun = WarmStart::new(smoother, vec![Block::Base], measurement_model, begin);
        for (index, theta) in
            [[0.3, -0.7, 1.0, 0.2], [-0.9, 0.4, -0.3, 1.1], [1.2, 0.8, 0.5, -0.6], [0.6, -0.2, -0.9, -1.0]]
                .iter()
                .enumerate()
        {
            assert!(begun.filter.is_none(), "after {index}");
            begun.update(theta, &Observation::seen(truth.marker_at(theta))).expect("absorbed");
        }
        assert!(begun.filter.is_some());
        let theta = [0.1, 0.2, -0.5, 0.9];
        assert!((begun.belief().state.marker_at(&theta) - truth.marker_at(&theta)).norm() < 0.01);
    }
}
