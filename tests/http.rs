//! The server over real connections.

pub(crate) mod support;

mod alone;
mod bounds;
mod checkpoints;
mod choices;
mod connections;
mod crashes;
mod crowd;
mod disk;
mod errors;
mod exported;
mod external;
mod faults;
pub(crate) mod local;
mod logs;
mod metrics;
mod openapi;
mod pages;
mod program;
mod python;
mod repeated;
mod results;
pub(crate) mod robot;
mod scene;
mod sessions;
mod shutdown;
mod signals;
mod strangers;
mod streams;
mod trust;
mod walkthrough;
