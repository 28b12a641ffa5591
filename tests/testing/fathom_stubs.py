"""Makes the generated Python stubs importable in a test.

Build them first: `ninja -C build/dev fathom_python_proto`. Then

    import fathom_stubs
    fathom_stubs.use("build/dev/python")
    from fathom.v1 import obstacle_service_pb2_grpc
    from grpc.health.v1 import health_pb2_grpc

Run tests with Debian's interpreter (/usr/bin/python3): python3-grpcio and
python3-protobuf belong to it.
"""

import os
import sys


def use(python_dir):
    """Puts the stubs in `python_dir` on the import path.

    The installed `grpc` is a regular package, which hides a folder of the same
    name; grpc/health is therefore added to the package's own path.
    """
    python_dir = os.path.abspath(python_dir)
    if not os.path.isdir(os.path.join(python_dir, "fathom")):
        raise FileNotFoundError(
            f"no stubs in {python_dir}: build target fathom_python_proto")
    if python_dir not in sys.path:
        sys.path.insert(0, python_dir)
    import grpc  # pylint: disable=import-outside-toplevel
    grpc_dir = os.path.join(python_dir, "grpc")
    if grpc_dir not in grpc.__path__:
        grpc.__path__.append(grpc_dir)
