//! Kinds hosted by another installed program: found next to `motorium` or on `PATH`, queried once, and run as
//! its processes.

use std::os::unix::fs::PermissionsExt as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use motorium::launcher::Exit;

use crate::MOTORIUM;
use crate::support::{ANY_LOSS, Ended, machine};

const SIBLING: &str = env!("CARGO_BIN_EXE_sibling-program");

/// A folder with `motorium`, and a graph with two pushes of a kind from `motorium-bridges`.
struct Installed(tempfile::TempDir);

impl Installed {
    fn new() -> Self {
        let installed = Self(tempfile::tempdir().unwrap());
        link_or_copy(MOTORIUM, &installed.path("motorium"));
        installed.graph("bridge.push", "force = 3.0");
        installed
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn graph(&self, kind: &str, config: &str) {
        let component = |name: &str| {
            format!(
                "[component.{name}]\nkind = \"{kind}\"\nrate = \"100 Hz\"\nschedule = \"normal\"\n\
                 publish = {{ wrench = \"{name}\" }}\nconfig = {{ {config} }}\n\n"
            )
        };
        let text = format!("name = \"push\"\n\n{}{}", component("left"), component("right"));
        std::fs::write(self.path("graph.toml"), text).unwrap();
    }

    /// Adds a script as a program with this name.
    fn script(&self, name: &str, text: &str) {
        let path = self.path(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(&path, format!("#!/bin/sh\n{text}\n")).unwrap();
        std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o755)).unwrap();
    }

    fn motorium(&self, arguments: &[&str]) -> Output {
        let mut command = Command::new(self.path("motorium"));
        command.args(arguments).current_dir(self.0.path()).stdin(Stdio::null());
        let path = format!("{}:{}", self.path("bin").display(), std::env::var("PATH").unwrap_or_default());
        command.env("PATH", path).output().expect("motorium starts")
    }

    fn run(&self, arguments: &[&str]) -> Ended {
        Ended::from_output(
            &self.motorium(&[&["run", "graph.toml", "--json"], &ANY_LOSS[..], arguments].concat()),
        )
    }

    /// Returns the digest of the shared memory layout that programs of this version report.
    fn memory(&self) -> String {
        let answer =
            Command::new(SIBLING).arg("motorium-kinds").output().expect("the program answers").stdout;
        let answer: serde_json::Value = serde_json::from_slice(&answer).expect("JSON");
        answer["memory"].as_str().expect("a digest").to_string()
    }

    /// Returns the error of `check`, without the folder.
    fn complaint(&self) -> String {
        let output = self.motorium(&["check", "graph.toml"]);
        assert!(!output.status.success(), "it should be refused");
        let text = String::from_utf8_lossy(&output.stderr);
        text.replace(&self.0.path().canonicalize().unwrap().display().to_string(), "FOLDER")
            .replace(env!("CARGO_PKG_VERSION"), "VERSION")
    }
}

/// Creates a link to a program, or a copy.
fn link_or_copy(program: &str, at: &Path) {
    std::fs::create_dir_all(at.parent().unwrap()).unwrap();
    if std::fs::hard_link(program, at).is_err() {
        std::fs::copy(program, at).unwrap();
    }
}

#[test]
fn kind_of_another_program_runs_as_its_process() {
    let _machine = machine();
    let installed = Installed::new();
    link_or_copy(SIBLING, &installed.path("motorium-bridges"));
    for arguments in [
        &["--for", "1 s"][..],
        &["--for", "1 s", "--clock", "lockstep"],
        &["--for", "1 s", "--clock", "lockstep", "--hosting", "threads"],
    ] {
        let ended = installed.run(arguments);
        assert_eq!((ended.code, &ended.report().exit), (Some(0), &Exit::Finished), "{}", ended.stderr);
        assert_eq!(ended.report().results["left"]["force"], 3.0);
        assert!(ended.report().components.iter().all(|c| c.steps > 50), "{:?}", ended.report().components);
    }
    let ended = installed.run(&["--for", "1 s", "--clock", "lockstep", "--hosting", "inline"]);
    assert_eq!(ended.code, Some(1), "{}", ended.stderr);
    assert!(ended.stderr.contains("component `left` is a `bridge.push`"), "{}", ended.stderr);
}

#[test]
fn program_on_the_path_is_queried_once_for_its_kinds() {
    let installed = Installed::new();
    link_or_copy(SIBLING, &installed.path("real"));
    let calls = installed.path("calls");
    let script =
        format!("echo \"$1\" >> {}; exec {} \"$@\"", calls.display(), installed.path("real").display());
    installed.script("bin/motorium-bridges", &script);
    let output = installed.motorium(&["check", "graph.toml"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let calls = std::fs::read_to_string(calls).unwrap();
    assert_eq!(calls, "motorium-kinds\nmotorium-describe\nmotorium-describe\n");
    let shown = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(shown.contains("bridge.push") && shown.contains("bin/motorium-bridges"), "{shown}");
}

#[test]
fn a_missing_program_is_named_with_its_installation() {
    let installed = Installed::new();
    let text = installed.complaint();
    assert!(
        text.contains("kind `bridge.push` belongs to the program `motorium-bridges`, which is not installed")
            && text.contains("graph.toml:4:8")
            && text.contains("`motorium-bridges` is neither in FOLDER nor on PATH")
            && text.contains("motorium does not include it; build a program `motorium-bridges`"),
        "{text}"
    );
    installed.graph("bridge.iceoryx", "");
    assert!(installed.complaint().contains("did you mean `bridge.iceoryx2`?"));
    installed.graph("nobody.push", "");
    assert!(installed.complaint().contains("unknown kind `nobody.push`"));
    for (kind, program) in [
        ("device.push", "motorium-devices"),
        ("ros2.push", "motorium-ros2"),
        ("zenoh.push", "motorium-zenoh"),
    ] {
        installed.graph(kind, "");
        let text = installed.complaint();
        assert!(text.contains(&format!("kind `{kind}` belongs to the program `{program}`")), "{text}");
    }
    installed.graph("view.push", "");
    let text = installed.complaint();
    assert!(
        text.contains("from a checkout of motorium: `cargo install --locked --path tools/view`"),
        "{text}"
    );
    let version = env!("CARGO_PKG_VERSION");
    let memory = installed.memory();
    installed.script(
        "motorium-view",
        &format!("echo '{{\"motorium\":\"{version}\",\"memory\":\"{memory}\",\"kinds\":[]}}'"),
    );
    let text = installed.complaint();
    assert!(
        text.contains("FOLDER/motorium-view has no kinds for graphs")
            && text.contains("name a built-in kind"),
        "{text}"
    );
}

#[test]
fn a_program_of_another_version_or_layout_is_refused() {
    let installed = Installed::new();
    installed.script("motorium-bridges", "echo '{\"motorium\":\"0.0.7\",\"memory\":\"\",\"kinds\":[]}'");
    let text = installed.complaint();
    assert!(
        text.contains("was built with motorium 0.0.7, expected motorium VERSION")
            && text.contains("graph.toml:4:8")
            && text.contains("build it again with motorium VERSION"),
        "{text}"
    );
    let version = env!("CARGO_PKG_VERSION");
    let answer = format!("{{\"motorium\":\"{version}\",\"memory\":\"0123\",\"kinds\":[]}}");
    installed.script("motorium-bridges", &format!("echo '{answer}'"));
    let text = installed.complaint();
    assert!(
        text.contains("lays out shared memory differently from this build of motorium VERSION"),
        "{text}"
    );
    installed.script("motorium-bridges", "echo 'what is motorium?' >&2; exit 3");
    let text = installed.complaint();
    assert!(
        text.contains("gave an invalid answer to `motorium-kinds`") && text.contains("what is motorium?"),
        "{text}"
    );
}

#[test]
fn configuration_mistakes_of_siblings_are_shown_in_the_file() {
    let installed = Installed::new();
    link_or_copy(SIBLING, &installed.path("motorium-bridges"));
    installed.graph("bridge.push", "force = 300.0");
    let text = installed.complaint();
    assert!(
        text.contains("`left.config.force`: 300 N, expected 0 to 100 N") && text.contains("graph.toml:8:20"),
        "{text}"
    );
    installed.graph("bridge.pusch", "force = 3.0");
    let text = installed.complaint();
    assert!(
        text.contains("unknown kind `bridge.pusch`")
            && text.contains("the kinds of FOLDER/motorium-bridges are `bridge.push`")
            && text.contains("did you mean `bridge.push`?"),
        "{text}"
    );
    // a path is relative to the folder of the file that contains it
    std::fs::create_dir(installed.path("below")).unwrap();
    std::fs::write(installed.path("below/there"), "").unwrap();
    let over = "extends = \"../graph.toml\"\n[component.left.config]\nfile = \"there\"\n";
    std::fs::write(installed.path("below/over.toml"), over).unwrap();
    installed.graph("bridge.push", "force = 3.0");
    let output = installed.motorium(&["check", "below/over.toml"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

#[test]
fn a_hosting_program_explains_itself_when_run_by_hand() {
    let output = Command::new(SIBLING).stdin(Stdio::null()).output().unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&output.stderr).contains("kind = \"bridge.push\""));
}
