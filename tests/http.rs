//! The server over real connections.

#[path = "http/support.rs"]
mod support;

#[path = "http/alone.rs"]
mod alone;
#[path = "http/bounds.rs"]
mod bounds;
#[path = "http/checkpoints.rs"]
mod checkpoints;
#[path = "http/choices.rs"]
mod choices;
#[path = "http/connections.rs"]
mod connections;
#[path = "http/crashes.rs"]
mod crashes;
#[path = "http/crowd.rs"]
mod crowd;
#[path = "http/disk.rs"]
mod disk;
#[path = "http/errors.rs"]
mod errors;
#[path = "http/exported.rs"]
mod exported;
#[path = "http/faults.rs"]
mod faults;
#[path = "cli/heard.rs"]
mod heard;
#[path = "http/logs.rs"]
mod logs;
#[path = "http/metrics.rs"]
mod metrics;
#[path = "http/openapi.rs"]
mod openapi;
#[path = "http/outside.rs"]
mod outside;
#[path = "http/pages.rs"]
mod pages;
#[path = "http/program.rs"]
mod program;
#[path = "http/python.rs"]
mod python;
#[path = "http/repeated.rs"]
mod repeated;
#[path = "http/results.rs"]
mod results;
#[path = "http/robot.rs"]
mod robot;
#[path = "http/scene.rs"]
mod scene;
#[path = "http/sessions.rs"]
mod sessions;
#[path = "http/shutdown.rs"]
mod shutdown;
#[path = "http/signals.rs"]
mod signals;
#[path = "http/strangers.rs"]
mod strangers;
#[path = "http/streams.rs"]
mod streams;
#[path = "http/trust.rs"]
mod trust;
#[path = "http/walkthrough.rs"]
mod walkthrough;
