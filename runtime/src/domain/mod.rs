//! The iceoryx2 domain of a run, which is stored in the run's folder: its nodes, services and mechanisms.

#![allow(unsafe_code)] // creates iceoryx2's node counter, which iceoryx2 would make accessible to all users

mod pool_allocated;
mod service;
mod variant;

use std::path::{Path, PathBuf};

use iceoryx2::config::Config;
use iceoryx2::node::{Node, NodeBuilder, NodeState};
use iceoryx2::prelude::{CallbackProgression, FileName, Path as IoxPath, SemanticString, SignalHandlingMode};
use iceoryx2::service::Service;
use iceoryx2_bb_elementary::package_version::PackageVersion;
use iceoryx2_cal::dynamic_storage::{DynamicStorage, DynamicStorageBuilder as _};
use iceoryx2_cal::named_concept::{
    NamedConceptBuilder as _, NamedConceptConfiguration as _, NamedConceptMgmt,
};

use crate::os::with_shortage;

pub use service::ServiceError;
pub(crate) use service::{refused, service_name};
pub use variant::Shared;

/// Folder of all shared memory objects.
pub const SHARED_MEMORY: &str = "/dev/shm";

/// Type of iceoryx2's node counter, from which it derives the name of the object.
const COUNTER_TYPE: &str = "iceoryx2::node::global_management_segment::State";

/// The iceoryx2 domain of one run. Processes in different domains do not see one another.
#[derive(Debug, Clone)]
pub struct Domain {
    config: Config,
    root: PathBuf,
    prefix: String,
}

/// Error of creating a domain or a node in it.
#[derive(Debug, thiserror::Error)]
pub enum DomainError {
    /// The path of the folder cannot be used for a domain.
    #[error(
        "`{0}` is not a valid folder for shared memory, expected a shorter path without special characters"
    )]
    Path(PathBuf),
    /// iceoryx2 could not create a node.
    #[error(
        "creating an iceoryx2 node in {root} failed: {reason}; `motorium doctor` checks shared memory and permissions"
    )]
    Node {
        /// Folder of the domain.
        root: PathBuf,
        /// Error message of iceoryx2.
        reason: String,
    },
}

impl Domain {
    /// Creates the domain of a run. Its files are in `folder/iox2`, and the names of its shared memory
    /// objects begin with `mt_<run>_`.
    ///
    /// # Errors
    /// The path or the run's name contains characters that iceoryx2 does not accept.
    pub fn new(folder: &Path, run: &str) -> Result<Self, DomainError> {
        let root = folder.join("iox2");
        let prefix = format!("mt_{run}_");
        let refuse = || DomainError::Path(root.clone());
        let mut config = Config::default();
        let path = IoxPath::new(root.as_os_str().as_encoded_bytes()).map_err(|_| refuse())?;
        config.global.set_root_path(&path);
        config.global.prefix = FileName::new(prefix.as_bytes()).map_err(|_| refuse())?;
        // Only the launcher cleans up dead nodes, never a starting component.
        config.global.service.cleanup_dead_nodes_on_open = false;
        config.global.node.cleanup_dead_nodes_on_creation = false;
        config.global.node.cleanup_dead_nodes_on_destruction = false;
        Ok(Self { config, root, prefix })
    }

    /// Creates the node counter, accessible to its owner only. iceoryx2 opens an existing counter. Otherwise
    /// it would create one that every user of the machine can write, and any user could then block all
    /// processes from joining.
    ///
    /// # Errors
    /// Shared memory is full or access is denied.
    pub(crate) fn prepare(&self) -> Result<(), DomainError> {
        type Counter = <Shared as Service>::PersistentDynamicStorage<u32>;
        let refuse =
            |reason| DomainError::Node { root: self.root.clone(), reason: with_shortage(reason, &self.root) };
        let global = &self.config.global;
        let version = PackageVersion::get();
        let suffix = format!(
            ".{}_{}_{}{}",
            version.major(),
            version.minor(),
            version.patch(),
            global.node.global_mgmt_suffix
        );
        let file = |text: &str| FileName::new(text.as_bytes()).map_err(|error| refuse(format!("{error:?}")));
        let mut config = <Counter as NamedConceptMgmt>::Configuration::default()
            .prefix(&global.prefix)
            .suffix(&file(&suffix)?)
            .path_hint(global.root_path());
        // SAFETY: iceoryx2's own type is a structure of one 32-bit counter, laid out as this number.
        unsafe { Counter::__internal_set_type_name_in_config(&mut config, COUNTER_TYPE) };
        <Counter as DynamicStorage<u32>>::Builder::new(&file("node")?)
            .config(&config)
            .has_ownership(false)
            .initializer(|counter, _| {
                counter.write(0);
                true
            })
            .create()
            .map(drop)
            .map_err(|error| refuse(format!("{error:?}")))
    }

    /// Creates a node of this process in the domain. The node installs no signal handlers.
    ///
    /// # Errors
    /// Shared memory is full or inaccessible, or the folder no longer exists.
    pub fn node(&self) -> Result<Node<Shared>, DomainError> {
        // iceoryx2 would recreate the folder of a finished run.
        if self.root.parent().is_some_and(|folder| !folder.exists()) {
            let reason = "the run has ended".to_string();
            return Err(DomainError::Node { root: self.root.clone(), reason });
        }
        NodeBuilder::new()
            .config(&self.config)
            .signal_handling_mode(SignalHandlingMode::Disabled)
            .create::<Shared>()
            .map_err(|error| DomainError::Node {
                root: self.root.clone(),
                reason: with_shortage(error.to_string(), &self.root),
            })
    }

    /// Returns `true` if dead processes still occupy slots in topics and parameters. This only inspects files
    /// and their locks. It does not access iceoryx2's data in shared memory.
    pub fn has_dead(&self) -> bool {
        let mut found = false;
        // Failures are retried at the next listing.
        let _ = Node::<Shared>::list(&self.config, |state| {
            found |= matches!(state, NodeState::Dead(_));
            if found { CallbackProgression::Stop } else { CallbackProgression::Continue }
        });
        found
    }

    /// Frees the slots of topics and parameters that dead processes occupy. This traverses shared memory
    /// written by other processes, so damaged memory may crash this process.
    pub fn clean(&self) {
        let _ = Node::<Shared>::list(&self.config, |state| {
            if let NodeState::Dead(dead) = state {
                // Failures are retried later.
                let _ = dead.try_remove_stale_resources();
            }
            CallbackProgression::Continue
        });
    }

    /// Returns the path of the object that reserves shared memory for restarts.
    pub(crate) fn spare_file(&self) -> PathBuf {
        Path::new(SHARED_MEMORY).join(format!("{}spare", self.prefix))
    }

    /// Removes all remains of a domain that is no longer used. Returns the paths of the removed files.
    pub fn remove(&self) -> Vec<PathBuf> {
        let mut removed = Vec::new();
        // The lock is removed last, because objects without a lock count as unused.
        for path in self.objects().filter(|path| *path != self.lock_file()).chain([self.lock_file()]) {
            if std::fs::remove_file(&path).is_ok() {
                removed.push(path);
            }
        }
        if std::fs::remove_dir_all(&self.root).is_ok() {
            removed.push(self.root.clone());
        }
        removed
    }

    /// Returns the shared memory objects of the domain.
    pub fn objects(&self) -> impl Iterator<Item = PathBuf> + '_ {
        let entries = std::fs::read_dir(SHARED_MEMORY).into_iter().flatten().flatten();
        let ours = |name: &std::ffi::OsStr| name.to_string_lossy().starts_with(&self.prefix);
        entries.filter(move |entry| ours(&entry.file_name())).map(|entry| entry.path())
    }

    /// Returns the file that processes lock while they use the domain's shared memory objects.
    pub fn lock_file(&self) -> PathBuf {
        Path::new(SHARED_MEMORY).join(format!("{}lock", self.prefix))
    }

    /// Returns the prefix of the names of the domain's shared memory objects.
    pub fn prefix(&self) -> &str {
        &self.prefix
    }

    /// Returns the configuration for iceoryx2.
    pub fn config(&self) -> &Config {
        &self.config
    }
}

/// Limits iceoryx2's log to messages that are relevant to users. This does not hide errors, which are
/// returned as values.
pub fn quieten() {
    iceoryx2::prelude::set_log_level(iceoryx2::prelude::LogLevel::Fatal);
}
