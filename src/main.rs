//! The command line of body-schema.

use std::{io::Write, process::ExitCode};

use clap::Parser;

mod cli;

/// An allocator that returns memory to the system: sessions come and go in a server that runs for weeks.
#[cfg(all(feature = "jemalloc", target_os = "linux"))]
#[global_allocator]
static ALLOCATOR: tikv_jemallocator::Jemalloc = tikv_jemallocator::Jemalloc;

fn main() -> ExitCode {
    let arguments = cli::Arguments::parse();
    match cli::run(arguments) {
        Ok(code) => code,
        Err(error) if cli::is_closed_pipe(&error) => ExitCode::SUCCESS,
        Err(error) => {
            // Standard error may be closed; there is nobody left to tell then.
            let _ = writeln!(std::io::stderr(), "error: {}", cli::told(&error));
            ExitCode::from(cli::exit_code(&error))
        }
    }
}
