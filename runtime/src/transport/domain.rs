//! One iceoryx2 domain per run, in the run's own folder.

use std::path::{Path, PathBuf};

use iceoryx2::config::Config;
use iceoryx2::node::{Node, NodeBuilder};
use iceoryx2::prelude::{FileName, Path as IoxPath, SemanticString, SignalHandlingMode};

use super::Shared;

/// The domain of one run. Two domains never see each other.
#[derive(Debug, Clone)]
pub struct Domain {
    config: Config,
    root: PathBuf,
    prefix: String,
}

/// A domain or a node in it could not be made.
#[derive(Debug, thiserror::Error)]
pub enum DomainError {
    /// The folder's path cannot name a domain.
    #[error("`{0}` cannot hold shared memory: use a shorter path of plain characters")]
    Path(PathBuf),
    /// iceoryx2 refused to make a node.
    #[error("no iceoryx2 node in {root}: {reason}; `motorium doctor` checks shared memory and permissions")]
    Node {
        /// The domain's folder.
        root: PathBuf,
        /// The error of iceoryx2.
        reason: String,
    },
}

impl Domain {
    /// The domain of a run: its files live in `folder/iox2`, its shared memory objects begin with `mt_<run>_`.
    ///
    /// # Errors
    /// The path or the run's name has characters that iceoryx2 does not take.
    pub fn new(folder: &Path, run: &str) -> Result<Self, DomainError> {
        let root = folder.join("iox2");
        let prefix = format!("mt_{run}_");
        let refuse = || DomainError::Path(root.clone());
        let mut config = Config::default();
        let path = IoxPath::new(root.as_os_str().as_encoded_bytes()).map_err(|_| refuse())?;
        config.global.set_root_path(&path);
        config.global.prefix = FileName::new(prefix.as_bytes()).map_err(|_| refuse())?;
        // Dead nodes are cleaned by the launcher alone, never by a component on its way up.
        config.global.service.cleanup_dead_nodes_on_open = false;
        config.global.node.cleanup_dead_nodes_on_creation = false;
        config.global.node.cleanup_dead_nodes_on_destruction = false;
        Ok(Self { config, root, prefix })
    }

    /// A node of this process in the domain. Signals stay the program's own business.
    ///
    /// # Errors
    /// Shared memory is full, forbidden, or the folder is gone.
    pub fn node(&self) -> Result<Node<Shared>, DomainError> {
        NodeBuilder::new()
            .config(&self.config)
            .signal_handling_mode(SignalHandlingMode::Disabled)
            .create::<Shared>()
            .map_err(|error| DomainError::Node { root: self.root.clone(), reason: error.to_string() })
    }

    /// Removes all that is left of the domain, once nobody uses it any more. Returns what was removed.
    pub fn remove(&self) -> Vec<PathBuf> {
        let mut removed = Vec::new();
        for entry in std::fs::read_dir("/dev/shm").into_iter().flatten().flatten() {
            if entry.file_name().to_string_lossy().starts_with(&self.prefix)
                && std::fs::remove_file(entry.path()).is_ok()
            {
                removed.push(entry.path());
            }
        }
        if std::fs::remove_dir_all(&self.root).is_ok() {
            removed.push(self.root.clone());
        }
        removed
    }

    /// Prefix of the names of the domain's shared memory objects.
    pub fn prefix(&self) -> &str {
        &self.prefix
    }

    /// The configuration for iceoryx2.
    pub fn config(&self) -> &Config {
        &self.config
    }
}
