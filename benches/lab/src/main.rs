//! `lab` measures wide-bvh: its speed beside other kernels, and whether each of them is right.

mod corrupt;
mod effort;
mod engines;
mod error;
mod exact;
mod limit;
mod output;
mod quiet;
mod race;
mod reference;
mod scenes;
mod stats;
mod stress;
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
    Limit(limit::Args),
    Race(race::Args),
    Stress(stress::Args),
    Error(error::Args),
    Corrupt(corrupt::Args),
}

fn main() -> ExitCode {
    let outcome = match Args::parse().command {
        Command::Limit(args) => limit::run(&args),
        Command::Race(args) => race::run(&args),
        Command::Stress(args) => stress::run(&args),
        Command::Error(args) => error::run(&args),
        Command::Corrupt(args) => corrupt::run(&args),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}
