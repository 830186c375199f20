//! What is seen while a graph runs: one live table on a terminal, plain lines elsewhere.

use std::io::Stderr;

use motorium::launcher::{ComponentStatus, Event, Status};
use motorium::plan::Plan;
use ratatui::backend::CrosstermBackend;
use ratatui::layout::Constraint;
use ratatui::style::{Modifier, Style};
use ratatui::text::Text;
use ratatui::widgets::{Paragraph, Row, Table, Widget as _};
use ratatui::{Frame, Terminal, TerminalOptions, Viewport};

use crate::commands::line;
use crate::report::microseconds;

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

    /// Shows an event. A terminal that cannot be drawn on is no reason to stop a robot.
    pub(crate) fn show(&mut self, event: &Event<'_>) {
        if let Event::Status(status) = event {
            let _ = self.terminal.draw(|frame| draw(frame, status));
        } else if let Some(line) = line(event) {
            let plain = anstream::adapter::strip_str(&line).to_string();
            let _ = self
                .terminal
                .insert_before(1, |buffer| Paragraph::new(Text::from(plain)).render(buffer.area, buffer));
        }
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
        let style =
            if misses(component) > 0 { Style::new().fg(ratatui::style::Color::Yellow) } else { Style::new() };
        Row::new(cells(component)).style(style)
    });
    let header = ["component", "phase", "steps", "Hz", "late p99 us", "step p99 us", "missed", "restarts"];
    let widths = [
        Constraint::Min(12),
        Constraint::Length(10),
        Constraint::Length(10),
        Constraint::Length(9),
        Constraint::Length(12),
        Constraint::Length(12),
        Constraint::Length(7),
        Constraint::Length(8),
    ];
    let title = format!("{:.1} s   (Ctrl-C stops)", status.elapsed_ns as f64 * 1e-9);
    let table = Table::new(rows, widths)
        .header(Row::new(header).style(Style::new().add_modifier(Modifier::BOLD)))
        .block(ratatui::widgets::Block::new().title_bottom(title));
    frame.render_widget(table, frame.area());
}

fn misses(component: &ComponentStatus) -> u64 {
    component.misses.missed()
}

fn cells(component: &ComponentStatus) -> [String; 8] {
    let phase = if component.safe {
        "safe state".to_string()
    } else {
        format!("{:?}", component.phase).to_lowercase()
    };
    [
        component.name.clone(),
        phase,
        component.steps.to_string(),
        format!("{:.1}", component.rate_hz),
        microseconds(component.lateness_ns.p99),
        microseconds(component.execution_ns.p99),
        misses(component).to_string(),
        component.restarts.to_string(),
    ]
}

/// Plain lines: what happens, and once a second how things are.
pub(crate) struct Plain {
    quiet: bool,
    next_ns: u64,
}

impl Plain {
    /// With `quiet`, standard output stays free for JSON.
    pub(crate) fn new(quiet: bool) -> Self {
        Self { quiet, next_ns: 1_000_000_000 }
    }

    pub(crate) fn show(&mut self, event: &Event<'_>) {
        let text = match event {
            Event::Status(status)
                if status.elapsed_ns >= self.next_ns && status.elapsed_ns < u64::MAX / 2 =>
            {
                self.next_ns = (status.elapsed_ns / 1_000_000_000 + 1) * 1_000_000_000;
                status_line(status)
            }
            _ => match line(event) {
                Some(line) => line,
                None => return,
            },
        };
        if self.quiet {
            anstream::eprintln!("{text}");
        } else {
            anstream::println!("{text}");
        }
    }
}

fn status_line(status: &Status) -> String {
    let parts: Vec<String> = status
        .components
        .iter()
        .map(|component| {
            format!(
                "{} {:.0} Hz, late p99 {} us, missed {}",
                component.name,
                component.rate_hz,
                microseconds(component.lateness_ns.p99),
                misses(component)
            )
        })
        .collect();
    format!("{:5.1} s  {}", status.elapsed_ns as f64 * 1e-9, parts.join(" | "))
}
