//! Leftovers of ended runs in shared memory.

use std::collections::BTreeSet;
use std::fs;
use std::os::unix::fs::MetadataExt as _;
use std::path::{Path, PathBuf};
use std::time::Duration;

use motorium::os::is_held;
use motorium::run_folder::{RunFolder, RunFolderError};

use super::finding::Finding;

/// Name prefix of all shared memory objects of runs.
const OURS: &str = "mt_";
/// Name prefix of objects of other programs that use iceoryx2.
const FOREIGN: &str = "iox2_";

/// Age below which an object may belong to a run that is starting.
const YOUNG: Duration = Duration::from_secs(5);

/// Objects left in shared memory.
#[derive(Debug, Default)]
pub(super) struct Leftovers {
    runs: Vec<RunFolder>,
    /// Shared memory objects that belong to no existing run.
    objects: Vec<PathBuf>,
    /// Objects of other programs, which may still use them.
    foreign: Vec<PathBuf>,
}

impl Leftovers {
    /// Finds objects that ended runs of this user left in shared memory.
    pub(super) fn find(shared: &Path) -> Self {
        // Objects first: an object created later cannot be mistaken for a leftover.
        let user = rustix::process::getuid().as_raw();
        let ours = objects(shared, OURS, Some(user));
        let foreign = objects(shared, FOREIGN, None);
        let all = RunFolder::list();
        // The folder of a run may be invisible in this container; the lock of its objects then decides.
        let elsewhere = held(&ours);
        let known: Vec<String> =
            all.iter().map(|run| format!("{OURS}{}_", run.id())).chain(elsewhere).collect();
        let objects = orphans(ours, &known).into_iter().filter(|path| is_old(path)).collect();
        let runs = all.into_iter().filter(RunFolder::is_abandoned).collect();
        Self { runs, objects, foreign }
    }

    /// Removes objects left by ended runs of this user and returns their names. Objects of other programs
    /// stay.
    pub(super) fn clean(&mut self) -> Vec<PathBuf> {
        let mut removed = Vec::new();
        for run in self.runs.drain(..) {
            // The report may be old by now: never remove an object of a living run.
            if !run.is_alive() {
                removed.extend(run.remove());
                removed.push(run.path().to_path_buf());
            }
        }
        removed.extend(self.objects.drain(..).filter(|path| fs::remove_file(path).is_ok()));
        removed
    }

    pub(super) fn findings(&self, removed: &[PathBuf]) -> Vec<Finding> {
        vec![
            check_place(RunFolder::parent_folder()),
            check_own(&self.runs, &self.objects, removed),
            check_foreign(&self.foreign),
        ]
    }
}

/// Files with this name prefix, of this user or of all users.
fn objects(shared: &Path, prefix: &str, user: Option<u32>) -> Vec<PathBuf> {
    let mut found: Vec<PathBuf> = fs::read_dir(shared)
        .into_iter()
        .flatten()
        .flatten()
        .filter(|entry| entry.file_name().to_string_lossy().starts_with(prefix))
        .filter(|entry| {
            entry
                .metadata()
                .is_ok_and(|metadata| metadata.is_file() && user.is_none_or(|user| metadata.uid() == user))
        })
        .map(|entry| entry.path())
        .collect();
    found.sort();
    found
}

/// Returns the name prefixes of the objects of runs whose lock is held.
fn held(objects: &[PathBuf]) -> Vec<String> {
    let locks = objects.iter().filter(|path| is_held(path));
    locks
        .filter_map(|path| Some(path.file_name()?.to_str()?.strip_suffix("lock")?.to_string()))
        .filter(|prefix| prefix.ends_with('_'))
        .collect()
}

/// Returns `true` if a file is too old to belong to a run that is starting.
fn is_old(path: &Path) -> bool {
    let made = fs::metadata(path).and_then(|metadata| metadata.modified());
    made.is_ok_and(|made| made.elapsed().is_ok_and(|age| age > YOUNG))
}

/// Returns the objects without any of the known name prefixes.
fn orphans(objects: Vec<PathBuf>, known: &[String]) -> Vec<PathBuf> {
    let is_known = |path: &Path| {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        known.iter().any(|prefix| name.starts_with(prefix))
    };
    objects.into_iter().filter(|path| !is_known(path)).collect()
}

fn check_place(place: Result<PathBuf, RunFolderError>) -> Finding {
    let name = "runs";
    match place {
        Ok(place) => Finding::pass(name, format!("in {}, private to this user", place.display())),
        Err(RunFolderError::NotPrivate { path, found, advice }) => {
            Finding::fail(name, format!("{} is {found}: nothing can run", path.display()), advice)
        }
        Err(error) => Finding::fail(name, error.to_string(), "check the owner of that folder"),
    }
}

fn check_own(runs: &[RunFolder], objects: &[PathBuf], removed: &[PathBuf]) -> Finding {
    let name = "leftovers";
    let gone = match removed.len() {
        0 => String::new(),
        count => format!("; {count} files and folders removed"),
    };
    if runs.is_empty() && objects.is_empty() {
        return Finding::pass(name, format!("none of ended runs{gone}"));
    }
    let mut parts: Vec<String> = runs.iter().map(|run| format!("run {}", run.id())).collect();
    if !objects.is_empty() {
        let first = objects[0].display();
        parts.push(format!("{} objects that belong to no run ({first} ...)", objects.len()));
    }
    Finding::warn(name, format!("left by ended runs: {}{gone}", parts.join(", ")), "motorium doctor --clean")
}

fn check_foreign(foreign: &[PathBuf]) -> Finding {
    let name = "other iceoryx2";
    let Some(first) = foreign.first() else {
        return Finding::pass(name, "no shared memory of other programs");
    };
    let owners: BTreeSet<u32> =
        foreign.iter().filter_map(|path| fs::metadata(path).ok()).map(|metadata| metadata.uid()).collect();
    let owners: Vec<String> = owners.iter().map(u32::to_string).collect();
    let found = format!(
        "{} objects of other programs that use iceoryx2 ({} ...), of user {}; they may still be in use",
        foreign.len(),
        first.display(),
        owners.join(", ")
    );
    Finding::warn(name, found, "if no such program runs any more: rm /dev/shm/iox2_* && rm -r /tmp/iceoryx2")
}

#[cfg(test)]
mod tests {
    use super::super::finding::Verdict;
    use super::*;

    #[test]
    fn objects_of_runs_that_exist_are_not_orphans() {
        let folder = tempfile::tempdir().unwrap();
        let make = |name: &&str| fs::write(folder.path().join(name), "x").unwrap();
        ["mt_reach-1_data", "mt_reach-12_data", "mt_reach-2_dynamic", "iox2_topic", "mine"]
            .iter()
            .for_each(make);
        fs::create_dir(folder.path().join("mt_folder")).unwrap();
        let user = rustix::process::getuid().as_raw();
        let ours = objects(folder.path(), OURS, Some(user));
        assert_eq!(ours.len(), 3, "files of this user with the prefix: {ours:?}");
        assert!(objects(folder.path(), OURS, Some(user + 1)).is_empty(), "nothing of other users");
        let left = orphans(ours, &["mt_reach-1_".to_string()]);
        let names: Vec<_> = left.iter().map(|path| path.file_name().unwrap().to_str().unwrap()).collect();
        assert_eq!(names, ["mt_reach-12_data", "mt_reach-2_dynamic"]);
        assert_eq!(objects(folder.path(), FOREIGN, None).len(), 1);
    }

    #[test]
    fn clean_removes_orphans_and_keeps_objects_of_others() {
        let folder = tempfile::tempdir().unwrap();
        let orphan = folder.path().join("mt_gone-1_data");
        let foreign = folder.path().join("iox2_data");
        for path in [&orphan, &foreign] {
            fs::write(path, "x").unwrap();
        }
        let mut left =
            Leftovers { runs: Vec::new(), objects: vec![orphan.clone()], foreign: vec![foreign.clone()] };
        assert_eq!(left.findings(&[])[1].verdict, Verdict::Warn);
        assert_eq!(left.clean(), std::slice::from_ref(&orphan));
        assert!(!orphan.exists() && foreign.exists());
        let after = left.findings(&[orphan]);
        assert_eq!(after[1].verdict, Verdict::Pass);
        assert!(after[1].found.contains("1 files and folders removed"), "{}", after[1].found);
        assert!(after[2].found.contains("iox2_data"), "{}", after[2].found);
    }

    #[test]
    fn held_objects_are_known_without_their_run_folder() {
        let folder = tempfile::tempdir().unwrap();
        let lock = folder.path().join("mt_reach-1_lock");
        let held_by_us = motorium::os::Lock::hold(&lock).unwrap();
        fs::write(folder.path().join("mt_reach-2_lock"), "").unwrap();
        let objects = objects(folder.path(), OURS, None);
        assert_eq!(held(&objects), ["mt_reach-1_"]);
        drop(held_by_us);
        assert!(held(&objects).is_empty());
    }

    #[test]
    fn accessible_run_folder_fails_the_doctor() {
        let open = RunFolderError::NotPrivate {
            path: "/dev/shm/motorium-7".into(),
            found: "open to other users (mode 777)".into(),
            advice: "chmod 700".into(),
        };
        let finding = check_place(Err(open));
        assert_eq!((finding.verdict, finding.fix.as_deref()), (Verdict::Fail, Some("chmod 700")));
        assert!(finding.found.contains("/dev/shm/motorium-7 is open to other users"), "{}", finding.found);
        assert_eq!(check_place(Ok("/dev/shm/motorium-7".into())).verdict, Verdict::Pass);
    }

    #[test]
    fn recent_object_is_not_a_leftover() {
        let folder = tempfile::tempdir().unwrap();
        assert!(!is_old(folder.path()));
        assert!(!is_old(Path::new("/nowhere")));
    }
}
