//! The page embedded in the program equals the page built from its sources.

use std::path::Path;
use std::process::Command;

use crate::support::workspace;

fn copy(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap().flatten() {
        let (path, target) = (entry.path(), to.join(entry.file_name()));
        match path.is_dir() {
            true if entry.file_name() == "node_modules" || entry.file_name() == "dist" => {}
            true => copy(&path, &target),
            false => drop(std::fs::copy(&path, &target).unwrap()),
        }
    }
}

#[test]
fn the_picture_of_the_page_in_the_docs_is_up_to_date() {
    let picture = "docs/src/images/view.png";
    let file = std::fs::read(workspace().join(picture)).unwrap();
    let page = motorium_pictures::png::text(&file, "page");
    assert_eq!(
        page,
        Some(motorium_view::page_digest()),
        "{picture} is of another page: motorium view graphs/panda-reach.toml --headless-check {picture}"
    );
    let page = std::fs::read_to_string(workspace().join("docs/src/view.md")).unwrap();
    assert!(page.contains("images/view.png"));
}

#[test]
fn the_bundle_matches_its_sources_and_locked_packages() {
    let page = workspace().join("tools/view/page");
    let copied = tempfile::tempdir().unwrap();
    copy(&page, copied.path());
    let install = ["ci", "--no-audit", "--no-fund", "--silent"];
    let installed = Command::new("npm").args(install).current_dir(copied.path()).output();
    if !installed.is_ok_and(|output| output.status.success()) {
        eprintln!("skipped: npm is missing, or cannot install the packages of the page");
        return;
    }
    let built = Command::new("node").arg("build.mjs").current_dir(copied.path()).output().unwrap();
    assert!(built.status.success(), "{}", String::from_utf8_lossy(&built.stderr));
    for file in ["index.html", "page.css", "page.js", "licences.txt"] {
        let read = |folder: &Path| std::fs::read(folder.join("dist").join(file)).unwrap();
        assert!(
            read(&page) == read(copied.path()),
            "{file} is not what its sources make: `npm ci && npm run build` in tools/view/page"
        );
    }
}

#[test]
fn the_logic_of_the_page_passes_its_tests() {
    let page = workspace().join("tools/view/page");
    let tested = Command::new("node").args(["--test", "test/"]).current_dir(page).output();
    let Ok(output) = tested else {
        eprintln!("skipped: node is missing");
        return;
    };
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(
        output.status.success() && text.contains("pass "),
        "{text}{}",
        String::from_utf8_lossy(&output.stderr)
    );
}
