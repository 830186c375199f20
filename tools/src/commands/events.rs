//! `motorium events`: the log of events of a run.

use std::io::{ErrorKind, Write as _};
use std::process::ExitCode;
use std::time::{Duration, Instant};

use motorium::launcher::LoggedEvent;
use motorium::nearest::suggest;
use motorium::plan::{ClockKind, Plan};
use motorium::region::{EventKind, EventReader, EventRecord, EventSeverity};

use crate::out::errln;
use crate::runs::{LivingRun, RunArg};
use crate::style;

/// Show the log of events of a run: starts, resets, failures, restarts, stops, misses, refusals, safe states,
/// printed lines.
///
/// The log has a fixed size: it keeps the newest 128 events of each severity, and the newest 128 printed
/// lines. A finished run has no log. To show the log of a crashed run, name its id.
///
/// Example: motorium events --follow --severity warning
#[derive(Debug, clap::Args)]
pub(crate) struct Events {
    /// Run to show: its id, a prefix of the id, or the name of its graph [default: the newest]
    #[arg(value_name = "RUN", add = crate::complete::runs())]
    name: Option<String>,
    /// Same as RUN, by the option of other commands
    #[arg(long = "run", value_name = "ID", conflicts_with = "name", add = crate::complete::runs())]
    run: Option<String>,
    /// Print new events until the run has ended
    #[arg(long, short)]
    follow: bool,
    /// Show only the newest N events of the log [default: all]
    #[arg(long, short = 'n', value_name = "N")]
    lines: Option<usize>,
    /// Show events of at least this severity
    #[arg(long, short, value_enum, default_value_t = Severity::Information, hide_default_value = true)]
    severity: Severity,
    /// Show only events of this component
    #[arg(long, short, value_name = "NAME", add = crate::complete::components())]
    component: Option<String>,
    /// Show only events of this kind, such as `restarted`; may be repeated
    #[arg(long, short, value_name = "KIND", value_parser = kind)]
    kind: Vec<EventKind>,
    /// Print one JSON object per line
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Severity {
    /// As planned
    Information,
    /// The run continues, but not as the graph requires
    Warning,
    /// A failure
    Error,
}

impl Severity {
    fn least(self) -> EventSeverity {
        match self {
            Self::Information => EventSeverity::Information,
            Self::Warning => EventSeverity::Warning,
            Self::Error => EventSeverity::Error,
        }
    }
}

fn kind(text: &str) -> Result<EventKind, String> {
    EventKind::ALL.iter().find(|kind| kind.name() == text).copied().ok_or_else(|| {
        let names = EventKind::ALL.iter().map(|kind| kind.name());
        format!("unknown kind of event; {}", suggest(text, names, "there are"))
    })
}

/// Interval between two polls of the log.
const LOOK: Duration = Duration::from_millis(20);
/// Interval between two checks whether the run has ended.
const LIFE_CHECK: Duration = Duration::from_millis(200);

impl Events {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        let run = RunArg::named(self.name.as_deref().or(self.run.as_deref())).open_even_if_over()?;
        if let Some(component) = &self.component {
            let names = || run.plan.components.iter().map(|component| component.name.as_str());
            anyhow::ensure!(
                names().any(|name| name == component),
                "graph `{}` has no component `{component}`; {}",
                run.plan.name,
                suggest(component, names(), "it has")
            );
        }
        run.stand_aside();
        let mut follower = Follower::new(&run);
        let mut events = self.chosen(&run.plan, follower.settled());
        let first = self.lines.map_or(0, |lines| events.len().saturating_sub(lines));
        events.drain(..first);
        if follower.lost() > 0 {
            errln!("{} older events are no longer in the log", follower.lost());
        }
        if !self.print(&run, events)? || !self.follow {
            return Ok(ExitCode::SUCCESS);
        }
        let lost = follower.lost();
        while let Some(records) = follower.next() {
            if !self.print(&run, self.chosen(&run.plan, records))? {
                return Ok(ExitCode::SUCCESS);
            }
        }
        if follower.lost() > lost {
            errln!("{} events were overwritten before they could be read", follower.lost() - lost);
        }
        errln!("run {} is over", run.folder.id());
        Ok(ExitCode::SUCCESS)
    }

    /// Selects events according to the options.
    fn chosen(&self, plan: &Plan, mut records: Vec<EventRecord>) -> Vec<EventRecord> {
        let component = |record: &EventRecord| {
            record.component.and_then(|index| plan.components.get(index)).map(|component| &component.name)
        };
        records.retain(|record| {
            record.severity >= self.severity.least()
                && (self.component.is_none() || component(record) == self.component.as_ref())
                && (self.kind.is_empty() || self.kind.contains(&record.kind))
        });
        records
    }

    /// Prints events. Returns `false` once the reader has closed the pipe.
    fn print(&self, run: &LivingRun, records: Vec<EventRecord>) -> anyhow::Result<bool> {
        let width = run.plan.components.iter().map(|component| component.name.chars().count()).max();
        let mut text = String::new();
        for record in records {
            let event = LoggedEvent::from_record(record, &run.plan, &run.region);
            text += &if self.json {
                serde_json::to_string(&event)?
            } else {
                line(&event, run.plan.clock, width.unwrap_or(0))
            };
            text.push('\n');
        }
        let mut out = anstream::stdout().lock();
        match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
            Ok(()) => Ok(true),
            Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(false),
            Err(error) => Err(error.into()),
        }
    }
}

/// Formats an event: time, severity, component, kind, text. `width` is the length of the longest component
/// name.
fn line(event: &LoggedEvent, clock: ClockKind, width: usize) -> String {
    let time_s = match clock {
        ClockKind::Realtime => event.time_s,
        ClockKind::Lockstep => event.simulated_s.unwrap_or(0.0),
    };
    let severity = format!("{:11}", event.severity.name());
    let severity = match event.severity {
        EventSeverity::Information => style::dim(severity),
        EventSeverity::Warning => style::warning(severity),
        EventSeverity::Error => style::error(severity),
    };
    let component = event.component.as_deref().unwrap_or("-");
    let kind = style::dim(format!("{:18}", event.kind.name()));
    format!("{time_s:>12.6} s  {severity}  {component:width$}  {kind}  {}", event.text)
}

/// Reads the events of a run as they arrive.
pub(super) struct Follower<'a> {
    run: &'a LivingRun,
    reader: EventReader,
    checked: Instant,
    is_over: bool,
}

impl<'a> Follower<'a> {
    /// Starts with the oldest event still in the log.
    pub(super) fn new(run: &'a LivingRun) -> Self {
        Self { run, reader: EventReader::default(), checked: Instant::now(), is_over: false }
    }

    /// Returns the number of events that were overwritten before they were read.
    pub(super) fn lost(&self) -> u64 {
        self.reader.lost()
    }

    /// Returns everything in the log, including an event that is being written.
    pub(super) fn settled(&mut self) -> Vec<EventRecord> {
        let mut records = self.reader.read(self.run.region.events());
        std::thread::sleep(Duration::from_millis(1));
        records.extend(self.reader.read(self.run.region.events()));
        records
    }

    /// Returns the next events, possibly none, or `None` when the run has ended and all were read.
    pub(super) fn next(&mut self) -> Option<Vec<EventRecord>> {
        if self.is_over {
            return None;
        }
        std::thread::sleep(LOOK);
        // Checked before the last poll, so that events written until the end are read.
        if self.checked.elapsed() >= LIFE_CHECK {
            self.checked = Instant::now();
            self.is_over = !self.run.folder.is_alive();
        }
        Some(if self.is_over { self.settled() } else { self.reader.read(self.run.region.events()) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn event() -> LoggedEvent {
        LoggedEvent {
            time_s: 12.5,
            simulated_s: Some(2.25),
            episode: Some(1),
            severity: EventSeverity::Warning,
            component: Some("physics".to_string()),
            kind: EventKind::Refused,
            value: 3.0,
            text: "`physics` refused 3 commands: 3 beyond a limit".to_string(),
        }
    }

    fn unstyled(text: &str) -> String {
        anstream::adapter::strip_str(text).to_string()
    }

    #[test]
    fn line_shows_time_severity_component_kind_and_text() {
        assert_eq!(
            unstyled(&line(&event(), ClockKind::Realtime, 10)),
            "   12.500000 s  warning      physics     refused             `physics` refused 3 commands: 3 beyond a limit"
        );
        let simulated = unstyled(&line(&event(), ClockKind::Lockstep, 10));
        assert!(simulated.starts_with("    2.250000 s  warning"), "{simulated}");
    }

    #[test]
    fn kind_names_are_suggested_on_a_typo() {
        assert_eq!(kind("restarted"), Ok(EventKind::Restarted));
        assert!(kind("restart").unwrap_err().contains("did you mean `restarted`?"));
    }
}
