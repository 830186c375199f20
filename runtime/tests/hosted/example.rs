//! The examples of the crate.

#[allow(dead_code, reason = "its `main`")]
#[path = "../../examples/hosted_graph.rs"]
mod hosted_graph;

#[test]
fn example_filter_is_a_first_order_low_pass() {
    let samples = hosted_graph::step_response().unwrap();
    assert_eq!(samples.len(), 50);
    // 1 - (tau / (tau + dt))^n after n steps
    for (n, sample) in samples.iter().enumerate() {
        let expected = 1.0 - (0.010_f64 / 0.011).powi(n as i32 + 1);
        assert!((sample.value.velocity()[0] - expected).abs() < 1e-12, "step {n}");
    }
}
