//! Reading requests; errors are stated in terms of the request.

use std::sync::Arc;

use axum::{
    body::Bytes,
    extract::{FromRequest, Request},
    http::{HeaderMap, StatusCode, header},
    response::IntoResponse,
};
use serde::de::DeserializeOwned;

use tokio::time::timeout;

use super::{
    App, Limits,
    problem::{Kind, Problem},
};
use body_schema_ask_tell::integer::MOST as MOST_WHOLE;
use body_schema_backend::parameters;

/// A JSON body. An absent one, and `null`, count as `{}`, so that defaults need no body.
pub(super) struct JsonBody<T>(pub(super) T);

/// A type that is read from a body. Types that serde reads are read by [`parse`].
pub(super) trait FromJson: Sized {
    fn from_json(bytes: &[u8], limits: &Limits) -> Result<Self, Problem>;

    /// The problem of a body beyond the limit of its route.
    fn too_large(limits: &Limits) -> Problem {
        Problem::body_too_large(limits.body_bytes)
    }
}

impl<T: DeserializeOwned> FromJson for T {
    fn from_json(bytes: &[u8], _: &Limits) -> Result<Self, Problem> {
        parse(bytes)
    }
}

impl<T: FromJson> FromRequest<Arc<App>> for JsonBody<T> {
    type Rejection = Problem;

    async fn from_request(request: Request, app: &Arc<App>) -> Result<Self, Problem> {
        let limits = &app.limits;
        let is_json = is_json(request.headers());
        let read = timeout(limits.body_timeout, Bytes::from_request(request, app)).await.map_err(|_| {
            let detail = format!("the body must be there within {} s", limits.body_timeout.as_secs_f64());
            Problem::new(Kind::BodyTooSlow, detail)
        })?;
        let bytes = read.map_err(|rejection| {
            let response = rejection.into_response();
            match response.status() {
                StatusCode::PAYLOAD_TOO_LARGE => T::too_large(limits),
                _ => Problem::new(Kind::Malformed, "the body broke off before its end"),
            }
        })?;
        if !is_json && !bytes.is_empty() {
            let detail = "send the body as JSON, with the header `Content-Type: application/json`";
            return Err(Problem::new(Kind::UnsupportedMediaType, detail).field("Content-Type"));
        }
        let is_nothing = bytes.is_empty() || bytes.trim_ascii() == b"null";
        T::from_json(if is_nothing { b"{}" } else { &bytes }, limits).map(Self)
    }
}

fn is_json(headers: &HeaderMap) -> bool {
    let value = headers.get(header::CONTENT_TYPE).and_then(|value| value.to_str().ok());
    value.is_some_and(|value| {
        value.split(';').next().is_some_and(|essence| essence.trim().eq_ignore_ascii_case("application/json"))
    })
}

pub(super) fn parse<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, Problem> {
    Ok(body_schema_backend::parse(bytes)?)
}

/// The parameters of a query, each a whole number among those `known`; absent ones are `None`.
pub(super) fn whole_numbers<const N: usize>(
    query: Option<&str>,
    known: [&'static str; N],
) -> Result<[Option<u64>; N], Problem> {
    let mut numbers = [None; N];
    for (number, (name, value)) in numbers.iter_mut().zip(known.into_iter().zip(parameters(query, known)?)) {
        *number = value.map(|value| whole_number(name, value)).transpose()?;
    }
    Ok(numbers)
}

/// The header `Last-Event-ID`: how often the history had been rewritten, and the last step of it that was seen.
pub(super) fn last_event_id(headers: &HeaderMap) -> Result<Option<(u64, u64)>, Problem> {
    let Some(value) = headers.get("last-event-id") else { return Ok(None) };
    let value = value.to_str().unwrap_or_default();
    let (rewritten, step) = value.split_once(':').unwrap_or(("0", value));
    let number = |value| whole_number("Last-Event-ID", value);
    Ok(Some((number(rewritten)?, number(step)?)))
}

/// The header `Idempotency-Key`.
pub(super) fn idempotency_key(headers: &HeaderMap) -> Result<Option<String>, Problem> {
    const MOST_BYTES: usize = 200;
    const NAME: &str = "Idempotency-Key";
    let mut given = headers.get_all(NAME).iter();
    let Some(value) = given.next() else { return Ok(None) };
    if given.next().is_some() {
        let detail = format!("`{NAME}` is there twice; send one with each observation");
        return Err(Problem::new(Kind::Malformed, detail).field(NAME));
    }
    let key = value.to_str().ok().filter(|key| (1..=MOST_BYTES).contains(&key.len()));
    let detail = || format!("`{NAME}` must have 1 to {MOST_BYTES} visible characters of ASCII");
    key.map(|key| Some(key.to_owned())).ok_or_else(|| Problem::new(Kind::Malformed, detail()).field(NAME))
}

pub(super) fn whole_number(name: &str, value: &str) -> Result<u64, Problem> {
    value.parse().ok().filter(|number| *number <= MOST_WHOLE).ok_or_else(|| {
        Problem::new(Kind::Malformed, format!("`{name}` must be a whole number from 0, not `{value}`")).field(name)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, serde::Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Body {
        #[allow(dead_code)]
        scenario: String,
        #[serde(default)]
        #[allow(dead_code)]
        learners: Vec<String>,
        #[serde(default)]
        #[allow(dead_code)]
        configuration: Vec<f64>,
        #[serde(default)]
        #[allow(dead_code)]
        parts: Vec<Part>,
    }

    #[derive(Debug, serde::Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Part {
        #[allow(dead_code)]
        length: f64,
    }

    #[test]
    fn every_fault_of_a_body_names_its_field() {
        for (body, status, field) in [
            ("{", 400, None),
            ("[]", 422, None),
            ("{}", 422, Some("scenario")),
            (r#"{"scenario":1}"#, 422, Some("scenario")),
            (r#"{"scenario":"a","seeds":1}"#, 422, Some("seeds")),
            (r#"{"scenario":"a","scenario":"b"}"#, 422, Some("scenario")),
            (r#"{"scenario":"a","learners":["b",2]}"#, 422, Some("learners[1]")),
            (r#"{"scenario":"a","learners":"b"}"#, 422, Some("learners")),
            (r#"{"scenario":"a","configuration":[0,1e999]}"#, 422, Some("configuration[1]")),
            (r#"{"scenario":"a","parts":[{"length":1},{"lengths":1}]}"#, 422, Some("parts[1].lengths")),
            (r#"{"scenario":"a","parts":[{"length":1},{}]}"#, 422, Some("parts[1].length")),
            (r#"{"scenario":"a","parts":[{"length":1,"length":2}]}"#, 422, Some("parts[0].length")),
            (r#"{"scenario":"a","configuration":[NaN]}"#, 400, None),
            (" 1", 422, None),
        ] {
            let problem = parse::<Body>(body.as_bytes()).expect_err(body);
            assert_eq!((problem.status, problem.field.as_deref()), (status, field), "{body}: {}", problem.detail);
        }
    }

    #[test]
    fn there_is_one_idempotency_key_or_none() {
        let with = |keys: &[&'static str]| {
            let mut headers = HeaderMap::new();
            for key in keys {
                headers.append("idempotency-key", key.parse().expect("a value"));
            }
            idempotency_key(&headers)
        };
        assert_eq!(with(&[]).expect("none"), None);
        assert_eq!(with(&["one"]).expect("one").as_deref(), Some("one"));
        for keys in [&["one", "one"][..], &["one", "two"], &["one", ""], &[""]] {
            let problem = with(keys).expect_err("not one");
            assert_eq!((problem.status, problem.field.as_deref()), (400, Some("Idempotency-Key")), "{keys:?}");
        }
    }

    #[test]
    fn the_last_event_is_a_step_of_a_history() {
        let of = |id: &'static str| {
            last_event_id(&HeaderMap::from_iter([(
                "last-event-id".parse().expect("a name"),
                id.parse().expect("a value"),
            )]))
        };
        assert_eq!(last_event_id(&HeaderMap::new()).expect("none"), None);
        assert_eq!(of("7").expect("a step"), Some((0, 7)));
        assert_eq!(of("2:7").expect("a step"), Some((2, 7)));
        for id in ["", "x", "1:", ":1", "1:2:3", "-1", "1:-1"] {
            assert_eq!(of(id).expect_err(id).field.as_deref(), Some("Last-Event-ID"));
        }
    }

    #[test]
    fn query_parameters_are_whole_numbers() {
        assert_eq!(whole_numbers(Some("after=3"), ["from", "after"]).expect("valid"), [None, Some(3)]);
        assert_eq!(whole_numbers(None, ["from"]).expect("valid"), [None]);
        for query in ["from=", "from=x", "from=-1", "from=1.5", "from=9223372036854775808"] {
            let problem = whole_numbers(Some(query), ["from"]).expect_err(query);
            assert_eq!((problem.status, problem.field.as_deref()), (400, Some("from")));
        }
        assert_eq!(whole_numbers(Some("form=1"), ["from"]).expect_err("unknown").field.as_deref(), Some("form"));
    }
}
