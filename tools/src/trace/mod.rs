//! The trace of a run, collected during the run and written at its end.

mod chrome;
mod flows;

use std::fs::File;
use std::io::{BufWriter, Write as _};
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering::Acquire;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::Duration;

use anyhow::Context as _;
use motorium::launcher::Report;
use motorium::plan::Plan;
use motorium::region::{Region, TraceEvent, TraceReader};
use motorium::run_folder::RunFolder;
use motorium::schedule::Admission;

use crate::out::errln;
use crate::style;
use chrome::Trace;

/// Capacity of a component's ring in events: about twenty times the events of a component at 8 kHz between
/// two polls.
const EVENTS: usize = 1 << 14;
/// Interval between two polls of the rings.
const LOOK: Duration = Duration::from_millis(10);

/// The trace of a run about to be launched.
pub(crate) struct Tracing {
    output: PathBuf,
    file: File,
    plan: Plan,
    admission: Admission,
    messages: Sender<Message>,
    follower: JoinHandle<Followed>,
}

enum Message {
    /// The run of this name was created.
    Created(String),
    /// The run is over.
    Ended,
}

/// Events read from the rings.
#[derive(Default)]
struct Followed {
    start_ns: u64,
    /// Events of each component, in the order of the plan.
    components: Vec<Vec<TraceEvent>>,
    lost: Vec<u64>,
}

impl Tracing {
    /// Enables tracing in a plan and creates the file immediately.
    pub(crate) fn new(output: &Path, plan: &mut Plan, admission: &Admission) -> anyhow::Result<Self> {
        plan.trace_events = EVENTS;
        if let Some(folder) = output.parent() {
            std::fs::create_dir_all(folder).with_context(|| format!("making {}", folder.display()))?;
        }
        let file = File::create(output).with_context(|| format!("making {}", output.display()))?;
        let (messages, receiver) = channel();
        // Created before the launcher moves to its cores, so that it does not share a core with a lockstep
        // run.
        let follower =
            std::thread::Builder::new().name("trace".to_string()).spawn(move || follow(&receiver))?;
        let (output, plan, admission) = (output.to_path_buf(), plan.clone(), admission.clone());
        Ok(Self { output, file, plan, admission, messages, follower })
    }

    /// Follows the run of this name, which was created but has not started.
    pub(crate) fn follow(&self, run: &str) {
        // A follower that has ended has panicked, which `finish` reports.
        let _ = self.messages.send(Message::Created(run.to_string()));
    }

    /// Writes the file of a run that is over.
    pub(crate) fn finish(self, report: &Report) -> anyhow::Result<()> {
        let _ = self.messages.send(Message::Ended);
        let followed =
            self.follower.join().map_err(|_| anyhow::anyhow!("the trace could not be followed"))?;
        let trace = Trace {
            plan: &self.plan,
            admission: &self.admission,
            start_ns: followed.start_ns,
            duration_s: report.duration_s,
            components: &followed.components,
            lost: &followed.lost,
        };
        let mut writer = BufWriter::new(self.file);
        let counts = trace.write(&mut writer).and_then(|counts| writer.flush().map(|()| counts));
        let counts = counts.with_context(|| format!("writing {}", self.output.display()))?;
        errln!("{}: {} steps, {} hand-overs", self.output.display(), counts.steps, counts.hand_overs);
        for (component, lost) in
            self.plan.components.iter().zip(&followed.lost).filter(|(_, lost)| **lost > 0)
        {
            errln!(
                "{} {lost} events of `{}` were overwritten before they were read: they are not in the trace",
                style::warning("warning:"),
                component.name
            );
        }
        Ok(())
    }
}

/// Reads the rings of a run until it is over.
fn follow(messages: &Receiver<Message>) -> Followed {
    let mut followed = Followed::default();
    let Ok(Message::Created(run)) = messages.recv() else { return followed };
    // Mapped while the run lives: the mapping outlives the name.
    let Some(region) = RunFolder::find(&run).and_then(|folder| folder.region().ok()) else { return followed };
    let mut readers: Vec<TraceReader> = (0..region.components().len()).map(TraceReader::new).collect();
    followed.components = vec![Vec::new(); readers.len()];
    loop {
        let ended = !matches!(messages.recv_timeout(LOOK), Err(RecvTimeoutError::Timeout));
        read(&region, &mut readers, &mut followed.components);
        if ended {
            followed.start_ns = region.header().start_ns.load(Acquire);
            followed.lost = readers.iter().map(TraceReader::lost).collect();
            return followed;
        }
    }
}

fn read(region: &Region, readers: &mut [TraceReader], components: &mut [Vec<TraceEvent>]) {
    for (reader, events) in readers.iter_mut().zip(components) {
        events.extend(reader.read(region));
    }
}
