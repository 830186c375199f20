//! Declarations of components: their inputs, and their warnings with positions.

use std::path::Path;

use motorium::component::{Component, ConfigureError, Setup, Tick};
use motorium::declare::{ClockKind, ConfigError, Declare, StepError};
use motorium::graph::{self, Checked};
use motorium::plan::SchedulingClass;
use motorium::state::Wrench;
use motorium::worker::{Kind, Registry, RobotSource};
use schemars::JsonSchema;
use serde::Deserialize;

use super::machine;

#[derive(Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
struct SurveyorConfig {
    /// Smallest period without a warning, ms.
    least_period_ms: u64,
    /// A file.
    map: Option<String>,
    /// Duration of its declaration, ms.
    slow_ms: u64,
    /// Reason why it cannot keep deadlines.
    not_real_time: Option<String>,
}

/// Names a port after its placement in the graph.
struct Surveyor;

impl Component for Surveyor {
    const KIND: &'static str = "test.surveyor";
    const SUMMARY: &'static str = "declares its placement";
    type Config = SurveyorConfig;

    fn declare(config: &SurveyorConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        std::thread::sleep(std::time::Duration::from_millis(config.slow_ms));
        let period_us = declare.period().map(|period| period.as_micros() as u64);
        let clock = match declare.clock() {
            ClockKind::Realtime => "real",
            ClockKind::Lockstep => "lockstep",
        };
        let name = format!("{clock}-{}", period_us.map_or("unknown".to_string(), |us| us.to_string()));
        if let Some(map) = &config.map {
            let path = declare.folder().join(map);
            if !path.is_file() {
                declare.warn(format!("there is no map at {}", path.display())).key("map").advise("draw one");
            }
        }
        if period_us.is_some_and(|us| us < 1_000 * config.least_period_ms) {
            declare.warn("it steps more often than it need");
        }
        if let Some(reason) = &config.not_real_time {
            declare.not_real_time(reason);
        }
        declare.optional_input::<Wrench>("in", "input");
        declare.output::<Wrench>("out", "output");
        declare.output::<Wrench>(&name, "its placement");
        Ok(())
    }

    fn configure(_: SurveyorConfig, _: &mut Setup) -> Result<Self, ConfigureError> {
        Err(ConfigureError::failed("this kind is only there to be checked"))
    }

    fn step(&mut self, _: &Tick) -> Result<(), StepError> {
        Err(StepError::failed("this kind is only there to be checked"))
    }
}

fn check_at(path: &Path, text: &str) -> Checked {
    let registry = Registry::new(RobotSource { check: |_| Ok(Vec::new()) }, [Kind::of::<Surveyor>()]);
    let checked = graph::check(path, text.to_string(), &[], &registry, &machine());
    checked.unwrap_or_else(|error| panic!("{}", error.render(false)))
}

fn check(text: &str) -> Checked {
    check_at(Path::new("graph.toml"), text)
}

/// Returns the ports that show the placement of each component.
fn declared_ports(checked: &Checked) -> Vec<String> {
    let last =
        |component: &motorium::plan::ComponentPlan| component.outputs.last().map(|port| port.port.clone());
    checked.plan.components.iter().filter_map(last).collect()
}

#[test]
fn component_knows_its_period_at_the_end_of_a_chain() {
    let text = r#"
        name = "chain"
        [component.third]
        kind = "test.surveyor"
        trigger = "b"
        subscribe = { in = "b" }
        [component.second]
        kind = "test.surveyor"
        trigger = "a"
        subscribe = { in = "a" }
        publish = { out = "b" }
        [component.first]
        kind = "test.surveyor"
        rate = "400 Hz"
        publish = { out = "a" }
    "#;
    assert_eq!(declared_ports(&check(text)), ["real-2500", "real-2500", "real-2500"]);
    let lockstep = check(&text.replace("name = \"chain\"", "name = \"chain\"\nclock = \"lockstep\""));
    assert_eq!(declared_ports(&lockstep), ["lockstep-2500", "lockstep-2500", "lockstep-2500"]);
    for component in &lockstep.plan.components {
        assert_eq!(component.period_ns(), 2_500_000, "as resolved after the declarations");
    }
}

#[test]
fn component_that_is_not_real_time_is_normal() {
    let text = |schedule: &str| {
        format!(
            r#"
        name = "script"
        [component.script]
        kind = "test.surveyor"
        rate = "100 Hz"
        {schedule}
        publish = {{ out = "a" }}
        config = {{ not_real_time = "its interpreter collects garbage" }}
        [component.middle]
        kind = "test.surveyor"
        rate = "100 Hz"
        schedule = "normal"
        subscribe = {{ in = "a" }}
        publish = {{ out = "b" }}
        [component.last]
        kind = "test.surveyor"
        rate = "100 Hz"
        subscribe = {{ in = "b" }}
    "#
        )
    };
    let warned = |checked: &Checked| {
        let warnings = checked.warnings.iter().map(|warning| warning.render(false)).collect::<Vec<_>>();
        warnings.into_iter().find(|warning| warning.contains("is not real-time: its interpreter"))
    };
    let class = |checked: &Checked| checked.plan.components[0].class;
    let by_default = check(&text(""));
    let warning = warned(&by_default).expect("a warning");
    assert!(warning.contains("real-time components that depend on it: `last`"), "{warning}");
    assert_eq!(class(&by_default), SchedulingClass::Normal);
    let accepted = check(&text("schedule = \"normal\""));
    assert!(warned(&accepted).is_none());
    let insists = check(&text("schedule = \"fifo\""));
    assert!(warned(&insists).is_some_and(|warning| warning.contains("requests a real-time class")));
    assert!(matches!(class(&insists), SchedulingClass::Fifo(_)));
    let simulated = check(&text("").replace("name = \"script\"", "name = \"script\"\nclock = \"lockstep\""));
    assert!(warned(&simulated).is_none(), "nothing has a deadline");
}

#[test]
fn component_without_a_known_period_is_still_declared() {
    let text = r#"
        name = "loop"
        [component.one]
        kind = "test.surveyor"
        trigger = "a"
        subscribe = { in = "a" }
        publish = { out = "b" }
        [component.two]
        kind = "test.surveyor"
        trigger = "b"
        subscribe = { in = "b" }
        publish = { out = "a" }
    "#;
    let registry = Registry::new(RobotSource { check: |_| Ok(Vec::new()) }, [Kind::of::<Surveyor>()]);
    let error =
        graph::check(Path::new("graph.toml"), text.to_string(), &[], &registry, &machine()).unwrap_err();
    let text = error.render(false);
    assert!(text.contains("trigger loop") && !text.contains("surveyor"), "{text}");
}

#[test]
fn component_warning_is_shown_at_its_key_or_component() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("graph.toml");
    let text = "name = \"doubts\"\n[component.mine]\nkind = \"test.surveyor\"\nrate = \"1 kHz\"\n\
                publish = { out = \"a\" }\nconfig = { least_period_ms = 5, map = \"hall.png\" }\n";
    let warnings = check_at(&path, text).warnings;
    let reports: Vec<_> = warnings.iter().map(|warning| warning.report()).collect();
    let ours: Vec<_> =
        reports.iter().filter(|report| report.label == "`test.surveyor` warns about this").collect();
    let place = |line, column| (Some(line), Some(column));
    assert_eq!((ours[0].line, ours[0].column), place(2, 12));
    assert_eq!(ours[0].message, "component `mine`: it steps more often than it need");
    assert_eq!((ours[1].line, ours[1].column), place(6, 39));
    let expected =
        format!("`mine.config.map`: there is no map at {}", folder.path().join("hall.png").display());
    assert_eq!((ours[1].message.as_str(), ours[1].advice.as_deref()), (expected.as_str(), Some("draw one")));
    std::fs::write(folder.path().join("hall.png"), "").expect("a file");
    let text = check_at(&path, text).warnings.iter().map(|warning| warning.render(false)).collect::<String>();
    assert!(!text.contains("no map"), "relative to the graph file: {text}");
}

#[test]
fn declaration_times_are_measured() {
    let text = "name = \"times\"\n[component.quick]\nkind = \"test.surveyor\"\nrate = \"1 kHz\"\npublish = { out = \"a\" }\n\
                [component.slow]\nkind = \"test.surveyor\"\nrate = \"1 kHz\"\npublish = { out = \"b\" }\nconfig = { slow_ms = 30 }\n";
    let declared = check(text).declared;
    assert_eq!(declared.iter().map(|time| time.component.as_str()).collect::<Vec<_>>(), ["quick", "slow"]);
    assert!(declared[1].wall_ns >= 30_000_000 && declared[1].wall_ns > declared[0].wall_ns, "{declared:?}");
}

/// Gravity in the configuration.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct FallerConfig {
    /// m/s2.
    #[serde(default = "own")]
    gravity: [f64; 3],
}

fn own() -> [f64; 3] {
    [0.0, 0.0, -9.5]
}

/// Names a port after its gravity.
struct Faller;

impl Component for Faller {
    const KIND: &'static str = "test.faller";
    const SUMMARY: &'static str = "uses gravity";
    const READS_GRAVITY: bool = true;
    type Config = FallerConfig;

    fn declare(config: &FallerConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        declare.output::<Wrench>("out", "output");
        declare.output::<Wrench>(&format!("g{}", config.gravity[2].abs()), "its gravity");
        Ok(())
    }

    fn configure(_: FallerConfig, _: &mut Setup) -> Result<Self, ConfigureError> {
        Err(ConfigureError::failed("this kind is only there to be checked"))
    }

    fn step(&mut self, _: &Tick) -> Result<(), StepError> {
        Err(StepError::failed("this kind is only there to be checked"))
    }
}

/// Reads a file with one number.
fn downwards(path: &Path) -> Result<[f64; 3], ConfigError> {
    let text = std::fs::read_to_string(path).map_err(|_| ConfigError::new("there is no such world"))?;
    Ok([0.0, 0.0, -text.trim().parse::<f64>().expect("a number")])
}

#[test]
fn kind_that_reads_gravity_gets_it_from_the_world_file() {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("moon.txt"), "1.62").expect("written");
    let path = folder.path().join("graph.toml");
    let text = |world: &str, config: &str| {
        let component = |name: &str| {
            format!(
                "[component.{name}]\nkind = \"test.faller\"\nrate = \"1 kHz\"\npublish = {{ out = \"{name}\" }}\nconfig = {{ {config} }}\n"
            )
        };
        format!("name = \"fall\"\n{}{}[world]\n{world}\n", component("one"), component("two"))
    };
    let plain = || Registry::new(RobotSource { check: |_| Ok(Vec::new()) }, [Kind::of::<Faller>()]);
    let check = |registry: &Registry, text: String| graph::check(&path, text, &[], registry, &machine());
    let gravities = |registry: &Registry, text: String| {
        declared_ports(&check(registry, text).unwrap_or_else(|error| panic!("{}", error.render(false))))
    };
    let reading = plain().with_gravity_of_file(downwards);
    let file = "file = \"moon.txt\"";
    assert_eq!(gravities(&reading, text(file, "")), ["g1.62", "g1.62"]);
    assert_eq!(gravities(&reading, text(file, "gravity = [0.0, 0.0, -3.7]")), ["g3.7", "g3.7"]);
    assert_eq!(gravities(&reading, text(&format!("{file}\ngravity = [0, 0, -5.0]"), "")), ["g5", "g5"]);
    // A missing file is reported once, at its position.
    let missing = check(&reading, text("file = \"mars.txt\"", "")).map(|_| ()).unwrap_err().render(false);
    assert_eq!(missing.matches("there is no such world").count(), 1, "{missing}");
    assert!(missing.contains("graph.toml:13:"), "{missing}");
    // A program without a reader keeps the defaults of its kinds, with a warning.
    let checked = check(&plain(), text(file, "")).unwrap_or_else(|error| panic!("{}", error.render(false)));
    assert_eq!(declared_ports(&checked), ["g9.5", "g9.5"]);
    let warned = |warning: &graph::Diagnostic| {
        warning.report().message.contains("component `one` cannot read the gravity")
    };
    assert!(checked.warnings.iter().any(warned));
}
