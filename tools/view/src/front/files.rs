//! The files of the page, which are part of the program.

use motorium::state::Digest;

/// A file of the page.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct File {
    /// Path of the file in the address.
    pub(super) path: &'static str,
    pub(super) content_type: &'static str,
    pub(super) content: &'static [u8],
}

macro_rules! file {
    ($path:literal, $content_type:literal, $file:literal) => {
        File {
            path: $path,
            content_type: $content_type,
            content: include_bytes!(concat!("../../page/dist/", $file)),
        }
    };
}

/// All files, built by `tools/view/page/build.mjs`.
pub(super) static FILES: [File; 4] = [
    file!("/", "text/html; charset=utf-8", "index.html"),
    file!("/page.js", "text/javascript; charset=utf-8", "page.js"),
    file!("/page.css", "text/css; charset=utf-8", "page.css"),
    file!("/licences.txt", "text/plain; charset=utf-8", "licences.txt"),
];

/// Returns a digest of all files, as 16 hexadecimal digits.
pub(super) fn digest() -> String {
    let mut digest = Digest::default();
    FILES.iter().for_each(|file| digest.write(file.content));
    format!("{:016x}", digest.finish())
}
