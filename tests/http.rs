//! The server over real connections.
#![cfg(feature = "app")]

#[path = "http/support.rs"]
mod support;

#[path = "http/choices.rs"]
mod choices;
#[path = "http/errors.rs"]
mod errors;
#[path = "http/openapi.rs"]
mod openapi;
#[path = "http/pages.rs"]
mod pages;
#[path = "http/program.rs"]
mod program;
#[path = "http/scene.rs"]
mod scene;
#[path = "http/sessions.rs"]
mod sessions;
#[path = "http/shutdown.rs"]
mod shutdown;
#[path = "http/streams.rs"]
mod streams;
