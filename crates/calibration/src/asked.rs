//! The workspace of a calibration: where predictions are asked for, and how errors there are measured.
//!
//! Held-out rows define it: for a target in sockets, how far the predicted target scatters in each of them, which is all that such
//! rows can tell. Where none are held out it is the table's postures; for a target in sockets, places anywhere that the robot reaches,
//! with postures anywhere within the joint limits that bring the target there, as believed.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::{Case, Split};
use body_schema_engine::model::{Manifold, State, Workspace};

/// The most postures.
const POSTURES: usize = 300;
/// The least number of held-out rows that define a workspace.
const FEWEST: usize = 10;
/// The number of places, and of postures at each.
const PLACES: usize = 20;
const EACH: usize = 10;

impl Case<'_> {
    /// The postures for which predictions are asked of a robot that is believed to be in `state`.
    pub(super) fn asked_about(&self, state: &State, splits: &[Split]) -> Workspace {
        let mut held_out: Vec<usize> = splits.iter().flat_map(|split| &split.held_out).copied().collect();
        held_out.sort_unstable();
        if self.meets_itself() {
            return self.met(state, &held_out);
        }
        let all: Vec<usize> = (0..self.rows.len()).collect();
        self.predicted(&spread(if held_out.len() < FEWEST { &all } else { &held_out }))
    }

    /// The workspace of the hand in these rows.
    pub(super) fn predicted(&self, rows: &[usize]) -> Workspace {
        Workspace {
            configurations: rows.iter().map(|row| self.rows[*row].positions.clone()).collect(),
            up_to_motion: self.scenario.robot.up_to_motion,
            places: Vec::new(),
        }
    }

    /// The workspace of the hand that meets itself in sockets of these rows; anywhere, without rows.
    pub(super) fn met(&self, state: &State, rows: &[usize]) -> Workspace {
        let asked = self.in_sockets(rows);
        if asked.configurations.is_empty() { self.anywhere(state) } else { asked }
    }

    /// The workspace of rows in which a target is held in a socket, each compared with the others there.
    pub(super) fn in_sockets(&self, rows: &[usize]) -> Workspace {
        let held: Vec<usize> = rows.iter().copied().filter(|row| self.held(&self.rows[*row]).is_some()).collect();
        let posture = |row: usize| (self.rows[row].socket.unwrap_or_default(), self.rows[row].positions.as_slice());
        Workspace::at_places(spread(&held).into_iter().map(posture))
    }

    fn anywhere(&self, state: &State) -> Workspace {
        // What is told of a table depends on no seed.
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        let robot = &self.scenario.robot;
        let (limits, target) = (&robot.limits, robot.sockets.first().map_or(0, |socket| socket.target));
        let mut drawn: Vec<(usize, Vec<f64>)> = Vec::new();
        for place in 0..PLACES {
            let manifold = Manifold::new(state, target, state.target_at(target, &limits.draw(&mut rng)), limits);
            let number = state.sockets.len() + place;
            drawn.extend((0..EACH).map_while(|_| manifold.draw(&mut rng)).map(|posture| (number, posture)));
        }
        Workspace::at_places(drawn.iter().map(|(place, posture)| (*place, posture.as_slice())))
    }
}

/// Some of the rows, as many as are looked at, spread evenly.
fn spread(rows: &[usize]) -> Vec<usize> {
    let count = rows.len().min(POSTURES);
    (0..count).map(|k| rows[k * rows.len() / count]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        Figures,
        laws::{REAL, learned_at},
    };
    use body_schema_scenario::builtin;

    /// Of two real robots, learned at each of their places: at all others the ball scatters as is expected, to a factor of two or so, though
    /// nothing of what is found there is known.
    #[test]
    fn a_ball_scatters_elsewhere_as_is_expected() {
        for ((name, places), most) in REAL.into_iter().zip([2.0, 2.2]) {
            for place in places {
                let scenario = learned_at(name, place, "criterion = \"d\"");
                let case = Case::new(&scenario).expect("measured");
                let splits = case.splits(None).expect("as the file says");
                let nominal = case.nominal(&splits[0].training).expect("fitted");
                let fit = case.fit(&case.writable(), &splits[0].training, Some(nominal.state())).expect("fitted");
                let asked = case.asked_about(fit.state(), &splits);
                let expected = case.more_rows(&fit, &asked, None, (&case.noise(&fit), None)).expected_mm.expect("told");
                let rms = Figures::of(&case.residuals(&fit, &splits[0].held_out)).rms_mm.expect("lengths");
                let sigma_mm = case.measurement_model().sigma() * 1e3;
                let found = (rms * rms - 3.0 * sigma_mm * sigma_mm).max(0.0).sqrt();
                let ratio = found / expected;
                assert!((0.5..most).contains(&ratio), "{name} {place}: {found} mm found, {expected} expected");
            }
        }
    }

    /// Where no socket is held out, places anywhere in reach are asked about, with several postures of each.
    #[test]
    fn without_held_out_sockets_it_is_asked_anywhere() {
        let scenario = builtin("panda-sockets").expect("built in");
        let case = Case::new(&scenario).expect("measured");
        let state =
            case.nominal(&case.splits(None).expect("as the file says")[0].training).expect("fitted").state().clone();
        let asked = case.asked_about(&state, &[]);
        assert!(asked.configurations.len() > 100 && asked.places.len() == asked.configurations.len());
        let points = asked.points(&state);
        for (place, point) in asked.places.iter().zip(&points) {
            let first = asked.places.iter().position(|other| other == place).expect("itself");
            assert!((points[first] - point).norm() < 1e-9);
        }
        assert!(asked.configurations.iter().all(|posture| scenario.robot.limits.contains(posture)));
    }
}
