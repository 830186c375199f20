//! Output files: formats by the ends of their names, and existing files, which are replaced on request only.

use std::fs::FileType;
use std::os::unix::fs::FileTypeExt as _;
use std::path::Path;

use anyhow::Context as _;

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

/// Writes an output file, and makes its folder.
pub(crate) fn write_file(path: &Path, content: impl AsRef<[u8]>) -> anyhow::Result<()> {
    if let Some(folder) = path.parent().filter(|folder| !folder.as_os_str().is_empty()) {
        std::fs::create_dir_all(folder).with_context(|| format!("making {}", folder.display()))?;
    }
    std::fs::write(path, content).with_context(|| format!("writing {}", path.display()))
}

/// Refuses to replace an existing file without `--overwrite`. Devices and pipes, such as `/dev/stdout`, keep
/// no content and are accepted.
pub(crate) fn refuse_existing(path: &Path, overwrite: bool) -> anyhow::Result<()> {
    let keeps_nothing = |kind: FileType| kind.is_char_device() || kind.is_fifo() || kind.is_socket();
    let is_stream = || path.metadata().is_ok_and(|found| keeps_nothing(found.file_type()));
    anyhow::ensure!(
        overwrite || path.symlink_metadata().is_err() || is_stream(),
        "{} exists: name another file, or replace it with `--overwrite`",
        path.display()
    );
    Ok(())
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
        assert!(refuse_existing(folder.path(), false).is_err(), "a folder");
    }
}
