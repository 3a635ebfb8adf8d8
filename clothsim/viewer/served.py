"""Page that is served until it is closed."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import viser


@contextmanager
def silent() -> Iterator[None]:
    """Keep viser from printing of itself."""
    import rich

    console = rich.get_console()
    before, console.quiet = console.quiet, True
    try:
        yield
    finally:
        console.quiet = before


class Served:
    """Address and end of a page.

    Attributes
    ----------
    server : viser.ViserServer
        Server of the page.
    """

    server: "viser.ViserServer"
    _closed: threading.Event

    @property
    def url(self) -> str:
        """Address of the page."""
        return f"http://{self.server.get_host()}:{self.server.get_port()}"

    def _repr_html_(self) -> str:
        """The page within a notebook."""
        return f'<iframe src="{self.url}" width="100%" height="560" style="border:0"></iframe>'

    def close(self) -> None:
        """End the server."""
        self._closed.set()
        with silent():
            self.server.stop()

    def wait(self) -> None:
        """Serve until Ctrl-C."""
        try:
            while not self._closed.wait(0.5):
                pass
        except KeyboardInterrupt:
            self.close()
