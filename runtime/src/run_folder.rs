//! The folder of a run in shared memory: its plan, its control block, its iceoryx2 domain, its results.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering::Relaxed;
use std::time::{SystemTime, UNIX_EPOCH};

use crate::os::Watch;
use crate::plan::Plan;
use crate::region::{Region, RegionError};
use crate::transport::{Domain, DomainError};

/// The folder of one run: `/dev/shm/motorium-<uid>/<run>`. It is in memory, private to the user, and removed when
/// the run ends.
#[derive(Debug, Clone)]
pub struct RunFolder {
    path: PathBuf,
    id: String,
}

/// Error of a run's folder.
#[derive(Debug, thiserror::Error)]
pub enum RunFolderError {
    /// The file system refused.
    #[error("{path}: {source}")]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// The error of the system.
        source: std::io::Error,
    },
    /// The plan is not one this version reads.
    #[error("{path} is not a plan of this version of motorium: {reason}")]
    Plan {
        /// The plan's file.
        path: PathBuf,
        /// The reason.
        reason: String,
    },
    /// The control block is unusable.
    #[error(transparent)]
    Region(#[from] RegionError),
    /// The domain is unusable.
    #[error(transparent)]
    Domain(#[from] DomainError),
}

fn io(path: &Path) -> impl FnOnce(std::io::Error) -> RunFolderError {
    let path = path.to_path_buf();
    move |source| RunFolderError::Io { path, source }
}

/// The folder that holds the runs of this user.
pub fn runs_folder() -> PathBuf {
    PathBuf::from(format!("/dev/shm/motorium-{}", rustix::process::getuid().as_raw()))
}

impl RunFolder {
    /// Makes the folder of a new run of a plan, with the plan and an empty control block in it.
    ///
    /// # Errors
    /// `/dev/shm` is full or forbidden.
    pub fn create(plan: &Plan) -> Result<(Self, Region), RunFolderError> {
        use std::os::unix::fs::DirBuilderExt as _;
        let runs = runs_folder();
        let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        let unique = (now.as_nanos() as u64 ^ u64::from(std::process::id()) << 40) & 0xffff_ffff;
        let name: String = plan.name.chars().take(24).collect();
        let id = format!("{name}-{unique:08x}");
        let path = runs.join(&id);
        fs::DirBuilder::new().recursive(true).mode(0o700).create(&path).map_err(io(&path))?;
        let this = Self { path, id };
        let made = this.fill(plan);
        if made.is_err() {
            this.remove();
        }
        made.map(|region| (this, region))
    }

    fn fill(&self, plan: &Plan) -> Result<Region, RunFolderError> {
        let file = self.path.join("plan.json");
        let text = serde_json::to_vec(plan)
            .map_err(|error| RunFolderError::Plan { path: file.clone(), reason: error.to_string() })?;
        fs::write(&file, text).map_err(io(&file))?;
        let region = Region::create(&self.path.join("region"), plan)?;
        region.header().launcher.store(std::process::id(), Relaxed);
        Ok(region)
    }

    /// The folder of an existing run.
    pub fn open(path: &Path) -> Self {
        let id = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        Self { path: path.to_path_buf(), id }
    }

    /// All runs of this user, newest first, whether alive or left behind by a crash.
    pub fn list() -> Vec<Self> {
        let mut runs: Vec<(SystemTime, Self)> = fs::read_dir(runs_folder())
            .into_iter()
            .flatten()
            .flatten()
            .filter(|entry| entry.path().is_dir())
            .map(|entry| {
                let made = entry.metadata().and_then(|m| m.modified()).unwrap_or(UNIX_EPOCH);
                (made, Self::open(&entry.path()))
            })
            .collect();
        runs.sort_by_key(|(made, _)| std::cmp::Reverse(*made));
        runs.into_iter().map(|(_, run)| run).collect()
    }

    /// The run's name: that of the graph and a number.
    pub fn id(&self) -> &str {
        &self.id
    }

    /// Its path.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The run's plan.
    ///
    /// # Errors
    /// It cannot be read.
    pub fn plan(&self) -> Result<Plan, RunFolderError> {
        let file = self.path.join("plan.json");
        let text = fs::read(&file).map_err(io(&file))?;
        serde_json::from_slice(&text)
            .map_err(|error| RunFolderError::Plan { path: file, reason: error.to_string() })
    }

    /// The run's control block.
    ///
    /// # Errors
    /// It cannot be mapped.
    pub fn region(&self) -> Result<Region, RunFolderError> {
        Ok(Region::open(&self.path.join("region"))?)
    }

    /// The run's iceoryx2 domain.
    ///
    /// # Errors
    /// The run's name cannot name a domain.
    pub fn domain(&self) -> Result<Domain, RunFolderError> {
        Ok(Domain::new(&self.path, &self.id)?)
    }

    /// Whether the process id of its launcher is set.
    pub fn names_launcher(&self) -> bool {
        self.region().is_ok_and(|region| region.header().launcher.load(Relaxed) != 0)
    }

    /// Whether its launcher or its guard is alive.
    pub fn is_alive(&self) -> bool {
        let Ok(region) = self.region() else { return false };
        let alive = |pid: u32| pid != 0 && Watch::new(pid).is_ok_and(|watch| !watch.has_ended());
        alive(region.header().launcher.load(Relaxed)) || alive(region.header().guard.load(Relaxed))
    }

    /// Saves a component's result for the launcher.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn save_result(&self, component: &str, result: &serde_json::Value) -> Result<(), RunFolderError> {
        let file = self.result_file(component);
        fs::write(&file, result.to_string()).map_err(io(&file))
    }

    /// The result that a component saved.
    pub fn result(&self, component: &str) -> Option<serde_json::Value> {
        serde_json::from_slice(&fs::read(self.result_file(component)).ok()?).ok()
    }

    fn result_file(&self, component: &str) -> PathBuf {
        self.path.join(format!("result-{component}.json"))
    }

    /// Removes the run from shared memory: the domain's objects, the control block, the folder. Returns the removed
    /// objects of the domain. Only for a run without processes.
    pub fn remove(&self) -> Vec<PathBuf> {
        let removed = self.domain().map(|domain| domain.remove()).unwrap_or_default();
        let _ = fs::remove_dir_all(&self.path);
        // Succeeds only when this was the last run.
        let _ = fs::remove_dir(runs_folder());
        removed
    }
}
