"""Times onnxruntime, GPy, scikit-learn and hmmlearn: reads a name a line, answers with the nanoseconds of processor
time of one call.

    pip install -r benches/peers/models.txt
"""

import warnings

import numpy as np

from turns import serve

POSES, OUTPUTS, LATENTS, POINTS, INPUTS = 200, 14, 2, 200, 6
LAYERS = [48, 256, 128, 64, 12]
STATES, COLUMNS, LENGTH = 8, 3, 500
PARAMETERS = [0.1, 0.2, -0.3, -4.0]


def values(rows, columns, phase):
    i = np.arange(rows * columns).reshape(rows, columns)
    row, column = i // columns, i % columns
    return np.sin(0.37 * row + 1.3 * column + phase) + 0.1 * np.cos(5.1 * i)


def onnx_runtime():
    import onnx
    import onnxruntime
    from onnx import TensorProto, helper, numpy_helper

    random, nodes, weights, last = np.random.default_rng(1), [], [], "obs"
    for index, (inputs, outputs) in enumerate(zip(LAYERS[:-1], LAYERS[1:])):
        matrix = random.normal(size=(outputs, inputs)).astype(np.float32) / np.sqrt(inputs, dtype=np.float32)
        weights.append(numpy_helper.from_array(matrix, f"w{index}"))
        weights.append(numpy_helper.from_array(np.full(outputs, 0.1, np.float32), f"b{index}"))
        nodes.append(helper.make_node("Gemm", [last, f"w{index}", f"b{index}"], [f"l{index}"], transB=1))
        last = f"l{index}"
        if index + 2 < len(LAYERS):
            nodes.append(helper.make_node("Elu", [last], [f"a{index}"]))
            last = f"a{index}"
    port = lambda name, width: helper.make_tensor_value_info(name, TensorProto.FLOAT, [1, width])
    graph = helper.make_graph(nodes, "mlp", [port("obs", LAYERS[0])], [port(last, LAYERS[-1])], weights)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    session = onnxruntime.InferenceSession(model.SerializeToString(), options, ["CPUExecutionProvider"])
    # inputs and outputs are bound once: the call is the inference alone
    binding = session.io_binding()
    observation = onnxruntime.OrtValue.ortvalue_from_numpy(
        np.linspace(-2.0, 2.0, LAYERS[0], dtype=np.float32)[None]
    )
    action = onnxruntime.OrtValue.ortvalue_from_numpy(np.zeros((1, LAYERS[-1]), np.float32))
    binding.bind_ortvalue_input("obs", observation)
    binding.bind_ortvalue_output(last, action)

    def outputs(path):
        session = onnxruntime.InferenceSession(path, options, ["CPUExecutionProvider"])
        inputs = (0.1 * np.arange(LAYERS[0], dtype=np.float32) - np.float32(2.0))[None]
        return session.run(None, {session.get_inputs()[0].name: inputs})[0].ravel()

    return {"mlp_inference": lambda: session.run_with_iobinding(binding)}, {"mlp_outputs": outputs}


def gpy():
    import GPy

    poses = values(POSES, OUTPUTS, 0.1)
    poses = (poses - poses.mean(0)) / poses.std(0)

    def model():
        return GPy.models.GPLVM(poses, LATENTS, kernel=GPy.kern.RBF(LATENTS, ARD=True))

    def train():
        made = model()
        made.optimize("lbfgsb", max_iters=100)
        return made

    first, trained = model(), train()
    parameters = first.optimizer_array.copy()
    pose = values(1, OUTPUTS, 0.55)

    def gradient():
        # GPy returns immediately if the parameters equal those from the last call
        parameters[0] += 1e-9
        first._objective_grads(parameters)

    x, y = values(POSES, LATENTS, 0.4), values(POSES, OUTPUTS, 0.1)
    variance, *lengths, noise = np.exp(PARAMETERS)
    given = GPy.models.GPLVM(y, LATENTS, X=x.copy(), kernel=GPy.kern.RBF(LATENTS, variance, lengths, ARD=True))
    given.likelihood.variance = noise

    def gradients():
        # by the points, then by the logarithms of the parameters
        slope, value = -np.array(given._log_likelihood_gradients()), np.array(given.param_array)
        return np.concatenate([slope[: x.size], slope[x.size :] * value[x.size :]])

    works = {
        "gplvm_gradient": gradient,
        "gplvm_100_iterations": train,
        "gplvm_latent_of_pose": lambda: trained.infer_newX(pose, optimize=True),
    }
    return works, {"gplvm_energy": lambda: [-float(given.log_likelihood())], "gplvm_gradients": gradients}


def scikit_learn():
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import ConstantKernel, Matern, WhiteKernel

    x, y = values(POINTS, INPUTS, 0.4), values(POINTS, 1, 0.1)[:, 0]
    kernel = ConstantKernel(1.0) * Matern(np.ones(INPUTS), nu=2.5) + WhiteKernel(0.1)
    fixed = GaussianProcessRegressor(kernel, optimizer=None).fit(x, y)
    one = x[:1]

    return {
        "gp_fit": lambda: GaussianProcessRegressor(kernel).fit(x, y),
        # it has no update: a point added is a new factorisation
        "gp_point_added": lambda: GaussianProcessRegressor(kernel, optimizer=None).fit(x, y),
        "gp_prediction": lambda: fixed.predict(one, return_std=True),
    }


def hmm_learn():
    from hmmlearn.hmm import GaussianHMM

    model = GaussianHMM(STATES, covariance_type="full")
    model.startprob_ = np.full(STATES, 1.0 / STATES)
    model.transmat_ = 0.9 * np.eye(STATES) + 0.1 * np.roll(np.eye(STATES), 1, axis=1)
    model.means_ = np.sin(0.9 * np.arange(STATES * COLUMNS)).reshape(STATES, COLUMNS)
    model.covars_ = np.tile(0.25 * np.eye(COLUMNS) + 0.05, (STATES, 1, 1))
    sequence = values(LENGTH, COLUMNS, 0.3)
    works = {
        "hmm_log_likelihood": lambda: model.score(sequence),
        "hmm_viterbi": lambda: model.decode(sequence, algorithm="viterbi"),
    }
    numbers = {
        "hmm_log_likelihood": lambda: [model.score(sequence)],
        "hmm_viterbi": lambda: model.decode(sequence, algorithm="viterbi")[1],
    }
    return works, numbers


warnings.filterwarnings("ignore")
serve({"onnxruntime": onnx_runtime, "GPy": gpy, "scikit-learn": scikit_learn, "hmmlearn": hmm_learn})
