//! The processes of a measurement: started, watched, ended.

use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use crate::MeasureError;

/// Starts a program several times, with a name and arguments each, and waits until all have ended well.
///
/// # Errors
/// One of them could not be started, failed, or took longer than the limit: then all are ended.
pub(crate) fn run_to_end(
    program: &Path,
    processes: &[(&'static str, Vec<String>)],
    folder: &Path,
    limit: Duration,
) -> Result<(), MeasureError> {
    let mut children = Vec::new();
    for (_, arguments) in processes {
        let child = Command::new(program)
            .args(arguments)
            .arg(folder)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn();
        match child {
            Ok(child) => children.push(child),
            Err(error) => {
                kill(&mut children);
                return Err(MeasureError::system("starting a process", error));
            }
        }
    }
    let end = Instant::now() + limit;
    loop {
        let mut ended = 0;
        for (child, (process, _)) in children.iter_mut().zip(processes) {
            match child.try_wait() {
                Ok(Some(status)) if status.success() => ended += 1,
                Ok(None) => {}
                Ok(Some(_)) | Err(_) => {
                    let message = child.stderr.take().and_then(|pipe| std::io::read_to_string(pipe).ok());
                    kill(&mut children);
                    let message = message.filter(|message| !message.trim().is_empty());
                    return Err(MeasureError::Process {
                        process,
                        reason: message.map_or("it died".to_string(), |message| message.trim().to_string()),
                    });
                }
            }
        }
        if ended == children.len() {
            return Ok(());
        }
        if Instant::now() > end {
            kill(&mut children);
            return Err(MeasureError::Process { process: processes[0].0, reason: "it hung".to_string() });
        }
        std::thread::sleep(Duration::from_millis(5));
    }
}

fn kill(children: &mut [Child]) {
    for child in children {
        let _ = child.kill();
        let _ = child.wait();
    }
}
