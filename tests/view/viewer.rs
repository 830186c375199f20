//! A viewer started by a user with `motorium view`.

use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc::{self, Receiver};
use std::time::{Duration, Instant};

use rustix::process::Signal;

use crate::support::{signal, workspace};
use crate::{MOTORIUM, VIEW};

/// A folder in which `motorium` and `motorium-view` are installed.
pub(crate) fn installed() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (program, name) in [(MOTORIUM, "motorium"), (VIEW, "motorium-view")] {
        let at = folder.path().join(name);
        if std::fs::hard_link(program, &at).is_err() {
            std::fs::copy(program, &at).unwrap();
        }
    }
    folder
}

pub(crate) struct Viewer {
    child: Child,
    lines: Receiver<String>,
    pub(crate) port: u16,
    pub(crate) token: String,
    _installed: tempfile::TempDir,
}

impl Viewer {
    /// Starts `motorium view ARGUMENTS --port 0` and waits until it serves.
    pub(crate) fn start(arguments: &[&str], environment: &[(&str, &Path)]) -> Self {
        let installed = installed();
        let child = Command::new(installed.path().join("motorium"))
            .args(["view", "--port", "0"])
            .args(arguments)
            .envs(environment.iter().copied())
            .current_dir(workspace())
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .expect("motorium starts");
        let (sender, lines) = mpsc::channel();
        let mut this = Self { child, lines, port: 0, token: String::new(), _installed: installed };
        let errors = this.child.stderr.take().unwrap();
        std::thread::spawn(move || {
            BufReader::new(errors).lines().map_while(Result::ok).try_for_each(|line| sender.send(line))
        });
        let (began, mut said) = (Instant::now(), Vec::new());
        loop {
            let line = this.lines.recv_timeout(Duration::from_secs(60).saturating_sub(began.elapsed()));
            let line = line.unwrap_or_else(|_| panic!("it does not serve:\n{}", said.join("\n")));
            if let Some((_, rest)) = line.split_once("view at http://localhost:") {
                let (port, token) = rest.trim().split_once("/?token=").expect("an address with its token");
                (this.port, this.token) = (port.parse().unwrap(), token.to_string());
                return this;
            }
            said.push(line);
        }
    }

    /// Returns the lines printed since the last call.
    pub(crate) fn said(&self) -> String {
        self.lines.try_iter().collect::<Vec<_>>().join("\n")
    }

    /// Requests termination, as a service manager does, and waits for the end.
    pub(crate) fn end(&mut self) -> ExitStatus {
        signal(self.child.id(), Signal::TERM);
        self.child.wait().expect("it ends")
    }

    /// Returns the processes it has started, and their descendants.
    pub(crate) fn descendants(&self) -> Vec<u32> {
        let mut found = vec![self.child.id()];
        let mut next = 0;
        while let Some(parent) = found.get(next) {
            let threads = std::fs::read_dir(format!("/proc/{parent}/task")).into_iter().flatten().flatten();
            let lists =
                threads.filter_map(|thread| std::fs::read_to_string(thread.path().join("children")).ok());
            let children: Vec<u32> = lists
                .flat_map(|list| list.split_whitespace().map(str::to_string).collect::<Vec<_>>())
                .filter_map(|pid| pid.parse().ok())
                .collect();
            found.extend(children);
            next += 1;
        }
        found.split_off(1)
    }

    /// Returns the address of the page, with the right to command.
    pub(crate) fn address(&self) -> String {
        format!("http://localhost:{}/?token={}", self.port, self.token)
    }

    /// Returns the answer to a request.
    pub(crate) fn ask(&self, request: &str) -> String {
        let mut stream = TcpStream::connect(("127.0.0.1", self.port)).expect("somebody listens");
        stream.write_all(request.as_bytes()).expect("it is heard");
        let mut answer = Vec::new();
        stream.read_to_end(&mut answer).expect("it answers");
        String::from_utf8_lossy(&answer).into_owned()
    }
}

impl Drop for Viewer {
    fn drop(&mut self) {
        if self.child.try_wait().is_ok_and(|ended| ended.is_some()) {
            return;
        }
        // It ends the graph that it has started.
        signal(self.child.id(), Signal::TERM);
        let began = Instant::now();
        while self.child.try_wait().is_ok_and(|ended| ended.is_none()) {
            if began.elapsed() > Duration::from_secs(30) {
                let _ = self.child.kill();
                break;
            }
            std::thread::sleep(Duration::from_millis(10));
        }
        let _ = self.child.wait();
    }
}
