//! Loading of robots by their name in a graph file, or by path.

use std::io;
use std::path::{Path, PathBuf};

use crate::file::read_bounded;
use crate::formats::format::{FileFormat, is_mjcf};
use crate::loading::installed::{find, installed};
use crate::loading::mesh_references::MeshReferences;
use crate::nearest::{nearest, suggestion};
use crate::{
    BaseKind, BaseMode, Entry, LoadOptions, MimicMode, MjcfError, MjcfRobot, Model, ModelWarning,
    PackagePath, Position, Posture, Profile, ProfileChoice, ProfileError, Srdf, UrdfError, UrdfRobot,
    catalogue, parse_mjcf, parse_urdf_with,
};

/// Maximum size of a robot or profile file, bytes. A robot with a hundred joints needs a tenth of a megabyte.
const LONGEST: u64 = 16 * 1024 * 1024;

/// The unit of angles in profiles and graphs.
pub(crate) const RADIANS: &str = "angles are in radians";

/// A loaded robot: its model, profile and files.
#[derive(Clone, Debug)]
pub struct Loaded {
    /// Model of the robot.
    pub model: Model,
    /// Warnings about defects of the robot's file, to be shown to the user.
    pub warnings: Vec<ModelWarning>,
    /// Profile of the robot: from the catalogue, or from the `.toml` file with the same name and in the same
    /// folder as the robot file. `None` if the robot has no profile.
    pub profile: Option<Profile>,
    /// Named poses of the SRDF, which is in the folder of the robot file or in a folder `srdf` next to that
    /// folder.
    pub postures: Vec<Posture>,
    /// Pairs of bodies that an MJCF file excludes from collision.
    pub exclusions: Srdf,
    /// Joints of the file that the graph holds, each with its position \[rad or m\]. Held joints are not part
    /// of the model.
    pub held: Vec<(String, f64)>,
    /// Catalogue entry; `None` if the robot is not from the catalogue.
    pub entry: Option<&'static Entry>,
    /// Path of the URDF or MJCF file; `None` if the robot was not loaded from a file.
    pub path: Option<PathBuf>,
}

impl Loaded {
    /// Returns the text of the URDF or MJCF file; `None` if the robot was not loaded from a file.
    ///
    /// ```
    /// let panda = motorium_robots::load("panda", std::path::Path::new("."))?;
    /// assert!(panda.text()?.unwrap().contains("<robot name=\"panda\""));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    ///
    /// The robot's file has been removed or cannot be read.
    pub fn text(&self) -> io::Result<Option<String>> {
        match (&self.entry, &self.path) {
            (Some(entry), _) => Ok(Some(entry.urdf.to_string())),
            (None, Some(path)) => std::fs::read_to_string(path).map(Some),
            (None, None) => Ok(None),
        }
    }
}

/// Error of loading a robot.
#[derive(Debug, thiserror::Error)]
pub enum LoadError {
    /// The robot is neither in the catalogue nor on disk.
    #[error(
        "robot \"{reference}\" is neither in the catalogue nor installed, nor a file or folder ({} does not exist){}",
        .path.display(), suggestion(.nearest.as_deref())
    )]
    NotFound {
        /// Reference to the robot as written.
        reference: String,
        /// Path of the missing file or folder, if the reference is meant as a path.
        path: PathBuf,
        /// Name of the most similar robot in the catalogue or among the installed robots.
        nearest: Option<String>,
    },
    /// The folder contains no robot.
    #[error("there is no .urdf file in {} or its urdf/ folder, and no MJCF (.xml) file", .0.display())]
    NoUrdf(PathBuf),
    /// The folder contains more than one robot.
    #[error("there are several robot files in {}: {}; name one of them", .folder.display(), .names.join(", "))]
    SeveralUrdf {
        /// Path of the folder.
        folder: PathBuf,
        /// Names of the robot files in the folder.
        names: Vec<String>,
    },
    /// The file is not MJCF, although the graph specifies it as MJCF.
    #[error("{} is not an MJCF file: its root element is not <mujoco>; use the key `urdf` for it", .0.display())]
    NotMjcf(PathBuf),
    /// The file cannot be read.
    #[error("cannot read {}: {source}", .path.display())]
    Read {
        /// Path of the file.
        path: PathBuf,
        /// Cause.
        source: io::Error,
    },
    /// The file is not UTF-8 text.
    #[error("{}:{}:{}: byte {byte:#04x} is not UTF-8; save the file as UTF-8", .path.display(), .at.line, .at.column)]
    NotText {
        /// Path of the file.
        path: PathBuf,
        /// Position of the first invalid byte. Columns count characters.
        at: Position,
        /// The invalid byte.
        byte: u8,
    },
    /// The URDF has an error.
    #[error(transparent)]
    Urdf(#[from] UrdfError),
    /// The MJCF file has an error.
    #[error(transparent)]
    Mjcf(#[from] MjcfError),
    /// A robot setting of a graph does not match the robot.
    #[error(transparent)]
    Setting(#[from] crate::SettingError),
    /// The profile has an error.
    #[error("{}: {source}", .path.display())]
    Profile {
        /// Path of the profile.
        path: PathBuf,
        /// Cause.
        source: ProfileError,
    },
}

/// Loads a robot by reference: a catalogue name (`panda`), a folder or file relative to `base`, or the name
/// of an [installed](crate::installed) robot. A file is URDF, or MJCF if its root element is `<mujoco>`.
///
/// If a catalogue robot and a folder have the same name, the catalogue robot is loaded (write `./panda` for
/// the folder). If a folder and an installed robot have the same name, the folder is loaded.
///
/// # Errors
///
/// [`LoadError`] if the robot is not found or one of its files has an error.
pub fn load(reference: &str, base: &Path) -> Result<Loaded, LoadError> {
    load_with(reference, base, &LoadOptions::default())
}

/// Loads a robot like [`load`], with options such as the treatment of the base and of mimic joints.
///
/// # Errors
///
/// See [`load`].
pub fn load_with(reference: &str, base: &Path, options: &LoadOptions) -> Result<Loaded, LoadError> {
    let mut options = options.clone();
    let environment = PackagePath::from_env();
    options.packages.folders.extend(environment.folders);
    options.packages.prefixes.extend(environment.prefixes);

    let entry = catalogue().iter().find(|entry| entry.name == reference);
    if let Some(entry) = entry.filter(|_| options.format == FileFormat::Any) {
        let profile = match &options.profile {
            ProfileChoice::Own => Some((entry.profile.clone(), PathBuf::from(format!("{reference}.toml")))),
            chosen => profile_of(chosen, Path::new(""))?,
        };
        let options = based(options, profile.as_ref());
        let UrdfRobot { model, warnings } = parse_urdf_with(entry.urdf, None, &options)?;
        let (postures, held, exclusions) = (Vec::new(), Vec::new(), Srdf::default());
        let (entry, path) = (Some(entry), None);
        let loaded = Loaded { model, warnings, profile: None, postures, exclusions, held, entry, path };
        return profiled(loaded, profile, &options);
    }
    let path = match (file(reference, base, options.format), entry) {
        (Err(LoadError::NotFound { .. }), Some(_)) => return Err(LoadError::NotMjcf(reference.into())),
        (found, _) => found?,
    };
    let profile = profile_of(&options.profile, &path.with_extension("toml"))?;
    let options = based(options, profile.as_ref());
    let text = read(&path)?;
    let Parsed { model, mut warnings, exclusions, profile: own } = parse(&text, &path, &options)?;
    if warnings.iter().any(|warning| matches!(warning, ModelWarning::MissingMesh { .. })) {
        MeshReferences::read(&text, Some(&path), options.shapes).locate(&mut warnings);
    }
    // poses and gains from the file itself, unless another profile is chosen
    let own = own.filter(|_| options.profile == ProfileChoice::Own).map(|own| (own, path.clone()));
    let profile = profile.or(own);
    let postures = Posture::beside(&path, &model);
    let (held, entry, path) = (Vec::new(), None, Some(path));
    let loaded = Loaded { model, warnings, profile: None, postures, exclusions, held, entry, path };
    profiled(loaded, profile, &options)
}

/// Adds the profile to the robot and applies the profile's limits.
fn profiled(
    loaded: Loaded,
    profile: Option<(Profile, PathBuf)>,
    options: &LoadOptions,
) -> Result<Loaded, LoadError> {
    let Some((profile, path)) = profile else { return Ok(loaded) };
    let mut warnings = loaded.warnings;
    for (name, pose) in &profile.base_poses {
        let what = format!("`rpy` of base pose `{name}` in {}", path.display());
        warnings.extend(ModelWarning::of_angles(&what, &pose.rpy, RADIANS, None));
    }
    // Independent mimic joints are unknown to the profile.
    let model = match options.mimic {
        MimicMode::Follow => {
            let fault = |source| LoadError::Profile { path: path.clone(), source };
            profile.check(&loaded.model).map_err(fault)?;
            let limits = profile.velocity_limit(&loaded.model).map_err(fault)?;
            match limits.iter().any(|limit| limit.is_finite()) {
                true => loaded.model.with_velocity_limits(limits.as_slice()),
                false => loaded.model,
            }
        }
        MimicMode::Independent => loaded.model,
    };
    Ok(Loaded { model, warnings, profile: Some(profile), ..loaded })
}

/// A robot parsed from a file.
struct Parsed {
    model: Model,
    warnings: Vec<ModelWarning>,
    exclusions: Srdf,
    profile: Option<Profile>,
}

/// Parses a file's text as MJCF if its root element is `<mujoco>`, otherwise as URDF.
fn parse(text: &str, path: &Path, options: &LoadOptions) -> Result<Parsed, LoadError> {
    if !is_mjcf(text) && options.format == FileFormat::Mjcf {
        return Err(LoadError::NotMjcf(path.to_owned()));
    }
    if is_mjcf(text) {
        let MjcfRobot { model, warnings, exclusions, profile, .. } = parse_mjcf(text, Some(path), options)?;
        return Ok(Parsed { model, warnings, exclusions, profile });
    }
    let UrdfRobot { model, warnings } = parse_urdf_with(text, Some(path), options)?;
    Ok(Parsed { model, warnings, exclusions: Srdf::default(), profile: None })
}

/// Returns the options with the profile's base, unless they specify one.
fn based(options: LoadOptions, profile: Option<&(Profile, PathBuf)>) -> LoadOptions {
    match (options.base, profile.map(|(profile, _)| profile.base)) {
        (BaseMode::AsFile, Some(BaseKind::Floating)) => LoadOptions { base: BaseMode::Floating, ..options },
        _ => options,
    }
}

/// Returns the file to which `reference` refers.
fn file(reference: &str, base: &Path, format: FileFormat) -> Result<PathBuf, LoadError> {
    let path = base.join(reference);
    if path.exists() {
        return if path.is_dir() { robot_in(&path, format) } else { Ok(path) };
    }
    let installed = installed();
    if let Some(robot) = find(&installed, reference) {
        return Ok(robot.urdf.clone());
    }
    let names = catalogue().iter().map(|entry| entry.name);
    let names = names.chain(installed.iter().map(|robot| robot.name.as_str()));
    let nearest = nearest(reference, names).map(str::to_owned);
    Err(LoadError::NotFound { reference: reference.to_owned(), path, nearest })
}

fn read(path: &Path) -> Result<String, LoadError> {
    let bytes =
        read_bounded(path, LONGEST).map_err(|source| LoadError::Read { path: path.to_owned(), source })?;
    String::from_utf8(bytes).map_err(|error| {
        let (before, rest) = error.as_bytes().split_at(error.utf8_error().valid_up_to());
        let before = String::from_utf8_lossy(before);
        let line = before.rsplit('\n').next().unwrap_or_default();
        let count = |count: usize| u32::try_from(count).unwrap_or(u32::MAX - 1) + 1;
        let at = Position { line: count(before.matches('\n').count()), column: count(line.chars().count()) };
        LoadError::NotText { path: path.to_owned(), at, byte: rest[0] }
    })
}

/// Returns the robot file in a folder: its only URDF, the URDF with the name of the folder, or the URDF in
/// its `urdf` folder; otherwise an MJCF file by the same rules.
fn robot_in(folder: &Path, format: FileFormat) -> Result<PathBuf, LoadError> {
    let places = [(folder.to_owned(), "urdf"), (folder.join("urdf"), "urdf"), (folder.to_owned(), "xml")];
    for (place, extension) in places {
        if format == FileFormat::Mjcf && extension == "urdf" {
            continue;
        }
        let Ok(entries) = std::fs::read_dir(&place) else { continue };
        let mut found: Vec<_> = entries
            .filter_map(|entry| Some(entry.ok()?.path()))
            .filter(|path| path.extension().is_some_and(|found| found == extension))
            // packages contain a package.xml, launch files and similar files
            .filter(|path| extension == "urdf" || read(path).is_ok_and(|text| is_mjcf(&text)))
            .collect();
        found.sort();
        let namesake = found.iter().find(|path| path.file_stem() == folder.file_name());
        match (&found[..], namesake) {
            (_, Some(path)) | ([path], None) => return Ok(path.clone()),
            ([], None) => {}
            _ => {
                let name =
                    |path: &PathBuf| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
                return Err(LoadError::SeveralUrdf {
                    folder: place,
                    names: found.iter().map(name).collect(),
                });
            }
        }
    }
    Err(LoadError::NoUrdf(folder.to_owned()))
}

/// Returns the chosen profile and its file: by default `beside`, if it exists.
fn profile_of(choice: &ProfileChoice, beside: &Path) -> Result<Option<(Profile, PathBuf)>, LoadError> {
    let path = match choice {
        ProfileChoice::Own if beside.is_file() => beside,
        ProfileChoice::Own | ProfileChoice::Without => return Ok(None),
        ProfileChoice::File(path) => path,
    };
    let text = read(path)?;
    // A graph with the robot's name next to it is not a profile.
    let table = || text.parse::<toml::Table>().is_ok_and(|table| table.contains_key("component"));
    if *choice == ProfileChoice::Own && table() {
        return Ok(None);
    }
    let profile = Profile::parse(&text);
    let path = path.to_path_buf();
    match profile {
        Ok(profile) => Ok(Some((profile, path))),
        Err(source) => Err(LoadError::Profile { path, source }),
    }
}
