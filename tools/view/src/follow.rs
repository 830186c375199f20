//! Following a run: the polling loop over its shared memory.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, Sender};
use std::time::{Duration, Instant};

use anyhow::bail;
use foxglove::RawChannel;
use foxglove::websocket::service::Responder;
use foxglove::websocket::{AnyClient, Parameter, SetParametersResponder};
use motorium::region::Latch;
use motorium::run_folder::RunFolder;
use serde_json::json;

use crate::ask::{Ask, Command};
use crate::children::{self, NeverSeen, Started, Times};
use crate::cores::stand_aside;
use crate::joined::{Joined, named, newest};
use crate::parameters;
use crate::request::Request;
use crate::schemas::{RUN, RUN_SCHEMA};
use crate::server::Server;

/// Poll interval for the start and end of runs.
const LIFE_CHECK: Duration = Duration::from_millis(50);
/// Poll interval for parameters, which other programs may set, and interval of run state reports.
const SLOWLY: Duration = Duration::from_millis(500);

/// Options of a run under check: it continues until the check is complete and is then ended.
const CHECKED_FOR: [&str; 3] = ["--for", "10min", "--no-expect"];

/// Name of the channel of times, which exists independently of the run.
const TIMES: &str = "/motorium/top";
/// JSON Schema of the times, the same as for `motorium top --json`.
const TIMES_SCHEMA: &str = include_str!("../schema/top.schema.json");

/// The thread that follows the run.
#[derive(Debug)]
pub(crate) struct Follower {
    motorium: PathBuf,
    request: Request,
    server: Arc<Server>,
    asks: Receiver<Ask>,
    started: Option<Started>,
    joined: Option<Joined>,
    /// Name of the last joined graph; a new run of it is joined next.
    graph: Option<String>,
    /// Id of the last joined run, which is not joined again.
    last: Option<String>,
    times: Option<Times>,
    run_channel: Arc<RawChannel>,
    times_channel: Arc<RawChannel>,
    shown: Vec<Parameter>,
    /// Commands on a run by their id.
    commands: Sender<(Command, String, Responder)>,
}

impl Follower {
    /// Creates a follower of the run of a request. The graph of the request is started.
    pub(crate) fn new(request: Request, server: Arc<Server>, asks: Receiver<Ask>) -> anyhow::Result<Self> {
        let run_channel = server.json_channel(RUN, "motorium.Run", RUN_SCHEMA)?;
        let times_channel = server.json_channel(TIMES, "motorium.Top", TIMES_SCHEMA)?;
        let (commands, requested) = mpsc::channel();
        let motorium = request.motorium.clone();
        std::thread::spawn(move || execute(&motorium, requested));
        let mut follower = Self {
            motorium: request.motorium.clone(),
            request,
            server,
            asks,
            started: None,
            joined: None,
            graph: None,
            last: None,
            times: None,
            run_channel,
            times_channel,
            shown: Vec::new(),
            commands,
        };
        if let Some(run) = &follower.request.run {
            let folder = named(run)?;
            follower.join(folder)?;
        }
        follower.start()?;
        Ok(follower)
    }

    /// Starts the graph of the request, if one is named and it is not running.
    fn start(&mut self) -> anyhow::Result<()> {
        if let (Some(graph), None) = (&self.request.graph, &self.started) {
            let (checked, mut arguments) =
                (self.request.headless_check.is_some(), self.request.arguments.clone());
            let has_duration = arguments.iter().any(|argument| argument.starts_with("--for"));
            if checked && !has_duration {
                arguments.extend(CHECKED_FOR.map(str::to_string));
            }
            self.started = Some(Started::run(&self.motorium, graph, &arguments, checked)?);
        }
        Ok(())
    }

    /// Follows until `over` is set. `interrupted` is set if the end was requested by a signal that also
    /// reached a graph started here.
    pub(crate) fn follow(mut self, over: &AtomicBool, interrupted: &AtomicBool) -> anyhow::Result<()> {
        let period = Duration::from_secs_f64(1.0 / self.request.rate_hz);
        let begun = Instant::now();
        let (mut next, mut checked, mut slowly) = (begun, begun, begun);
        while !over.load(Relaxed) && !interrupted.load(Relaxed) {
            match self.asks.recv_timeout(next.saturating_duration_since(Instant::now())) {
                Ok(ask) => {
                    self.answer(ask);
                    continue;
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => break,
            }
            let now = Instant::now();
            // Missed periods are skipped.
            next = (next + period).max(now);
            if let Some(joined) = &mut self.joined {
                joined.send();
            }
            if now - checked >= LIFE_CHECK {
                checked = now;
                self.check_life()?;
            }
            if now - slowly >= SLOWLY {
                slowly = now;
                self.tell_parameters();
                self.tell_times();
                self.tell_run();
            }
        }
        if let Some(started) = &mut self.started {
            started.end(interrupted.load(Relaxed));
        }
        Ok(())
    }

    /// Joins a run that starts and leaves one that has ended.
    fn check_life(&mut self) -> anyhow::Result<()> {
        if self.joined.as_ref().is_some_and(Joined::has_ended) {
            (self.joined, self.times) = (None, None);
            self.tell_run();
        }
        if let Some(status) = self.started.as_mut().and_then(Started::ended) {
            self.started = None;
            if self.graph.is_none() {
                bail!(NeverSeen::from_status(status));
            }
            eprintln!("the run is over; the page starts it again, Ctrl-C ends the viewer");
            self.tell_run();
        }
        if self.joined.is_none()
            && let Some(folder) = self.next_run()
        {
            // A run that is being created or removed is retried soon.
            if let Err(error) = self.join(folder)
                && self.graph.is_none()
                && self.request.run.is_some()
            {
                return Err(error);
            }
        }
        Ok(())
    }

    /// Returns the run to join: the graph started here, else the newest run of the last joined graph.
    fn next_run(&self) -> Option<RunFolder> {
        let is_new = |folder: &RunFolder| self.last.as_deref() != Some(folder.id());
        match (&self.started, &self.graph, &self.request.graph) {
            (Some(started), ..) => newest(|folder| {
                let launcher = |region: motorium::region::Region| region.header().launcher.load(Relaxed);
                is_new(folder) && folder.region().is_ok_and(|region| launcher(region) == started.pid())
            }),
            (None, Some(graph), _) => {
                newest(|folder| is_new(folder) && folder.plan().is_ok_and(|plan| plan.name == *graph))
            }
            (None, None, None) => newest(is_new),
            (None, None, Some(_)) => None,
        }
    }

    fn join(&mut self, folder: RunFolder) -> anyhow::Result<()> {
        let joined = Joined::open(folder, &self.server, &self.request.overheads.unwrap_or_default())?;
        stand_aside(&joined.plan.scheduling.shared_cores);
        self.graph = Some(joined.plan.name.clone());
        self.last = Some(joined.folder.id().to_string());
        self.joined = Some(joined);
        self.shown.clear();
        self.tell_parameters();
        self.tell_run();
        Ok(())
    }

    /// Returns the state of the run as sent to viewers.
    fn state(&self) -> String {
        let latch = self.joined.as_ref().and_then(|joined| joined.region.header().latched());
        let clock = self.joined.as_ref().map(|joined| joined.plan.clock);
        let state = match (&self.joined, &self.started, &self.graph) {
            (Some(_), ..) => "running",
            (None, Some(_), _) => "starting",
            (None, None, Some(_)) => "ended",
            (None, None, None) => "waiting",
        };
        json!({
            "run": self.last,
            "graph": self.graph,
            "state": state,
            "clock": clock,
            "latched": latch,
            "can_start": self.request.graph.is_some() && self.started.is_none(),
        })
        .to_string()
    }

    /// Reports the state of the run: immediately on a change, and periodically because slow viewers lose
    /// messages.
    fn tell_run(&self) {
        self.run_channel.log(self.state().as_bytes());
    }

    /// Reports parameters whose value has changed, by any program.
    fn tell_parameters(&mut self) {
        let Some(joined) = &self.joined else { return };
        let all = parameters::all(&joined.parameters);
        let changed = all.iter().filter(|parameter| !self.shown.contains(parameter)).cloned().collect();
        self.server.publish_parameters(changed);
        self.shown = all;
    }

    /// Forwards the times of the run, which are read only while there are subscribers.
    fn tell_times(&mut self) {
        let Some(joined) = self.joined.as_ref().filter(|_| self.times_channel.has_sinks()) else {
            self.times = None;
            return;
        };
        match &self.times {
            Some(times) => {
                if let Some(line) = times.newest() {
                    self.times_channel.log(line.as_bytes());
                }
            }
            None => self.times = Times::follow(&self.motorium, joined.folder.id()).ok(),
        }
    }

    fn answer(&mut self, ask: Ask) {
        match ask {
            Ask::Get(names, responder) => {
                let all =
                    self.joined.as_ref().map_or_else(Vec::new, |joined| parameters::all(&joined.parameters));
                let wanted = |parameter: &Parameter| names.is_empty() || names.contains(&parameter.name);
                responder.respond(all.into_iter().filter(wanted).collect());
            }
            Ask::Set(parameters, client, responder) => self.set(&parameters, &client, responder),
            Ask::Command(command, responder) => self.command(command, responder),
            Ask::Latched(topic, sink) => {
                if topic == RUN {
                    self.run_channel.log_to_sink(self.state().as_bytes(), sink);
                } else if let Some(joined) = &self.joined {
                    joined.send_latched(&topic, sink);
                }
            }
        }
    }

    /// Sets parameters: all of them, or none if one is invalid. The viewer receives the resulting values.
    fn set(&mut self, parameters: &[Parameter], client: &AnyClient, responder: SetParametersResponder) {
        let Some(joined) = &self.joined else {
            client.send_error("no graph is running");
            return responder.respond(Vec::new());
        };
        let declaration = |path: &str| {
            let (component, name) = path.split_once('.')?;
            let component = joined.plan.components.iter().find(|known| known.name == component)?;
            component.parameters.iter().map(|plan| &plan.declaration).find(|known| known.name == name)
        };
        let values: Result<Vec<_>, String> = parameters
            .iter()
            .map(|parameter| {
                let value = parameters::given(declaration(&parameter.name), parameter)?;
                Ok((parameter.name.as_str(), value))
            })
            .collect();
        let set =
            values.and_then(|values| joined.parameters.set_many(values).map_err(|error| error.to_string()));
        if let Err(error) = set {
            client.send_error(error);
        }
        let now = parameters::all(&joined.parameters);
        let asked = |parameter: &&Parameter| parameters.iter().any(|asked| asked.name == parameter.name);
        responder.respond(now.iter().filter(asked).cloned().collect());
        // The rejected client also receives the values, so its slider returns.
        self.server.publish_parameters(now.iter().filter(asked).cloned().collect());
        self.shown = now;
    }

    fn command(&mut self, command: Command, responder: Responder) {
        if command == Command::Start {
            let outcome = if self.request.graph.is_none() {
                Err("this viewer has not started the graph, and cannot start it again".to_string())
            } else if self.started.is_some() {
                Err("the graph runs".to_string())
            } else {
                self.start()
                    .map(|()| "the graph is started".to_string())
                    .map_err(|error| format!("{error:#}"))
            };
            self.tell_run();
            return respond(responder, outcome);
        }
        let Some(joined) = &self.joined else {
            return respond(responder, Err("no graph is running".to_string()));
        };
        if command == Command::Stop {
            // Immediate, independent of the process that waits for the outcome.
            joined.region.header().latch(Latch::Stop);
        }
        // the thread that executes them lives as long as this sender
        let _ = self.commands.send((command, joined.folder.id().to_string(), responder));
        self.tell_run();
    }
}

/// Executes commands one after another: `motorium stop` of an earlier click must not stop a robot that a
/// later one has released.
fn execute(motorium: &Path, requested: Receiver<(Command, String, Responder)>) {
    for (command, run, responder) in requested {
        let words: &[&str] = match command {
            Command::Stop => &["stop", "--now", "--run", &run],
            Command::Resume => &["resume", "--run", &run],
            Command::End | Command::Start => &["stop", "--run", &run],
        };
        respond(responder, children::command(motorium, words));
    }
}

/// Answers a request with the output of its command, or with its error.
fn respond(responder: Responder, outcome: Result<String, String>) {
    match outcome {
        Ok(message) => responder.respond_ok(json!({ "done": true, "message": message }).to_string()),
        Err(message) => responder.respond_err(message),
    }
}
