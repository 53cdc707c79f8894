//! The world of a scenario: simulated or measured.

use toml::Spanned;

use super::{Check, raw};
use std::sync::Arc;

use crate::{HeldOut, InitialError, Measurements, Prior, Robot, WorldSpec};
use body_schema_engine::sensing::{MeasurementModel, NoiseModel, Sensor, Socket, Spacing};
use body_schema_experiment::Outliers;

impl Check<'_> {
    pub(super) fn world(
        &mut self,
        raw: &raw::Scenario,
        robot: &Robot,
        measurement_model: Option<&MeasurementModel>,
        prior: &Prior,
        recorded: Option<(Measurements, HeldOut)>,
    ) -> Option<WorldSpec> {
        if self.is_external {
            return Some(self.outside(raw, robot, measurement_model, prior));
        }
        let socket = raw.sockets.first().map(Spanned::span);
        let is_replayed = raw.measurements.is_some();
        let senses = raw.sensor.is_some() || (socket.is_some() && !is_replayed);
        let of_tables =
            [("sockets", raw.held.as_ref().map(Spanned::span)), ("held_out", raw.held_out.as_ref().map(Spanned::span))];
        for (key, span) in of_tables.into_iter().filter_map(|(key, span)| Some((key, span?))).filter(|_| !is_replayed) {
            let hint = "remove it, or add [measurements] with a file";
            self.problem(span, key, "it tells of a table, and there is none", hint);
        }
        match (senses, &raw.initial_error, &raw.measurements) {
            (true, Some(error), None) => {
                let marker_m = error.get_ref().marker_m.as_ref();
                if raw.robot.learn_marker && marker_m.is_none() {
                    let hint = "add `marker_m = …`, or set `learn_marker = false`";
                    self.problem(error.span(), "initial_error.marker_m", "the marker is learned", hint);
                }
                let error = error.get_ref();
                let angle = self.number(
                    "initial_error.angle_deg",
                    &error.angle_deg,
                    |angle| (0.0..=180.0).contains(&angle),
                    "an angle from 0 to 180 degrees",
                );
                let watch = match (&raw.head, &raw.view, measurement_model) {
                    (Some(head), None, _) => self.head(head, robot),
                    (None, Some(view), Some(measurement_model)) => self.view(view, robot, measurement_model, None),
                    (Some(_), Some(view), _) => {
                        let hint = "remove [view]: the head says which pose is in view";
                        self.problem(view.span(), "view", "there is a head that watches", hint);
                        None
                    }
                    _ => None,
                };
                let change = raw.change.as_ref().map(|change| self.change(change.get_ref(), robot));
                Some(WorldSpec::Simulated {
                    initial_error: InitialError {
                        draw: error.draw,
                        angle_rad: angle.to_radians(),
                        point_m: self.not_negative("initial_error.point_m", &error.point_m),
                        marker_m: marker_m.map_or(0.0, |size| self.not_negative("initial_error.marker_m", size)),
                    },
                    watch,
                    change: change.flatten().map(Box::new),
                    outliers: raw.outliers.as_ref().map(|outliers| self.outliers(outliers.get_ref())),
                })
            }
            (_, None, Some(_)) => {
                let head = raw.head.as_ref().map(|head| ("head", head.span()));
                let change = raw.change.as_ref().map(|change| ("change", change.span()));
                let outliers = raw.outliers.as_ref().map(|outliers| ("outliers", outliers.span()));
                let sockets = socket.map(|span| ("socket", span));
                for (key, span) in head.into_iter().chain(change).chain(outliers).chain(sockets) {
                    let hint = "remove it; it belongs to a simulated world";
                    self.problem(
                        span,
                        key,
                        "recorded measurements cannot be watched, changed, spoilt or held in sockets",
                        hint,
                    );
                }
                recorded.map(|(measurements, held_out)| WorldSpec::Measured { measurements, held_out })
            }
            (_, error, measurements) => {
                let span = [raw.sensor.as_ref().map(Spanned::span), error.as_ref().map(Spanned::span)]
                    .into_iter()
                    .chain([measurements.as_ref().map(Spanned::span)])
                    .flatten()
                    .next();
                let what = "a scenario is either simulated or measured";
                let hint = "write [sensor] (or [[socket]]s) and [initial_error] for a simulated world, or [measurements] without \
                            [initial_error] for a measured one";
                self.problem(span.unwrap_or(0..0), "sensor, initial_error, measurements", what, hint);
                None
            }
        }
    }

    fn outliers(&mut self, raw: &raw::Outliers) -> Outliers {
        let hint = "a share of readings, from 0 to 1";
        Outliers {
            fraction: self.number("outliers.fraction", &raw.fraction, |share| (0.0..=1.0).contains(&share), hint),
            box_m: self.positive("outliers.box_m", &raw.box_m),
        }
    }

    /// The measurement model: the sensors of a simulated world; where measurements are replayed, a tracker with the
    /// noise that the filter assumes.
    pub(super) fn measurement_model(&mut self, raw: &raw::Scenario, robot: &Robot) -> Option<Arc<MeasurementModel>> {
        let equipment = &robot.equipment;
        let own = own_sensors(robot);
        let Some(sensors) = &raw.sensor else {
            if !robot.sockets.is_empty() {
                return Some(Arc::new(MeasurementModel::new(own)));
            }
            let variance = raw.filter.get_ref().measurement_variance_m2.as_ref().map(|variance| *variance.get_ref());
            return variance.map(|variance| Arc::new(MeasurementModel::tracker(variance.sqrt())));
        };
        let given = sensors.get_ref();
        let mut measurement_model = Vec::new();
        for (index, keys) in given.0.iter().enumerate() {
            if let (Some(_), None, false) = (&keys.get_ref().columns, &raw.measurements, self.is_external) {
                let hint = "remove it, or add [measurements] with a file";
                self.problem(keys.span(), format!("sensor[{index}].columns"), "there is no table", hint);
            }
            let section = if given.0.len() > 1 { format!("sensor[{index}]") } else { "sensor".to_owned() };
            let span = if given.0.len() > 1 { keys.span() } else { sensors.span() };
            match keys.get_ref().sensor(equipment) {
                Ok(sensor) if given.0.len() + own.len() > 1 && sensor.sigma() == 0.0 => {
                    let what = "several sensors are weighed by their noise, and this one has none";
                    self.problem(span, format!("{section}.sigma_m"), what, "write a number above 0");
                }
                Ok(sensor) => measurement_model.push(sensor),
                Err(error) => {
                    let place = raw::key_in(self.text, span, &error.key);
                    self.problem(place, format!("{section}.{}", error.key), error.what, error.hint);
                }
            }
        }
        if given.0.is_empty() {
            self.problem(sensors.span(), "sensor", "there is no sensor", "add `sigma_m = 0.01`, say");
        }
        if let Some(head) = raw.head.as_ref().filter(|_| {
            measurement_model.iter().any(|sensor| sensor.subject().point() != Some(0)) || !robot.sockets.is_empty()
        }) {
            let hint = "leave [head] out, or use sensors of the marker's position alone";
            self.problem(head.span(), "head", "a head watches the marker, and not what another sensor measures", hint);
        }
        if let Some(outliers) =
            raw.outliers.as_ref().filter(|_| measurement_model.iter().any(|sensor| sensor.subject().point().is_none()))
        {
            let hint = "leave [outliers] out, or use sensors of positions alone";
            self.problem(
                outliers.span(),
                "outliers",
                "they replace positions, and another sensor measures something else",
                hint,
            );
        }
        let complete = measurement_model.len() == given.0.len() && !measurement_model.is_empty();
        measurement_model.extend(own);
        complete.then(|| Arc::new(MeasurementModel::new(measurement_model)))
    }
}

/// The sensors that come with the sockets of a robot, and what is known of its equipment.
fn own_sensors(robot: &Robot) -> Vec<Sensor> {
    let held = robot.sockets.iter().enumerate();
    let held = held.map(|(socket, spec)| Sensor::even(Socket { target: spec.target, socket }, spec.sigma_m));
    let spacings = robot.spacings.iter();
    let spacings = spacings.map(|spec| Sensor::even(Spacing { sockets: spec.sockets }, spec.sigma_m));
    let baselines = robot.baselines.iter();
    // A position and a rotation have a noise each.
    let baselines =
        baselines.filter_map(|spec| Sensor::new(spec.between, NoiseModel::parts([spec.sigma_m, spec.sigma_rad])).ok());
    held.chain(spacings).chain(baselines).collect()
}
