//! Measurements of motorium against floors and peers: `cargo bench -p motorium-benches`.
