//! Display of a running graph: one live table on a terminal, plain lines elsewhere.

use std::io::{Stderr, Write as _};

use motorium::launcher::{ComponentStatus, Status};
use motorium::plan::Plan;
use ratatui::backend::CrosstermBackend;
use ratatui::layout::Constraint;
use ratatui::style::{Modifier, Style};
use ratatui::text::Text;
use ratatui::widgets::{Paragraph, Row, Table, Widget as _};
use ratatui::{Frame, Terminal, TerminalOptions, Viewport};

use crate::progress::{Progress, causes};
use crate::report::microseconds;
use crate::wrap::wrapped;

/// Returns `true` if standard error is a terminal with a known size, unlike a serial console.
pub(crate) fn is_drawable() -> bool {
    let is_dumb = std::env::var_os("TERM").is_none_or(|name| name == "dumb");
    let has_size = ratatui::crossterm::terminal::size().is_ok_and(|(width, height)| width > 0 && height > 0);
    !is_dumb && has_size
}

/// The live table: below the lines of the run, redrawn in place.
pub(crate) struct Screen {
    terminal: Terminal<CrosstermBackend<Stderr>>,
}

impl Screen {
    pub(crate) fn new(plan: &Plan) -> anyhow::Result<Self> {
        let height = plan.components.len() as u16 + 2;
        let options = TerminalOptions { viewport: Viewport::Inline(height) };
        let terminal = Terminal::with_options(CrosstermBackend::new(std::io::stderr()), options)?;
        Ok(Self { terminal })
    }

    /// Draws the state of the graph. Errors of the terminal are ignored: they must not stop a robot.
    pub(crate) fn state(&mut self, status: &Status) {
        let _ = self.terminal.draw(|frame| draw(frame, status));
    }

    /// Prints a line above the table.
    pub(crate) fn line(&mut self, line: &str) {
        let mut plain = anstream::adapter::strip_str(line).to_string();
        if let Ok(size) = self.terminal.size() {
            plain = wrapped(&plain, usize::from(size.width.max(1)));
        }
        let height = plain.lines().count().max(1) as u16;
        let _ = self
            .terminal
            .insert_before(height, |buffer| Paragraph::new(Text::from(plain)).render(buffer.area, buffer));
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        let _ = self.terminal.clear();
        let _ = self.terminal.show_cursor();
    }
}

fn draw(frame: &mut Frame<'_>, status: &Status) {
    let rows = status.components.iter().map(|component| {
        let missed = component.report.misses.missed() > 0;
        let style = if missed { Style::new().fg(ratatui::style::Color::Yellow) } else { Style::new() };
        Row::new(cells(component)).style(style)
    });
    let header = ["component", "phase", "steps", "Hz", "late p99 us", "step p99 us", "restarts", "missed"];
    let longest =
        status.components.iter().map(|component| component.report.name.chars().count()).max().unwrap_or(0);
    let widths = [
        Constraint::Length(longest.max(12) as u16),
        Constraint::Length(10),
        Constraint::Length(10),
        Constraint::Length(9),
        Constraint::Length(12),
        Constraint::Length(12),
        Constraint::Length(8),
        Constraint::Fill(1),
    ];
    let title = format!("{:.1} s   (Ctrl-C stops)", status.elapsed_ns as f64 * 1e-9);
    let table = Table::new(rows, widths)
        .header(Row::new(header).style(Style::new().add_modifier(Modifier::BOLD)))
        .block(ratatui::widgets::Block::new().title_bottom(title));
    frame.render_widget(table, frame.area());
}

fn cells(component: &ComponentStatus) -> [String; 8] {
    let phase = if component.safe {
        "safe state".to_string()
    } else {
        format!("{:?}", component.phase).to_lowercase()
    };
    let report = &component.report;
    [
        report.name.clone(),
        phase,
        report.steps.to_string(),
        format!("{:.1}", report.rate_hz),
        microseconds(report.lateness_ns.p99),
        microseconds(report.execution_ns.p99),
        report.restarts.to_string(),
        causes(&report.misses),
    ]
}

/// Plain lines: events and states.
pub(crate) struct Plain {
    quiet: bool,
    progress: Progress,
}

impl Plain {
    /// Creates a printer of plain lines. With `quiet`, standard output stays free for JSON.
    pub(crate) fn new(quiet: bool) -> Self {
        Self { quiet, progress: Progress::default() }
    }

    /// Prints the state of the graph as a line.
    pub(crate) fn state(&mut self, status: &Status) {
        let line = self.progress.line(status);
        self.line(&line);
    }

    /// Prints a line. A closed pipe or a full disk must not stop a robot.
    pub(crate) fn line(&self, line: &str) {
        let _ = match self.quiet {
            true => writeln!(anstream::stderr(), "{line}"),
            false => writeln!(anstream::stdout(), "{line}"),
        };
    }
}

#[cfg(test)]
mod tests {
    use motorium::launcher::ComponentReport;
    use motorium::region::{Misses, Phase};
    use motorium::telemetry::Percentiles;
    use ratatui::backend::TestBackend;

    use super::*;

    fn component(name: &str, misses: Misses) -> ComponentStatus {
        let percentiles = Percentiles { p50: 1_000, p99: 25_000, p999: 30_000, max: 41_000 };
        let report = ComponentReport {
            name: name.to_string(),
            steps: 2_004,
            rate_hz: 999.97,
            lateness_ns: percentiles,
            execution_ns: percentiles,
            misses,
            ..ComponentReport::default()
        };
        ComponentStatus { phase: Phase::Running, safe: false, report }
    }

    #[test]
    fn the_live_table_names_the_causes_of_misses() {
        let misses = Misses { stolen: 3, long_step: 1, skipped: 9, ..Misses::default() };
        let components =
            vec![component("joint-trajectory-controller", misses), component("b", Misses::default())];
        let status = Status { elapsed_ns: 2_000_000_000, components, latencies: vec![], edges: vec![] };
        let mut terminal = Terminal::new(TestBackend::new(120, 4)).expect("a picture");
        terminal.draw(|frame| draw(frame, &status)).expect("it can be drawn on");
        insta::assert_snapshot!(terminal.backend());
    }
}
