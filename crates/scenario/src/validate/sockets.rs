//! Places beside the robot in which a target is held.

use nalgebra::Point3;
use toml::Spanned;

use super::{Check, raw};
use crate::{Known, Robot, SocketSpec, SpacingSpec};
use body_schema_engine::model::{Block, Manifold};

/// The prior's standard deviation, per coordinate, of a socket without a guess: what is held there tells where it is.
const UNGUESSED_M: f64 = 1.0;
/// The most that a given posture may have the target away from its socket, metres: whoever pushes it in sees where it
/// goes.
const PUSHED_M: f64 = 0.02;
/// The most standard deviations by which a stated distance may be wrong.
const HONEST: f64 = 4.0;

/// The prior knowledge of a socket without a guess.
pub(super) fn unguessed() -> Known {
    Known::Within { length_m: UNGUESSED_M, angle_rad: UNGUESSED_M, other: UNGUESSED_M }
}

impl Check<'_> {
    /// Adds the sockets of a file to a robot.
    pub(super) fn sockets(&mut self, scenario: &raw::Scenario, robot: &mut Robot) {
        // Those of recorded data are told by columns.
        let sockets = if scenario.measurements.is_none() { &scenario.sockets[..] } else { &[] };
        // Those that something is known of the distance to.
        let mut distances = Vec::new();
        for (index, spanned) in sockets.iter().enumerate() {
            let key = format!("socket[{index}]");
            let Some(socket) = self.socket(&key, spanned, robot) else { continue };
            let raw = spanned.get_ref();
            if raw.held_out {
                robot.held_out_sockets.push(socket);
                continue;
            }
            let number = robot.sockets.len();
            let known = self.known(&key, &raw.known, spanned);
            robot.known.push((Block::Socket(number), known.unwrap_or_else(unguessed)));
            robot.state.sockets.push(socket.at);
            robot.sockets.push(SocketSpec { is_guessed: known.is_some(), ..socket });
            distances.push((key, spanned, number));
        }
        for (key, spanned, number) in distances {
            let spacing = self.spacing(&key, spanned, number, robot);
            robot.spacings.extend(spacing);
        }
        if let (true, Some(first)) = (robot.sockets.is_empty() && scenario.sensor.is_none(), sockets.first()) {
            let hint = "leave `held_out` away from one, or add a [sensor]";
            self.problem(first.span(), "socket.held_out", "nothing is left to learn from", hint);
        }
    }

    fn socket(&mut self, key: &str, spanned: &Spanned<raw::Socket>, robot: &Robot) -> Option<SocketSpec> {
        let raw = spanned.get_ref();
        let field = |field: &str| format!("{key}.{field}");
        let place = raw.place.as_ref().map(|place| place.get_ref().clone());
        let others = robot.all_sockets().filter(|other| other.place == place);
        self.free_name(&field("name"), &raw.name, others.map(|other| other.name.as_str()));
        let target = match &raw.target {
            None => 0,
            Some(name) => self.target_named(&field("target"), name, robot)?,
        };
        let sigma_m = match &raw.sigma_m {
            Some(sigma) => self.positive(&field("sigma_m"), sigma),
            None if raw.held_out => 1.0,
            None => {
                let hint = "add `sigma_m = 0.0002`, say: what play and the noise of the joints amount to at the target, in metres";
                self.problem(spanned.span(), field("sigma_m"), "missing", hint);
                return None;
            }
        };
        if raw.held_out {
            let sigma = raw.sigma_m.as_ref().map(|it| ("sigma_m", it.span()));
            let distance = raw.distance_m.as_ref().map(|it| ("distance_m", it.span()));
            for (name, span) in sigma.into_iter().chain(distance) {
                let hint = "remove it, or `held_out`";
                self.problem(span, field(name), "nobody learns from a socket that is held out", hint);
            }
        }
        let Some(given) = &raw.posture_deg else {
            let hint = "add `posture_deg = […]`, a posture that holds the target there, one position per joint";
            self.problem(spanned.span(), field("posture_deg"), "missing", hint);
            return None;
        };
        let mut posture = self.pose(&field("posture_deg"), given, robot)?;
        let there = robot.state.target_at(target, &posture);
        let at = raw.at_m.as_ref().map_or(there, |at| self.point(&field("at_m"), at));
        if at != there {
            let pushed = Manifold::new(&robot.state, target, at, &robot.limits).nearest(&posture);
            match pushed.filter(|_| (at - there).norm() <= PUSHED_M) {
                Some(pushed) => posture = pushed,
                None => {
                    let what = format!("the target is {:.4} m from the socket there", (at - there).norm());
                    self.problem(given.span(), field("posture_deg"), what, moved_to(&there));
                    return None;
                }
            }
        }
        let name = raw.name.get_ref().clone();
        Some(SocketSpec { name, place, target, at, posture, is_guessed: false, sigma_m })
    }

    /// The known distance from one socket to another.
    fn spacing(
        &mut self,
        key: &str,
        spanned: &Spanned<raw::Socket>,
        number: usize,
        robot: &Robot,
    ) -> Option<SpacingSpec> {
        let raw = spanned.get_ref();
        let field = |field: &str| format!("{key}.{field}");
        let (Some(to), Some(distance), Some(sigma)) = (&raw.to, &raw.distance_m, &raw.sigma_distance_m) else {
            if raw.to.is_some() || raw.distance_m.is_some() || raw.sigma_distance_m.is_some() {
                let hint = "write all three: `to = \"…\"`, `distance_m = …` and `sigma_distance_m = …`, or none";
                self.problem(spanned.span(), field("distance_m"), "a distance leads to a socket, and has a σ", hint);
            }
            return None;
        };
        let here = &robot.sockets[number];
        let found = robot.sockets.iter().position(|other| other.place == here.place && other.name == *to.get_ref());
        let Some(other) = found.filter(|other| *other != number) else {
            let what = if found.is_some() {
                "a socket is no distance from itself".to_owned()
            } else {
                format!("there is no socket `{}` at this place to learn from", to.get_ref())
            };
            let others = robot.sockets.iter().enumerate();
            let names = others.filter(|(index, other)| *index != number && other.place == here.place);
            let names: Vec<&str> = names.map(|(_, other)| other.name.as_str()).collect();
            let hint = match names.is_empty() {
                true => {
                    "remove `to`, `distance_m` and `sigma_distance_m`, or add a [[socket]] at this place".to_owned()
                }
                false => format!("write one of {}", names.join(", ")),
            };
            self.problem(to.span(), field("to"), what, hint);
            return None;
        };
        let told = self.positive(&field("distance_m"), distance);
        let sigma_m = self.positive(&field("sigma_distance_m"), sigma);
        let truly = (here.at - robot.sockets[other].at).norm();
        if (told - truly).abs() > HONEST * sigma_m {
            let what = format!("{told} m is told, and they are {truly:.6} m apart");
            let hint = "correct it, or where one of them is";
            self.problem(distance.span(), field("distance_m"), what, hint);
            return None;
        }
        Some(SpacingSpec { sockets: [number, other], sigma_m })
    }

    pub(super) fn target_named(&mut self, key: &str, name: &Spanned<String>, robot: &Robot) -> Option<usize> {
        let targets = &robot.equipment.targets;
        let found = targets.iter().position(|target| target.name == *name.get_ref());
        if found.is_none() {
            let names: Vec<&str> = targets.iter().map(|target| target.name.as_str()).collect();
            let what = format!("there is no target `{}`", name.get_ref());
            self.problem(name.span(), key, what, format!("write one of {}", names.join(", ")));
        }
        found
    }
}

fn moved_to(there: &Point3<f64>) -> String {
    format!(
        "name a posture that holds the target in it, or leave `at_m` out; in this one the target is at [{:.4}, {:.4}, {:.4}]",
        there.x, there.y, there.z
    )
}
