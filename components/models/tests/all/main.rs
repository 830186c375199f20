//! Tests of the models against independent references: golden numbers from GPy, scikit-learn and hmmlearn
//! (`tests/golden/golden.py`), from PyTorch (`tests/golden/encoder.py`), and from onnxruntime.

mod approximators;
mod encoder;
mod golden;
mod latent;
mod markov;
mod onnx;
mod processes;
