//! The state of the game "Beat the algorithm": the visitor's movements, and when the server is asked about them.

use body_schema_wire::AppraisalReport;

/// Movements of a game.
pub const ROUNDS: u64 = 10;
/// The time after a change during which nothing is asked, s: sliders change with every frame.
const DEBOUNCE: f64 = 0.08;

/// The visitor's next movement.
#[derive(Clone, Debug, Default)]
pub struct Game {
    /// The posture of the sliders, rad or m per joint.
    pub values: Vec<f64>,
    /// The joints of the slice, across and up.
    pub axes: (usize, usize),
    /// What it would teach, once that is known.
    pub evaluation: Option<AppraisalReport>,
    /// Postures that were tried before this movement, and their shares of the best gain.
    pub tried: Vec<(Vec<f64>, f64)>,
    /// The shares of the movements made.
    pub shares: Vec<f64>,
    /// Movements made.
    pub made: u64,
    /// Whether the movement is to be made as soon as the server knows its posture.
    pub(crate) wanted: bool,
    changed_at: Option<f64>,
    asked: Option<Vec<f64>>,
}

/// The next thing to do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Due {
    Nothing,
    /// In so many seconds.
    Later(f64),
    Ask,
}

impl Game {
    /// A game that begins with this posture.
    pub(crate) fn new(values: Vec<f64>, made: u64, now: f64) -> Self {
        let axes = (0, values.len().saturating_sub(1).min(1));
        Self { values, axes, made, changed_at: Some(now), ..Self::default() }
    }

    /// Sets another posture.
    pub(crate) fn set(&mut self, values: Vec<f64>, now: f64) {
        if values != self.values {
            (self.values, self.evaluation, self.changed_at) = (values, None, Some(now));
        }
    }

    /// Whether to ask now: one request at a time, and none while the visitor is still moving.
    pub(crate) fn due(&self, now: f64) -> Due {
        match self.changed_at {
            Some(at) if self.asked.is_none() => match at + DEBOUNCE - now {
                wait if wait > 0.0 => Due::Later(wait),
                _ => Due::Ask,
            },
            _ => Due::Nothing,
        }
    }

    pub(crate) fn ask(&mut self) -> Vec<f64> {
        self.changed_at = None;
        self.asked = Some(self.values.clone());
        self.values.clone()
    }

    pub(crate) fn answered(&mut self, evaluation: AppraisalReport) {
        let Some(asked) = self.asked.take() else { return };
        if let Some(share) = evaluation.share {
            self.tried.push((asked.clone(), share));
        }
        if asked == self.values {
            self.evaluation = Some(evaluation);
        }
    }

    pub(crate) fn refused(&mut self) {
        (self.asked, self.wanted) = (None, false);
    }

    /// Whether the server knows this posture, so that the movement can be made.
    pub(crate) fn is_known(&self) -> bool {
        self.evaluation.is_some() && self.asked.is_none() && self.changed_at.is_none()
    }

    /// Notes that the movement was made, so that knowledge of postures is out of date.
    pub(crate) fn moved(&mut self, made: u64, now: f64) {
        self.shares.extend(self.evaluation.take().and_then(|evaluation| evaluation.share));
        self.tried.clear();
        (self.made, self.wanted, self.changed_at) = (made, false, Some(now));
    }

    /// Mean share of the best gain over the movements made.
    pub fn mean_share(&self) -> Option<f64> {
        let count = self.shares.len();
        (count > 0).then(|| self.shares.iter().sum::<f64>() / count as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn answer(configuration: Vec<f64>, share: f64) -> AppraisalReport {
        AppraisalReport {
            configuration,
            criterion: 0.9,
            gain: 0.1,
            best_gain: Some(0.1 / share),
            share: Some(share),
            trace: 1.0,
            estimated_skeleton_m: Vec::new(),
            estimated_bones_m: Vec::new(),
            predicted_marker_m: [0.0; 3],
            marker_covariance_m2: [[0.0; 3]; 3],
            chance_of_being_seen: 1.0,
        }
    }

    #[test]
    fn one_request_at_a_time_and_none_while_sliding() {
        let mut game = Game::new(vec![0.0, 0.0], 0, 1.0);
        assert_eq!(game.due(1.1), Due::Ask);
        assert_eq!(game.ask(), [0.0, 0.0]);
        game.set(vec![0.5, 0.0], 1.2);
        assert_eq!(game.due(9.0), Due::Nothing, "the first is still under way");
        game.answered(answer(vec![0.0, 0.0], 0.4));
        assert!(!game.is_known() && game.tried == [(vec![0.0, 0.0], 0.4)]);
        assert!(matches!(game.due(1.25), Due::Later(wait) if wait < DEBOUNCE));
        assert_eq!(game.due(1.3), Due::Ask);
        game.ask();
        game.answered(answer(vec![0.5, 0.0], 0.8));
        assert!(game.is_known());
        game.moved(1, 2.0);
        assert!(!game.is_known() && game.tried.is_empty());
        assert_eq!((game.mean_share(), game.due(2.1)), (Some(0.8), Due::Ask));
    }
}
