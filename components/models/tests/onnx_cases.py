"""Generates the fixtures of the ONNX tests: models, inputs, and the outputs of onnxruntime.

    pip install onnx onnxruntime numpy
    python components/models/tests/onnx_cases.py operators components/models/tests/all/operators.json
    python components/models/tests/onnx_cases.py networks components/models/tests/all/networks.json.zlib 200

Numbers of networks have 8 bits of precision, to keep the file of 200 networks small. Networks for which onnxruntime
differs by more than 1e-6 from an evaluation in double precision are omitted: they amplify rounding errors.
"""

import json
import sys
import zlib

import numpy as np
import onnx
import onnxruntime
from onnx import TensorProto, helper, numpy_helper
from onnx.reference import ReferenceEvaluator

random = np.random.default_rng(38)


def real(*shape, scale=1.0):
    return (scale * random.standard_normal(shape)).astype(np.float32)


def short(*shape, scale=1.0):
    """Returns random numbers that are exact with 8 bits of precision."""
    numbers = real(*shape, scale=scale).view(np.uint32)
    return ((numbers + 0x8000) & 0xFFFF0000).astype(np.uint32).view(np.float32)


def case(name, nodes, inputs, constants=(), outputs=("y",), opset=17):
    """Creates a model from these nodes and runs it with onnxruntime. Inputs and constants: pairs of a name and an array."""
    graph = helper.make_graph(
        nodes,
        name,
        [helper.make_tensor_value_info(n, TensorProto.FLOAT, list(v.shape)) for n, v in inputs],
        [helper.make_tensor_value_info(n, TensorProto.FLOAT, None) for n in outputs],
        [numpy_helper.from_array(v, n) for n, v in constants],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", opset)], ir_version=8)
    options = onnxruntime.SessionOptions()
    options.graph_optimization_level = onnxruntime.GraphOptimizationLevel.ORT_DISABLE_ALL
    options.log_severity_level = 3
    session = onnxruntime.InferenceSession(model.SerializeToString(), options, providers=["CPUExecutionProvider"])
    found = session.run(list(outputs), dict(inputs))
    tensor = lambda v: {"shape": list(v.shape), "values": [float(x) for x in np.asarray(v, np.float32).ravel()]}
    return {
        "name": name,
        "model": model.SerializeToString().hex(),
        "inputs": [tensor(v) for _, v in inputs],
        "outputs": [tensor(v) for v in found],
    }


def node(operator, inputs, outputs="y", **attributes):
    split = lambda names: names.split(",") if isinstance(names, str) else names
    return helper.make_node(operator, split(inputs), split(outputs), **attributes)


def integers(*values):
    return np.array(values, np.int64)


def operators():
    x, m = ("x", real(2, 3, 4)), ("x", real(3, 5))
    for name in ["Relu", "Tanh", "Sigmoid", "Softplus", "Identity", "Softsign"]:
        yield case(name, [node(name, "x")], [("x", real(2, 3, 4, scale=3.0))])
    yield case("Elu", [node("Elu", "x", alpha=0.7)], [x])
    yield case("LeakyRelu", [node("LeakyRelu", "x", alpha=0.2)], [x])
    yield case("Sqrt", [node("Sqrt", "x")], [("x", np.abs(real(7)))])
    yield case("Clip", [node("Clip", "x,low,high")], [x], [("low", np.float32(-0.5)), ("high", np.float32(0.25))])
    yield case("Clip one side", [node("Clip", "x,,high")], [x], [("high", np.float32(0.25))])
    yield case("Clip 6", [node("Clip", "x", min=-0.5, max=0.1)], [x], opset=7)
    for name in ["Add", "Sub", "Mul", "Div"]:
        yield case(name, [node(name, "x,b")], [x, ("b", real(2, 3, 4) + 3)])
        yield case(name + " stretched", [node(name, "x,b")], [x, ("b", real(3, 1) + 3)])
        yield case(name + " constant", [node(name, "x,b")], [x], [("b", real(4) + 3)])
        yield case(name + " scalar", [node(name, "b,x")], [("x", real(2, 3) + 5)], [("b", np.float32(2.5))])
    yield case("Pow", [node("Pow", "x,b")], [("x", np.abs(real(3, 4)) + 0.1), ("b", real(4))])
    yield case("Pow 2", [node("Pow", "x,b")], [x], [("b", np.float32(2))])
    for a in (0, 1):
        for b in (0, 1):
            yield case(
                f"Gemm {a}{b}",
                [node("Gemm", "x,w,c", transA=a, transB=b, alpha=0.5, beta=1.5)],
                [("x", real(*((5, 3) if a else (3, 5))))],
                [("w", real(*((7, 5) if b else (5, 7)))), ("c", real(7))],
            )
    yield case("Gemm computed", [node("Gemm", "x,w,c", transB=1)], [m, ("w", real(4, 5)), ("c", real(3, 1))])
    yield case("Gemm no bias", [node("Gemm", "x,w")], [m], [("w", real(5, 130))])
    yield case("Gemm scalar bias", [node("Gemm", "x,w,c", beta=0.5)], [m], [("w", real(5, 6)), ("c", real(1))])
    yield case("Gemm matrix bias", [node("Gemm", "x,w,c", beta=0.5)], [m], [("w", real(5, 6)), ("c", real(3, 6))])
    yield case("MatMul", [node("MatMul", "x,w")], [x], [("w", real(4, 6))])
    yield case("MatMul vector", [node("MatMul", "x,w")], [x], [("w", real(4))])
    yield case("MatMul row", [node("MatMul", "x,w")], [("x", real(4))], [("w", real(4, 3))])
    yield case("MatMul stacked", [node("MatMul", "x,w")], [("x", real(2, 1, 3, 4)), ("w", real(5, 4, 2))])
    yield case("MatMul weights left", [node("MatMul", "w,x")], [x], [("w", real(2, 5, 3))])
    yield case("Constant", [node("Constant", [], "c", value_floats=[1.0, 2.0]), node("Add", "x,c")], [("x", real(3, 2))])
    value = numpy_helper.from_array(real(4))
    yield case("Constant tensor", [node("Constant", [], "c", value=value), node("Mul", "x,c")], [x])
    yield case("Cast", [node("Cast", "x", "z", to=TensorProto.DOUBLE), node("Cast", "z", to=TensorProto.FLOAT)], [x])
    shaped = [
        node("Shape", "x", "s"),
        node("Gather", "s,zero", "n", axis=0),
        node("Unsqueeze", "n,axes", "u"),
        node("Concat", "u,rest", "shape", axis=0),
        node("Reshape", "x,shape"),
    ]
    constants = [("zero", np.int64(0)), ("axes", integers(0)), ("rest", integers(-1))]
    yield case("Shape folded", shaped, [x], constants)
    halves = [node("Shape", "x", "s", start=1), node("Cast", "s", "f", to=TensorProto.FLOAT), node("Div", "x,f")]
    yield case("Shape cast", halves, [("x", real(2, 3, 2))])
    counted = [node("Shape", "x", "s"), node("Mul", "s,t", "d"), node("Div", "d,t", "e"), node("Expand", "o,e")]
    yield case("Expand folded", counted, [("x", real(2, 3)), ("o", real(3))], [("t", integers(2))])
    yield case("Concat", [node("Concat", "x,b,c", axis=1)], [x, ("b", real(2, 2, 4))], [("c", real(2, 1, 4))])
    yield case("Concat last", [node("Concat", "x,b", axis=-1)], [x, ("b", real(2, 3, 1))])
    sliced = [("s", integers(1, -1)), ("e", integers(3, -9)), ("a", integers(1, 2)), ("t", integers(1, -2))]
    yield case("Slice", [node("Slice", "x,s,e,a,t")], [x], sliced)
    yield case("Slice 9", [node("Slice", "x", starts=[0, 1], ends=[9, -1], axes=[0, 2])], [x], opset=9)
    yield case("Split", [node("Split", "x,s", "y,z", axis=2)], [x], [("s", integers(1, 3))], ("y", "z"))
    yield case("Split even", [node("Split", "x", "y,z", axis=2)], [x], outputs=("y", "z"))
    yield case("Split uneven", [node("Split", "x", "y,z", axis=1, num_outputs=2)], [x], outputs=("y", "z"), opset=18)
    yield case("Gather", [node("Gather", "x,i", axis=1)], [x], [("i", np.array([[2, 0], [-1, 1]], np.int64))])
    yield case("Gather one", [node("Gather", "x,i", axis=2)], [x], [("i", np.int64(3))])
    yield case("Reshape", [node("Reshape", "x,s")], [x], [("s", integers(0, 2, -1))])
    yield case("Flatten", [node("Flatten", "x", axis=2)], [x])
    yield case("Transpose", [node("Transpose", "x", perm=[2, 0, 1])], [x])
    yield case("Transpose reversed", [node("Transpose", "x")], [x])
    weights = [node("Transpose", "w", "t", perm=[1, 0]), node("MatMul", "x,t")]
    yield case("Transpose folded", weights, [x], [("w", real(6, 4))])
    yield case("Squeeze", [node("Squeeze", "x,a")], [("x", real(2, 1, 3, 1))], [("a", integers(-1))])
    yield case("Squeeze all", [node("Squeeze", "x")], [("x", real(2, 1, 3, 1))])
    yield case("Squeeze 11", [node("Squeeze", "x", axes=[1])], [("x", real(2, 1, 3, 1))], opset=11)
    yield case("Unsqueeze", [node("Unsqueeze", "x,a")], [m], [("a", integers(0, -1))])
    yield case("Unsqueeze 11", [node("Unsqueeze", "x", axes=[0, 2])], [m], opset=11)
    yield case("Expand", [node("Expand", "x,s")], [("x", real(3, 1))], [("s", integers(2, 1, 4))])
    yield case("ReduceMean", [node("ReduceMean", "x", axes=[1])], [x])
    yield case("ReduceMean all", [node("ReduceMean", "x", keepdims=0)], [x])
    yield case("ReduceMean 18", [node("ReduceMean", "x,a", keepdims=0)], [x], [("a", integers(0, -1))], opset=18)
    scale = [("s", real(4)), ("b", real(4))]
    yield case("LayerNormalization", [node("LayerNormalization", "x,s,b", epsilon=1e-3)], [x], scale)
    yield case("LayerNormalization axis", [node("LayerNormalization", "x,s", axis=1)], [x], [("s", real(3, 4))])
    batch = [("s", real(3)), ("b", real(3)), ("m", real(3)), ("v", np.abs(real(3)) + 0.1)]
    yield case("BatchNormalization", [node("BatchNormalization", "x,s,b,m,v")], [x], batch)
    yield case("BatchNormalization rows", [node("BatchNormalization", "x,s,b,m,v")], [("x", real(5, 3))], batch)
    image = ("x", real(2, 4, 7, 6))
    for name, shape, attributes in [
        ("plain", (5, 4, 3, 3), {}),
        ("padded", (5, 4, 3, 2), {"pads": [1, 0, 2, 1], "strides": [2, 1]}),
        ("dilated", (5, 4, 2, 2), {"dilations": [2, 3]}),
        ("grouped", (6, 2, 3, 3), {"group": 2}),
        ("depthwise", (4, 1, 3, 3), {"group": 4, "pads": [1, 1, 1, 1]}),
        ("same", (5, 4, 3, 2), {"auto_pad": "SAME_UPPER", "strides": [2, 2]}),
        ("same lower", (5, 4, 2, 2), {"auto_pad": "SAME_LOWER"}),
    ]:
        yield case("Conv " + name, [node("Conv", "x,w,b", **attributes)], [image], [("w", real(*shape)), ("b", real(shape[0]))])
    yield case("Conv line", [node("Conv", "x,w", pads=[1, 1])], [("x", real(1, 3, 9))], [("w", real(20, 3, 3))])
    yield case("MaxPool", [node("MaxPool", "x", kernel_shape=[2, 2], strides=[2, 2])], [image])
    yield case("MaxPool padded", [node("MaxPool", "x", kernel_shape=[3, 3], pads=[1, 1, 1, 1], strides=[2, 2], ceil_mode=1)], [image])
    yield case("GlobalAveragePool", [node("GlobalAveragePool", "x")], [image])
    yield case("Softmax", [node("Softmax", "x", axis=1)], [x])
    yield case("Softmax 11", [node("Softmax", "x", axis=1)], [x], opset=11)
    for operator, gates in (("GRU", 3), ("LSTM", 4)):
        for direction, count in (("forward", 1), ("reverse", 1), ("bidirectional", 2)):
            for before in (0, 1) if operator == "GRU" else (None,):
                hidden, sequence = 5, real(4, 2, 3)
                constants = [("w", real(count, gates * hidden, 3)), ("r", real(count, gates * hidden, hidden))]
                constants.append(("b", real(count, 2 * gates * hidden)))
                inputs = [("x", sequence), ("h", real(count, 2, hidden))]
                names, outputs = ["x", "w", "r", "b", "", "h"], ["y", "last"]
                if operator == "LSTM":
                    names, inputs, outputs = names + ["c"], inputs + [("c", real(count, 2, hidden))], outputs + ["cell"]
                attributes = {} if before is None else {"linear_before_reset": before}
                unit = node(operator, names, outputs, hidden_size=hidden, direction=direction, **attributes)
                yield case(f"{operator} {direction} {before}", [unit], inputs, constants, outputs)
    start = [node("GRU", "x,w,r", "y", hidden_size=4)]
    yield case("GRU from zero", start, [("x", real(3, 2, 3))], [("w", real(1, 12, 3)), ("r", real(1, 12, 4))])
    x = np.array([[1.0, 3.0, 2.0], [-1.0, -3.0, -2.0], [2.0, 2.0, 1.0]], dtype=np.float32)
    yield case("Hardmax", [node("Hardmax", "x", axis=1)], [("x", x)])
    yield case("Hardmax last", [node("Hardmax", "x")], [("x", real(2, 3, 4))])
    x = ("x", real(2, 3, 4))
    for name in ["Min", "Max"]:
        yield case(name, [node(name, "x,b")], [x, ("b", real(2, 3, 4))])
        yield case(name + " stretched", [node(name, "x,b")], [x, ("b", real(3, 1))])
        yield case(name + " constant", [node(name, "x,b")], [x], [("b", real(4))])
        yield case(name + " scalar", [node(name, "b,x")], [x], [("b", np.float32(0.1))])
    yield case("Neg", [node("Neg", "x")], [x])


def network(index):
    """Returns a random network of the operators, from a row of observations to actions."""
    nodes, constants = [], []
    rows, width = int(random.integers(1, 4)), int(random.integers(2, 9))
    x, name = short(rows, width), "x"

    def constant(value):
        constants.append((f"c{len(constants)}", value))
        return constants[-1][0]

    def add(operator, inputs, **attributes):
        output = f"v{len(nodes)}"
        nodes.append(node(operator, inputs, output, **attributes))
        return output

    def dense(name, width):
        new = int(random.integers(2, 12))
        if random.random() < 0.6:
            w = short(new, width, scale=width**-0.5)
            return add("Gemm", [name, constant(w), constant(short(new))], transB=1), new
        product = add("MatMul", [name, constant(short(width, new, scale=width**-0.5))])
        return add("Add", [product, constant(short(new))]), new

    if random.random() < 0.5:
        centred = add("Sub", [name, constant(short(1, width))])
        spread = add("Sqrt", [constant(np.abs(short(width)) + np.float32(0.125))])
        name = add("Div", [centred, spread])
        name = add("Clip", [name, constant(np.float32(-5)), constant(np.float32(5))])
    for _ in range(int(random.integers(1, 6))):
        kind = random.integers(16)
        if kind <= 2:
            name, width = dense(name, width)
            name = add(str(random.choice(["Elu", "Relu", "Tanh", "Sigmoid", "Softplus", "LeakyRelu"])), [name])
        elif kind == 3:
            name = add("LayerNormalization", [name, constant(short(width)), constant(short(width))])
        elif kind == 4:
            other, more = dense(name, width)
            name, width = add("Concat", [name, other], axis=1), width + more
        elif kind == 5:
            first = add("Slice", [name, constant(integers(0)), constant(integers(width // 2)), constant(integers(1))])
            rest = add("Slice", [name, constant(integers(width // 2)), constant(integers(width)), constant(integers(1))])
            name = add("Concat", [rest, first], axis=-1)
        elif kind == 6:
            hidden = int(random.integers(2, 7))
            unit, gates = (("GRU", 3), ("LSTM", 4))[int(random.integers(2))]
            sequence = add("Unsqueeze", [name, constant(integers(0))])
            w, r = short(1, gates * hidden, width, scale=0.5), short(1, gates * hidden, hidden, scale=0.5)
            attributes = {"linear_before_reset": 1} if unit == "GRU" else {}
            states = add(unit, [sequence, constant(w), constant(r), constant(short(1, 2 * gates * hidden))], hidden_size=hidden, **attributes)
            name, width = add("Reshape", [states, constant(integers(rows, hidden))]), hidden
        elif kind == 7:
            image = add("Reshape", [name, constant(integers(rows, 1, 1, width))])
            channels = int(random.integers(1, 4))
            image = add("Conv", [image, constant(short(channels, 1, 1, 2)), constant(short(channels))], pads=[0, 0, 0, 1])
            image = add("MaxPool", [image], kernel_shape=[1, 2], strides=[1, 2])
            if width < 2:
                continue
            name, width = add("Flatten", [image]), channels * (width // 2)
        elif kind == 8:
            image = add("Reshape", [name, constant(integers(rows, 1, 1, width))])
            channels = int(random.integers(1, 4))
            image = add("Conv", [image, constant(short(channels, 1, 1, 3)), constant(short(channels))], pads=[0, 1, 0, 1])
            image = add("BatchNormalization", [image, *(constant(short(channels)) for _ in range(3)), constant(np.abs(short(channels)) + np.float32(0.5))])
            name, width = add("Squeeze", [add("GlobalAveragePool", [image]), constant(integers(2, 3))]), channels
        elif kind == 9:
            power = add("Pow", [add("Mul", [name, name]), constant(np.float32(random.choice([0.5, 1.0, 2.0])))])
            name = add("Tanh", [power])
        elif kind == 10:
            first = int(random.integers(1, width)) if width > 1 else 1
            if first == width:
                continue
            parts = [f"p{len(nodes)}", f"q{len(nodes)}"]
            nodes.append(node("Split", [name, constant(integers(first, width - first))], parts, axis=1))
            name = add("Concat", [add("Relu", [parts[0]]), parts[1]], axis=1)
        elif kind == 11:
            picks = random.integers(0, width, int(random.integers(2, 8)))
            name, width = add("Gather", [name, constant(integers(*picks))], axis=1), len(picks)
        elif kind == 12:
            turned = add("Transpose", [name], perm=[1, 0])
            mean = add("ReduceMean", [turned], axes=[0], keepdims=1)
            name = add("Transpose", [add("Sub", [turned, mean])], perm=[1, 0])
        elif kind == 13:
            size = add("Shape", [name])
            row = add("Constant", [], value=numpy_helper.from_array(short(1, width)))
            name = add("Add", [name, add("Expand", [row, size])])
        elif kind == 14:
            factor = add("Cast", [add("Gather", [add("Shape", [name]), constant(np.int64(1))], axis=0)], to=TensorProto.FLOAT)
            name = add("Div", [name, factor])
        else:
            other, more = dense(name, width)
            weights = add("Softmax", [other], axis=-1)
            mean = add("ReduceMean", [name], axes=[1])
            name, width = add("Mul", [weights, mean]), more
    name, _ = dense(name, width)
    nodes.append(node("Identity", [name]))
    return case(f"network {index}", nodes, [("x", x)], constants)


def exact(case):
    """Returns the outputs of a case in double precision."""
    model = onnx.load_from_string(bytes.fromhex(case["model"]))
    wide = lambda tensor: tensor.CopyFrom(numpy_helper.from_array(numpy_helper.to_array(tensor).astype(np.float64), tensor.name))
    for tensor in model.graph.initializer:
        if tensor.data_type == TensorProto.FLOAT:
            wide(tensor)
    for node in model.graph.node:
        for attribute in node.attribute:
            if attribute.name == "value":
                wide(attribute.t)
            if node.op_type == "Cast":
                attribute.i = TensorProto.DOUBLE
    for value in [*model.graph.input, *model.graph.output]:
        value.type.tensor_type.elem_type = TensorProto.DOUBLE
    inputs = {value.name: np.array(tensor["values"]).reshape(tensor["shape"]) for value, tensor in zip(model.graph.input, case["inputs"])}
    return ReferenceEvaluator(model).run(None, inputs)


def is_accurate(case):
    found = [np.array(tensor["values"]).reshape(tensor["shape"]) for tensor in case["outputs"]]
    return all(np.max(np.abs(y - t) / np.maximum(1, np.abs(t))) < 1e-6 for y, t in zip(found, exact(case)))


def networks(count):
    index = 0
    while count > 0:
        found = network(index)
        index += 1
        if is_accurate(found):
            count -= 1
            yield found
        else:
            print("left out:", found["name"])


def main():
    kind, output = sys.argv[1:3]
    cases = list(operators()) if kind == "operators" else list(networks(int(sys.argv[3])))
    text = "[\n" + ",\n".join(json.dumps(case, separators=(",", ":")) for case in cases) + "\n]\n"
    if kind == "networks":
        used = {node.op_type for case in cases for node in onnx.load_from_string(bytes.fromhex(case["model"])).graph.node}
        print(len(cases), "networks of", len(used), "operators:", *sorted(used))
    with open(output, "wb") as file:
        file.write(zlib.compress(text.encode(), 9) if output.endswith(".zlib") else text.encode())


main()
