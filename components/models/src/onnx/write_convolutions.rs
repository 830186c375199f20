//! Writes networks with convolutions of images before their dense layers.

use super::proto::{Attribute, GraphProto, INT64, NodeProto, TensorProto};
use super::write::{act, activate, dense, integer, model, node, port, tensor};
use crate::inference::Unary;
use crate::networks::ConvolvedImage;

/// Attribute type of a list of integers in the format.
const INTEGERS: i32 = 7;

/// The layers before the dense layers of a network that observes images.
#[derive(Clone, Debug, PartialEq)]
pub struct ImageInput {
    /// Number that is subtracted from each observation first; one per observation.
    pub means: Vec<f32>,
    /// Factor of each difference; one per observation.
    pub factors: Vec<f32>,
    /// Images among the observations, in order, with their convolutions. ReLU follows each convolution.
    pub images: Vec<ConvolvedImage>,
}

fn integers(name: &str, values: &[usize]) -> Attribute {
    let ints = values.iter().map(|value| *value as i64).collect();
    Attribute { name: name.to_owned(), ints, kind: INTEGERS, ..Attribute::default() }
}

/// Adds a constant list of integers.
fn list(graph: &mut GraphProto, name: &str, values: &[i64]) {
    graph.initializer.push(TensorProto {
        dims: vec![values.len() as i64],
        data_type: INT64,
        name: name.to_owned(),
        raw_data: values.iter().flat_map(|value| value.to_le_bytes()).collect(),
        ..TensorProto::default()
    });
}

/// Adds a slice of the normalised observations; returns its name.
fn slice(graph: &mut GraphProto, first: usize, end: usize) -> String {
    let name = format!("normal_{first}_{end}");
    let [from, to] = [format!("{name}.first"), format!("{name}.end")];
    list(graph, &from, &[first as i64]);
    list(graph, &to, &[end as i64]);
    graph.node.push(node("Slice", &["normal", &from, &to, "columns"], &[&name]));
    name
}

/// Adds the convolutions of an image; returns the name of their flat output and its width.
fn convolve(graph: &mut GraphProto, image: &ConvolvedImage) -> (String, usize) {
    let Some(input) = image.layers.first().map(|layer| layer.shape) else { return (String::new(), 0) };
    let pixels = input.channels * input.size[0] * input.size[1];
    let flat = slice(graph, image.first, image.first + pixels);
    let mut name = format!("image_{}", image.first);
    let lengths = format!("{name}.shape");
    list(graph, &lengths, &[-1, input.channels as i64, input.size[0] as i64, input.size[1] as i64]);
    graph.node.push(node("Reshape", &[&flat, &lengths], &[&name]));
    let mut width = pixels;
    for (index, layer) in image.layers.iter().enumerate() {
        let shape = layer.shape;
        let output = format!("image_{}_{index}", image.first);
        let [weight, bias] = [format!("{output}.weight"), format!("{output}.bias")];
        let sizes = [shape.filters, shape.channels, shape.kernel[0], shape.kernel[1]];
        graph.initializer.push(tensor(&weight, &sizes, &layer.weights));
        graph.initializer.push(tensor(&bias, &[shape.filters], &layer.bias));
        let mut convolution: NodeProto = node("Conv", &[&name, &weight, &bias], &[&output]);
        convolution.attribute.extend([
            integers("kernel_shape", &shape.kernel),
            integers("strides", &[shape.stride; 2]),
            integers("pads", &[shape.padding; 4]),
        ]);
        graph.node.push(convolution);
        name = activate(graph, Unary::Relu, &output);
        width = shape.filters * shape.output_size().iter().product::<usize>();
    }
    let flat = format!("{name}_flat");
    let mut flatten = node("Flatten", &[&name], &[&flat]);
    flatten.attribute.push(integer("axis", 1));
    graph.node.push(flatten);
    (flat, width)
}

/// Returns the bytes of an ONNX file with convolutions of images, followed by dense layers on the flattened
/// results and all other observations. Inputs, outputs and layers are as for
/// [`write_mlp`](super::write_mlp); with a `table`, the output is a row of it, as for
/// [`write_choice`](super::write_choice).
///
/// # Panics
///
/// If there is no layer, or a table and the last layer has no output.
pub fn write_convolutions(
    input: &ImageInput,
    layers: &[(Vec<f32>, Vec<f32>)],
    activation: Unary,
    table: Option<&[f32]>,
    metadata: &[(&str, &str)],
) -> Vec<u8> {
    let inputs = input.means.len();
    let mut graph = GraphProto { name: "convolutions".to_owned(), ..GraphProto::default() };
    graph.initializer.push(tensor("means", &[inputs], &input.means));
    graph.initializer.push(tensor("factors", &[inputs], &input.factors));
    list(&mut graph, "columns", &[1]);
    graph.node.push(node("Sub", &["obs", "means"], &["centred"]));
    graph.node.push(node("Mul", &["centred", "factors"], &["normal"]));
    let (mut parts, mut width) = (Vec::new(), 0);
    for image in &input.images {
        let (name, count) = convolve(&mut graph, image);
        parts.push(name);
        width += count;
    }
    let mut end = 0;
    let images = input.images.iter().filter_map(|image| {
        let shape = image.layers.first()?.shape;
        Some((image.first, image.first + shape.channels * shape.size[0] * shape.size[1]))
    });
    for (first, next) in images.chain([(inputs, inputs)]) {
        if end < first {
            parts.push(slice(&mut graph, end, first));
            width += first - end;
        }
        end = next;
    }
    let names: Vec<&str> = parts.iter().map(String::as_str).collect();
    let mut joined = node("Concat", &names, &["features"]);
    joined.attribute.push(integer("axis", 1));
    graph.node.push(joined);
    let (last, outputs) = dense(&mut graph, ("features", width), layers, activation);
    let width = act(&mut graph, (&last, outputs), table);
    graph.input.push(port("obs", &[(0, "rows"), (inputs, "")]));
    graph.output.push(port("actions", &[(0, "rows"), (width, "")]));
    model(graph, metadata)
}
