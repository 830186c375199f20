//! Resources of a run, which are checked before anything is created and reserved before anything moves.
//!
//! The first access to unavailable shared memory kills the process (`SIGBUS`). The launcher therefore
//! allocates all of it at the start, when a shortage is a named error. It keeps a reserve for restarts of
//! components, because programs outside the run may have used up the remaining memory when a component
//! restarts.

use std::fs::{File, OpenOptions};
use std::os::unix::fs::OpenOptionsExt as _;
use std::path::{Path, PathBuf};

use rustix::fs::{FallocateFlags, fallocate, ftruncate};
use rustix::process::Resource;

use super::{Hosting, LaunchError};
use crate::domain::SHARED_MEMORY;
use crate::os::{
    Room, amount, is_bound_by_process_limit, open_descriptors, process_limit, raise_limit,
    threads_of_this_user,
};
use crate::plan::Plan;
use crate::run_folder::RunFolder;

/// Reserve for iceoryx2's data of the services of a topic and of a component's parameters, bytes.
const SERVICE: u64 = 48 * 1024;
/// Reserve for each component's entries in the domain and its result, bytes.
const COMPONENT: u64 = 64 * 1024;
/// Reserve for restarts of components and for observing tools, bytes.
const SPARE: u64 = 256 * 1024;
/// Number of files of a service, and of a process that joins the domain.
const FILES: u64 = 8;
/// Number of processes in addition to the components': the guard and the cleaner of dead processes.
const PROCESSES: u64 = 2;
/// Threads per component process: three of its own (stepping, watching, holding a word), and three of the
/// launcher (two forward its output, one waits for the word).
const THREADS_PER_COMPONENT: u64 = 6;
/// Descriptors per component in the launcher: its process, the detection of its end, its output, and its
/// start.
const PER_COMPONENT: u64 = 6;
/// Descriptors per service during creation and use.
const PER_SERVICE: u64 = 2;
/// Descriptors for everything else: signals, the control block, locks, cores, a terminal, cleaning up.
const OTHERS: u64 = 40;

/// Resources required by a plan.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Need {
    bytes: u64,
    files: u64,
    descriptors: u64,
    /// Size of the largest file, bytes.
    largest: u64,
    /// Number of processes and threads.
    threads: u64,
}

impl Need {
    fn for_plan(plan: &Plan, hosting: Hosting) -> Self {
        let topics = plan.topics.iter().map(|topic| topic.memory_bytes() as u64);
        let (components, count) = (plan.components.len() as u64, plan.topics.len() as u64);
        let tables =
            plan.components.iter().filter(|component| !component.parameters.is_empty()).count() as u64;
        let services = count + tables;
        let region = crate::region::Region::bytes(plan) as u64;
        let others = region + services * SERVICE + components * COMPONENT + SPARE;
        Self {
            bytes: topics.clone().fold(others, u64::saturating_add),
            files: FILES * (services + components) + 32,
            descriptors: OTHERS + PER_COMPONENT * components + PER_SERVICE * services,
            largest: topics.chain([region, SPARE, 1 << 20]).max().unwrap_or(SPARE),
            threads: match hosting {
                Hosting::Processes => PROCESSES + THREADS_PER_COMPONENT * components,
                Hosting::Threads => components,
                Hosting::Inline => 0,
            },
        }
    }
}

/// Checks the resources of a plan before anything is created.
///
/// # Errors
/// Descriptors, file size, processes or shared memory are insufficient. The error states the requirement, the
/// available amount and advice.
pub(super) fn check(plan: &Plan, hosting: Hosting) -> Result<(), LaunchError> {
    let need = Need::for_plan(plan, hosting);
    let exhausted = |what: &'static str, need: String, found: String, advice: String| {
        Err(LaunchError::Exhausted { what, need, found, advice })
    };
    // If counting fails, there is no descriptor left even for that.
    let wanted = open_descriptors().map_or(u64::MAX, |open| open + need.descriptors);
    if let Some(limit) = raise_limit(Resource::Nofile, wanted.min(1 << 20)).filter(|limit| *limit < wanted) {
        let advice = format!(
            "raise it with `ulimit -n {}`, or `LimitNOFILE=` of the service",
            1024.max(2 * need.descriptors)
        );
        let (need, found) =
            (format!("{} more open files", need.descriptors), format!("the limit is {limit}"));
        return exhausted("too few open files", need, found, advice);
    }
    if let Some(limit) = raise_limit(Resource::Fsize, need.largest).filter(|limit| *limit < need.largest) {
        let found = format!("the limit is {}", amount(limit));
        let advice = "raise it with `ulimit -f unlimited`".to_string();
        return exhausted(
            "the limit on file sizes is too low",
            format!("files of {}", amount(need.largest)),
            found,
            advice,
        );
    }
    if let Some(limit) = process_limit().filter(|_| need.threads > 0 && is_bound_by_process_limit())
        && let Some(has) = threads_of_this_user().filter(|has| has + need.threads > limit)
    {
        return exhausted(
            "too few processes and threads",
            format!("{} more", need.threads),
            format!("this user has {has}, and the limit is {limit}"),
            format!(
                "raise it with `ulimit -u {}`, or `TasksMax=` of the service",
                1024.max(2 * (has + need.threads))
            ),
        );
    }
    let Some(room) = Room::for_path(Path::new(SHARED_MEMORY)) else {
        let advice = "run `motorium doctor` to diagnose it".to_string();
        return exhausted(
            "no shared memory",
            amount(need.bytes),
            format!("there is no {SHARED_MEMORY}"),
            advice,
        );
    };
    let advice = || {
        format!(
            "check what fills it (`ls -lS {SHARED_MEMORY}`), remove the remains of dead runs (`motorium doctor --clean`), or \
             enlarge it (`mount -o remount,size=1G {SHARED_MEMORY}`; `--shm-size` of a container)"
        )
    };
    if room.bytes < need.bytes {
        let found = format!("{} of {} are free in {SHARED_MEMORY}", amount(room.bytes), amount(room.total));
        return exhausted("too little shared memory", amount(need.bytes), found, advice());
    }
    if room.files < need.files {
        let found = format!("{} can be created in {SHARED_MEMORY}", room.files);
        return exhausted("too little shared memory", format!("{} files", need.files), found, advice());
    }
    Ok(())
}

/// Shared memory kept free for restarts.
#[derive(Debug)]
pub(super) struct Spare(Option<File>);

impl Spare {
    /// Creates an empty reserve.
    pub(super) fn none() -> Self {
        Self(None)
    }

    /// Allocates all pages of a run's objects now, plus a reserve.
    ///
    /// # Errors
    /// Shared memory is full.
    pub(super) fn reserve(folder: &RunFolder) -> Result<Self, LaunchError> {
        let refuse = |path: &Path, error: rustix::io::Errno| LaunchError::System {
            what: "reserving shared memory",
            reason: crate::os::with_shortage(format!("{}: {error}", path.display()), folder.path()),
        };
        let domain = folder.domain()?;
        let objects: Vec<PathBuf> = domain.objects().filter(|path| *path != domain.lock_file()).collect();
        for path in objects {
            let Ok(file) = OpenOptions::new().read(true).write(true).open(&path) else { continue };
            let bytes = file.metadata().map_or(0, |metadata| metadata.len());
            if bytes > 0 {
                fallocate(&file, FallocateFlags::empty(), 0, bytes).map_err(|error| refuse(&path, error))?;
            }
        }
        let path = domain.spare_file();
        let file = OpenOptions::new().write(true).create_new(true).mode(0o600).open(&path);
        let file = file.map_err(|error| {
            refuse(&path, rustix::io::Errno::from_io_error(&error).unwrap_or(rustix::io::Errno::IO))
        })?;
        let spare = Self(Some(file));
        spare.take_back().map_err(|error| refuse(&path, error))?;
        Ok(spare)
    }

    /// Releases the reserve for a process that is about to start.
    pub(super) fn release(&self) {
        if let Some(file) = &self.0 {
            let _ = ftruncate(file, 0);
        }
    }

    /// Reserves the same amount again, if available.
    pub(super) fn take_back(&self) -> rustix::io::Result<()> {
        match &self.0 {
            Some(file) => fallocate(file, FallocateFlags::empty(), 0, SPARE),
            None => Ok(()),
        }
    }
}
