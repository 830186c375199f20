//! `motorium robot install`: unpacks collections of robots into the user's data folder.

use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

use anyhow::Context as _;
use motorium_robots::{installed, installed_folder};

use crate::out::outln;
use crate::style;

/// Install a collection of robots into the user's data folder, where commands and graphs find them by name.
///
/// `example-robot-data` is the collection that Pinocchio's examples use: about seventy robot files. Most have
/// BSD or Apache licences; the README of each robot names its licence. pip downloads it from PyPI; nothing is
/// executed.
///
/// Example: motorium robot install example-robot-data
#[derive(Debug, clap::Args)]
pub(super) struct Install {
    /// The collection
    #[arg(value_enum)]
    collection: Collection,
    /// Version of the collection
    #[arg(long, default_value = "6.0.0")]
    version: String,
    /// The Python interpreter whose pip is used
    #[arg(long, default_value = "python3")]
    python: PathBuf,
    /// Target folder [default: `$MOTORIUM_ROBOTS`, or `motorium/robots` in the user's data folder]
    #[arg(long, value_name = "FOLDER")]
    into: Option<PathBuf>,
}

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum Collection {
    /// The PyPI package of that name
    ExampleRobotData,
}

impl Collection {
    /// Returns the name of the package, and of its folder.
    fn name(self) -> &'static str {
        match self {
            Self::ExampleRobotData => "example-robot-data",
        }
    }

    /// Returns the folder of its robots in the unpacked package.
    fn inside(self) -> &'static str {
        match self {
            Self::ExampleRobotData => "cmeel.prefix/share/example-robot-data",
        }
    }
}

impl Install {
    pub(super) fn run(self) -> anyhow::Result<ExitCode> {
        let usual = installed_folder();
        let folder = self.into.clone().or_else(|| usual.clone());
        let folder =
            folder.context("neither HOME nor MOTORIUM_ROBOTS is set; name a folder with --into FOLDER")?;
        std::fs::create_dir_all(&folder).with_context(|| format!("making {}", folder.display()))?;
        // Next to its destination, so that it can be moved atomically; the leading dot hides it until it is
        // complete.
        let unpacked = folder.join(format!(".unpacking-{}", std::process::id()));
        let result = self.unpack(&unpacked, &folder);
        let _ = std::fs::remove_dir_all(&unpacked);
        let place = result?;
        outln!("{} {}", style::good("installed:"), place.display());
        if self.into.is_none() || self.into == usual {
            let name = self.collection.name();
            let count = installed().iter().filter(|robot| robot.collection == name).count();
            outln!("{count} robots; `motorium robot list` names them");
        } else {
            outln!("set MOTORIUM_ROBOTS={} to find its robots by name", folder.display());
        }
        Ok(ExitCode::SUCCESS)
    }

    /// Unpacks into `unpacked`, then moves the robots to their destination in `folder`.
    fn unpack(&self, unpacked: &Path, folder: &Path) -> anyhow::Result<PathBuf> {
        let name = self.collection.name();
        let python = self.python.display();
        let pip = |arguments: &[&str]| {
            let mut command = Command::new(&self.python);
            command.args(["-m", "pip"]).args(arguments);
            command
        };
        let there = pip(&["--version"]).output();
        anyhow::ensure!(
            there.is_ok_and(|output| output.status.success()),
            "`{python} -m pip` does not work, but pip is required to download the robots; install it (Debian: apt install python3-pip), name \
             another Python with --python, or unpack the wheel from https://pypi.org/project/{name}/ into {}",
            folder.join(name).display()
        );
        let package = format!("{name}=={}", self.version);
        let mut install =
            pip(&["install", "--quiet", "--disable-pip-version-check", "--no-deps", "--no-compile"]);
        install.args(["--only-binary", ":all:", "--target"]).arg(unpacked).arg(&package);
        let output = install.output().with_context(|| format!("starting {python} -m pip"))?;
        let complaint = String::from_utf8_lossy(&output.stderr);
        anyhow::ensure!(output.status.success(), "pip could not download {package}:\n{}", complaint.trim());
        let robots = unpacked.join(self.collection.inside());
        anyhow::ensure!(
            robots.is_dir(),
            "{package} has no folder {}; its layout changed, try --version 6.0.0",
            self.collection.inside()
        );
        let place = folder.join(name);
        if place.exists() {
            std::fs::remove_dir_all(&place)
                .with_context(|| format!("removing the old {}", place.display()))?;
        }
        std::fs::rename(&robots, &place)
            .with_context(|| format!("moving the robots to {}", place.display()))?;
        Ok(place)
    }
}
