"""Renders on a cluster of Dask: work units mapped over workers, and their films summed.

One process, the client, plans the render and keeps the ledger of units: which are handed out, to
whom, and in which sum they are. A unit that is lost with its worker is handed out again; what a
worker gives that has been declared lost is of no sum. So each unit counts once, and the picture has
the same bits as one machine's.

:mod:`.connection` finds a scheduler or starts one here; :mod:`.crew` knows the workers;
:mod:`.shipping` sends scenes; :mod:`.worker` is what workers run; :mod:`.ledger` is the account of
one picture; :mod:`.rendering` hands out units until all pictures are done.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from distributed import Client

    from usdmlt.checkpoint import Checkpoint
    from usdmlt.previews import Preview
    from usdmlt.rendering import Progress, Rendering


def render(
    client: Client,
    rendering: Rendering,
    progress: Callable[[Progress], None] | None = None,
    stop: Callable[[], bool] | None = None,
    previews: Sequence[Preview] = (),
    checkpoint: Checkpoint | None = None,
) -> None:
    """Render what is left of a rendering on the workers of a client, as :meth:`Rendering.run`
    does here.

    :class:`usdmlt.Error` where that fails; the rendering then has what was collected.
    """
    from usdmlt.cluster.picture import Picture
    from usdmlt.cluster.rendering import pictures

    picture = Picture(rendering, 0, None, progress, checkpoint, previews)
    for _ in pictures(client, [picture], stop):
        pass
    if picture.failure is not None:
        raise picture.failure
