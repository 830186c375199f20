//! Tests of the models against independent references.

mod onnx;
