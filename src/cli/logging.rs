//! The log of `serve`, on standard error.

use std::{
    io::{IsTerminal, stderr},
    str::FromStr,
};

use anyhow::{Context, Result};
use tracing_appender::non_blocking::{NonBlockingBuilder, WorkerGuard};
use tracing_subscriber::{
    Layer,
    filter::{LevelFilter, Targets},
    fmt::layer,
    layer::SubscriberExt,
    registry,
    util::SubscriberInitExt,
};

use super::BadInput;

/// The environment variable for the level, if no argument sets it.
const VARIABLE: &str = "BODY_SCHEMA_LOG";
/// The target whose lines have that level; those of other crates are logged from warnings on, because we cannot vouch for
/// their other lines.
const OURS: &str = "body_schema";

/// The most lines that wait to be written.
const MOST_WAITING: usize = 16 << 10;

#[derive(Debug, Default, clap::Args)]
#[command(next_help_heading = "Log, on standard error")]
pub struct LoggingArguments {
    /// Log events of this level and above: off, error, warn, info, debug or trace [default: that of the environment's
    /// BODY_SCHEMA_LOG, else info]
    #[arg(long = "log", value_name = "LEVEL", value_parser = level)]
    level: Option<LevelFilter>,
    /// How a line is written
    #[arg(long = "log-format", value_name = "FORMAT", value_enum, default_value_t)]
    format: Format,
}

#[derive(Clone, Copy, Debug, Default, clap::ValueEnum)]
enum Format {
    /// For people
    #[default]
    Text,
    /// One JSON object
    Json,
}

impl LoggingArguments {
    /// Starts logging. Waiting lines are written when the returned guard is dropped.
    pub fn begin(&self) -> Result<WorkerGuard> {
        let level = self.level.map_or_else(usual_level, Ok)?;
        // Who does not read the log, as a terminal that is halted, holds up nobody: lines are lost then.
        let (lines, guard) = NonBlockingBuilder::default().buffered_lines_limit(MOST_WAITING).finish(stderr());
        let colours = stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none_or(|set| set.is_empty());
        let lines = layer().with_writer(lines).with_ansi(colours).log_internal_errors(false);
        let lines = match self.format {
            Format::Text => lines.boxed(),
            Format::Json => lines.json().flatten_event(true).boxed(),
        };
        let told = Targets::new().with_default(level.min(LevelFilter::WARN)).with_target(OURS, level);
        registry().with(lines.with_filter(told)).try_init().context("cannot begin the log")?;
        Ok(guard)
    }
}

fn usual_level() -> Result<LevelFilter> {
    match std::env::var(VARIABLE) {
        Ok(named) if !named.is_empty() => level(&named).map_err(|why| BadInput(format!("{VARIABLE}: {why}")).into()),
        _ => Ok(LevelFilter::INFO),
    }
}

fn level(name: &str) -> Result<LevelFilter, String> {
    LevelFilter::from_str(name).map_err(|_| format!("`{name}` is none of off, error, warn, info, debug and trace"))
}
