//! Differences from the peers' numbers at the same parameters.

use motorium_benches::peers::Peer;
use motorium_models::gplvm::{LatentModel, Workspace};
use motorium_models::onnx::Model;

use crate::work::{self, LATENTS, OUTPUTS, POSES};

/// One comparison.
struct Row {
    name: &'static str,
    peer: &'static str,
    /// The line that requests the peer's numbers.
    line: String,
    ours: Vec<f64>,
    /// Largest difference that meets the target, relative to the largest number above 1.
    bound: f64,
}

/// Prints the largest difference of every comparison.
///
/// # Errors
/// If a peer does not answer with the expected number of values, as text.
pub(crate) fn print(peers: &mut [Peer]) -> Result<(), String> {
    let file = std::env::temp_dir().join(format!("motorium-agreement-{}.onnx", std::process::id()));
    std::fs::write(&file, work::network_file()).map_err(|error| error.to_string())?;
    let printed = print_rows(peers, &rows(&file.display().to_string()));
    let removed = std::fs::remove_file(&file).map_err(|error| error.to_string());
    printed.and(removed)
}

fn print_rows(peers: &mut [Peer], rows: &[Row]) -> Result<(), String> {
    println!("\nlargest difference from the peer, relative to its largest number above 1\n");
    println!("{:<22} {:<14} {:>8} {:>12} {:>9}", "", "peer", "numbers", "difference", "target");
    for row in rows {
        let peer = peers.iter_mut().find(|peer| peer.name() == row.peer);
        let theirs = peer.ok_or_else(|| format!("no peer {}", row.peer))?.values(&row.line)?;
        let difference = difference(&row.ours, &theirs).ok_or_else(|| {
            format!(
                "{}: {} answers {} numbers, expected {}",
                row.name,
                row.peer,
                theirs.len(),
                row.ours.len()
            )
        })?;
        let verdict = if difference <= row.bound { "met" } else { "missed" };
        println!(
            "{:<22} {:<14} {:>8} {difference:>12.1e} {:>9.0e}  {verdict}",
            row.name,
            row.peer,
            row.ours.len(),
            row.bound
        );
    }
    Ok(())
}

/// Returns the largest difference; `None` if the numbers of values differ.
fn difference(ours: &[f64], theirs: &[f64]) -> Option<f64> {
    let scale = theirs.iter().fold(1.0_f64, |most, value| most.max(value.abs()));
    let largest = ours.iter().zip(theirs).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    (ours.len() == theirs.len()).then_some(largest / scale)
}

fn rows(network: &str) -> Vec<Row> {
    let (x, y) = (work::values(POSES, LATENTS, 0.4), work::values(POSES, OUTPUTS, 0.1));
    let (energy, by_points, by_parameters) =
        LatentModel::energy(&x, &y, &work::PARAMETERS, &mut Workspace::default()).expect("an energy");
    let (model, sequence) = work::markov();
    let likelihood = model.log_likelihood(&sequence).expect("a likelihood");
    let path = model.viterbi(&sequence).expect("a path").1;
    let row = |name, peer, ours, bound| Row { name, peer, line: format!("values {name}"), ours, bound };
    vec![
        Row {
            line: format!("values mlp_outputs {network}"),
            ..row("mlp_outputs", "onnxruntime", outputs(), 1e-5)
        },
        row("gplvm_energy", "GPy", vec![energy], 1e-8),
        row("gplvm_gradients", "GPy", [by_points, by_parameters].concat(), 1e-8),
        row("hmm_log_likelihood", "hmmlearn", vec![likelihood], 1e-8),
        row("hmm_viterbi", "hmmlearn", path.iter().map(|state| *state as f64).collect(), 0.0),
    ]
}

/// Outputs of the network for the observation of the peers.
fn outputs() -> Vec<f64> {
    let program = Model::read(&work::network_file()).and_then(|model| model.program(1));
    let mut program = program.expect("a network");
    work::observe(program.input_mut(0));
    program.run();
    program.output(0).iter().map(|value| f64::from(*value)).collect()
}
