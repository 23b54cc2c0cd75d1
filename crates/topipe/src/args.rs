//! The command line.

use clap::{Args, Parser, Subcommand, ValueEnum};
use std::path::{Path, PathBuf};
use std::time::Duration;
use topipe_engine::{Choice, Override, RunOptions};

/// From a topology optimization result to a closed CAD solid.
#[derive(Debug, Parser)]
#[command(
    version,
    after_help = "Examples:
  topipe new part.stl                                look at a mesh, write part.toml
  topipe run part.toml                               results in topipe-out/part/, report.html among them
  topipe plan part.toml --set tiles.tile_size=3      what another value would cost
  topipe stages tiling                               the fields of a stage
  topipe render surface --pipeline part.toml -o part.png

Exit codes: 0 done; 1 a stage failed; 2 bad command line or pipeline; 3 geometry or data refused; \
                  4 trouble with the cache or a file; 130 interrupted (what was finished stays finished)."
)]
pub struct Arguments {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
    /// Say more: reasons, remarks of stages, logs.
    #[arg(short, long, global = true, conflicts_with = "quiet")]
    pub verbose: bool,
    /// Say nothing but errors.
    #[arg(short, long, global = true)]
    pub quiet: bool,
}

/// How much is said.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Verbosity {
    /// Errors.
    Quiet,
    /// What happened.
    Normal,
    /// And why.
    Verbose,
}

impl Arguments {
    /// How much is said.
    pub fn verbosity(&self) -> Verbosity {
        match (self.quiet, self.verbose) {
            (true, _) => Verbosity::Quiet,
            (_, true) => Verbosity::Verbose,
            _ => Verbosity::Normal,
        }
    }
}

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Look at a mesh and write a commented pipeline for it.
    #[command(
        after_help = "Examples:\n  topipe new part.stl\n  topipe new meshes/part.stl -o part.toml --overwrite"
    )]
    New(NewArguments),
    /// Write a pipeline for an edited mesh, or for other features, that keeps what the edit does not touch.
    #[command(
        after_help = "Examples:\n  topipe edit part.toml part-with-a-rib.stl\n  topipe edit part.toml      # the same mesh; change the features in part-edited.toml"
    )]
    Edit(EditArguments),
    /// Run a pipeline; what is known already is not computed again.
    #[command(
        after_help = "Examples:\n  topipe run part.toml\n  topipe run part.toml --until smooth --force smooth\n  topipe run part.toml --set smooth.iterations=20 --out trial\n  topipe run part.toml --json > events.jsonl"
    )]
    Run(RunArguments),
    /// Say what a run would do, and why.
    #[command(
        after_help = "Examples:\n  topipe plan part.toml\n  topipe plan part.toml --set smooth.method=taubin"
    )]
    Plan(PlanArguments),
    /// Print the graph of a pipeline.
    #[command(after_help = "Examples:\n  topipe graph part.toml --format svg > part.svg")]
    Graph(GraphArguments),
    /// List the kinds of stages, or the fields of one kind.
    Stages {
        /// The kind.
        kind: Option<String>,
    },
    /// Print the JSON schema of pipelines, for editors.
    Schema,
    /// Say what is in a mesh file, an artifact file, or the result of a stage.
    #[command(
        after_help = "Examples:\n  topipe inspect part.stl\n  topipe inspect smooth --pipeline part.toml"
    )]
    Inspect(InspectArguments),
    /// Draw a mesh file, an artifact file, or the result of a stage as PNG.
    #[command(
        after_help = "Examples:\n  topipe render part.stl -o part.png\n  topipe render surface --pipeline part.toml --color deviation --against smooth -o deviation.png\n  topipe render frame --pipeline part.toml --over smooth --view 30:20 -o frame.png"
    )]
    Render(RenderArguments),
    /// Write the report of a run as one HTML file: model, figures, histograms, stages.
    #[command(
        after_help = "Examples:\n  topipe report topipe-out/part\n  topipe report topipe-out/part/run.json -o part.html"
    )]
    Report(ReportArguments),
    /// Do a recorded run once more, from nothing, and say whether it gives the same.
    Reproduce(ReproduceArguments),
    /// Write the hashes of a run to a file that can be kept beside a paper; `reproduce` takes it too.
    Lock(LockArguments),
    /// Say what differs between two runs: parameters, inputs, code, results.
    #[command(after_help = "Examples:\n  topipe diff topipe-out/part trial")]
    Diff(DiffArguments),
    /// Say again what the stages of a pipeline said when their results were computed.
    Log(LogArguments),
    /// Look at the cache, or throw away what is needed least.
    Cache(CacheArguments),
    /// Print the manual page, or write one for each command.
    #[command(
        after_help = "Examples:\n  topipe man | man -l -\n  topipe man --output ~/.local/share/man/man1"
    )]
    Man(ManArguments),
    /// Print a completion script.
    #[command(
        after_help = "Examples:\n  topipe completions bash > ~/.local/share/bash-completion/completions/topipe\n  \
                            topipe completions zsh > ~/.zfunc/_topipe\n  \
                            topipe completions fish > ~/.config/fish/completions/topipe.fish"
    )]
    Completions {
        /// The shell.
        shell: clap_complete::Shell,
    },
}

/// A pipeline and where its results are kept.
#[derive(Debug, Clone, Args)]
pub struct PipelineArguments {
    /// The pipeline, a TOML file.
    pub pipeline: PathBuf,
    /// The cache [default: .topipe beside the pipeline].
    #[arg(long, env = "TOPIPE_CACHE", value_name = "DIR")]
    pub cache: Option<PathBuf>,
    /// A second cache behind the first: a shared folder, or s3://BUCKET/PREFIX.
    #[arg(long, env = "TOPIPE_REMOTE", value_name = "DIR|URL")]
    pub remote: Option<String>,
    /// Take from the remote cache, give nothing to it.
    #[arg(long, env = "TOPIPE_REMOTE_READ_ONLY", requires = "remote")]
    pub remote_read_only: bool,
    /// Use another value than the pipeline says.
    #[arg(long = "set", value_name = "STAGE.FIELD=VALUE")]
    pub set: Vec<Override>,
}

impl PipelineArguments {
    /// The cache folder.
    pub fn cache_folder(&self) -> PathBuf {
        let beside = || self.pipeline.parent().unwrap_or(Path::new("")).join(".topipe");
        self.cache.clone().unwrap_or_else(beside)
    }
}

/// Which stages.
#[derive(Debug, Clone, Args)]
pub struct ChoiceArguments {
    /// Only this stage and what it depends on.
    #[arg(long, value_name = "STAGE")]
    pub until: Vec<String>,
    /// Only this stage and what depends on it.
    #[arg(long, value_name = "STAGE")]
    pub from: Vec<String>,
    /// Only this stage; its inputs must be in the cache.
    #[arg(long, value_name = "STAGE")]
    pub only: Vec<String>,
    /// Run this stage even if its result is known.
    #[arg(long, value_name = "STAGE")]
    pub force: Vec<String>,
}

impl ChoiceArguments {
    /// As the engine takes it.
    pub fn choice(&self) -> Choice {
        Choice {
            until: self.until.clone(),
            from: self.from.clone(),
            only: self.only.clone(),
            force: self.force.clone(),
        }
    }
}

/// `topipe run`.
#[derive(Debug, Args)]
pub struct RunArguments {
    /// The pipeline.
    #[command(flatten)]
    pub pipeline: PipelineArguments,
    /// Which stages.
    #[command(flatten)]
    pub choice: ChoiceArguments,
    /// The folder for exports and run.json [default: topipe-out/NAME].
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Threads, and stages at the same time [default: all processors].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub jobs: Option<u16>,
    /// After a failure, still run what does not depend on it.
    #[arg(long)]
    pub keep_going: bool,
    /// Wait at most this long for another process that computes the same: "30s", "2h", or seconds [default: for ever].
    #[arg(long, value_name = "TIME", value_parser = parse_patience)]
    pub lock_timeout: Option<Duration>,
    /// One JSON object per event on stdout.
    #[arg(long)]
    pub json: bool,
}

impl RunArguments {
    /// As the engine takes it, for a pipeline of this name.
    pub fn options(&self, name: &str) -> RunOptions {
        let processors = std::thread::available_parallelism().map_or(1, usize::from);
        RunOptions {
            out: self.out.clone().unwrap_or_else(|| Path::new("topipe-out").join(name)),
            choice: self.choice.choice(),
            jobs: self.jobs.map_or(processors, usize::from),
            keep_going: self.keep_going,
            lock_timeout: self.lock_timeout,
            program: concat!("topipe ", env!("CARGO_PKG_VERSION")).into(),
        }
    }
}

/// `topipe plan`.
#[derive(Debug, Args)]
pub struct PlanArguments {
    /// The pipeline.
    #[command(flatten)]
    pub pipeline: PipelineArguments,
    /// Which stages.
    #[command(flatten)]
    pub choice: ChoiceArguments,
    /// The plan as one JSON object.
    #[arg(long)]
    pub json: bool,
}

/// A language for graphs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum GraphFormat {
    /// Mermaid, which GitHub and many editors draw.
    Mermaid,
    /// Graphviz.
    Dot,
    /// A picture.
    Svg,
}

/// `topipe graph`.
#[derive(Debug, Args)]
pub struct GraphArguments {
    /// The pipeline, a TOML file.
    pub pipeline: PathBuf,
    /// The language.
    #[arg(long, value_enum, default_value = "mermaid")]
    pub format: GraphFormat,
}

/// `topipe inspect`.
#[derive(Debug, Args)]
pub struct InspectArguments {
    /// What to look at.
    #[command(flatten)]
    pub target: TargetArguments,
}

/// `topipe render`.
#[derive(Debug, Args)]
pub struct RenderArguments {
    /// What to draw.
    #[command(flatten)]
    pub target: TargetArguments,
    /// The picture.
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// What the colours say: plain, regions, design, tiles, quads, patches, kinds, curvature, or deviation (from --against)
    /// [default: what suits the result].
    #[arg(long)]
    pub color: Option<String>,
    /// The mesh that deviations are measured from: a mesh file, or with --pipeline the name of a stage.
    #[arg(long, value_name = "TARGET", required_if_eq("color", "deviation"))]
    pub against: Option<String>,
    /// The value at which the colours of deviation or curvature end, mm or 1/mm [default: 98 % of the surface are below].
    #[arg(long, value_name = "VALUE")]
    pub range: Option<f64>,
    /// Draw the edges of the triangles.
    #[arg(long)]
    pub edges: bool,
    /// Draw a bar of known length.
    #[arg(long)]
    pub scale_bar: bool,
    /// Strength of the shadows in corners, 0 to 1.
    #[arg(long, value_name = "SHARE", default_value = "0.9")]
    pub occlusion: f32,
    /// From where: iso, front, back, left, right, top, bottom, or AZIMUTH:ELEVATION in degrees.
    #[arg(long, default_value = "iso", allow_hyphen_values = true)]
    pub view: String,
    /// Pixels.
    #[arg(long, value_name = "WIDTHxHEIGHT", default_value = "1200x900")]
    pub size: String,
    /// Draw this mesh over a skeleton or beams, translucent: a mesh file, or with --pipeline the name of a stage.
    #[arg(long, value_name = "TARGET")]
    pub over: Option<String>,
}

/// Something that can be looked at.
#[derive(Debug, Clone, Args)]
pub struct TargetArguments {
    /// A mesh file, an artifact file, or with --pipeline the name of a stage.
    pub target: String,
    /// The pipeline of the stage.
    #[arg(long, value_name = "PIPELINE")]
    pub pipeline: Option<PathBuf>,
    /// The cache [default: .topipe beside the pipeline].
    #[arg(long, env = "TOPIPE_CACHE", value_name = "DIR")]
    pub cache: Option<PathBuf>,
}

/// `topipe cache`.
#[derive(Debug, Args)]
pub struct CacheArguments {
    /// What to do.
    #[command(subcommand)]
    pub command: CacheCommand,
    /// The cache.
    #[arg(long, env = "TOPIPE_CACHE", value_name = "DIR", default_value = ".topipe", global = true)]
    pub cache: PathBuf,
}

/// What `topipe cache` can do.
#[derive(Debug, Clone, Subcommand)]
pub enum CacheCommand {
    /// List the results that are kept, or with --runs the runs that are remembered.
    Ls {
        /// List runs.
        #[arg(long)]
        runs: bool,
    },
    /// Say how much room everything takes.
    Du,
    /// Check every file against its hash; move aside what does not verify.
    Verify,
    /// Say what could be thrown away, and which runs it would hurt; with --delete, do it.
    Gc {
        /// At most so much may stay: "500MB", "2GB".
        #[arg(long, value_name = "SIZE", value_parser = parse_size)]
        max_size: Option<u64>,
        /// Nothing that was last used longer ago may stay: "30d", "12h".
        #[arg(long, value_name = "TIME", value_parser = parse_age)]
        max_age: Option<Duration>,
        /// Throw it away.
        #[arg(long)]
        delete: bool,
        /// The plan as one JSON object.
        #[arg(long)]
        json: bool,
    },
    /// Keep the results of a run whatever gc is told.
    Pin {
        /// The run: the beginning of its name in `cache ls --runs`, its run.json, or its output folder.
        run: String,
        /// No longer.
        #[arg(long)]
        remove: bool,
    },
}

fn parse_size(text: &str) -> Result<u64, String> {
    let units = [("TB", 1e12), ("GB", 1e9), ("MB", 1e6), ("kB", 1e3), ("B", 1.0)];
    let (number, unit) =
        units.iter().find_map(|(name, unit)| Some((text.strip_suffix(name)?, *unit))).unwrap_or((text, 1.0));
    match number.trim().parse::<f64>() {
        Ok(number) if number >= 0.0 && number.is_finite() => Ok((number * unit) as u64),
        _ => Err("not a size; use a number and B, kB, MB, GB or TB".into()),
    }
}

fn parse_age(text: &str) -> Result<Duration, String> {
    let units = [('d', 86_400.0), ('h', 3600.0), ('m', 60.0), ('s', 1.0)];
    let seconds = units
        .iter()
        .find_map(|(name, unit)| Some(text.strip_suffix(*name)?.trim().parse::<f64>().ok()? * unit))
        .and_then(|seconds| Duration::try_from_secs_f64(seconds).ok());
    seconds.ok_or_else(|| "not a time; use a number and d, h, m or s".into())
}

/// A time, in seconds where it has no unit.
fn parse_patience(text: &str) -> Result<Duration, String> {
    let seconds = text.trim().parse::<f64>().ok().and_then(|s| Duration::try_from_secs_f64(s).ok());
    seconds.map_or_else(|| parse_age(text), Ok)
}

/// `topipe diff`.
#[derive(Debug, Args)]
pub struct DiffArguments {
    /// A run: its run.json, its output folder, or the beginning of its name in `cache ls --runs`.
    pub before: String,
    /// The run to compare it with.
    pub after: String,
    /// The cache in which runs are looked up and figures are found.
    #[arg(long, env = "TOPIPE_CACHE", value_name = "DIR", default_value = ".topipe")]
    pub cache: PathBuf,
    /// The differences as one JSON object.
    #[arg(long)]
    pub json: bool,
}

/// `topipe report`.
#[derive(Debug, Args)]
pub struct ReportArguments {
    /// The run: its run.json, its output folder, or the beginning of its name in `cache ls --runs`.
    pub run: String,
    /// The file [default: report.html beside run.json, or here].
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// The cache that has the results [default: .topipe beside the pipeline of the run].
    #[arg(long, env = "TOPIPE_CACHE", value_name = "DIR")]
    pub cache: Option<PathBuf>,
}

/// `topipe reproduce`.
#[derive(Debug, Args)]
pub struct ReproduceArguments {
    /// The record: a run.json or a lock file.
    pub record: PathBuf,
    /// The folder for the exports [default: they are compared and thrown away].
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// An empty folder to compute in, which is kept [default: a temporary one].
    #[arg(long, value_name = "DIR")]
    pub cache: Option<PathBuf>,
}

/// `topipe lock`.
#[derive(Debug, Args)]
pub struct LockArguments {
    /// The run: its run.json or its output folder.
    pub run: PathBuf,
    /// The lock file [default: beside the pipeline, NAME.lock.json].
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
}

/// `topipe log`.
#[derive(Debug, Args)]
pub struct LogArguments {
    /// The pipeline.
    #[command(flatten)]
    pub pipeline: PipelineArguments,
    /// Only this stage.
    pub stage: Option<String>,
}

/// `topipe man`.
#[derive(Debug, Args)]
pub struct ManArguments {
    /// The folder for the pages [default: the page of topipe goes to stdout].
    #[arg(short, long, value_name = "DIR")]
    pub output: Option<PathBuf>,
}

/// `topipe edit`.
#[derive(Debug, Args)]
pub struct EditArguments {
    /// The pipeline of the part before the edit.
    pub pipeline: PathBuf,
    /// The edited mesh. Triangles that the earlier one has too may be in another order [default: the earlier one].
    pub mesh: Option<PathBuf>,
    /// The pipeline to write, in the same folder [default: the mesh's name with .toml, or the pipeline's with -edited].
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Replace the pipeline if it exists.
    #[arg(long)]
    pub overwrite: bool,
}

/// `topipe new`.
#[derive(Debug, Args)]
pub struct NewArguments {
    /// The mesh: STL, OFF, OBJ or PLY, a density field: VTU, VTI or VTK, or a deck: INP.
    pub mesh: PathBuf,
    /// The pipeline to write [default: the mesh's name with .toml, in this folder].
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Replace the pipeline if it exists.
    #[arg(long)]
    pub overwrite: bool,
}
