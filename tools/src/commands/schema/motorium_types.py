"""The built-in states of motorium for iceoryx2's Python wheel, as `motorium schema python` prints them.

Units and meanings: the page "Ports, state buffers, parameters" of the book. Of the arrays of a `JointState` or a
`JointCommand` only the first `count` entries mean anything.
"""

import ctypes
import os
import pathlib
import typing

import iceoryx2


def join(run):
    """A node in the domain of a running graph: by the run's name, or a prefix of it."""
    user = os.getuid()
    places = [pathlib.Path(os.environ.get("XDG_RUNTIME_DIR", f"/run/user/{user}")) / "motorium"]
    places.append(pathlib.Path(f"/dev/shm/motorium-{user}"))
    found = sorted(
        folder for runs in places if runs.is_dir() for folder in runs.glob(f"{run}*") if (folder / "iox2").is_dir()
    )
    if len(found) != 1:
        raise LookupError(f"{len(found)} runs in {places[0]} and {places[1]} begin with {run!r}")
    config = iceoryx2.config.default()
    config.global_cfg.root_path = iceoryx2.Path.new(str(found[0] / "iox2"))
    config.global_cfg.prefix = iceoryx2.FileName.new(f"mt_{found[0].name}_")
    return iceoryx2.NodeBuilder.new().config(config).create(iceoryx2.ServiceType.Ipc)


def service(node, name, kind, stream=False):
    """The publish-subscribe service `out/TOPIC` or `in/TOPIC` of a bridge, for values of the class `kind`.

    For slices, `kind` is `iceoryx2.Slice[CLASS]`. A topic that is fed as a stream of single values needs `stream=True`.
    """
    builder = node.service_builder(iceoryx2.ServiceName.new(name)).publish_subscribe(kind)
    has_stamp = name.startswith("out/") or stream or typing.get_origin(kind) is iceoryx2.Slice
    return (builder.user_header(Stamp) if has_stamp else builder).open()
