//! Refusals that several routes have in common, as OpenAPI describes them.

use std::collections::BTreeMap;

use utoipa::{
    IntoResponses,
    openapi::{ContentBuilder, RefOr, Response, ResponseBuilder, schema::Ref},
};

use super::JSON;

type Refusals = BTreeMap<String, RefOr<Response>>;

/// Refusals of every route.
pub(super) struct OfAll;

impl IntoResponses for OfAll {
    fn responses() -> Refusals {
        described(&[
            ("400", "The request cannot be read: its address, a parameter or a header"),
            ("401", "The server answers only those who carry its token"),
            ("403", "The request is meant for another host, or comes from a foreign page"),
            ("431", "The address and the header fields are too large together, or too many"),
            ("500", "The server has failed, or what it kept is damaged"),
            ("503", "The server has as much to do as it can"),
        ])
    }
}

/// Refusals of a route with a body.
pub(super) struct OfBodies;

impl IntoResponses for OfBodies {
    fn responses() -> Refusals {
        described(&[
            ("403", "The request comes from a foreign page"),
            ("408", "The body did not come in time"),
            ("413", "The body is too large"),
            ("415", "The body is not said to be JSON"),
        ])
    }
}

/// Refusals of a stream.
pub(super) struct OfStreams;

impl IntoResponses for OfStreams {
    fn responses() -> Refusals {
        described(&[("429", "As many follow the session as may")])
    }
}

/// Refusals of a route that the engine of a robot elsewhere answers.
pub(super) struct OfEngines;

impl IntoResponses for OfEngines {
    fn responses() -> Refusals {
        described(&[
            ("404", "There is no such session"),
            ("500", "The session's engine has failed"),
            ("503", "The server's memory is full, or it is shutting down"),
        ])
    }
}

/// Refusals of a route that shows the status of a session with a robot elsewhere.
pub(super) struct OfRobots;

impl IntoResponses for OfRobots {
    fn responses() -> Refusals {
        described(&[
            ("404", "There is no such session"),
            ("409", "The session has no robot elsewhere"),
            ("500", "The session cannot be taken up again"),
            ("503", "The server's memory is full, or it is shutting down"),
        ])
    }
}

/// Problems, by their status.
fn described(refusals: &[(&str, &str)]) -> Refusals {
    let problem = ContentBuilder::new().schema(Some(Ref::from_schema_name("Problem"))).build();
    let response = |what: &str| ResponseBuilder::new().description(what).content(JSON, problem.clone()).build();
    refusals.iter().map(|(status, what)| ((*status).to_owned(), response(what).into())).collect()
}
