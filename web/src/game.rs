//! The state of the game "Beat the algorithm": the visitor's movements, and when the server is asked about them.

use body_schema_wire::AppraisalReport;

/// Movements of a game.
pub const ROUNDS: u64 = 10;
/// The time after a change during which nothing is asked, s: sliders change with every frame.
const DEBOUNCE: f64 = 0.08;

/// The map of the slice has so many cells across and up.
pub const CELLS: usize = 9;

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
    /// What the postures of a slice would teach, row by row from its lower left corner, as shares of the best; empty until it is known.
    map: (Option<Plane>, Vec<f64>),
    /// The slice whose map is awaited.
    mapping: Option<Plane>,
}

/// A slice of all postures: its joints, and the posture of all others.
#[derive(Clone, Debug, PartialEq)]
struct Plane {
    axes: (usize, usize),
    others: Vec<f64>,
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

    /// The slice that is shown.
    fn plane(&self) -> Plane {
        let (x, y) = self.axes;
        let mut others = self.values.clone();
        [x, y].into_iter().for_each(|joint| others[joint] = 0.0);
        Plane { axes: self.axes, others }
    }

    /// Whether to ask what the postures of the slice would teach: once all else is known, and once for each slice.
    pub(crate) fn map_is_due(&self) -> bool {
        self.values.len() > 1 && self.is_known() && self.mapping.is_none() && self.map.0.as_ref() != Some(&self.plane())
    }

    /// The postures at the middles of the cells of the slice.
    pub(crate) fn ask_map(&mut self, limits: &[[f64; 2]]) -> Vec<Vec<f64>> {
        let (plane, (x, y)) = (self.plane(), self.axes);
        let at = |joint: usize, cell: usize| {
            let [low, high] = limits[joint];
            low + (high - low) * (cell as f64 + 0.5) / CELLS as f64
        };
        let posture = |cell: usize| {
            let mut values = plane.others.clone();
            (values[x], values[y]) = (at(x, cell % CELLS), at(y, cell / CELLS));
            values
        };
        let postures = (0..CELLS * CELLS).map(posture).collect();
        self.mapping = Some(plane);
        postures
    }

    /// The gains of these postures; none where they could not be had.
    pub(crate) fn mapped(&mut self, gains: &[f64]) {
        let Some(plane) = self.mapping.take() else { return };
        let best = self.evaluation.as_ref().and_then(|evaluation| evaluation.best_gain).filter(|best| *best > 0.0);
        // The movement may have been made since, or the slice be another.
        let Some(best) = best.filter(|_| plane == self.plane()) else { return };
        self.map = (Some(plane), gains.iter().map(|gain| (gain / best).clamp(0.0, 1.0)).collect());
    }

    /// What the cells of the shown slice would teach, as shares of the best; empty until it is known.
    pub fn map(&self) -> &[f64] {
        let is_whole = self.map.1.len() == CELLS * CELLS && self.map.0.as_ref() == Some(&self.plane());
        if is_whole { &self.map.1 } else { &[] }
    }

    /// Whether the server knows this posture, so that the movement can be made.
    pub(crate) fn is_known(&self) -> bool {
        self.evaluation.is_some() && self.asked.is_none() && self.changed_at.is_none()
    }

    /// Notes that the movement was made, so that knowledge of postures is out of date.
    pub(crate) fn moved(&mut self, made: u64, now: f64) {
        self.shares.extend(self.evaluation.take().and_then(|evaluation| evaluation.share));
        self.tried.clear();
        (self.map, self.mapping) = ((None, Vec::new()), None);
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
