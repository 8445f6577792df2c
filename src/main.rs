//! The command line: parses it, calls the application, prints errors.

use clap::builder::PossibleValuesParser;
use clap::{Args, Parser, Subcommand};
use palpate::app::{self, AppError, Outcome, ReplayOptions, ValidateOptions, WindowOptions};
use palpate::study::{self, Shard, Study, StudyOptions};
use std::path::PathBuf;
use std::process::ExitCode;

/// Deformable tissue that can be prodded: a soft body whose light paths are refitted every frame.
///
/// Without a command, the window opens on the default scene.
#[derive(Parser)]
#[command(name = "palpate", version = app::VERSION, after_help = AFTER_HELP)]
struct Cli {
    #[command(subcommand)]
    command: Option<Command>,
}

const AFTER_HELP: &str = "\
Examples:
  palpate                                     prod the default organ with the mouse
  palpate replay liver --out out              run its script, write pictures, log and report
  palpate replay liver --set body.file='\"spleen.glb\"' --set surface.kind=gooey
  palpate study solver --quick                time against error of every method, in a minute
  palpate validate truth --out out            radiance against reference pictures
  palpate check spleen.glb my-scene.toml      say what a file holds, or what is wrong with it

Exit status: 0 done; 1 a comparison or validation failed; 2 bad usage or bad input.";

#[derive(Subcommand)]
enum Command {
    /// Opens the window on a scene: left drag pushes, right drag grabs, middle drag orbits, wheel zooms.
    Window {
        /// A bundled scene (see `palpate scenes`) or the path of a TOML file.
        #[arg(default_value = app::DEFAULT_SCENE)]
        scene: String,
        #[command(flatten)]
        sets: Sets,
        /// Threads of the simulation; the result does not depend on it.
        #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1024))]
        threads: Option<u32>,
        /// Writes the frame log of the session here when the window closes.
        #[arg(long, value_name = "CSV")]
        log: Option<PathBuf>,
    },
    /// Runs a scene's script without a window and writes pictures, log, states and a report.
    Replay(Replay),
    /// Charts speed against accuracy: prints a table, writes NAME.csv, NAME.json, NAME.svg and a report.
    Study(StudyArguments),
    /// Compares the frame times of two replays: medians, ratio, and which stage changed.
    Compare {
        /// The folder that the first replay wrote.
        a: PathBuf,
        /// The folder that the second one wrote.
        b: PathBuf,
    },
    /// Renders a folder of reference scenes, scores the pictures and checks them against its goals.
    Validate {
        /// Folder with scenes/*.json, and for the scores ref/*.npz and goals.json.
        dir: PathBuf,
        /// Folder for pictures (linear radiance, NumPy arrays), scores and report.
        #[arg(long, value_name = "DIR", default_value = "out/validate")]
        out: PathBuf,
        #[command(flatten)]
        sets: Sets,
    },
    /// Reads scenes, meshes and pictures; says what they hold or what is wrong.
    Check {
        /// Files to read.
        #[arg(required = true)]
        files: Vec<PathBuf>,
    },
    /// Lists the bundled scenes, a line each.
    Scenes,
}

#[derive(Args)]
struct Sets {
    /// Replaces one value of the scene by its dotted path, such as solver.substeps=40; repeatable.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    set: Vec<String>,
}

#[derive(Args)]
struct Replay {
    /// A bundled scene (see `palpate scenes`) or the path of a TOML file.
    scene: String,
    /// Folder for everything that is written.
    #[arg(long, value_name = "DIR", default_value = "out")]
    out: PathBuf,
    /// Frames to run instead of the scene's own number.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=10_000_000))]
    frames: Option<u32>,
    /// Size of the pictures instead of the scene's own.
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    size: Option<[u32; 2]>,
    /// A picture every so many frames; 0 for the last one only.
    #[arg(long, value_name = "EVERY")]
    png: Option<u32>,
    /// Writes everything the shaders read and made at this frame; repeatable.
    #[arg(long, value_name = "FRAME")]
    dump: Vec<u32>,
    /// Threads of the simulation; the result does not depend on it.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1024))]
    threads: Option<u32>,
    /// Simulates only; needs no GPU adapter.
    #[arg(long)]
    no_render: bool,
    /// Compares with the states and pictures recorded in this folder; exit status 1 if they differ.
    #[arg(long, value_name = "DIR")]
    against: Option<PathBuf>,
    #[command(flatten)]
    sets: Sets,
}

/// A study goes on where an interrupted run with the same settings stopped.
#[derive(Args)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
struct StudyArguments {
    #[command(subcommand)]
    command: Option<StudyCommand>,
    /// Which study.
    #[arg(value_parser = PossibleValuesParser::new(Study::ALL.map(Study::name)), required = true)]
    name: Option<String>,
    /// Folder for everything that is written [default: out/study, or out/study-I-of-N].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// A few settings, in less than a minute.
    #[arg(long)]
    quick: bool,
    /// Only part I of N, counted from 1: every Nth cell. `palpate study merge` joins the parts.
    #[arg(long, value_name = "I/N")]
    shard: Option<Shard>,
    /// Replaces one value of the study's plan, or a list by a list or a single value, such as
    /// solver.substeps=20 or solver.substeps=[10,20]; repeatable.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Threads to use; no result but the times depends on it.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1024))]
    threads: Option<u32>,
}

#[derive(Subcommand)]
enum StudyCommand {
    /// Joins the parts of a study, made with --shard, to the result of one run.
    Merge {
        /// Folder for the result.
        out: PathBuf,
        /// The folder of each part.
        #[arg(required = true, value_name = "DIR")]
        parts: Vec<PathBuf>,
    },
}

/// `800x600` as width and height.
fn parse_size(text: &str) -> Result<[u32; 2], String> {
    let sides = text
        .split_once(['x', 'X'])
        .and_then(|(w, h)| Some([w.parse().ok()?, h.parse().ok()?]));
    match sides {
        Some([w, h]) if (8..=8192).contains(&w) && (8..=8192).contains(&h) => Ok([w, h]),
        _ => Err("write WIDTHxHEIGHT in pixels, 8 to 8192 each, such as 800x600".to_owned()),
    }
}

fn main() -> ExitCode {
    app::start_clock();
    let cli = Cli::parse();
    match run(cli.command) {
        Ok(Outcome::Done) => ExitCode::SUCCESS,
        Ok(Outcome::Differs) => ExitCode::from(1),
        Err(error) => {
            eprintln!("palpate: {}", chain(&error));
            ExitCode::from(2)
        }
    }
}

fn run(command: Option<Command>) -> Result<Outcome, AppError> {
    match command {
        None => app::window(&WindowOptions::default()),
        Some(Command::Window {
            scene,
            sets,
            threads,
            log,
        }) => app::window(&WindowOptions {
            scene,
            sets: sets.set,
            threads,
            log,
        }),
        Some(Command::Replay(replay)) => app::replay(&ReplayOptions {
            scene: replay.scene,
            sets: replay.sets.set,
            out: replay.out,
            frames: replay.frames,
            size: replay.size,
            png_every: replay.png,
            dumps: replay.dump,
            threads: replay.threads,
            render: !replay.no_render,
            against: replay.against,
        }),
        Some(Command::Study(arguments)) => run_study(arguments),
        Some(Command::Compare { a, b }) => app::compare(&a, &b),
        Some(Command::Validate { dir, out, sets }) => app::validate(&ValidateOptions {
            dir,
            out,
            sets: sets.set,
        }),
        Some(Command::Check { files }) => app::check(&files),
        Some(Command::Scenes) => app::list_scenes(),
    }
}

fn run_study(arguments: StudyArguments) -> Result<Outcome, AppError> {
    if let Some(StudyCommand::Merge { out, parts }) = arguments.command {
        return study::merge(&out, &parts);
    }
    let name = arguments.name.expect("the parser asks for a name");
    study::study(&StudyOptions {
        study: Study::named(&name).expect("the parser lets only known names through"),
        out: arguments.out,
        quick: arguments.quick,
        shard: arguments.shard,
        sets: arguments.set,
        threads: app::thread_count(arguments.threads),
    })
}

/// An error with the causes below it, on one line.
fn chain(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(inner) = cause {
        let inner_text = inner.to_string();
        if !text.contains(&inner_text) {
            text.push_str(": ");
            text.push_str(&inner_text);
        }
        cause = inner.source();
    }
    text
}
