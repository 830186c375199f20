//! Output files: formats by the ends of their names, and existing files, which are replaced on request only.

use std::fs::FileType;
use std::os::unix::fs::FileTypeExt as _;
use std::path::{Path, PathBuf};

use anyhow::Context as _;
use serde::{Serialize as _, Serializer};

/// The option of commands that write files.
#[derive(Debug, Default, Clone, Copy, clap::Args)]
pub(crate) struct Overwrite {
    /// Replace files that exist
    #[arg(long)]
    overwrite: bool,
}

impl Overwrite {
    /// Returns `true` if existing files are replaced.
    pub(crate) fn is_given(self) -> bool {
        self.overwrite
    }

    /// Checks the output files of a command before its work: none exists without `--overwrite`, is an input,
    /// or is written twice.
    pub(crate) fn check<'p>(
        self,
        inputs: impl IntoIterator<Item = &'p PathBuf>,
        outputs: impl IntoIterator<Item = &'p PathBuf>,
    ) -> anyhow::Result<()> {
        let inputs: Vec<&PathBuf> = inputs.into_iter().collect();
        let mut checked: Vec<&PathBuf> = Vec::new();
        for output in outputs {
            refuse_existing(output, self.overwrite)?;
            anyhow::ensure!(
                !inputs.iter().any(|input| is_same(input, output)),
                "the output {} is an input of the command: name another file",
                output.display()
            );
            anyhow::ensure!(
                !checked.iter().any(|other| is_same(other, output)),
                "{} is named for two outputs: name another file for one of them",
                output.display()
            );
            checked.push(output);
        }
        Ok(())
    }
}

/// Serialises an optional path as text. Bytes that are not UTF-8 are replaced.
pub(crate) fn serialize_path<S: Serializer>(
    path: &Option<PathBuf>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    path.as_ref().map(|path| path.to_string_lossy()).serialize(serializer)
}

/// Returns `true` if two paths name the same file. Devices and pipes are never the same.
fn is_same(one: &Path, other: &Path) -> bool {
    let resolved = |path: &Path| path.canonicalize().or_else(|_| std::path::absolute(path));
    match (resolved(one), resolved(other)) {
        (Ok(one), Ok(other)) => one == other && !is_stream(&one),
        _ => false,
    }
}

/// Refuses an output file that this user cannot write.
fn refuse_unwritable(path: &Path) -> anyhow::Result<()> {
    if is_stream(path) {
        return Ok(());
    }
    let found = path.ancestors().find(|above| above.exists()).unwrap_or(Path::new("."));
    rustix::fs::access(found, rustix::fs::Access::WRITE_OK)
        .map_err(std::io::Error::from)
        .with_context(|| format!("{}: {} cannot be written", path.display(), found.display()))
}

/// Returns `true` for devices and pipes, such as `/dev/stdout`, which keep no content.
fn is_stream(path: &Path) -> bool {
    let keeps_nothing = |kind: FileType| kind.is_char_device() || kind.is_fifo() || kind.is_socket();
    path.metadata().is_ok_and(|found| keeps_nothing(found.file_type()))
}

/// Returns the format of a file, one of `known`: the end of its name in lower case.
pub(crate) fn format<'k>(path: &Path, known: &[&'k str]) -> anyhow::Result<&'k str> {
    let end = path.extension().map(|end| end.to_string_lossy());
    let is_it = |format: &&&str| end.as_ref().is_some_and(|end| end.eq_ignore_ascii_case(format));
    known.iter().find(is_it).copied().with_context(|| {
        let found = end.as_ref().map_or("no ending".to_string(), |end| format!("the ending .{end}"));
        let (last, rest) = known.split_last().expect("a format");
        let rest: Vec<String> = rest.iter().map(|format| format!(".{format}")).collect();
        let expected = match &rest[..] {
            [] => format!(".{last}"),
            rest => format!("{} or .{last}", rest.join(", ")),
        };
        let other = path.with_extension(known[0]);
        format!("{}: found {found}, expected {expected}; write `{}`", path.display(), other.display())
    })
}

/// Checks the format of an output file, one of `known`. Devices and pipes have no format.
pub(crate) fn check_format(path: &Path, known: &[&str]) -> anyhow::Result<()> {
    if is_stream(path) { Ok(()) } else { format(path, known).map(drop) }
}

/// Makes the folder of an output file.
pub(crate) fn make_folder(path: &Path) -> anyhow::Result<()> {
    let Some(folder) = path.parent().filter(|folder| !folder.as_os_str().is_empty()) else { return Ok(()) };
    std::fs::create_dir_all(folder).with_context(|| format!("making {}", folder.display()))
}

/// Writes an output file, and makes its folder.
pub(crate) fn write_file(path: &Path, content: impl AsRef<[u8]>) -> anyhow::Result<()> {
    make_folder(path)?;
    std::fs::write(path, content).with_context(|| format!("writing {}", path.display()))
}

/// Refuses a file in the place of an output folder or of a folder above it.
pub(crate) fn check_folder(path: &Path) -> anyhow::Result<()> {
    match path.ancestors().find(|above| above.symlink_metadata().is_ok()) {
        Some(found) if !found.is_dir() => anyhow::bail!("{} is a file, expected a folder", found.display()),
        _ => Ok(()),
    }
}

/// Refuses to replace an existing file without `--overwrite`. Devices and pipes, such as `/dev/stdout`, keep
/// no content and are accepted. Also refuses a folder, a file in the place of a folder of the path, and a
/// file that this user cannot write.
pub(crate) fn refuse_existing(path: &Path, overwrite: bool) -> anyhow::Result<()> {
    anyhow::ensure!(!path.is_dir(), "{} is a folder, expected the name of a file", path.display());
    path.parent().map_or(Ok(()), check_folder)?;
    anyhow::ensure!(
        overwrite || path.symlink_metadata().is_err() || is_stream(path),
        "{} exists: name another file, or replace it with `--overwrite`",
        path.display()
    );
    refuse_unwritable(path)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formats_are_recognised_by_the_end_of_the_name() {
        let of = |name: &str| format(Path::new(name), &["svg", "png"]).map_err(|error| error.to_string());
        assert_eq!((of("a.svg"), of("b/c.PNG")), (Ok("svg"), Ok("png")));
        let refused = "z.gif: found the ending .gif, expected .svg or .png; write `z.svg`";
        assert_eq!(of("z.gif"), Err(refused.to_string()));
        assert_eq!(of("z"), Err("z: found no ending, expected .svg or .png; write `z.svg`".to_string()));
        let one = format(Path::new("x.txt"), &["mcap"]).unwrap_err().to_string();
        assert_eq!(one, "x.txt: found the ending .txt, expected .mcap; write `x.mcap`");
    }

    #[test]
    fn existing_files_are_replaced_on_request_only() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("a");
        assert!(refuse_existing(&file, false).is_ok());
        std::os::unix::fs::symlink("nowhere", &file).expect("a link");
        let refused = refuse_existing(&file, false).unwrap_err().to_string();
        assert!(
            refused.ends_with("a exists: name another file, or replace it with `--overwrite`"),
            "{refused}"
        );
        assert!(refuse_existing(&file, true).is_ok());
        assert!(refuse_existing(Path::new("/dev/null"), false).is_ok(), "a device");
        for overwrite in [false, true] {
            let refused = refuse_existing(folder.path(), overwrite).unwrap_err().to_string();
            assert!(refused.ends_with("is a folder, expected the name of a file"), "{refused}");
            let above = folder.path().join("b");
            std::fs::write(&above, "").expect("a file");
            let refused = refuse_existing(&above.join("c/d.svg"), overwrite).unwrap_err().to_string();
            assert!(refused.ends_with("b is a file, expected a folder"), "{refused}");
        }
        assert!(refuse_existing(&folder.path().join("c/d.svg"), false).is_ok(), "a new folder");
    }

    #[test]
    fn unwritable_folder_is_refused_before_the_work() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::set_permissions(folder.path(), PermissionsExt::from_mode(0o555)).expect("its owner");
        let file = folder.path().join("a.svg");
        if std::fs::write(&file, "").is_ok() {
            println!("skipped: this user writes into every folder");
            return;
        }
        let refused = format!("{:#}", refuse_existing(&file, false).unwrap_err());
        assert!(refused.contains("cannot be written: Permission denied"), "{refused}");
    }

    #[test]
    fn inputs_and_files_named_twice_are_refused() {
        let folder = tempfile::tempdir().expect("a folder");
        let [input, output, other] = ["in.csv", "out.csv", "./out.csv"].map(|name| folder.path().join(name));
        std::fs::write(&input, "1").expect("a file");
        let given = Overwrite { overwrite: true };
        let refused = |outputs: &[&PathBuf]| {
            let checked = given.check([&input], outputs.iter().copied());
            checked.map_err(|error| error.to_string()).unwrap_err()
        };
        assert!(
            refused(&[&output, &input]).ends_with("in.csv is an input of the command: name another file")
        );
        assert!(
            refused(&[&output, &other])
                .ends_with("is named for two outputs: name another file for one of them")
        );
        assert!(given.check([&input], [&output]).is_ok());
        let stream = PathBuf::from("/dev/null");
        assert!(given.check([&stream], [&stream, &stream]).is_ok());
        assert!(check_format(&stream, &["svg"]).is_ok() && check_format(&output, &["svg"]).is_err());
    }
}
