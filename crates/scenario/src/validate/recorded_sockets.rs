//! Sockets that the columns of a table name.

use std::collections::HashMap;

use super::{Check, measured::SocketColumns, raw, sockets::unguessed};
use crate::{HeldOut, HeldOutRule, Measurements, Robot, SocketSpec, SpacingSpec};
use body_schema_engine::{
    model::{Block, Layout},
    sensing::Observation,
};
use body_schema_table::is_absent;

/// The default noise at the target from play and from the joints, metres.
pub(super) const SIGMA_M: f64 = 2e-4;
/// The default standard deviation of the distance between two sockets, metres.
pub(super) const SIGMA_DISTANCE_M: f64 = 1e-4;

impl Check<'_> {
    /// Makes every pair of a place and a socket a socket of the robot: to learn from, where any fold has training rows there, or
    /// else held out.
    pub(super) fn recorded_sockets(
        &mut self,
        raw: &raw::Scenario,
        columns: &SocketColumns,
        rows: &mut Measurements,
        held_out: &HeldOut,
        robot: &mut Robot,
    ) -> Option<()> {
        let held = raw.held.as_ref()?;
        let (span, held) = (held.span(), held.get_ref());
        let target = match &held.target {
            Some(name) => self.target_named("sockets.target", name, robot)?,
            None => 0,
        };
        let sigma_m = held.sigma_m.as_ref().map_or(SIGMA_M, |sigma| self.positive("sockets.sigma_m", sigma));
        let label = |row: usize| {
            let of = |title: &String| rows.labels[title][row].clone();
            (columns.place.as_ref().map(of), of(&columns.socket))
        };
        // What seeds draw may be any row.
        let mut is_trained = vec![matches!(held_out.rule, HeldOutRule::Count(_)); rows.rows()];
        held_out.folds().iter().flat_map(|(training, _)| training).for_each(|row| is_trained[*row] = true);
        let order =
            (0..rows.rows()).filter(|row| is_trained[*row]).chain((0..rows.rows()).filter(|row| !is_trained[*row]));
        let mut numbers: HashMap<(Option<String>, String), usize> = HashMap::new();
        for row in order {
            let (place, name) = label(row);
            // A row may hold nothing.
            let label = (place.clone(), name.clone());
            if is_absent(&name) || numbers.contains_key(&label) {
                continue;
            }
            numbers.insert(label, numbers.len());
            let posture = rows.configurations[row].clone();
            let at = robot.state.target_at(target, &posture);
            let socket = SocketSpec { name, place, target, at, posture, is_guessed: false, sigma_m };
            if is_trained[row] {
                robot.known.push((Block::Socket(robot.sockets.len()), unguessed()));
                robot.state.sockets.push(at);
                robot.sockets.push(socket);
            } else {
                robot.held_out_sockets.push(socket);
            }
        }
        rows.sockets = (0..rows.rows()).map(|row| numbers.get(&label(row)).copied()).collect();
        let blocks: Vec<Block> = robot.layout.blocks().map(|(block, _)| block).collect();
        let sockets = (0..robot.sockets.len()).map(Block::Socket);
        robot.layout = Layout::new(&robot.state, blocks.into_iter().chain(sockets));
        let distance = match &held.distance_m {
            Some(distance) => {
                let sigma = held.sigma_distance_m.as_ref();
                let sigma = sigma.map_or(SIGMA_DISTANCE_M, |sigma| self.positive("sockets.sigma_distance_m", sigma));
                let distance = self.positive("sockets.distance_m", distance);
                self.pairs(span, robot, sigma)?;
                distance
            }
            None => 0.0,
        };
        complete_observations(rows, robot, distance);
        Some(())
    }

    /// Adds a known distance between the two sockets of every tool.
    pub(super) fn pairs(&mut self, span: std::ops::Range<usize>, robot: &mut Robot, sigma_m: f64) -> Option<()> {
        for one in 0..robot.sockets.len() {
            let place = &robot.sockets[one].place;
            let there: Vec<usize> =
                (0..robot.sockets.len()).filter(|other| robot.sockets[*other].place == *place).collect();
            match there[..] {
                [first, second] if first == one => {
                    robot.spacings.push(SpacingSpec { sockets: [first, second], sigma_m })
                }
                [_] | [_, _] => {}
                _ => {
                    let what = format!("{} sockets stand together, and a distance is between two", there.len());
                    let hint = "give each pair a place of its own, or leave `distance_m` out";
                    self.problem(span, "sockets.distance_m", what, hint);
                    return None;
                }
            }
        }
        Some(())
    }
}

/// Adds to every row that a target was held, and the prior observations, in the order of the measurement model: sensors, sockets, distances.
fn complete_observations(rows: &mut Measurements, robot: &Robot, distance_m: f64) {
    let (sockets, spacings) = (robot.sockets.len(), robot.spacings.len());
    let sensors = rows.observations.first().map_or(0, |observation| observation.readings.len());
    for (observation, held) in rows.observations.iter_mut().zip(&rows.sockets) {
        let is_held = |socket| (*held == Some(socket)).then(|| vec![0.0; 3]);
        observation.readings.extend((0..sockets).map(is_held));
        observation.readings.resize(sensors + sockets + spacings, None);
    }
    if spacings > 0 {
        let mut known = Observation::missed(sensors + sockets);
        known.readings.resize(sensors + sockets + spacings, Some(vec![distance_m]));
        rows.beforehand = Some(known);
    }
}
