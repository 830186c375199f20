"""Generates encoder.json: outputs and gradients of a network with convolutions, by PyTorch in double precision.

    pip install torch
    python components/models/tests/golden/encoder.py components/models/tests/golden/encoder.json

An image of 2 channels, 5 rows and 6 columns, then 3 other inputs; two convolutions with ReLU; layers of 4 and 2
units with tanh between them. All numbers are sines of their index, in the order of `Perceptron::to_vec`.
"""

import json
import sys

import torch

torch.set_default_dtype(torch.float64)


def numbers(count, first, scale):
    return scale * torch.sin(1.7 * torch.arange(first, first + count, dtype=torch.float64) + 0.3)


def take(parameters, first, count):
    return parameters[first : first + count], first + count


samples = 3
input = numbers(samples * 63, 5, 1.0).reshape(samples, 63).requires_grad_()
convolutions = [(2, 3, 3, 2, 1), (3, 4, 2, 1, 0)]  # channels, filters, kernel, stride, padding
layers = [(4 * 2 * 2 + 3, 4), (4, 2)]
total = sum(c * f * k * k + f for c, f, k, _, _ in convolutions) + sum(i * o + o for i, o in layers)
parameters = numbers(total, 900, 0.5).requires_grad_()
image, first = input[:, :60].reshape(samples, 2, 5, 6), 0
for c, f, k, stride, padding in convolutions:
    weights, first = take(parameters, first, c * f * k * k)
    bias, first = take(parameters, first, f)
    # rows, columns, channels, filters -> filters, channels, rows, columns
    weights = weights.reshape(k, k, c, f).permute(3, 2, 0, 1)
    image = torch.relu(torch.nn.functional.conv2d(image, weights, bias, stride, padding))
values = torch.cat([image.flatten(1), input[:, 60:]], 1)
for index, (i, o) in enumerate(layers):
    weights, first = take(parameters, first, i * o)
    bias, first = take(parameters, first, o)
    values = (torch.tanh(values) if index else values) @ weights.reshape(i, o) + bias
loss = (values * numbers(samples * 2, 40, 1.0).reshape(samples, 2)).sum()
loss.backward()
rounded = lambda tensor: [round(float(value), 9) for value in tensor.detach().flatten()]
json.dump(
    {"outputs": rounded(values), "inputs": rounded(input.grad), "parameters": rounded(parameters.grad)},
    open(sys.argv[1], "w"),
)
print(total, "parameters,", int((image > 0).sum()), "of", image.numel(), "values above 0")
