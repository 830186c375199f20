//! MuJoCo's shared library: located, loaded and checked once per process.

#![allow(unsafe_code)] // a library loaded at run time has only the signatures that are declared here

use core::ffi::{CStr, c_char, c_int, c_void};
use std::ffi::CString;
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use super::layout::VERSION;
use crate::library_error::{FILE, LibraryError, VARIABLE};

/// A model or the data of a simulation, opaque outside the library.
pub(super) type Opaque = *mut c_void;

/// The functions of the library.
pub(super) struct Library {
    pub(super) parse_xml_string:
        unsafe extern "C" fn(*const c_char, *const c_void, *mut c_char, c_int) -> Opaque,
    pub(super) compile: unsafe extern "C" fn(Opaque, *const c_void) -> Opaque,
    pub(super) spec_error: unsafe extern "C" fn(Opaque) -> *const c_char,
    pub(super) delete_spec: unsafe extern "C" fn(Opaque),
    pub(super) delete_model: unsafe extern "C" fn(Opaque),
    pub(super) make_data: unsafe extern "C" fn(Opaque) -> Opaque,
    pub(super) delete_data: unsafe extern "C" fn(Opaque),
    pub(super) reset_data: unsafe extern "C" fn(Opaque, Opaque),
    pub(super) step: unsafe extern "C" fn(Opaque, Opaque),
    pub(super) state_size: unsafe extern "C" fn(Opaque, c_int) -> c_int,
    pub(super) get_state: unsafe extern "C" fn(Opaque, Opaque, *mut f64, c_int),
    pub(super) set_state: unsafe extern "C" fn(Opaque, Opaque, *const f64, c_int),
    pub(super) name_to_id: unsafe extern "C" fn(Opaque, c_int, *const c_char) -> c_int,
    pub(super) contact_force: unsafe extern "C" fn(Opaque, Opaque, c_int, *mut f64),
}

impl Library {
    /// Returns the library of this process.
    ///
    /// # Errors
    ///
    /// [`LibraryError`]; it persists for the life of the process.
    pub(super) fn get() -> Result<&'static Self, LibraryError> {
        static LIBRARY: OnceLock<Result<Library, LibraryError>> = OnceLock::new();
        LIBRARY.get_or_init(|| find().and_then(|path| Self::load(&path))).as_ref().map_err(Clone::clone)
    }

    fn load(path: &Path) -> Result<Self, LibraryError> {
        let unusable = |reason: String| LibraryError::Unusable { path: path.to_owned(), reason };
        let name = CString::new(path.as_os_str().as_bytes()).map_err(|error| unusable(error.to_string()))?;
        // SAFETY: the name ends with a zero byte; the library's initialisers are safe to run, as in any
        // program that links it.
        let handle = unsafe { libc::dlopen(name.as_ptr(), libc::RTLD_NOW | libc::RTLD_LOCAL) };
        if handle.is_null() {
            return Err(unusable(last_error()));
        }
        let symbol = |name: &'static CStr| {
            // SAFETY: the handle belongs to a library that is never closed.
            let address = unsafe { libc::dlsym(handle, name.as_ptr()) };
            if address.is_null() { Err(unusable(last_error())) } else { Ok(address) }
        };
        /// Returns the function at an address.
        ///
        /// # Safety
        ///
        /// The address must point to a function of this type.
        unsafe fn function<F: Copy>(address: *mut c_void) -> F {
            const { assert!(size_of::<F>() == size_of::<*mut c_void>(), "a pointer to a function") };
            // SAFETY: the caller guarantees the type, and both are pointers.
            unsafe { core::mem::transmute_copy(&address) }
        }
        // SAFETY: the function has this type in every version.
        let version: unsafe extern "C" fn() -> c_int = unsafe { function(symbol(c"mj_version")?) };
        // SAFETY: it has no parameters and returns a number, in every version.
        let found = unsafe { version() };
        if found != VERSION {
            // Three digits per component; older versions have one.
            let found = match found {
                old if old < 10_000 => format!("{}.{}.{}", old / 100, old / 10 % 10, old % 10),
                new => format!("{}.{}.{}", new / 1_000_000, new / 1_000 % 1_000, new % 1_000),
            };
            return Err(LibraryError::Version { path: path.to_owned(), found });
        }
        // SAFETY: the types match the headers of this version.
        let library = unsafe {
            Self {
                parse_xml_string: function(symbol(c"mj_parseXMLString")?),
                compile: function(symbol(c"mj_compile")?),
                spec_error: function(symbol(c"mjs_getError")?),
                delete_spec: function(symbol(c"mj_deleteSpec")?),
                delete_model: function(symbol(c"mj_deleteModel")?),
                make_data: function(symbol(c"mj_makeData")?),
                delete_data: function(symbol(c"mj_deleteData")?),
                reset_data: function(symbol(c"mj_resetData")?),
                step: function(symbol(c"mj_step")?),
                state_size: function(symbol(c"mj_stateSize")?),
                get_state: function(symbol(c"mj_getState")?),
                set_state: function(symbol(c"mj_setState")?),
                name_to_id: function(symbol(c"mj_name2id")?),
                contact_force: function(symbol(c"mj_contactForce")?),
            }
        };
        type Handler = extern "C" fn(*const c_char);
        for (name, handler) in
            [(c"mju_user_warning", ignore as Handler), (c"mju_user_error", fail as Handler)]
        {
            let place = symbol(name)?.cast::<Handler>();
            // SAFETY: both are global variables that hold a pointer to such a function, and no other thread
            // uses the library yet.
            unsafe { place.write(handler) };
        }
        Ok(library)
    }
}

/// Receives a warning from MuJoCo, which would otherwise write a file into the working directory. The
/// conditions it warns of (states that are not finite, no room for contacts) are checked after every step.
extern "C" fn ignore(_: *const c_char) {}

/// Receives an error from which MuJoCo cannot continue, and aborts the process: a panic cannot unwind out of
/// this function.
extern "C" fn fail(message: *const c_char) {
    // SAFETY: MuJoCo passes a text that ends with a zero byte.
    let message = unsafe { CStr::from_ptr(message) };
    panic!("MuJoCo: {}", message.to_string_lossy());
}

fn last_error() -> String {
    // SAFETY: the text, if any, stays valid until this thread's next call of the loader.
    unsafe {
        let text = libc::dlerror();
        if text.is_null() {
            "unknown".to_owned()
        } else {
            CStr::from_ptr(text).to_string_lossy().into_owned()
        }
    }
}

/// Returns the path of the library.
pub(super) fn find() -> Result<PathBuf, LibraryError> {
    if let Some(path) = std::env::var_os(VARIABLE) {
        let path = PathBuf::from(path);
        let file = if path.is_dir() { path.join(FILE) } else { path.clone() };
        return if file.is_file() { Ok(file) } else { Err(LibraryError::Elsewhere { path }) };
    }
    let python = std::env::var_os("MOTORIUM_PYTHON").map(PathBuf::from);
    let python = python.iter().filter_map(|python| python.parent().map(Path::to_owned));
    let venv = std::env::var_os("VIRTUAL_ENV").map(|venv| PathBuf::from(venv).join("bin"));
    let path = std::env::var_os("PATH").unwrap_or_default();
    let home = std::env::var_os("HOME").map(|home| PathBuf::from(home).join(".local/bin"));
    let bins = python.chain(venv).chain(std::env::split_paths(&path)).chain(home);
    let prefixes = bins.filter_map(|bin| bin.parent().map(Path::to_owned));
    let system = ["/usr/local/lib", "/usr/lib"].map(|folder| Path::new(folder).join(FILE));
    let found = prefixes.flat_map(|prefix| in_prefix(&prefix)).chain(system).find(|file| file.is_file());
    found.ok_or(LibraryError::Missing)
}

/// Returns the possible paths of the library below the prefix of a Python:
/// `lib/python3.*/site-packages/mujoco`, or Debian's `dist-packages`.
fn in_prefix(prefix: &Path) -> Vec<PathBuf> {
    let Ok(entries) = std::fs::read_dir(prefix.join("lib")) else { return Vec::new() };
    let is_python = |name: &std::ffi::OsStr| name.as_bytes().starts_with(b"python3");
    let mut pythons: Vec<PathBuf> =
        entries.flatten().filter(|entry| is_python(&entry.file_name())).map(|entry| entry.path()).collect();
    pythons.sort();
    let packages = |python: PathBuf| {
        ["site-packages", "dist-packages"].map(|kind| python.join(kind).join("mujoco").join(FILE))
    };
    pythons.into_iter().flat_map(packages).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn library_is_found_where_pip_installs_it() {
        let prefix = std::env::temp_dir().join(format!("motorium-prefix-{}", std::process::id()));
        let package = prefix.join("lib/python3.11/site-packages/mujoco");
        std::fs::create_dir_all(&package).expect("a folder");
        assert!(in_prefix(&prefix).contains(&package.join(FILE)));
        std::fs::remove_dir_all(&prefix).expect("the folder");
        assert!(in_prefix(&prefix).is_empty());
    }

    #[test]
    fn a_file_that_is_not_a_library_is_reported() {
        let Err(error) = Library::load(Path::new("/dev/null")) else { panic!("no library") };
        assert!(matches!(&error, LibraryError::Unusable { .. }), "{error}");
        assert!(error.to_string().contains("`/dev/null` cannot be loaded: "), "{error}");
    }
}
