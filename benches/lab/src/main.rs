//! `lab` measures wide-bvh: its speed beside other kernels, and whether each of them is right.

mod effort;
mod engines;
mod race;
mod reference;
mod scenes;
mod stats;
mod text;
mod workloads;

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
}

fn main() -> ExitCode {
    let outcome = match Args::parse().command {
        Command::Race(args) => race::run(&args),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}
