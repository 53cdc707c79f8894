//! Diagnostics of a scenario's data, and the check of its prior.

use std::collections::BTreeSet;

use nalgebra::{Point3, Vector3};

use super::{
    HeldOutRule, Known, Measurements, Scenario, ScenarioError, WorldSpec,
    resection::{Resected, Resection},
};
use body_schema_diagnostics::{
    Base, Diagnostic, DiagnosticKind, Evidence, Examination, Seen, Subject, examine, few_folds,
};
use body_schema_engine::{
    elementary::hypot,
    model::{Block, PriorError},
    most::middle,
    sensing::{Observation, Occasion, Sensor, present},
};

/// The pictures in which a body's pose is looked for, at most, and their points; the rows of a run of them.
const MOST_PICTURES: usize = 300;
const MOST_POINTS: usize = 6000;
const RUN: usize = 30;
/// The pictures from which on it can be told what most of them say.
const ENOUGH: usize = 6;
/// The deviation of a rotation, radians, below which it tells.
const WELL_TURNED: f64 = 0.1;

/// The share of a body's size in its picture that must be left of its points, and how many σ, so that it does not fit its pictures.
const OFF: f64 = 0.05;
const OFF_SIGMAS: f64 = 10.0;

/// What pictures tell.
struct Pictured {
    /// Where a body or a camera was, or why they do not tell.
    places: Result<Places, String>,
    /// The diagnostic about the pictures themselves.
    diagnostic: Option<Diagnostic>,
}

/// Where a body or a camera was, in the frame of the other.
struct Places {
    /// The link that carries it.
    link: usize,
    /// Its likely place at θ = 0.
    at: Point3<f64>,
    /// The deviation of its place, metres.
    sigma_m: f64,
    seen: Seen,
}

/// The assumed deviation, metres, of a target from where the file has it before any row is looked at; also of a base of which the file says
/// no more.
const TARGET_M: f64 = 0.3;

/// The diagnostic about the pictures of a body, whatever moves it.
fn doubted(all: &[&Resected], name: &str) -> Option<Diagnostic> {
    if all.len() < ENOUGH {
        return None;
    }
    let diagnostic = |kind: DiagnosticKind, what: &str, evidence: String, hint: &str| Diagnostic {
        kind,
        column: Some(name.to_owned()),
        lines: Vec::new(),
        what: what.to_owned(),
        evidence,
        hint: hint.to_owned(),
    };
    let left = |of: &dyn Fn(&Resected) -> f64| middle(all.iter().map(|it| of(it)).collect::<Vec<_>>());
    let (sigmas, share) = (left(&|it| it.left.0)?, left(&|it| it.left.1)?);
    if sigmas > OFF_SIGMAS && share > OFF {
        return Some(diagnostic(
            DiagnosticKind::Order,
            "its points do not fit its pictures, wherever it is",
            format!("{:.0} % of its size in the picture are left where its pose alone is fitted", 100.0 * share),
            "list points_m in the order of the columns, and look over focal_px, size_px and the distortion",
        ));
    }
    let behind = all.iter().filter(|it| it.is_from_behind).count();
    (2 * behind > all.len()).then(|| {
        diagnostic(
            DiagnosticKind::Mirror,
            "its points run the other way round, as in a mirror",
            format!("in {behind} of {} pictures it would be seen from behind", all.len()),
            "list points_m in the order of the columns, and look over the direction in which it faces",
        )
    })
}

impl Scenario {
    /// Examines recorded measurements; `None` where the world is simulated.
    pub fn examine(&self) -> Option<Examination> {
        let WorldSpec::Measured { measurements, held_out } = &self.world else { return None };
        let robot = &self.robot;
        let limits = match &robot.described {
            Some(described) => described.chain.moving().map(|segment| segment.limits).collect(),
            None => robot.limits.joints().iter().copied().map(Some).collect::<Vec<_>>(),
        };
        let held_in: Option<Vec<usize>> = measurements.sockets.iter().copied().collect();
        let held_in = held_in.filter(|sockets| !sockets.is_empty());
        let (tree, link) = (&robot.state.tree, self.examined(measurements));
        let seen = self.seen(measurements, link);
        let pictured = if seen.is_empty() && held_in.is_none() { self.pictured(measurements) } else { None };
        let (places, untold, of_pictures) = match pictured {
            Some(Pictured { places: Ok(places), diagnostic }) => (Some(places), None, diagnostic),
            Some(Pictured { places: Err(why), diagnostic }) => (None, Some(why), diagnostic),
            None => (None, None, None),
        };
        let is_pictured = places.is_some();
        let link = places.as_ref().map_or(link, |places| places.link);
        let mut carriers: Vec<usize> = tree.path(link).collect();
        carriers.reverse();
        let is_whole = tree.is_serial() && link == robot.state.joints.len();
        let subject = Subject {
            columns: &measurements.columns,
            joints: &robot.state.joints,
            carriers: (!is_whole).then_some(carriers.as_slice()),
            limits: &limits,
            target: places.as_ref().map_or_else(|| robot.state.marker(), |places| places.at),
            target_sd_m: TARGET_M,
            learned: &(0..robot.state.joints.len()).map(|joint| robot.layout.is_learned(joint)).collect::<Vec<_>>(),
            zeros_rad: &(0..robot.state.joints.len()).map(|joint| self.zero_rad(joint)).collect::<Vec<_>>(),
            unknowns: robot.layout.dimension(),
            sigma_m: places.as_ref().map_or(self.smoother.sigma, |places| places.sigma_m),
            direction_rad: self.prior.direction_rad,
            point_m: self.prior.point_m,
            base: if places.is_some() { None } else { self.base_said() },
        };
        let listed = match &held_out.rule {
            HeldOutRule::Rows(rows) => rows.as_slice(),
            _ => &[],
        };
        let evidence = Evidence {
            lines: &measurements.lines,
            files: &measurements.files,
            numbers: &measurements.numbers,
            configurations: &measurements.configurations,
            targets: places.into_iter().map(|places| places.seen).chain(seen).collect(),
            sockets: held_in,
            equations: Some(self.equations(measurements)),
            held_out: listed,
            repeated: &measurements.repeated,
        };
        let mut found = examine(&subject, &evidence);
        found.unjudged = untold.or(found.unjudged);
        if self.learns_a_lens() {
            // Places by a lens that is still to be learned are off, and as large as its focal length says.
            found.diagnostics.retain(|diagnostic| {
                !is_pictured || !matches!(diagnostic.kind, DiagnosticKind::Misfit | DiagnosticKind::Size)
            });
        }
        if let Some(diagnostic) =
            of_pictures.filter(|_| found.diagnostics.iter().all(|diagnostic| diagnostic.kind != DiagnosticKind::Mirror))
        {
            found.diagnostics.insert(0, diagnostic);
        }
        if is_pictured && found.diagnostics.iter().any(|diagnostic| matches!(diagnostic.kind, DiagnosticKind::Mirror)) {
            // It is known why they do not fit.
            found.diagnostics.retain(|diagnostic| diagnostic.kind != DiagnosticKind::Misfit);
        }
        if let HeldOutRule::Folds(folds) = held_out.rule {
            found.diagnostics.extend(few_folds(folds, held_out.count_postures(), held_out.rows));
        }
        Some(found)
    }

    /// The number of equations of all measurements. The first row in a socket only places the socket, and adds none.
    fn equations(&self, measurements: &Measurements) -> usize {
        let sensors = self.measurement_model.sensors();
        let always = |observation: &Observation| -> usize {
            let always = sensors.iter().map(|sensor| sensor.subject().occasion == Occasion::Always);
            let read = always.zip(&observation.readings).filter(|(always, _)| *always);
            read.filter_map(|(_, reading)| reading.as_deref()).map(present).sum()
        };
        let measured: usize = measurements.observations.iter().map(always).sum();
        let held: Vec<usize> = measurements.sockets.iter().copied().flatten().collect();
        let places: BTreeSet<usize> = held.iter().copied().collect();
        let beforehand = measurements.beforehand.iter().flat_map(|known| known.readings.iter().flatten());
        measured + 3 * (held.len() - places.len()) + beforehand.map(Vec::len).sum::<usize>()
    }

    /// Whether focal lengths, a centre or the coefficients of a lens are learned.
    fn learns_a_lens(&self) -> bool {
        let is_of_lens = |block: &Block| matches!(block, Block::Intrinsics(_) | Block::Distortion(..));
        self.robot.layout.blocks().any(|(block, _)| is_of_lens(&block))
    }

    /// The stated deviation of a joint's zero; 0 where its offset is not learned.
    fn zero_rad(&self, joint: usize) -> f64 {
        match self.prior.of(Block::Offset(joint)) {
            Some(Known::Within { angle_rad, .. }) => angle_rad,
            _ => 0.0,
        }
    }

    /// The stated pose of the base, and its deviations.
    fn base_said(&self) -> Option<Base> {
        let at = self.robot.state.base;
        match (self.robot.layout.block(Block::Base), self.prior.of(Block::Base)) {
            (None, _) => Some(Base { at, sd_m: Known::EXACTLY, sd_rad: Known::EXACTLY }),
            (_, Some(Known::Within { length_m, angle_rad, .. })) if length_m < TARGET_M => {
                Some(Base { at, sd_m: length_m, sd_rad: angle_rad })
            }
            _ => None,
        }
    }

    /// The link on which targets are examined: the last; where joints branch that of the first target whose position is measured or
    /// that is held in a socket.
    fn examined(&self, measurements: &Measurements) -> usize {
        let (state, sensors) = (&self.robot.state, self.measurement_model.sensors());
        let seen_by = |channel: usize| {
            let readings = measurements.observations.iter().filter_map(|it| it.readings.get(channel)?.as_ref());
            Some(readings.filter_map(|reading| sensors[channel].subject().position(reading)).next()?.0)
        };
        let held = self.robot.all_sockets().map(|socket| socket.target);
        let mut targets = (0..sensors.len()).filter_map(seen_by).chain(held);
        match targets.next() {
            Some(target) if !state.tree.is_serial() => state.targets[target].link,
            _ => state.joints.len(),
        }
    }

    /// The measured positions of targets on a link.
    fn seen(&self, measurements: &Measurements, link: usize) -> Vec<Seen> {
        let state = &self.robot.state;
        let sensors = self.measurement_model.sensors().iter().zip(&measurements.readings).enumerate();
        let seen = sensors.filter_map(|(index, (sensor, name))| {
            let position =
                |observation: &Observation| sensor.subject().position(observation.readings.get(index)?.as_ref()?);
            let (target, _) = measurements.observations.iter().find_map(position)?;
            let points = measurements.observations.iter().map(|observation| position(observation).map(|seen| seen.1));
            // A pose: its rotation follows as a rotation vector.
            let is_pose = sensor.subject().is_pose();
            let turn = |observation: &Observation| {
                let turn =
                    observation.readings.get(index).and_then(Option::as_ref).and_then(|reading| reading.get(3..6));
                turn.map_or_else(Vector3::zeros, Vector3::from_column_slice)
            };
            let turns = measurements.observations.iter().filter(|_| is_pose).map(turn).collect();
            let arm_m =
                is_pose.then(|| sensor.nominal(0).0 / sensor.nominal(3).0).filter(|arm| arm.is_finite() && *arm > 0.0);
            (state.targets[target].link == link).then(|| Seen {
                name: name.clone(),
                points: points.collect(),
                turns,
                arm_m,
                mirrored: Vec::new(),
            })
        });
        seen.collect()
    }

    /// What the pictures tell of a body with known points on a link and a camera that stands beside the robot, or of a camera on a link and
    /// such a body beside it.
    fn pictured(&self, measurements: &Measurements) -> Option<Pictured> {
        let sensors = self.measurement_model.sensors().iter().zip(&measurements.readings).enumerate();
        let mut first = None;
        for (index, (sensor, name)) in sensors {
            let found = self.pictured_by(measurements, index, sensor, name);
            if found.as_ref().is_some_and(|found| found.places.is_ok()) {
                return found;
            }
            first = first.or(found);
        }
        first
    }

    fn pictured_by(&self, of: &Measurements, index: usize, sensor: &Sensor, name: &str) -> Option<Pictured> {
        let state = &self.robot.state;
        let (camera, target) = sensor.subject().sight()?;
        let (camera, target) = (&state.devices[camera], &state.targets[target]);
        // Base and body take up one motion each: where both move with the robot there is a third.
        let (link, at, is_eye) = match (camera.link.unwrap_or(0), target.link) {
            (0, link) if link > 0 => (link, target.place.origin(), false),
            (link, 0) if link > 0 => (link, Point3::from(camera.pose.translation.vector), true),
            _ => return None,
        };
        let resection = Resection::new(state, sensor)?;
        // Some runs of rows, spread over the table: neighbours tell whether rows are late.
        let most = (MOST_POINTS / sensor.equations().max(1)).clamp(RUN, MOST_PICTURES);
        let (count, runs) = (of.observations.len(), most / RUN);
        let is_taken = |row: usize| count <= most || row - (row * runs / count * count).div_ceil(runs) < RUN;
        let found = of.observations.iter().enumerate().map(|(row, observation)| {
            let picture = observation.readings.get(index)?.as_ref().filter(|_| is_taken(row))?;
            Some((resection.pose(picture)?, resection.pose(&resection.mirrored(picture))?))
        });
        let found: Vec<Option<(Resected, Resected)>> = found.collect();
        let all: Vec<&Resected> = found.iter().flatten().map(|(as_is, _)| as_is).collect();
        // Of a board all columns would be many.
        let name = match name.split(", ").collect::<Vec<_>>().as_slice() {
            [first, _, .., last] => format!("{first} … {last}"),
            _ => name.to_owned(),
        };
        let diagnostic = doubted(&all, &name);
        let is_decided = |it: &Resected| it.is_decided && it.sd.1 < WELL_TURNED;
        let decided = all.iter().filter(|it| is_decided(it)).count();
        let is_turned = decided >= ENOUGH && 2 * decided >= all.len();
        if all.is_empty() {
            return Some(Pictured {
                places: Err(format!("no picture of `{name}` shows four points of a body")),
                diagnostic,
            });
        }
        if is_eye && !is_turned {
            let why = format!(
                "{decided} of {} pictures of `{name}` tell within {:.0} degrees how the body is turned to the camera on the robot, and half of \
                 them must, {ENOUGH} at least; more do of a larger body, or of a nearer one",
                all.len(),
                WELL_TURNED.to_degrees()
            );
            return Some(Pictured { places: Err(why), diagnostic });
        }
        // The place of a camera is off by as much as the body's turn moves it.
        let place = |it: &Resected| if is_eye { it.pose.inverse() } else { it.pose };
        let mut seen = Seen { name, arm_m: None, ..Seen::default() };
        let (mut lengths, mut angles) = (Vec::new(), Vec::new());
        for pair in &found {
            let used = pair.as_ref().filter(|(as_is, _)| !is_turned || is_decided(as_is));
            seen.points.push(used.map(|(it, _)| Point3::from(place(it).translation.vector)));
            seen.mirrored.push(used.map(|(_, mirrored)| place(mirrored)));
            if is_turned {
                seen.turns.push(used.map_or_else(Vector3::zeros, |(it, _)| place(it).rotation.scaled_axis()));
            }
            if let Some((it, _)) = used {
                let far = if is_eye { it.pose.translation.vector.norm() } else { 0.0 };
                lengths.push(hypot(it.sd.0, it.sd.1 * far));
                angles.push(it.sd.1);
            }
        }
        let sigma_m = middle(lengths)?;
        seen.arm_m = middle(angles).filter(|_| is_turned).map(|angle| sigma_m / angle);
        Some(Pictured { places: Ok(Places { link, at, sigma_m, seen }), diagnostic })
    }

    /// Checks, without building any learner, that learners can begin from the prior.
    ///
    /// # Errors
    ///
    /// [`ScenarioError::Prior`] if the square of a standard deviation, or its reciprocal, underflows or overflows.
    pub fn check_prior(&self) -> Result<(), ScenarioError> {
        let deviations = self.prior.standard_deviations(&self.robot.layout);
        if deviations.iter().all(|sd| (sd * sd).is_normal() && (sd * sd).recip().is_normal()) {
            return Ok(());
        }
        let source = PriorError::NotPositive(deviations.len());
        Err(ScenarioError::Prior { scenario: self.name.clone(), source })
    }
}
