//! The folder of a run in shared memory: its plan, its control block, its iceoryx2 domain, its results.

mod error;
mod place;

pub use error::RunFolderError;

use std::fs;
use std::io::Write as _;
use std::os::unix::fs::{DirBuilderExt as _, OpenOptionsExt as _};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use crate::domain::Domain;
use crate::os::{Lock, is_held, random_bytes};
use crate::plan::Plan;
use crate::region::Region;
use error::io;

/// Age below which a folder without a lock holder may still be under construction.
const YOUNG: Duration = Duration::from_secs(5);

/// The folder of one run: `$XDG_RUNTIME_DIR/motorium/RUN` if that variable is set, otherwise
/// `/dev/shm/motorium-UID/RUN`. It is stored in memory, private to the user, and removed when the run ends.
///
/// The launcher and its guard hold a [lock](Lock) on the folder, which the system releases when they end.
/// From any process namespace, the lock shows whether the run is alive.
#[derive(Debug, Clone)]
pub struct RunFolder {
    path: PathBuf,
    id: String,
    /// Locks on the folder and on the shared memory objects, for holders of the run.
    locks: Option<Arc<[Lock; 2]>>,
}

/// Writes a file that only its owner can read.
fn write_private(path: &Path, content: &[u8]) -> std::io::Result<()> {
    let mut file = fs::OpenOptions::new().write(true).create(true).truncate(true).mode(0o600).open(path)?;
    file.write_all(content)
}

/// Returns a random name of ten unambiguous letters and digits, which is 50 random bits.
fn unguessable() -> std::io::Result<String> {
    const LETTERS: &[u8; 32] = b"0123456789abcdefghjkmnpqrstvwxyz";
    Ok(random_bytes::<10>()?.iter().map(|byte| char::from(LETTERS[usize::from(byte % 32)])).collect())
}

impl RunFolder {
    /// Creates the folder of a new run, with its plan and an empty control block, and locks the folder.
    ///
    /// # Errors
    /// Shared memory is full or inaccessible, or the folder of this user's runs is not private.
    pub fn create(plan: &Plan) -> Result<(Self, Region), RunFolderError> {
        let name: String = plan.name.chars().take(24).collect();
        let id = format!("{name}-{}", unguessable().map_err(io(Path::new("the random source")))?);
        let make = |runs: PathBuf| {
            let path = runs.join(&id);
            fs::DirBuilder::new().mode(0o700).create(&path).map(|()| path)
        };
        let runs = place::make()?;
        let mut this = Self { path: runs.join(&id), id: id.clone(), locks: None };
        let made = this.domain().and_then(|domain| Ok(domain.prepare()?)).and_then(|()| {
            // From here on the run is visible, and other programs may join its domain.
            this.path = match make(runs.clone()) {
                // The last other run has just ended and removed the folder.
                Err(error) if error.kind() == std::io::ErrorKind::NotFound => make(place::make()?),
                made => made,
            }
            .map_err(io(&runs))?;
            this.hold()?;
            this.fill(plan)
        });
        if made.is_err() {
            this.remove();
        }
        made.map(|region| (this, region))
    }

    fn fill(&self, plan: &Plan) -> Result<Region, RunFolderError> {
        let file = self.path.join("plan.json");
        let text = serde_json::to_vec(plan)
            .map_err(|error| RunFolderError::Plan { path: file.clone(), reason: error.to_string() })?;
        write_private(&file, &text).map_err(io(&file))?;
        let region = Region::create(&self.path.join("region"), plan)?;
        region.header().launcher.store(std::process::id(), Relaxed);
        Ok(region)
    }

    /// Locks the run: while this value or a clone of it exists, the run is alive.
    ///
    /// # Errors
    /// The folder has been removed, or no descriptor is available.
    pub fn hold(&mut self) -> Result<(), RunFolderError> {
        let (folder, objects) = self.lock_files()?;
        let hold = |path: &Path| Lock::hold(path).map_err(io(path));
        self.locks = Some(Arc::new([hold(&folder)?, hold(&objects)?]));
        Ok(())
    }

    /// Returns the files whose locks indicate that the folder and the domain's objects are in use. There are
    /// two, because a container may share only one of the locations with its host.
    fn lock_files(&self) -> Result<(PathBuf, PathBuf), RunFolderError> {
        Ok((self.path.join("lock"), self.domain()?.lock_file()))
    }

    /// Creates a value for the folder of an existing run, without accessing it.
    pub fn open(path: &Path) -> Self {
        let id = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        Self { path: path.to_path_buf(), id, locks: None }
    }

    /// Returns the folder that contains the folders of this user's new runs. If the folder exists, checks
    /// that it is private.
    ///
    /// # Errors
    /// The folder is not private to this user.
    pub fn parent_folder() -> Result<PathBuf, RunFolderError> {
        let place = place::all().swap_remove(0);
        match place::check(&place) {
            Err(RunFolderError::Io { source, .. }) if source.kind() == std::io::ErrorKind::NotFound => {
                Ok(place)
            }
            checked => checked.map(|()| place),
        }
    }

    /// Finds a run of this user by its id.
    pub fn find(id: &str) -> Option<Self> {
        Self::list().into_iter().find(|run| run.id == id)
    }

    /// Returns all runs of this user, newest first. Includes runs that are alive and runs that a crash left
    /// behind.
    pub fn list() -> Vec<Self> {
        // A location that other users could have written to contains no run of this user.
        let places = place::all().into_iter().filter(|path| place::check(path).is_ok());
        let mut runs: Vec<(SystemTime, Self)> = places
            .filter_map(|place| fs::read_dir(place).ok())
            .flatten()
            .flatten()
            .filter(|entry| entry.file_type().is_ok_and(|kind| kind.is_dir()))
            .map(|entry| {
                let made = entry.metadata().and_then(|m| m.modified()).unwrap_or(UNIX_EPOCH);
                (made, Self::open(&entry.path()))
            })
            .collect();
        runs.sort_by_key(|(made, _)| std::cmp::Reverse(*made));
        runs.into_iter().map(|(_, run)| run).collect()
    }

    /// Returns the id of the run: the graph's name and a random suffix.
    pub fn id(&self) -> &str {
        &self.id
    }

    /// Returns the path of the folder.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Reads the run's plan.
    ///
    /// # Errors
    /// The plan cannot be read.
    pub fn plan(&self) -> Result<Plan, RunFolderError> {
        let file = self.path.join("plan.json");
        let text = fs::read(&file).map_err(io(&file))?;
        serde_json::from_slice(&text)
            .map_err(|error| RunFolderError::Plan { path: file, reason: error.to_string() })
    }

    /// Maps the run's control block.
    ///
    /// # Errors
    /// The control block cannot be mapped.
    pub fn region(&self) -> Result<Region, RunFolderError> {
        Ok(Region::open(&self.path.join("region"))?)
    }

    /// Returns the run's iceoryx2 domain.
    ///
    /// # Errors
    /// The run's name is not a valid name of a domain.
    pub fn domain(&self) -> Result<Domain, RunFolderError> {
        Ok(Domain::new(&self.path, &self.id)?)
    }

    /// Returns `true` if the launcher or the guard of the run is alive, in any process namespace.
    pub fn is_alive(&self) -> bool {
        self.lock_files().is_ok_and(|(folder, objects)| is_held(&folder) || is_held(&objects))
    }

    /// Returns `true` if the run was abandoned: it is not locked and not under construction.
    pub fn is_abandoned(&self) -> bool {
        let made = fs::metadata(&self.path).and_then(|metadata| metadata.modified());
        let is_old = made.is_ok_and(|made| made.elapsed().is_ok_and(|age| age > YOUNG));
        // The locks are acquired before the region is created.
        (is_old || self.path.join("region").exists()) && !self.is_alive()
    }

    /// Saves the result of a component, which the launcher adds to the report.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn save_result(&self, component: &str, result: &serde_json::Value) -> Result<(), RunFolderError> {
        let file = self.result_file(component);
        write_private(&file, result.to_string().as_bytes()).map_err(io(&file))
    }

    /// Returns the saved result of a component, or `None` if the component saved no result.
    pub fn result(&self, component: &str) -> Option<serde_json::Value> {
        serde_json::from_slice(&fs::read(self.result_file(component)).ok()?).ok()
    }

    fn result_file(&self, component: &str) -> PathBuf {
        self.path.join(format!("result-{component}.json"))
    }

    /// Removes the objects of the domain, the control block and the folder from shared memory. Returns the
    /// removed objects of the domain. Only call this function for runs without processes.
    pub fn remove(&self) -> Vec<PathBuf> {
        let removed = self.domain().map(|domain| domain.remove()).unwrap_or_default();
        let _ = fs::remove_dir_all(&self.path);
        // Succeeds only when this was the last run.
        let _ = self.path.parent().map(fs::remove_dir);
        removed
    }
}
