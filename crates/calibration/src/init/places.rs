//! Sockets that a table names: at which place to learn, and how far two of them are apart.
//!
//! Rows of one place are learned from, and those of all others are predicted. The place is chosen whose rows leave the least expected
//! scatter at the others, by design alone: rows of sockets hold only joints' readings, so that nothing by which the calibration is judged
//! later enters the choice.

use std::io::Read;

use super::Guess;
use crate::Case;
use body_schema_scenario::Scenario;
use body_schema_table::{Columns, Table, TableError, is_absent};

/// The places of a table and their sockets, in the order of its rows.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Held {
    places: Vec<(String, Vec<String>)>,
}

/// The expected result of learning at a place.
struct Expected<'h> {
    place: &'h str,
    /// The scatter expected at all other places, root mean square, millimetres.
    scatter_mm: f64,
}

/// A function that writes a calibration file that learns at a place, with a distance of sockets in metres.
type Written<'w> = &'w dyn Fn(Option<&str>, Option<f64>) -> Option<Scenario>;

impl Held {
    /// Reads the columns of place and socket.
    ///
    /// # Errors
    ///
    /// [`TableError`] if a column is missing or a line cannot be read.
    pub fn read<R: Read>(table: Table<R>, [place, socket]: [&str; 2]) -> Result<Self, TableError> {
        let labels = vec![table.titles().label(place)?, table.titles().label(socket)?];
        let mut held = Self::default();
        for row in table.rows(Columns { labels, ..Columns::default() }) {
            let [place, socket] = <[String; 2]>::try_from(row?.labels).unwrap_or_default();
            if is_absent(&place) || is_absent(&socket) {
                continue;
            }
            match held.places.iter_mut().find(|(known, _)| *known == place) {
                Some((_, sockets)) if sockets.contains(&socket) => {}
                Some((_, sockets)) => sockets.push(socket),
                None => held.places.push((place, vec![socket])),
            }
        }
        Ok(held)
    }

    /// The place to learn at, if there are several. Guesses and missing knowledge are added to `guesses`, the latter first.
    pub fn choose(&self, distance_m: Option<f64>, written: Written<'_>, guesses: &mut Vec<Guess>) -> Option<String> {
        let trained = match self.places.as_slice() {
            [] | [_] => {
                guesses.push(Guess::new("held out: every row once, in five folds, as there is one place alone"));
                None
            }
            [(first, _), ..] => {
                let (place, why) = self.best(written).unwrap_or((first, String::new()));
                guesses.push(Guess::new(format!("held out: all places but `{place}`{why}")));
                Some(place.to_owned())
            }
        };
        let size = |distance_m| size_mm(trained.as_deref(), distance_m, written);
        match distance_m {
            Some(metres) => guesses.push(Guess::new(format!(
                "sockets: the two of a place are {:.2} mm apart, as was said: it tells how large the robot is{}",
                1e3 * metres,
                size(distance_m).map(|mm| format!(", a span of 1 m to ± {mm:.1} mm")).unwrap_or_default()
            ))),
            None => guesses.insert(0, self.missing(&size)),
        }
        trained
    }

    /// The place whose rows are expected to tell most about all others, with a sentence on how much.
    fn best(&self, written: Written<'_>) -> Option<(&str, String)> {
        let expected_scatter =
            |(place, _): &'_ (String, Vec<String>)| Case::new(&written(Some(place), None)?).ok()?.scatter_mm();
        let mut expected: Vec<Expected<'_>> = self
            .places
            .iter()
            .filter_map(|held| Some(Expected { place: &held.0, scatter_mm: expected_scatter(held)? }))
            .collect();
        expected.sort_by(|a, b| a.scatter_mm.total_cmp(&b.scatter_mm));
        // Of places that are as good the first by name: the order of the rows is not to decide.
        let as_good = expected.iter().take_while(|it| it.scatter_mm <= AS_GOOD * expected[0].scatter_mm);
        let (best, worst) = (as_good.min_by_key(|it| it.place)?, expected.last()?);
        let why = format!(
            ", whose postures tell most about the others: the ball is expected to scatter there by {:.2} mm, by up to {:.2} mm if \
             another is trained on (`{}`)",
            best.scatter_mm, worst.scatter_mm, worst.place
        );
        Some((best.place, if expected.len() > 1 { why } else { String::new() }))
    }

    /// A sentence on what is missing about the sockets, what that costs, and what to do.
    fn missing(&self, size: &dyn Fn(Option<f64>) -> Option<f64>) -> Guess {
        let costs = size(None).map(|mm| format!(", a span of 1 m is known to ± {mm:.1} mm alone")).unwrap_or_default();
        if !self.places.iter().any(|(_, sockets)| sockets.len() == 2) {
            return Guess::new(format!(
                "MISSING: a distance. With one socket at a place nothing tells how large the robot is{costs}; hold the target in a \
                 second one at a known distance from the first"
            ));
        }
        let with = size(Some(USUAL_M)).map(|mm| format!(", with it to ± {mm:.1} mm")).unwrap_or_default();
        Guess::new(format!(
            "MISSING: how far the two sockets of a place are apart. Without it nothing tells how large the robot is{costs}{with}; measure it, \
             and write `distance_m` below [sockets]"
        ))
        .or("socket_distance", "or begin anew with --socket-distance MM")
    }
}

/// The factor of expected scatter within which two places are as good.
const AS_GOOD: f64 = 1.02;
/// A usual distance between sockets, metres: what a known distance is worth hardly depends on it.
const USUAL_M: f64 = 0.05;

/// The standard deviation of a span of 1 m, millimetres.
fn size_mm(place: Option<&str>, distance_m: Option<f64>, written: Written<'_>) -> Option<f64> {
    Case::new(&written(place, distance_m)?).ok()?.size_mm()
}
