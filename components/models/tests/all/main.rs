//! Tests of the models against golden numbers from GPy, scikit-learn and hmmlearn (`tests/golden/golden.py`).

mod golden;
mod latent;
mod markov;
mod processes;
mod timing;
