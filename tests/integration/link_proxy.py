"""A TCP link to a server that a test can cut."""

import socket
import threading


class LinkProxy:
    """Forwards 127.0.0.1:`port` to `to`, which may change between connections.
    The first `cuts` connections are cut by themselves after so many bytes from
    the client; `made` counts them. While the server is away, a connection is
    taken and closed."""

    def __init__(self, address, cuts=0, after_bytes=0):
        host, port = address.rsplit(":", 1)
        self.to = (host, int(port))
        self.left = cuts
        self.after_bytes = after_bytes
        self.made = 0
        self.accepted = 0
        self.sockets = []
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.address = f"127.0.0.1:{self.listener.getsockname()[1]}"
        threading.Thread(target=self._accept, daemon=True).start()

    def _accept(self):
        while True:
            try:
                near, _ = self.listener.accept()
            except OSError:
                return
            try:
                far = socket.create_connection(self.to)
            except OSError:
                near.close()
                continue
            self.accepted += 1
            self.sockets += [near, far]
            limit = self.after_bytes if self.left > 0 else None
            self.left -= limit is not None
            threading.Thread(target=self._carry, args=(near, far, limit),
                             daemon=True).start()
            threading.Thread(target=self._carry, args=(far, near, None),
                             daemon=True).start()

    def _carry(self, source, sink, limit):
        """Until either end is gone, or what the limit allows was carried."""
        carried = 0
        try:
            while chunk := source.recv(16384):
                carried += len(chunk)
                if limit is not None and carried > limit:
                    self.made += 1
                    break
                sink.sendall(chunk)
        except OSError:
            pass
        self._shut(source, sink)

    @staticmethod
    def _shut(*ends):
        for end in ends:
            try:
                end.shutdown(socket.SHUT_RDWR)
            except OSError:
                pass

    def cut(self):
        """All connections there are."""
        sockets, self.sockets = self.sockets, []
        self._shut(*sockets)
        for end in sockets:
            end.close()

    def close(self):
        self.listener.close()
        self.cut()
