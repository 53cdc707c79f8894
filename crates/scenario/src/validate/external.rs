//! The description of a robot elsewhere: the keys of a file that replays a table, without the table.
//!
//! Sockets, which a table names in its columns, are listed: `[[socket]]` with `name`, `place` and `posture_deg`, a posture in
//! which the target was in it. What is common to all of them stands in `[sockets]`, as it does beside a table.

use toml::Spanned;

use super::{
    Check,
    measured::told,
    raw,
    recorded_sockets::{SIGMA_DISTANCE_M, SIGMA_M},
};
use crate::{Prior, Robot, WorldSpec};
use body_schema_engine::sensing::{MeasurementModel, Observation};
use body_schema_table::{TableError, Titles};

impl Check<'_> {
    /// Checks that the file has no keys of a table or of a simulated world; `None` has left a problem behind.
    pub(super) fn nothing_recorded_or_simulated(&mut self, raw: &raw::Scenario) -> Option<()> {
        let found = self.problems.len();
        let simulated = "remove it; it belongs to a simulated world, and this robot is a real one";
        let foreign = [
            (
                "measurements",
                raw.measurements.as_ref().map(Spanned::span),
                "remove it; what is measured is told, observation by observation",
            ),
            ("initial_error", raw.initial_error.as_ref().map(Spanned::span), simulated),
            ("head", raw.head.as_ref().map(Spanned::span), simulated),
            ("change", raw.change.as_ref().map(Spanned::span), simulated),
            ("outliers", raw.outliers.as_ref().map(Spanned::span), simulated),
        ];
        for (key, span, hint) in foreign {
            span.into_iter().for_each(|span| self.problem(span, key, "this robot is elsewhere", hint));
        }
        if raw.robot.urdf.is_none() {
            let hint = "add the text of the robot's URDF";
            self.problem(raw.name.span(), "robot.urdf", "missing", hint);
        }
        for (index, socket) in raw.sockets.iter().enumerate() {
            let (span, socket) = (socket.span(), socket.get_ref());
            let given = [
                ("at_m", socket.at_m.is_some()),
                ("known", !socket.known.is_exact()),
                ("held_out", socket.held_out),
                ("to", socket.to.is_some()),
                ("distance_m", socket.distance_m.is_some()),
                ("sigma_distance_m", socket.sigma_distance_m.is_some()),
            ];
            for (key, _) in given.into_iter().filter(|(_, is_given)| *is_given) {
                let hint = "remove it; `distance_m` and `sigma_distance_m` of [sockets] say how far the two of a place are apart";
                self.problem(
                    span.clone(),
                    format!("socket[{index}].{key}"),
                    "of a real socket nobody knows this",
                    hint,
                );
            }
        }
        if let (Some(held), true) = (&raw.held, raw.sockets.is_empty()) {
            let hint = "add `[[socket]]`s, each with `name`, `place` and `posture_deg`, a posture in which the target is in it";
            self.problem(held.span(), "socket", "missing: [sockets] says what is known of them", hint);
        }
        (self.problems.len() == found).then_some(())
    }

    /// Checks that a table can be written in the columns that sensors name, and read again.
    fn columns_to_write(&mut self, raw: &raw::Scenario, robot: &Robot) {
        for keys in raw.sensor.iter().flat_map(|sensors| &sensors.get_ref().0) {
            let Some(columns) = &keys.get_ref().columns else { continue };
            let titles = Titles::listed(columns.clone());
            let read = titles.and_then(|titles| titles.reading_titled(told(keys.get_ref(), robot).0, columns));
            if let Err(TableError { what, hint }) = read {
                let what = format!("the session's observations.csv {what}");
                self.problem(keys.span(), "sensor.columns", what, hint);
            }
        }
    }

    /// Gives every socket the keys that are common to all.
    pub(super) fn share_what_sockets_have_in_common(&mut self, raw: &mut raw::Scenario) {
        let Some(held) = &raw.held else { return };
        let (span, held) = (held.span(), held.get_ref());
        for socket in raw.sockets.iter_mut().map(Spanned::get_mut) {
            let sigma = held.sigma_m.clone().unwrap_or_else(|| Spanned::new(span.clone(), SIGMA_M));
            socket.sigma_m.get_or_insert(sigma);
            if let (None, Some(target)) = (&socket.target, &held.target) {
                socket.target = Some(target.clone());
            }
        }
    }

    /// Adds the distance between the two sockets of every place, if it is known.
    pub(super) fn space_sockets(&mut self, raw: &raw::Scenario, robot: &mut Robot) {
        let Some((held, distance)) =
            raw.held.as_ref().and_then(|held| Some((held, held.get_ref().distance_m.as_ref()?)))
        else {
            return;
        };
        self.positive("sockets.distance_m", distance);
        let sigma = held.get_ref().sigma_distance_m.as_ref();
        let sigma = sigma.map_or(SIGMA_DISTANCE_M, |sigma| self.positive("sockets.sigma_distance_m", sigma));
        // Where more than two stand together it has left a problem behind.
        let _ = self.pairs(held.span(), robot, sigma);
    }

    /// The world of a robot elsewhere.
    pub(super) fn outside(
        &mut self,
        raw: &raw::Scenario,
        robot: &Robot,
        measurement_model: Option<&MeasurementModel>,
        prior: &Prior,
    ) -> WorldSpec {
        let watch = match (&raw.view, measurement_model) {
            (Some(view), Some(measurement_model)) => self.view(view, robot, measurement_model, Some(prior)),
            _ => None,
        };
        self.columns_to_write(raw, robot);
        let distance = raw.held.as_ref().and_then(|held| held.get_ref().distance_m.as_ref());
        let known = measurement_model.map(|measurement_model| {
            let own = robot.sockets.len() + robot.spacings.len() + robot.baselines.len();
            let mut known = Observation::missed(measurement_model.sensors().len() - own + robot.sockets.len());
            known.readings.extend(robot.spacings.iter().map(|_| distance.map(|distance| vec![*distance.get_ref()])));
            known.readings.extend(robot.known_baselines().map(Some));
            known
        });
        WorldSpec::External { watch, beforehand: known.filter(|known| !known.is_miss()) }
    }
}
