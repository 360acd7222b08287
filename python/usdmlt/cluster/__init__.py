"""Renders on a cluster of Dask: work units mapped over workers, and their films summed.

One process, the client, plans the render and keeps the ledger of units: which are handed out, to
whom, and in which sum they are. A unit that is lost with its worker is handed out again; what a
worker gives that has been declared lost is of no sum. So each unit counts once, and the picture has
the same bits as one machine's.

:mod:`.connection` finds a scheduler or starts one here; :mod:`.crew` knows the workers;
:mod:`.shipping` sends scenes; :mod:`.worker` is what workers run; :mod:`.ledger` is the account of
one picture; :mod:`.rendering` hands out units until all pictures are done.
"""
