//! Graphs of absurd size, which are refused or checked in linear time.

use std::time::Duration;

use motorium::graph::check;
use motorium::os::thread_cpu_ns;

use super::{good, kinds, load, machine};

/// Returns the errors of a text and the CPU time of the check, which excludes other programs.
fn errors(text: String) -> (Vec<String>, String, Duration) {
    let started = thread_cpu_ns();
    let error =
        check(&good("panda-reach"), text, &[], &kinds::registry(), &machine()).expect_err("a broken graph");
    let rendered = error.render(false);
    let messages = error.diagnostics().iter().map(|diagnostic| diagnostic.message().to_string()).collect();
    (messages, rendered, Duration::from_nanos(thread_cpu_ns() - started))
}

#[test]
fn five_of_many_syntax_errors_are_shown_and_the_rest_counted() {
    let (messages, rendered, _) = errors("[[a]]x\n".repeat(5_027));
    assert_eq!(messages.len(), 6, "{messages:?}");
    assert_eq!(messages[5], "and 5,022 more errors");
    assert!(rendered.ends_with(&format!("5027 errors in {}\n", good("panda-reach").display())), "{rendered}");
    // One error more than five is shown, because a line with its count would be no shorter.
    let (messages, ..) = errors("[[a]]x\n".repeat(6));
    assert_eq!(messages.len(), 6);
    assert!(!messages[5].contains("more"), "{messages:?}");
}

/// Asserts by the exponent of growth, in the best of three, that the time grows much less than quadratically
/// with the length.
fn grows_like_its_length(text: impl Fn(usize) -> String, short: usize) {
    const TIMES: usize = 8;
    let took = |size: usize| (0..3).map(|_| errors(text(size)).2).min().expect("three of them").as_secs_f64();
    let (small, large) = (took(short), took(short * TIMES));
    let exponent = (large / small).ln() / (TIMES as f64).ln();
    assert!(exponent < 1.5, "{small:.3} s for {short}, {large:.3} s for {TIMES} times as many");
}

#[test]
fn syntax_errors_are_reported_in_linear_time() {
    grows_like_its_length(|count| "[[a]]x\n".repeat(count), 1_000);
    grows_like_its_length(|count| "<a> ".repeat(count), 1_000);
}

#[test]
fn other_errors_are_reported_in_linear_time() {
    let unknown = |count: usize| {
        (0..count).map(|i| format!("[component.c{i}]\nkind = \"no.such\"\nrate = 3\n")).collect::<String>()
    };
    grows_like_its_length(unknown, 100);
}

#[test]
fn graph_with_too_many_components_is_refused_early() {
    let many = |count: usize| {
        let component = |i| format!("[component.c{i}]\nkind = \"sensor.joint_encoder\"\nrate = \"1 Hz\"\n");
        format!("name = \"many\"\n{}", (0..count).map(component).collect::<String>())
    };
    let (messages, rendered, _) = errors(many(2_000));
    assert!(messages.iter().any(|message| message == "the graph has 2000 components"), "{rendered}");
    assert!(rendered.contains("c512") && rendered.contains("expected at most 512"), "{rendered}");
}

#[test]
fn very_long_name_is_not_repeated_in_full() {
    let (messages, rendered, _) = errors(format!("name = \"{}\"\n", "A".repeat(1_000_000)));
    assert!(messages.iter().all(|message| message.len() < 2_000), "{}", messages[0].len());
    assert!(rendered.len() < 20_000, "{} bytes", rendered.len());
}

#[test]
fn absurdly_large_number_is_refused() {
    for number in ["1e308", "-1e16", "1e300"] {
        let path = "component.policy.config.number".to_string();
        let setting = motorium::graph::Override { path, value: number.to_string() };
        let error =
            motorium::graph::load_for(&good("everything"), &[setting], &kinds::registry(), &machine())
                .expect_err("an absurd number");
        assert!(
            error.render(false).contains("expected a number between -1e15 and 1e15"),
            "{}",
            error.render(false)
        );
    }
}

#[test]
fn special_files_are_refused_immediately() {
    for path in ["/dev/zero", "/dev/full", "/dev"] {
        let error = load(std::path::Path::new(path)).expect_err("no graph");
        assert!(error.render(false).contains("expected a regular file"), "{}", error.render(false));
    }
}
