//! `merge`: puts the parts of a comparison together, which were computed separately.

use std::path::PathBuf;

use anyhow::Result;

use super::{compare::Outputs, part};

#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// The files of all parts, in any order (`compare --shard`)
    #[arg(required = true, value_name = "PART")]
    parts: Vec<PathBuf>,
    #[command(flatten)]
    outputs: Outputs,
}

pub fn merge(arguments: &Arguments) -> Result<()> {
    arguments.outputs.check(None, &arguments.parts)?;
    arguments.outputs.tell(&part::merged(&arguments.parts)?)
}
