//! Everything that can go wrong, as an answer of the server.

use std::ops::{Deref, DerefMut};

use axum::{
    http::{HeaderValue, StatusCode, header},
    response::{IntoResponse, Response},
};
use serde::Serialize;
use utoipa::{
    PartialSchema, ToSchema,
    openapi::{RefOr, Schema},
};

use super::{requests, store::StoreError};
use body_schema_ask_tell::{Refusal, ReplayError, ResultsError, SetupError};
use body_schema_backend as backend;
pub use body_schema_backend::Beside;
pub(super) use body_schema_backend::Kind;
use body_schema_experiment::ChoiceError;
use body_schema_scenario::ScenarioError;

/// Media type of every error.
pub const PROBLEM_JSON: &str = "application/problem+json";

/// The seconds after which a client should ask again where there is too much to do.
pub(super) const RETRY_AFTER_S: u64 = 10;

/// What went wrong, as an answer.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(transparent)]
pub struct Problem(backend::Problem);

impl Problem {
    pub(super) fn new(kind: Kind, detail: impl Into<String>) -> Self {
        Self(backend::Problem::new(kind, detail))
    }

    pub(super) fn field(self, field: impl Into<String>) -> Self {
        Self(self.0.field(field))
    }

    pub(super) fn step(self, step: u64) -> Self {
        Self(self.0.step(step))
    }

    pub(super) fn body_too_large(most: usize) -> Self {
        Self(backend::Problem::body_too_large(most))
    }

    pub(super) fn never_steps(id: impl std::fmt::Display) -> Self {
        Self(backend::Problem::never_steps(id))
    }

    pub(super) fn not_outside(id: impl std::fmt::Display) -> Self {
        Self(backend::Problem::not_outside(id))
    }

    pub(super) fn unknown_session(id: impl std::fmt::Display) -> Self {
        Self(backend::Problem::unknown_session(id))
    }

    pub(super) fn into_detail(self) -> String {
        self.0.detail.into()
    }
}

impl Deref for Problem {
    type Target = backend::Problem;

    fn deref(&self) -> &backend::Problem {
        &self.0
    }
}

impl DerefMut for Problem {
    fn deref_mut(&mut self) -> &mut backend::Problem {
        &mut self.0
    }
}

impl PartialSchema for Problem {
    fn schema() -> RefOr<Schema> {
        backend::Problem::schema()
    }
}

impl ToSchema for Problem {
    fn name() -> std::borrow::Cow<'static, str> {
        backend::Problem::name()
    }

    fn schemas(schemas: &mut Vec<(String, RefOr<Schema>)>) {
        backend::Problem::schemas(schemas);
    }
}

macro_rules! told_as_by_the_backend {
    ($($Error:ty),*) => {
        $(impl From<$Error> for Problem {
            fn from(error: $Error) -> Self {
                Self(error.into())
            }
        })*
    };
}
told_as_by_the_backend!(backend::Problem, ScenarioError, ChoiceError, SetupError, ReplayError, Refusal, ResultsError);

/// A change that could not be written, and so was not made.
impl From<StoreError> for Problem {
    fn from(error: StoreError) -> Self {
        match error {
            StoreError::Full(_) | StoreError::Large(_) => Self::new(Kind::ServerFull, error.to_string()),
            StoreError::Damaged { .. } => {
                let hint = "end the server and run `body-schema repair` on its folder to keep what is before that";
                Self::new(Kind::Damaged, format!("{error}; {hint}"))
            }
            StoreError::Gone { .. } | StoreError::Changed { .. } => {
                Self::new(Kind::Storage, format!("it has not happened: {error}"))
            }
            _ if error.is_for_want_of_space() => {
                let detail =
                    format!("it could not be written, and has not happened: {error}; free some space and ask again");
                Self::new(Kind::Storage, detail)
            }
            _ => Self::new(Kind::Internal, format!("it has not happened: {error}")),
        }
    }
}

impl IntoResponse for Problem {
    fn into_response(mut self) -> Response {
        let status = StatusCode::from_u16(self.status).unwrap_or(StatusCode::INTERNAL_SERVER_ERROR);
        let refused = requests::Refused::new(self.kind, status.is_server_error().then(|| self.detail.to_string()));
        self.beside.request_id = requests::id();
        let body = serde_json::to_vec(&self).unwrap_or_default();
        let mut response = (status, [(header::CONTENT_TYPE, PROBLEM_JSON)], body).into_response();
        response.extensions_mut().insert(refused);
        if matches!(status, StatusCode::SERVICE_UNAVAILABLE | StatusCode::TOO_MANY_REQUESTS) {
            // A session that has left memory is back at once.
            let after = if self.is(Kind::Dormant) { 0 } else { RETRY_AFTER_S };
            response.headers_mut().insert(header::RETRY_AFTER, after.into());
        }
        if matches!(status, StatusCode::REQUEST_TIMEOUT) {
            // What is still coming is no next request.
            response.headers_mut().insert(header::CONNECTION, HeaderValue::from_static("close"));
        }
        if matches!(status, StatusCode::UNAUTHORIZED) {
            response.headers_mut().insert(header::WWW_AUTHENTICATE, HeaderValue::from_static("Bearer"));
        }
        response
    }
}
