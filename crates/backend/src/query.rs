//! What the query of an address asks for.

use body_schema_recording::{LiveLog, Shape, Theme};
use body_schema_wire::LearnerDescription;
use bytes::Bytes;
use percent_encoding::percent_decode_str;
use serde::de::{DeserializeOwned, IntoDeserializer};

use crate::{Kind, Problem};

/// The parameters of a query as written, each among those `known`.
///
/// # Errors
///
/// [`Kind::Malformed`] of a parameter that is not.
pub fn parameters<'a, const N: usize>(
    query: Option<&'a str>,
    known: [&'static str; N],
) -> Result<[Option<&'a str>; N], Problem> {
    let mut values = [None; N];
    for pair in query.unwrap_or_default().split('&').filter(|pair| !pair.is_empty()) {
        let (name, value) = pair.split_once('=').unwrap_or((pair, ""));
        let Some(index) = known.iter().position(|known| *known == name) else {
            let detail = format!("there is no parameter `{name}`; there is: {}", known.join(", "));
            return Err(Problem::new(Kind::Malformed, detail).field(name));
        };
        values[index] = Some(value);
    }
    Ok(values)
}

/// The value of a parameter that is written as one of a few words; the default if it is absent.
///
/// # Errors
///
/// [`Kind::Malformed`] of any other word.
pub fn word<T: DeserializeOwned + Default>(name: &'static str, value: Option<&str>) -> Result<T, Problem> {
    let Some(value) = value else { return Ok(T::default()) };
    T::deserialize(value.into_deserializer()).map_err(|error: serde::de::value::Error| {
        Problem::new(Kind::Malformed, format!("`{name}`: {error}")).field(name)
    })
}

/// The arrangement of the viewer that a query asks for by `theme`, `shape`, `aspect` and `learner`, one of these: a Rerun blueprint.
///
/// # Errors
///
/// [`Kind::Malformed`] of a parameter, [`Kind::Internal`] where it cannot be written.
pub fn arrangement(live: &LiveLog, learners: &[LearnerDescription], query: Option<&str>) -> Result<Bytes, Problem> {
    let [theme, shape, aspect, learner] = parameters(query, ["theme", "shape", "aspect", "learner"])?;
    let (theme, shape): (Theme, Shape) = (word("theme", theme)?, word("shape", shape)?);
    let aspect = aspect.map(self::aspect).transpose()?.unwrap_or(shape.aspect());
    let alone = learner.map(|name| place(learners, name)).transpose()?;
    let failed = |detail: String| Problem::new(Kind::Internal, format!("no arrangement: {detail}"));
    let blueprint = live.blueprint(theme, aspect, alone).map_err(|error| failed(error.to_string()))?;
    blueprint.ok_or_else(|| failed("the recording has not begun".to_owned()))
}

/// The place of the learner of this name, which may be percent-encoded.
fn place(learners: &[LearnerDescription], name: &str) -> Result<usize, Problem> {
    let name = percent_decode_str(name).decode_utf8_lossy();
    learners.iter().position(|learner| learner.name == name).ok_or_else(|| {
        let names: Vec<&str> = learners.iter().map(|learner| learner.name.as_str()).collect();
        let detail = format!("there is no learner `{name}`; there are {}", names.join(", "));
        Problem::new(Kind::UnknownLearner, detail).field("learner")
    })
}

fn aspect(value: &str) -> Result<f64, Problem> {
    value.parse().ok().filter(|aspect| (0.2..=5.0).contains(aspect)).ok_or_else(|| {
        let detail = format!("`aspect` must be a number from 0.2 to 5, not `{value}`");
        Problem::new(Kind::Malformed, detail).field("aspect")
    })
}
