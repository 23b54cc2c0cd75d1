//! Messages that point into a text.

use std::fmt;
use std::ops::Range;
use std::sync::Arc;

/// A text that messages point into: a spec file, or one argument of the command line.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Source {
    /// What to call it: the path as the user gave it, or "command line".
    pub name: String,
    /// The whole text.
    pub text: String,
}

/// One thing that is wrong, with its place.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Diagnostic {
    /// What is wrong.
    pub message: String,
    /// Where.
    pub source: Arc<Source>,
    /// The bytes of the text it is about.
    pub span: Range<usize>,
    /// What to do about it.
    pub help: Option<String>,
}

impl Diagnostic {
    /// `message` about `span` of `source`.
    pub fn new(source: &Arc<Source>, span: Range<usize>, message: impl Into<String>) -> Self {
        Self { message: message.into(), source: Arc::clone(source), span, help: None }
    }

    /// Adds advice.
    #[must_use]
    pub fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }

    /// Adds the known name nearest to `wrong`, if one is near, otherwise the list of all.
    #[must_use]
    pub fn suggest<'n>(self, wrong: &str, known: impl IntoIterator<Item = &'n str>) -> Self {
        let known: Vec<&str> = known.into_iter().collect();
        if let Some(near) = nearest(wrong, known.iter().copied()) {
            return self.help(format!("did you mean `{near}`?"));
        }
        if known.is_empty() {
            return self;
        }
        let list: Vec<String> = known.iter().map(|name| format!("`{name}`")).collect();
        self.help(format!("possible are {}", list.join(", ")))
    }

    /// Line and column of the start, from 1; the column counts characters.
    pub fn position(&self) -> (usize, usize) {
        let start = floor_boundary(&self.source.text, self.span.start);
        let before = &self.source.text[..start];
        let line_start = before.rfind('\n').map_or(0, |at| at + 1);
        (before.matches('\n').count() + 1, before[line_start..].chars().count() + 1)
    }
}

/// Longer lines are shown in part.
const LONGEST_LINE: usize = 160;

/// The largest character boundary that is not above `at`.
fn floor_boundary(text: &str, at: usize) -> usize {
    let mut at = at.min(text.len());
    while !text.is_char_boundary(at) {
        at -= 1;
    }
    at
}

/// The name most like `wrong`, if any is like it at all.
pub fn nearest<'n>(wrong: &str, known: impl IntoIterator<Item = &'n str>) -> Option<&'n str> {
    // 0.75 accepts one or two typing errors in a word of six letters and refuses words that merely share letters.
    known
        .into_iter()
        .map(|name| (strsim::jaro_winkler(wrong, name), name))
        .filter(|(likeness, _)| *likeness >= 0.75)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, name)| name)
}

impl fmt::Display for Diagnostic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (line, column) = self.position();
        let text = self.source.text.lines().nth(line - 1).unwrap_or("");
        let start = floor_boundary(&self.source.text, self.span.start);
        let end = floor_boundary(&self.source.text, self.span.end);
        let marked = self.source.text.get(start..end).unwrap_or("").lines().next().unwrap_or("");
        let gutter = line.to_string().len();
        // Of a line that fills the screen, what stands around the mark.
        let (from, length) = (column - 1, text.chars().count());
        let (first, last) = match length {
            0..=LONGEST_LINE => (0, length),
            _ => (from.saturating_sub(LONGEST_LINE / 2), (from + LONGEST_LINE / 2).min(length)),
        };
        let carets = marked.chars().count().min(last.saturating_sub(from)).max(1);
        let before = if first > 0 { "\u{2026}" } else { "" };
        let after = if last < length { "\u{2026}" } else { "" };
        let text: String = text.chars().skip(first).take(last - first).collect();
        // Tabs are kept so that the caret stands below the marked text whatever their width.
        let lead: String = before
            .chars()
            .chain(text.chars().take(from.saturating_sub(first)))
            .map(|c| if c == '\t' { '\t' } else { ' ' })
            .collect();
        let text = format!("{before}{text}{after}");
        writeln!(f, "error: {}", self.message)?;
        writeln!(f, "{:gutter$}--> {}:{line}:{column}", "", self.source.name)?;
        writeln!(f, "{:gutter$} |", "")?;
        writeln!(f, "{line} | {text}")?;
        write!(f, "{:gutter$} | {lead}{}", "", "^".repeat(carets))?;
        if let Some(help) = &self.help {
            write!(f, "\n{:gutter$} = help: {help}", "")?;
        }
        Ok(())
    }
}

impl std::error::Error for Diagnostic {}

#[cfg(test)]
mod tests {
    use super::*;

    fn source(text: &str) -> Arc<Source> {
        Arc::new(Source { name: "a.toml".into(), text: text.into() })
    }

    #[test]
    fn caret_stands_below_the_marked_text() {
        let source = source("one\n\té = 3\n");
        let at = source.text.find('3').unwrap();
        let shown = Diagnostic::new(&source, at..at + 1, "no").help("yes").to_string();
        assert_eq!(shown, "error: no\n --> a.toml:2:6\n  |\n2 | \té = 3\n  | \t    ^\n  = help: yes");
    }

    #[test]
    fn of_a_line_that_fills_the_screen_the_part_around_the_mark_is_shown() {
        let source = source(&format!("{}wrong{}\n", "\u{e9}".repeat(10_000), "b".repeat(100_000)));
        let at = source.text.find('w').unwrap();
        let shown = Diagnostic::new(&source, at..at + 5, "no").to_string();
        assert!(shown.contains("a.toml:1:10001"), "{shown}");
        let lines: Vec<Vec<char>> = shown.lines().map(|line| line.chars().collect()).collect();
        assert!(lines.iter().all(|line| line.len() < 180));
        let carets: Vec<usize> = (0..lines[4].len()).filter(|&k| lines[4][k] == '^').collect();
        let marked: String = carets.iter().map(|&k| lines[3][k]).collect();
        assert_eq!(marked, "wrong");
        // A mark from here to the end of the text ends with what is shown.
        let shown = Diagnostic::new(&source, at..source.text.len(), "no").to_string();
        assert!(shown.lines().all(|line| line.chars().count() < 180), "{shown}");
    }

    #[test]
    fn a_span_outside_the_text_is_shown_at_its_end() {
        let shown = Diagnostic::new(&source("ab"), 7..9, "no").to_string();
        assert!(shown.contains("a.toml:1:3"), "{shown}");
    }

    #[test]
    fn only_near_names_are_suggested() {
        assert_eq!(nearest("alhpa", ["alpha", "beta"]), Some("alpha"));
        assert_eq!(nearest("smothing", ["smoothing", "tiling"]), Some("smoothing"));
        assert_eq!(nearest("xyz", ["alpha", "beta"]), None);
    }
}
