//! `lab` measures wide-bvh: its speed beside other kernels, and whether each of them is right.

mod engines;
mod error;
mod race;
mod reference;

use clap::{Parser, Subcommand};
use std::process::ExitCode;

/// Measures wide-bvh beside other ray tracing kernels.
#[derive(Parser)]
#[command(version)]
struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    Race(race::Args),
    Error(error::Args),
}

fn main() -> ExitCode {
    let outcome = match Args::parse().command {
        Command::Race(args) => race::run(&args),
        Command::Error(args) => error::run(&args),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}
