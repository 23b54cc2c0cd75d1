//! What people see: progress on stderr while it runs, a summary on stdout at the end.

use crate::args::Verbosity;
use indicatif::{MultiProgress, ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::collections::HashMap;
use std::fmt::Write as _;
use std::io::{IsTerminal, Write as _};
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};
use topipe_engine::{Event, EventSink, ExitCode, ExportOutcome, Outcome, RunRecord};
pub(crate) use topipe_progress::{duration, size};

/// Whether stderr is a terminal on which colors are welcome (<https://no-color.org>).
pub(crate) fn colors_on_stderr() -> bool {
    std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty())
}

/// Whether stdout is a terminal on which colors are welcome.
fn colors_on_stdout() -> bool {
    std::io::stdout().is_terminal() && std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty())
}

/// The styles of a summary: all empty where colors are not welcome.
#[derive(Clone, Copy)]
struct Style {
    bold: &'static str,
    dim: &'static str,
    good: &'static str,
    bad: &'static str,
    end: &'static str,
}

impl Style {
    const NONE: Self = Self { bold: "", dim: "", good: "", bad: "", end: "" };
    const ANSI: Self =
        Self { bold: "\x1b[1m", dim: "\x1b[2m", good: "\x1b[32m", bad: "\x1b[31m", end: "\x1b[0m" };
}

/// "5 min", "3 h", "12 d".
pub(crate) fn span(time: Duration) -> String {
    match time.as_secs() {
        s if s < 120 => format!("{s} s"),
        s if s < 7200 => format!("{} min", s / 60),
        s if s < 172_800 => format!("{} h", s / 3600),
        s => format!("{} d", s / 86_400),
    }
}

/// Follows a run on stderr: bars on a terminal, lines for what needs attention everywhere.
pub(crate) struct Console {
    verbosity: Verbosity,
    bars: MultiProgress,
    running: Mutex<HashMap<String, Running>>,
    /// How many stages are done, where there are many.
    whole: Mutex<Option<ProgressBar>>,
}

/// A stage that is being computed.
struct Running {
    bar: ProgressBar,
    /// What is counted now, up to where, how far it is, and when that count began.
    what: String,
    total: u64,
    done: u64,
    since: Instant,
}

impl Running {
    /// Takes note of a count; how long it has gone on. A stage that counts something else, or anew, is at another task.
    fn count(&mut self, what: &str, done: u64, total: u64) -> Duration {
        if self.what != what || self.total != total || done < self.done {
            (self.what, self.total, self.since) = (what.to_owned(), total, Instant::now());
        }
        self.done = done;
        self.since.elapsed()
    }
}

/// How much longer something takes that goes on as it went: told once there is something to go by.
fn remaining(elapsed: Duration, done: u64, total: u64) -> Option<Duration> {
    let known = elapsed >= Duration::from_secs(2) && done > 0 && total > done;
    known.then(|| elapsed.mul_f64((total - done) as f64 / done as f64))
}

/// So many stages can be followed one by one.
const FEW: usize = 12;

impl Console {
    pub(crate) fn new(verbosity: Verbosity, bars: bool) -> Self {
        let show = bars && verbosity > Verbosity::Quiet && std::io::stderr().is_terminal();
        let target = if show { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
        Self {
            verbosity,
            bars: MultiProgress::with_draw_target(target),
            running: Mutex::default(),
            whole: Mutex::default(),
        }
    }

    /// Takes the bars away.
    pub(crate) fn finish(&self) {
        // The terminal may be gone; then there is nothing to take away.
        let _ = self.bars.clear();
    }

    fn line(&self, at_least: Verbosity, text: &str) {
        if self.verbosity >= at_least {
            self.bars.suspend(|| eprintln!("{text}"));
        }
    }

    fn start(&self, stage: &str) {
        let bar = self.bars.add(ProgressBar::new_spinner());
        // The template is constant and right; were it not, the plain style would do.
        if let Ok(style) = ProgressStyle::with_template("  {spinner} {prefix} {wide_msg} {elapsed}") {
            bar.set_style(style);
        }
        bar.set_prefix(stage.to_owned());
        bar.enable_steady_tick(Duration::from_millis(120));
        let running = Running { bar, what: String::new(), total: 0, done: 0, since: Instant::now() };
        self.running.lock().unwrap_or_else(PoisonError::into_inner).insert(stage.to_owned(), running);
    }

    fn end(&self, stage: &str) {
        if let Some(running) = self.running.lock().unwrap_or_else(PoisonError::into_inner).remove(stage) {
            running.bar.finish_and_clear();
        }
    }
}

impl EventSink for Console {
    fn event(&self, event: &Event) {
        if let Event::StageCached { .. }
        | Event::StageFinished { .. }
        | Event::StageFailed { .. }
        | Event::StageSkipped { .. } = event
            && let Some(bar) = &*self.whole.lock().unwrap_or_else(PoisonError::into_inner)
        {
            bar.inc(1);
        }
        match event {
            Event::RunStarted { stages, .. } if stages.len() > FEW => {
                let bar = self.bars.insert(0, ProgressBar::new(stages.len() as u64));
                if let Ok(style) = ProgressStyle::with_template("  {bar:40} {pos} of {len} stages {elapsed}")
                {
                    bar.set_style(style);
                }
                *self.whole.lock().unwrap_or_else(PoisonError::into_inner) = Some(bar);
            }
            Event::StageStarted { stage, reasons, .. } => {
                let reasons: Vec<String> = reasons.iter().map(ToString::to_string).collect();
                self.line(Verbosity::Verbose, &format!("{stage}: {}", reasons.join("; ")));
                self.start(stage);
            }
            Event::StageProgress { stage, done, total, what } => {
                let mut running = self.running.lock().unwrap_or_else(PoisonError::into_inner);
                if let Some(running) = running.get_mut(stage) {
                    let of = if *total > 0 { format!(" of {total}") } else { String::new() };
                    let left = remaining(running.count(what, *done, *total), *done, *total);
                    let left = left.map_or_else(String::new, |left| format!(", about {} left", span(left)));
                    running.bar.set_message(format!("{done}{of} {what}{left}"));
                }
            }
            Event::StageWaiting { stage, holder } => {
                self.line(
                    Verbosity::Normal,
                    &format!("{stage}: waiting for {holder}, which computes the same"),
                );
            }
            Event::StageCached { stage, remarks, warnings, .. } => {
                for text in warnings {
                    self.line(Verbosity::Normal, &format!("warning: {stage}: {text}"));
                }
                for text in remarks {
                    self.line(Verbosity::Verbose, &format!("{stage}: {text}"));
                }
            }
            Event::StageWarning { stage, text } => {
                self.line(Verbosity::Normal, &format!("warning: {stage}: {text}"));
            }
            Event::StageRemark { stage, text } => self.line(Verbosity::Verbose, &format!("{stage}: {text}")),
            Event::StageUnits { stage, reused, computed } => {
                self.line(
                    Verbosity::Verbose,
                    &format!("{stage}: {reused} parts reused, {computed} computed"),
                );
            }
            Event::StageFinished { stage, .. } => self.end(stage),
            Event::StageFailed { stage, message, .. } => {
                self.end(stage);
                self.line(Verbosity::Quiet, &format!("error: stage `{stage}`: {message}"));
            }
            Event::UnitsNotKept { stage, message } => {
                self.line(Verbosity::Normal, &format!("warning: {stage}: {message}"));
            }
            Event::RecordNotWritten { message } => self.line(Verbosity::Quiet, &format!("error: {message}")),
            Event::ExportFailed { file, message, .. } => {
                self.line(Verbosity::Quiet, &format!("error: export {file}: {message}"));
            }
            Event::Quarantined { path, reason, moved_to } => {
                let moved = match moved_to {
                    Some(to) => format!("moved to {}", to.display()),
                    None => "it could not be moved aside".into(),
                };
                let text =
                    format!("warning: damaged file in the cache: {}: {reason}; {moved}", path.display());
                self.line(Verbosity::Normal, &text);
            }
            _ => {}
        }
    }
}

/// Writes each event as one line of JSON to stdout; what needs attention goes to the console as well.
pub(crate) struct JsonLines {
    console: Arc<Console>,
}

impl JsonLines {
    pub(crate) fn new(console: Arc<Console>) -> Self {
        Self { console }
    }
}

impl EventSink for JsonLines {
    fn event(&self, event: &Event) {
        self.console.event(event);
        if let Ok(line) = serde_json::to_string(event) {
            let mut stdout = std::io::stdout().lock();
            // Whoever listened may be gone; the run goes on.
            let _ = writeln!(stdout, "{line}").and_then(|()| stdout.flush());
        }
    }
}

/// What a run did, for the terminal. `reports` are files about the run, and whether each was written now; `broken` are figures out of their limits,
/// or nothing where there are no figures.
pub(crate) fn summary(
    record: &RunRecord,
    out: &Path,
    figures: &[(String, String)],
    reports: &[(std::path::PathBuf, bool)],
    broken: Option<&[topipe_report::figures::Finding]>,
) -> String {
    let style = if colors_on_stdout() { Style::ANSI } else { Style::NONE };
    let text = styled_summary(record, out, figures, reports, broken, style);
    match console::Term::stdout().size_checked() {
        Some((_, columns)) => wrapped(&text, usize::from(columns)),
        // What is piped keeps its lines.
        None => text,
    }
}

/// Lines that are too long go on below, a little further in. A terminal would break words.
fn wrapped(text: &str, columns: usize) -> String {
    let mut out = String::with_capacity(text.len());
    for line in text.lines() {
        let indent = line.chars().take_while(|c| *c == ' ').count();
        let hang = " ".repeat((indent + 2).min(columns / 2));
        let mut used = 0;
        for (k, word) in line.split_inclusive(' ').enumerate() {
            let width = console::measure_text_width(word.trim_end());
            if k > 0 && used > indent && used + width > columns.max(20) {
                out.truncate(out.trim_end().len());
                out.push('\n');
                out.push_str(&hang);
                used = hang.len();
            }
            out.push_str(word);
            used += console::measure_text_width(word);
        }
        out.push('\n');
    }
    out
}

fn styled_summary(
    record: &RunRecord,
    out: &Path,
    figures: &[(String, String)],
    reports: &[(std::path::PathBuf, bool)],
    broken: Option<&[topipe_report::figures::Finding]>,
    style: Style,
) -> String {
    let Style { bold, dim, good, bad, end } = style;
    let interrupted = match record.code {
        ExitCode::Interrupted => format!(", {bad}interrupted{end}; run again to go on"),
        _ => String::new(),
    };
    let mut text = format!("{bold}{}{end} ({}){interrupted}\n", record.pipeline, duration(record.seconds));
    let names = record.stages.iter().map(|stage| stage.stage.chars().count()).max().unwrap_or(0);
    let kinds = record.stages.iter().map(|stage| stage.kind.len()).max().unwrap_or(0);
    for stage in &record.stages {
        let state = match &stage.outcome {
            Outcome::Computed => duration(stage.seconds.unwrap_or_default()),
            Outcome::Cached => format!("{dim}cached{end}"),
            Outcome::Failed { .. } => format!("{bad}failed{end}"),
            Outcome::Skipped { because } => format!("{dim}skipped: {because}{end}"),
        };
        let _ = writeln!(text, "  {:names$}  {:kinds$}  {state}", stage.stage, stage.kind);
    }
    if !record.exports.is_empty() || !reports.is_empty() {
        let _ = writeln!(text, "\n{bold}{}{end}", out.display());
        let names = record.exports.iter().map(|export| export.file.chars().count());
        let reports_too = reports.iter().map(|(report, _)| report.to_string_lossy().chars().count());
        let files = names.chain(reports_too).max().unwrap_or(0);
        for export in &record.exports {
            let state = match &export.outcome {
                ExportOutcome::Written => format!("written, {}", size(export.bytes.unwrap_or_default())),
                ExportOutcome::UpToDate => format!("{dim}up to date{end}"),
                ExportOutcome::Skipped => "not written: its stage gave no result".into(),
                ExportOutcome::Failed { .. } => format!("{bad}failed{end}"),
            };
            let _ = writeln!(text, "  {:files$}  {state}", export.file);
        }
        for (report, written) in reports {
            let state =
                if *written { "written; open it in a browser" } else { "up to date; open it in a browser" };
            let _ = writeln!(text, "  {:files$}  {state}", report.to_string_lossy());
        }
    }
    for (stage, figures) in figures {
        let _ = writeln!(text, "\n{bold}{stage}{end}\n{}", figures.trim_end());
    }
    match broken {
        Some([]) => {
            let _ = writeln!(text, "\n{good}all figures are within their limits{end}");
        }
        Some(broken) => {
            let plural = if broken.len() == 1 { "figure is" } else { "figures are" };
            let _ = writeln!(text, "\n{bad}{} {plural} out of limits{end}", broken.len());
            for finding in broken {
                let limit = finding.limit.as_deref().unwrap_or_default();
                let _ = writeln!(text, "  {}: {} (limit: {limit})", finding.words, finding.value);
            }
        }
        None => {}
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_lines_go_on_below() {
        let text = "name (1 s)\n  one two three four five\n\nend\n";
        assert_eq!(wrapped(text, 80), text);
        assert_eq!(wrapped("  one two three four five six\n", 20), "  one two three four\n    five six\n");
        let word = "a_path_that_is_longer_than_the_terminal";
        assert_eq!(wrapped(&format!("{word} {word}\n"), 20), format!("{word}\n  {word}\n"));
    }

    #[test]
    fn a_count_that_begins_anew_has_its_own_time() {
        let begun = Instant::now().checked_sub(Duration::from_secs(60)).unwrap();
        let mut running =
            Running { bar: ProgressBar::hidden(), what: "patches".into(), total: 10, done: 9, since: begun };
        assert!(running.count("patches", 10, 10) >= Duration::from_secs(60));
        assert!(running.count("patches", 1, 10) < Duration::from_secs(60));
        running.since = begun;
        assert!(running.count("edges", 2, 10) < Duration::from_secs(60));
    }

    #[test]
    fn what_is_left_is_told_once_it_can_be_known() {
        let s = Duration::from_secs;
        assert_eq!(remaining(s(1), 5, 10), None);
        assert_eq!(remaining(s(10), 0, 10), None);
        assert_eq!(remaining(s(10), 10, 10), None);
        assert_eq!(remaining(s(10), 2, 10), Some(s(40)));
    }
}
