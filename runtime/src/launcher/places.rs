//! Slots in topics and parameters occupied by dead processes, and their release.

use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use super::services::Services;
use super::{Event, Hosting, Options};
use crate::run_folder::RunFolder;
use crate::worker::CLEANER;

/// Time between two checks for dead processes.
const LOOK_EVERY: Duration = Duration::from_millis(300);
/// Delay after a crash of the cleaner.
const AFTER_CRASH: Duration = Duration::from_secs(10);

/// Releases the slots of killed components before their restart, and of killed tools.
///
/// iceoryx2 frees a slot by traversing data that all processes of the run can write. This is done by a
/// separate process, so that damaged data can only crash that process.
#[derive(Debug, Default)]
pub(super) struct Places {
    next: Option<Instant>,
    cleaner: Option<Child>,
}

impl Places {
    /// Checks for dead processes periodically, and starts the cleaner to free their slots.
    pub(super) fn look(&mut self, options: &Options, folder: &RunFolder, observe: &mut dyn FnMut(Event<'_>)) {
        if options.program.as_os_str().is_empty() {
            // The slots of threads are freed when one of them restarts.
            return;
        }
        let now = Instant::now();
        if let Some(cleaner) = &mut self.cleaner {
            match cleaner.try_wait() {
                Ok(None) => return,
                Ok(Some(status)) if status.success() => {}
                Ok(Some(status)) => {
                    self.next = Some(now + AFTER_CRASH);
                    let line = format!(
                        "the slots of dead processes in the topics could not be freed ({status}); a component that \
                         crashes again may find no free slot"
                    );
                    observe(Event::Lost(&line));
                }
                Err(_) => {}
            }
            self.cleaner = None;
        }
        if self.next.is_some_and(|next| now < next) {
            return;
        }
        self.next = Some(now + LOOK_EVERY);
        if folder.domain().is_ok_and(|domain| domain.has_dead()) {
            self.start_cleaner(options, folder);
        }
    }

    /// Frees the slots of a component that has just died and is about to be restarted. Because there are
    /// spare slots, its successor need not wait.
    pub(super) fn free(&mut self, options: &Options, folder: &RunFolder, services: &Services) {
        match options.hosting {
            // The threads of one process share their node.
            Hosting::Threads | Hosting::Inline => {
                if let Some(node) = &services.node {
                    node.try_cleanup_dead_nodes();
                }
            }
            Hosting::Processes if self.cleaner.is_none() => self.start_cleaner(options, folder),
            Hosting::Processes => self.next = None,
        }
    }

    fn start_cleaner(&mut self, options: &Options, folder: &RunFolder) {
        let mut command = Command::new(&options.program);
        command.arg(CLEANER).arg(folder.path());
        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
        // If no process can be started, the next check tries again.
        self.cleaner = command.spawn().ok();
    }

    /// Ends the cleaner, which works in memory that is about to be removed.
    pub(super) fn end_cleaner(&mut self) {
        if let Some(mut cleaner) = self.cleaner.take() {
            let _ = cleaner.kill();
            let _ = cleaner.wait();
        }
    }
}
