//! `motorium top` on a terminal: the tables, redrawn every interval, and keys.

use std::io;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};

use anyhow::Context as _;
use ratatui::Frame;
use ratatui::crossterm::event::{self, Event, KeyCode, KeyEvent, KeyEventKind, KeyModifiers};
use ratatui::layout::{Constraint, Layout};
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::{Line, Span as Piece};
use ratatui::widgets::Paragraph;

use super::data::{Span, Top};
use super::interval::{End, LONGEST, SHORTEST};
use super::layout::{Cell, Tone};
use super::order::Order;
use super::view::View;
use crate::metrics::Sample;
use crate::runs::LivingRun;

/// Time until the first interval is complete.
const FIRST: Duration = Duration::from_millis(300);
/// Interval between two checks whether the run has ended.
const LIFE_CHECK: Duration = Duration::from_millis(250);

/// State of the screen.
#[derive(Debug)]
struct Screen {
    view: View,
    interval: Duration,
    /// Index of the first displayed line of the tables.
    scroll: u16,
    top: Top,
}

/// Shows a run until it is over or the user quits, then restores the terminal.
pub(super) fn follow(
    run: &LivingRun,
    interval: Duration,
    view: View,
    interrupted: &AtomicBool,
) -> anyhow::Result<End> {
    let mut terminal = ratatui::try_init().context("taking the terminal")?;
    let end = (|| {
        let mut before = Sample::take(run);
        let mut screen = Screen { view, interval, scroll: 0, top: Top::between(run, &before, &before) };
        let mut due = Instant::now() + FIRST.min(interval);
        loop {
            terminal.draw(|frame| draw(frame, &mut screen))?;
            if key_within(due.saturating_duration_since(Instant::now()).min(LIFE_CHECK))?
                .is_some_and(|key| screen.press(key))
                || interrupted.load(Relaxed)
            {
                return Ok(End::Asked);
            }
            if run.has_ended() {
                return Ok(End::RunOver);
            }
            if Instant::now() >= due {
                let now = Sample::take(run);
                screen.top = Top::between(run, &before, &now);
                before = now;
                due = Instant::now() + screen.interval;
            }
        }
    })();
    ratatui::restore();
    end
}

/// Returns the key pressed within this time.
fn key_within(time: Duration) -> io::Result<Option<KeyEvent>> {
    let pressed = event::poll(time).and_then(|any| if any { event::read().map(Some) } else { Ok(None) });
    match pressed {
        Ok(Some(Event::Key(key))) if key.kind != KeyEventKind::Release => Ok(Some(key)),
        Ok(_) => Ok(None),
        // A signal; its sender is determined elsewhere.
        Err(error) if error.kind() == io::ErrorKind::Interrupted => Ok(None),
        Err(error) => Err(error),
    }
}

impl Screen {
    /// Applies a key. Returns `true` if it ends the display.
    fn press(&mut self, key: KeyEvent) -> bool {
        match key.code {
            KeyCode::Char('c') if key.modifiers.contains(KeyModifiers::CONTROL) => return true,
            KeyCode::Char('q') | KeyCode::Esc => return true,
            KeyCode::Char('i') | KeyCode::Tab => {
                self.view.span = match self.view.span {
                    Span::Run => Span::Interval,
                    Span::Interval => Span::Run,
                };
            }
            KeyCode::Char('r') => self.view.reversed = !self.view.reversed,
            KeyCode::Char('+') => self.interval = (self.interval * 2).min(LONGEST),
            KeyCode::Char('-') => self.interval = (self.interval / 2).max(SHORTEST),
            KeyCode::Down => self.scroll = self.scroll.saturating_add(1),
            KeyCode::Up => self.scroll = self.scroll.saturating_sub(1),
            KeyCode::PageDown => self.scroll = self.scroll.saturating_add(10),
            KeyCode::PageUp => self.scroll = self.scroll.saturating_sub(10),
            KeyCode::Home => self.scroll = 0,
            KeyCode::Char(letter) => {
                if let Some((_, order, _)) = Order::KEYS.iter().find(|(key, ..)| *key == letter) {
                    (self.view.order, self.view.reversed) = (*order, false);
                }
            }
            _ => {}
        }
        false
    }
}

fn draw(frame: &mut Frame<'_>, screen: &mut Screen) {
    let areas = Layout::vertical([Constraint::Length(1), Constraint::Fill(1), Constraint::Length(2)]);
    let [title, tables, footer] = areas.areas(frame.area());
    frame.render_widget(styled(&screen.view.title(&screen.top)), title);
    let mut lines = Vec::new();
    for sheet in screen.view.sheets(&screen.top) {
        lines.push(Line::default());
        lines.extend(sheet.lines(Some(tables.width.into())).iter().map(|line| styled(line)));
    }
    let most = (lines.len() as u16).saturating_sub(tables.height);
    screen.scroll = screen.scroll.min(most);
    frame.render_widget(Paragraph::new(lines).scroll((screen.scroll, 0)), tables);
    let below = if screen.scroll < most { "  (arrows: more below)" } else { "" };
    frame.render_widget(Paragraph::new(vec![orders(screen), keys(screen, below)]), footer);
}

/// Returns the sort keys, with the current one marked.
fn orders(screen: &Screen) -> Line<'static> {
    let mut pieces = vec![Piece::raw("sort by")];
    for (key, order, name) in Order::KEYS {
        let chosen = order == screen.view.order;
        let style = if chosen { Style::new().add_modifier(Modifier::REVERSED) } else { Style::new() };
        pieces.push(Piece::raw(" "));
        pieces.push(Piece::styled(key.to_string(), style.add_modifier(Modifier::BOLD)));
        pieces.push(Piece::styled(format!(" {name}"), style));
    }
    Line::from(pieces)
}

fn keys(screen: &Screen, below: &str) -> Line<'static> {
    let other = match screen.view.span {
        Span::Run => "last interval",
        Span::Interval => "whole run",
    };
    let every = screen.interval.as_secs_f64();
    let keys = [
        ("r", "reverse".to_string()),
        ("i", other.to_string()),
        ("+ -", format!("every {every} s")),
        ("q", format!("quit{below}")),
    ];
    let pieces = keys.into_iter().flat_map(|(key, does)| {
        [
            Piece::styled(key, Style::new().add_modifier(Modifier::BOLD)),
            Piece::raw(format!(" {does}")),
            Piece::raw("   "),
        ]
    });
    Line::from(pieces.collect::<Vec<_>>())
}

fn styled(line: &[Cell]) -> Line<'static> {
    let style = |tone| match tone {
        Tone::Plain => Style::new(),
        Tone::Strong => Style::new().add_modifier(Modifier::BOLD),
        Tone::Dim => Style::new().add_modifier(Modifier::DIM),
        Tone::Warning => Style::new().fg(Color::Yellow),
        Tone::Bad => Style::new().fg(Color::Red).add_modifier(Modifier::BOLD),
    };
    Line::from(line.iter().map(|cell| Piece::styled(cell.text.clone(), style(cell.tone))).collect::<Vec<_>>())
}

#[cfg(test)]
mod tests {
    use ratatui::Terminal;
    use ratatui::backend::TestBackend;

    use super::super::example::top;
    use super::*;

    fn screen() -> Screen {
        Screen { view: View::default(), interval: Duration::from_secs(1), scroll: 0, top: top() }
    }

    fn drawn(screen: &mut Screen, width: u16, height: u16) -> Terminal<TestBackend> {
        let mut terminal = Terminal::new(TestBackend::new(width, height)).expect("a picture");
        terminal.draw(|frame| draw(frame, screen)).expect("it can be drawn on");
        terminal
    }

    fn press(screen: &mut Screen, letter: char) -> bool {
        screen.press(KeyEvent::from(KeyCode::Char(letter)))
    }

    #[test]
    fn a_wide_terminal_shows_everything() {
        insta::assert_snapshot!(drawn(&mut screen(), 140, 34).backend());
    }

    #[test]
    fn a_small_terminal_shows_what_matters_most() {
        insta::assert_snapshot!(drawn(&mut screen(), 80, 24).backend());
    }

    #[test]
    fn keys_sort_and_choose_the_span() {
        let mut screen = screen();
        assert!(!press(&mut screen, 'e') && !press(&mut screen, 'i') && !press(&mut screen, '+'));
        let text = drawn(&mut screen, 120, 30).backend().to_string();
        let place = |name: &str| text.find(name).unwrap_or_else(|| panic!("{name}: {text}"));
        assert!(place("controller ") < place("physics "), "the longest step comes first: {text}");
        assert!(text.contains("of the last 1.0 s") && text.contains("every 2 s"), "{text}");
        press(&mut screen, 'r');
        let text = drawn(&mut screen, 120, 30).backend().to_string();
        assert!(text.find("encoder ") < text.find("controller "), "{text}");
        press(&mut screen, 'g');
        assert!((screen.view.order, screen.view.reversed) == (Order::Graph, false));
    }

    #[test]
    fn what_needs_attention_is_coloured() {
        let terminal = drawn(&mut screen(), 140, 34);
        let cells = terminal.backend().buffer().content();
        let coloured = |color| cells.iter().filter(move |cell| cell.fg == color).map(|cell| cell.symbol());
        let red: String = coloured(Color::Red).collect();
        assert!(red.contains("controller") && red.contains("faulted"), "{red}");
        let yellow: String = coloured(Color::Yellow).collect();
        assert!(yellow.split_whitespace().any(|number| number == "3"), "stolen steps: {yellow}");
    }

    #[test]
    fn the_interval_has_limits_and_scrolling_ends_with_the_tables() {
        let mut screen = screen();
        assert!((0..30).all(|_| !press(&mut screen, '-')));
        assert_eq!(screen.interval, SHORTEST);
        assert!((0..30).all(|_| !press(&mut screen, '+')));
        assert_eq!(screen.interval, LONGEST);
        assert!((0..30).all(|_| !screen.press(KeyEvent::from(KeyCode::PageDown))));
        let text = drawn(&mut screen, 100, 12).backend().to_string();
        assert!(text.contains("physics encoder"), "the cores come last: {text}");
        assert!(screen.scroll < 60);
        screen.press(KeyEvent::from(KeyCode::Home));
        assert!(drawn(&mut screen, 100, 12).backend().to_string().contains("more below"));
    }

    #[test]
    fn three_keys_end_it() {
        let control_c = KeyEvent::new(KeyCode::Char('c'), KeyModifiers::CONTROL);
        for key in [KeyEvent::from(KeyCode::Char('q')), KeyEvent::from(KeyCode::Esc), control_c] {
            assert!(screen().press(key));
        }
        assert!(!press(&mut screen(), 'c') && !press(&mut screen(), 'x'));
    }
}
