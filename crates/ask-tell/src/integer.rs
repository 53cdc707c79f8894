//! Whole numbers as JSON Schema defines them.

use std::fmt;

use serde::{
    Deserialize, Deserializer,
    de::{Error, Unexpected, Visitor},
};

/// The greatest whole number that is accepted, that of OpenAPI's `int64`.
pub const MOST: u64 = i64::MAX as u64;

/// Reads a whole number from 0 as JSON Schema defines it, for serde: `100.0` and `1e2` are 100.
///
/// # Errors
///
/// The deserializer's error if the value is no number, has a fraction, is negative, or is above [`MOST`].
pub fn integer<'de, D: Deserializer<'de>>(deserializer: D) -> Result<u64, D::Error> {
    struct Whole;

    impl Visitor<'_> for Whole {
        type Value = u64;

        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            write!(f, "a whole number from 0 to {MOST}")
        }

        fn visit_u64<E: Error>(self, number: u64) -> Result<u64, E> {
            if number <= MOST { Ok(number) } else { Err(E::invalid_value(Unexpected::Unsigned(number), &self)) }
        }

        fn visit_i64<E: Error>(self, number: i64) -> Result<u64, E> {
            u64::try_from(number).map_err(|_| E::invalid_value(Unexpected::Signed(number), &self))
        }

        fn visit_f64<E: Error>(self, number: f64) -> Result<u64, E> {
            // 2⁶³ is the first number beyond; below it the conversion loses nothing of a whole number.
            let is_whole = number.fract() == 0.0 && (0.0..MOST as f64).contains(&number);
            if is_whole { Ok(number as u64) } else { Err(E::invalid_value(Unexpected::Float(number), &self)) }
        }
    }

    deserializer.deserialize_any(Whole)
}

/// Reads a whole number from 0, as [`integer`] does, or nothing where it is absent or null.
///
/// # Errors
///
/// The deserializer's error if the value is neither null nor a number that [`integer`] takes.
pub fn integer_or_none<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<u64>, D::Error> {
    #[derive(Deserialize)]
    struct Given(#[serde(deserialize_with = "integer")] u64);
    Ok(Option::<Given>::deserialize(deserializer)?.map(|Given(number)| number))
}

#[cfg(test)]
mod tests {
    use serde_json::from_str;

    use super::*;

    #[derive(Deserialize)]
    struct Body {
        #[serde(deserialize_with = "integer")]
        number: u64,
        #[serde(default, deserialize_with = "integer_or_none")]
        other: Option<u64>,
    }

    #[test]
    fn they_may_be_written_with_a_point_or_an_exponent() {
        let number = |text: &str| from_str::<Body>(&format!("{{\"number\": {text}}}")).map(|body| body.number);
        for (text, wanted) in [("0", 0), ("-0.0", 0), ("100.0", 100), ("1e2", 100), ("9223372036854775807", MOST)] {
            assert_eq!(number(text).expect("whole"), wanted, "{text}");
        }
        for text in
            ["-1", "0.5", "9223372036854775808", "18446744073709551616", "1e300", "-1e300", "\"1\"", "null", "true"]
        {
            assert!(number(text).is_err(), "{text}");
        }
        for (text, wanted) in [("null", None), ("2.0", Some(2))] {
            let body = from_str::<Body>(&format!("{{\"number\": 1, \"other\": {text}}}"));
            assert_eq!(body.expect("valid").other, wanted);
        }
    }
}
